//! A hierarchy whose triangles have moved: the same records with other boxes and corners. Rays that pass it take longer the farther
//! they have moved, which is little while a shutter is open, and building it anew takes many times as long.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

use glam::Vec3;
use obvhs::aabb::Aabb;
use rayon::prelude::*;

use super::bvh::{Bvh, PlacedMesh};
use crate::layout::{BvhInstance, BvhNode, BvhTriangle, LEAF, PLACEMENT_RECORD};
use crate::scene::{SHARED, Scene};

/// Whether a hierarchy's order of triangles is one of this scene's.
pub fn is_of(order: &[u32], shared: &[Range<u32>], scene: &Scene, ranges: &[Range<u32>]) -> bool {
    let own = shared.first().map_or(order.len(), |shared| shared.start as usize);
    let object = |index: &u32| scene.triangles.get(*index as usize).map(|triangle| triangle.object);
    let are_own = order[..own]
        .iter()
        .all(|index| object(index).is_some_and(|object| object != SHARED));
    let are_shared = |(packed, range): (&Range<u32>, &Range<u32>)| {
        let order = &order[packed.start as usize..packed.end as usize];
        packed.len() == range.len() && order.iter().all(|index| range.contains(index))
    };
    own == scene.own_triangles().count()
        && are_own
        && shared.len() == ranges.len()
        && shared.iter().zip(ranges).all(are_shared)
}

/// The hierarchy of a scene whose triangles it [is of](is_of), and of its instances, as many as before.
pub fn refit(before: Bvh, scene: &Scene, placed: &[PlacedMesh]) -> Bvh {
    let boxes = placed.par_iter().map(|PlacedMesh { shared, placement }| {
        let range = &before.shared[*shared];
        let triangles = &before.order[range.start as usize..range.end as usize];
        let corners = triangles.iter().flat_map(|&index| scene.corners_of(index));
        around(corners.map(|corner| placement.point(corner)))
    });
    let mut fit = Fit {
        boxes: boxes.collect(),
        bvh: before,
        scene,
        placed,
    };
    let mut roots = BTreeSet::from([0]);
    let mut done = BTreeSet::new();
    while let Some(root) = roots.pop_first() {
        if done.insert(root) {
            fit.hierarchy(root, &mut roots);
        }
    }
    fit.bvh
}

/// The lower corner of a box that no ray enters, which stays.
const NOTHING: [f32; 3] = [1e30; 3];

fn around(points: impl Iterator<Item = Vec3>) -> Aabb {
    points.fold(Aabb::empty(), |mut bounds, point| {
        bounds.extend(point.into());
        bounds
    })
}

struct Fit<'a> {
    bvh: Bvh,
    scene: &'a Scene,
    placed: &'a [PlacedMesh],
    /// Of the instances.
    boxes: Vec<Aabb>,
}

