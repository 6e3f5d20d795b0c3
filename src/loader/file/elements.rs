//! Access to the elements of an accessor: everything is verified when it is opened, so that reading can't fail.

use std::fmt::Debug;

use gltf_json::accessor::{ComponentType, Type, sparse};
use gltf_json::buffer::View;
use gltf_json::validation::Checked;
use gltf_json::{Accessor, Index};

use super::buffer::slice;
use super::document::Document;
use crate::loader::diagnostic::{Check, damaged, label};

/// Maximum number of elements of an accessor without data: the file's size does not limit their number.
const MAX_ZEROS: u64 = 1 << 20;

/// How components are stored.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Format {
    /// The type of each.
    pub component: ComponentType,
    /// Whether integers are fractions of the type's largest value.
    pub is_normalized: bool,
}

impl Format {
    /// Plain numbers.
    pub(crate) const fn plain(component: ComponentType) -> Self {
        Self {
            component,
            is_normalized: false,
        }
    }

    /// Integers that are fractions.
    pub(crate) const fn normalized(component: ComponentType) -> Self {
        Self {
            component,
            is_normalized: true,
        }
    }

    fn spell(self) -> String {
        let prefix = if self.is_normalized { "normalized " } else { "" };
        format!("{prefix}{:?}", self.component)
    }
}

/// The elements of an accessor, including its sparse part.
#[derive(Clone, Copy)]
pub(crate) struct Elements<'a> {
    /// `None`: all are zero.
    base: Option<Packed<'a>>,
    sparse: Option<Sparse<'a>>,
    /// Number of elements.
    pub count: usize,
    /// Number of components of each.
    pub width: usize,
    /// Their format.
    pub format: Format,
}

impl<'a> Elements<'a> {
    /// Opens the accessor at `index`, which must have one of the types `shapes` and one of `formats`.
    pub(crate) fn open(
        document: &'a Document,
        index: Index<Accessor>,
        shapes: &[Type],
        formats: &[Format],
    ) -> Check<Self> {
        let index = index.value();
        let accessors = &document.root.accessors;
        let accessor = accessors.get(index).ok_or_else(|| {
            let what = format!("there is no accessor {index}, the file has {}", accessors.len());
            damaged(what)
        })?;
        let fail = |what: String| format!("{}: {what}", label("accessor", index, accessor.name.as_deref()));

        let (shape, format) = kind(accessor, shapes, formats).map_err(|what| fail(damaged(what)))?;
        Self::locate(document, index, accessor, shape, format).map_err(|what| fail(damaged(what)))
    }

    fn locate(document: &'a Document, index: usize, accessor: &Accessor, shape: Type, format: Format) -> Check<Self> {
        let width = shape.multiplicity();
        let size = width * format.component.size();
        let count = accessor.count.0;
        let start = accessor.byte_offset.unwrap_or_default().0;
        let base = match (document.decompressed.get(&index), accessor.buffer_view) {
            (Some(bytes), _) => Some(Packed {
                bytes,
                stride: size,
                size,
            }),
            (None, Some(view)) => Some(Packed::locate(document, view, start, count, size)?),
            (None, None) => None,
        };
        if base.is_none() && count > MAX_ZEROS {
            return Err(format!(
                "it has {count} elements without a bufferView, more than the {MAX_ZEROS} that are read"
            ));
        }
        let sparse = accessor
            .sparse
            .as_ref()
            .map(|sparse| Sparse::locate(document, sparse, count, size))
            .transpose()
            .map_err(|what| format!("its sparse part: {what}"))?;
        // The elements are in memory, or few, so their number fits as well.
        let count = usize::try_from(count).map_err(|_| format!("{count} elements are too many"))?;
        Ok(Self {
            base,
            sparse,
            count,
            width,
            format,
        })
    }

    /// The bytes of the element at `index`, which is less than `count`; `None` if it is zero.
    pub(crate) fn get(&self, index: usize) -> Option<&'a [u8]> {
        self.sparse
            .and_then(|sparse| sparse.get(index))
            .or_else(|| self.base.map(|base| base.get(index)))
    }
}

