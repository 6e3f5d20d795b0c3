//! Device structs as words, for serde.

use bytemuck::{AnyBitPattern, NoUninit};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Writes them.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<T: NoUninit, S: Serializer>(structs: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    bytemuck::cast_slice::<T, u32>(structs).serialize(serializer)
}

/// Reads them.
///
/// # Errors
/// Those of the deserializer; words that make no whole structs.
pub fn deserialize<'de, T: NoUninit + AnyBitPattern, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    let words = Vec::<u32>::deserialize(deserializer)?;
    if !(size_of_val(words.as_slice())).is_multiple_of(size_of::<T>()) {
        return Err(D::Error::custom("a part of a struct"));
    }
    Ok(bytemuck::pod_collect_to_vec(&words))
}
