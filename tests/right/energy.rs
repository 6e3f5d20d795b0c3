//! Flux: what the lights emit is what surfaces absorb and what escapes, counted over all photons of an iteration.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, EmissionChoice, RenderConfig, Sampler};
use ppm_vk::internals::cpu;
use ppm_vk::internals::layout::{CAUSTIC, Photon};
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::stage::BufferId;

use crate::document::{Document, clear, light, matte, mirror};
use crate::furnace::{ALBEDO, MAX_DEPTH, closed_room};
use crate::measure::Measured;
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::{faceted, subject};

/// Photon paths: so many that each of the lanes has as many as any other.
pub const PATHS: u32 = 65_536;

/// Of them, what the CPU's independent samples have.
const PATHS_A_LANE: u32 = 16;

pub fn xyz([x, y, z]: [f32; 3]) -> DVec3 {
    dvec3(x.into(), y.into(), z.into())
}

/// The photons of each lane in the last batch.
pub fn photon_lanes(renderer: &mut Renderer) -> Vec<Vec<Photon>> {
    let gpu = renderer.gpu();
    let counts: Vec<u32> = gpu.download(BufferId::LaneCounts, None).expect("a download");
    let photons: Vec<Photon> = gpu.download(BufferId::LanePhotons, None).expect("a download");
    let lane = |(lane, &count): (usize, &u32)| {
        let numbers = 0..count as usize;
        numbers.map(|number| photons[number * counts.len() + lane]).collect()
    };
    counts.iter().enumerate().map(lane).collect()
}

fn config(direct: Direct) -> RenderConfig {
    RenderConfig {
        direct,
        radius: Some(0.01),
        max_depth: MAX_DEPTH,
        drop_unwanted: false,
        sampler: Sampler::Independent,
        // Paths of one power, none of which is rejected.
        emission: EmissionChoice::Power,
        // Of seed 0 one path stays in the faceted glass for longer.
        seed: 1,
        ..small(8, PATHS)
    }
}

