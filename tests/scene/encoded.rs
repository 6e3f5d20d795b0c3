//! Compressed inputs, for the tests that read them and those that damage them.

use draco_core::{DataType, EncoderBuffer, EncoderOptions, GeometryAttributeType, Mesh, MeshEncoder, PointAttribute};
use serde_json::json;

use crate::fixture::Fixture;

/// Compresses views.
pub const MESHOPT: &str = "EXT_meshopt_compression";

/// Makes the view of an accessor a compressed one.
pub fn compress(room: &mut Fixture, accessor: usize, encoded: &[u8], stride: usize, count: usize, mode: &str) {
    let offset = room.binary.len();
    room.binary.extend_from_slice(encoded);
    room.set("/buffers/0/byteLength", json!(room.binary.len()));
    let view = room.json["accessors"][accessor]["bufferView"].as_u64().expect("a view");
    let extension = json!({
        "buffer": 0, "byteOffset": offset, "byteLength": encoded.len(),
        "byteStride": stride, "count": count, "mode": mode
    });
    room.set(
        &format!("/bufferViews/{view}"),
        json!({"buffer": 1, "byteLength": stride * count, "extensions": {MESHOPT: extension}}),
    );
}

/// The room with its floor's views compressed.
pub fn meshopt_room() -> Fixture {
    let mut room = Fixture::room();
    room.set("/extensionsUsed", json!([MESHOPT]));
    room.set("/extensionsRequired", json!([MESHOPT]));
    room.set(
        "/buffers/-",
        json!({"byteLength": 4096, "extensions": {MESHOPT: {"fallback": true}}}),
    );
    let vectors = |bytes: &[u8]| -> Vec<[u8; 12]> { bytes.as_chunks().0.to_vec() };
    let (positions, normals) = (vectors(&room.binary[..48]), vectors(&room.binary[48..96]));
    for (accessor, vectors) in [(0, positions), (1, normals)] {
        let encoded = meshopt::encode_vertex_buffer(&vectors).expect("encoded");
        compress(&mut room, accessor, &encoded, 12, 4, "ATTRIBUTES");
    }
    let encoded = meshopt::encode_index_buffer(&[0, 1, 2, 0, 2, 3], 4).expect("encoded");
    compress(&mut room, 2, &encoded, 2, 6, "TRIANGLES");
    room
}

/// Compresses primitives.
pub const DRACO: &str = "KHR_draco_mesh_compression";

/// Encodings: sequential, edgebreaker, and edgebreaker with valence.
pub const SEQUENTIAL: i32 = 0;
pub const EDGEBREAKER: i32 = 1;
pub const VALENCE: i32 = 2;

/// An attribute of a mesh to be compressed, as its accessor has it.
pub struct Attribute<'a> {
    pub kind: GeometryAttributeType,
    pub component: DataType,
    pub width: u8,
    pub bytes: &'a [u8],
}

/// Compresses a mesh; the numbers of its attributes are those of the list. `quantized`: floats have 14 bits.
pub fn encode(attributes: &[Attribute<'_>], triangles: &[[u32; 3]], method: i32, quantized: bool) -> Vec<u8> {
    let mut mesh = Mesh::new();
    let mut options = EncoderOptions::new();
    options.set_encoding_method(method.min(EDGEBREAKER));
    if method == VALENCE {
        options.set_compression_level(10);
    }
    for attribute in attributes {
        let size = attribute.component.byte_length() * usize::from(attribute.width);
        let count = attribute.bytes.len() / size;
        mesh.set_num_points(count);
        let mut encoded = PointAttribute::new();
        encoded.init(attribute.kind, attribute.width, attribute.component, false, count);
        encoded.buffer_mut().write(0, attribute.bytes);
        let id = mesh.add_attribute(encoded);
        if quantized && attribute.component == DataType::Float32 {
            options.set_attribute_quantization(id, 14);
        }
    }
    mesh.set_num_faces(triangles.len());
    for (index, triangle) in triangles.iter().enumerate() {
        mesh.set_face_from_indices(index, *triangle);
    }
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut encoded = EncoderBuffer::new();
    encoder.encode(&options, &mut encoded).expect("encoded");
    encoded.data().to_vec()
}

/// The room whose floor has only compressed data.
pub fn draco_room(method: i32, quantized: bool) -> Fixture {
    let mut room = Fixture::room();
    let (positions, normals) = (room.binary[..48].to_vec(), room.binary[48..96].to_vec());
    let attribute = |kind, bytes| Attribute {
        kind,
        component: DataType::Float32,
        width: 3,
        bytes,
    };
    let attributes = [
        attribute(GeometryAttributeType::Position, &positions[..]),
        attribute(GeometryAttributeType::Normal, &normals),
    ];
    let encoded = encode(&attributes, &[[0, 1, 2], [0, 2, 3]], method, quantized);
    add_compressed(&mut room, &encoded);
    for accessor in 0..3 {
        room.remove(&format!("/accessors/{accessor}/bufferView"));
    }
    room.set("/extensionsRequired", json!([DRACO]));
    room
}

/// Adds compressed data to the floor, which keeps its own.
pub fn add_compressed(room: &mut Fixture, encoded: &[u8]) {
    let accessor = room.add_accessor(encoded, encoded.len(), 5121, "SCALAR");
    let view = room.json["accessors"][accessor]["bufferView"].clone();
    room.set(
        "/meshes/0/primitives/0/extensions",
        json!({DRACO: {"bufferView": view, "attributes": {"POSITION": 0, "NORMAL": 1}}}),
    );
    room.set("/extensionsUsed", json!([DRACO]));
}

/// A WebP of two texels side by side, red and half green, without loss.
pub fn webp() -> Vec<u8> {
    let mut webp = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_vec(2, 1, vec![255, 0, 0, 255, 0, 255, 0, 128])
        .expect("two texels")
        .write_to(&mut webp, image::ImageFormat::WebP)
        .expect("a WebP");
    webp.into_inner()
}

/// Four squares of 4×4 texels, red, green, blue and white, by Basis Universal's encoder.
pub const KTX2: [(&str, &[u8]); 4] = [
    ("ETC1S", include_bytes!("ktx2/etc1s.ktx2")),
    ("ETC1S with alpha", include_bytes!("ktx2/etc1s-alpha.ktx2")),
    ("UASTC", include_bytes!("ktx2/uastc.ktx2")),
    ("UASTC, mip levels, Zstandard", include_bytes!("ktx2/uastc-zstd.ktx2")),
];
