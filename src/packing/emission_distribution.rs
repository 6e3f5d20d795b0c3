//! The distribution of emission over triangles: the factor by which textures and alpha scale it.

use glam::{DVec2, DVec3, DVec4};
use rayon::prelude::*;

use super::EmissiveTriangle;
use super::part::Part;
use crate::layout::TextureLookup;
use crate::scene::{Alpha, Material, Scene, Triangle};

/// Maximum number of parts along a side of a triangle.
const MOST_COLUMNS: u32 = 256;
/// Maximum number of parts of all triangles together.
const MOST_PARTS: u64 = 1 << 18;
/// Minimum and maximum number of points that are evaluated along a side of a triangle.
const ASKED: [u32; 2] = [4, 1024];
/// Approximate maximum number of points of all triangles together.
const MOST_ASKED: u64 = 1 << 22;
/// Points for each texel along a side, and for each part: interpolation blends light over half a texel.
const ASKED_A_TEXEL: f64 = 4.0;
const ASKED_A_PART: u32 = 2;
/// Parts are not divided further if their squared noise is at most this multiple of that of even emission, for an object whose
/// triangles all emit equally.
const EVEN_ENOUGH: f64 = 1.1;
/// The share of a part's weight that goes by the brightest texels that it may read: no point of a part as small as a texel emits
/// more than 50 times its weight.
const BY_MOST: f64 = 0.02;
/// Minimum mean factor: power is always positive.
const LEAST: f64 = 1e-6;

/// A triangle's middle.
const MIDDLE: DVec2 = DVec2::splat(1.0 / 3.0);

/// The distribution of emission over a triangle.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EmissionDistribution {
    /// Approximate mean factor of the emission.
    pub mean: f64,
    /// Parts along a side.
    pub columns: u32,
    /// The share of the light that is assumed to come from each part; 0 if it is surely dark.
    pub shares: Vec<f64>,
}

impl EmissionDistribution {
    const EVEN: Self = Self {
        mean: 1.0,
        columns: 1,
        shares: Vec::new(),
    };

    /// Whether no part of it emits.
    pub fn is_dark(&self) -> bool {
        self.shares == [0.0]
    }

    /// For an object that is dark as a whole, some light has to be assumed.
    pub fn not_dark(&mut self) {
        self.shares.clear();
    }

    /// The share of one of the parts.
    pub fn share(&self, number: u32) -> f64 {
        self.shares.get(number as usize).copied().unwrap_or(1.0)
    }

    /// The distributions of emissive triangles, whose powers are without textures; and whether some of them would need more
    /// parts.
    pub fn of_all(scene: &Scene, triangles: &[EmissiveTriangle]) -> (Vec<Self>, bool) {
        let textured = triangles.par_iter().map(|light| Textured::of(scene, light.triangle));
        let textured: Vec<Option<Textured<'_>>> = textured.collect();
        let asked = || textured.iter().flatten().map(Textured::asked);
        let within = |most: u32| asked().map(|asked| u64::from(asked.min(most)).pow(2)).sum::<u64>() <= MOST_ASKED;
        let most_asked = halved_until(ASKED[1], ASKED[0], within);
        let levels: Vec<Option<Level>> = textured
            .par_iter()
            .map(|textured| textured.as_ref().map(|textured| textured.finest(most_asked)))
            .collect();
        let enough = enough_noise(scene, triangles, &levels);
        let levels = levels.into_iter().zip(enough);
        let levels: Vec<Option<Level>> = levels
            .map(|(level, enough)| level.map(|level| level.coarse_as(enough)))
            .collect();
        let columns = || levels.iter().flatten().map(|level| level.columns);
        let within = |most: u32| columns().map(|n| u64::from(n.min(most)).pow(2)).sum::<u64>() <= MOST_PARTS;
        let most_columns = halved_until(MOST_COLUMNS, 1, within);
        let is_coarse = levels
            .iter()
            .flatten()
            .any(|level| level.is_coarse || level.columns > most_columns);
        let distribution =
            |level: Option<Level>| level.map_or(Self::EVEN, |level| Self::of(&level.coarsened(most_columns)));
        (levels.into_iter().map(distribution).collect(), is_coarse)
    }