impl Fit<'_> {
    /// Refits the hierarchy below a root. `roots`: takes those of the instances in it.
    fn hierarchy(&mut self, root: usize, roots: &mut BTreeSet<usize>) {
        // Parents come before their children.
        let mut nodes = vec![root];
        let mut next = 0;
        while next < nodes.len() {
            let node = self.bvh.records[nodes[next]].node();
            let children = [node.left, node.right].into_iter().filter(|child| child & LEAF == 0);
            nodes.extend(children.map(|child| child as usize));
            next += 1;
        }
        let mut boxes = HashMap::new();
        for &index in nodes.iter().rev() {
            let mut node = self.bvh.records[index].node();
            let BvhNode { left, right, .. } = node;
            let mut of_child = |child: u32, low: [f32; 3], high: [f32; 3]| {
                if low == NOTHING {
                    return Aabb::new(low.into(), high.into());
                }
                if child & LEAF == 0 {
                    boxes.remove(&child).unwrap_or(Aabb::empty())
                } else {
                    self.leaf((child & !LEAF) as usize, roots)
                }
            };
            let of_left = of_child(left, node.left_low, node.left_high);
            let of_right = of_child(right, node.right_low, node.right_high);
            (node.left_low, node.left_high) = (of_left.min.into(), of_left.max.into());
            (node.right_low, node.right_high) = (of_right.min.into(), of_right.max.into());
            self.bvh.records[index] = node.into();
            let both = if node.right_low == NOTHING {
                of_left
            } else {
                of_left.union(&of_right)
            };
            boxes.insert(index as u32, both);
        }
    }

    /// Moves the triangles of a leaf, or its instance; returns its box.
    fn leaf(&mut self, first: usize, roots: &mut BTreeSet<usize>) -> Aabb {
        let placement = self.bvh.records[first].instance();
        if placement.kind == PLACEMENT_RECORD {
            let instance = placement.index as usize;
            let (inverse, widening) = self.placed[instance].placement.inverse();
            let rows = self.placed[instance].placement.rows;
            self.bvh.records[first] = BvhInstance { rows, ..placement }.into();
            let ray = self.bvh.records[first + 1].instance();
            roots.insert(ray.index as usize);
            let rows = inverse;
            self.bvh.records[first + 1] = BvhInstance { rows, widening, ..ray }.into();
            return self.boxes[instance];
        }
        let mut bounds = Aabb::empty();
        for record in &mut self.bvh.records[first..] {
            let triangle = record.triangle();
            let corners = self.scene.corners_of(self.bvh.order[triangle.index as usize]);
            let [p0, p1, p2] = corners.map(|corner| corner.to_array());
            *record = BvhTriangle { p0, p1, p2, ..triangle }.into();
            bounds = bounds.union(&around(corners.into_iter()));
            if triangle.last == 1 {
                break;
            }
        }
        bounds
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3A;

    use super::super::bvh::build;
    use super::super::shared_triangles;
    use super::*;
    use crate::layout::BvhRecord;

    fn scene(name: &str) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        Scene::load(&path).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Every record as it is built: boxes, triangles and instances alike.
    #[test]
    fn where_nothing_moves_nothing_changes() {
        for name in ["cornell.gltf", "cornell-spheres.gltf", "instances.gltf", "slab.gltf"] {
            let scene = scene(name);
            let shared = shared_triangles(&scene);
            let bvh = build(&scene, &shared.ranges, &shared.placed).unwrap_or_else(|error| panic!("{error}"));
            assert!(is_of(&bvh.order, &bvh.shared, &scene, &shared.ranges), "{name}");
            let again = refit(bvh.clone(), &scene, &shared.placed);
            let bytes = |records: &[BvhRecord]| bytemuck::cast_slice::<_, u8>(records).to_vec();
            assert!(bytes(&again.records) == bytes(&bvh.records), "{name}");
        }
    }

    #[test]
    fn boxes_contain_what_has_moved() {
        let mut scene = scene("cornell-spheres.gltf");
        let shared = shared_triangles(&scene);
        let bvh = build(&scene, &shared.ranges, &shared.placed).unwrap_or_else(|error| panic!("{error}"));
        for (number, position) in scene.positions.iter_mut().enumerate() {
            *position += 0.2
                * Vec3::new(
                    (number as f32).sin(),
                    (2.0 * number as f32).sin(),
                    (3.0 * number as f32).sin(),
                );
        }
        let moved = refit(bvh.clone(), &scene, &shared.placed);
        // Each node's boxes contain those below, and leaves' boxes their triangles.
        let mut stack = vec![(0, Aabb::new(Vec3A::splat(-9.0), Vec3A::splat(9.0)))];
        let mut triangles = 0;
        while let Some((reference, outer)) = stack.pop() {
            let contains = |inner: &Aabb| inner.min.cmpge(outer.min).all() && inner.max.cmple(outer.max).all();
            if reference & LEAF == 0 {
                let node = moved.records[reference as usize].node();
                for (child, low, high) in [
                    (node.left, node.left_low, node.left_high),
                    (node.right, node.right_low, node.right_high),
                ] {
                    let inner = Aabb::new(low.into(), high.into());
                    assert!(contains(&inner), "{inner:?} in {outer:?}");
                    stack.push((child, inner));
                }
                continue;
            }
            for record in &moved.records[(reference & !LEAF) as usize..] {
                let triangle = record.triangle();
                let corners = scene.corners_of(moved.order[triangle.index as usize]);
                assert_eq!(
                    [triangle.p0, triangle.p1, triangle.p2],
                    corners.map(|corner| corner.to_array())
                );
                assert!(contains(&around(corners.into_iter())));
                triangles += 1;
                if triangle.last == 1 {
                    break;
                }
            }
        }
        assert_eq!(triangles, scene.triangles.len());
    }
}
