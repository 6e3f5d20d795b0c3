//! The bounding volume hierarchy: built by obvhs, packed for the device with both children's boxes in their parent and
//! the triangles of leaves among the nodes.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::triangle::Triangle;

use crate::layout::{BvhRecord, LEAF};

/// Entries of the traversal's stack in `glsl/shared/intersect.glsl`, and so levels of inner nodes at the most.
const STACK_SIZE: u32 = 64;
/// Triangles of a leaf at the most.
const LEAF_TRIANGLES: u32 = 4;
/// Triangles at the most: the device counts four texels a record, and records are fewer than twice the triangles.
const MOST_TRIANGLES: usize = 1 << 28;
/// Levels that are taken as they were built. Where boxes overlap, as those of slivers do, the builder may split off one
/// triangle at a time; what lies deeper is split in halves, which takes one level for each bit of their number.
const BUILT_LEVELS: u32 = STACK_SIZE - MOST_TRIANGLES.ilog2();

/// A hierarchy over triangles.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// The root first, which is an inner node.
    pub records: Vec<BvhRecord>,
    /// Old index of each triangle in the order of the leaves.
    pub order: Vec<u32>,
}

/// Builds the hierarchy over triangles given by their corners.
///
/// # Errors
/// A text, if there are too many triangles.
pub fn build(corners: &[[Vec3; 3]]) -> Result<Bvh, String> {
    if corners.len() > MOST_TRIANGLES {
        return Err(format!(
            "it has {} triangles, {MOST_TRIANGLES} at most are supported",
            corners.len()
        ));
    }
    let triangles: Vec<Triangle> = corners
        .iter()
        .map(|c| Triangle {
            v0: c[0].into(),
            v1: c[1].into(),
            v2: c[2].into(),
        })
        .collect();
    let parameters = BvhBuildParams {
        max_prims_per_leaf: LEAF_TRIANGLES,
        pre_split: false,
        ..BvhBuildParams::slow_build()
    };
    let tree = build_bvh2_from_tris(&triangles, parameters, &mut Duration::default());
    let mut packed = Packed {
        tree: &tree,
        triangles: &triangles,
        bvh: Bvh {
            records: Vec::new(),
            order: Vec::with_capacity(triangles.len()),
        },
    };
    packed.pack();
    Ok(packed.bvh)
}

struct Packed<'a> {
    tree: &'a Bvh2,
    triangles: &'a [Triangle],
    bvh: Bvh,
}

/// A part of the hierarchy that is still to be packed.
enum Subtree {
    /// A node of the built tree.
    Built(usize),
    /// Triangles to be split in halves.
    Halves(Vec<u32>),
}

/// An inner node that is still to be packed.
struct Pending {
    children: [Subtree; 2],
    /// The record that refers to it, and whether as its right child.
    parent: Option<(usize, bool)>,
    level: u32,
}

