use std::path::Path;

use bytemuck::Zeroable;
use glam::Vec3;

use super::*;
use crate::config::{RenderConfig, Sampler};
use crate::emission::{Aim, PathValue};
use crate::film::Image;
use crate::layout::{Settings, VisiblePoint};
use crate::packing::PackedScene;
use crate::random::PathKind;
use crate::scene;
use crate::scene::PunctualLight;
use crate::scene::Scene;

/// The part of a spot's photons within an angle is the part of its intensity's integral there.
#[test]
fn photons_of_a_spot_are_spread_as_its_intensity() {
    let light = Light {
        inner: 0.1,
        outer: 0.4,
        ..Light::zeroed()
    };
    const STEPS: u32 = 100_000;
    let mut integral = 0.0;
    let step = 0.4 / f64::from(STEPS);
    let (_, solid_angle) = spot_versine(&light, 0.0);
    for i in 0..STEPS {
        let versine = (f64::from(i) + 0.5) * step;
        integral += spot_falloff(&light, versine) * step;
        if i % 10_000 == 9_999 {
            let within = 2.0 * PI * integral / solid_angle;
            let (found, _) = spot_versine(&light, (1.0 - within).max(0.0));
            let expected = f64::from(i + 1) * step;
            assert!(
                spot_falloff(&light, expected) < 1e-6 || (found - expected).abs() < 1e-4,
                "{found} instead of {expected}"
            );
        }
    }
    assert!((2.0 * PI * integral / solid_angle - 1.0).abs() < 1e-6, "{integral}");
}

/// A room with a lamp, mirrors and glass, and lights of every other kind.
fn lit_room(far_light: bool, extent: f64) -> PackedScene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-spheres.gltf");
    let mut scene = Scene::load(&path).expect("a scene");
    let light = |emission, position| PunctualLight {
        emission,
        position,
        intensity: Vec3::new(1.0, 0.8, 0.5),
        extent,
        range: None,
    };
    let direction = Vec3::new(0.2, -1.0, -0.7).normalize();
    let spot = |outer| scene::Emission::Spot {
        direction,
        inner: 0.5 * outer,
        outer,
    };
    scene.lights = vec![
        light(scene::Emission::Point, Vec3::new(0.3, 0.5, 0.2)),
        light(spot(0.02), Vec3::new(-0.1, 0.8, 0.6)),
        light(spot(0.6), Vec3::new(0.1, 0.7, 0.5)),
        light(scene::Emission::Directional { direction }, Vec3::ZERO),
    ];
    if far_light {
        scene.lights.push(PunctualLight {
            intensity: Vec3::splat(30.0),
            ..light(scene::Emission::Point, Vec3::new(1.0, 4.0, -2.0))
        });
    }
    let pixel = |i: usize| {
        [
            0.2 + (i % 5) as f32,
            if i == 100 { 200.0 } else { 0.5 },
            (i / 32) as f32 * 0.2,
        ]
    };
    let image = Image::new(32, 16, (0..512).map(pixel).collect());
    scene.environment = Some(scene::Environment::new(image).expect("an environment"));
    PackedScene::new(&scene).expect("a scene in the device's layout")
}

/// Visible points along a line, so that spheres of many sizes are around their middle.
fn points() -> Vec<VisiblePoint> {
    let point = |i: i32| VisiblePoint {
        position_object: [0.2 + 0.01 * i as f32, -0.4, 0.1, f32::from_bits(0)],
        weight_normal: [0.0; 4],
        emitted_normal: [0.0; 4],
    };
    (-20..=20).map(point).collect()
}

/// Which light a start is of: an index of those that aren't triangles, or their number for a triangle.
fn light_of_start(scene: &PackedScene, start: &Emission) -> usize {
    let others: Vec<&Light> = scene.lights.iter().filter(|light| light.kind != 0).collect();
    if start.ignored.is_some() {
        return others.len();
    }
    let is_of = |light: &&Light| match light.kind {
        DIRECTIONAL_LIGHT if light.extent == 0.0 => start.ray.direction == rgb(light.direction),
        DIRECTIONAL_LIGHT => 1.0 - start.ray.direction.dot(rgb(light.direction)) <= f64::from(light.extent),
        ENVIRONMENT_LIGHT => true,
        // Of two that overlap the first: a start tells.
        _ => start.ray.origin.distance(rgb(light.position)) <= f64::from(light.extent) * (1.0 + 1e-9),
    };
    others.iter().position(is_of).expect("a light")
}

const STARTS: u32 = 400_000;
/// Paths of a light through a region that its mean and error are to be trusted with.
const ENOUGH: f64 = 30.0;

/// Mean over the starts and its standard error, and the paths that it comes from.
#[derive(Debug)]
struct Flux {
    mean: f64,
    error: f64,
    count: f64,
}

