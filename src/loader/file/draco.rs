//! `KHR_draco_mesh_compression`: primitives whose indices and attributes are stored compressed.

use crate::loader::extensions::DRACO;
use std::collections::{BTreeMap, HashMap};

use draco_core::draco_types::DataType;
use draco_core::geometry_attribute::PointAttribute;
use draco_core::geometry_indices::PointIndex;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::mesh::{Mode, Primitive};
use gltf_json::validation::{Checked, USize64};
use gltf_json::{Accessor, Index};
use serde::Deserialize;

use super::document::Document;
use crate::loader::diagnostic::{Check, Warnings, damaged, primitive_label};
use crate::loader::limits::MAX_TRIANGLES;

/// Maximum size of all decompressed primitives, in bytes: a thousand bytes can expand to millions of equal vertices.
const MOST_BYTES: u64 = 1 << 30;

/// The extension's object of a primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer_view: usize,
    /// Ids within the compressed data, by the attribute's name.
    attributes: BTreeMap<String, u32>,
}

/// Data of an accessor that is not in a buffer.
struct Decompressed {
    count: usize,
    component: ComponentType,
    shape: Type,
    bytes: Vec<u8>,
}

/// Gives each compressed primitive new accessors, whose bytes are in [`Document::decompressed`]. If that fails, a primitive that
/// also has uncompressed data keeps it, with a warning.
pub(crate) fn decompress(document: &mut Document, warnings: &mut Warnings) -> Check<()> {
    let mut decoder = Decoder::default();
    for mesh in 0..document.root.meshes.len() {
        for primitive in 0..document.root.meshes[mesh].primitives.len() {
            let json = &document.root.meshes[mesh].primitives[primitive];
            let extensions = json.extensions.as_ref();
            let Some(extension) = extensions.and_then(|extensions| extensions.others.get(DRACO)) else {
                continue;
            };
            let decoded = Compressed::deserialize(extension)
                .map_err(|error| damaged(error.to_string()))
                .and_then(|compressed| decoder.primitive(document, json, &compressed));
            let has_plain_data = has_plain_data(document, json);
            let label = || {
                let label = primitive_label(mesh, &document.root.meshes[mesh], primitive);
                format!("{label}, {DRACO}")
            };
            match decoded {
                Ok(decoded) => replace(document, [mesh, primitive], decoded),
                Err(what) if has_plain_data => warnings.push(format!(
                    "{}: {what}; the picture is correct, by the file's uncompressed data",
                    label()
                )),
                Err(what) => return Err(format!("{}: {what}", label())),
            }
        }
    }
    document.budget.take(decoder.bytes, "decompressed data")
}

/// The new accessors of a primitive; the indices have no name.
type Parts = Vec<(Option<Checked<gltf_json::mesh::Semantic>>, Accessor, Vec<u8>)>;

#[derive(Default)]
struct Decoder {
    /// By view: primitives may share compressed data.
    meshes: HashMap<usize, Mesh>,
    bytes: u64,
    triangles: u64,
}

impl Decoder {
    fn primitive(&mut self, document: &Document, json: &Primitive, compressed: &Compressed) -> Check<Parts> {
        let view = compressed.buffer_view;
        if !self.meshes.contains_key(&view) {
            let mesh = self.mesh(document, view)?;
            self.meshes.insert(view, mesh);
        }
        let mesh = &self.meshes[&view];
        let mut parts = Parts::new();
        let triangles = mesh.num_faces();
        self.bytes += 12 * triangles as u64;
        let accessors = &document.root.accessors;
        for (semantic, index) in &json.attributes {
            let name = semantic.to_string();
            let Some(&id) = compressed.attributes.get(&name) else {
                continue;
            };
            let accessor = accessors.get(index.value()).ok_or_else(|| {
                damaged(format_args!(
                    "{name}: there is no accessor {index}, the file has {}",
                    accessors.len()
                ))
            })?;
            let attribute = mesh
                .attribute_by_unique_id(id)
                .ok_or_else(|| damaged(format_args!("{name}: its data has no attribute {id}")))?;
            let (data, left) = (mesh.num_points(), MOST_BYTES.saturating_sub(self.bytes));
            let data = decompressed(attribute, data, left).map_err(|what| format!("{name}: {what}"))?;
            self.bytes += data.bytes.len() as u64;
            let (accessor, bytes) = filled(accessor.clone(), data);
            parts.push((Some(semantic.clone()), accessor, bytes));
        }
        if self.bytes > MOST_BYTES {
            return Err(too_much());
        }
        document.budget.check(self.bytes, "decompressed data")?;
        let indices = Decompressed {
            count: 3 * triangles,
            component: ComponentType::U32,
            shape: Type::Scalar,
            bytes: mesh
                .faces()
                .iter()
                .flatten()
                .flat_map(|point| point.0.to_le_bytes())
                .collect(),
        };
        let (accessor, bytes) = filled(blank(), indices);
        parts.push((None, accessor, bytes));
        Ok(parts)
    }

