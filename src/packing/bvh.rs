//! The bounding volume hierarchy: built by obvhs, packed for the device with both children's boxes in their parent and
//! the triangles of leaves among the nodes. Shared triangles have hierarchies of their own, which that of render space
//! refers to by instances.

use std::ops::Range;
use std::time::Duration;

use bytemuck::Zeroable;
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use rayon::prelude::*;

use crate::layout::{BvhInstance, BvhNode, BvhRecord, BvhTriangle, LEAF, PLACEMENT_RECORD, RAY_RECORD};
use crate::scene::{Placement, Scene};

/// Maximum number of levels of inner nodes, of both hierarchies that a ray is in together: the entries of the traversal's stack
/// in `glsl/trace/intersect.glsl`, except one that is written and never read.
const MOST_LEVELS: u32 = 63;
/// Maximum number of levels of shared triangles' hierarchies, if that of render space leaves them.
const SHARED_LEVELS: u32 = 40;
/// Maximum number of triangles in a leaf.
const LEAF_TRIANGLES: usize = 4;
/// Maximum number of triangles and instances: the device counts four texels per record, and there are fewer than three times as
/// many records.
const MOST_ITEMS: usize = 1 << 27;

/// A hierarchy over triangles and instances.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// The root first, which is an inner node.
    pub records: Vec<BvhRecord>,
    /// Index in the scene of each triangle in the order of the leaves: those in render space, then the shared ones.
    pub order: Vec<u32>,
    /// Shared triangles in that order, those of one primitive in each range.
    pub shared: Vec<Range<u32>>,
}

/// A placement of shared triangles.
pub struct PlacedMesh {
    /// Index of the range of shared triangles.
    pub shared: usize,
    /// The transform.
    pub placement: Placement,
}

/// Builds the hierarchy of a scene's own triangles and of instances of `shared` ranges of others.
///
/// # Errors
/// A text, if there are too many triangles.
pub fn build(scene: &Scene, shared: &[Range<u32>], instances: &[PlacedMesh]) -> Result<Bvh, String> {
    let own: Vec<u32> = scene.own_triangles().collect();
    let all = own.len() + shared.iter().map(Range::len).sum::<usize>();
    let items = all + instances.len();
    if items > MOST_ITEMS {
        return Err(format!("it has {items} triangles, {MOST_ITEMS} at most are supported"));
    }
    let mut bvh = Bvh {
        records: vec![bytemuck::Zeroable::zeroed()],
        order: own.clone(),
        shared: Vec::with_capacity(shared.len()),
    };
    let built: Vec<(Items, Bvh2)> = shared
        .par_iter()
        .map(|triangles| Items::new(scene, triangles.clone().collect(), Vec::new()).built())
        .collect();
    let top = own.len() + instances.len();
    let levels = SHARED_LEVELS.min(MOST_LEVELS - levels_of_halves(top));
    let (mut roots, mut deepest) = (Vec::new(), 0);
    for (items, tree) in &built {
        let first = bvh.order.len() as u32;
        let root = bvh.records.len();
        bvh.records.push(bytemuck::Zeroable::zeroed());
        deepest = deepest.max(Packing::new(&mut bvh, items, tree, levels, first).pack(root));
        bvh.shared.push(first..bvh.order.len() as u32);
        roots.push(root as u32);
    }
    let placed = instances.par_iter().map(|PlacedMesh { shared, placement }| Placed {
        root: roots[*shared],
        placement: *placement,
        bounds: bounds(
            built[*shared]
                .0
                .triangles
                .iter()
                .flat_map(|(_, corners)| corners.iter().map(|&corner| placement.point(corner))),
        ),
    });
    let (items, tree) = Items::new(scene, own, placed.collect()).built();
    Packing::new(&mut bvh, &items, &tree, MOST_LEVELS - deepest, 0).pack(0);
    Ok(bvh)
}

/// Levels of inner nodes over this number of triangles or instances, split in halves.
fn levels_of_halves(items: usize) -> u32 {
    items.max(1).next_power_of_two().ilog2()
}

fn bounds(points: impl Iterator<Item = Vec3>) -> Aabb {
    points.fold(Aabb::empty(), |mut bounds, point| {
        bounds.extend(point.into());
        bounds
    })
}

/// An instance in the hierarchy of render space.
struct Placed {
    root: u32,
    placement: Placement,
    bounds: Aabb,
}

/// The items of a hierarchy: triangles, then instances.
struct Items {
    /// Index in the scene, and corners.
    triangles: Vec<(u32, [Vec3; 3])>,
    instances: Vec<Placed>,
    bounds: Vec<Aabb>,
}

