//! Glass without a volume is a thin wall by the specification, but is often meant as a solid: `LoadOptions::solid_glass` treats
//! it as such if its mesh is closed.

use std::collections::{BTreeMap, HashMap};

use glam::{DVec3, Vec3};
use gltf_json::Root;

use super::geometry::Geometry;
use crate::loader::diagnostic::{Check, label};
use crate::loader::material::solid;
use crate::scene::{LoadChoice, Material, Object, Remark, Surface};
use crate::text::{list, quote};

/// Indices of the materials in use that are glass without a volume.
pub(crate) fn thin_glass(materials: &[Material], used: &[bool]) -> Vec<usize> {
    let is_thin = |material: &Material| matches!(material.surface, Surface::Dielectric(glass) if glass.thin);
    let indices = (0..materials.len()).filter(|&index| used[index] && is_thin(&materials[index]));
    indices.collect()
}

/// The note about them, if they remain thin walls.
pub(crate) fn note(root: &Root, thin: &[usize]) -> Option<Remark> {
    (!thin.is_empty()).then(|| {
        let what = format!(
            "glass without a volume is a thin wall, which does not bend light: {}",
            list(&labels(root, thin))
        );
        Remark::with(LoadChoice::SolidGlass, what)
    })
}

fn labels(root: &Root, indices: &[usize]) -> Vec<String> {
    let of = |&index: &usize| {
        let name = root.materials.get(index).and_then(|material| material.name.as_deref());
        label("material", index, name)
    };
    indices.iter().map(of).collect()
}

/// Gives objects of thin glass with a closed mesh a solid material, and reports those that remain thin.
pub(crate) fn make_solid(
    root: &Root,
    geometry: &mut Geometry,
    materials: &mut Vec<Material>,
    thin: &[usize],
) -> Check<Option<Remark>> {
    let is_thin = |object: &Object| thin.contains(&(object.material as usize));
    let mut of_nodes: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (object, &node) in geometry.nodes.iter().enumerate() {
        of_nodes.entry(node).or_default().push(object);
    }
    let mut solids: BTreeMap<u32, u32> = BTreeMap::new();
    let mut open = Vec::new();
    let mut known: HashMap<u32, bool> = HashMap::new();
    for objects in of_nodes.values() {
        // The mesh as a whole, if one of its primitives alone is not closed.
        let mut whole = None;
        for &index in objects {
            let object = &geometry.objects[index];
            if !is_thin(object) {
                continue;
            }
            let own = *known
                .entry(object.triangles.start)
                .or_insert_with(|| is_closed(geometry, &[index]));
            if !own && !*whole.get_or_insert_with(|| is_closed(geometry, objects)) {
                open.push(quote(&object.name));
                continue;
            }
            let material = object.material;
            if let std::collections::btree_map::Entry::Vacant(entry) = solids.entry(material) {
                entry.insert(materials.len() as u32);
                materials.push(solid(root, material as usize, &materials[material as usize])?);
            }
            geometry.objects[index].material = solids[&material];
        }
    }
    open.dedup();
    Ok((!open.is_empty()).then(|| {
        let what = format!(
            "{} can't be taken as solid glass and stays a thin wall: not closed (each edge between two faces that look to the same \
             side), or inside out",
            list(&open)
        );
        Remark::from(what)
    }))
}

/// Whether the objects together are closed: each edge lies between two faces of consistent orientation, facing outwards.
fn is_closed(geometry: &Geometry, objects: &[usize]) -> bool {
    let mut balance: HashMap<[[u32; 3]; 2], i64> = HashMap::new();
    let mut volume = 0.0;
    let mut first = None;
    for &index in objects {
        let Object {
            triangles, placement, ..
        } = &geometry.objects[index];
        for triangle in &geometry.triangles[triangles.start as usize..triangles.end as usize] {
            let corners = triangle.vertices.map(|vertex| {
                let position = geometry.positions[vertex as usize];
                placement.map_or(position, |placement| placement.point(position))
            });
            let origin = *first.get_or_insert(corners[0].as_dvec3());
            let [a, b, c] = corners.map(|corner| corner.as_dvec3() - origin);
            // Mirrored instances exchange front and back; the renderer turns their faces round.
            let mirrored = placement.is_some_and(|placement| placement.is_mirrored());
            volume += DVec3::dot(a, b.cross(c)) * if mirrored { -1.0 } else { 1.0 };
            // −0 and 0 are equal.
            let keys = corners.map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
            for (from, to) in [(0, 1), (1, 2), (2, 0)] {
                let (from, to) = (keys[from], keys[to]);
                if from < to {
                    *balance.entry([from, to]).or_default() += 1;
                } else if to < from {
                    *balance.entry([to, from]).or_default() -= 1;
                }
            }
        }
    }
    volume > 0.0 && balance.values().all(|&balance| balance == 0)
}
