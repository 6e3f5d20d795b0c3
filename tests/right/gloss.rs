//! Microfacets: what is sampled is what is evaluated, both ways are one, and no more comes out than what went in.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};
use ppm_vk::internals::config::{Direct, RenderConfig};
use ppm_vk::internals::cpu::Reflector;
use ppm_vk::internals::random::{PathKind, Random};

use crate::document::{Document, light, matte, metallic_roughness};
use crate::measure::{Measured, Region, measure};
use crate::mesh::Mesh;
use crate::picture::small;
use crate::stage::{camera_ray, subject};

const ALPHAS: [f64; 5] = [0.01, 0.1, 0.3, 0.6, 1.0];
const COSINES: [f64; 4] = [0.05, 0.3, 0.7, 1.0];

pub fn metal(alpha: f64) -> Reflector {
    Reflector {
        diffuse: DVec3::ZERO,
        f0: dvec3(0.95, 0.64, 0.3),
        f90: 1.0,
        over_base: [0.0; 2],
        alpha,
        coat: 0.0,
        sheen: Default::default(),
        along: None,
    }
}

pub fn plastic(alpha: f64) -> Reflector {
    Reflector {
        diffuse: dvec3(0.8, 0.5, 0.1),
        f0: DVec3::splat(0.04),
        f90: 1.0,
        over_base: [0.04, 1.0],
        alpha,
        coat: 0.0,
        sheen: Default::default(),
        along: None,
    }
}

/// α is another one along a direction that is turned from x towards y.
pub fn brushed(across: f64, along: f64, turn: f64) -> Reflector {
    Reflector {
        along: Some((along, dvec3(turn.cos(), turn.sin(), 0.0))),
        ..metal(across)
    }
}

/// With what they are called.
fn metals() -> Vec<(String, Reflector)> {
    let isotropic = ALPHAS.map(|alpha| (format!("α {alpha}"), metal(alpha)));
    let anisotropic = [(0.02, 0.1, 0.0), (0.1, 0.5, 0.7), (0.3, 1.0, 1.5)].map(|(across, along, turn)| {
        let name = format!("α {across} and {along}, turned by {turn}");
        (name, brushed(across, along, turn))
    });
    isotropic.into_iter().chain(anisotropic).collect()
}

fn viewer(cosine: f64) -> DVec3 {
    dvec3((1.0 - cosine * cosine).sqrt(), 0.0, cosine)
}

fn uniform(index: u32, kind: PathKind) -> [f64; 4] {
    Random::new(kind, index, 0, 0).next4()
}

/// The directions along and across which α differs, and both α.
fn axes(reflector: &Reflector) -> ([DVec3; 2], [f64; 2]) {
    let (along, t) = reflector.along.unwrap_or((reflector.alpha, DVec3::X));
    ([t, DVec3::Z.cross(t)], [along, reflector.alpha])
}

/// A microfacet normal by two numbers in [0, 1), and the solid angle of a unit of both. The first one is x / (1 + x), where x is the
/// square of the slope in units of α, so that neither has a peak where α is small.
fn microfacet(reflector: &Reflector, [s, turn]: [f64; 2]) -> (DVec3, f64) {
    let ([t, b], [along, across]) = axes(reflector);
    let slope = (s / (1.0 - s)).sqrt();
    let (sin, cos) = (2.0 * PI * turn).sin_cos();
    let normal = (along * slope * cos * t + across * slope * sin * b + DVec3::Z).normalize();
    // An area of slopes is dω / cos³θ, and d(slope²) = ds / (1 − s)².
    let solid_angle = PI * normal.z.powi(3) * along * across / (1.0 - s).powi(2);
    (normal, solid_angle)
}

/// The numbers of a microfacet normal.
fn numbers_of(reflector: &Reflector, h: DVec3) -> [f64; 2] {
    let ([t, b], [along, across]) = axes(reflector);
    let (x, y) = (h.dot(t) / (h.z * along), h.dot(b) / (h.z * across));
    let slope2 = x * x + y * y;
    [slope2 / (1.0 + slope2), y.atan2(x) / (2.0 * PI)]
}

