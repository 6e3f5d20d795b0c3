//! A render uses the memory that `ppm-vk inspect` predicts.

// Each test program uses a part of the shared module.
#[allow(dead_code)]
#[path = "scene/fixture.rs"]
mod fixture;
#[allow(dead_code)]
#[path = "picture/mod.rs"]
mod picture;

use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Accel, Estimator, RenderConfig, Totals};
use ppm_vk::internals::gpu::best_device;
use ppm_vk::internals::layout::VISIBLE_LOBES;
use ppm_vk::internals::packing::SceneFeatures;
use ppm_vk::internals::pipeline::{Memory, Stages};
use ppm_vk::internals::sizes::{Limits, Sizes};
use serde_json::json;

use fixture::Fixture;
use picture::{Subject, small};

#[test]
fn a_render_takes_the_predicted_memory() {
    let device = best_device().expect("a Vulkan device");
    for (name, estimator) in [
        ("cornell", Estimator::Sppm),
        ("glossy", Estimator::Sppm),
        ("pool", Estimator::Ppm),
        ("glasses", Estimator::Ppm),
        ("instances", Estimator::Sppm),
    ] {
        let subject = Subject::named(name);
        let config = RenderConfig {
            estimator,
            ..small(160, 20_000)
        };
        let predicted = Memory::of(&subject.packed, &config, &device).expect("a device");
        let mut renderer = subject.renderer(config);
        let at_first = renderer.gpu().bytes();
        for _ in 0..4 {
            renderer.iterate().expect("iteration");
        }
        let later = renderer.gpu().bytes();
        let total = predicted.scene + predicted.render;
        println!("{name}: predicted {total}, at first {at_first}, later {later}");
        let ratio = at_first as f64 / total as f64;
        assert!(
            (0.9..=1.1).contains(&ratio),
            "{name}: {at_first} bytes instead of {total}"
        );
        assert!(later <= at_first, "{name}: {later} bytes after {at_first}");
    }
}

/// The room with this number of nodes that show one mesh of 2·side² triangles.
fn with_nodes(count: u32, side: u16) -> Subject {
    let mut room = Fixture::room();
    let place = |number: u16| f32::from(number) / f32::from(side) - 0.5;
    let vertices = (0..=side).flat_map(|z| (0..=side).map(move |x| [place(x), place(x) * place(z), place(z)]));
    let corner = |x: u16, z: u16| z * (side + 1) + x;
    let squares = (0..side).flat_map(|z| (0..side).map(move |x| (x, z)));
    let triangles = squares.flat_map(|(x, z)| {
        let [a, b, c, d] = [corner(x, z), corner(x, z + 1), corner(x + 1, z + 1), corner(x + 1, z)];
        [a, b, c, a, c, d]
    });
    let positions = room.add_vectors(&vertices.collect::<Vec<_>>());
    let indices = room.add_indices(&triangles.collect::<Vec<_>>());
    let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices, "material": 0});
    room.set("/meshes/-", json!({"primitives": [primitive]}));
    for number in 0..count {
        let turn = f64::from(number);
        room.add_root(json!({
            "mesh": 2, "translation": [0.7 * turn.sin(), 0.5, 0.7 * turn.cos()], "scale": [0.1, 0.2, 0.1],
            "rotation": [0, (0.3 * turn).sin(), 0, (0.3 * turn).cos()]
        }));
    }
    Subject::of(room.scene())
}

#[test]
fn a_thousand_instances_of_a_mesh_take_hardly_more_memory_than_one_node() {
    let device = best_device().expect("a Vulkan device");
    let memory = |subject: &Subject| Memory::of(&subject.packed, &small(160, 20_000), &device).expect("a device");
    let bytes = |subject: &Subject| memory(subject).scene;
    let (one, thousand) = (with_nodes(1, 71), with_nodes(1000, 71));
    println!("{} bytes for one, {} for a thousand", bytes(&one), bytes(&thousand));
    assert_eq!((one.packed.instances.len(), thousand.packed.instances.len()), (0, 1000));
    assert_eq!(thousand.packed.seen_triangles(), 3 + 1000 * 10_082);
    assert!(4 * bytes(&thousand) < 5 * bytes(&one));
    // And on the host.
    assert_eq!(thousand.scene.positions.len(), one.scene.positions.len());
}

#[test]
fn acceleration_structures_take_at_most_the_predicted_memory() {
    let device = best_device().expect("a Vulkan device");
    if !device.ray_query {
        println!("skipped: {} has no ray queries (VK_KHR_ray_query)", device.name);
        return;
    }
    for (name, subject) in [
        ("cornell", Subject::named("cornell")),
        ("instances", Subject::named("instances")),
        ("one mesh", with_nodes(1, 224)),
    ] {
        let config = RenderConfig {
            accel: Accel::RayQuery,
            ..small(32, 1000)
        };
        let predicted = Memory::of(&subject.packed, &config, &device).expect("a device");
        let by_bvh = RenderConfig {
            accel: Accel::Bvh,
            ..config.clone()
        };
        let without = Memory::of(&subject.packed, &by_bvh, &device).expect("a device");
        let mut renderer = subject.renderer(config);
        let built = renderer.gpu().built_bytes();
        println!(
            "{name}: {} triangles, {} instances: {built} bytes, predicted {}",
            subject.packed.shading_triangles.len(),
            subject.packed.instances.len(),
            predicted.structures
        );
        assert_eq!(without.structures, 0, "{name}");
        assert_eq!(predicted.scene, without.scene + predicted.structures, "{name}");
        assert!(
            (1..=predicted.structures).contains(&built),
            "{name}: {built} bytes, predicted at most {}",
            predicted.structures
        );
    }
}

/// lavapipe binds at most 128 MiB. Pictures of the default width and larger fit, whatever a scene needs for its visible points.
#[test]
fn pictures_of_usual_sizes_fit_the_bindings_of_a_small_device() {
    const BINDABLE: u64 = 128 << 20;
    let limits = Limits {
        storage_buffer_bytes: BINDABLE,
        loop_limit: u32::MAX,
        clustered_run: 8,
        lanes: 4096,
        splitting: true,
        specular: true,
        lobes: [true; VISIBLE_LOBES.len()],
        meshes: 9,
        object_cells: 9 * 1024,
    };
    let sides = [
        [640, 480],
        [560, 560],
        [800, 600],
        [1280, 720],
        [1280, 1280],
        [1920, 1080],
        [1920, 1200],
    ];
    for (resolution, estimator) in sides
        .iter()
        .flat_map(|&side| [(side, Estimator::Sppm), (side, Estimator::Ppm)])
    {
        let config = RenderConfig {
            resolution,
            estimator,
            ..RenderConfig::default()
        };
        let sizes = Sizes::new(&config, limits);
        let stages = Stages {
            config: &config,
            sizes: &sizes,
            features: SceneFeatures::ALL,
        };
        for recording in [stages.iteration(0), stages.picture(Totals::default())] {
            for id in recording.buffers() {
                let bytes = sizes.bytes(id).unwrap_or_default();
                assert!(
                    bytes <= BINDABLE,
                    "{resolution:?}, {estimator:?}: {id:?} has {bytes} bytes"
                );
            }
        }
        let caustics_apart = estimator == Estimator::Sppm && resolution[0] * resolution[1] < 1_300_000;
        assert_eq!(
            sizes.photon_maps,
            1 + u32::from(caustics_apart),
            "{resolution:?}, {estimator:?}"
        );
    }
}
