//! The stages `photons` and `compact`.

use ppm_vk::config::{Accel, Direct, EmissionChoice, RenderConfig};
use ppm_vk::cpu::{self, Batch, Counts, Traced};
use ppm_vk::emission::PathValue;
use ppm_vk::layout::Photon;
use ppm_vk::stage::BufferId;

use super::agreement::{Agreement, relative_difference};
use super::bench::{Bench, object, small, xyz};

/// The photons of each lane as the device stored them: number-major, `[number][lane]`.
fn lanes_on_device(bench: &mut Bench) -> Vec<Vec<Photon>> {
    let counts: Vec<u32> = bench.download(BufferId::LaneCounts);
    let stored: Vec<Photon> = bench.download(BufferId::LanePhotons);
    let lanes = counts.len();
    let lane = |(lane, &count): (usize, &u32)| {
        (0..count as usize)
            .map(|number| stored[number * lanes + lane])
            .collect()
    };
    counts.iter().enumerate().map(lane).collect()
}

fn same(found: &Photon, expected: &Photon, tolerance: f64) -> bool {
    let direction = |photon: &Photon| cpu::decode_direction(photon.flux_direction[3].to_bits());
    let (flux, expected_flux) = (xyz(found.flux_direction), xyz(expected.flux_direction));
    object(found.position_object) == object(expected.position_object)
        && xyz(found.position_object).distance(xyz(expected.position_object)) < tolerance
        && flux.distance(expected_flux) < 1e-4 * expected_flux.length()
        // A step of the octahedral code turns a direction by 1.3e-4 rad at the most.
        && direction(found).angle_between(direction(expected)) < 1.5e-4 + tolerance
}

fn total_flux(lanes: &[Vec<Photon>]) -> f64 {
    lanes
        .iter()
        .flatten()
        .map(|photon| xyz(photon.flux_direction).element_sum())
        .sum()
}

/// Of paths that are aimed and of those that start by power.
fn assert_photons_agree(name: &str, config: RenderConfig, tolerance: f64, least_share: f64, least_photons: usize) {
    for emission in [EmissionChoice::Aimed, EmissionChoice::Power] {
        let config = RenderConfig {
            emission,
            aims_anyway: true,
            ..config.clone()
        };
        assert_agree(name, config, tolerance, least_share, least_photons);
    }
}

fn assert_agree(name: &str, config: RenderConfig, tolerance: f64, least_share: f64, least_photons: usize) {
    let what = format!(
        "photons of {name}, direct light from {:?}, {:?}, {:?}",
        config.direct, config.accel, config.emission
    );
    let mut bench = Bench::new(name, config);
    let found = lanes_on_device(&mut bench);
    let batch = Batch {
        iteration: 0,
        first_path: 0,
        paths: bench.config.photons,
    };
    let Traced {
        lanes: expected,
        values,
    } = cpu::photons(&bench.inputs(), batch, &Counts::default());
    assert_eq!(found.len(), expected.len(), "{what}: lanes");
    if bench.config.emission == EmissionChoice::Aimed {
        let mut worth = Agreement::default();
        let of_device: Vec<u32> = bench.download(BufferId::PathValues);
        for (path, (found, expected)) in of_device.iter().zip(&values).enumerate() {
            let (found, expected) = (PathValue::unpacked(*found), PathValue::unpacked(*expected));
            let off = relative_difference(found.value.into(), expected.value.into());
            let same = found.rays == expected.rays && (found.value == expected.value || off < 1e-3);
            worth.note(same, || {
                format!("path {path}: {found:?} on the device, {expected:?} on the CPU")
            });
        }
        worth.assert(&format!("values of {what}"), least_share, values.len());
    }
    let (mut lanes, mut photons) = (Agreement::default(), Agreement::default());
    for (lane, (found, expected)) in found.iter().zip(&expected).enumerate() {
        lanes.note(found.len() == expected.len(), || {
            format!(
                "lane {lane}: {} photons on the device, {} on the CPU",
                found.len(),
                expected.len()
            )
        });
        if found.len() == expected.len() {
            for (number, (found, expected)) in found.iter().zip(expected).enumerate() {
                photons.note(same(found, expected, tolerance), || {
                    format!("photon {number} of lane {lane}: {found:?} on the device, {expected:?} on the CPU")
                });
            }
        }
    }
    lanes.assert(&format!("lanes with as many {what}"), least_share, 64);
    photons.assert(&what, least_share, least_photons);
    let (found, expected) = (total_flux(&found), total_flux(&expected));
    println!("{what}: flux {found} on the device, {expected} on the CPU");
    assert!(
        relative_difference(found, expected) < 1e-3,
        "{what}: flux {found} on the device, {expected} on the CPU"
    );
}

