//! Cryptomatte: Friedman and Jones, «Fully automatic ID mattes with support for motion blur and transparency», SIGGRAPH 2015
//! posters; specification 1.2.0.

use std::collections::BTreeMap;

use super::Channel;

/// Ranks of a pixel that are written: two a layer.
const RANKS: usize = 6;

/// A matte for each of the things of one kind.
#[derive(Debug, Clone)]
pub struct Cryptomatte<'a> {
    /// Such as `CryptoObject`, with the view layer's name before it.
    pub name: String,
    /// Names of the things, by their index.
    pub things: &'a [String],
}

/// MurmurHash3_x86_32 with seed 0 (Appleby, public domain).
fn murmur3(bytes: &[u8]) -> u32 {
    let mix = |word: u32| word.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let mut hash = 0u32;
    let (words, rest) = bytes.as_chunks::<4>();
    for word in words {
        hash = (hash ^ mix(u32::from_le_bytes(*word)))
            .rotate_left(13)
            .wrapping_mul(5)
            .wrapping_add(0xe654_6b64);
    }
    let tail = rest.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte));
    if !rest.is_empty() {
        hash ^= mix(tail);
    }
    hash ^= bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// The hash of a name, without the bit patterns that are no normal number.
fn id(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    let exponent = hash >> 23 & 255;
    if exponent == 0 || exponent == 255 {
        hash ^ 1 << 23
    } else {
        hash
    }
}

impl Cryptomatte<'_> {
    /// The attributes of the file's header: names and texts.
    pub fn attributes(&self) -> Vec<(String, String)> {
        let key = format!("{:08x}", murmur3(self.name.as_bytes()));
        let attribute = |what: &str, text: String| (format!("cryptomatte/{}/{what}", &key[..7]), text);
        let manifest: BTreeMap<&str, String> = self
            .things
            .iter()
            .map(|name| (name.as_str(), format!("{:08x}", id(name))))
            .collect();
        vec![
            attribute("name", self.name.clone()),
            attribute("hash", "MurmurHash3_32".to_owned()),
            attribute("conversion", "uint32_to_float32".to_owned()),
            attribute("manifest", serde_json::json!(manifest).to_string()),
        ]
    }

    /// The file's channels. `shares`: of each pixel, indices of things and the shares of the pixel that they cover.
    pub fn channels(&self, shares: impl Iterator<Item = Vec<(u32, f32)>>) -> Vec<Channel> {
        let ids: Vec<u32> = self.things.iter().map(|name| id(name)).collect();
        let mut channels: Vec<Channel> = (0..2 * RANKS)
            .map(|index| {
                let component = ["R", "G", "B", "A"][index % 4];
                Channel {
                    name: format!("{}{:02}.{component}", self.name, index / 4),
                    samples: Vec::new(),
                }
            })
            .collect();
        for pixel in shares {
            // Things of one name are one.
            let mut of_ids = BTreeMap::new();
            for (thing, share) in pixel {
                *of_ids.entry(ids[thing as usize]).or_insert(0.0f32) += share;
            }
            let mut ranked: Vec<(u32, f32)> = of_ids.into_iter().collect();
            ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
            ranked.resize(RANKS, (0, 0.0));
            for (rank, (id, share)) in ranked.into_iter().enumerate() {
                channels[2 * rank].samples.push(f32::from_bits(id));
                channels[2 * rank + 1].samples.push(share);
            }
        }
        channels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values of Appleby's code, and of the specification's example.
    #[test]
    fn names_have_the_hashes_of_the_specification() {
        for (name, hash) in [
            ("", 0),
            ("a", 0x3c25_69b2),
            ("abc", 0xb3dd_93fa),
            ("hello", 0x248b_fa47),
            ("hello, world", 0x149b_bb7f),
            ("The quick brown fox jumps over the lazy dog.", 0xd5c4_8bfc),
        ] {
            assert_eq!(murmur3(name.as_bytes()), hash, "{name}: {:x}", murmur3(name.as_bytes()));
        }
        assert!((0..100_000).all(|i| f32::from_bits(id(&i.to_string())).is_normal()));
    }

    #[test]
    fn the_largest_shares_come_first_and_things_of_one_name_are_one() {
        let things = ["cup", "table", "cup"].map(str::to_owned);
        let matte = Cryptomatte {
            name: "CryptoObject".to_owned(),
            things: &things,
        };
        let pixels = [vec![(1, 0.5), (0, 0.25), (2, 0.25)], vec![(1, 0.25), (2, 0.75)], vec![]];
        let channels = matte.channels(pixels.into_iter());
        let names: Vec<&str> = channels.iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(
            names[..5],
            [
                "CryptoObject00.R",
                "CryptoObject00.G",
                "CryptoObject00.B",
                "CryptoObject00.A",
                "CryptoObject01.R"
            ]
        );
        assert_eq!(names.len(), 2 * RANKS);
        let [cup, table] = ["cup", "table"].map(|name| f32::from_bits(id(name)));
        assert_eq!(channels[1].samples, [0.5, 0.75, 0.0]);
        assert_eq!(channels[3].samples, [0.5, 0.25, 0.0]);
        assert_eq!(channels[0].samples[1..], [cup, 0.0]);
        assert_eq!(channels[2].samples[1..], [table, 0.0]);
    }
}
