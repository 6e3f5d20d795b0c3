//! Starts of photon paths, one light at a time: in a scene most lights have few of the starts, and errors of theirs would pass as
//! rounding.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec4};
use ppm_vk::internals::config::{EmissionChoice, RenderConfig};
use ppm_vk::internals::cpu;
use ppm_vk::internals::layout::BACK_EMITS;
use ppm_vk::internals::shaders;
use ppm_vk::internals::stage::BufferId;

use super::agreement::Agreement;
use super::bench::{Bench, random_numbers, small, xyz};
use super::probes::probe;

const SCENES: [&str; 4] = [
    "glossy, lit",
    "glossy, softly lit",
    "cornell-spheres, patterned",
    "many-lamps",
];

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct AskedStart {
    u: [f32; 4],
    target: [f32; 4],
    light: u32,
    side: f32,
    unused: [u32; 2],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct FoundStart {
    origin: [f32; 4],
    direction: [f32; 4],
    flux: [f32; 4],
}

/// A scene whose paths start by power, and some of its lights: up to three of each kind.
fn bench_with_lights(name: &str) -> (Bench, Vec<u32>) {
    let config = RenderConfig {
        emission: EmissionChoice::Power,
        ..small()
    };
    let bench = Bench::with(name, config, |scene| {
        // One scene's lamps shine to both sides.
        if name == "many-lamps" {
            scene
                .materials
                .iter_mut()
                .for_each(|material| material.flags |= BACK_EMITS);
        }
    });
    let kinds = bench.scene.lights.iter().map(|light| light.kind);
    let mut numbers: Vec<(u32, u32)> = (0..).zip(kinds).map(|(number, kind)| (kind, number)).collect();
    numbers.sort_unstable();
    let of_kind = numbers.chunk_by(|one, other| one.0 == other.0);
    let some = of_kind.flat_map(|all| [0, all.len() / 2, all.len() - 1].map(|i| all[i].1));
    let mut lights: Vec<u32> = some.collect();
    lights.dedup();
    (bench, lights)
}

/// Starts at a light, towards a sphere if its radius isn't 0.
fn starts(bench: &mut Bench, light: u32, target: [f32; 4], count: u32) -> Vec<(AskedStart, FoundStart)> {
    let numbers: Vec<[f32; 4]> = random_numbers(2 * count).collect();
    let ask = |n: &[[f32; 4]]| AskedStart {
        u: n[0],
        target,
        light,
        side: n[1][0],
        unused: [0; 2],
    };
    let asked: Vec<AskedStart> = numbers.chunks_exact(2).map(ask).collect();
    let (features, sampler) = (bench.scene.features, bench.config.sampler);
    let found = probe(bench, &shaders::EMISSION_PROBE, features, sampler, &asked);
    asked.into_iter().zip(found).collect()
}

#[test]
fn each_light_emits_what_it_emits_in_f64() {
    for name in SCENES {
        let (mut bench, lights) = bench_with_lights(name);
        for light in lights {
            let starts = starts(&mut bench, light, [0.0; 4], 1000);
            let mut agreement = Agreement::default();
            for (asked, found) in &starts {
                let u = asked.u.map(f64::from);
                let (place, direction) = (DVec2::new(u[0], u[1]), DVec2::new(u[2], u[3]));
                let expected = cpu::sample_emission(&bench.inputs(), light, place, direction, asked.side.into());
                // Rounding of coordinates within ±2, and of sines and cosines.
                let same = xyz(found.origin).distance(expected.ray.origin) < 4e-6
                    && xyz(found.direction).distance(expected.ray.direction) < 4e-6
                    && xyz(found.flux).distance(expected.flux) <= 1e-4 * expected.flux.length();
                agreement.note(same, || format!("{found:?} instead of {expected:?}, {asked:?}"));
            }
            let kind = bench.scene.lights[light as usize].kind;
            // Next to the edge of an environment's pixel or of a texel a number lies on either side by rounding.
            agreement.assert(&format!("starts at light {light} of {name}, kind {kind}"), 0.99, 1000);
        }
    }
}

/// The squared distance of a sphere's centre from a ray, or from a line without origin, over its squared radius.
fn off_centre(start: &FoundStart, sphere: [f32; 4]) -> f64 {
    let (to_centre, direction) = (xyz(sphere) - xyz(start.origin), xyz(start.direction));
    let along = to_centre.dot(direction);
    let is_line = start.direction[3] != 0.0;
    let nearest = if is_line { along } else { along.max(0.0) } * direction;
    (to_centre - nearest).length_squared() / f64::from(sphere[3]).powi(2)
}

/// Mean and variance of the mean of the flux through a sphere, and of its products with the direction and with the distance from
/// the centre.
fn flux_through(starts: &[(AskedStart, FoundStart)], sphere: [f32; 4]) -> [[f64; 2]; 5] {
    let of_start = |(_, start): &(AskedStart, FoundStart)| {
        let off = off_centre(start, sphere);
        let flux = if off <= 1.0 { xyz(start.flux).element_sum() } else { 0.0 };
        let direction: DVec3 = xyz(start.direction);
        [1.0, direction.x, direction.y, direction.z, off].map(|factor| flux * factor)
    };
    let values: Vec<[f64; 5]> = starts.iter().map(of_start).collect();
    let count = values.len() as f64;
    std::array::from_fn(|i| {
        let mean = values.iter().map(|value| value[i]).sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value[i] - mean).powi(2)).sum();
        [mean, squares / (count * (count - 1.0))]
    })
}

