//! Named blocks of bytes.

use bytemuck::Pod;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// A named block of bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// Its name, unique among those of a state.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// What a renderer needs, besides its scene and settings, to go on with a render.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Blocks(pub Vec<Block>);

impl Blocks {
    /// Adds a value.
    ///
    /// # Errors
    /// A value that can't be encoded.
    pub fn put(&mut self, name: &str, value: &impl Serialize) -> Result<()> {
        let bytes =
            postcard::to_stdvec(value).map_err(|error| Error::Config(format!("{name} can't be encoded: {error}")))?;
        self.put_bytes(name, bytes);
        Ok(())
    }

    /// Adds bytes as they are.
    pub fn put_bytes(&mut self, name: &str, bytes: Vec<u8>) {
        self.0.push(Block {
            name: name.to_owned(),
            bytes,
        });
    }

    /// The value of this name.
    ///
    /// # Errors
    /// A block that is missing, or is none of this type.
    pub fn get<T: DeserializeOwned>(&self, name: &str) -> Result<T> {
        postcard::from_bytes(self.bytes(name)?)
            .map_err(|error| Error::Config(format!("block {name} can't be decoded: {error}")))
    }

    /// The bytes of this name.
    ///
    /// # Errors
    /// A block that is missing.
    pub fn bytes(&self, name: &str) -> Result<&[u8]> {
        let block = self.0.iter().find(|block| block.name == name);
        block
            .map(|block| block.bytes.as_slice())
            .ok_or_else(|| Error::Config(format!("block {name} is missing")))
    }

    /// The elements of this name, of which there must be `count`.
    ///
    /// # Errors
    /// A block that is missing or has another size.
    pub fn elements<T: Pod>(&self, name: &str, count: usize) -> Result<Vec<T>> {
        let bytes = self.bytes(name)?;
        if bytes.len() != count * size_of::<T>() {
            let what = format!(
                "block {name} has {} bytes instead of {}",
                bytes.len(),
                count * size_of::<T>()
            );
            return Err(Error::Config(what));
        }
        Ok(bytemuck::pod_collect_to_vec(bytes))
    }
}
