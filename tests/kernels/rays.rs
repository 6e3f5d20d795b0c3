//! Ray-triangle intersection on the device: despite rounding no ray may pass between two triangles, whether kernels or the
//! device's ray queries trace it.

use glam::Vec3;
use ppm_vk::internals::config::{Accel, RenderConfig, TriangleTest};
use ppm_vk::internals::gpu::{Device, best_device};
use ppm_vk::internals::packing::{PackedScene, SceneFeatures};
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::scene::{Object, Placement, SHARED, Scene, Triangle};
use ppm_vk::internals::shaders;
use ppm_vk::internals::stage::{BufferId, RAY_QUERY, StageDesc};

use super::bench::{random_numbers, scene};

/// A ray as the probe reads it: origin, then direction.
pub type Ray = [[f32; 4]; 2];

/// Rays traced at once.
const BATCH: usize = 1 << 17;

pub fn ray(origin: Vec3, direction: Vec3) -> Ray {
    [origin, direction].map(|v| [v.x, v.y, v.z, 0.0])
}

/// Results of the probe.
pub struct Probe {
    renderer: Renderer,
    triangle_test: TriangleTest,
    accel: Accel,
    features: SceneFeatures,
}

/// The available ways to trace rays. Prints a message without ray queries.
pub fn accels() -> Vec<Accel> {
    let device = best_device().expect("a device");
    let mut accels = vec![Accel::Bvh, Accel::Brute];
    if device.ray_query {
        accels.push(Accel::RayQuery);
    } else {
        println!(
            "ray queries skipped: {} has no ray queries (VK_KHR_ray_query)",
            device.name
        );
    }
    accels
}

impl Probe {
    pub fn with(scene: &Scene, triangle_test: TriangleTest, accel: Accel) -> Self {
        let packed = PackedScene::new(scene).expect("a hierarchy");
        let config = RenderConfig {
            resolution: [8, 8],
            photons: 64,
            radius: Some(0.1),
            triangle_test,
            accel,
            ..RenderConfig::default()
        };
        let device = Device::open(None).expect("a Vulkan device");
        let renderer = Renderer::new(device, &packed, &scene.cameras[0], config).expect("a renderer");
        Self {
            renderer,
            triangle_test,
            accel,
            features: packed.features,
        }
    }

    /// t, u, v, and the bits of the object or of `u32::MAX`.
    pub fn hits(&mut self, rays: &[Ray]) -> Vec<[f32; 4]> {
        self.renderer.gpu().upload(BufferId::ProbeFrom, rays).expect("rays");
        let gpu = self.renderer.gpu();
        gpu.create(BufferId::ProbeTo, (16 * rays.len()) as u64).expect("hits");
        let mut recording = Recording::new();
        let constants = vec![
            ("HAVEL", u32::from(self.triangle_test == TriangleTest::Havel)),
            ("BRUTE_FORCE", u32::from(self.accel == Accel::Brute)),
            (RAY_QUERY, u32::from(self.accel == Accel::RayQuery)),
            ("INSTANCED", u32::from(self.features.instanced)),
        ];
        recording.dispatch(
            StageDesc::new(&shaders::RAY_PROBE, rays.len() as u32)
                .constants(constants)
                .push(shaders::CountPush {
                    count: rays.len() as u32,
                }),
        );
        gpu.run(&recording).expect("a run");
        gpu.download(BufferId::ProbeTo, Some(rays.len())).expect("hits")
    }

    /// How many of the rays hit nothing, and one of them.
    fn leaks(&mut self, rays: impl Iterator<Item = Ray>) -> (usize, usize, Option<Ray>) {
        let (mut traced, mut leaked, mut first) = (0, 0, None);
        let mut rays = rays.peekable();
        while rays.peek().is_some() {
            let batch: Vec<Ray> = rays.by_ref().take(BATCH).collect();
            let hits = self.hits(&batch);
            for (ray, hit) in batch.iter().zip(&hits) {
                traced += 1;
                let missed = hit[3].to_bits() == u32::MAX;
                assert!(missed || (hit[0] > 0.0 && hit[0].is_finite()), "{ray:?} meets {hit:?}");
                if missed {
                    leaked += 1;
                    first.get_or_insert(*ray);
                }
            }
        }
        (traced, leaked, first)
    }
}

/// Both triangle tests for the same rays: none may pass with the watertight one; those that pass with Havel's are counted.
fn assert_tight(what: &str, scene: &Scene, rays: impl Fn() -> Box<dyn Iterator<Item = Ray>>) {
    let (_, by_havel, _) = Probe::with(scene, TriangleTest::Havel, Accel::Bvh).leaks(rays());
    println!("{what}: {by_havel} rays leave with Havel's test");
    for accel in accels().into_iter().filter(|&accel| accel != Accel::Brute) {
        let (traced, leaked, first) = Probe::with(scene, TriangleTest::Watertight, accel).leaks(rays());
        println!("{what}: of {traced} rays {leaked} leave by {accel:?}");
        assert_eq!(
            leaked, 0,
            "{what}: of {traced} rays by {accel:?} that leave, one is {first:?}"
        );
    }
}

