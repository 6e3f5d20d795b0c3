//! The bounding volume hierarchy: built by obvhs, packed for the device with both children's boxes in their parent.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::triangle::Triangle;

use crate::layout::BvhNode;

/// Entries of the traversal's stack in `glsl/shared/intersect.glsl`.
const STACK_SIZE: usize = 64;

/// A hierarchy over triangles.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// Nodes, the root first. A leaf is described in its parent.
    pub nodes: Vec<BvhNode>,
    /// Old index of each triangle in the order of the leaves.
    pub order: Vec<u32>,
}

/// Builds the hierarchy over triangles given by their corners.
///
/// # Errors
/// A text, if the hierarchy is deeper than the traversal's stack.
pub fn build(corners: &[[Vec3; 3]]) -> Result<Bvh, String> {
    let triangles: Vec<Triangle> = corners
        .iter()
        .map(|c| Triangle {
            v0: c[0].into(),
            v1: c[1].into(),
            v2: c[2].into(),
        })
        .collect();
    let parameters = BvhBuildParams {
        max_prims_per_leaf: 4,
        pre_split: false,
        ..BvhBuildParams::slow_build()
    };
    let tree = build_bvh2_from_tris(&triangles, parameters, &mut Duration::default());

    let mut packed = Packed {
        tree: &tree,
        nodes: Vec::new(),
    };
    let depth = packed.pack();
    if depth > STACK_SIZE {
        return Err(format!(
            "its bounding volume hierarchy is {depth} levels deep, {STACK_SIZE} at most are supported"
        ));
    }
    Ok(Bvh {
        nodes: packed.nodes,
        order: tree.primitive_indices.clone(),
    })
}

struct Packed<'a> {
    tree: &'a Bvh2,
    nodes: Vec<BvhNode>,
}

/// An inner node of the tree that is still to be packed.
struct Pending {
    index: usize,
    /// The packed node that refers to it, and whether as its right child.
    parent: Option<(usize, bool)>,
    depth: usize,
}

/// A child that no ray enters.
fn nothing() -> ([f32; 4], [f32; 4]) {
    ([1e30, 1e30, 1e30, 0.0], [1e30, 1e30, 1e30, f32::from_bits(1)])
}

impl Packed<'_> {
    /// Packs the tree depth first, so that near nodes lie near each other; returns its depth.
    fn pack(&mut self) -> usize {
        let root = &self.tree.nodes[0];
        if root.is_leaf() {
            let (left_min, left_max) = corners(root.aabb(), root.first_index, root.prim_count);
            let (right_min, right_max) = nothing();
            // The empty child is a leaf of no reachable triangle.
            self.nodes.push(BvhNode {
                left_min,
                left_max,
                right_min,
                right_max,
            });
            return 1;
        }
        let mut deepest = 0;
        let mut stack = vec![Pending {
            index: 0,
            parent: None,
            depth: 1,
        }];
        while let Some(Pending { index, parent, depth }) = stack.pop() {
            deepest = deepest.max(depth);
            let me = self.nodes.len();
            if let Some((parent, right)) = parent {
                let node = &mut self.nodes[parent];
                let reference = if right {
                    &mut node.right_min[3]
                } else {
                    &mut node.left_min[3]
                };
                *reference = f32::from_bits(me as u32);
            }
            let first = self.tree.nodes[index].first_index as usize;
            let (left, right) = (&self.tree.nodes[first], &self.tree.nodes[first + 1]);
            let (left_min, left_max) = corners(left.aabb(), left.first_index, left.prim_count);
            let (right_min, right_max) = corners(right.aabb(), right.first_index, right.prim_count);
            self.nodes.push(BvhNode {
                left_min,
                left_max,
                right_min,
                right_max,
            });
            if !right.is_leaf() {
                stack.push(Pending {
                    index: first + 1,
                    parent: Some((me, true)),
                    depth: depth + 1,
                });
            }
            if !left.is_leaf() {
                stack.push(Pending {
                    index: first,
                    parent: Some((me, false)),
                    depth: depth + 1,
                });
            }
        }
        deepest
    }
}

fn corners(bounds: &Aabb, first: u32, count: u32) -> ([f32; 4], [f32; 4]) {
    let with = |corner: Vec3A, word: u32| [corner.x, corner.y, corner.z, f32::from_bits(word)];
    (with(bounds.min, first), with(bounds.max, count))
}
