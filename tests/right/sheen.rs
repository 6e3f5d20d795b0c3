//! Sheen: what it reflects and what it lets through, against quadrature.

use glam::{DVec3, dvec3};
use ppm_vk::internals::config::Direct;
use ppm_vk::internals::cpu::Reflector;
use ppm_vk::internals::layout::{GLOSSY_SURFACE, Material};
use serde_json::json;

use crate::coat::{assert_plate_shows, with_extension};
use crate::document::metallic_roughness;
use crate::gloss::albedo;

const ROUGHNESSES: [f64; 7] = [0.0, 0.15, 0.3, 0.35, 0.5, 0.75, 1.0];
const COSINES: [f64; 7] = [0.003, 0.03, 0.1, 0.25, 0.5, 0.8, 1.0];

/// A matte base under a sheen.
fn fabric(base: [f64; 3], color: [f64; 3], roughness: f64) -> Reflector {
    Reflector::glossy(&Material {
        base_color: base.map(|value| value as f32),
        surface: GLOSSY_SURFACE,
        roughness: 1.0,
        sheen_color: color.map(|value| value as f32),
        sheen_roughness: roughness as f32,
        ..bytemuck::Zeroable::zeroed()
    })
}

fn direction(cosine: f64, turn: f64) -> DVec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
    dvec3(sine * cos, sine * sin, cosine)
}

/// ∫ BRDF · cos, with more points at grazing angles.
fn reflected(reflector: &Reflector, cosine: f64) -> f64 {
    const STEPS: u32 = 500;
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
    let of_row = |i: u32| {
        let (z, weight) = (at(i).powi(2), 2.0 * at(i));
        let of = |j: u32| reflector.brdf(DVec3::Z, direction(cosine, 0.0), direction(z, at(j))).x * z * weight;
        (0..STEPS).map(of).sum::<f64>()
    };
    (0..STEPS).map(of_row).sum::<f64>() * std::f64::consts::TAU / f64::from(STEPS).powi(2)
}

/// The fit of its albedo is too high by 0.06 at the most, and never too low: no more than arrives comes out, of a white one on a
/// white base too.
#[test]
fn a_sheen_reflects_no_more_than_arrives_and_covers_what_it_reflects() {
    for (roughness, cosine) in ROUGHNESSES
        .into_iter()
        .flat_map(|roughness| COSINES.map(|cosine| (roughness, cosine)))
    {
        let black = fabric([0.0; 3], [1.0; 3], roughness);
        let (exact, fit) = (reflected(&black, cosine), black.sheen.albedo(cosine));
        let white = reflected(&fabric([1.0; 3], [1.0; 3], roughness), cosine);
        let what = format!("roughness {roughness}, cos {cosine}: albedo {exact}, fit {fit}, on white {white}");
        println!("{what}");
        assert!(exact < 1.0 && fit >= exact - 1e-3 && fit < exact + 0.06, "{what}");
        assert!(white <= 1.0, "{what}");
        let half = fabric([0.0; 3], [0.5; 3], roughness);
        assert!((reflected(&half, cosine) - 0.5 * exact).abs() < 1e-9, "{what}");
    }
}

#[test]
fn light_and_viewer_may_change_places() {
    let mut compared = 0;
    for i in 0..20_000u32 {
        let part = |step: f64| (f64::from(i) * step).fract();
        let (v, l) = (
            direction(part(0.754_877), part(0.569_84)),
            direction(part(0.430_16), part(0.214_6)),
        );
        let reflector = fabric([0.5, 0.2, 0.7], [part(0.31), 0.6, 0.1], part(0.618_034));
        let (one, other) = (reflector.brdf(DVec3::Z, v, l), reflector.brdf(DVec3::Z, l, v));
        assert!((one - other).length() <= 1e-10 * one.length(), "{v} {l}: {one} {other}");
        compared += u32::from(one.x > 0.0);
    }
    assert!(compared > 19_000, "{compared} BRDFs aren't black");
}

/// Light comes by shadow rays, or by photons alone; the base is matte, glossy or a metal whose reflection paths follow.
#[test]
fn a_plate_under_a_sheen_in_uniform_light_shows_its_albedo() {
    const SHEEN: [f64; 3] = [0.8, 0.5, 0.2];
    for (metallic, base, sheen) in [(0.0, 0.7, 0.3), (0.0, 0.7, 0.8), (1.0, 0.5, 0.5), (1.0, 0.1, 0.5)] {
        const COLOR: [f64; 3] = [0.6, 0.5, 0.3];
        let reflector = Reflector::glossy(&Material {
            base_color: COLOR.map(|value| value as f32),
            surface: GLOSSY_SURFACE,
            metallic: metallic as f32,
            roughness: base as f32,
            specular_f0: [0.04; 3],
            specular_f90: 1.0,
            sheen_color: SHEEN.map(|value| value as f32),
            sheen_roughness: sheen as f32,
            ..bytemuck::Zeroable::zeroed()
        });
        for direct in [Direct::Light, Direct::Photons] {
            let extension = json!({"sheenColorFactor": SHEEN, "sheenRoughnessFactor": sheen});
            let material = metallic_roughness("fabric", COLOR, metallic, base);
            assert_plate_shows(
                |_| with_extension(material, "KHR_materials_sheen", extension),
                direct,
                20_000,
                &format!("metallic {metallic}, roughness {base}, sheen {sheen}"),
                |cosine| albedo(reflector, cosine, 96).x,
                1e-3,
            );
        }
    }
}
