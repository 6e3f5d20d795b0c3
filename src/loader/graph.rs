//! The node hierarchy: the nodes of a scene and their transforms to world space.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf_json::{Node, Root};

use super::animation::{NodePose, Pose};
use super::diagnostic::{Check, damaged, label};
use super::scenes;
use crate::scene::Remark;

/// Tolerance of the last row of a node's matrix, 0 0 0 1.
const AFFINE_TOLERANCE: f64 = 1e-5;

/// A node of the scene with its global transform.
pub(crate) struct PlacedNode<'a> {
    /// Index in the file.
    pub index: usize,
    /// The node.
    pub node: &'a Node,
    /// From the node's space to world space.
    pub to_world: DAffine3,
    /// The same without the node's own scale, for cameras.
    pub unscaled_to_world: DAffine3,
}

/// Every node of the scene chosen by [`scenes::choose`], parents before children, depth first in the file's order.
///
/// Without a scene, all trees of nodes.
pub(crate) fn place_nodes<'a>(
    root: &'a Root,
    pose: &Pose<'_>,
    scene: Option<&str>,
    notes: &mut Vec<Remark>,
) -> Check<Vec<PlacedNode<'a>>> {
    let parents = check_forest(root)?;
    let scene = scenes::choose(root, &parents, scene, notes)?;
    // Siblings are pushed in reverse. Recursion would overflow on a long chain.
    let mut stack: Vec<(usize, DAffine3)> = scene_roots(root, &parents, scene)?
        .into_iter()
        .rev()
        .map(|index| (index, DAffine3::IDENTITY))
        .collect();
    let mut placed = Vec::new();
    while let Some((index, parent_to_world)) = stack.pop() {
        let node = &root.nodes[index];
        let local = LocalTransform::of(node, pose.node(index))
            .map_err(|what| format!("{}: {what}", node_label(root, index)))?;
        let to_world = parent_to_world * local.full;
        if !to_world.is_finite() {
            return Err(format!(
                "{}: its place in the world is out of floating-point range; correct the scales above it",
                node_label(root, index)
            ));
        }
        for child in node.children.iter().flatten().rev() {
            stack.push((child.value(), to_world));
        }
        placed.push(PlacedNode {
            index,
            node,
            to_world,
            unscaled_to_world: parent_to_world * local.unscaled,
        });
    }
    Ok(placed)
}

/// `node 3 "name"`.
pub(crate) fn node_label(root: &Root, index: usize) -> String {
    let name = root.nodes.get(index).and_then(|node| node.name.as_deref());
    label("node", index, name)
}

/// Checks that the nodes form trees: children exist, none has two parents, and there is no cycle.
///
/// Returns the parent of each node that has one.
fn check_forest(root: &Root) -> Check<Vec<Option<usize>>> {
    let mut parents: Vec<Option<usize>> = vec![None; root.nodes.len()];
    for (index, node) in root.nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            let parent = parents.get_mut(child.value()).ok_or_else(|| {
                damaged(format_args!(
                    "{}: it has the child {child}, but the file has {} nodes",
                    node_label(root, index),
                    root.nodes.len()
                ))
            })?;
            if let Some(other) = parent.replace(index) {
                return Err(damaged(format_args!(
                    "{}: it is a child of both node {other} and node {index}",
                    node_label(root, child.value())
                )));
            }
        }
    }
    // Since each has one parent, the nodes that can't be reached from a root are exactly those on and below cycles.
    let mut reached: Vec<bool> = parents.iter().map(Option::is_none).collect();
    let mut stack: Vec<usize> = (0..reached.len()).filter(|&index| reached[index]).collect();
    while let Some(index) = stack.pop() {
        for child in root.nodes[index].children.iter().flatten() {
            reached[child.value()] = true;
            stack.push(child.value());
        }
    }
    if let Some(index) = reached.iter().position(|reached| !reached) {
        return Err(damaged(format_args!(
            "{}: it is part of a cycle, or below one: no node may be its own ancestor",
            node_label(root, index)
        )));
    }
    Ok(parents)
}

fn scene_roots(root: &Root, parents: &[Option<usize>], scene: Option<usize>) -> Check<Vec<usize>> {
    let Some(index) = scene else {
        return Ok((0..root.nodes.len()).filter(|&node| parents[node].is_none()).collect());
    };
    let scene = &root.scenes[index];
    let mut listed = vec![false; root.nodes.len()];
    for node in &scene.nodes {
        let fault = match listed.get_mut(node.value()) {
            None => format!("but the file has {} nodes", root.nodes.len()),
            Some(true) => "twice".to_owned(),
            Some(_) if parents[node.value()].is_some() => "which is the child of another node".to_owned(),
            Some(listed) => {
                *listed = true;
                continue;
            }
        };
        let scene = label("scene", index, scene.name.as_deref());
        return Err(damaged(format_args!("{scene}: it lists node {node}, {fault}")));
    }
    Ok(scene.nodes.iter().map(|node| node.value()).collect())
}

/// A node's transform relative to its parent.
struct LocalTransform {
    full: DAffine3,
    /// Without the scale, if translation, rotation and scale are given separately.
    unscaled: DAffine3,
}

impl LocalTransform {
    /// The file's values, except those set by an animation.
    fn of(node: &Node, pose: Option<&NodePose<'_>>) -> Check<Self> {
        if let Some(matrix) = &node.matrix {
            let full = affine_from(matrix.map(f64::from))?;
            return Ok(Self { full, unscaled: full });
        }
        let translation = DVec3::from_array(widen("translation", node.translation.unwrap_or_default())?);
        let scale = DVec3::from_array(widen("scale", node.scale.unwrap_or([1.0; 3]))?);
        let rotation = DQuat::from_array(widen("rotation", node.rotation.unwrap_or_default().0)?);
        if rotation.length_squared() == 0.0 {
            return Err(damaged("its rotation is the quaternion 0 0 0 0"));
        }
        let translation = pose.and_then(|pose| pose.translation).unwrap_or(translation);
        let scale = pose.and_then(|pose| pose.scale).unwrap_or(scale);
        let rotation = pose.and_then(|pose| pose.rotation).unwrap_or(rotation.normalize());
        Ok(Self {
            full: DAffine3::from_scale_rotation_translation(scale, rotation, translation),
            unscaled: DAffine3::from_rotation_translation(rotation, translation),
        })
    }
}

/// The affine map of a column-major 4×4 matrix.
pub(crate) fn affine_from(m: [f64; 16]) -> Check<DAffine3> {
    if m.iter().any(|entry| !entry.is_finite()) {
        return Err(damaged("its matrix isn't finite"));
    }
    let last_row = [m[3], m[7], m[11], m[15] - 1.0];
    if last_row.iter().any(|entry| entry.abs() > AFFINE_TOLERANCE) {
        return Err(damaged("its matrix isn't affine: the last row must be 0 0 0 1"));
    }
    let column = |at: usize| DVec3::new(m[at], m[at + 1], m[at + 2]);
    let linear = DMat3::from_cols(column(0), column(4), column(8));
    Ok(DAffine3::from_mat3_translation(linear, column(12)))
}

fn widen<const N: usize>(what: &str, values: [f32; N]) -> Check<[f64; N]> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(values.map(f64::from))
    } else {
        Err(damaged(format_args!("its {what} isn't finite")))
    }
}
