//! The wording of errors and warnings about a scene file: one line each, whatever the names in the file look like.

use std::collections::HashSet;
use std::fmt::Display;

use crate::error::one_line;

/// Result of a step of loading. The message says what is wrong, where and what to do; `Scene::load` adds the path.
pub(super) type Check<T> = std::result::Result<T, String>;

/// Characters of a name or URI that are kept: a file may hold megabytes of them, and repeat them per instance.
const MAX_NAME: usize = 120;

/// How many items a list in a message spells out.
const MAX_LISTED: usize = 8;

/// `name`, cut where it is longer than any sensible name.
pub(super) fn shorten(name: &str) -> String {
    match name.char_indices().nth(MAX_NAME) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.to_owned(),
    }
}

/// `name` in quotation marks, with line ends and control characters escaped.
pub(super) fn quote(name: &str) -> String {
    format!("{:?}", shorten(name))
}

/// Where something is in the file: `mesh 3 "floor"`.
pub(super) fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) => format!("{kind} {index} {}", quote(name)),
        None => format!("{kind} {index}"),
    }
}

/// The message for something that no correct exporter writes.
pub(super) fn damaged(what: impl Display) -> String {
    format!("{what}; the file is damaged or was written wrongly: export it again")
}

/// `a, b and c`, or the first few `and 5 more`.
pub(super) fn list(items: &[String]) -> String {
    let (shown, rest) = items.split_at(items.len().min(MAX_LISTED));
    match (shown, rest.len()) {
        ([head @ .., last], 0) if !head.is_empty() => format!("{} and {last}", head.join(", ")),
        (shown, 0) => shown.join(", "),
        (shown, more) => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Warnings in the order in which they arose, each text once.
#[derive(Default)]
pub(super) struct Warnings {
    lines: Vec<String>,
    seen: HashSet<String>,
}

impl Warnings {
    /// Adds a line unless it is there already, as it is for a mesh that several nodes show.
    pub(super) fn push(&mut self, text: String) {
        let line = one_line(text);
        if self.seen.insert(line.clone()) {
            self.lines.push(line);
        }
    }

    /// The lines.
    pub(super) fn into_lines(self) -> Vec<String> {
        self.lines
    }
}
