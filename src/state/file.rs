//! The file of a state.
//!
//! All numbers are little-endian. The magic number; the version of the format, u32; the size of the table, u64; the table, JSON:
//! what the state is of, and name, size and BLAKE3 hash of each block; the table's BLAKE3 hash; the blocks, one after another.

use std::io::{self, Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Block, Blocks};
use crate::error::{Error, Result};
use crate::files::{open, write_whole_by};

/// The first bytes. The line end shows whether a file went through a conversion of texts.
const MAGIC: [u8; 8] = *b"ppmvk\r\n\x1a";
/// Version of the format.
const VERSION: u32 = 1;
/// Maximum size of a table: names and hashes of some dozen blocks, and settings.
const LARGEST_TABLE: u64 = 1 << 20;
const HASH_BYTES: usize = blake3::OUT_LEN;

#[derive(Serialize, Deserialize)]
struct Table {
    of: serde_json::Value,
    blocks: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    name: String,
    bytes: u64,
    blake3: String,
}

/// Writes a state: `of` says what it is of. The file is whole, or what it was before.
///
/// # Errors
/// A path that can't be written to, a full disk.
pub fn write(path: &Path, of: &serde_json::Value, blocks: &Blocks) -> Result<()> {
    let entry = |block: &Block| Entry {
        name: block.name.clone(),
        bytes: block.bytes.len() as u64,
        blake3: hash(&block.bytes),
    };
    let table = Table {
        of: of.clone(),
        blocks: blocks.0.iter().map(entry).collect(),
    };
    let table = serde_json::to_vec(&table).map_err(|error| Error::Config(error.to_string()))?;
    write_whole_by(path, |file| {
        file.write_all(&MAGIC)?;
        file.write_all(&VERSION.to_le_bytes())?;
        file.write_all(&(table.len() as u64).to_le_bytes())?;
        file.write_all(&table)?;
        file.write_all(blake3::hash(&table).as_bytes())?;
        blocks.0.iter().try_for_each(|block| file.write_all(&block.bytes))
    })
}

/// Reads a state and checks it; returns also what it is of.
///
/// # Errors
/// A file that can't be read, is no state, is of another version, is cut short or damaged.
pub fn read(path: &Path) -> Result<(serde_json::Value, Blocks)> {
    let mut file = open(path)?;
    let failed = |error: io::Error| match error.kind() {
        io::ErrorKind::UnexpectedEof => Error::file(path, "is a state that was cut short; start the render anew"),
        _ => Error::file(path, format!("can't be read ({error})")),
    };
    let damaged = |what: &str| Error::file(path, format!("is a damaged state ({what}); start the render anew"));
    let is_of_this_kind = {
        let mut magic = [0; MAGIC.len()];
        matches!(file.read_exact(&mut magic), Ok(())) && magic == MAGIC
    };
    if !is_of_this_kind {
        return Err(Error::file(path, "is no state of a render"));
    }
    let version = u32::from_le_bytes(array(&mut file).map_err(failed)?);
    if version != VERSION {
        let what = format!("is a state in version {version} of the format; this program reads version {VERSION}");
        return Err(Error::file(path, what));
    }
    let size = u64::from_le_bytes(array(&mut file).map_err(failed)?);
    if size > LARGEST_TABLE {
        return Err(damaged("the table's size"));
    }
    let table = bytes(&mut file, size).map_err(failed)?;
    let expected: [u8; HASH_BYTES] = array(&mut file).map_err(failed)?;
    if *blake3::hash(&table).as_bytes() != expected {
        return Err(damaged("the table"));
    }
    let table: Table = serde_json::from_slice(&table).map_err(|_| damaged("the table"))?;
    let mut blocks = Blocks::default();
    for entry in table.blocks {
        let content = bytes(&mut file, entry.bytes).map_err(failed)?;
        if hash(&content) != entry.blake3 {
            return Err(damaged(&format!("block {}", entry.name)));
        }
        blocks.put_bytes(&entry.name, content);
    }
    Ok((table.of, blocks))
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

fn array<const N: usize>(file: &mut impl Read) -> io::Result<[u8; N]> {
    let mut array = [0; N];
    file.read_exact(&mut array)?;
    Ok(array)
}

/// So many bytes. Memory grows with what the file really has.
fn bytes(file: &mut impl Read, count: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = file.take(count).read_to_end(&mut bytes)?;
    if (read as u64) < count {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::json;
    use tempfile::tempdir;

    use super::*;

    fn state() -> Blocks {
        let mut blocks = Blocks::default();
        blocks.put("numbers", &(1u32, 2.5f64)).expect("encoded");
        blocks.put_bytes("raw", (0..200).collect());
        blocks
    }

    #[test]
    fn a_state_is_read_as_it_was_written() {
        let folder = tempdir().expect("a folder");
        let path = folder.path().join("a.state");
        write(&path, &json!({"seed": 7}), &state()).expect("written");
        let (of, blocks) = read(&path).expect("read");
        assert_eq!((of, &blocks), (json!({"seed": 7}), &state()));
        assert_eq!(blocks.get::<(u32, f64)>("numbers").expect("a block"), (1, 2.5));
        assert!(blocks.get::<u32>("missing").is_err());
    }

    #[test]
    fn a_file_cut_anywhere_or_with_any_changed_byte_is_refused_in_one_line() {
        let folder = tempdir().expect("a folder");
        let path = folder.path().join("a.state");
        write(&path, &json!({}), &state()).expect("written");
        let whole = fs::read(&path).expect("a file");
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).expect("a file");
            let error = read(&path).expect_err("cut").to_string();
            assert!(
                error.contains(if length < 8 { "no state" } else { "cut short" }),
                "{length}: {error}"
            );
        }
        for place in 0..whole.len() {
            let mut changed = whole.clone();
            changed[place] ^= 0x10;
            fs::write(&path, &changed).expect("a file");
            let error = read(&path).expect_err("changed").to_string();
            assert!(!error.contains('\n'), "{error}");
        }
    }
}