    /// Decodes a view.
    fn mesh(&mut self, document: &Document, view: usize) -> Check<Mesh> {
        let views = &document.root.buffer_views;
        let json = views.get(view).ok_or_else(|| {
            damaged(format_args!(
                "there is no bufferView {view}, the file has {}",
                views.len()
            ))
        })?;
        let limits = DecodeLimits::default()
            .with_max_points(MOST_BYTES)
            .with_max_faces(MAX_TRIANGLES as u64 - self.triangles)
            .with_max_decoded_bytes(MOST_BYTES.saturating_sub(self.bytes));
        let mut buffer = DecoderBuffer::new(document.view_bytes(view, json)?).with_limits(limits);
        let mut mesh = Mesh::new();
        MeshDecoder::new()
            .decode(&mut buffer, &mut mesh)
            .map_err(|error| damaged(format_args!("bufferView {view} can't be decompressed ({error})")))?;
        self.triangles += mesh.num_faces() as u64;
        Ok(mesh)
    }
}

fn too_much() -> String {
    format!("it and those before have more than the {MOST_BYTES} bytes that are read; split the scene")
}

/// Whether all data of a primitive is in buffers.
fn has_plain_data(document: &Document, primitive: &Primitive) -> bool {
    let mut accessors = primitive.attributes.values().chain(&primitive.indices);
    accessors.all(|index| {
        let accessor = document.root.accessors.get(index.value());
        accessor.is_some_and(|accessor| accessor.buffer_view.is_some() || accessor.sparse.is_some())
    })
}

/// The values of an attribute at all points, if `left` bytes are sufficient.
fn decompressed(attribute: &PointAttribute, points: usize, left: u64) -> Check<Decompressed> {
    let component = match attribute.data_type() {
        DataType::Int8 => ComponentType::I8,
        DataType::Uint8 => ComponentType::U8,
        DataType::Int16 => ComponentType::I16,
        DataType::Uint16 => ComponentType::U16,
        DataType::Uint32 => ComponentType::U32,
        DataType::Float32 => ComponentType::F32,
        other => return Err(damaged(format_args!("glTF has no {other:?}"))),
    };
    let shape = match attribute.num_components() {
        1 => Type::Scalar,
        2 => Type::Vec2,
        3 => Type::Vec3,
        4 => Type::Vec4,
        other => return Err(damaged(format_args!("glTF has no vectors of {other} components"))),
    };
    let size = component.size() * shape.multiplicity();
    if (points as u64).saturating_mul(size as u64) > left {
        return Err(too_much());
    }
    let data = attribute.buffer().data();
    let stride = attribute.byte_stride();
    let mut bytes = Vec::with_capacity(points * size);
    for point in 0..points {
        let value = attribute.mapped_index(PointIndex(point as u32)).0;
        let value = stride
            .checked_mul(value.into())
            .and_then(|start| data.get(usize::try_from(start).ok()?..)?.get(..size))
            .ok_or_else(|| damaged(format_args!("vertex {point} has no value")))?;
        bytes.extend_from_slice(value);
    }
    Ok(Decompressed {
        count: points,
        component,
        shape,
        bytes,
    })
}

/// An accessor that describes decompressed data.
fn filled(mut accessor: Accessor, data: Decompressed) -> (Accessor, Vec<u8>) {
    accessor.buffer_view = None;
    accessor.byte_offset = None;
    accessor.sparse = None;
    accessor.count = USize64::from(data.count);
    accessor.component_type = Checked::Valid(GenericComponentType(data.component));
    accessor.type_ = Checked::Valid(data.shape);
    accessor.name = Some("decompressed".to_owned());
    (accessor, data.bytes)
}

/// An accessor of indices, initially empty.
fn blank() -> Accessor {
    Accessor {
        buffer_view: None,
        byte_offset: None,
        count: USize64(0),
        component_type: Checked::Valid(GenericComponentType(ComponentType::U32)),
        extensions: None,
        extras: Default::default(),
        type_: Checked::Valid(Type::Scalar),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}

/// Replaces the primitive's accessors in the document.
fn replace(document: &mut Document, [mesh, primitive]: [usize; 2], parts: Parts) {
    for (semantic, accessor, bytes) in parts {
        let index = document.root.accessors.len();
        document.root.accessors.push(accessor);
        document.decompressed.insert(index, bytes);
        let primitive = &mut document.root.meshes[mesh].primitives[primitive];
        // Decompressed strips are triangles.
        primitive.mode = Checked::Valid(Mode::Triangles);
        match semantic {
            Some(semantic) => drop(primitive.attributes.insert(semantic, Index::new(index as u32))),
            None => primitive.indices = Some(Index::new(index as u32)),
        }
    }
}
