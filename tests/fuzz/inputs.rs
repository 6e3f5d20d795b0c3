//! Valid files with every kind of data that is read.

use std::io::Cursor;

use draco_core::{DataType, GeometryAttributeType};
use exr::compression::Compression;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Layer};
use exr::math::Vec2;
use exr::meta::attribute::LineOrder;
use exr::meta::header::LayerAttributes;
use exr::prelude::WritableImage;
use serde_json::json;

use crate::encoded::{
    Attribute, DRACO, EDGEBREAKER, KTX2, SEQUENTIAL, VALENCE, add_compressed, encode, meshopt_room, webp,
};
use crate::fixture::Fixture;

/// An animated scene: compressed and sparse views and small integers, strips, texture coordinates, colours, missing tangents,
/// morph targets, skins and animations.
pub fn moving() -> Fixture {
    let mut room = meshopt_room();
    room.set("/extensionsUsed/-", json!("KHR_mesh_quantization"));
    let texcoords = room.add_accessor(&[0, 0, 0, 255, 255, 255, 255, 0], 4, 5121, "VEC2");
    room.set(&format!("/accessors/{texcoords}/normalized"), json!(true));
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(texcoords));
    room.set("/materials/0/normalTexture", json!({"index": 0}));
    room.set(
        "/materials/0/extensions/KHR_materials_clearcoat",
        json!({"clearcoatFactor": 0.5, "clearcoatNormalTexture": {"index": 0, "scale": 0.5}}),
    );
    room.set("/textures", json!([{}]));
    let colors = room.add_floats("VEC4", 4, &[0.5; 12]);
    room.set("/meshes/1/primitives/0/attributes/COLOR_0", json!(colors));
    let joints = room.add_accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 3, 5121, "VEC4");
    let weights = [[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]].concat();
    let weights = room.add_floats("VEC4", 4, &weights);
    room.set("/meshes/1/primitives/0/attributes/JOINTS_0", json!(joints));
    room.set("/meshes/1/primitives/0/attributes/WEIGHTS_0", json!(weights));
    room.set("/meshes/1/primitives/0/mode", json!(5));
    let matrices = [glam::Mat4::IDENTITY.to_cols_array(); 2].concat();
    let matrices = room.add_floats("MAT4", 16, &matrices);
    room.set("/skins", json!([{"joints": [3, 4], "inverseBindMatrices": matrices}]));
    room.set("/nodes/1/skin", json!(0));
    room.add_root(json!({"name": "hip"}));
    room.add_root(json!({"name": "knee", "rotation": [0, 0, 0, 1], "scale": [1, 1, -1]}));
    let shifts = room.add_vectors(&[[0.0, 0.5, 0.0]; 3]);
    room.add_sparse(shifts, &[1], &[[0.25, 0.0, 0.0]]);
    room.set("/meshes/1/primitives/0/targets", json!([{"POSITION": shifts}]));
    room.set("/nodes/1/weights", json!([0.5]));
    let weights = room.add_floats("SCALAR", 1, &[0.0, 1.0]);
    room.animate(1, "weights", "LINEAR", &[0.0, 1.0], weights);
    let moves = room.add_vectors(&[[0.0, 0.5, 0.0]; 6]);
    room.animate(4, "translation", "CUBICSPLINE", &[0.0, 1.0], moves);
    let turns = room.add_floats("VEC4", 4, &[0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
    room.animate(0, "rotation", "LINEAR", &[0.25, 2.0], turns);
    room
}

/// A wavy sheet of triangles with every attribute, compressed in three ways.
pub fn draco() -> Fixture {
    const SIDE: u32 = 7;
    let places = || (0..SIDE * SIDE).map(|i| [(i % SIDE) as f32 / 6.0, (i / SIDE) as f32 / 6.0]);
    let floats = |of: fn([f32; 2]) -> Vec<f32>| -> Vec<u8> {
        places().flat_map(of).flat_map(|value| value.to_le_bytes()).collect()
    };
    let positions = floats(|[x, y]| vec![x, 0.2 * (7.0 * x).sin() * (5.0 * y).cos(), y]);
    let normals = floats(|[x, y]| glam::Vec3::new(x - 0.5, 1.0, y - 0.5).normalize().to_array().to_vec());
    let texcoords = floats(|place| place.to_vec());
    let weights = floats(|[x, _]| vec![x, 1.0 - x, 0.0, 0.0]);
    let colors: Vec<u8> = places()
        .flat_map(|[x, y]| [(x * 255.0) as u8, (y * 255.0) as u8, 99, 255])
        .collect();
    let joints: Vec<u8> = places().flat_map(|_| [0, 1, 0, 0]).collect();
    let attribute = |kind, component, width, bytes| Attribute {
        kind,
        component,
        width,
        bytes,
    };
    let (float, generic) = (DataType::Float32, GeometryAttributeType::Generic);
    let attributes = [
        attribute(GeometryAttributeType::Position, float, 3, &positions[..]),
        attribute(GeometryAttributeType::Normal, float, 3, &normals),
        attribute(GeometryAttributeType::TexCoord, float, 2, &texcoords),
        attribute(GeometryAttributeType::Color, DataType::Uint8, 4, &colors),
        attribute(generic, DataType::Uint8, 4, &joints),
        attribute(generic, float, 4, &weights),
    ];
    let corners = (0..SIDE - 1).flat_map(|y| (0..SIDE - 1).map(move |x| y * SIDE + x));
    let triangles: Vec<[u32; 3]> = corners
        .flat_map(|a| [[a, a + SIDE, a + 1], [a + 1, a + SIDE, a + SIDE + 1]])
        .collect();

    let mut room = Fixture::room();
    let names = ["POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0", "JOINTS_0", "WEIGHTS_0"];
    let mut accessors = serde_json::Map::new();
    for (name, attribute) in names.iter().zip(&attributes) {
        let kind = ["", "", "VEC2", "VEC3", "VEC4"][usize::from(attribute.width)];
        let component = if attribute.component == float { 5126 } else { 5121 };
        let accessor = room.add_accessor(&[], (SIDE * SIDE) as usize, component, kind);
        room.remove(&format!("/accessors/{accessor}/bufferView"));
        room.set(&format!("/accessors/{accessor}/normalized"), json!(*name == "COLOR_0"));
        accessors.insert((*name).to_owned(), json!(accessor));
    }
    let ids: serde_json::Map<_, _> = (0..)
        .zip(names)
        .map(|(id, name): (u32, _)| (name.to_owned(), json!(id)))
        .collect();
    let mut primitives = Vec::new();
    for (method, quantized) in [(SEQUENTIAL, false), (EDGEBREAKER, true), (VALENCE, true)] {
        add_compressed(&mut room, &encode(&attributes, &triangles, method, quantized));
        let extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
        room.set(&format!("{extension}/attributes"), json!(ids));
        let extension = room.json.pointer(extension).expect("the extension").clone();
        primitives.push(json!({"attributes": accessors, "material": 0, "extensions": {DRACO: extension}}));
    }
    room.set("/meshes/0/primitives", json!(primitives));
    let joints = [
        room.add_root(json!({})),
        room.add_root(json!({"translation": [0, 0.5, 0]})),
    ];
    room.set("/skins", json!([{"joints": joints}]));
    room.set("/nodes/0/skin", json!(0));
    room
}

/// A floor with a texture in each format.
pub fn pictured() -> Fixture {
    let mut room = Fixture::room();
    let encoded = |format| {
        let mut bytes = Cursor::new(Vec::new());
        let picture = image::RgbImage::from_fn(9, 5, |x, y| image::Rgb([20 * x as u8, 40 * y as u8, 99]));
        picture.write_to(&mut bytes, format).expect("a picture");
        bytes.into_inner()
    };
    let mut files = vec![
        webp(),
        encoded(image::ImageFormat::WebP),
        encoded(image::ImageFormat::Png),
        encoded(image::ImageFormat::Jpeg),
    ];
    files.extend(KTX2.map(|(_, bytes)| bytes.to_vec()));
    let (mut images, mut textures) = (Vec::new(), Vec::new());
    for (index, bytes) in files.iter().enumerate() {
        let accessor = room.add_accessor(bytes, bytes.len(), 5121, "SCALAR");
        images.push(json!({"bufferView": room.json["accessors"][accessor]["bufferView"]}));
        let extension = if index < 2 {
            "EXT_texture_webp"
        } else {
            "KHR_texture_basisu"
        };
        textures.push(match index {
            2 | 3 => json!({"source": index, "sampler": 0}),
            _ => json!({"source": 2, "extensions": {extension: {"source": index}}}),
        });
    }
    room.set("/images", json!(images));
    room.set("/textures", json!(textures));
    room.set(
        "/samplers",
        json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]),
    );
    let texture = |index: usize| json!({"index": index});
    room.set(
        "/materials/0",
        json!({
            "pbrMetallicRoughness": {"baseColorTexture": texture(0), "metallicRoughnessTexture": texture(4)},
            "normalTexture": {"index": 6, "scale": 0.5},
            "emissiveTexture": texture(7), "emissiveFactor": [1, 1, 1], "alphaMode": "MASK",
            "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": texture(3)},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0.2]},
                "KHR_materials_specular": {"specularTexture": texture(5), "specularColorTexture": texture(1)},
                "KHR_materials_clearcoat": {
                    "clearcoatFactor": 1, "clearcoatTexture": texture(2),
                    "clearcoatNormalTexture": {"index": 6, "extensions": {"KHR_texture_transform": {"rotation": 1, "scale": [2, 3]}}}
                }
            }
        }),
    );
    let texcoords = room.add_floats("VEC2", 2, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(texcoords));
    room
}

