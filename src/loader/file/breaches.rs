//! Harmless violations of glTF: the file is read as by other viewers, with a warning of one line.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::loader::diagnostic::Warnings;
use crate::text::{list, quote};

/// Names of primitives' attributes in glTF; some are followed by the number of their set.
const ATTRIBUTES: [&str; 7] = [
    "POSITION",
    "NORMAL",
    "TANGENT",
    "TEXCOORD_",
    "COLOR_",
    "JOINTS_",
    "WEIGHTS_",
];
/// Valid values of a sampler's filters and wrap modes.
const FILTERS: [u64; 6] = [9728, 9729, 9984, 9985, 9986, 9987];
const WRAPS: [u64; 3] = [33071, 33648, 10497];

#[derive(Default)]
struct Breaches {
    empty_lists: BTreeSet<String>,
    nulls: BTreeSet<String>,
    attributes: BTreeSet<String>,
    without_elements: Vec<String>,
    samplers: Vec<String>,
}

/// Warns of violations in the original JSON.
pub(crate) fn warn(root: &Value, warnings: &mut Warnings) {
    let mut found = Breaches::default();
    found.look("", root);
    let names = |names: BTreeSet<String>| list(&names.iter().map(|name| quote(name)).collect::<Vec<_>>());
    let kinds = [
        ("lists without elements, ", names(found.empty_lists)),
        ("null, ", names(found.nulls)),
        ("unknown attributes, ", names(found.attributes)),
        ("accessors without elements, ", list(&found.without_elements)),
        ("unknown filters and wrap modes, ", list(&found.samplers)),
    ];
    let kinds = kinds.into_iter().filter(|(_, items)| !items.is_empty());
    let kinds: Vec<String> = kinds.map(|(kind, items)| format!("{kind}{items}")).collect();
    if !kinds.is_empty() {
        warnings.push(format!(
            "glTF forbids {}; they are ignored, as other viewers do, and nothing is missing in the picture",
            kinds.join("; ")
        ));
    }
}

impl Breaches {
    /// Checks a value and all below, except `extras`, which may be anything, and extensions, which have their own schemas.
    fn look(&mut self, name: &str, value: &Value) {
        match value {
            Value::Null => _ = self.nulls.insert(name.to_owned()),
            Value::Array(elements) if elements.is_empty() => _ = self.empty_lists.insert(name.to_owned()),
            Value::Array(elements) => {
                for (index, element) in elements.iter().enumerate() {
                    match name {
                        "accessors" if element.get("count").and_then(Value::as_f64) == Some(0.0) => {
                            self.without_elements.push(format!("accessor {index}"));
                        }
                        "samplers" if has_other_modes(element) => self.samplers.push(format!("sampler {index}")),
                        _ => (),
                    }
                    self.look(name, element);
                }
            }
            Value::Object(members) => {
                for (member, value) in members {
                    if name == "attributes" && !is_attribute(member) {
                        self.attributes.insert(member.clone());
                    }
                    match (member.as_str(), value) {
                        ("extras", _) | ("extensions", Value::Object(_)) => (),
                        _ => self.look(member, value),
                    }
                }
            }
            _ => (),
        }
    }
}

/// Whether a name is one of glTF or of an application.
fn is_attribute(name: &str) -> bool {
    let is_own = |own: &&str| match name.strip_prefix(*own) {
        Some(rest) => rest.is_empty() != own.ends_with('_'),
        None => false,
    };
    name.starts_with('_') || ATTRIBUTES.iter().any(is_own)
}

/// Whether a sampler of textures has invalid values. Samplers of animations have no such members.
fn has_other_modes(sampler: &Value) -> bool {
    let is_other = |name: &str, known: &[u64]| {
        let value = sampler.get(name).and_then(Value::as_f64);
        value.is_some_and(|value| known.iter().all(|&known| known as f64 != value))
    };
    is_other("magFilter", &FILTERS[..2])
        || is_other("minFilter", &FILTERS)
        || is_other("wrapS", &WRAPS)
        || is_other("wrapT", &WRAPS)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn said(root: &Value) -> Vec<String> {
        let mut warnings = Warnings::default();
        warn(root, &mut warnings);
        warnings.into_lines().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_gltf_forbids_without_harm_is_one_line() {
        let lines = said(&json!({
            "images": [], "textures": null,
            "nodes": [{"children": [], "extensions": null}, {"children": []}],
            "accessors": [{"count": 1}, {"count": 0.0}],
            "samplers": [{"magFilter": 9728}, {"magFilter": 9984}, {"wrapT": 1}],
            "meshes": [{"primitives": [{"attributes": {"COLOR": 0, "NORMAL_0": 0, "POSITION": 0}}]}]
        }));
        assert_eq!(lines.len(), 1, "{lines:?}");
        for words in [
            "elements, \"children\" and \"images\";",
            "null, \"extensions\" and \"textures\";",
            "unknown attributes, \"COLOR\" and \"NORMAL_0\";",
            "elements, accessor 1;",
            "wrap modes, sampler 1 and sampler 2;",
        ] {
            assert!(lines[0].contains(words), "«{words}» isn't in: {}", lines[0]);
        }
    }

    #[test]
    fn what_it_allows_is_not() {
        let lines = said(&json!({
            "extras": null,
            "nodes": [{"extras": [], "extensions": {"XYZ_any": {"list": [], "none": null}}}],
            "animations": [{"samplers": [{"input": 0, "interpolation": "STEP"}]}],
            "samplers": [{}, {"magFilter": 9729.0, "minFilter": 9987, "wrapS": 10497, "wrapT": 33648}],
            "meshes": [{"primitives": [{
                "attributes": {"POSITION": 0, "TEXCOORD_1": 0, "COLOR_0": 0, "_ANY": 0, "JOINTS_0": 0, "WEIGHTS_10": 0},
                "targets": [{"POSITION": 1}]
            }]}]
        }));
        assert!(lines.is_empty(), "{lines:?}");
    }
}