    fn of(level: &Level) -> Self {
        let weight = |(square, most): (&f64, &f64)| {
            if *most > 0.0 {
                (1.0 - BY_MOST) * square.sqrt() + BY_MOST * most.sqrt()
            } else {
                0.0
            }
        };
        let weights: Vec<f64> = level.squares.iter().zip(&level.most).map(weight).collect();
        let all: f64 = weights.iter().sum();
        Self {
            // The texture may emit between the evaluated points.
            mean: level.mean.max(BY_MOST * all / weights.len() as f64).max(LEAST),
            columns: level.columns,
            shares: match weights[..] {
                [weight] => vec![f64::from(u8::from(weight > 0.0))],
                _ => weights.iter().map(|weight| weight / all).collect(),
            },
        }
    }
}

/// The noise that the parts of each triangle may have: a triangle that emits little compared with the rest of its object needs
/// less precision.
fn enough_noise(scene: &Scene, triangles: &[EmissiveTriangle], levels: &[Option<Level>]) -> Vec<f64> {
    let mean = |level: &Option<Level>| level.as_ref().map_or(1.0, |level| level.mean);
    let powers = || {
        triangles.iter().zip(levels).map(|(light, level)| {
            let object = scene.triangles[light.triangle as usize].object as usize;
            (object, light.power * mean(level))
        })
    };
    let mut of_objects = vec![(0.0, 0.0); scene.objects.len()];
    for (object, power) in powers() {
        let (all, count) = &mut of_objects[object];
        *all += power;
        *count += 1.0;
    }
    let enough = |(object, power): (usize, f64)| {
        let (all, count) = of_objects[object];
        1.0 + (EVEN_ENOUGH - 1.0) * (all / (count * power)).max(1.0)
    };
    powers().map(enough).collect()
}

/// Halves a number until it fits or is the least one.
fn halved_until(mut number: u32, least: u32, fits: impl Fn(u32) -> bool) -> u32 {
    while number > least && !fits(number) {
        number /= 2;
    }
    number
}

/// The factors of a triangle's parts, for a given number of parts.
struct Level {
    columns: u32,
    mean: f64,
    /// Mean square of each part's factor.
    squares: Vec<f64>,
    /// The square of the largest factor that a point of each part may have: 0 if it is surely dark.
    most: Vec<f64>,
    /// Whether more parts would reduce noise.
    is_coarse: bool,
}

impl Level {
    /// The squared noise of light that is sampled by these parts, at least 1.
    fn noise(&self) -> f64 {
        let roots: f64 = self.squares.iter().map(|square| square.sqrt()).sum();
        (roots / (self.squares.len() as f64 * self.mean)).powi(2)
    }

    /// The smallest number of parts that has no more noise than this, or all.
    fn coarse_as(mut self, noise: f64) -> Self {
        let is_even = |level: &Self| level.mean <= 0.0 || level.noise() <= noise;
        self.is_coarse &= !is_even(&self);
        while self.columns > 1 {
            let halved = self.halved();
            if !is_even(&halved) {
                break;
            }
            self = halved;
        }
        self
    }

    /// Joins four parts each.
    fn halved(&self) -> Self {
        Self {
            columns: self.columns / 2,
            squares: halved(&self.squares, self.columns),
            most: halved(&self.most, self.columns),
            ..*self
        }
    }

    fn coarsened(mut self, most_columns: u32) -> Self {
        while self.columns > most_columns {
            self = self.halved();
        }
        self
    }
}

/// Means of four parts each.
fn halved(values: &[f64], columns: u32) -> Vec<f64> {
    let mut means = vec![0.0; values.len() / 4];
    for (number, value) in (0..).zip(values) {
        let middle = Part::numbered(number, columns).place(MIDDLE);
        means[Part::around(middle, columns / 2).number() as usize] += value / 4.0;
    }
    means
}

/// A triangle whose emission depends on a texture or on vertex colours.
struct Textured<'a> {
    scene: &'a Scene,
    material: &'a Material,
    emission: Option<&'a TextureLookup>,
    /// Base colour; only its alpha matters.
    color: Option<&'a TextureLookup>,
    /// Both sets of coordinates, of the three corners.
    corners: [[DVec2; 2]; 3],
    alphas: DVec3,
}

