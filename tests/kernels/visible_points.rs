//! The stages `camera` and `direct`.
//!
//! Tolerances: the kernels compute in f32, whose rounding (6e-8 of the coordinates, which lie within ±1) the ray's
//! length and slope multiply a few times on flat surfaces; a sphere multiplies it by distance over radius at each
//! bounce. Where a ray passes an edge, or a random number lies next to a reflectance, rounding makes it take another
//! way: those are the few that may differ.

use bytemuck::Zeroable;
use half::f16;
use ppm_vk::config::{Direct, Estimator, RenderConfig, Sampler};
use ppm_vk::cpu::{self, CameraTurn, Counts, Seen};
use ppm_vk::layout::{DirectSum, Gloss, Light, Statistics};
use ppm_vk::record::Recording;
use ppm_vk::shaders;
use ppm_vk::stage::{BufferId, StageDesc};

use super::agreement::{Agreement, relative_difference};
use super::bench::{Bench, object, small, xyz};

/// The last of the first iteration's paths of a pixel, whose visible points the buffers hold.
fn last_turn(config: &RenderConfig) -> CameraTurn {
    let first = CameraTurn::that_gathers(config, 0);
    first.others().last().unwrap_or(first)
}

/// Angle between two encoded directions, rad.
fn angle(a: f32, b: f32) -> f64 {
    cpu::decode_direction(a.to_bits()).angle_between(cpu::decode_direction(b.to_bits()))
}

fn same_gloss(found: &Gloss, expected: &Gloss) -> bool {
    let near = |a: [f32; 4], b: [f32; 4]| xyz(a).distance(xyz(b)) <= 1e-6;
    // Rounded to f16, where a texture was between two of them to either side.
    let numbers = |gloss: &Gloss| {
        let halves = gloss
            .rest
            .into_iter()
            .flat_map(|word| [word as u16, (word >> 16) as u16]);
        halves.map(|bits| f16::from_bits(bits).to_f64())
    };
    near(found.diffuse_viewer, expected.diffuse_viewer)
        && numbers(found)
            .zip(numbers(expected))
            .all(|(found, expected)| (found - expected).abs() < 1e-3)
        && angle(found.diffuse_viewer[3], expected.diffuse_viewer[3]) < 1.5e-4
}

fn assert_camera_agrees(name: &str, config: RenderConfig, least_seen: usize) {
    let what = format!("visible points of {name}, {:?}", config.estimator);
    let mut bench = Bench::new(name, config);
    let Seen {
        points: found,
        gloss,
        footprints,
    } = bench.seen();
    let counts = Counts::default();
    let Seen {
        points: expected,
        gloss: expected_gloss,
        footprints: expected_footprints,
    } = cpu::camera(&bench.inputs(), last_turn(&bench.config), &counts);
    assert_eq!(found.len(), expected.len(), "{what}: slots");
    let (mut places, mut seen) = (Agreement::default(), Agreement::default());
    for (slot, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let objects = (object(found.position_object), object(expected.position_object));
        let distance = xyz(found.position_object).distance(xyz(expected.position_object));
        places.note(objects.0 == objects.1 && distance < 2e-5, || {
            format!("slot {slot}: objects {objects:?}, {distance:e} apart (device, CPU)")
        });
        if objects.0.is_some() && objects.0 == objects.1 && distance < 2e-5 {
            let (weight, expected_weight) = (xyz(found.weight_normal), xyz(expected.weight_normal));
            let emitted = (xyz(found.emitted_normal), xyz(expected.emitted_normal));
            // A step of the octahedral code turns a direction by 1.3e-4 rad at the most.
            let turned = angle(found.weight_normal[3], expected.weight_normal[3])
                .max(angle(found.emitted_normal[3], expected.emitted_normal[3]));
            // A reflectance is the square of a difference, which may be small, and steep next to the critical angle.
            let same = weight.distance(expected_weight) <= 1e-4 * expected_weight.length()
                && emitted.0.distance(emitted.1) <= 1e-5 * emitted.1.length()
                && turned < 1.5e-4
                && (footprints[slot] / expected_footprints[slot] - 1.0).abs() < 1e-4
                && (gloss.is_empty() || same_gloss(&gloss[slot], &expected_gloss[slot]));
            seen.note(same, || {
                format!(
                    "slot {slot}: weights {weight} {expected_weight}, emitted {emitted:?}, normals {turned:e} rad apart, \
                     footprints {} {}",
                    footprints[slot], expected_footprints[slot]
                )
            });
        }
    }
    places.assert(&what, 0.999, found.len());
    seen.assert(&format!("weights and normals of the {what}"), 0.995, least_seen);
}

