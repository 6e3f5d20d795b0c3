//! Textures, vertex colours and alpha.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::DVec2;
use ppm_vk::internals::layout::{CLAMP, MIRROR_REPEAT, NEAREST, SECOND_SET, SRGB, WRAP_U, WRAP_V};
use ppm_vk::internals::scene::Alpha;
use serde_json::{Value, json};

use super::encoded::{KTX2, webp};
use super::fixture::Fixture;
use crate::allocations::peak_of;

/// A PNG of two texels side by side, as a data URI.
fn two_texels() -> String {
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_vec(2, 1, vec![255, 0, 0, 255, 0, 255, 0, 128])
        .expect("two texels")
        .write_to(&mut png, image::ImageFormat::Png)
        .expect("a PNG");
    format!("data:image/png;base64,{}", STANDARD.encode(png.into_inner()))
}

fn webp_uri() -> String {
    format!("data:image/webp;base64,{}", STANDARD.encode(webp()))
}

/// The room with a floor of this material and one texture, of two texels.
fn textured(material: Value) -> Fixture {
    let mut room = Fixture::room();
    room.set("/materials/0", material);
    room.set("/textures", json!([{"source": 0}]));
    room.set("/images", json!([{"uri": two_texels()}]));
    room
}

fn with_base_color(info: Value) -> Value {
    json!({"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": info}})
}

#[test]
fn one_image_is_stored_once_and_looked_up_as_each_slot_wants() {
    let texture = json!({"index": 0});
    let scene = textured(json!({
        "pbrMetallicRoughness": {"baseColorTexture": texture, "metallicRoughnessTexture": texture},
        "normalTexture": {"index": 0, "scale": 0.5},
        "emissiveTexture": texture, "emissiveFactor": [1, 1, 1],
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": texture},
            "KHR_materials_volume": {"thicknessFactor": 1},
            "KHR_materials_specular": {"specularTexture": texture, "specularColorTexture": texture}
        }
    }))
    .scene();
    let textures = &scene.materials[0].textures;
    let [color, linear] = [Some(0), Some(1)];
    assert_eq!(
        (textures.base_color, textures.emission, textures.specular_color),
        (color, color, color)
    );
    assert_eq!(
        (textures.metallic_roughness, textures.transmission, textures.specular),
        (linear, linear, linear)
    );
    assert_eq!((textures.normal, textures.normal_scale), (Some(1), 0.5));
    assert_eq!((scene.textures.lookups.len(), scene.textures.texels.len()), (2, 2));
    assert_eq!(scene.textures.lookups[0].flags, SRGB);
}

#[test]
fn samplers_sets_and_transforms_have_the_values_of_the_file() {
    let transform =
        json!({"offset": [0.5, 0.25], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 3], "texCoord": 1});
    let info = json!({"index": 0, "extensions": {"KHR_texture_transform": transform}});
    let mut room = textured(with_base_color(info));
    room.set("/textures/0/sampler", json!(0));
    room.set(
        "/samplers",
        json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]),
    );
    let scene = room.scene();
    let lookup = &scene.textures.lookups[0];
    assert_eq!(
        lookup.flags,
        SRGB | NEAREST | SECOND_SET | CLAMP << WRAP_U | MIRROR_REPEAT << WRAP_V
    );
    // Scaled, turned by a quarter, moved: (u, v) → (3 v + 1/2, −2 u + 1/4).
    let close = |row: [f32; 3], expected: [f32; 3]| row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(
        close(lookup.row_u, [0.0, 3.0, 0.5]) && close(lookup.row_v, [-2.0, 0.0, 0.25]),
        "{lookup:?}"
    );
    // Only the second set is read: 3 · 0.2 + 0.5 lies past the last texel, which is clamped.
    let value = scene.textures.value(0, [DVec2::splat(7.0), DVec2::new(0.0, 0.2)]);
    assert_eq!(value.to_array(), [0.0, 1.0, 0.0, 128.0 / 255.0]);
}

