//! The `.glb` container: a header of 12 bytes, then chunks of a length, a type and data (glTF 2.0, section 4).

use std::ops::Range;

use crate::loader::diagnostic::{Check, damaged};

/// The first bytes of a `.glb` file.
pub(crate) const MAGIC: &[u8] = b"glTF";

const HEADER_SIZE: usize = 12;
const CHUNK_HEADER_SIZE: usize = 8;
const JSON: u32 = u32::from_le_bytes(*b"JSON");
const BINARY: u32 = u32::from_le_bytes(*b"BIN\0");

/// The ranges of the JSON and, if present, the binary chunk in `bytes`, which begin with [`MAGIC`].
///
/// Chunks of other types and data beyond the length in the header are skipped, as the format requires.
pub(crate) fn split(bytes: &[u8]) -> Check<(Range<usize>, Option<Range<usize>>)> {
    let truncated = |needed: usize| {
        format!(
            "truncated .glb: {needed} bytes are needed, the file has {}; copy or export it again",
            bytes.len()
        )
    };
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(truncated(HEADER_SIZE));
    };
    if version != 2 {
        return Err(format!(
            "is .glb version {version}, but only 2 is supported; export it as glTF 2.0"
        ));
    }
    let length = length as usize;
    let body = bytes.get(..length).ok_or_else(|| truncated(length))?;

    let (json_type, json) = chunk(body, HEADER_SIZE)?;
    if json_type != JSON {
        return Err(damaged("damaged .glb: its first chunk isn't JSON"));
    }
    // Chunks are padded to four bytes, and their lengths include the padding: there are no gaps.
    if json.end == body.len() {
        return Ok((json, None));
    }
    let (second_type, second) = chunk(body, json.end)?;
    Ok((json, (second_type == BINARY).then_some(second)))
}

/// Type and data of the chunk whose header begins at `at`.
fn chunk(body: &[u8], at: usize) -> Check<(u32, Range<usize>)> {
    let (Some(length), Some(kind)) = (word(body, at), word(body, at.saturating_add(4))) else {
        return Err(damaged(format_args!(
            "damaged .glb: no room for a chunk's header at byte {at} of {}",
            body.len()
        )));
    };
    let start = at + CHUNK_HEADER_SIZE;
    let left = body.len() - start;
    if length as usize > left {
        return Err(damaged(format_args!(
            "damaged .glb: the chunk at byte {at} is {length} bytes long, {left} are left"
        )));
    }
    Ok((kind, start..start + length as usize))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let word = bytes.get(at..)?.first_chunk()?;
    Some(u32::from_le_bytes(*word))
}