#[test]
fn camera_paths_end_where_the_cpus_end() {
    for name in [
        "cornell-spheres",
        "ring",
        "glossy",
        "glasses",
        "coats",
        "textures",
        "instances",
        "ring, lit",
        "glasses, lit",
        "cornell-spheres, softly lit",
        "glasses, softly lit",
    ] {
        assert_camera_agrees(name, small(), 3000);
    }
    // A third of the picture is the void.
    assert_camera_agrees("plaza", small(), 2000);
}

#[test]
fn camera_paths_that_split_at_glass_fill_the_same_slots() {
    for (name, least_seen) in [("cornell-spheres", 4000), ("pool", 3000), ("plaza", 1000)] {
        // Of an odd height: rays through the pixels' centres meet the very edges of the symmetric room otherwise.
        let config = RenderConfig {
            estimator: Estimator::Ppm,
            resolution: [64, 63],
            ..small()
        };
        assert_camera_agrees(name, config, least_seen);
    }
}

#[test]
fn a_picture_that_cuts_its_tiles_fills_the_same_slots() {
    let config = RenderConfig {
        resolution: [51, 29],
        ..small()
    };
    assert_camera_agrees("cornell", config, 700);
}

/// Runs the stage `direct` over cleared sums; returns the radiance of each slot.
fn direct_on_device(bench: &mut Bench, turn: CameraTurn) -> Vec<DirectSum> {
    let mut recording = Recording::new();
    recording.fill(BufferId::DirectSums, 0);
    let slots = bench.renderer.sizes().slots();
    let mut constants = vec![
        ("SAMPLE_LIGHTS", u32::from(bench.config.direct == Direct::Light)),
        ("SAMPLER", bench.config.sampler as u32),
    ];
    let features = bench.scene.features.constants();
    constants.extend(features.map(|(name, present)| (name, u32::from(present))));
    recording.dispatch(
        StageDesc::new(&shaders::DIRECT, slots)
            .constants(constants)
            .push(turn.words())
            .bind(vec![(BufferId::SequenceSums, BufferId::Sequence0Sums)]),
    );
    bench.renderer.run(&recording).expect("a run");
    bench.download(BufferId::DirectSums)
}

/// What the device and the CPU say of the light behind glass at the same visible points.
#[test]
fn light_behind_glass_agrees_at_the_same_visible_points() {
    let cases = [
        ("cornell-spheres", 0, 100),
        ("cornell-spheres", 5, 50),
        ("pool", 0, 2000),
        ("pool", 5, 1000),
        ("cornell-spheres, lit", 0, 30),
    ];
    for (name, iteration, least) in cases {
        let mut bench = Bench::new(name, small());
        let seen = bench.seen();
        // In the first iteration all ask; later those who have enough photons in the last map don't.
        let mut statistics: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
        for (receiver, statistics) in statistics.iter_mut().enumerate() {
            statistics.accepted_low = receiver as u32 * 7 % 32;
        }
        bench.upload(BufferId::StatisticsOf, &statistics);
        let turn = CameraTurn {
            iteration,
            ..CameraTurn::FIRST
        };
        let found = direct_on_device(&mut bench, turn);
        let nothing = DirectSum {
            high: [0.0; 4],
            low: [0.0; 4],
        };
        let mut expected = vec![nothing; seen.points.len()];
        let counts = Counts::default();
        let mut sums = vec![[0.0; 4]; seen.points.len()];
        cpu::direct(
            &bench.inputs(),
            turn,
            &seen,
            &statistics,
            &counts,
            &mut expected,
            &mut sums,
        );
        let mut agreement = Agreement::default();
        for (slot, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found.low[3], expected.low[3], "{name}, slot {slot}: times asked");
            let (found, expected) = (f64::from(found.high[3]), f64::from(expected.high[3]));
            if found > 0.0 || expected > 0.0 {
                agreement.note(relative_difference(found, expected) < 1e-4, || {
                    format!("slot {slot}: {found} on the device, {expected} on the CPU")
                });
            }
        }
        // Rays that graze the edge of a tessellated ball.
        agreement.assert(&format!("light behind glass in {name}"), 0.98, least);
    }
}

