//! What a surface's material is at a place: `glsl/bsdf/material.glsl`, and `glsl/trace/opacity.glsl`.

use glam::{DVec2, DVec3, DVec4};
use half::f16;

use super::Inputs;
use super::interaction::is_hidden_back;
use super::intersect::{Hit, PlacedTriangle, Progress, Ray, nearest_hit_from};
use super::sampling::decode_direction;
use super::surface::{Surface, surface_of};
use super::vector::rgb;
use crate::layout::{BLEND, MASK, NO_TEXTURE, SEE_THROUGH, TEXTURED_TRIANGLE};
use crate::packing::PackedScene;
use crate::random::Random;

/// What a place of a triangle has for textures.
struct Place {
    sets: [DVec2; 2],
    color: DVec4,
    /// w: the bitangent's side, 0 where there is none.
    tangent: DVec4,
}

impl Place {
    fn of(scene: &PackedScene, at: PlacedTriangle, [u, v]: [f64; 2]) -> Self {
        let mut place = Self {
            sets: [DVec2::ZERO; 2],
            color: DVec4::ZERO,
            tangent: DVec4::ZERO,
        };
        let placement = at.placement(scene);
        let corners = &scene.corners[3 * at.triangle as usize..][..3];
        for (corner, weight) in corners.iter().zip([1.0 - u - v, u, v]) {
            let half = |word: u32| f64::from(f16::from_bits(word as u16));
            let [low, high] = corner.color;
            let color = [half(low), half(low >> 16), half(high), half(high >> 16)];
            place.sets[0] += weight * DVec2::from(corner.first.map(f64::from));
            place.sets[1] += weight * DVec2::from(corner.second.map(f64::from));
            place.color += weight * DVec4::from(color);
            let mut side = f64::from(corner.bitangent);
            let mut tangent = decode_direction(corner.tangent);
            if let Some(placement) = placement {
                // It follows the surface as its edges do. Mirroring turns normal × tangent round, but not the bitangent.
                tangent = placement.map().transform_vector3(tangent).normalize();
                side = if placement.is_mirrored() { -side } else { side };
            }
            place.tangent += weight * (tangent * side.abs()).extend(side);
        }
        place
    }
}

/// The value of a texture, or `None` where there is none.
fn value(scene: &PackedScene, texture: u32, place: &Place) -> Option<DVec4> {
    let lookup = (texture != NO_TEXTURE).then(|| &scene.textures[texture as usize])?;
    Some(lookup.value(&scene.texels, place.sets))
}

/// Gives a surface the material of its place. A texture of normals turns its shading normal.
pub fn apply_textures(scene: &PackedScene, surface: &mut Surface) {
    if surface.flags & TEXTURED_TRIANGLE == 0 {
        return;
    }
    let place = Place::of(scene, surface.triangle, surface.uv);
    let at = |texture: u32| value(scene, texture, &place);
    let times = |color: [f32; 3], factor: DVec3| (rgb(color) * factor).as_vec3().to_array();
    let textures = surface.material;
    let material = &mut surface.material;
    let color = at(textures.color_texture).unwrap_or(DVec4::ONE) * place.color;
    material.base_color = times(material.base_color, color.truncate()).map(|value| value.min(1.0));
    if let Some(value) = at(textures.metal_texture) {
        material.roughness *= value.y as f32;
        material.metallic *= value.z as f32;
    }
    if let Some(value) = at(textures.emission_texture) {
        material.emission = times(material.emission, value.truncate());
    }
    if let Some(value) = at(textures.transmission_texture) {
        material.transmission *= value.x as f32;
    }
    if let Some(value) = at(textures.specular_texture) {
        material.specular_f0 = times(material.specular_f0, DVec3::splat(value.w));
        material.specular_f90 *= value.w as f32;
    }
    if let Some(value) = at(textures.specular_color_texture) {
        material.specular_f0 = times(material.specular_f0, value.truncate());
    }
    if let Some(value) = at(textures.normal_texture) {
        let scale = textures.normal_scale.into();
        surface.shading_normal = leaning_normal(surface.shading_normal, surface, &place, value.truncate(), scale);
    }
    let material = &mut surface.material;
    if let Some(value) = at(textures.coat_texture) {
        material.coat *= value.x as f32;
    }
    if let Some(value) = at(textures.coat_roughness_texture) {
        material.coat_roughness *= value.y as f32;
    }
    if let Some(value) = at(textures.coat_normal_texture) {
        let scale = textures.coat_normal_scale.into();
        surface.coat_normal = leaning_normal(surface.coat_normal, surface, &place, value.truncate(), scale);
    }
}

/// The normal that a texture leans `n` to, on the side of the geometric one.
fn leaning_normal(n: DVec3, surface: &Surface, place: &Place, value: DVec3, scale: f64) -> DVec3 {
    let t = place.tangent.truncate();
    let t = t - t.dot(n) * n;
    if t.length_squared() < 1e-12 || place.tangent.w == 0.0 {
        return n;
    }
    let t = t.normalize();
    let b = place.tangent.w.signum() * n.cross(t);
    let local = 2.0 * value - 1.0;
    let leaning = local.x * scale * t + local.y * scale * b + local.z * n;
    if leaning.length_squared() > 1e-12 && leaning.dot(surface.geometric_normal) > 0.0 {
        leaning.normalize()
    } else {
        n
    }
}

/// The part of a surface that is there, at its place.
pub fn share_there(scene: &PackedScene, surface: &Surface) -> f64 {
    if surface.flags & SEE_THROUGH == 0 {
        return 1.0;
    }
    let material = &surface.material;
    let mut alpha = f64::from(material.alpha);
    if surface.flags & TEXTURED_TRIANGLE != 0 {
        let place = Place::of(scene, surface.triangle, surface.uv);
        alpha *= place.color.w * value(scene, material.color_texture, &place).map_or(1.0, |value| value.w);
    }
    match material.alpha_mode {
        MASK if alpha < f64::from(material.alpha_cutoff) => 0.0,
        BLEND => alpha.clamp(0.0, 1.0),
        _ => 1.0,
    }
}

/// Whether a ray finds a face there: by chance where it isn't there everywhere, a pure function of the ray's place in its path.
pub(super) fn is_face_there(scene: &PackedScene, surface: &Surface, at: PlacedTriangle, random: &Random) -> bool {
    let thing = [at.triangle, at.instance.map_or(0, |instance| instance + 1)];
    random.number_of(thing) < share_there(scene, surface)
}

/// As [`nearest_hit`](super::intersect::nearest_hit), by chance through what is there in part.
pub(super) fn nearest_visible(
    inputs: &Inputs<'_>,
    ray: Ray,
    t_max: f64,
    ignored: Option<PlacedTriangle>,
    random: &Random,
) -> Option<Hit> {
    nearest_seen(inputs, ray, t_max, ignored, false, random)
}

/// The same, with `culls` through backs that no camera sees.
pub(super) fn nearest_seen(
    inputs: &Inputs<'_>,
    ray: Ray,
    t_max: f64,
    ignored: Option<PlacedTriangle>,
    culls: bool,
    random: &Random,
) -> Option<Hit> {
    let mut progress = Progress::AT_ORIGIN;
    loop {
        let hit = nearest_hit_from(inputs, ray, progress, t_max, ignored)?;
        let met = surface_of(inputs.scene, hit);
        if !(culls && is_hidden_back(&met, ray.direction)) && is_face_there(inputs.scene, &met, hit.at, random) {
            return Some(hit);
        }
        progress = Progress::past(hit);
    }
}
