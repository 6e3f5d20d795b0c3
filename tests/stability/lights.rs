//! Lights and photons of very different power in one scene.

use glam::Vec3;
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::gather::METHODS;
use ppm_vk::internals::layout::{Gathered, Photon, VisiblePoint};
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::scene::Scene;
use ppm_vk::internals::shaders;
use ppm_vk::internals::stage::{BufferId, StageDesc};

use super::bench::{Bench, photon, visible_point};
use super::model::Model;
use super::sound::assert_sound;
use super::uniform::{add_ball_in_room, assert_lit_by_photons, assert_lit_by_shadow_rays};

const DIM: f32 = 1e-6;
const BRIGHT: f32 = 1e6;

/// Two rooms without a door. Camera 0 is in the dim room, camera 1 in the bright one.
fn two_rooms() -> Scene {
    let mut model = Model::new();
    add_ball_in_room(&mut model, Vec3::X * -3.0, 1.0, DIM);
    add_ball_in_room(&mut model, Vec3::X * 3.0, 1.0, BRIGHT);
    model.scene()
}

#[test]
fn light_of_1e_minus_6_is_right_beside_light_of_1e6_in_separate_rooms() {
    let scene = two_rooms();
    assert_lit_by_shadow_rays("light of 1e-6", &scene, 0, DIM);
    assert_lit_by_shadow_rays("light of 1e6", &scene, 1, BRIGHT);
    assert_lit_by_photons("two rooms", &scene, &[DIM, BRIGHT]);
}

/// The flux of a photon must survive storing, compacting, sorting and gathering.
#[test]
fn a_photons_power_survives_its_way_to_the_gather_over_twelve_orders_of_magnitude() {
    let config = RenderConfig {
        resolution: [8, 8],
        photons: 64,
        radius: Some(0.1),
        ..RenderConfig::default()
    };
    let mut bench = Bench::new("cornell", config);
    // Slot i lies on object i and receives one photon, stored by lane i.
    let power = |i: u32| 10f32.powf(-6.0 + 12.0 * i as f32 / 63.0);
    let flux = |i: u32| [power(i), 1.0 / power(i), 1.0];
    let objects = bench.scene.object_grids.len() as u32;
    let object = |i: u32| i % objects;
    let place = |i: u32| [-0.9 + 0.25 * (i % 8) as f32, -0.9 + 0.25 * (i / 8) as f32, 0.0];
    let points: Vec<VisiblePoint> = (0..64).map(|i| visible_point(place(i), object(i))).collect();
    let lanes = bench.settings.photon_lanes;
    assert_eq!(lanes, 64, "one lane a photon");
    let photons: Vec<Photon> = (0..lanes).map(|i| photon(place(i), object(i), flux(i))).collect();
    bench.upload(BufferId::LanePhotons, &photons);
    bench.upload(BufferId::LaneCounts, &vec![1u32; 64]);
    bench.upload(BufferId::LaneOffsets, &(0..64).collect::<Vec<u32>>());
    bench.upload(BufferId::ScanTotal, &[64u32]);
    bench.upload(BufferId::VisiblePoints, &points);
    let mut compact = Recording::new();
    compact.dispatch(StageDesc::new(&shaders::COMPACT, bench.renderer.sizes().lane_photons()));
    bench.renderer.run(&compact).expect("a run");
    for (index, method) in METHODS
        .iter()
        .enumerate()
        .filter(|(_, method)| method.stages().is_some())
    {
        bench.renderer.gather(index, Default::default()).expect("a gather");
        for (i, gathered) in (0..).zip(bench.download::<Gathered>(BufferId::GatheredOf)) {
            assert_eq!(gathered.count, 1, "{}, slot {i}: M", method.name);
            for (found, stored) in gathered.flux.into_iter().zip(flux(i)) {
                let off = (f64::from(found) / f64::from(stored) - 1.0).abs();
                assert!(off <= 1e-6, "{}, slot {i}: flux {found}, {stored} stored", method.name);
            }
        }
    }
    assert_sound(&mut bench.renderer);
}
