//! Checked reading of accessors: everything is verified when one is opened, so that reading elements can't fail.

use std::fmt::Debug;

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};

use super::diagnostic::{Check, damaged, label};
use super::document::Document;

/// Vectors of three floats: positions or normals.
#[derive(Clone, Copy)]
pub(super) struct Vec3Accessor<'a>(Elements<'a>);

impl<'a> Vec3Accessor<'a> {
    /// Opens an accessor of type VEC3 of FLOAT.
    pub(super) fn open(document: &'a Document, index: Index<Accessor>) -> Check<Self> {
        let (elements, _) = Elements::open(document, index, Type::Vec3, &[ComponentType::F32])?;
        Ok(Self(elements))
    }

    /// Number of vectors.
    pub(super) fn len(&self) -> usize {
        self.0.count
    }

    /// The vector at `index`, which is less than `len`. It may hold NaN or infinity.
    pub(super) fn get(&self, index: usize) -> [f32; 3] {
        let bytes: [u8; 12] = self.0.get(index);
        let component = |at: usize| f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        [component(0), component(4), component(8)]
    }
}

/// Vertex indices of any of the three widths.
#[derive(Clone, Copy)]
pub(super) struct IndexAccessor<'a> {
    elements: Elements<'a>,
    component: ComponentType,
}

impl<'a> IndexAccessor<'a> {
    /// Opens an accessor of type SCALAR of an unsigned type.
    pub(super) fn open(document: &'a Document, index: Index<Accessor>) -> Check<Self> {
        let unsigned = [ComponentType::U8, ComponentType::U16, ComponentType::U32];
        let (elements, component) = Elements::open(document, index, Type::Scalar, &unsigned)?;
        Ok(Self { elements, component })
    }

    /// Number of indices.
    pub(super) fn len(&self) -> usize {
        self.elements.count
    }

    /// The vertex index at `index`, which is less than `len`.
    pub(super) fn get(&self, index: usize) -> u32 {
        match self.component {
            ComponentType::U8 => u32::from(u8::from_le_bytes(self.elements.get(index))),
            ComponentType::U16 => u32::from(u16::from_le_bytes(self.elements.get(index))),
            _ => u32::from_le_bytes(self.elements.get(index)),
        }
    }
}

/// `count` elements, `stride` bytes apart, all within `bytes`.
#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    /// Opens the accessor at `index`, which must have the type `shape` and one of the types of `components`.
    fn open(
        document: &'a Document,
        index: Index<Accessor>,
        shape: Type,
        components: &[ComponentType],
    ) -> Check<(Self, ComponentType)> {
        let index = index.value();
        let accessors = &document.root.accessors;
        let accessor = accessors.get(index).ok_or_else(|| {
            let what = format!("there is no accessor {index}, the file has {}", accessors.len());
            damaged(what)
        })?;
        let fail = |what: String| format!("{}: {what}", label("accessor", index, accessor.name.as_deref()));

        if accessor.sparse.is_some() {
            let what = "sparse accessors aren't supported yet; export without sparse data";
            return Err(fail(what.into()));
        }
        let component = match (accessor.type_, accessor.component_type) {
            (Checked::Valid(kind), Checked::Valid(component)) if kind == shape && components.contains(&component.0) => {
                component.0
            }
            (kind, component) => {
                let (kind, component) = (spell(kind), spell(component));
                let what = format!("its elements are {kind} of {component}, not {shape:?} of one of {components:?}");
                return Err(fail(damaged(what)));
            }
        };
        let Some(view) = accessor.buffer_view else {
            let what = "it has no bufferView; if an extension compresses its data, export without compression";
            return Err(fail(what.into()));
        };
        let size = shape.multiplicity() * component.size();
        let elements = Self::locate(document, accessor, view.value(), size).map_err(|what| fail(damaged(what)))?;
        Ok((elements, component))
    }

    /// Finds the bytes of an accessor into the view at `view_index`, whose elements have `size` bytes.
    fn locate(document: &'a Document, accessor: &Accessor, view_index: usize, size: usize) -> Check<Self> {
        let views = &document.root.buffer_views;
        let view = views
            .get(view_index)
            .ok_or_else(|| format!("there is no bufferView {view_index}, the file has {}", views.len()))?;
        let buffer_index = view.buffer.value();
        let buffer = document.buffers.get(buffer_index).ok_or_else(|| {
            let buffers = document.buffers.len();
            format!("there is no buffer {buffer_index}, the file has {buffers}")
        })?;

        let view_start = view.byte_offset.unwrap_or_default().0;
        let view_bytes = slice(buffer, view_start, view.byte_length.0).ok_or_else(|| {
            format!(
                "bufferView {view_index} is {} bytes from byte {view_start} of buffer {buffer_index}, which has {}",
                view.byte_length.0,
                buffer.len()
            )
        })?;

        // A stride of zero is how some files spell «tightly packed».
        let stride = match view.byte_stride {
            Some(stride) if stride.0 != 0 => stride.0,
            _ => size,
        };
        if stride < size {
            return Err(format!(
                "bufferView {view_index} has a stride of {stride} bytes for elements of {size}"
            ));
        }
        let start = accessor.byte_offset.unwrap_or_default().0;
        let count = accessor.count.0;
        let bytes = span(count, stride, size)
            .and_then(|length| slice(view_bytes, start, length))
            .ok_or_else(|| {
                format!(
                    "its {count} elements from byte {start} don't fit into bufferView {view_index}, which has {} bytes",
                    view_bytes.len()
                )
            })?;
        // The elements were found to lie in memory, so their number fits as well.
        let count = usize::try_from(count).map_err(|_| format!("{count} elements are too many"))?;
        Ok(Self { bytes, stride, count })
    }

    /// The bytes of an element; `N` is no more than the size that was checked.
    fn get<const N: usize>(&self, index: usize) -> [u8; N] {
        let start = index * self.stride;
        std::array::from_fn(|byte| self.bytes[start + byte])
    }
}

fn spell<T: Debug>(value: Checked<T>) -> String {
    match value {
        Checked::Valid(value) => format!("{value:?}"),
        Checked::Invalid => "a kind that glTF doesn't have".into(),
    }
}

/// Bytes from the beginning of the first element to the end of the last.
fn span(count: u64, stride: usize, size: usize) -> Option<u64> {
    match count.checked_sub(1) {
        None => Some(0),
        Some(steps) => steps.checked_mul(stride as u64)?.checked_add(size as u64),
    }
}

fn slice(bytes: &[u8], start: u64, length: u64) -> Option<&[u8]> {
    let end = usize::try_from(start.checked_add(length)?).ok()?;
    bytes.get(usize::try_from(start).ok()?..end)
}