#[test]
fn rays_meet_the_same_triangles_at_the_same_places_by_every_search() {
    for name in ["cornell-spheres", "pool", "instances", "glasses"] {
        let scene = scene(name);
        let numbers: Vec<[f32; 4]> = random_numbers(2 * if long() { 1_000_000 } else { 20_000 }).collect();
        let place = |[x, y, z, _]: [f32; 4]| 1.8 * Vec3::new(x, y, z) - 0.9;
        let rays: Vec<Ray> = numbers
            .chunks_exact(2)
            .map(|pair| ray(place(pair[0]), place(pair[1]) - place(pair[0])))
            .collect();
        // Some drivers end loops early; a ray may use a quarter of the limit.
        let limit = Device::open(None)
            .and_then(|mut device| device.loop_limit())
            .expect("a limit");
        let triangles = PackedScene::new(&scene).expect("a hierarchy").seen_triangles();
        let is_cut = limit != u32::MAX && triangles > u64::from(limit / 4);
        if is_cut {
            println!("{name}: skipped brute, since the driver ends loops after {limit} iterations");
        }
        let mut tests = vec![TriangleTest::Watertight];
        // With instances, each search rounds the transform to the space of Havel's planes on its own.
        if name != "instances" {
            tests.push(TriangleTest::Havel);
        }
        for test in tests {
            let mut hits = accels()
                .into_iter()
                .filter(|accel| *accel != Accel::Brute || !is_cut)
                .map(|accel| {
                    let hits = Probe::with(&scene, test, accel).hits(&rays);
                    (
                        accel,
                        hits.into_iter().map(|hit| hit.map(f32::to_bits)).collect::<Vec<_>>(),
                    )
                });
            let (_, expected) = hits.next().expect("a search");
            let met = expected.iter().filter(|hit| hit[3] != u32::MAX).count();
            assert!(4 * met > rays.len(), "{name}: only {met} rays meet anything");
            for (accel, found) in hits {
                let differ: Vec<usize> = (0..rays.len()).filter(|&i| found[i] != expected[i]).collect();
                let first = differ.first().map(|&i| {
                    let [found, expected] = [found[i], expected[i]].map(|hit| hit.map(f32::from_bits));
                    format!("{:?} meets {found:?} instead of {expected:?}", rays[i])
                });
                let what = format!("{name}, {test:?}: hits by {accel:?}");
                println!("{what}: {} of {} differ", differ.len(), rays.len());
                assert_eq!(differ.len(), 0, "{what}: {first:?}");
            }
        }
    }
}