/// The lanes of an iteration, on the device and on the CPU.
pub fn on_both(subject: &Subject, config: &RenderConfig) -> [(&'static str, Vec<Vec<Photon>>); 2] {
    let mut renderer = subject.renderer(config.clone());
    renderer.iterate().expect("iteration");
    assert_eq!(
        renderer.counters().truncated_paths,
        0,
        "the flux of paths that were ended is missing"
    );
    let plain = cpu::Renderer::new(&subject.packed, &subject.scene.cameras[0], config.clone()).expect("renderer");
    let lane = |lane: u32| {
        plain
            .trace_photon_paths(0, PATHS_A_LANE * lane..PATHS_A_LANE * (lane + 1))
            .0
    };
    let on_cpu = (0..PATHS / PATHS_A_LANE).map(lane).collect();
    [("device", photon_lanes(&mut renderer)), ("CPU", on_cpu)]
}

/// Mean over the paths of the flux that their photons have together, each with a weight, in the scene's units. The lanes
/// are independent samples: each has as many paths.
fn flux(subject: &Subject, lanes: &[Vec<Photon>], channel: usize, weight: impl Fn(u32) -> f64) -> Vec<f64> {
    assert_eq!(PATHS as usize % lanes.len(), 0, "lanes with as many paths");
    let paths_a_lane = f64::from(PATHS) / lanes.len() as f64;
    let area_unit = subject.scene.normalisation.scale.powi(2);
    let of_lane = |lane: &Vec<Photon>| {
        let photons = lane.iter();
        let sum: f64 = photons
            .map(|photon| xyz(photon.flux)[channel] * weight(photon.object & !CAUSTIC))
            .sum();
        sum / (paths_a_lane * area_unit)
    };
    lanes.iter().map(of_lane).collect()
}

/// A path with all its flux at each of its meetings with the walls: Φ (1 + ρ + ρ² + …). The walls, 24 m² of radiance 1,
/// shine to the outside as well, from where nothing comes back.
#[test]
fn photons_in_a_closed_room_carry_phi_over_one_minus_rho() {
    for with_spheres in [false, true] {
        let room = closed_room(with_spheres);
        for direct in [Direct::Photons, Direct::Light] {
            // Where rays bring the direct light, the first photon of a path that has met no sphere is left out.
            if with_spheres && direct == Direct::Light {
                continue;
            }
            for (place, lanes) in on_both(&room, &config(direct)) {
                for (channel, albedo) in ALBEDO.into_iter().enumerate() {
                    let all = 24.0 * PI / (1.0 - albedo);
                    let expected = if direct == Direct::Photons { all } else { albedo * all };
                    let what = format!("{place}, spheres: {with_spheres}, direct light by {direct:?}, albedo {albedo}");
                    Measured::of(flux(&room, &lanes, channel, |_| 1.0)).assert_is(expected, &what);
                }
            }
        }
    }
}

const FLOOR: [f64; 3] = [0.25, 0.5, 0.75];
const LAMP: [f64; 3] = [4.0, 2.0, 1.0];

/// A floor with a mirror and a glass sphere under a lamp; with a black sky around it or nothing.
fn under_the_sky(floor: [f64; 3], closed: bool) -> Subject {
    let mut scene = Document::new("under-the-sky");
    let floor = scene.material(matte("floor", floor));
    let lamp = scene.material(light("lamp", LAMP));
    let mirror = scene.material(mirror("mirror", [1.0; 3]));
    let glass = scene.material(clear("glass", 1.5));
    let black = scene.material(matte("sky", [0.0; 3]));
    scene.object("floor", &Mesh::facing_up(1.0, 0.0), floor);
    scene.object("lamp", &Mesh::facing_down(0.5, 1.5), lamp);
    let sphere = faceted(&Mesh::icosphere(0.35, 2));
    scene.object("mirror", &sphere, mirror).at([-0.5, 0.4, 0.0]);
    scene.object("glass", &sphere, glass).at([0.5, 0.4, 0.0]);
    if closed {
        let sky = Mesh::cuboid(DVec3::splat(-3.0), DVec3::splat(3.0)).flipped();
        scene.object("sky", &sky, black);
    }
    scene.camera([1.0, 2.9], [0.5, 0.0], 40.0);
    subject(scene)
}

/// What the sky gets is what escapes without it. The floor absorbs 1 − ρ of what it gets, and the lamp all.
#[test]
fn what_is_emitted_is_absorbed_or_escapes() {
    let [open, closed] = [false, true].map(|closed| under_the_sky(FLOOR, closed));
    let object = |name| {
        let object = closed.scene.objects.iter().position(|object| object.name == name);
        object.expect("an object") as u32
    };
    let (floor, lamp, sky) = (object("floor"), object("lamp"), object("sky"));
    let config = config(Direct::Photons);
    for ((place, open_lanes), (_, closed_lanes)) in on_both(&open, &config).into_iter().zip(on_both(&closed, &config)) {
        for channel in 0..3 {
            let absorbs = |id| match id {
                id if id == floor => 1.0 - FLOOR[channel],
                id if id == lamp => 1.0,
                _ => 0.0,
            };
            let absorbed = flux(&open, &open_lanes, channel, absorbs);
            let escaped = flux(&closed, &closed_lanes, channel, |id| f64::from(u8::from(id == sky)));
            // Both scenes have the same paths, so that a lane's sum is a sample as well.
            let sums: Vec<f64> = absorbed.iter().zip(&escaped).map(|(a, b)| a + b).collect();
            Measured::of(sums).assert_is(PI * LAMP[channel], &format!("{place}, channel {channel}"));
            let share = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64 / (PI * LAMP[channel]);
            println!(
                "  {:.1} % absorbed, {:.1} % escaped",
                100.0 * share(&absorbed),
                100.0 * share(&escaped)
            );
            let on_open_floor = share(&absorbed);
            assert!(
                (0.05..0.9).contains(&on_open_floor),
                "this scene shows little: {on_open_floor} is absorbed"
            );
        }
    }
}

/// Where all that is matte is black, every path ends with one photon that has all its flux. Not a path may differ.
#[test]
fn mirrors_and_glass_neither_gain_nor_lose_flux() {
    let black = under_the_sky([0.0; 3], true);
    for (place, lanes) in on_both(&black, &config(Direct::Photons)) {
        for (channel, radiance) in LAMP.into_iter().enumerate() {
            let sums = flux(&black, &lanes, channel, |_| 1.0);
            let expected = PI * radiance;
            let worst = sums.iter().map(|sum| (sum / expected - 1.0).abs()).fold(0.0, f64::max);
            println!("{place}, channel {channel}: a lane is off by {worst:.1e} at the most");
            assert!(
                worst < 1e-5,
                "{place}, channel {channel}: the flux of a lane is off by {worst}"
            );
        }
    }
}
