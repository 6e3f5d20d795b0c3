//! What a render has learned, as named blocks of bytes, and their file.

mod blocks;
mod file;
pub mod words;

pub use blocks::{Block, Blocks};
pub use file::{read, write};