/// A scene with only this object, in render space.
fn closed(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Scene {
    let mut scene = scene("furnace-closed");
    scene.normals = positions.iter().map(|position| position.normalize()).collect();
    scene.positions = positions;
    scene.triangles = triangles
        .into_iter()
        .map(|vertices| Triangle { vertices, object: 0 })
        .collect();
    scene
}

/// A bipyramid with vertices at `angles` around its axis; closed when seen from inside.
fn bipyramid(angles: &[f64]) -> Scene {
    let rim = angles.iter().map(|a| Vec3::new(a.cos() as f32, 0.013, a.sin() as f32));
    let positions: Vec<Vec3> = [Vec3::Y, Vec3::NEG_Y].into_iter().chain(rim).collect();
    let count = angles.len() as u32;
    let triangles = (0..count).flat_map(|i| {
        let (a, b) = (2 + i, 2 + (i + 1) % count);
        [[0, a, b], [1, b, a]]
    });
    closed(positions, triangles.collect())
}

fn evenly(count: u32) -> Vec<f64> {
    (0..count)
        .map(|i| std::f64::consts::TAU * f64::from(i) / f64::from(count))
        .collect()
}

/// A thousand slivers with an aspect ratio of 10⁶ among wide triangles.
fn slivers() -> Scene {
    let mut angles: Vec<f64> = (0..1000).map(|i| 1e-6 * f64::from(i)).collect();
    angles.extend(evenly(16).into_iter().skip(1));
    bipyramid(&angles)
}

/// Rays from near the middle to points on edges, every eighth to a corner.
fn rays_at_edges(scene: &Scene, count: u32) -> Box<dyn Iterator<Item = Ray>> {
    let edges: Vec<[Vec3; 2]> = scene
        .triangles
        .iter()
        .flat_map(|t| [0, 1, 2].map(|i| [i, (i + 1) % 3].map(|i| scene.positions[t.vertices[i] as usize])))
        .collect();
    let numbers = random_numbers(2 * count).collect::<Vec<_>>();
    Box::new((0..count as usize).map(move |i| {
        let [x, y, z, along] = numbers[2 * i];
        let [edge, corner, ..] = numbers[2 * i + 1];
        let origin = (Vec3::new(x, y, z) - 0.5) * 0.2;
        let [a, b] = edges[(edge * edges.len() as f32) as usize];
        let target = if corner < 0.125 { a } else { a.lerp(b, along) };
        ray(origin, target - origin)
    }))
}

fn long() -> bool {
    std::env::var_os("PPM_VK_LONG").is_some()
}

#[test]
fn no_ray_passes_a_shared_edge_or_corner() {
    let count = if long() { 10_000_000 } else { 300_000 };
    let scene = bipyramid(&evenly(97));
    assert_tight("edges and corners of a bipyramid", &scene, || {
        rays_at_edges(&scene, count)
    });
}

#[test]
fn no_ray_passes_between_triangles_that_an_instance_puts_somewhere() {
    let count = if long() { 10_000_000 } else { 100_000 };
    for triangles in [bipyramid(&evenly(97)), slivers()] {
        for rows in [
            [[0.3, -0.1, 0.2, 0.4], [0.1, 0.02, -0.3, -0.3], [0.05, 0.4, 0.1, 0.2]],
            [[-1.0, 0.0, 0.0, 0.0], [0.0, 1e-3, 0.0, 0.7], [0.0, 0.0, 0.5, -0.1]],
        ] {
            let placed = placed(&triangles, Placement { rows });
            let rays = || -> Box<dyn Iterator<Item = Ray>> {
                let point = |[x, y, z, _]: [f32; 4]| Vec3::new(x, y, z);
                let rays = rays_at_edges(&triangles, count).map(move |[origin, direction]| {
                    let placement = Placement { rows };
                    let from = placement.point(point(origin));
                    ray(from, placement.point(point(origin) + point(direction)) - from)
                });
                Box::new(rays)
            };
            assert_tight("edges and corners of an instance", &placed, rays);
        }
    }
}

/// A closed surface as the only instance of its triangles, and a distant lamp.
fn placed(closed: &Scene, placement: Placement) -> Scene {
    let mut scene = closed.clone();
    let count = scene.triangles.len() as u32;
    for triangle in &mut scene.triangles {
        triangle.object = SHARED;
    }
    let mut surface = scene.materials[0].clone();
    surface.emission = Vec3::ZERO;
    let first = scene.positions.len() as u32;
    let far = [
        Vec3::new(5.0, 5.0, 5.0),
        Vec3::new(6.0, 5.0, 5.0),
        Vec3::new(5.0, 6.0, 5.0),
    ];
    scene.positions.extend(far);
    scene.normals.extend([Vec3::Z; 3]);
    scene.triangles.push(Triangle {
        vertices: [first, first + 1, first + 2],
        object: 1,
    });
    scene.materials.push(surface);
    let object = |material, triangles, placement| Object {
        name: String::new(),
        material,
        triangles,
        placement,
    };
    let matte = scene.materials.len() as u32 - 1;
    scene.objects = vec![
        object(matte, 0..count, Some(placement)),
        object(0, count..count + 1, None),
    ];
    scene
}

#[test]
fn no_ray_passes_between_slivers() {
    let scene = slivers();
    let count = if long() { 10_000_000 } else { 300_000 };
    assert_tight("slivers of aspect 10⁶", &scene, || rays_at_edges(&scene, count));
}

#[test]
fn no_ray_along_an_axis_passes() {
    let scene = bipyramid(&evenly(96));
    let corners = scene.positions.clone();
    assert_tight("rays along axes", &scene, || {
        // From the plane through the middle: they hit corners and edges of the rim, and both tips, exactly.
        let axes = corners.clone().into_iter().flat_map(|corner| {
            let axes: &[usize] = if corner.y.abs() == 1.0 { &[1] } else { &[0, 2] };
            axes.iter().map(move |&axis| (corner, axis))
        });
        let inside = axes.filter(|(corner, axis)| corner[*axis].abs() > 0.1);
        Box::new(inside.map(|(corner, axis)| {
            let (mut origin, mut direction) = (corner, Vec3::ZERO);
            origin[axis] = 0.0;
            direction[axis] = corner[axis].signum();
            ray(origin, direction)
        }))
    });
}

#[test]
fn no_grazing_ray_passes() {
    // Along a wall of the room from slightly above it: the cosine to the wall's normal is at most 10⁻⁷.
    let room = scene("furnace-closed");
    let (low, high) = room
        .positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
            (low.min(*p), high.max(*p))
        });
    let numbers: Vec<[f32; 4]> = random_numbers(200_000).collect();
    assert_tight("grazing rays", &room, || {
        let numbers = numbers.clone();
        Box::new(numbers.into_iter().enumerate().map(move |(i, [x, y, angle, tilt])| {
            let axis = i % 3;
            let mut origin =
                low.lerp(high, 0.5) + (high - low) * 0.49 * Vec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, 2.0 * x - 1.0);
            origin[axis] = low[axis] + (high - low)[axis] * 1e-6;
            let (sin, cos) = (std::f32::consts::TAU * angle).sin_cos();
            let mut direction = Vec3::ZERO;
            direction[(axis + 1) % 3] = sin;
            direction[(axis + 2) % 3] = cos;
            direction[axis] = (tilt - 0.5) * 2e-7;
            ray(origin, direction)
        }))
    });
}
