//! `EXT_meshopt_compression`: buffer views that are stored compressed.

use crate::loader::extensions::MESHOPT;
use std::collections::HashMap;

use gltf_json::buffer::View;
use gltf_json::{Buffer, Root};
use meshopt::{
    decode_filter_oct, decode_filter_quat, decode_index_buffer, decode_index_sequence, decode_vertex_buffer,
};
use serde::Deserialize;

use super::budget::Budget;
use super::buffer::slice;
use crate::loader::diagnostic::{Check, damaged, label};

/// Maximum expansion of a compressed byte: two bits encode a group of 16 equal bytes.
const MAX_RATIO: u64 = 64;

/// The extension's object of a view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Default)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
}

/// Whether all data of a buffer also comes from compressed views, so that it may be absent.
pub(crate) fn is_fallback(buffer: &Buffer) -> bool {
    let extensions = buffer.extensions.as_ref();
    let extension = extensions.and_then(|extensions| extensions.others.get(MESHOPT));
    extension.and_then(|extension| extension.get("fallback")?.as_bool()) == Some(true)
}

/// The bytes of each view that is stored compressed, by its index.
pub(crate) fn decode_views(root: &Root, buffers: &[Vec<u8>], budget: &Budget) -> Check<HashMap<usize, Vec<u8>>> {
    let mut decoded = HashMap::new();
    for (index, view) in root.buffer_views.iter().enumerate() {
        let extensions = view.extensions.as_ref();
        let Some(extension) = extensions.and_then(|extensions| extensions.others.get(MESHOPT)) else {
            continue;
        };
        let bytes = Compressed::deserialize(extension)
            .map_err(|error| damaged(error.to_string()))
            .and_then(|compressed| {
                budget.take(compressed.check(view)?, "its decompressed data")?;
                compressed.decode(buffers)
            });
        let bytes = bytes.map_err(|what| {
            let view = label("bufferView", index, view.name.as_deref());
            format!("{view}, {MESHOPT}: {what}")
        })?;
        decoded.insert(index, bytes);
    }
    Ok(decoded)
}

impl Compressed {
    /// Checks the sizes against each other and returns the decoded one. The decoder does not check them.
    fn check(&self, view: &View) -> Check<u64> {
        let (count, stride) = (self.count, self.byte_stride);
        let filtered = match self.filter {
            Filter::None | Filter::Exponential => true,
            Filter::Octahedral => stride == 4 || stride == 8,
            Filter::Quaternion => stride == 8,
        };
        let fits = match self.mode {
            Mode::Attributes => stride > 0 && stride <= 256 && stride.is_multiple_of(4) && filtered,
            Mode::Triangles | Mode::Indices => (stride == 2 || stride == 4) && self.filter == Filter::None,
        };
        if !fits {
            return Err(damaged(format_args!(
                "a stride of {stride} bytes does not fit its mode and filter"
            )));
        }
        if self.mode == Mode::Triangles && !count.is_multiple_of(3) {
            return Err(damaged(format_args!("{count} indices form no triangles")));
        }
        let bytes = count.checked_mul(stride).filter(|&bytes| bytes == view.byte_length.0);
        match bytes {
            None => Err(damaged(format_args!(
                "{count} elements of {stride} bytes aren't the view's {} bytes",
                view.byte_length.0
            ))),
            // Before they are allocated.
            Some(bytes) if bytes / MAX_RATIO > self.byte_length => Err(damaged(format_args!(
                "{} bytes can't expand to {bytes}",
                self.byte_length
            ))),
            Some(bytes) => Ok(bytes),
        }
    }

    fn decode(&self, buffers: &[Vec<u8>]) -> Check<Vec<u8>> {
        let (start, length) = (self.byte_offset, self.byte_length);
        let encoded = buffers.get(self.buffer);
        let encoded = encoded.and_then(|buffer| slice(buffer, start, length)).ok_or_else(|| {
            damaged(format_args!(
                "there are no {length} bytes from byte {start} of buffer {}",
                self.buffer
            ))
        })?;
        // `check` has bounded both.
        let (count, stride) = (self.count as usize, self.byte_stride as usize);
        let bytes = match (self.mode, stride) {
            (Mode::Triangles, 2) => decode_index_buffer::<u16>(encoded, count).map(to_bytes),
            (Mode::Triangles, _) => decode_index_buffer::<u32>(encoded, count).map(to_bytes),
            (Mode::Indices, 2) => decode_index_sequence::<u16>(encoded, count).map(to_bytes),
            (Mode::Indices, _) => decode_index_sequence::<u32>(encoded, count).map(to_bytes),
            (Mode::Attributes, _) => match (self.filter, stride) {
                (Filter::None, _) => decode_vertices(encoded, count, stride),
                (Filter::Octahedral, 4) => decode_vertex_buffer(encoded, count).map(|mut vectors: Vec<[i8; 4]>| {
                    decode_filter_oct(&mut vectors);
                    to_bytes(vectors)
                }),
                (Filter::Octahedral, _) => decode_vertex_buffer(encoded, count).map(|mut vectors: Vec<[i16; 4]>| {
                    decode_filter_oct(&mut vectors);
                    to_bytes(vectors)
                }),
                (Filter::Quaternion, _) => decode_vertex_buffer(encoded, count).map(|mut rotations: Vec<[i16; 4]>| {
                    decode_filter_quat(&mut rotations);
                    to_bytes(rotations)
                }),
                (Filter::Exponential, _) => decode_vertices(encoded, count, stride).map(|mut bytes| {
                    bytes.as_chunks_mut().0.iter_mut().for_each(decode_exponential);
                    bytes
                }),
            },
        };
        bytes.map_err(|_| {
            damaged(format_args!(
                "its {length} bytes aren't what the mode {:?} has",
                self.mode
            ))
        })
    }
}

/// glTF's numbers have their lowest byte first, and so have those of every machine that Vulkan runs on.
fn to_bytes<T: bytemuck::NoUninit>(elements: Vec<T>) -> Vec<u8> {
    bytemuck::cast_slice(&elements).to_vec()
}

/// A signed mantissa of 24 bits and an exponent of 8 above it become a float.
fn decode_exponential(bytes: &mut [u8; 4]) {
    let value = i32::from_le_bytes(*bytes);
    let (mantissa, exponent) = (value << 8 >> 8, value >> 24);
    *bytes = (mantissa as f32 * (exponent as f32).exp2()).to_le_bytes();
}

/// An element of `N` bytes: the decoder takes the stride from a type.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct Element<const N: usize>([u8; N]);

impl<const N: usize> Default for Element<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

fn decode_vertices(encoded: &[u8], count: usize, stride: usize) -> meshopt::Result<Vec<u8>> {
    fn decode<const N: usize>(encoded: &[u8], count: usize) -> meshopt::Result<Vec<u8>> {
        let elements: Vec<Element<N>> = decode_vertex_buffer(encoded, count)?;
        Ok(elements.iter().flat_map(|element| element.0).collect())
    }
    macro_rules! by_stride {
        ($($stride:literal)*) => {
            match stride {
                $($stride => decode::<$stride>(encoded, count),)*
                // Only 256 is left: `check` has refused the rest.
                _ => decode::<256>(encoded, count),
            }
        };
    }
    by_stride!(
        4 8 12 16 20 24 28 32 36 40 44 48 52 56 60 64 68 72 76 80 84 88 92 96 100 104 108 112 116 120 124 128 132 136
        140 144 148 152 156 160 164 168 172 176 180 184 188 192 196 200 204 208 212 216 220 224 228 232 236 240 244 248
        252
    )
}
