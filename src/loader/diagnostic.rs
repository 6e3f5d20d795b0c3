//! Texts of errors and warnings about a scene file: one line each, for any names in the file.

use std::collections::HashSet;
use std::fmt::Display;

use gltf_json::Mesh;

use crate::scene::Remark;
use crate::text::quote;

/// Result of a step of loading. The message says what is wrong, where and how to fix it; `Scene::load` adds the path.
pub(crate) type Check<T> = std::result::Result<T, String>;

/// The location of an item in the file: `mesh 3 "floor"`.
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
    lines: Vec<Remark>,
    seen: HashSet<String>,
}

impl Warnings {
    /// Adds a line unless it is present already, as for a mesh of several nodes.
    pub(crate) fn push(&mut self, text: String) {
        self.add(text.into());
    }

    /// The same for a remark.
    pub(crate) fn add(&mut self, warning: Remark) {
        if self.seen.insert(warning.text().to_owned()) {
            self.lines.push(warning);
        }
    }

    /// The lines.
    pub(crate) fn into_lines(self) -> Vec<Remark> {
        self.lines
    }
}
