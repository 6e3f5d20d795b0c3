//! Reads a `.gltf` or `.glb` file and its buffers, without interpreting them.
//!
//! The `gltf` crate's own reader is not used beyond its JSON types: its validation indexes accessors unchecked, treats
//! `KHR_materials_volume` as unsupported, and rejects custom attributes that the format allows.

use crate::loader::extensions::{QUANTIZATION, is_supported};
use std::collections::HashMap;
use std::fs;
use std::path::Path;

use gltf_json::Root;
use gltf_json::buffer::View;
use serde_json::Value;

use super::budget::Budget;
use super::buffer::slice;
use super::{buffer, draco, glb, json, meshopt};
use crate::loader::diagnostic::{Check, Warnings, damaged};
use crate::text::quote;

/// Maximum size of a file, in bytes: the maximum of a `.glb` header.
const MAX_FILE_SIZE: u64 = u32::MAX as u64;

/// The file's JSON and the bytes of its buffers. Indices in the JSON are unchecked.
pub(crate) struct Document {
    /// The JSON.
    pub root: Root,
    /// One byte string per `root.buffers`, as long as its `byteLength`, or empty if compressed views replace it.
    buffers: Vec<Vec<u8>>,
    /// The bytes of the views that are stored compressed.
    decoded_views: HashMap<usize, Vec<u8>>,
    /// The bytes of the accessors whose data was decompressed, by index: tightly packed elements.
    pub decompressed: HashMap<usize, Vec<u8>>,
    /// Whether the file uses [`QUANTIZATION`].
    pub is_quantized: bool,
    /// The memory budget for the rest of the scene.
    pub budget: Budget,
}

impl Document {
    /// Reads the file at `path` and all buffers that it refers to, within the rest of the budget.
    pub(crate) fn read(path: &Path, budget: Budget, warnings: &mut Warnings) -> Check<Self> {
        let mut bytes = read_file(path, &budget)?;
        let (json, binary) = if bytes.starts_with(glb::MAGIC) {
            glb::split(&bytes)?
        } else {
            (0..bytes.len(), None)
        };
        json::check_size(&bytes[json.clone()], &budget)?;
        let root = parse(&bytes[json], warnings)?;
        // The binary chunk can be most of the file: it is kept in place instead of copied.
        let binary = binary.map(|chunk| {
            bytes.truncate(chunk.end);
            bytes.drain(..chunk.start);
            bytes
        });
        let folder = path.parent().unwrap_or(Path::new(""));
        let buffers = buffer::read_all(&root, folder, binary, &budget, warnings)?;
        let decoded_views = meshopt::decode_views(&root, &buffers, &budget)?;
        let mut extensions = root.extensions_used.iter().chain(&root.extensions_required);
        let is_quantized = extensions.any(|extension| extension == QUANTIZATION);
        let mut document = Self {
            root,
            buffers,
            decoded_views,
            decompressed: HashMap::new(),
            is_quantized,
            budget,
        };
        draco::decompress(&mut document, warnings)?;
        Ok(document)
    }

    /// The bytes of the view at `index`, decoded where they are stored compressed.
    pub(crate) fn view_bytes(&self, index: usize, view: &View) -> Check<&[u8]> {
        if let Some(bytes) = self.decoded_views.get(&index) {
            return Ok(bytes);
        }
        let buffer_index = view.buffer.value();
        let buffer = self.buffers.get(buffer_index).ok_or_else(|| {
            let buffers = self.buffers.len();
            format!("there is no buffer {buffer_index}, the file has {buffers}")
        })?;
        let start = view.byte_offset.unwrap_or_default().0;
        slice(buffer, start, view.byte_length.0).ok_or_else(|| {
            format!(
                "bufferView {index} is {} bytes from byte {start} of buffer {buffer_index}, which has {}",
                view.byte_length.0,
                buffer.len()
            )
        })
    }
}

fn read_file(path: &Path, budget: &Budget) -> Check<Vec<u8>> {
    let unreadable = |error| format!("can't be read ({error}); check the path and its permissions");
    let metadata = fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err("isn't a file; give the path of a .gltf or .glb file".into());
    }
    if metadata.len() > MAX_FILE_SIZE {
        return Err(format!(
            "has {} bytes, more than the {MAX_FILE_SIZE} that a glTF file is read up to; split the scene",
            metadata.len()
        ));
    }
    budget.check(metadata.len(), "the file itself")?;
    let bytes = fs::read(path).map_err(unreadable)?;
    if bytes.is_empty() {
        return Err("is empty; export the scene again".into());
    }
    Ok(bytes)
}

fn parse(json: &[u8], warnings: &mut Warnings) -> Check<Root> {
    let json = json::read(json, warnings)?;
    // Checked first: another version or extension may have another structure.
    check_version(&json)?;
    let required = json.get("extensionsRequired").and_then(Value::as_array);
    for extension in required.into_iter().flatten().filter_map(Value::as_str) {
        if !is_supported(extension) {
            return Err(format!(
                "requires the extension {}, which isn't supported; export the scene without it",
                quote(extension)
            ));
        }
    }
    json::to_root(json)
}

fn check_version(json: &Value) -> Check<()> {
    let Some(asset) = json.get("asset").filter(|asset| asset.get("version").is_some()) else {
        return Err(damaged("has no asset.version, so it isn't glTF 2.0"));
    };
    let text = |name: &str| match asset.get(name) {
        None => Ok(None),
        Some(Value::String(version)) => Ok(Some(version.as_str())),
        Some(other) => Err(damaged(format_args!(
            "isn't glTF 2.0: its asset.{name} is {}, not a text such as \"2.0\"",
            quote(&other.to_string())
        ))),
    };
    let (version, least) = (text("version")?.unwrap_or_default(), text("minVersion")?);
    let is_2 = version == "2" || version.starts_with("2.");
    if is_2 && least.is_none_or(|least| least == "2.0") {
        return Ok(());
    }
    Err(format!(
        "is glTF {}, but only 2.0 is supported; export it as glTF 2.0",
        quote(least.unwrap_or(version))
    ))
}