impl<'a> Textured<'a> {
    fn of(scene: &'a Scene, triangle: u32) -> Option<Self> {
        let Triangle { vertices, object } = scene.triangles[triangle as usize];
        let material = &scene.materials[scene.objects[object as usize].material as usize];
        let lookup = |index: u32| &scene.textures.lookups[index as usize];
        let sees_through = material.alpha != Alpha::Opaque;
        let emission = material.textures.emission.map(lookup);
        let alpha_of = |vertex: u32| {
            scene
                .colors
                .get(vertex as usize)
                .map_or(1.0, |color| f64::from(color.w))
        };
        let sets_of = |vertex: u32| scene.texcoords.get(vertex as usize).copied().unwrap_or_default();
        (emission.is_some() || sees_through).then(|| Self {
            scene,
            material,
            emission,
            color: material.textures.base_color.filter(|_| sees_through).map(lookup),
            corners: vertices.map(|vertex| sets_of(vertex).map(|set| set.as_dvec2())),
            alphas: vertices.map(alpha_of).into(),
        })
    }

    /// Texels along its longest side.
    fn texels(&self) -> f64 {
        let lookups = [self.emission, self.color].into_iter().flatten();
        lookups
            .map(|lookup| lookup.texels_across(self.corners))
            .fold(1.0, f64::max)
    }

    /// Number of points along a side that resolve it.
    fn asked(&self) -> u32 {
        let [least, most] = ASKED;
        let wanted = ASKED_A_TEXEL * self.texels().min(f64::from(most));
        // Texture coordinates are rounded.
        ((wanted - 1e-3).ceil() as u32).next_power_of_two().clamp(least, most)
    }

    /// Both sets of coordinates at a point.
    fn sets(&self, place: DVec2) -> [DVec2; 2] {
        let [a, b, c] = self.corners;
        [0, 1].map(|set: usize| a[set] * (1.0 - place.x - place.y) + b[set] * place.x + c[set] * place.y)
    }

    /// Mean of a colour's channels, weighted by the material's emission.
    fn emitted(&self, texel: DVec4) -> f64 {
        let emission = self.material.emission.as_dvec3();
        texel.truncate().dot(emission) / emission.element_sum()
    }

    /// Factor of the emission at a point.
    fn factor(&self, place: DVec2) -> f64 {
        let texels = &self.scene.textures.texels;
        let sets = self.sets(place);
        let emitted = self
            .emission
            .map_or(1.0, |lookup| self.emitted(lookup.value(texels, sets)));
        let of_corners = self.alphas.dot(DVec3::new(1.0 - place.x - place.y, place.x, place.y));
        let alpha = || of_corners * self.color.map_or(1.0, |lookup| lookup.value(texels, sets).w);
        let there = match self.material.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask { alpha: factor, cutoff } => {
                f64::from(u8::from(f64::from(factor) * alpha() >= f64::from(cutoff)))
            }
            Alpha::Blend { alpha: factor } => (f64::from(factor) * alpha()).clamp(0.0, 1.0),
        };
        emitted * there
    }

    /// With the maximum number of parts.
    fn finest(&self, most_asked: u32) -> Level {
        let wanted = self.asked();
        let asked = wanted.min(most_asked);
        let factor = |number| self.factor(Part::numbered(number, asked).place(MIDDLE));
        let factors: Vec<f64> = (0..asked * asked).map(factor).collect();
        let squares: Vec<f64> = factors.iter().map(|factor| factor * factor).collect();
        let columns = asked / ASKED_A_PART;
        let most = (0..columns * columns).map(|number| self.most(Part::numbered(number, columns)).powi(2));
        let level = Level {
            columns,
            mean: factors.iter().sum::<f64>() / factors.len() as f64,
            squares: halved(&squares, asked),
            most: most.collect(),
            is_coarse: f64::from(columns.min(MOST_COLUMNS)) < self.texels().min(f64::from(wanted)) - 1e-3,
        };
        level.coarsened(MOST_COLUMNS)
    }

    /// The largest factor that a point of a part may have.
    fn most(&self, part: Part) -> f64 {
        let texels = &self.scene.textures.texels;
        let corners = [DVec2::ZERO, DVec2::X, DVec2::Y].map(|corner| self.sets(part.place(corner)));
        self.emission
            .map_or(1.0, |lookup| lookup.most(texels, corners, |texel| self.emitted(texel)))
    }
}