fn photons_carry_all_light() -> RenderConfig {
    RenderConfig {
        direct: Direct::Photons,
        ..small()
    }
}

#[test]
fn photons_on_flat_matte_walls_land_where_the_cpus_do() {
    // A matte bounce draws its direction anew, so rounding doesn't grow along a path: a few 1e-7 of the direction (of
    // its sine and cosine above all), times the distance, over the cosine at which the photon arrives.
    assert_photons_agree("cornell", photons_carry_all_light(), 1e-4, 0.999, 8000);
}

#[test]
fn photons_that_pass_glass_and_mirrors_land_where_the_cpus_do() {
    // Between curved mirrors and glass rounding does grow, by distance over radius at each bounce, and a random number
    // next to a reflectance sends a path another way.
    assert_photons_agree("cornell-spheres", photons_carry_all_light(), 1e-4, 0.995, 7000);
}

#[test]
fn photons_that_microfacets_scatter_land_where_the_cpus_do() {
    assert_photons_agree("glossy", photons_carry_all_light(), 1e-4, 0.995, 7000);
    assert_photons_agree("glasses", photons_carry_all_light(), 1e-4, 0.99, 7000);
    assert_photons_agree("coats", photons_carry_all_light(), 1e-4, 0.99, 7000);
}

#[test]
fn photons_in_a_scene_of_textures_land_where_the_cpus_do() {
    assert_photons_agree("textures", photons_carry_all_light(), 1e-4, 0.995, 7000);
}

#[test]
fn photons_of_lamps_with_a_pattern_land_where_the_cpus_do() {
    assert_photons_agree(
        "cornell-spheres, patterned",
        photons_carry_all_light(),
        1e-4,
        0.995,
        4000,
    );
}

#[test]
fn photons_among_instances_land_where_the_cpus_do() {
    // The studs' normals are steep: they make more of what rounding makes of a place.
    assert_photons_agree("instances", photons_carry_all_light(), 1e-4, 0.98, 7000);
}

#[test]
fn photons_of_every_kind_of_light_land_where_the_cpus_do() {
    for name in [
        "cornell-spheres, lit",
        "ring, lit",
        "glasses, lit",
        "glasses, softly lit",
    ] {
        // Many of the environment's meet nothing, or what isn't seen.
        assert_photons_agree(name, photons_carry_all_light(), 1e-4, 0.99, 900);
    }
}

#[test]
fn photons_of_indirect_light_leave_out_the_first_matte_surface() {
    assert_photons_agree("cornell-spheres", small(), 1e-4, 0.995, 4000);
}

#[test]
fn photons_that_test_every_triangle_are_those_that_use_the_hierarchy() {
    let config = RenderConfig {
        accel: Accel::Brute,
        ..photons_carry_all_light()
    };
    assert_photons_agree("cornell", config, 1e-4, 0.999, 8000);
}

#[test]
fn photons_lie_together_in_the_order_of_lanes() {
    let mut bench = Bench::new("cornell", photons_carry_all_light());
    let lanes = lanes_on_device(&mut bench);
    let expected = cpu::compact(&lanes);
    let found = bench.photons();
    assert_eq!(found.len(), expected.len(), "photons");
    for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
        // An object's number may be a NaN's bits.
        assert_eq!(
            bytemuck::bytes_of(found),
            bytemuck::bytes_of(expected),
            "photon {i}: {found:?}, {expected:?}"
        );
    }
    let mut offsets: Vec<u32> = lanes.iter().map(|lane| lane.len() as u32).collect();
    cpu::scan(&mut offsets);
    assert_eq!(bench.download::<u32>(BufferId::LaneOffsets), offsets);
}
