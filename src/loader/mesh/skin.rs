//! Skins: transforms of vertices by joints (glTF 2.0, section 3.7.3).

use std::collections::HashMap;
use std::rc::Rc;

use glam::DAffine3;

use crate::loader::diagnostic::{Check, damaged, label};
use crate::loader::file::accessor::{FLOATS, Vectors};
use crate::loader::file::document::Document;
use crate::loader::graph::{PlacedNode, affine_from, node_label};

/// For each joint of a skin, the map from the mesh's space to world space.
pub(crate) type JointMatrices = Rc<[DAffine3]>;

/// The skins of a file, each built at its first use.
pub(crate) struct Skins<'a> {
    document: &'a Document,
    nodes: &'a [PlacedNode<'a>],
    /// Index in `nodes` by index in the file.
    places: HashMap<usize, usize>,
    made: HashMap<usize, JointMatrices>,
}

impl<'a> Skins<'a> {
    /// The skins of a file whose scene has these nodes.
    pub(crate) fn new(document: &'a Document, nodes: &'a [PlacedNode<'a>]) -> Self {
        let places = nodes.iter().enumerate().map(|(place, node)| (node.index, place));
        Self {
            document,
            nodes,
            places: places.collect(),
            made: HashMap::new(),
        }
    }

    /// The matrices of the skin at `index`. The transform of the mesh's node is ignored.
    pub(crate) fn matrices(&mut self, index: usize) -> Check<JointMatrices> {
        if let Some(matrices) = self.made.get(&index) {
            return Ok(matrices.clone());
        }
        let matrices = self.make(index)?;
        self.made.insert(index, matrices.clone());
        Ok(matrices)
    }

    fn make(&self, index: usize) -> Check<JointMatrices> {
        let root = &self.document.root;
        let skin = root.skins.get(index).ok_or_else(|| {
            let skins = root.skins.len();
            damaged(format_args!("there is no skin {index}, the file has {skins}"))
        })?;
        let fail = |what: String| format!("{}: {what}", label("skin", index, skin.name.as_deref()));
        let inverse_binds = skin
            .inverse_bind_matrices
            .map(|index| Vectors::<16>::open(self.document, index, &FLOATS))
            .transpose()
            .map_err(|what| fail(format!("inverseBindMatrices, {what}")))?;
        if let Some(matrices) = inverse_binds
            && matrices.len() < skin.joints.len()
        {
            let (matrices, joints) = (matrices.len(), skin.joints.len());
            return Err(fail(damaged(format_args!("{matrices} matrices for {joints} joints"))));
        }
        let joints = skin.joints.iter().enumerate();
        let matrices = joints.map(|(joint, node)| {
            let Some(&place) = self.places.get(&node.value()) else {
                let node = node_label(root, node.value());
                return Err(fail(damaged(format_args!(
                    "its joint {joint}, {node}, isn't in the scene"
                ))));
            };
            let inverse_bind = match inverse_binds {
                Some(matrices) => affine_from(matrices.get(joint)).map_err(&fail)?,
                None => DAffine3::IDENTITY,
            };
            Ok(self.nodes[place].to_world * inverse_bind)
        });
        matrices.collect()
    }
}