/// The type and format of an accessor, if they are allowed.
fn kind(accessor: &Accessor, shapes: &[Type], formats: &[Format]) -> Check<(Type, Format)> {
    let format = match accessor.component_type {
        Checked::Valid(component) => Some(Format {
            component: component.0,
            // The flag does not apply to floats.
            is_normalized: accessor.normalized && component.0 != ComponentType::F32,
        }),
        Checked::Invalid => None,
    };
    match (accessor.type_, format) {
        (Checked::Valid(shape), Some(format)) if shapes.contains(&shape) && formats.contains(&format) => {
            Ok((shape, format))
        }
        (shape, format) => {
            let shape = match shape {
                Checked::Valid(shape) => format!("{shape:?}"),
                Checked::Invalid => "of a kind that glTF doesn't have".into(),
            };
            Err(format!(
                "its elements are {shape} of {}, not {} of {}",
                format.map_or("a kind that glTF doesn't have".into(), Format::spell),
                alternatives(shapes.iter().map(spell)),
                alternatives(formats.iter().map(|format| format.spell())),
            ))
        }
    }
}

fn spell(value: impl Debug) -> String {
    format!("{value:?}")
}

fn alternatives(items: impl Iterator<Item = String>) -> String {
    items.collect::<Vec<_>>().join(" or ")
}

/// The sparse part of an accessor: replaced elements at increasing indices.
#[derive(Clone, Copy)]
struct Sparse<'a> {
    count: usize,
    indices: Packed<'a>,
    values: Packed<'a>,
}

impl<'a> Sparse<'a> {
    /// Opens the sparse part of an accessor of `elements` elements, which have `size` bytes.
    fn locate(document: &'a Document, sparse: &sparse::Sparse, elements: u64, size: usize) -> Check<Self> {
        let Checked::Valid(index_type) = sparse.indices.component_type else {
            return Err("its indices are of a kind that glTF doesn't have".into());
        };
        let count = sparse.count.0;
        let (indices, values) = (&sparse.indices, &sparse.values);
        let index_size = index_type.0.size();
        let sparse = Self {
            indices: Packed::locate(document, indices.buffer_view, indices.byte_offset.0, count, index_size)?,
            values: Packed::locate(document, values.buffer_view, values.byte_offset.0, count, size)?,
            count: usize::try_from(count).map_err(|_| format!("{count} elements are too many"))?,
        };
        let mut least = 0;
        for at in 0..sparse.count {
            let index = sparse.index(at) as u64;
            if index < least || index >= elements {
                return Err(format!(
                    "its index {at} is {index}, but they must increase and be less than {elements}"
                ));
            }
            least = index + 1;
        }
        Ok(sparse)
    }

    fn index(&self, at: usize) -> usize {
        unsigned(self.indices.get(at)) as usize
    }

    /// The replacement of the element at `index`, if any.
    fn get(&self, index: usize) -> Option<&'a [u8]> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.index(middle) < index {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        (low < self.count && self.index(low) == index).then(|| self.values.get(low))
    }
}

/// Value of one to four bytes, the lowest first.
pub(crate) fn unsigned(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte))
}

/// Elements of `size` bytes, `stride` bytes apart, all within `bytes`.
#[derive(Clone, Copy)]
struct Packed<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Packed<'a> {
    /// Finds `count` elements of `size` bytes from byte `start` of a view.
    fn locate(document: &'a Document, view: Index<View>, start: u64, count: u64, size: usize) -> Check<Self> {
        let view_index = view.value();
        let views = &document.root.buffer_views;
        let view = views
            .get(view_index)
            .ok_or_else(|| format!("there is no bufferView {view_index}, the file has {}", views.len()))?;
        let view_bytes = document.view_bytes(view_index, view)?;

        // Some files use a stride of zero for tightly packed data.
        let stride = match view.byte_stride {
            Some(stride) if stride.0 != 0 => stride.0,
            _ => size,
        };
        if stride < size {
            return Err(format!(
                "bufferView {view_index} has a stride of {stride} bytes for elements of {size}"
            ));
        }
        let bytes = span(count, stride, size)
            .and_then(|length| slice(view_bytes, start, length))
            .ok_or_else(|| {
                format!(
                    "its {count} elements from byte {start} don't fit into bufferView {view_index}, which has {} bytes",
                    view_bytes.len()
                )
            })?;
        Ok(Self { bytes, stride, size })
    }

    fn get(&self, index: usize) -> &'a [u8] {
        &self.bytes[index * self.stride..][..self.size]
    }
}

/// Bytes from the beginning of the first element to the end of the last.
fn span(count: u64, stride: usize, size: usize) -> Option<u64> {
    match count.checked_sub(1) {
        None => Some(0),
        Some(steps) => steps.checked_mul(stride as u64)?.checked_add(size as u64),
    }
}