/// How the device's radiance agrees with the CPU's at the very same visible points.
fn compare_direct(bench: &mut Bench, tolerance: f64) -> Agreement {
    let seen = bench.seen();
    let statistics: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    let found = direct_on_device(bench, CameraTurn::FIRST);
    let mut expected = vec![
        DirectSum {
            high: [0.0; 4],
            low: [0.0; 4]
        };
        seen.points.len()
    ];
    cpu::direct(
        &bench.inputs(),
        CameraTurn::FIRST,
        &seen,
        &statistics,
        &Counts::default(),
        &mut expected,
        &mut vec![[0.0; 4]; seen.points.len()],
    );
    let mut agreement = Agreement::default();
    for (slot, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let (found, expected) = (xyz(found.high) + xyz(found.low), xyz(expected.high) + xyz(expected.low));
        if found.length() > 0.0 || expected.length() > 0.0 {
            let difference = relative_difference(found.element_sum(), expected.element_sum());
            agreement.note(difference < tolerance, || {
                format!("slot {slot}: {found} on the device, {expected} on the CPU")
            });
        }
    }
    agreement
}

#[test]
fn direct_light_agrees_at_the_same_visible_points() {
    for (name, least) in [
        ("cornell-spheres", 2500),
        ("ring", 2000),
        ("furnace-closed", 4000),
        ("glossy", 2500),
        ("instances", 2000),
        ("ring, lit", 2000),
        ("glossy, lit", 1000),
        ("glossy, softly lit", 1000),
        ("cornell-spheres, patterned", 1500),
        ("glossy, patterned", 1500),
        ("glossy, lit, patterned", 500),
    ] {
        let mut bench = Bench::new(name, small());
        // Light that grazes a surface has a cosine of which rounding is a larger part.
        compare_direct(&mut bench, 1e-4).assert(&format!("direct light in {name}"), 0.995, least);
    }
}

#[test]
fn light_that_is_seen_directly_agrees_without_sampling() {
    let config = RenderConfig {
        direct: Direct::Photons,
        ..small()
    };
    let mut bench = Bench::new("furnace-closed", config);
    compare_direct(&mut bench, 1e-6).assert("emitted light in furnace-closed", 1.0, 4000);
}

#[test]
fn random_numbers_are_the_same_to_the_last_bit() {
    for sampler in [Sampler::Sobol, Sampler::Independent, Sampler::Congruential] {
        assert_same_random_numbers(sampler);
    }
}

fn assert_same_random_numbers(sampler: Sampler) {
    // Each visible point chooses a light by its numbers. There are many more cells of lights than points, each of which
    // ends right below or right above what of its point's number lies in it: 12 digits more or less below the first 24 choose
    // another light; the radiance, in proportion to the light's area, tells which one it was. The emitter is the same
    // triangle for all.
    const CELLS: u32 = 1 << 16;
    const MARGIN: f64 = 1.0 / (1 << 20) as f64;
    let mut bench = Bench::new("light-area", RenderConfig { sampler, ..small() });
    let light = |area| Light {
        triangle: bench.scene.lights[0].triangle,
        probability: 1.0,
        area,
        accept: 1.0,
        alias: CELLS - 1,
        // All of its triangle.
        position: [0.0, 0.0, 1.0],
        ..Light::zeroed()
    };
    let mut lights = vec![light(1.0); CELLS as usize];
    for slot in 0..bench.settings.resolution[0] * bench.settings.resolution[1] {
        let mut random = cpu::Random::of_pixel(&bench.config, cpu::PathKind::LightSample, slot, CameraTurn::FIRST);
        let [u, ..] = random.next4();
        let [digits, ..] = random.next4();
        let place = (u + digits / f64::from(1 << 24)) * f64::from(CELLS);
        let side = if slot % 2 == 0 { MARGIN } else { -MARGIN };
        lights[place as usize].accept = (place.fract() + side).clamp(1e-9, 1.0) as f32;
    }
    lights[CELLS as usize - 1] = light(2.0);
    bench.settings.light_count = CELLS;
    let settings = bench.settings;
    bench.upload(BufferId::Settings, &[settings]);
    bench.upload(BufferId::Lights, &lights);
    bench.scene.lights = lights;
    bench.scene.media_of_lights = vec![[u32::MAX; 4]; CELLS as usize];
    compare_direct(&mut bench, 6e-5).assert(&format!("choices that hang on the last bit, {sampler:?}"), 0.999, 500);
}