/// χ² over 16 × 16 cells of microfacet normals. By Wilson and Hilferty's transformation it is a normal number, which
/// exceeds 6 with a probability of 1e-9.
#[test]
fn reflected_directions_have_the_density_that_is_said() {
    const CELLS: usize = 16;
    const FINE: usize = 64;
    const SAMPLES: u32 = 200_000;
    for ((name, reflector), cosine) in metals()
        .into_iter()
        .flat_map(|metal| COSINES.map(|cosine| (metal.clone(), cosine)))
    {
        let (n, v) = (DVec3::Z, viewer(cosine));
        let mut found = vec![0.0; CELLS * CELLS];
        for index in 0..SAMPLES {
            let [u0, u1, ..] = uniform(index, PathKind::Camera);
            let h = (v + reflector.reflected_direction(n, v, [u0, u1])).normalize();
            let [s, turn] = numbers_of(&reflector, h);
            let cell = |x: f64| ((x - x.floor()) * CELLS as f64).min(CELLS as f64 - 1.0) as usize;
            found[cell(s.min(1.0 - 1e-12)) * CELLS + cell(turn)] += 1.0;
        }
        let mut chi2 = 0.0;
        let mut cells = 0.0;
        for (cell, &found) in found.iter().enumerate() {
            let mut share = 0.0;
            for i in 0..FINE * FINE {
                let at = |cell: usize, i: usize| (cell as f64 + (i as f64 + 0.5) / FINE as f64) / CELLS as f64;
                let (h, solid_angle) = microfacet(&reflector, [at(cell / CELLS, i / FINE), at(cell % CELLS, i % FINE)]);
                let vh = v.dot(h);
                if vh > 0.0 {
                    let l = 2.0 * vh * h - v;
                    // dω_l = 4 (v·h) dω_h
                    share += reflector.reflected_density(n, v, l) * 4.0 * vh * solid_angle;
                }
            }
            let expected = share * f64::from(SAMPLES) / ((CELLS * FINE).pow(2)) as f64;
            if expected > 5.0 {
                chi2 += (found - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        let freedom: f64 = cells - 1.0;
        let spread = 2.0 / (9.0 * freedom);
        let z = ((chi2 / freedom).cbrt() - (1.0 - spread)) / spread.sqrt();
        println!("{name}, cos {cosine}: χ² {chi2:.1} of {cells} cells, {z:.2} deviations");
        assert!(cells > 30.0, "{name}, cos {cosine}: {cells} cells");
        assert!(z < 6.0, "{name}, cos {cosine}: χ² {chi2} of {cells} cells");
    }
}

#[test]
fn light_and_viewer_may_change_places() {
    for index in 0..10_000 {
        let [a, b, c, d] = uniform(index, PathKind::Camera);
        let [e, f, ..] = uniform(index, PathKind::LightSample);
        let direction = |cosine: f64, turn: f64| {
            let sin = (1.0 - cosine * cosine).sqrt();
            dvec3(sin * (2.0 * PI * turn).cos(), sin * (2.0 * PI * turn).sin(), cosine)
        };
        let (v, l) = (direction(a, b), direction(c, d));
        let reflector = Reflector {
            coat: f,
            along: (index % 2 == 0).then(|| (0.02 + f, dvec3(a, b - 0.5, 0.0).normalize())),
            ..plastic(0.02 + e)
        };
        let (one, other) = (reflector.brdf(DVec3::Z, v, l), reflector.brdf(DVec3::Z, l, v));
        assert!((one - other).length() <= 1e-10 * one.length(), "{v} {l}: {one} {other}");
    }
}

/// ∫ BRDF · cos for a viewer at this cosine.
pub fn albedo(reflector: Reflector, cosine: f64, steps: u32) -> DVec3 {
    albedo_towards(reflector, viewer(cosine), steps)
}

/// ∫ BRDF · cos by the microfacet normals' own measure, and the base's by angle; without what a smooth boundary mirrors.
pub fn albedo_towards(reflector: Reflector, v: DVec3, steps: u32) -> DVec3 {
    let n = DVec3::Z;
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(steps);
    let base = Reflector {
        alpha: 0.0,
        ..reflector
    };
    let mirrors = reflector.boundary();
    let mut sum = DVec3::ZERO;
    for i in 0..steps * steps {
        let (s, turn) = (at(i / steps), at(i % steps));
        let sin = s.sqrt();
        let l = dvec3(
            sin * (2.0 * PI * turn).cos(),
            sin * (2.0 * PI * turn).sin(),
            (1.0 - s).sqrt(),
        );
        sum += base.brdf(n, v, l) * PI;
        let (h, solid_angle) = microfacet(&reflector, [s, turn]);
        let l = 2.0 * v.dot(h) * h - v;
        if reflector.alpha > 0.0 && v.dot(h) > 0.0 && l.z > 0.0 {
            sum += mirrors.brdf(n, v, l) * l.z * 4.0 * v.dot(h) * solid_angle;
        }
    }
    sum / f64::from(steps * steps)
}

/// What single scattering between microfacets loses is the model's own loss: two thirds of a white metal at α = 1.
#[test]
fn a_metal_reflects_no_more_than_arrives_and_samples_weigh_what_the_integral_says() {
    const SAMPLES: u32 = 20_000;
    for ((name, metal), cosine) in metals()
        .into_iter()
        .flat_map(|metal| COSINES.map(|cosine| (metal.clone(), cosine)))
    {
        let white = Reflector {
            f0: DVec3::ONE,
            ..metal
        };
        let expected = albedo(white, cosine, 1024).x;
        let v = viewer(cosine);
        let samples = (0..SAMPLES).map(|index| {
            let [u0, u1, ..] = uniform(index, PathKind::Camera);
            let l = white.reflected_direction(DVec3::Z, v, [u0, u1]);
            white.reflected_weight(DVec3::Z, v, l).x
        });
        let found = Measured::of(samples.collect());
        // The rule of midpoints is right to 1e-3 where the lobe is cut by the horizon.
        found.assert_between(
            expected * 0.999,
            expected * 1.001,
            &format!("{name}, cos {cosine}, white metal"),
        );
        assert!(expected < 1.001, "{name}, cos {cosine}: {expected}");
    }
}

/// Plates in a room whose walls all have radiance 1 show their albedo in the direction that they are seen from. Light comes
/// by shadow rays or by photons alone; reflections are followed at the lower two roughnesses.
#[test]
fn a_glossy_plate_in_uniform_light_shows_its_albedo() {
    const SIDE: usize = 32;
    for (metallic, roughness) in [(1.0, 0.1), (1.0, 0.3), (1.0, 0.4), (1.0, 0.8), (0.0, 0.2), (0.0, 0.6)] {
        for direct in [Direct::Light, Direct::Photons] {
            let mut scene = Document::new("plate");
            let base = [0.9, 0.6, 0.3];
            let plate = scene.material(metallic_roughness("plate", base, metallic, roughness));
            let wall = scene.material(light("wall", [1.0; 3]));
            scene.object("plate", &Mesh::facing_up(0.9, 0.0), plate);
            scene.object(
                "room",
                &Mesh::cuboid(dvec3(-1.0, -0.1, -1.0), dvec3(1.0, 1.4, 1.0)).flipped(),
                wall,
            );
            scene.camera([0.8, 0.85], [0.0, 0.0], 20.0);
            let scene = subject(scene);
            let middle = Region::around([SIDE / 2; 2], 6);
            let reflector = Reflector {
                alpha: roughness * roughness,
                ..if metallic > 0.0 {
                    Reflector {
                        f0: DVec3::from(base),
                        ..metal(0.0)
                    }
                } else {
                    Reflector {
                        diffuse: DVec3::from(base),
                        ..plastic(0.0)
                    }
                }
            };
            let expected = middle.mean(|[column, row]| {
                let (_, direction) = camera_ray(&scene, SIDE, [column as f64 + 0.5, row as f64 + 0.5]);
                albedo(reflector, -direction.y, 96).x
            });
            let config = RenderConfig {
                direct,
                radius: Some(0.1),
                ..small(SIDE as u32, 20_000)
            };
            let measured = measure(&scene, config, 32, |image| vec![middle.of(image, 0)]);
            let what = format!("metallic {metallic}, roughness {roughness}, direct light by {direct:?}");
            measured[0].assert_between(expected * 0.999, expected * 1.001, &what);
        }
    }
}

/// KHR_materials_specular: max_value(fr) is what a coloured reflection takes from all channels of the base, so that it doesn't
/// show in the complementary colour; and appendix B mixes the BRDFs of metal and dielectric, each with its own Fresnel.
#[test]
fn a_base_lies_under_the_largest_channel_of_what_is_no_metal() {
    let (specular, metallic, color) = (0.8, 0.25, dvec3(0.9, 0.6, 0.3));
    let f0 = specular * dvec3(0.3, 0.1, 0.0);
    let reflector = Reflector {
        diffuse: color * (1.0 - metallic),
        f0: f0.lerp(color, metallic),
        f90: specular * (1.0 - metallic) + metallic,
        over_base: [0.24, specular],
        alpha: 0.0,
        coat: 0.0,
        sheen: Default::default(),
        along: None,
    };
    for cosine in COSINES {
        let l = dvec3(-viewer(cosine).x, 0.0, cosine);
        let weight = (1.0 - cosine).powi(5);
        let of_dielectric = 0.24 + (specular - 0.24) * weight;
        let expected = (1.0 - metallic) * (1.0 - of_dielectric) * color / PI;
        let found = reflector.brdf(DVec3::Z, viewer(cosine), l);
        assert!(
            (found - expected).abs().max_element() < 1e-12,
            "{found} instead of {expected}"
        );
        let boundary = (f0 + (specular - f0) * weight) * (1.0 - metallic) + (color + (1.0 - color) * weight) * metallic;
        let found = reflector.fresnel(cosine);
        assert!(
            (found - boundary).abs().max_element() < 1e-12,
            "{found} instead of {boundary}"
        );
    }
}

/// Appendix B weighs the base with Fresnel's reflectance at the microfacets between viewer and light, not at the viewer's
/// angle: at grazing angles more comes out than what went in. Over all angles it is a few per cent of a white base.
#[test]
fn a_coated_white_base_gains_no_more_than_the_model_does() {
    for alpha in ALPHAS {
        let coated = Reflector {
            diffuse: DVec3::ONE,
            ..plastic(alpha)
        };
        let mean = (0..32)
            .map(|i| albedo(coated, ((f64::from(i) + 0.5) / 32.0).sqrt(), 96).x)
            .sum::<f64>()
            / 32.0;
        println!("α {alpha}: {mean:.4} of diffuse light is reflected");
        assert!(
            mean < 1.06 && mean > 0.9,
            "α {alpha}: {mean} of diffuse light is reflected"
        );
    }
}

/// At the ends of the roughnesses that are mirrors, that paths follow, and that visible points have, the picture goes on as it
/// was: a plate in a black room with one shining wall.
#[test]
fn roughness_passes_over_from_mirrors_to_wide_lobes_without_a_step() {
    const SIDE: usize = 32;
    // α is 1e-3 and 0.1 in the middle of the second and the third.
    for (one, other) in [(0.0, 0.01), (0.0312, 0.0320), (0.3160, 0.3164)] {
        for metallic in [0.0, 1.0] {
            let regions = [([12, 16], 5), ([16, 16], 12)];
            let regions = regions.map(|(centre, side)| Region::around(centre, side));
            let [one_mean, other_mean] = [one, other].map(|roughness| {
                let mut scene = Document::new("plate");
                let plate = scene.material(metallic_roughness("plate", [0.9; 3], metallic, roughness));
                let wall = scene.material(light("wall", [1.0; 3]));
                let black = scene.material(matte("black", [0.0; 3]));
                scene.object("plate", &Mesh::facing_up(0.9, 0.0), plate);
                let room = Mesh::cuboid(dvec3(-1.0, -0.1, -1.0), dvec3(1.0, 1.4, 1.0)).flipped();
                scene.object("room", &room, black);
                // The middle of the picture mirrors its edge.
                let corners = [[-0.95, 0.85], [0.0, 0.85], [0.0, 1.35], [-0.95, 1.35]];
                let corners = corners.map(|[x, y]| dvec3(x, y, -0.95));
                scene.object("wall", &Mesh::quad(corners), wall);
                scene.camera([0.8, 0.85], [0.0, 0.0], 20.0);
                let config = RenderConfig {
                    radius: Some(0.1),
                    ..small(SIDE as u32, 1000)
                };
                measure(&subject(scene), config, 64, |image| {
                    regions.iter().map(|region| region.of(image, 0)).collect()
                })
            });
            for (region, (one_mean, other_mean)) in one_mean.iter().zip(&other_mean).enumerate() {
                let what = format!("metallic {metallic}, roughness {other} less {one}, region {region}");
                // How much a lobe widens over the interval.
                let slack = 3e-3;
                other_mean.minus(one_mean).assert_between(-slack, slack, &what);
            }
        }
    }
}
