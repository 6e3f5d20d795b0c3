//! Anisotropic microfacets: their lobe by slopes, and pictures in closed form.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::{DVec2, DVec3, dvec3};
use ppm_vk::internals::config::Direct;
use ppm_vk::internals::cpu::Reflector;
use ppm_vk::internals::layout::LEAST_ROUGHNESS;
use ppm_vk::internals::random::{PathKind, Random};
use serde_json::{Value, json};

use crate::coat::{assert_plate_shows_towards, with_extension};
use crate::document::{Filter, metallic_roughness, png, with_texture};
use crate::gloss::{albedo_towards, brushed, metal, plastic};
use crate::lights::assert_shows_highlights;
use crate::mesh::Mesh;

const BASE: [f64; 3] = [0.9, 0.6, 0.3];

/// α along the direction, by KHR_materials_anisotropy.
fn along(roughness: f64, strength: f64) -> f64 {
    let alpha = roughness * roughness;
    alpha + (1.0 - alpha) * strength * strength
}

fn anisotropic(metallic: f64, roughness: f64, strength: f64, rotation: f64) -> Value {
    let extension = json!({"anisotropyStrength": strength, "anisotropyRotation": rotation});
    let material = metallic_roughness("brushed", BASE, metallic, roughness);
    with_extension(material, "KHR_materials_anisotropy", extension)
}

/// Heitz, 2014, sections 5.3 and 5.4: slopes have the density of an ellipse, and Λ is that of the α in the direction's plane.
#[test]
fn the_lobe_is_that_of_slopes_on_an_ellipse() {
    let mut compared = 0;
    for index in 0..10_000 {
        let [a, b, c, d] = Random::new(PathKind::Camera, index, 0, 0).next4();
        let [e, f, g, _] = Random::new(PathKind::LightSample, index, 0, 0).next4();
        let direction = |cosine: f64, turn: f64| {
            let sin = (1.0 - cosine * cosine).sqrt();
            dvec3(sin * (2.0 * PI * turn).cos(), sin * (2.0 * PI * turn).sin(), cosine)
        };
        let (v, l, turn) = (direction(a, b), direction(c, d), 2.0 * PI * g);
        let (across, along) = (0.02 + e, 0.02 + f);
        let reflector = brushed(across, along, turn);
        let h = (v + l).normalize();
        // Components along and across the direction.
        let turned = |w: DVec3| DVec2::from_angle(-turn).rotate(w.truncate()) / w.z;
        let slope = turned(h) / DVec2::new(along, across);
        let density_of_slopes = 1.0 / (PI * across * along * (1.0 + slope.length_squared()).powi(2));
        let density = density_of_slopes / h.z.powi(4);
        let lambda = |w: DVec3| {
            let tangent = turned(w) * DVec2::new(along, across);
            ((1.0 + tangent.length_squared()).sqrt() - 1.0) / 2.0
        };
        let brdf = reflector.fresnel(v.dot(h)) * density / (4.0 * v.z * l.z * (1.0 + lambda(v) + lambda(l)));
        let found = reflector.brdf(DVec3::Z, v, l);
        assert!(
            (found - brdf).length() <= 1e-9 * brdf.length(),
            "{found} instead of {brdf}"
        );
        let of_reflections = density / (4.0 * v.z * (1.0 + lambda(v)));
        let found = reflector.reflected_density(DVec3::Z, v, l);
        assert!(
            (found - of_reflections).abs() <= 1e-9 * of_reflections,
            "density {found} instead of {of_reflections}"
        );
        let swapped = brushed(along, across, turn + FRAC_PI_2).brdf(DVec3::Z, v, l);
        assert!(
            (swapped - brdf).length() <= 1e-9 * brdf.length(),
            "turned {swapped}, not {brdf}"
        );
        compared += u32::from(brdf.x > 1e-6);
    }
    assert!(compared > 9_000, "{compared} BRDFs aren't black");
}

/// The mesh has no tangents: they follow its texture coordinates, along x at first. Paths follow the reflection of the narrower
/// lobes, and visible points have the others.
#[test]
fn brushed_metal_shows_highlights_that_are_long_in_its_direction() {
    let floor = Mesh::facing_up(1.5, 0.0);
    let reflector = |roughness: f64, strength: f64, rotation: f64| Reflector {
        f0: BASE.into(),
        along: Some((along(roughness, strength), dvec3(rotation.cos(), 0.0, -rotation.sin()))),
        ..metal(roughness * roughness)
    };
    for (roughness, strength, rotation) in [
        (0.25, 0.5, 0.0),
        (0.25, 0.5, FRAC_PI_4),
        (0.25, 0.5, FRAC_PI_2),
        (0.45, 0.7, FRAC_PI_4),
    ] {
        let material = anisotropic(1.0, roughness, strength, rotation);
        let what = format!("roughness {roughness}, strength {strength}, turned by {rotation}");
        assert_shows_highlights(|_| material, &floor, reflector(roughness, strength, rotation), &what);
    }
    // A quarter turn of the texture coordinates, and one of the direction.
    let mut turned = Mesh::facing_up(1.5, 0.0);
    turned.texcoords = turned.texcoords.iter().map(|at| DVec2::new(-at.y, at.x)).collect();
    let material = anisotropic(1.0, 0.25, 0.5, FRAC_PI_2);
    assert_shows_highlights(|_| material, &turned, reflector(0.25, 0.5, 0.0), "turned back");
    // The direction and the strength of a texel, which are turned and multiplied.
    let texel = [38, 217, 204, 255];
    let [x, y, part] = [0, 1, 2].map(|channel| f64::from(texel[channel]) / 255.0);
    let rotation = 0.4 + (2.0 * y - 1.0).atan2(2.0 * x - 1.0);
    assert_shows_highlights(
        |scene| {
            let texture = scene.texture(&png(1, 1, |_, _| texel), Filter::Nearest);
            let slot = "/extensions/KHR_materials_anisotropy/anisotropyTexture";
            with_texture(anisotropic(1.0, 0.25, 0.7, 0.4), slot, texture)
        },
        &floor,
        reflector(0.25, 0.7 * part, rotation),
        "textured",
    );
}

/// Light comes by shadow rays, or by photons alone; paths follow the reflection of the first two. What would be a mirror without
/// anisotropy has the least roughness across its direction.
#[test]
fn a_brushed_plate_in_uniform_light_shows_its_albedo() {
    const ROTATION: f64 = 0.6;
    for (metallic, roughness, strength) in [(1.0, 0.0, 0.6), (1.0, 0.3, 0.6), (1.0, 0.4, 0.6), (0.0, 0.4, 0.9)] {
        let across = f64::max(roughness, LEAST_ROUGHNESS);
        let kind = if metallic > 0.0 { metal } else { plastic };
        let mut reflector = Reflector {
            along: brushed(0.0, along(across, strength), ROTATION).along,
            ..kind(across * across)
        };
        if metallic > 0.0 {
            reflector.f0 = BASE.into();
        } else {
            reflector.diffuse = BASE.into();
        }
        for direct in [Direct::Light, Direct::Photons] {
            let material = anisotropic(metallic, roughness, strength, ROTATION);
            assert_plate_shows_towards(
                |_| material,
                direct,
                20_000,
                &format!("metallic {metallic}, roughness {roughness}, strength {strength}"),
                |v| albedo_towards(reflector, v, 96).x,
                1e-3,
            );
        }
    }
}
