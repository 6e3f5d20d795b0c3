//! The files that a command writes.

use std::path::{Path, PathBuf};
use std::{fs, iter};

use anyhow::{Error, Result, bail, ensure};

use super::advice;
use ppm_vk::internals::files::check_writable;
use ppm_vk::{Look, Rendered};

/// The identities of a path: two paths are the same file if any of these is equal.
struct Place {
    /// The entry in its folder, which writing replaces.
    entry: PathBuf,
    /// The target of a link.
    file: Option<PathBuf>,
    /// The file system's number, common to all its hard links.
    number: Option<(u64, u64)>,
}

impl Place {
    fn of(path: &Path) -> Self {
        let folder = match path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        let absolute = || std::path::absolute(path).unwrap_or(path.to_owned());
        let entry = match (folder.canonicalize(), path.file_name()) {
            (Ok(folder), Some(name)) => folder.join(name),
            _ => absolute(),
        };
        Self {
            entry: as_compared(entry),
            file: path.canonicalize().ok().map(as_compared),
            number: number(path),
        }
    }

    fn is(&self, other: &Self) -> bool {
        let names = |place: &Self, name: &PathBuf| place.entry == *name || place.file.as_ref() == Some(name);
        names(other, &self.entry)
            || self.file.as_ref().is_some_and(|file| names(other, file))
            || self.number.is_some() && self.number == other.number
    }
}

/// On systems whose file systems usually ignore case, the comparison does too.
fn as_compared(path: PathBuf) -> PathBuf {
    if cfg!(any(windows, target_os = "macos")) {
        path.to_string_lossy().to_lowercase().into()
    } else {
        path
    }
}

#[cfg(unix)]
fn number(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt as _;
    fs::metadata(path).ok().map(|metadata| (metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn number(_: &Path) -> Option<(u64, u64)> {
    None
}

/// Fails if two outputs, or an output and an input, are one file, or if an output can't be written.
pub fn check_outputs<'a>(inputs: &[&Path], outputs: impl Iterator<Item = &'a Path>) -> Result<()> {
    let outputs: Vec<&Path> = outputs.collect();
    let mut taken: Vec<_> = inputs.iter().map(|input| (*input, "reads", Place::of(input))).collect();
    for output in &outputs {
        let place = Place::of(output);
        if let Some((other, what, _)) = taken.iter().find(|(.., other)| place.is(other)) {
            bail!(
                "{}: would overwrite {}, which this command {what}; name another file",
                output.display(),
                other.display()
            );
        }
        taken.push((output, "writes too", place));
    }
    outputs.into_iter().try_for_each(|output| Ok(check_writable(output)?))
}

/// The picture files of a command.
#[derive(Debug, Clone)]
pub struct PictureFiles {
    pub exr: PathBuf,
    pub png: Option<PathBuf>,
    pub view_layer: Option<String>,
    pub look: Look,
}

impl PictureFiles {
    /// Writes each, even if another fails; `written` is called for each that is written.
    pub fn write(&self, rendered: &Rendered, written: impl Fn(&Path)) -> Vec<Result<()>> {
        let tell = |result: ppm_vk::Result<()>, file: &Path| result.map(|()| written(file)).map_err(Error::from);
        let exr = tell(
            rendered.write_view_layer(&self.exr, self.view_layer.as_deref()),
            &self.exr,
        );
        let png = self.png.as_deref();
        let png = png.map(|file| tell(rendered.write_png(file, self.look), file));
        iter::once(exr).chain(png).collect()
    }
}

/// Fails if any of these failed, with all failures in one line: one failed output does not stop the others.
pub fn all(written: impl IntoIterator<Item = Result<()>>) -> Result<()> {
    let failures = written.into_iter().filter_map(Result::err);
    let failures: Vec<String> = failures.map(|error| advice::line(&error)).collect();
    ensure!(failures.is_empty(), "{}", failures.join("; "));
    Ok(())
}

/// Formats by file name endings.
const ENDINGS: [&str; 13] = [
    "exr", "hdr", "png", "jpg", "jpeg", "webp", "svg", "json", "csv", "gltf", "glb", "bin", "state",
];

/// A parser of file names for one format: names with the ending of another format are refused.
pub fn named(format: &'static str) -> impl Fn(&str) -> Result<PathBuf, String> + Clone {
    move |name| {
        let path = PathBuf::from(name);
        let ending = path
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .to_ascii_lowercase();
        if ending != format && ENDINGS.contains(&ending.as_str()) {
            return Err(format!(
                "{} is written, not {}: name a file that ends in .{format}",
                format.to_uppercase(),
                ending.to_uppercase()
            ));
        }
        Ok(path)
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn a_file_is_known_by_any_of_its_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("d")).expect("a folder");
        symlink(at("d"), at("link-to-d")).expect("a link");
        fs::write(at("a.exr"), "a").expect("a file");
        symlink(at("a.exr"), at("link")).expect("a link");
        fs::hard_link(at("a.exr"), at("d/hard")).expect("a link");
        symlink(at("b.exr"), at("to-nothing")).expect("a link");
        let is = |one: &str, other: &str| Place::of(&at(one)).is(&Place::of(&at(other)));
        for (one, other) in [
            ("a.exr", "a.exr"),
            ("a.exr", "link"),
            ("link", "d/hard"),
            ("a.exr", "d/../a.exr"),
            // Files that do not exist yet.
            ("b.exr", "d/../b.exr"),
            ("d/c.exr", "link-to-d/c.exr"),
            ("./b.exr", "b.exr"),
        ] {
            assert!(is(one, other) && is(other, one), "{one} is {other}");
        }
        for (one, other) in [("a.exr", "b.exr"), ("b.exr", "d/b.exr"), ("to-nothing", "a.exr")] {
            assert!(!is(one, other), "{one} isn't {other}");
        }
    }
}
