//! Reads the buffers that a glTF file refers to: the `.glb` binary chunk, data URIs and external files.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use gltf_json::{Buffer, Root};

use super::budget::Budget;
use super::meshopt;
use crate::loader::diagnostic::{Check, Warnings, damaged, label};
use crate::text::quote;

/// Base64 with optional padding, which some exporters omit.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Number of bytes that may be missing at a buffer's end: some exporters count padding that they do not write.
const MOST_PADDING: u64 = 3;

/// Reads each buffer of `root`. `folder` holds the scene file, `binary` is the binary chunk of a `.glb`.
pub(crate) fn read_all(
    root: &Root,
    folder: &Path,
    binary: Option<Vec<u8>>,
    budget: &Budget,
    warnings: &mut Warnings,
) -> Check<Vec<Vec<u8>>> {
    // Checked before any is read: a small file can refer to a large one a thousand times.
    let total = root
        .buffers
        .iter()
        .fold(0u64, |total, buffer| total.saturating_add(buffer.byte_length.0));
    budget.take(total, "what its buffers hold")?;
    let mut binary = binary;
    let mut buffers = Vec::with_capacity(root.buffers.len());
    for (index, buffer) in root.buffers.iter().enumerate() {
        // Only the first buffer may lack a URI, and then it is the binary chunk.
        let binary = binary.take();
        let label = || label("buffer", index, buffer.name.as_deref());
        let bytes = read(buffer, folder, binary, |line| {
            warnings.push(format!("{}: {line}", label()))
        })
        .map_err(|what| format!("{}: {what}", label()))?;
        buffers.push(bytes);
    }
    Ok(buffers)
}

fn read(buffer: &Buffer, folder: &Path, binary: Option<Vec<u8>>, warn: impl FnOnce(String)) -> Check<Vec<u8>> {
    let length = buffer.byte_length.0;
    if buffer.uri.is_none() && binary.is_none() && meshopt::is_fallback(buffer) {
        return Ok(Vec::new());
    }
    let (mut bytes, source) = match &buffer.uri {
        None => (
            binary.ok_or_else(|| damaged("it has no uri, and the file no binary chunk for it"))?,
            "the binary chunk".to_owned(),
        ),
        Some(uri) => match data_of(uri) {
            Some(data) => (decode_data_uri(data)?, "its data URI".to_owned()),
            None => {
                let path = path_of(uri, folder)?;
                (read_file(&path, length)?, quote(uri))
            }
        },
    };
    let missing = length.saturating_sub(bytes.len() as u64);
    if (1..=MOST_PADDING).contains(&missing) {
        warn(format!(
            "its byteLength is {length}, but {source} has {} bytes; what is missing is taken for padding, and the picture is \
             right",
            bytes.len()
        ));
    } else if missing > 0 {
        return Err(damaged(format_args!(
            "its byteLength is {length}, but {source} has {} bytes",
            bytes.len()
        )));
    }
    // The rest is padding.
    bytes.resize(length as usize, 0);
    Ok(bytes)
}

/// The data of an image's URI. Of a file, `needed` returns the number of bytes to read from its first ones: the file may be
/// endless.
pub(crate) fn read_uri(uri: &str, folder: &Path, needed: impl FnOnce(&[u8]) -> u64, budget: &Budget) -> Check<Vec<u8>> {
    if let Some(data) = data_of(uri) {
        return decode_data_uri(data);
    }
    let path = path_of(uri, folder)?;
    let head = read_file(&path, HEAD)?;
    if (head.len() as u64) < HEAD {
        return Ok(head);
    }
    let length = fs::metadata(&path).map_or(u64::MAX, |metadata| metadata.len());
    let length = length.min(needed(&head));
    budget.check(length, format_args!("the file {}", quote(uri)))?;
    read_file(&path, length)
}

/// Number of bytes of an image file that are examined first.
const HEAD: u64 = 1 << 20;

/// The files that buffers and images refer to, read or not.
pub(crate) fn referred_files<'a>(root: &'a Root, folder: &'a Path) -> impl Iterator<Item = PathBuf> + 'a {
    let buffers = root.buffers.iter().filter_map(|buffer| buffer.uri.as_deref());
    let images = root.images.iter().filter_map(|image| image.uri.as_deref());
    let files = buffers.chain(images).filter(|uri| data_of(uri).is_none());
    files.filter_map(|uri| path_of(uri, folder).ok())
}

