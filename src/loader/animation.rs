//! Animations at a time: the properties of nodes that they set (glTF 2.0, section 3.11).

use std::collections::{HashMap, HashSet};

use glam::{DQuat, DVec3};
use gltf_json::animation::{Channel, Property};
use gltf_json::validation::Checked;
use gltf_json::{Animation, Root};

use super::curve::{Curve, Keyframes};
use super::diagnostic::{Check, Warnings, damaged, label};
use super::file::accessor::{ANIMATED_FRACTIONS, FLOATS};
use super::file::document::Document;
use super::graph::node_label;
use crate::text::list;

/// Properties set by animations, by node.
#[derive(Default)]
pub(crate) struct Pose<'a> {
    nodes: HashMap<usize, NodePose<'a>>,
}

/// Properties of a node set by animations; the others are those of the file.
#[derive(Default)]
pub(crate) struct NodePose<'a> {
    pub translation: Option<DVec3>,
    pub rotation: Option<DQuat>,
    pub scale: Option<DVec3>,
    /// One curve for all morph targets.
    pub weights: Option<Curve<'a, 1>>,
}

impl<'a> Pose<'a> {
    /// The pose at `time`, in seconds, by all animations of the file. Where two set the same property, the last does.
    pub(crate) fn at(document: &'a Document, time: f64, warnings: &mut Warnings) -> Check<Self> {
        let root = &document.root;
        let mut pose = Self::default();
        let mut owners: HashMap<(usize, &str), usize> = HashMap::new();
        let mut contested = Vec::new();
        let mut checked_times = HashSet::new();
        for (index, animation) in root.animations.iter().enumerate() {
            for (channel_index, channel) in animation.channels.iter().enumerate() {
                let target = pose
                    .apply(document, animation, channel, time, &mut checked_times, warnings)
                    .map_err(|what| format!("{}, channel {channel_index}: {what}", animation_label(root, index)))?;
                let Some((node, property)) = target else {
                    continue;
                };
                if let Some(other) = owners.insert((node, property), index) {
                    contested.push(format!(
                        "the {} of {} ({}, then {})",
                        property,
                        node_label(root, node),
                        animation_label(root, other),
                        animation_label(root, index)
                    ));
                }
            }
        }
        if !contested.is_empty() {
            warnings.push(format!(
                "several animations set the same property; the last one is used for {}",
                list(&contested)
            ));
        }
        Ok(pose)
    }

    /// What animations set of a node.
    pub(crate) fn node(&self, index: usize) -> Option<&NodePose<'a>> {
        self.nodes.get(&index)
    }

    /// Sets the property that a channel animates. Returns node and property, or `None` if there is nothing to set.
    fn apply(
        &mut self,
        document: &'a Document,
        animation: &Animation,
        channel: &Channel,
        time: f64,
        checked_times: &mut HashSet<usize>,
        warnings: &mut Warnings,
    ) -> Check<Option<(usize, &'static str)>> {
        let root = &document.root;
        let sampler = channel.sampler.value();
        let sampler = animation.samplers.get(sampler).ok_or_else(|| {
            let samplers = animation.samplers.len();
            damaged(format_args!(
                "there is no sampler {sampler}, the animation has {samplers}"
            ))
        })?;
        let index = channel.target.node.value();
        let node = root.nodes.get(index).ok_or_else(|| {
            let nodes = root.nodes.len();
            damaged(format_args!("there is no node {index}, the file has {nodes}"))
        })?;
        let Checked::Valid(property) = channel.target.path else {
            return Err(damaged("its path is not translation, rotation, scale or weights"));
        };
        if node.matrix.is_some() && property != Property::MorphTargetWeights {
            warnings.push(format!(
                "{}: it has a matrix, which animations can't move; it stays where it is at rest: export translation, rotation and scale \
                 instead",
                node_label(root, index)
            ));
            return Ok(None);
        }
        let targets = morph_targets(root, index);
        if property == Property::MorphTargetWeights && targets == 0 {
            return Ok(None);
        }
        let keyframes = Keyframes::at(document, sampler, time, checked_times)?;
        let pose = self.nodes.entry(index).or_default();
        match property {
            Property::Translation => {
                let curve = Curve::open(document, sampler, keyframes, 1, &FLOATS)?;
                pose.translation = Some(curve.value(0)?.into());
            }
            Property::Scale => {
                let curve = Curve::open(document, sampler, keyframes, 1, &FLOATS)?;
                pose.scale = Some(curve.value(0)?.into());
            }
            Property::Rotation => {
                let curve = Curve::open(document, sampler, keyframes, 1, &ANIMATED_FRACTIONS)?;
                pose.rotation = Some(curve.rotation()?);
            }
            Property::MorphTargetWeights => {
                let curve = Curve::open(document, sampler, keyframes, targets, &ANIMATED_FRACTIONS)?;
                pose.weights = Some(curve);
            }
        }
        Ok(Some((index, spell(property))))
    }
}

/// Number of morph targets of the mesh at a node, equal for all its primitives.
fn morph_targets(root: &Root, node: usize) -> usize {
    let mesh = root.nodes[node].mesh.and_then(|mesh| root.meshes.get(mesh.value()));
    let primitives = mesh.into_iter().flat_map(|mesh| &mesh.primitives);
    let targets = primitives.map(|primitive| primitive.targets.as_ref().map_or(0, Vec::len));
    targets.max().unwrap_or(0)
}

fn animation_label(root: &Root, index: usize) -> String {
    label("animation", index, root.animations[index].name.as_deref())
}

fn spell(property: Property) -> &'static str {
    match property {
        Property::Translation => "translation",
        Property::Rotation => "rotation",
        Property::Scale => "scale",
        Property::MorphTargetWeights => "weights",
    }
}
