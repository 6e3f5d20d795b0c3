//! File access: only regular files are read; written files are complete or absent.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, is_separator};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::NamedTempFile;

/// Number of active writers.
static WRITERS: Mutex<usize> = Mutex::new(0);

fn writers() -> MutexGuard<'static, usize> {
    WRITERS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// While one is alive, [`unless_writing`] does nothing.
#[derive(Debug)]
pub struct Writing(());

impl Writing {
    /// Marks a write as active.
    pub fn begin() -> Self {
        *writers() += 1;
        Self(())
    }
}

impl Drop for Writing {
    fn drop(&mut self) {
        *writers() -= 1;
    }
}

/// Calls `end`, which ends the process, unless a write is active, so that no temporary file is left behind. No write begins
/// meanwhile.
pub fn unless_writing(end: impl FnOnce()) {
    let writers = writers();
    if *writers == 0 {
        end();
    }
}

/// Opens a file for reading.
///
/// # Errors
/// A file that can't be opened or is not a regular file: opening a pipe would wait for a writer, and a device may be endless.
pub fn open(path: &Path) -> Result<File> {
    let unopened = |error: io::Error| {
        Error::file(
            path,
            format!("can't be opened ({error}): check the path and its permissions"),
        )
    };
    if !fs::metadata(path).map_err(unopened)?.is_file() {
        return Err(Error::file(
            path,
            "can't be opened: it is no regular file; give the path of one",
        ));
    }
    File::open(path).map_err(unopened)
}

/// Checks that a file can be written at `path`, and leaves nothing behind; for use before a long render.
///
/// # Errors
/// A path without a file name, a folder, or another file that is not regular; a file that may not be overwritten; a folder that
/// does not exist or can't be written to.
pub fn check_writable(path: &Path) -> Result<()> {
    let _writing = Writing::begin();
    temporary_beside(path).map(drop)
}

/// Writes `bytes` to `path` atomically: to a temporary file in the same folder, which is then renamed.
///
/// # Errors
/// As [`check_writable`]; further if the disk is full.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole_by(path, |file| file.write_all(bytes))
}

/// The same for what `write` writes.
///
/// # Errors
/// As [`write_whole`].
pub fn write_whole_by(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<()> {
    let failed = |error: io::Error| {
        Error::file(
            path,
            format!("can't be written ({error}): check the disk's free space and permissions"),
        )
    };
    let _writing = Writing::begin();
    let mut temporary = temporary_beside(path)?;
    write(temporary.as_file_mut()).map_err(failed)?;
    // Otherwise a power failure soon after the renaming could leave an empty file.
    temporary.as_file().sync_all().map_err(failed)?;
    temporary.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}

/// A temporary file in `path`'s folder, deleted when dropped, after checking that it can be renamed to `path`.
fn temporary_beside(path: &Path) -> Result<NamedTempFile> {
    let unwritable = |what: String| Error::file(path, format!("can't be written: {what}"));
    let names_a_folder = path.to_string_lossy().ends_with(is_separator);
    if names_a_folder || path.file_name().is_none() || path.is_dir() {
        return Err(unwritable("it names a folder; name a file in it".to_owned()));
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(unwritable(format!(
            "there is no folder {}; create it or name another",
            folder.display()
        )));
    }
    match fs::metadata(path) {
        // Renaming would replace a device or a pipe (/dev/null!) by a file.
        Ok(existing) if !existing.is_file() => {
            return Err(unwritable("it is no regular file; name another".to_owned()));
        }
        // Renaming needs permission for the folder, not for the file.
        Ok(_) => {
            File::options()
                .write(true)
                .open(path)
                .map_err(|error| unwritable(format!("{error}; change its permissions or name another")))?;
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(unwritable(format!("{error}; name another"))),
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".ppm-vk-");
    // Temporary files are private to their owner, and renaming keeps that; the umask still applies to this mode.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|error| {
        unwritable(format!(
            "no file can be created in the folder {} ({}); change its permissions or name another",
            folder.display(),
            error.kind()
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;
    use tempfile::tempdir;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let folder = tempdir().expect("a temporary folder");
        let path = folder.path().join("out");
        for content in ["a first, longer content", "a second"] {
            write_whole(&path, content.as_bytes()).expect("a file");
            assert_eq!(fs::read_to_string(&path).expect("a file"), content);
        }
        assert_eq!(names(folder.path()), ["out"]);
    }

    #[test]
    fn checking_a_path_changes_nothing() {
        let folder = tempdir().expect("a temporary folder");
        let old = folder.path().join("old");
        fs::write(&old, "content").expect("a file");
        check_writable(&old).expect("writable");
        check_writable(&folder.path().join("new")).expect("writable");
        assert_eq!(fs::read_to_string(&old).expect("a file"), "content");
        assert_eq!(names(folder.path()), ["old"]);
    }

    #[test]
    fn an_unwritable_path_is_one_clear_line_before_and_after_the_work() {
        let folder = tempdir().expect("a temporary folder");
        let folder = folder.path();
        let file = folder.join("file");
        fs::write(&file, "").expect("a file");
        let mut cases = vec![
            (folder.to_owned(), "it names a folder"),
            (folder.join("new/"), "it names a folder"),
            (PathBuf::new(), "it names a folder"),
            (folder.join("missing/out.exr"), "there is no folder"),
            (file.join("out.exr"), "there is no folder"),
            (folder.join("x".repeat(300)), "name another"),
        ];
        if cfg!(target_os = "linux") {
            cases.push(("/dev/null".into(), "no regular file"));
            cases.push(("/proc/out.exr".into(), "no file can be created in the folder /proc"));
        }
        for (path, expected) in cases {
            let error = |result: Result<()>| result.expect_err("an error").to_string();
            let checked = error(check_writable(&path));
            assert!(
                checked.contains(expected) && !checked.contains('\n'),
                "{}: {checked}",
                path.display()
            );
            assert_eq!(error(write_whole(&path, b"content")), checked);
        }
        assert_eq!(names(folder), ["file"]);
    }

    #[test]
    fn nothing_ends_the_process_while_a_file_is_written() {
        let mut ended = false;
        let first = Writing::begin();
        let second = Writing::begin();
        drop(first);
        unless_writing(|| ended = true);
        assert!(!ended, "one writer of two is still at work");
        drop(second);
        // Other tests write too: sooner or later none does.
        while !ended {
            unless_writing(|| ended = true);
        }
    }

    #[test]
    fn what_is_no_regular_file_is_not_opened() {
        let folder = tempdir().expect("a temporary folder");
        let mut paths = vec![folder.path().to_owned()];
        if cfg!(unix) {
            let pipe = folder.path().join("pipe");
            let made = std::process::Command::new("mkfifo").arg(&pipe).status();
            assert!(made.expect("mkfifo").success());
            paths.extend([pipe, "/dev/zero".into()]);
        }
        for path in paths {
            let error = open(&path).expect_err("no regular file").to_string();
            assert!(error.contains("it is no regular file"), "{error}");
        }
        let error = open(&folder.path().join("none")).expect_err("no file").to_string();
        assert!(error.contains("can't be opened"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_has_the_mode_of_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempdir().expect("a temporary folder");
        let (whole, plain) = (folder.path().join("whole"), folder.path().join("plain"));
        write_whole(&whole, b"").expect("a file");
        fs::write(&plain, "").expect("a file");
        let mode = |path: &Path| fs::metadata(path).expect("a file").permissions().mode();
        assert_eq!(mode(&whole), mode(&plain), "the temporary file's mode stayed");
    }
}