impl Packed<'_> {
    /// Packs the tree depth first, so that near nodes lie near each other.
    fn pack(&mut self) {
        let root = self.cut(Subtree::Built(0), 0);
        let children = match self.leaf(&root) {
            // A root of one leaf gets a sibling without triangles.
            Some(_) => [root, Subtree::Halves(Vec::new())],
            None => self.split(root, 0),
        };
        let mut stack = vec![Pending {
            children,
            parent: None,
            level: 0,
        }];
        while let Some(Pending {
            children,
            parent,
            level,
        }) = stack.pop()
        {
            let me = self.bvh.records.len();
            if let Some((parent, right)) = parent {
                self.refer(parent, right, me as u32);
            }
            let [left, right] = [&children[0], &children[1]].map(|child| self.bounds(child));
            self.push_node(&left, &right);
            let [left, right] = children;
            // The left subtree follows its parent: it is pushed last.
            for (child, is_right) in [(right, true), (left, false)] {
                if let Some(triangles) = self.leaf(&child) {
                    let reference = LEAF | self.bvh.records.len() as u32;
                    self.refer(me, is_right, reference);
                    self.push_leaf(&triangles);
                } else {
                    stack.push(Pending {
                        children: self.split(child, level + 1),
                        parent: Some((me, is_right)),
                        level: level + 1,
                    });
                }
            }
        }
    }

    /// The triangles of a subtree that is a leaf.
    fn leaf(&self, subtree: &Subtree) -> Option<Vec<u32>> {
        match subtree {
            Subtree::Built(index) => {
                let node = &self.tree.nodes[*index];
                node.is_leaf().then(|| self.triangles_of_leaf(*index).to_vec())
            }
            Subtree::Halves(triangles) => (triangles.len() <= LEAF_TRIANGLES as usize).then(|| triangles.clone()),
        }
    }

    fn triangles_of_leaf(&self, index: usize) -> &[u32] {
        let node = &self.tree.nodes[index];
        let first = node.first_index as usize;
        &self.tree.primitive_indices[first..first + node.prim_count as usize]
    }

    fn bounds(&self, subtree: &Subtree) -> Aabb {
        match subtree {
            Subtree::Built(index) => *self.tree.nodes[*index].aabb(),
            Subtree::Halves(triangles) if triangles.is_empty() => NOTHING,
            Subtree::Halves(triangles) => triangles.iter().fold(Aabb::empty(), |bounds, &triangle| {
                bounds.union(&self.triangles[triangle as usize].aabb())
            }),
        }
    }

    /// The subtree itself, or its triangles if it lies too deep.
    fn cut(&self, subtree: Subtree, level: u32) -> Subtree {
        let Subtree::Built(index) = subtree else { return subtree };
        if level < BUILT_LEVELS {
            return subtree;
        }
        let (mut triangles, mut stack) = (Vec::new(), vec![index]);
        while let Some(index) = stack.pop() {
            let node = &self.tree.nodes[index];
            if node.is_leaf() {
                triangles.extend_from_slice(self.triangles_of_leaf(index));
            } else {
                stack.extend([node.first_index as usize + 1, node.first_index as usize]);
            }
        }
        Subtree::Halves(triangles)
    }

    /// The children of an inner node of this level.
    fn split(&self, subtree: Subtree, level: u32) -> [Subtree; 2] {
        match subtree {
            Subtree::Built(index) => {
                let first = self.tree.nodes[index].first_index as usize;
                [first, first + 1].map(|child| self.cut(Subtree::Built(child), level + 1))
            }
            Subtree::Halves(mut triangles) => {
                let centre = |triangle: u32| self.triangles[triangle as usize].aabb().center();
                let bounds = triangles.iter().fold(Aabb::empty(), |mut bounds, &triangle| {
                    bounds.extend(centre(triangle));
                    bounds
                });
                let axis = bounds.largest_axis();
                let middle = triangles.len() / 2;
                triangles.select_nth_unstable_by(middle, |&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]));
                let right = triangles.split_off(middle);
                [Subtree::Halves(triangles), Subtree::Halves(right)]
            }
        }
    }

    fn push_node(&mut self, left: &Aabb, right: &Aabb) {
        let row = |corner: Vec3A| [corner.x, corner.y, corner.z, 0.0];
        self.bvh.records.push(BvhRecord {
            row0: row(left.min),
            row1: row(left.max),
            row2: row(right.min),
            row3: row(right.max),
        });
    }

    fn push_leaf(&mut self, triangles: &[u32]) {
        for (number, &triangle) in triangles.iter().enumerate() {
            let corners = &self.triangles[triangle as usize];
            let [row0, row1, row2] =
                [corners.v0, corners.v1, corners.v2].map(|corner| [corner.x, corner.y, corner.z, 0.0]);
            let index = self.bvh.order.len() as u32;
            let last = u32::from(number + 1 == triangles.len());
            self.bvh.records.push(BvhRecord {
                row0,
                row1,
                row2,
                row3: [f32::from_bits(index), f32::from_bits(last), 0.0, 0.0],
            });
            self.bvh.order.push(triangle);
        }
    }

    fn refer(&mut self, node: usize, right: bool, reference: u32) {
        let node = &mut self.bvh.records[node];
        let row = if right { &mut node.row2 } else { &mut node.row0 };
        row[3] = f32::from_bits(reference);
    }
}

/// A box that no ray enters.
const NOTHING: Aabb = Aabb {
    min: Vec3A::splat(1e30),
    max: Vec3A::splat(1e30),
};