#[test]
fn unreadable_images_are_reported_and_left_out() {
    let floor = || with_base_color(json!({"index": 0}));
    for (image, parts) in [
        (json!({"uri": "absent.png"}), ["absent.png", "left out"]),
        (
            json!({"uri": "data:image/webp;base64,UklGRhAAAABXRUJQVlA4TAAAAAA="}),
            ["can't be decoded", "left out"],
        ),
        (
            json!({"uri": "data:;base64,AAAA"}),
            ["not PNG, JPEG, WebP or KTX 2.0", "left out"],
        ),
        (json!({}), ["neither a uri nor a bufferView", "left out"]),
        // The decoder's message for a truncated JPEG ends with a line break.
        (
            json!({"uri": "data:;base64,/9j/4AAQSkZJRgABAQAAAQABAAD/"}),
            ["can't be decoded", "left out"],
        ),
    ] {
        let mut room = textured(floor());
        room.set("/images/0", image);
        let scene = room.assert_warns(&[&["material 0", "image 0"], &parts[..]].concat());
        assert_eq!(scene.materials[0].textures.base_color, None);
    }
    let mut room = textured(floor());
    room.set(
        "/textures/0",
        json!({"extensions": {"MSFT_texture_dds": {"source": 0}}}),
    );
    room.assert_warns(&["texture 0", "MSFT_texture_dds", "left out"]);
}

/// A room whose floor's texture is an image by a required extension, with or without the PNG as a fallback.
fn textured_by(extension: &str, uri: &str, has_fallback: bool) -> Fixture {
    let mut room = textured(with_base_color(json!({"index": 0})));
    let source = json!({extension: {"source": 1}});
    room.set("/images/-", json!({"uri": uri}));
    room.set("/textures/0", json!({"source": 0, "extensions": source}));
    room.set("/extensionsUsed", json!([extension]));
    if !has_fallback {
        room.remove("/textures/0/source");
        room.set("/extensionsRequired", json!([extension]));
    }
    room
}

#[test]
fn webp_is_preferred_to_its_fallback() {
    let plain = textured(with_base_color(json!({"index": 0}))).scene();
    for has_fallback in [true, false] {
        let scene = textured_by("EXT_texture_webp", &webp_uri(), has_fallback).scene();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_eq!(scene.textures, plain.textures);
    }
    // The PNG is another image: lookups use the WebP.
    let mut room = textured_by("EXT_texture_webp", &webp_uri(), true);
    room.set("/images/0", json!({"uri": "absent.png"}));
    assert_eq!(room.scene().textures, plain.textures);
}

#[test]
fn ktx2_is_transcoded() {
    for (name, bytes) in KTX2 {
        let uri = format!("data:image/ktx2;base64,{}", STANDARD.encode(bytes));
        let scene = textured_by("KHR_texture_basisu", &uri, false).scene();
        assert!(scene.warnings.is_empty(), "{name}: {:?}", scene.warnings);
        assert_eq!(scene.textures.texels.len(), 64, "{name}");
        for (place, wanted) in [
            (0, [255, 0, 0]),
            (7, [0, 255, 0]),
            (56, [0, 0, 255]),
            (63, [255, 255, 255]),
        ] {
            let [r, g, b, alpha] = scene.textures.texels[place].to_le_bytes();
            let far = [r, g, b]
                .iter()
                .zip(wanted)
                .any(|(&found, wanted)| found.abs_diff(wanted) > 8);
            assert!(!far && alpha == 255, "{name}, texel {place}: {:?}", [r, g, b, alpha]);
        }
    }
}

#[test]
fn the_fallback_of_an_unreadable_image_is_used_with_a_warning() {
    let plain = textured(with_base_color(json!({"index": 0}))).scene();
    for (extension, bytes) in [
        ("EXT_texture_webp", "AAAA"),
        ("KHR_texture_basisu", "q0tUWCAyMLsNChoKAAAA"),
    ] {
        let uri = format!("data:;base64,{bytes}");
        let scene = textured_by(extension, &uri, true).assert_warns(&["image 1", "image 0 stands for it"]);
        assert_eq!(scene.textures, plain.textures);
        let scene = textured_by(extension, &uri, false).assert_warns(&["image 1", "left out"]);
        assert_eq!(scene.materials[0].textures.base_color, None);
    }
}

#[test]
fn ktx2_that_claims_too_much_is_refused_before_memory_is_asked_for() {
    let mut room = textured_by("KHR_texture_basisu", "", false);
    for (at, value, part) in [
        (20, 40_000u32, "40000x"),
        (28, 4, "of one face and layer"),
        (36, 6, "of one face and layer"),
        (52, u32::MAX, "of one face and layer"),
        (80, u32::MAX, "of one face and layer"),
        (96, u32::MAX, "of one face and layer"),
    ] {
        let mut bytes = KTX2[2].1.to_vec();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        let uri = format!("data:image/ktx2;base64,{}", STANDARD.encode(bytes));
        room.set("/images/1/uri", json!(uri));
        room.assert_warns(&["image 1", part, "left out"]);
    }
}