impl Items {
    fn new(scene: &Scene, triangles: Vec<u32>, instances: Vec<Placed>) -> Self {
        let triangles: Vec<_> = triangles
            .into_iter()
            .map(|index| (index, scene.corners_of(index)))
            .collect();
        let of_triangles = triangles.iter().map(|(_, corners)| bounds(corners.iter().copied()));
        Self {
            bounds: of_triangles
                .chain(instances.iter().map(|instance| instance.bounds))
                .collect(),
            triangles,
            instances,
        }
    }

    fn built(self) -> (Self, Bvh2) {
        let parameters = BvhBuildParams {
            max_prims_per_leaf: LEAF_TRIANGLES as u32,
            pre_split: false,
            ..BvhBuildParams::slow_build()
        };
        let tree = build_bvh2(&self.bounds, parameters, &mut Duration::default());
        (self, tree)
    }

    /// Whether these are the content of one leaf. An instance has a leaf of its own, so that a ray enters no other instance
    /// because of its box.
    fn fit_leaf(&self, items: &[u32]) -> bool {
        let only_triangles = items.iter().all(|&item| (item as usize) < self.triangles.len());
        items.len() <= if only_triangles { LEAF_TRIANGLES } else { 1 }
    }
}

struct Packing<'a> {
    bvh: &'a mut Bvh,
    items: &'a Items,
    tree: &'a Bvh2,
    /// Triangles and instances below each node of the tree.
    counts: Vec<usize>,
    /// Maximum number of levels of inner nodes.
    levels: u32,
    /// The next triangle in the order of the leaves.
    next: u32,
}

/// A part of the hierarchy that is not packed yet.
enum Subtree {
    /// A node of the built tree.
    Built(usize),
    /// Items to be split in halves.
    Halves(Vec<u32>),
}

/// An inner node that is not packed yet.
struct Pending {
    children: [Subtree; 2],
    /// The record that refers to it, and whether as its right child.
    parent: Option<(usize, bool)>,
    level: u32,
}

impl<'a> Packing<'a> {
    fn new(bvh: &'a mut Bvh, items: &'a Items, tree: &'a Bvh2, levels: u32, next: u32) -> Self {
        Self {
            bvh,
            items,
            tree,
            counts: counts(tree),
            levels,
            next,
        }
    }