/// Instances of a node, material variants, several scenes, lights and cameras of each kind.
pub fn chosen() -> Fixture {
    const VARIANTS: &str = "KHR_materials_variants";
    let mut room = Fixture::room();
    let translations = room.add_vectors(&[[0.0; 3], [0.5, 0.25, 0.0], [-0.5, 0.5, 0.0]]);
    let rotations = room.add_accessor(&[0, 0, 0, 127, 0, 90, 0, 90, 127, 0, 0, 0], 3, 5120, "VEC4");
    room.set(&format!("/accessors/{rotations}/normalized"), json!(true));
    let scales = room.add_vectors(&[[1.0; 3], [0.5, 1.0, -0.5], [0.25; 3]]);
    let attributes = json!({"TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales});
    room.set(
        "/nodes/1/extensions",
        json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}}),
    );
    room.set(
        "/extensions",
        json!({
            VARIANTS: {"variants": [{"name": "first"}, {"name": "second"}]},
            "KHR_lights_punctual": {"lights": [
                {"type": "point", "intensity": 10, "range": 5},
                {"type": "spot", "color": [1, 0.5, 0.2], "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}},
                {"type": "directional"}
            ]}
        }),
    );
    room.set(
        "/meshes/0/primitives/0/extensions",
        json!({VARIANTS: {"mappings": [{"material": 0, "variants": [0]}, {"material": 1, "variants": [1]}]}}),
    );
    for light in 0..3 {
        room.add_root(json!({"rotation": [-0.7, 0, 0, 0.7], "extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    room.set(
        "/cameras/-",
        json!({"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 0}}),
    );
    room.add_root(json!({"camera": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1]}));
    room.set("/scenes/-", json!({"name": "another", "nodes": [1, 2]}));
    room.set(
        "/extensionsUsed",
        json!([VARIANTS, "EXT_mesh_gpu_instancing", "KHR_lights_punctual"]),
    );
    room
}

/// A `.glb` file of one buffer.
pub fn of_glb(bytes: &[u8]) -> Fixture {
    let length = u32::from_le_bytes(*bytes[12..].first_chunk().expect("a length")) as usize;
    let mut fixture = Fixture::room();
    fixture.json = serde_json::from_slice(&bytes[20..20 + length]).expect("JSON");
    fixture.binary = bytes[28 + length..].to_vec();
    fixture.set("/buffers/0/uri", json!("room.bin"));
    fixture
}

/// Environments in both formats, with every supported compression: description, file extension, and content.
pub fn pictures() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    const SIZE: Vec2<usize> = Vec2(20, 10);
    let value = |i: usize| (i % 20) as f32 * 0.25 + 0.5;
    let written = |names: &[&str], compression, blocks| {
        let samples = |channel: usize| match channel {
            0 => FlatSamples::F16(
                (0..SIZE.area())
                    .map(|i| exr::prelude::f16::from_f32(value(i)))
                    .collect(),
            ),
            _ => FlatSamples::F32((0..SIZE.area()).map(value).collect()),
        };
        let channels = names
            .iter()
            .enumerate()
            .map(|(index, &name)| AnyChannel::new(name, samples(index)));
        let encoding = Encoding {
            compression,
            blocks,
            line_order: LineOrder::Increasing,
        };
        let layer = Layer::new(
            SIZE,
            LayerAttributes::default(),
            encoding,
            AnyChannels::sort(channels.collect()),
        );
        let mut bytes = Cursor::new(Vec::new());
        exr::image::Image::from_layer(layer)
            .write()
            .to_buffered(&mut bytes)
            .expect("an EXR file");
        bytes.into_inner()
    };
    let (colors, lines, tiles) = (&["B", "G", "R"][..], Blocks::ScanLines, Blocks::Tiles(Vec2(8, 8)));
    let mut pictures: Vec<_> = [
        ("EXR, ZIP", colors, Compression::ZIP16, lines),
        ("EXR, luminance, RLE", &["Y"], Compression::RLE, lines),
        ("EXR, PIZ", colors, Compression::PIZ, lines),
        ("EXR, PXR24, alpha", &["A", "B", "G", "R"], Compression::PXR24, lines),
        ("EXR, B44", colors, Compression::B44, lines),
        ("EXR, tiles, ZIPS", colors, Compression::ZIP1, tiles),
        ("EXR, plain", colors, Compression::Uncompressed, lines),
    ]
    .map(|(name, names, compression, blocks)| (name, "exr", written(names, compression, blocks)))
    .into();
    let mut hdr = Vec::new();
    let pixels: Vec<_> = (0..SIZE.area()).map(|i| image::Rgb([value(i), 1.0, 0.25])).collect();
    image::codecs::hdr::HdrEncoder::new(&mut hdr)
        .encode(&pixels, SIZE.0, SIZE.1)
        .expect("an HDR file");
    pictures.push(("HDR", "hdr", hdr));
    pictures
}
