//! The JSON of a glTF file, in the form that the `gltf` crate's types expect. They are stricter than the schema.

use std::collections::BTreeSet;

use gltf_json::Root;
use serde_json::{Number, Value};

use super::breaches;
use super::budget::Budget;
use crate::loader::diagnostic::{Check, Warnings, damaged};
use crate::text::quote;

/// Component types of accessors.
const U8: u64 = 5121;
const U16: u64 = 5123;

/// Integers from here on are not exact as floating-point numbers.
const LARGEST_EXACT: f64 = 9_007_199_254_740_992.0;

/// Checks that there is memory for JSON, before it is read: values take much more than their text.
pub(crate) fn check_size(json: &[u8], budget: &Budget) -> Check<()> {
    /// Approximate size of a value and of a struct member of the `gltf` crate.
    const BYTES_A_VALUE: u64 = 128;
    let values = json.iter().filter(|byte| b",[{".contains(byte)).count() as u64;
    // Strings are copied twice.
    budget.check(BYTES_A_VALUE * values + 2 * json.len() as u64, "its JSON")
}

/// Reads JSON, and normalises what may be written in several ways: null members are removed, `extras` may be anything and are
/// ignored, integers may have a fraction of zero. Warns of violations that other viewers accept.
pub(crate) fn read(json: &[u8], warnings: &mut Warnings) -> Check<Value> {
    // The specification forbids a byte order mark; some editors add one all the same.
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let end = json.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    let (json, padding) = json.split_at(end);
    if !padding.is_empty() {
        warnings.push("its JSON ends in NUL characters instead of spaces, which glTF forbids; they are skipped".into());
    }
    let mut value: Value = serde_json::from_slice(json).map_err(|error| {
        format!("isn't glTF: neither .glb nor JSON ({error}); give a .gltf or .glb file, or export it again")
    })?;
    breaches::warn(&value, warnings);
    normalise(&mut value);
    normalise_colors(&mut value, warnings);
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

/// The elements of an array member of a value; empty if it is no array.
fn elements<'a>(value: &'a Value, name: &str) -> impl Iterator<Item = &'a Value> + use<'a> {
    value.get(name).and_then(Value::as_array).into_iter().flatten()
}

/// Integer colours are fractions, even without the flag.
fn normalise_colors(root: &mut Value, warnings: &mut Warnings) {
    let mut colors = BTreeSet::new();
    for primitive in elements(root, "meshes").flat_map(|mesh| elements(mesh, "primitives")) {
        let attributes = primitive.get("attributes").and_then(Value::as_object);
        let of_colors = attributes
            .into_iter()
            .flatten()
            .filter(|(name, _)| name.starts_with("COLOR_"));
        colors.extend(of_colors.filter_map(|(_, accessor)| accessor.as_u64()));
    }
    let accessors = root.get_mut("accessors").and_then(Value::as_array_mut);
    for (index, accessor) in (0..).zip(accessors.into_iter().flatten()) {
        let is_integer = matches!(accessor["componentType"].as_u64(), Some(U8 | U16));
        let Some(members) = accessor.as_object_mut() else {
            continue;
        };
        let is_normalized = members.get("normalized") == Some(&Value::Bool(true));
        if colors.contains(&index) && is_integer && !is_normalized {
            members.insert("normalized".to_owned(), Value::Bool(true));
            warnings.push(format!(
                "accessor {index}: its colours are integers that aren't normalized, which glTF forbids; they are read as if they \
                 were, as other viewers do"
            ));
        }
    }
}

/// The glTF structure.
pub(crate) fn to_root(mut value: Value) -> Check<Root> {
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
