//! The wording of errors and warnings about a scene file: one line each, whatever the names in the file look like.

use std::collections::HashSet;
use std::fmt::Display;

use gltf::json::Mesh;

use crate::error::one_line;
use crate::text::quote;

/// Result of a step of loading. The message says what is wrong, where and what to do; `Scene::load` adds the path.
pub(crate) type Check<T> = std::result::Result<T, String>;

/// Where something is in the file: `mesh 3 "floor"`.
pub(crate) fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) => format!("{kind} {index} {}", quote(name)),
        None => format!("{kind} {index}"),
    }
}

/// `mesh 1 "name", primitive 0`.
pub(crate) fn primitive_label(mesh_index: usize, mesh: &Mesh, primitive_index: usize) -> String {
    let mesh = label("mesh", mesh_index, mesh.name.as_deref());
    format!("{mesh}, primitive {primitive_index}")
}

/// The message for something that no correct exporter writes.
pub(crate) fn damaged(what: impl Display) -> String {
    format!("{what}; the file is damaged or was written wrongly: export it again")
}

/// Warnings in the order in which they arose, each text once.
#[derive(Default)]
pub(crate) struct Warnings {
    lines: Vec<String>,
    seen: HashSet<String>,
}

impl Warnings {
    /// Adds a line unless it is there already, as it is for a mesh that several nodes show.
    pub(crate) fn push(&mut self, text: String) {
        let line = one_line(text);
        if self.seen.insert(line.clone()) {
            self.lines.push(line);
        }
    }

    /// The lines.
    pub(crate) fn into_lines(self) -> Vec<String> {
        self.lines
    }
}
