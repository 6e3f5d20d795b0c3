//! The picture of independent parts of a render.
//!
//! Sums are whole numbers of 2⁻⁶⁴, in 128 bits: the order in which parts are added, and whether they were added to others before,
//! makes no difference in any bit.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::Zeroable as _;
use serde::{Deserialize, Serialize};

use super::state::{Identity, State};
use super::{Rendered, rendered::Of};
use crate::backend::{Counters, DeviceDescription, Resolved};
use crate::config::{Layers, Region, SEQUENCES, SequenceIterations, Totals};
use crate::error::{Error, Result};
use crate::estimate::ErrorEstimate;
use crate::film::Metadata;
use crate::layout::BehindGlass;
use crate::report::{Profile, Subject};
use crate::state::Blocks;

/// Sums of a pixel: RGB, alpha; RGB and curvature of each sequence; of the light behind glass what there would be, what arrived,
/// and photons.
const SUMS: usize = 4 + 4 * SEQUENCES as usize + 3;
const GLASS: usize = SUMS - 3;
/// The unit of the sums is 1 over this.
const UNITS: f64 = (1u128 << 64) as f64;
/// Maximum of a value in such units: 2³⁸, or 2.7e11. With 2²⁴ iterations, sums stay below 2¹²⁷.
const MOST: f64 = UNITS * (1u64 << 38) as f64;

/// Blocks of a part's state.
const SHARE: &str = "share";
const FILM: &str = "film";
const SEQUENCE_FILMS: &str = "films of sequences";
const BEHIND_GLASS: &str = "behind glass";
/// Blocks of a merged state.
const SHARES: &str = "shares";
const WAITS: &str = "parts that wait";
const SUMS_OF_PIXELS: &str = "sums";

/// What is known of a part besides its pixels.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Share {
    totals: Totals,
    seconds: f64,
    device: DeviceDescription,
    counters: Counters,
    estimate: ErrorEstimate,
    scene: String,
    gather: String,
    photons: u32,
    seed: u32,
    max_depth: u32,
    resolution: [u32; 2],
    shown: Region,
}

/// Adds a picture to the state of one of several parts.
pub(super) fn put_picture(blocks: &mut Blocks, about: &super::rendered::About, made: &PictureOfPart<'_>) -> Result<()> {
    let config = &about.config;
    let share = Share {
        totals: made.totals,
        seconds: made.seconds,
        device: about.device.clone(),
        counters: made.counters,
        estimate: about.estimate,
        scene: about.scene.clone(),
        gather: about.gather.to_owned(),
        photons: config.photons,
        seed: config.seed,
        max_depth: config.max_depth,
        resolution: config.resolution,
        shown: config.shown(),
    };
    blocks.put(SHARE, &share)?;
    let picture = made.picture;
    let film = picture.image.pixels().iter().zip(&picture.alpha).zip(&picture.waits);
    let film: Vec<[f32; 4]> = film
        .map(|((&[r, g, b], &alpha), &waits)| [r, g, b, if waits { -alpha } else { alpha }])
        .collect();
    blocks.put_bytes(FILM, bytemuck::cast_slice(&film).to_vec());
    blocks.put_bytes(SEQUENCE_FILMS, bytemuck::cast_slice(&picture.sequences).to_vec());
    blocks.put_bytes(BEHIND_GLASS, bytemuck::cast_slice(&picture.behind_glass).to_vec());
    Ok(())
}

/// The picture of a part, and what it is made of.
pub(super) struct PictureOfPart<'a> {
    pub picture: &'a Resolved,
    pub counters: Counters,
    pub totals: Totals,
    pub seconds: f64,
}

/// The sum of independent parts of one render.
pub struct Merge {
    of: Identity,
    /// By the parts' numbers.
    shares: BTreeMap<u32, Share>,
    sums: Vec<[i128; SUMS]>,
    /// Of each pixel, how many parts wait for its first photon.
    waits: Vec<u32>,
    /// Radii are the largest of all parts.
    glass: Vec<BehindGlass>,
}

impl Merge {
    /// Begins with a part's state, or with that of several merged parts.
    ///
    /// # Errors
    /// A state of no part; a picture that is too bright.
    pub fn new(state: &State) -> Result<Self> {
        if state.of.part.is_whole() {
            return Err(Error::Config("is a state of a whole render, not of a part".to_owned()));
        }
        let shares = shares_of(state)?;
        let pixels = shares.values().next().map_or(0, |share| share.shown.pixels()) as usize;
        let mut merge = Self {
            of: state.of.merged(),
            shares: BTreeMap::new(),
            sums: vec![[0; SUMS]; pixels],
            waits: vec![0; pixels],
            glass: vec![BehindGlass::zeroed(); pixels],
        };
        merge.add(state)?;
        Ok(merge)
    }