/// `length` bytes from byte `start`, if they exist.
pub(crate) fn slice(bytes: &[u8], start: u64, length: u64) -> Option<&[u8]> {
    let end = usize::try_from(start.checked_add(length)?).ok()?;
    bytes.get(usize::try_from(start).ok()?..end)
}

/// Reads the first `length` bytes of a file, or all if it is shorter.
fn read_file(path: &Path, length: u64) -> Check<Vec<u8>> {
    let place = quote(&path.to_string_lossy());
    let unreadable = |error| format!("{place} can't be read ({error}); put the file there");
    // Checked first: opening a pipe would wait for a writer, and a device may be endless.
    let metadata = fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(format!("{place} isn't a file; put the file there"));
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(length).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    Ok(bytes)
}

/// The part after `data:`, in any case.
fn data_of(uri: &str) -> Option<&str> {
    let (scheme, data) = uri.split_at_checked("data:".len())?;
    scheme.eq_ignore_ascii_case("data:").then_some(data)
}

/// Decodes `[media type][;base64],…`, the part after `data:`: RFC 2397. Media types are ignored. Line ends in base64 are skipped,
/// as browsers do.
fn decode_data_uri(data: &str) -> Check<Vec<u8>> {
    let (head, body) = data
        .split_once(',')
        .ok_or_else(|| damaged("its data URI has no comma before the data"))?;
    let mut bytes = percent_decode(body);
    let is_base64 = head
        .rsplit_once(';')
        .is_some_and(|(_, coding)| coding.trim().eq_ignore_ascii_case("base64"));
    if !is_base64 {
        return Ok(bytes);
    }
    bytes.retain(|byte| !byte.is_ascii_whitespace());
    BASE64
        .decode(bytes)
        .map_err(|error| damaged(format_args!("its data URI isn't valid base64 ({error})")))
}

/// The file that a relative URI names. A query or fragment belongs to its name only if such a file exists.
fn path_of(uri: &str, folder: &Path) -> Check<PathBuf> {
    let path = folder.join(relative_path(uri)?);
    match uri.find(['?', '#']) {
        Some(end) if !path.exists() => Ok(folder.join(relative_path(&uri[..end])?)),
        _ => Ok(path),
    }
}

/// The path that a relative URI names from the scene file's folder on.
fn relative_path(uri: &str) -> Check<PathBuf> {
    let advice = "put the file next to the scene and refer to it by a relative path";
    if let Some((scheme, _)) = uri.split_once(':')
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    {
        return Err(format!(
            "its uri {} has the scheme {}, which is not supported; {advice}",
            quote(uri),
            quote(scheme)
        ));
    }
    let decoded = String::from_utf8(percent_decode(uri))
        .ok()
        .filter(|decoded| !decoded.contains('\0'))
        .ok_or_else(|| damaged(format_args!("its uri {} isn't a valid file name", quote(uri))))?;
    let path = PathBuf::from(decoded);
    if path
        .components()
        .any(|part| matches!(part, Component::RootDir | Component::Prefix(_)))
    {
        return Err(format!(
            "its uri {} isn't relative to the scene's folder; {advice}",
            quote(uri)
        ));
    }
    Ok(path)
}

/// Decodes `%2F` and similar; a `%` without two digits is kept.
fn percent_decode(uri: &str) -> Vec<u8> {
    let mut decoded = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        match (first, tail) {
            (b'%', [high, low, after @ ..]) if high.is_ascii_hexdigit() && low.is_ascii_hexdigit() => {
                decoded.push(hex_value(*high) << 4 | hex_value(*low));
                rest = after;
            }
            _ => {
                decoded.push(*first);
                rest = tail;
            }
        }
    }
    decoded
}

/// Value of a hexadecimal digit.
fn hex_value(digit: u8) -> u8 {
    match digit {
        b'0'..=b'9' => digit - b'0',
        _ => (digit | 0x20) - b'a' + 10,
    }
}
