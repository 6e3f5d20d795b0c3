//! Damage that keeps most of a file's structure, so that it reaches the inner layers.

use serde_json::{Value, json};

/// Knuth's linear congruential generator; the same numbers in every run.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut random = Self(seed);
        random.below(2);
        random
    }

    pub fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % bound.max(1) as u64) as usize
    }

    pub fn of<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }
}

/// Numbers at the bounds of types, and small ones.
const NUMBERS: [u64; 16] = [
    0,
    1,
    2,
    3,
    4,
    255,
    256,
    32_767,
    65_535,
    1 << 20,
    (1 << 31) - 1,
    1 << 31,
    u32::MAX as u64,
    1 << 40,
    i64::MAX as u64,
    u64::MAX,
];

/// Changes a few bytes, bits or little-endian numbers; sometimes cuts, repeats or moves a part.
pub fn bytes(original: &[u8], random: &mut Random) -> Vec<u8> {
    let mut damaged = original.to_vec();
    if damaged.is_empty() {
        return damaged;
    }
    for _ in 0..=random.below(4) {
        let at = random.below(damaged.len());
        match random.below(6) {
            0 => damaged[at] = random.below(256) as u8,
            1 => damaged[at] ^= 1 << random.below(8),
            // JSON consists mostly of digits and punctuation: these changes often keep it valid.
            2 => damaged[at] = *random.of(b"0123456789-.eE,:[]{}\""),
            3 => damaged[at] = *random.of(original),
            4 => {
                let number = random.of(&NUMBERS).to_le_bytes();
                let size = *random.of(&[1, 2, 4, 8]);
                let end = damaged.len().min(at + size);
                damaged[at..end].copy_from_slice(&number[..end - at]);
            }
            _ => {
                let number =
                    f32::from_bits(*random.of(&[0x7fc0_0000, 0x7f80_0000, 0xff80_0000, 0x7f7f_ffff, 1, 0x8000_0000]));
                let at = at / 4 * 4;
                if let Some(place) = damaged.get_mut(at..at + 4) {
                    place.copy_from_slice(&number.to_le_bytes());
                }
            }
        }
    }
    match random.below(16) {
        0 => damaged.truncate(1 + random.below(original.len())),
        1 => {
            let from = random.below(damaged.len());
            let length = random.below(damaged.len() - from).min(64);
            let part = damaged[from..from + length].to_vec();
            let to = random.below(damaged.len());
            damaged.splice(to..to, part);
        }
        _ => {}
    }
    damaged
}

/// JSON pointers to all values within `value`.
pub fn pointers(value: &Value) -> Vec<String> {
    let children: Vec<(String, &Value)> = match value {
        Value::Object(object) => object.iter().map(|(key, child)| (key.clone(), child)).collect(),
        Value::Array(array) => (0..).map(|index: usize| index.to_string()).zip(array).collect(),
        _ => Vec::new(),
    };
    let mut all = Vec::new();
    for (key, child) in children {
        all.extend(pointers(child).into_iter().map(|rest| format!("/{key}{rest}")));
        all.push(format!("/{key}"));
    }
    all
}

/// Changes a few values of a JSON document at the pointers `places`: to other values of the same or any name, or to numbers at
/// the bounds of types. Members are removed and moved to other objects, elements repeated and swapped.
pub fn json(value: &mut Value, places: &[String], random: &mut Random) {
    for _ in 0..=random.below(3) {
        let place = random.of(places);
        let name = place.rsplit('/').next().unwrap_or_default();
        let same_name: Vec<&str> = places
            .iter()
            .map(String::as_str)
            .filter(|other| other.ends_with(&format!("/{name}")))
            .collect();
        let alike: &str = random.of::<&str>(&same_name);
        let other = random.of(places).clone();
        let replacement = match random.below(8) {
            0 | 1 => value.pointer(alike).cloned(),
            2 => value.pointer(&other).cloned(),
            3 | 4 => Some(json!(random.of(&NUMBERS))),
            5 => Some(
                random
                    .of(&[
                        json!(-1),
                        json!(null),
                        json!(1e39),
                        json!(-1e-45),
                        json!([]),
                        json!({}),
                        json!(""),
                    ])
                    .clone(),
            ),
            6 => value
                .pointer(place)
                .and_then(Value::as_u64)
                .map(|number| json!(number.wrapping_add(1))),
            _ => None,
        };
        let Some((parent, key)) = place.rsplit_once('/') else {
            continue;
        };
        match (value.pointer_mut(parent), replacement) {
            (Some(Value::Object(members)), Some(replacement)) => drop(members.insert(key.to_owned(), replacement)),
            (Some(Value::Object(members)), None) => {
                let moved = members.remove(key);
                if random.below(2) == 0
                    && let Some(moved) = moved
                    && let Some(members) = value.pointer_mut(&other).and_then(Value::as_object_mut)
                {
                    members.insert(key.to_owned(), moved);
                }
            }
            (Some(Value::Array(elements)), replacement) => {
                let index = key.parse().unwrap_or(0);
                match replacement {
                    Some(replacement) if index < elements.len() => elements[index] = replacement,
                    _ if elements.is_empty() => {}
                    _ if random.below(2) == 0 => {
                        let length = elements.len();
                        elements.swap(index % length, random.below(length));
                    }
                    _ => elements.push(elements[index % elements.len()].clone()),
                }
            }
            _ => {}
        }
    }
}
