//! The library's errors. Each message says in one line what is wrong, where, and what to do about it.

use std::path::{Path, PathBuf};

/// Result of a library function.
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can go wrong outside the program's own logic.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A scene file that can't be read, is damaged, or lacks something that rendering needs.
    #[error("{}: {what}", path.display())]
    Scene {
        /// The scene file.
        path: PathBuf,
        /// What is wrong, where in the file, and what to do.
        what: String,
    },
    /// A setting outside its range.
    #[error("{0}")]
    Config(String),
    /// A file that can't be read or written.
    #[error("{}: {what}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What failed, and what to do.
        what: String,
    },
    /// No usable Vulkan loader or device, or one that lacks what the program needs.
    #[error("{0}")]
    Device(String),
    /// A Vulkan call that failed.
    #[error("Vulkan: {call} failed: {code}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// The driver's result code.
        code: String,
    },
}

impl Error {
    /// An error about the scene file at `path`.
    pub fn scene(path: &Path, what: impl Into<String>) -> Self {
        Self::Scene {
            path: path.to_owned(),
            what: one_line(what.into()),
        }
    }

    /// An error about reading or writing the file at `path`.
    pub fn file(path: &Path, what: impl Into<String>) -> Self {
        Self::File {
            path: path.to_owned(),
            what: one_line(what.into()),
        }
    }
}

/// A message as one line: those of decoders may have several, or end with a line end.
pub(crate) fn one_line(text: String) -> String {
    if !text.contains(['\n', '\r']) {
        return text;
    }
    let lines: Vec<&str> = text
        .split(['\n', '\r'])
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    lines.join(" ")
}
