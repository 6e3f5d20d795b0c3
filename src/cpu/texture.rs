//! Textures and opacity: `glsl/bsdf/material.glsl` and `glsl/trace/opacity.glsl`.

use glam::{DVec2, DVec3, DVec4};
use half::f16;

use super::Inputs;
use super::interaction::is_hidden_back;
use super::intersect::{Hit, PlacedTriangle, Progress, Ray, nearest_hit_from};
use super::sampling::{decode_direction, encode_direction};
use super::surface::{Surface, surface_of};
use crate::layout::{
    BLEND, DIELECTRIC, LEAST_ROUGHNESS, MASK, Material, NO_TEXTURE, SEE_THROUGH, TEXTURE_FACTORS, TEXTURED_TRIANGLE,
};
use crate::packing::PackedScene;
use crate::random::Random;

/// Texture coordinates, vertex colour and tangent at a point.
struct Place {
    sets: [DVec2; 2],
    color: DVec4,
    /// w: the bitangent's sign, 0 without a tangent.
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
                // The tangent transforms like an edge. Mirroring flips normal × tangent, but not the bitangent.
                tangent = placement.map().transform_vector3(tangent).normalize();
                side = if placement.is_mirrored() { -side } else { side };
            }
            place.tangent += weight * (tangent * side.abs()).extend(side);
        }
        place
    }
}

/// The value of a texture; `None` if there is no texture.
fn value(scene: &PackedScene, texture: u32, place: &Place) -> Option<DVec4> {
    let lookup = (texture != NO_TEXTURE).then(|| &scene.textures[texture as usize])?;
    Some(lookup.value(&scene.texels, place.sets))
}

/// Applies textures to a surface's material, and normal maps to its normals.
pub fn apply_textures(scene: &PackedScene, surface: &mut Surface) {
    if surface.flags & TEXTURED_TRIANGLE == 0 {
        return;
    }
    let place = Place::of(scene, surface.triangle, surface.uv);
    let at = |texture: u32| value(scene, texture, &place);
    let maps = surface.material;
    let mut numbers: [f32; size_of::<Material>() / 4] = bytemuck::cast(maps);
    let words: [u32; size_of::<Material>() / 4] = bytemuck::cast(maps);
    for map in TEXTURE_FACTORS {
        if let Some(value) = at(words[map.texture / 4]) {
            for (number, &channel) in numbers[map.factor / 4..].iter_mut().zip(map.channels) {
                *number = (f64::from(*number) * value[channel]) as f32;
            }
        }
    }
    surface.material = bytemuck::cast(numbers);
    let colors = place.color.truncate().to_array();
    for (number, color) in surface.material.base_color.iter_mut().zip(colors) {
        *number = ((f64::from(*number) * color) as f32).min(1.0);
    }
    let leaning = |n: DVec3, texture: u32, scale: f32| {
        at(texture).map_or(n, |value| {
            leaning_normal(n, surface, &place, value.truncate(), scale.into())
        })
    };
    let shading = leaning(surface.shading_normal, maps.normal_texture, maps.normal_scale);
    let coat = leaning(surface.coat_normal, maps.coat_normal_texture, maps.coat_normal_scale);
    (surface.shading_normal, surface.coat_normal) = (shading, coat);
    if maps.anisotropy > 0.0 {
        turn_anisotropy(surface, &place, at(maps.anisotropy_texture));
    }
}

/// Turns the direction of anisotropy into render space. Without a tangent the material is isotropic.
fn turn_anisotropy(surface: &mut Surface, place: &Place, value: Option<DVec4>) {
    let material = &mut surface.material;
    let mut turn = DVec2::from_angle(material.anisotropy_rotation.into());
    if let Some(value) = value {
        turn = turn.rotate(2.0 * value.truncate().truncate() - 1.0);
        material.anisotropy *= value.z as f32;
    }
    let n = surface.shading_normal;
    let t = place.tangent.truncate();
    let t = t - t.dot(n) * n;
    let has_direction = t.length_squared() >= 1e-12 && place.tangent.w != 0.0 && turn.length_squared() > 1e-6;
    if has_direction && material.anisotropy > 0.0 {
        let t = t.normalize();
        let direction = turn.x * t + turn.y * place.tangent.w.signum() * n.cross(t);
        material.anisotropy_direction = encode_direction(direction);
        // Across its direction too the lobe is no mirror's; what transmits light is isotropic and may be smooth.
        if material.surface != DIELECTRIC {
            material.roughness = material.roughness.max(LEAST_ROUGHNESS as f32);
        }
    } else {
        material.anisotropy = 0.0;
    }
}

/// The normal `n` perturbed by a normal map, if it stays on the geometric normal's side.
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

/// The probability that a ray hits the surface.
pub fn opacity(scene: &PackedScene, surface: &Surface) -> f64 {
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

/// Whether a ray hits a partly transparent face: random, but a pure function of the ray's position in its path.
pub(super) fn is_hit(scene: &PackedScene, surface: &Surface, at: PlacedTriangle, random: &Random) -> bool {
    let face = [at.triangle, at.instance.map_or(0, |instance| instance + 1)];
    random.number_of(face) < opacity(scene, surface)
}

/// As [`nearest_hit`](super::intersect::nearest_hit), passing partly transparent faces at random.
pub(super) fn nearest_visible(
    inputs: &Inputs<'_>,
    ray: Ray,
    t_max: f64,
    ignored: Option<PlacedTriangle>,
    random: &Random,
) -> Option<Hit> {
    nearest_visible_culled(inputs, ray, t_max, ignored, false, random)
}

/// The same; with `culls`, culled back faces are ignored.
pub(super) fn nearest_visible_culled(
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
        if !(culls && is_hidden_back(&met, ray.direction)) && is_hit(inputs.scene, &met, hit.at, random) {
            return Some(hit);
        }
        progress = Progress::past(hit);
    }
}
