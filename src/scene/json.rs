//! The JSON of a glTF file, in the form that the `gltf` crate's types expect. They are stricter than the schema.

use gltf::json::Root;
use serde_json::{Number, Value};

use super::diagnostic::{Check, damaged, quote};

/// Integers from here on aren't exact as floating-point numbers.
const LARGEST_EXACT: f64 = 9_007_199_254_740_992.0;

/// Reads JSON, and writes alike what the schema allows to be written in several ways: members that are null are as good as
/// absent, `extras` may be anything and are read by nobody, and integers may have a fraction of zero.
pub(super) fn read(json: &[u8]) -> Check<Value> {
    // The specification forbids a byte order mark; some editors add one all the same.
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let mut value: Value = serde_json::from_slice(json).map_err(|error| {
        format!("isn't glTF: neither .glb nor JSON ({error}); give a .gltf or .glb file, or export it again")
    })?;
    normalise(&mut value);
    Ok(value)
}

fn normalise(value: &mut Value) {
    match value {
        Value::Object(members) => {
            members.retain(|name, member| name != "extras" && !member.is_null());
            members.values_mut().for_each(normalise);
        }
        Value::Array(elements) => elements.iter_mut().for_each(normalise),
        Value::Number(number) => {
            let whole = number
                .as_f64()
                .filter(|number| number.fract() == 0.0 && number.abs() < LARGEST_EXACT);
            if let Some(whole) = whole.filter(|_| number.is_f64()) {
                *number = Number::from(whole as i64);
            }
        }
        _ => (),
    }
}

/// The glTF that it is.
pub(super) fn to_root(mut value: Value) -> Check<Root> {
    // A scene may be without nodes.
    let scenes = value.get_mut("scenes").and_then(Value::as_array_mut);
    for scene in scenes.into_iter().flatten().filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    serde_path_to_error::deserialize(value).map_err(|error| {
        let place = error.path().to_string();
        damaged(format_args!("isn't glTF 2.0: {}: {}", quote(&place), error.inner()))
    })
}
