//! The memory limit of a scene.

use ppm_vk::internals::film::Image;
use ppm_vk::internals::loader::LoadOptions;
use ppm_vk::internals::scene::Environment;
use serde_json::json;

use crate::fixture::Fixture;
use crate::textures::with_images;

/// The smallest limit that a scene loads with, and the message for the largest that it does not load with.
fn least_limit(room: &Fixture, environment: Option<&Environment>) -> (u64, String) {
    let load = |memory_limit| {
        room.load_with(LoadOptions {
            environment: environment.cloned(),
            memory_limit: Some(memory_limit),
            ..LoadOptions::default()
        })
    };
    let (mut too_small, mut enough) = (0, 1 << 30);
    load(enough).expect("1 GiB");
    while enough - too_small > 1 {
        let middle = too_small.midpoint(enough);
        match load(middle) {
            Ok(_) => enough = middle,
            Err(_) => too_small = middle,
        }
    }
    (enough, load(too_small).expect_err("less than the least").to_string())
}

/// Adds a mesh of this number of vertices, each used by a triangle of its own.
fn add_strip(room: &mut Fixture, vertices: u16) {
    let place = |index: u16| f32::from(index) / f32::from(vertices);
    let positions: Vec<[f32; 3]> = (0..vertices)
        .map(|index| [place(index), 0.1 + 0.1 * f32::from(index % 2), 0.0])
        .collect();
    let indices: Vec<u16> = (2..vertices).flat_map(|last| [last - 2, last - 1, last]).collect();
    let (positions, indices) = (room.add_vectors(&positions), room.add_indices(&indices));
    let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices, "material": 0});
    room.set("/meshes/-", json!({"primitives": [primitive]}));
    let mesh = room.json["meshes"].as_array().expect("meshes").len() - 1;
    room.add_root(json!({"mesh": mesh}));
}

#[test]
fn buffers_geometry_images_and_the_environment_are_added_up_to_one_limit() {
    const SIDE: u32 = 128;
    const VERTICES: u16 = 20_000;
    let texels = u64::from(SIDE * SIDE);
    let sky = Environment::new(Image::new(512, 256, vec![[1.0; 3]; 512 * 256])).expect("a sky");
    let sky_bytes = 512 * 256 * 12;

    let (two_images, _) = least_limit(&with_images(2, SIDE), None);
    let (three_images, said) = least_limit(&with_images(3, SIDE), None);
    // RGBA, and a few bytes of the materials.
    assert!(
        three_images - two_images >= 4 * texels,
        "{two_images}, {three_images}: images aren't added up"
    );
    let limit = ppm_vk::internals::text::bytes(three_images - 1);
    for words in [
        "an image of 128x128 texels needs",
        "in addition to",
        &limit,
        "allow more",
    ] {
        assert!(
            said.contains(words) && !said.contains('\n'),
            "«{words}» isn't in: {said}"
        );
    }

    let (under_a_sky, _) = least_limit(&with_images(3, SIDE), Some(&sky));
    assert_eq!(
        under_a_sky - three_images,
        sky_bytes,
        "the environment isn't added to the rest"
    );

    let mut with_a_strip = with_images(3, SIDE);
    let before = with_a_strip.binary.len();
    add_strip(&mut with_a_strip, VERTICES);
    let in_buffers = (with_a_strip.binary.len() - before) as u64;
    // At least positions and normals, and three indices and a material for each triangle.
    let as_geometry = u64::from(VERTICES) * (24 + 12);
    let (with_a_strip, _) = least_limit(&with_a_strip, None);
    assert!(
        with_a_strip - three_images >= in_buffers + as_geometry,
        "{three_images}, {with_a_strip}: buffers of {in_buffers} bytes and geometry of {as_geometry} aren't added to the images"
    );
}