    /// Adds another one.
    ///
    /// # Errors
    /// A state of another render, or one that contains a part that is already there; a picture that is too bright.
    pub fn add(&mut self, state: &State) -> Result<()> {
        state.of.merged().check_is(&self.of)?;
        let shares = shares_of(state)?;
        if let Some(part) = shares.keys().find(|part| self.shares.contains_key(part)) {
            return Err(Error::Config(format!(
                "contains part {part}, which another of these states contains too"
            )));
        }
        match state.of.part.number {
            0 => self.add_merged(&state.blocks)?,
            part => self.add_part(&state.blocks, shares[&part].totals)?,
        }
        self.shares.extend(shares);
        Ok(())
    }

    fn add_part(&mut self, blocks: &Blocks, totals: Totals) -> Result<()> {
        let pixels = self.sums.len();
        let film: Vec<[f32; 4]> = blocks.elements(FILM, pixels)?;
        let sequences: Vec<[f32; 4]> = blocks.elements(SEQUENCE_FILMS, pixels * SEQUENCES as usize)?;
        let glass: Vec<BehindGlass> = blocks.elements(BEHIND_GLASS, pixels)?;
        let SequenceIterations(of_sequences) = totals.iterations.into();
        for (pixel, sums) in self.sums.iter_mut().enumerate() {
            let mut add = |index: usize, value: f32, times: u32| -> Result<()> {
                sums[index] += units(value, times)?;
                Ok(())
            };
            let [r, g, b, alpha] = film[pixel];
            for (index, value) in [r, g, b].into_iter().enumerate() {
                add(index, value, totals.iterations)?;
            }
            add(3, alpha.abs(), totals.camera_paths)?;
            for (sequence, iterations) in of_sequences.into_iter().enumerate() {
                for (index, value) in sequences[sequence * pixels + pixel].into_iter().enumerate() {
                    add(4 + 4 * sequence + index, value, iterations)?;
                }
            }
            add(GLASS, glass[pixel].unbent, totals.iterations)?;
            add(GLASS + 1, glass[pixel].arrived, totals.iterations)?;
            add(GLASS + 2, glass[pixel].photons, 1)?;
            self.waits[pixel] += u32::from(alpha < 0.0);
            larger_radii(&mut self.glass[pixel], &glass[pixel]);
        }
        Ok(())
    }

    fn add_merged(&mut self, blocks: &Blocks) -> Result<()> {
        let pixels = self.sums.len();
        let sums: Vec<[i128; SUMS]> = blocks.elements(SUMS_OF_PIXELS, pixels)?;
        let waits: Vec<u32> = blocks.elements(WAITS, pixels)?;
        let glass: Vec<BehindGlass> = blocks.elements(BEHIND_GLASS, pixels)?;
        for pixel in 0..pixels {
            for (sum, other) in self.sums[pixel].iter_mut().zip(sums[pixel]) {
                *sum += other;
            }
            self.waits[pixel] += waits[pixel];
            larger_radii(&mut self.glass[pixel], &glass[pixel]);
        }
        Ok(())
    }

    /// How many parts the render has.
    pub fn parts(&self) -> u32 {
        self.of.part.of
    }

    /// The parts that have not been added.
    pub fn missing(&self) -> Vec<u32> {
        (1..=self.parts())
            .filter(|part| !self.shares.contains_key(part))
            .collect()
    }

    /// The sum as a state, which can be merged with those of other parts.
    ///
    /// # Errors
    /// A state that can't be encoded.
    pub fn state(&self) -> Result<State> {
        let mut blocks = Blocks::default();
        blocks.put(SHARES, &self.shares)?;
        blocks.put_bytes(SUMS_OF_PIXELS, bytemuck::cast_slice(&self.sums).to_vec());
        blocks.put_bytes(WAITS, bytemuck::cast_slice(&self.waits).to_vec());
        blocks.put_bytes(BEHIND_GLASS, bytemuck::cast_slice(&self.glass).to_vec());
        Ok(State {
            of: self.of.clone(),
            blocks,
        })
    }