    /// Packs the tree depth first, so that near nodes are near in memory; its root into an existing record. Returns the number of
    /// levels of inner nodes.
    fn pack(mut self, root_record: usize) -> u32 {
        let root = self.cut(Subtree::Built(0), 0);
        let children = match self.leaf(&root) {
            // A root of one leaf gets a sibling without triangles.
            Some(_) => [root, Subtree::Halves(Vec::new())],
            None => self.split(root, 0),
        };
        let mut levels = 0;
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
            levels = levels.max(level + 1);
            let [left, right] = [&children[0], &children[1]].map(|child| self.bounds(child));
            let node = node(&left, &right);
            let me = if let Some((parent, right)) = parent {
                let me = self.bvh.records.len();
                self.refer(parent, right, me as u32);
                self.bvh.records.push(node);
                me
            } else {
                self.bvh.records[root_record] = node;
                root_record
            };
            let [left, right] = children;
            // The left subtree follows its parent: it is pushed last.
            for (child, is_right) in [(right, true), (left, false)] {
                if let Some(items) = self.leaf(&child) {
                    let reference = LEAF | self.bvh.records.len() as u32;
                    self.refer(me, is_right, reference);
                    self.push_leaf(&items);
                } else {
                    stack.push(Pending {
                        children: self.split(child, level + 1),
                        parent: Some((me, is_right)),
                        level: level + 1,
                    });
                }
            }
        }
        levels
    }

    /// The items of a subtree that is a leaf.
    fn leaf(&self, subtree: &Subtree) -> Option<Vec<u32>> {
        match subtree {
            Subtree::Built(index) => {
                let node = &self.tree.nodes[*index];
                node.is_leaf().then(|| self.items_of_leaf(*index).to_vec())
            }
            Subtree::Halves(items) => self.items.fit_leaf(items).then(|| items.clone()),
        }
    }

    fn items_of_leaf(&self, index: usize) -> &[u32] {
        let node = &self.tree.nodes[index];
        let first = node.first_index as usize;
        &self.tree.primitive_indices[first..first + node.prim_count as usize]
    }

    fn bounds(&self, subtree: &Subtree) -> Aabb {
        match subtree {
            Subtree::Built(index) => *self.tree.nodes[*index].aabb(),
            Subtree::Halves(items) if items.is_empty() => NOTHING,
            Subtree::Halves(items) => items.iter().fold(Aabb::empty(), |bounds, &item| {
                bounds.union(&self.items.bounds[item as usize])
            }),
        }
    }

    /// The subtree itself, or its items to be split in halves: if it is so deep that only halves fit, which take one level for
    /// each bit of the number of items (where boxes overlap, as those of slivers do, the builder may split off one triangle at a
    /// time), and if a leaf has more than an instance.
    fn cut(&self, subtree: Subtree, level: u32) -> Subtree {
        let Subtree::Built(index) = subtree else { return subtree };
        let node = &self.tree.nodes[index];
        let is_whole = if node.is_leaf() {
            self.items.fit_leaf(self.items_of_leaf(index))
        } else {
            level + levels_of_halves(self.counts[index]) < self.levels
        };
        if is_whole {
            return subtree;
        }
        let (mut items, mut stack) = (Vec::new(), vec![index]);
        while let Some(index) = stack.pop() {
            let node = &self.tree.nodes[index];
            if node.is_leaf() {
                items.extend_from_slice(self.items_of_leaf(index));
            } else {
                stack.extend([node.first_index as usize + 1, node.first_index as usize]);
            }
        }
        Subtree::Halves(items)
    }

    /// The children of an inner node of this level.
    fn split(&self, subtree: Subtree, level: u32) -> [Subtree; 2] {
        match subtree {
            Subtree::Built(index) => {
                let first = self.tree.nodes[index].first_index as usize;
                [first, first + 1].map(|child| self.cut(Subtree::Built(child), level + 1))
            }
            Subtree::Halves(mut items) => {
                let centre = |item: u32| self.items.bounds[item as usize].center();
                let bounds = items.iter().fold(Aabb::empty(), |mut bounds, &item| {
                    bounds.extend(centre(item));
                    bounds
                });
                let axis = bounds.largest_axis();
                let middle = items.len() / 2;
                items.select_nth_unstable_by(middle, |&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]));
                let right = items.split_off(middle);
                [Subtree::Halves(items), Subtree::Halves(right)]
            }
        }
    }

    fn push_leaf(&mut self, items: &[u32]) {
        for (number, &item) in items.iter().enumerate() {
            let Some((index, corners)) = self.items.triangles.get(item as usize) else {
                self.push_instance(item as usize - self.items.triangles.len());
                continue;
            };
            let [p0, p1, p2] = corners.map(|corner| corner.to_array());
            self.bvh.records.push(BvhRecord::from(BvhTriangle {
                p0,
                p1,
                p2,
                index: self.next,
                last: u32::from(number + 1 == items.len()),
                ..BvhTriangle::zeroed()
            }));
            if let Some(place) = self.bvh.order.get_mut(self.next as usize) {
                *place = *index;
            } else {
                self.bvh.order.push(*index);
            }
            self.next += 1;
        }
    }

    fn push_instance(&mut self, index: usize) {
        let instance = &self.items.instances[index];
        let (inverse, widening) = instance.placement.inverse();
        let records = [
            (instance.placement.rows, index as u32, PLACEMENT_RECORD, 0.0),
            (inverse, instance.root, RAY_RECORD, widening),
        ];
        for (rows, index, kind, widening) in records {
            self.bvh.records.push(BvhRecord::from(BvhInstance {
                rows,
                index,
                last: 0,
                kind,
                widening,
            }));
        }
    }

    fn refer(&mut self, node: usize, right: bool, reference: u32) {
        let record = &mut self.bvh.records[node];
        let mut node = record.node();
        *if right { &mut node.right } else { &mut node.left } = reference;
        *record = node.into();
    }
}

fn node(left: &Aabb, right: &Aabb) -> BvhRecord {
    BvhRecord::from(BvhNode {
        left_low: left.min.into(),
        left_high: left.max.into(),
        right_low: right.min.into(),
        right_high: right.max.into(),
        ..BvhNode::zeroed()
    })
}

/// Items below each node of a tree.
fn counts(tree: &Bvh2) -> Vec<usize> {
    let mut counts = vec![0; tree.nodes.len()];
    let mut stack = vec![(0, false)];
    while let Some((index, is_done)) = stack.pop() {
        let node = &tree.nodes[index];
        let first = node.first_index as usize;
        if node.is_leaf() {
            counts[index] = node.prim_count as usize;
        } else if is_done {
            counts[index] = counts[first] + counts[first + 1];
        } else {
            stack.extend([(index, true), (first, false), (first + 1, false)]);
        }
    }
    counts
}

/// A box that no ray enters.
const NOTHING: Aabb = Aabb {
    min: Vec3A::splat(1e30),
    max: Vec3A::splat(1e30),
};