#[test]
fn textures_that_do_not_exist_are_refused() {
    let room = textured(with_base_color(json!({"index": 3})));
    room.assert_fails(&["material 0", "no texture 3"]);
    let mut room = textured(with_base_color(json!({"index": 0})));
    room.set("/textures/0/source", json!(5));
    room.assert_fails(&["material 0", "no image 5"]);
    room.set("/textures/0", json!({"source": 0, "sampler": 9}));
    room.assert_fails(&["material 0", "no sampler 9"]);
}

#[test]
fn unlit_surfaces_show_their_base_color_and_are_no_lights() {
    let mut material = with_base_color(json!({"index": 0}));
    material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.25, 1, 1]);
    material["emissiveFactor"] = json!([1, 1, 1]);
    material["extensions"] = json!({"KHR_materials_unlit": {}});
    let scene = textured(material).scene();
    let floor = &scene.materials[0];
    assert_eq!(
        (floor.base_color.to_array(), floor.emission.to_array()),
        ([0.0; 3], [0.5, 0.25, 1.0])
    );
    assert_eq!(floor.textures.emission, floor.textures.base_color);
    let lamps = scene.emissive_triangles();
    let of_floor = |triangle: u32| scene.objects[scene.triangles[triangle as usize].object as usize].material == 0;
    assert!(
        !lamps.is_empty() && !lamps.iter().any(|lamp| of_floor(lamp.triangle)),
        "{lamps:?}"
    );
}

#[test]
fn alpha_is_as_the_file_says() {
    let with = |more: Value| {
        let mut material = json!({"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [1, 1, 1, 0.25]}});
        for (key, value) in more.as_object().expect("an object") {
            material[key] = value.clone();
        }
        textured(material).scene().materials[0].alpha
    };
    assert_eq!(with(json!({})), Alpha::Opaque);
    assert_eq!(with(json!({"alphaMode": "BLEND"})), Alpha::Blend { alpha: 0.25 });
    let mask = |cutoff| Alpha::Mask { alpha: 0.25, cutoff };
    assert_eq!(with(json!({"alphaMode": "MASK"})), mask(0.5));
    assert_eq!(with(json!({"alphaMode": "MASK", "alphaCutoff": 0.2})), mask(0.2));
}

/// A black PNG in the room's folder; the room's floor has this number of copies as textures.
pub fn with_images(count: usize, side: u32) -> Fixture {
    let mut room = Fixture::room();
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(side, side)
        .write_to(&mut png, image::ImageFormat::Png)
        .expect("a PNG");
    room.write("black.png", &png.into_inner());
    let material = |index| with_base_color(json!({"index": index}));
    room.set("/materials", (0..count).map(material).collect());
    room.set("/textures", (0..count).map(|index| json!({"source": index})).collect());
    room.set("/images", (0..count).map(|_| json!({"uri": "black.png"})).collect());
    let primitive = room.json["meshes"][0]["primitives"][0].clone();
    for index in 1..count {
        let mut primitive = primitive.clone();
        primitive["material"] = json!(index);
        room.set("/meshes/0/primitives/-", primitive);
    }
    room
}

#[test]
fn the_pixels_of_an_image_decide_how_much_of_its_file_is_read() {
    let room = with_images(2, 4);
    // The part after the image takes no room on the disk, but 6 GiB in memory.
    let file = std::fs::File::options().append(true).open(room.path("black.png"));
    file.and_then(|file| file.set_len(6 << 30)).expect("a sparse file");
    let (scene, peak) = peak_of(|| room.scene());
    assert_eq!(scene.textures.texels.len(), 2 * 16);
    assert!(peak < 200 << 20, "{peak} bytes for 16 texels");
}

#[test]
fn images_take_no_more_memory_than_the_scene_may() {
    let room = with_images(40, 512);
    let load = |memory_limit| room.load_within(memory_limit);
    load(64 << 20).expect("40 MiB");
    let (result, peak) = peak_of(|| load(20 << 20));
    let error = result.expect_err("too large").to_string();
    assert!(
        error.contains("an image of 512x512 texels") && error.contains("allow more") && !error.contains('\n'),
        "{error}"
    );
    // Pixels move to where there is room for more of them.
    assert!(peak < 60 << 20, "{peak} bytes");
}