    /// The picture, the mean of the parts by their iterations, with the error that it has by all of them.
    pub fn rendered(&self) -> Rendered {
        let (mut totals, mut of_sequences) = (Totals::default(), [0; SEQUENCES as usize]);
        let mut counters = Counters::default();
        for share in self.shares.values() {
            totals.add(share.totals);
            counters.add(&share.counters);
            let SequenceIterations(of_share) = share.totals.iterations.into();
            of_sequences
                .iter_mut()
                .zip(of_share)
                .for_each(|(sum, of_share)| *sum += of_share);
        }
        let picture = self.picture(totals, of_sequences);
        // Each merge has one part at least.
        let first = self.shares.values().next().expect("a part");
        let mut devices: Vec<&DeviceDescription> = self.shares.values().map(|share| &share.device).collect();
        devices.sort_by(|a, b| a.name.cmp(&b.name));
        devices.dedup_by(|a, b| a.name == b.name);
        let joined = |of: fn(&DeviceDescription) -> &str| {
            devices.iter().map(|device| of(device)).collect::<Vec<_>>().join(" + ")
        };
        let device = DeviceDescription {
            name: joined(|device| &device.name),
            driver: joined(|device| &device.driver),
            timestamp_period_ns: first.device.timestamp_period_ns,
        };
        let iterations = SequenceIterations(of_sequences);
        let estimate = first.estimate;
        Rendered::from(Of {
            metadata: Metadata {
                iterations: u64::from(totals.iterations),
                photons_emitted: totals.emitted,
                seed: u64::from(first.seed),
                device: device.name.clone(),
                seconds: self.shares.values().map(|share| share.seconds).sum(),
                estimated_error: None,
                denoised_by: None,
            },
            iterations,
            picture: picture.into(),
            layers: Layers::NONE,
            shown: first.shown,
            resolution: first.resolution,
            names: Arc::default(),
            samples: totals.camera_paths,
            estimate,
            subject: Subject {
                scene: first.scene.clone(),
                resolution: first.shown.size,
                gather: first.gather.clone(),
                photons: first.photons,
                photons_emitted: totals.emitted,
                device,
                counters,
            },
            max_depth: first.max_depth,
            profile: Profile::default(),
            failure: None,
            given: None,
        })
    }

    fn picture(&self, totals: Totals, of_sequences: [u32; SEQUENCES as usize]) -> Resolved {
        let mean = |sum: i128, count: u32| (sum as f64 / UNITS / f64::from(count.max(1))) as f32;
        let parts = self.shares.len() as u32;
        let film: Vec<[f32; 4]> = self
            .sums
            .iter()
            .zip(&self.waits)
            .map(|(sums, &waits)| {
                let [r, g, b] = [0, 1, 2].map(|channel| mean(sums[channel], totals.iterations));
                let alpha = mean(sums[3], totals.camera_paths);
                [r, g, b, if waits == parts { -alpha } else { alpha }]
            })
            .collect();
        let glass = self.sums.iter().zip(&self.glass).map(|(sums, radii)| BehindGlass {
            unbent: mean(sums[GLASS], totals.iterations),
            arrived: mean(sums[GLASS + 1], totals.iterations),
            photons: mean(sums[GLASS + 2], 1),
            ..*radii
        });
        let of_sequence = |(sequence, iterations): (usize, u32)| {
            let first = 4 + 4 * sequence;
            let of_pixel = move |sums: &[i128; SUMS]| -> [f32; 4] {
                std::array::from_fn(|index| mean(sums[first + index], iterations))
            };
            self.sums.iter().map(of_pixel)
        };
        let sequences = of_sequences.into_iter().enumerate().flat_map(of_sequence);
        let size = self.shares.values().next().map_or([0, 0], |share| share.shown.size);
        Resolved::from_film(size, &film, glass.collect(), sequences.collect())
    }
}

/// A value times a count, in units of the sums.
fn units(value: f32, times: u32) -> Result<i128> {
    let units = f64::from(value) * UNITS;
    if units.abs() < MOST {
        return Ok(units as i128 * i128::from(times));
    }
    let most = MOST / UNITS;
    Err(Error::Config(format!(
        "has a radiance of {value:e}; parts can be merged up to {most:.1e}: scale the scene's lights down"
    )))
}

fn larger_radii(of: &mut BehindGlass, other: &BehindGlass) {
    of.radius = of.radius.max(other.radius);
    of.radius2 = of.radius2.max(other.radius2);
}

fn shares_of(state: &State) -> Result<BTreeMap<u32, Share>> {
    match state.of.part.number {
        0 => state.blocks.get(SHARES),
        part => Ok(BTreeMap::from([(part, state.blocks.get(SHARE)?)])),
    }
}