/// The flux of each light through a sphere.
fn fluxes(scene: &PackedScene, emission: Option<&Table>, region: Sphere, kinds: usize) -> Vec<Flux> {
    let config = RenderConfig {
        sampler: Sampler::Independent,
        ..RenderConfig::default()
    };
    let inputs = Inputs {
        demand: None,
        scene,
        settings: &Settings::zeroed(),
        config: &config,
        emission,
    };
    let mut sums = vec![[0.0; 3]; kinds];
    for path in 0..STARTS {
        // Other numbers than the power's starts have.
        let iteration = emission.map_or(1, |_| 0);
        let start = emit(&inputs, &mut Random::of_photon(&config, path, iteration));
        let flux = start.flux.element_sum();
        assert!(flux.is_finite() && flux >= 0.0);
        if flux > 0.0 && region.is_met(start.ray.origin, start.ray.direction, false) {
            let [sum, squares, count] = &mut sums[light_of_start(scene, &start)];
            *sum += flux;
            *squares += flux * flux;
            *count += 1.0;
        }
    }
    let n = f64::from(STARTS);
    let measured = |[sum, squares, count]: [f64; 3]| Flux {
        mean: sum / n,
        error: (squares / n - (sum / n).powi(2)).sqrt() / n.sqrt(),
        count,
    };
    sums.into_iter().map(measured).collect()
}

/// Values as of paths that are worth nothing where they pass through a region, and much elsewhere.
fn mislead(aim: &mut Aim, scene: &PackedScene, region: Sphere) {
    let config = RenderConfig::default();
    for iteration in 0..6 {
        let table = aim.table().clone();
        let inputs = Inputs {
            demand: None,
            scene,
            settings: &Settings::zeroed(),
            config: &config,
            emission: Some(&table),
        };
        let value = |path| {
            let start = emit(&inputs, &mut Random::of_photon(&config, path, iteration));
            let useless =
                start.flux.max_element() <= 0.0 || region.is_met(start.ray.origin, start.ray.direction, false);
            let value = if useless { 0.0 } else { 1.0 };
            PathValue { value, rays: 1 }.packed()
        };
        let values: Vec<u32> = (0..crate::emission::counted_paths(iteration)).map(value).collect();
        aim.learn(&config, iteration, 0, &values);
        aim.update();
    }
}

#[test]
fn aimed_paths_bring_each_lights_flux_whatever_the_table() {
    for (far_light, extent) in [(false, 0.0), (true, 0.0), (false, 0.1), (true, 0.1)] {
        let scene = lit_room(far_light, extent);
        let kinds = 1 + scene.lights.iter().filter(|light| light.kind != 0).count();
        let region = |x, y, z, radius| Sphere {
            centre: DVec3::new(x, y, z),
            radius,
        };
        let mut compared = vec![false; kinds];
        // Small ones and one that holds the room, in which every path lies.
        for region in [
            region(0.3, -0.5, 0.2, 0.1),
            region(0.1, -0.3, -0.2, 0.2),
            region(0.0, 0.0, 0.0, 0.8),
        ] {
            let expected = fluxes(&scene, None, region, kinds);
            for misled in [false, true] {
                let mut aim = Aim::new(&scene, &points());
                if misled {
                    mislead(&mut aim, &scene, region);
                }
                let found = fluxes(&scene, Some(aim.table()), region, kinds);
                for (light, (found, expected)) in found.iter().zip(&expected).enumerate() {
                    let error = found.error.hypot(expected.error);
                    println!(
                        "far light {far_light}, extent {extent}, {region:?}, misled {misled}, light {light}: {found:?}, by power {expected:?}, \
                         {:.2} standard errors",
                        (found.mean - expected.mean) / error
                    );
                    if found.count.min(expected.count) < ENOUGH {
                        continue;
                    }
                    compared[light] = true;
                    assert!(
                        (found.mean - expected.mean).abs() <= 4.0 * error,
                        "light {light} of {kinds}: {found:?} instead of {expected:?}"
                    );
                }
            }
        }
        assert!(compared.iter().all(|&compared| compared), "{compared:?}");
    }
}

/// The mean over all directions of what photons carry is that of cosine-weighted ones, whatever part of them is sent to the view.
#[test]
fn guided_photons_carry_as_much_as_those_that_are_not() {
    const COUNT: u32 = 200_000;
    let scene = lit_room(false, 0.0);
    let config = RenderConfig::default();
    let normal = DVec3::Y;
    for (distance, side) in [(3.0, 0.2), (3.0, 2.0), (2.0, 2.9)] {
        let table = Table {
            spheres: vec![[side, distance, 0.0, 0.5]],
            view: Some(0),
            cells: Vec::new(),
        };
        let inputs = Inputs {
            demand: None,
            scene: &scene,
            settings: &Settings::zeroed(),
            config: &config,
            emission: Some(&table),
        };
        let (mut sum, mut squares, mut slope, mut largest) = (0.0, 0.0, 0.0, 0.0f64);
        for path in 0..COUNT {
            let mut random = Random::with(Sampler::Independent, PathKind::Photon, path, 0, 1);
            let (u, v) = (random.next4(), random.next4());
            let cosine = cosine_direction(normal, v[0], v[1]);
            let (direction, weight) = guide(&inputs, DVec3::ZERO, normal, u, cosine);
            sum += weight;
            squares += weight * weight;
            slope += weight * direction.dot(normal);
            largest = largest.max(weight);
        }
        let count = f64::from(COUNT);
        let mean = sum / count;
        let error = ((squares / count - mean * mean) / count).sqrt();
        assert!(error > 1e-4, "nothing was guided: weights are all {mean}");
        assert!((mean - 1.0).abs() < 5.0 * error, "mean weight {mean} ± {error}");
        // ∫ cos²θ / π over the hemisphere; each weight is 2 at the most.
        assert!(
            (slope / count - 2.0 / 3.0).abs() < 5.0 * error,
            "mean cosine {}",
            slope / count
        );
        assert!(largest <= 2.0 + 1e-9, "weight {largest}");
    }
}
