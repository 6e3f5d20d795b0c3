//! `KHR_texture_basisu`: images that Basis Universal compressed, in KTX 2.0 files.

use basisu::{DecodeFlags, TargetFormat, Transcoder};

use crate::loader::diagnostic::{Check, damaged};

const MAGIC: [u8; 12] = *b"\xabKTX 20\xbb\r\n\x1a\n";

/// Sizes of the header and of each entry of the index of levels, which follows it, in bytes.
const HEADER_SIZE: usize = 80;
const LEVEL_SIZE: usize = 24;
/// Maximum number of levels: a side has at most 2¹⁵ texels.
const MOST_LEVELS: u32 = 16;

/// Offset of the length of keys and values in the header.
const KEY_VALUE_LENGTH: usize = 60;

/// Size of the format descriptor before its first channel, in bytes.
const DESCRIPTION_SIZE: u64 = 32;
/// Colour models of descriptors that the extension allows.
const ETC1S: u32 = 163;
const UASTC: u32 = 166;

/// Supercompression schemes of levels.
const BASIS_LZ: u32 = 1;
const ZSTANDARD: u32 = 2;
/// Bytes of a block of 4×4 texels.
const UASTC_BLOCK: u64 = 16;

/// Whether it is a KTX 2.0 file.
pub(crate) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// The header of a file, checked against the file's size.
pub(crate) struct Ktx2 {
    bytes: Vec<u8>,
    /// Texels of the largest level.
    pub size: [u32; 2],
}

impl Ktx2 {
    /// Reads the header. The transcoder does not check it.
    pub(crate) fn open(bytes: &[u8]) -> Check<Self> {
        let u32_at = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        let u64_at = |at: usize| Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        let is_inside =
            |start: u64, length: u64| start.checked_add(length).is_some_and(|end| end <= bytes.len() as u64);
        let read = || {
            let [width, height, depth, layers, faces, levels, compression] =
                [20, 24, 28, 32, 36, 40, 44].map(|at| u32_at(at).unwrap_or_default());
            if depth != 0 || layers > 1 || faces != 1 {
                return None;
            }
            let (description, length) = (u32_at(48)?.into(), u32_at(52)?.into());
            let is_described = is_inside(description, length) && length >= DESCRIPTION_SIZE;
            if !is_described || !is_inside(u64_at(64)?, u64_at(72)?) {
                return None;
            }
            let model = u32_at(description as usize + 12)? & 0xff;
            let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
            let is_known = match model {
                ETC1S => compression == BASIS_LZ,
                UASTC => compression == 0 || compression == ZSTANDARD,
                _ => false,
            };
            if !is_known || !(1..=MOST_LEVELS).contains(&levels) {
                return None;
            }
            for level in 0..levels as usize {
                let at = HEADER_SIZE + LEVEL_SIZE * level;
                if !is_inside(u64_at(at)?, u64_at(at + 8)?)
                    || (model == UASTC && u64_at(at + 16)? > UASTC_BLOCK * blocks)
                {
                    return None;
                }
            }
            Some([width, height])
        };
        let size = read().ok_or_else(|| {
            damaged("it is no KTX 2.0 picture that KHR_texture_basisu allows: of one face and layer, in ETC1S or UASTC")
        })?;
        let mut bytes = bytes.to_vec();
        // They are not needed, and the transcoder reads beyond the end of damaged ones.
        bytes[KEY_VALUE_LENGTH..][..4].fill(0);
        Ok(Self { bytes, size })
    }

    /// The texels of the largest level, RGBA, in rows from the top left.
    pub(crate) fn decode(&self) -> Check<Vec<u8>> {
        let rgba = Transcoder::new(&self.bytes)
            .and_then(|picture| picture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE));
        rgba.map_err(|error| damaged(format_args!("its KTX 2.0 data can't be decoded ({error:?})")))
    }
}