/// A hundred hits and more: six standard errors fail a right program once in 10⁷ times for each of fewer than 1000 numbers. (The random
/// numbers are the same in every run.)
#[test]
fn aiming_at_a_sphere_leaves_the_flux_through_it_as_it_is() {
    const COUNT: u32 = 40_000;
    for name in SCENES {
        let (mut bench, lights) = bench_with_lights(name);
        for light in lights {
            let everywhere = starts(&mut bench, light, [0.0; 4], COUNT);
            let (_, first) = everywhere[0];
            for (way, radius) in [(0.0, 0.3), (0.3, 0.2), (0.7, 0.3), (0.9, 0.15)] {
                // Light from afar starts on discs that cover the scene, and nothing beyond it.
                let is_distant = first.direction[3] != 0.0;
                let centre = if is_distant {
                    (way - 0.5) * DVec3::new(0.6, 0.4, -0.5)
                } else {
                    xyz(first.origin) + way * xyz(first.direction)
                };
                let sphere = centre.as_vec3().extend(radius).to_array();
                let aimed = starts(&mut bench, light, sphere, COUNT);
                for (asked, start) in &aimed {
                    let is_known = start.origin[3] != 0.0;
                    assert!(
                        !is_known || off_centre(start, sphere) < 1.0 + 1e-4,
                        "{name}: {start:?} is said to hit {sphere:?}, {asked:?}"
                    );
                }
                let hits = |starts: &[(_, FoundStart)]| {
                    let hit = starts.iter().filter(|(_, start)| off_centre(start, sphere) <= 1.0);
                    hit.count()
                };
                let (by_chance, by_aim) = (hits(&everywhere), hits(&aimed));
                assert!(
                    by_chance > 100 && by_aim >= by_chance,
                    "{name}, light {light}, {sphere:?}: {by_aim} of {COUNT} aimed starts hit it, {by_chance} of the others"
                );
                let (found, expected) = (flux_through(&aimed, sphere), flux_through(&everywhere, sphere));
                for (number, (found, expected)) in found.iter().zip(&expected).enumerate() {
                    let error = (found[1] + expected[1]).sqrt();
                    assert!(
                        (found[0] - expected[0]).abs() <= 6.0 * error + 1e-4 * expected[0].abs(),
                        "{name}, light {light}, {sphere:?}, moment {number}: {} aimed, {} everywhere, ± {error}",
                        found[0],
                        expected[0]
                    );
                }
            }
        }
    }
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct AskedGuide {
    position: [f32; 4],
    normal: [f32; 4],
    u: [f32; 4],
}

/// The moments of cosine-distributed directions, 1 and 2n/3, are those of guided ones with their weights. The bound is that above.
#[test]
fn guided_photons_leave_as_by_the_cosine() {
    const COUNT: u32 = 40_000;
    let config = RenderConfig {
        aims_anyway: true,
        ..small()
    };
    let mut bench = Bench::new("blinds", config);
    let table: Vec<Vec4> = bench.download(BufferId::EmissionTable);
    let [_, targets, view, _] = table[0].to_array().map(f32::to_bits);
    assert!(view < targets, "nothing is guided in this scene");
    let sphere = table[1 + view as usize];
    let (centre, radius) = (sphere.truncate().as_dvec3(), f64::from(sphere.w));
    // From just outside of where all is near, from afar, and from below the horizon in part; by half of the photons, and by fewer.
    for (way, lean, share) in [(2.05, 0.0, 0.5), (2.05, 1.0, 0.5), (2.3, 1.4, 0.375), (4.0, 0.5, 0.05)] {
        let axis = DVec3::new(0.48, 0.6, 0.64);
        let across = DVec3::new(0.8, 0.0, -0.6);
        let normal = axis * f64::cos(lean) + across * f64::sin(lean);
        let position = (centre - way * radius * axis).as_vec3().extend(0.0).to_array();
        let ask = |u: [f32; 4]| AskedGuide {
            position,
            normal: normal.as_vec3().extend(share).to_array(),
            u,
        };
        let asked: Vec<AskedGuide> = random_numbers(COUNT).map(ask).collect();
        let (features, sampler) = (bench.scene.features, bench.config.sampler);
        let found: Vec<[f32; 4]> = probe(&mut bench, &shaders::GUIDE_PROBE, features, sampler, &asked);
        let is_hit = |found: &&[f32; 4]| {
            let along = xyz(**found).dot(axis);
            along > 0.0 && way * way * (1.0 - along * along) <= 1.0
        };
        let hits = found.iter().filter(is_hit).count();
        assert!(
            hits as f32 > 0.6 * share * found.len() as f32,
            "{way} radii away: {hits} of {COUNT} go to the view"
        );
        let most = found.iter().map(|found| found[3]).fold(0.0, f32::max);
        assert!(
            most <= 1.0001 / (1.0 - share),
            "{way} radii away: a photon's flux is weighted by {most}, by {share} of them"
        );
        for (what, factor, expected) in [
            ("number", None, 1.0),
            ("normal", Some(normal), 2.0 / 3.0),
            ("axis", Some(axis), 2.0 / 3.0 * normal.dot(axis)),
        ] {
            let value = |found: &[f32; 4]| f64::from(found[3]) * factor.map_or(1.0, |factor| factor.dot(xyz(*found)));
            let count = found.len() as f64;
            let mean = found.iter().map(value).sum::<f64>() / count;
            let squares: f64 = found.iter().map(|found| (value(found) - mean).powi(2)).sum();
            let error = (squares / (count * (count - 1.0))).sqrt();
            assert!(
                (mean - expected).abs() < 6.0 * error + 1e-5,
                "{way} radii away, leaning by {lean}, {what}: {mean} instead of {expected}, ± {error}"
            );
        }
    }
}
