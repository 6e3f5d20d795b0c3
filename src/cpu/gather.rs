//! The photons within each visible point's radius.

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::camera::SeenSlice;
use super::gloss::Reflector;
use super::sampling::decode_direction;
use super::vector::{mean, rgb, word, xyz};
use crate::error::{Error, Result};
use crate::layout::{CAUSTIC, Gathered, NO_OBJECT, Photon, VisiblePoint};

/// How much farther than R the kd-tree is asked: more than the rounding of the squared distance, which the tree and
/// the predicate sum up differently.
const MARGIN: f32 = 1.0 + 1e-5;

/// Sums of flux and of flux · distance², and number of accepted photons. Thousands of f32 of like size add up in f64 without rounding, so the
/// order in which photons are found doesn't matter.
#[derive(Default)]
struct Sum {
    flux: DVec3,
    count: u32,
    moment: f64,
}

impl Sum {
    fn add(&mut self, flux: DVec3, distance2: f32) {
        self.flux += flux;
        self.count += 1;
        self.moment += mean(flux) * f64::from(distance2);
    }

    fn add_to(&self, gathered: &mut Gathered) {
        let flux = (rgb(gathered.flux) + self.flux).as_vec3();
        gathered.flux = flux.to_array();
        gathered.count += self.count;
        gathered.moment = (f64::from(gathered.moment) + self.moment) as f32;
    }
}

/// The gather's side of a visible point.
struct Receiver {
    position: [f32; 3],
    radius2: f32,
    /// With its map's bit, as photons have it.
    object: u32,
    normal: DVec3,
    shading_normal: DVec3,
    /// Of a scene with glossy surfaces; and the direction to the viewer.
    reflector: Option<(Reflector, DVec3)>,
    coated: bool,
}

fn position(position_object: [f32; 4]) -> [f32; 3] {
    [position_object[0], position_object[1], position_object[2]]
}

impl Receiver {
    /// `None` where the path met no matte surface.
    fn new(point: &VisiblePoint, map: usize, radius2: f32, seen: SeenSlice<'_>, slot: usize) -> Option<Self> {
        let object = word(point.position_object);
        (object != NO_OBJECT).then(|| Self {
            position: position(point.position_object),
            radius2,
            object: if map == 1 { object | CAUSTIC } else { object },
            normal: decode_direction(word(point.weight_normal)),
            shading_normal: decode_direction(word(point.emitted_normal)),
            reflector: seen.reflector(slot),
            coated: seen.is_coated(slot),
        })
    }

    /// `gather` of `glsl/shared/gather.glsl`: adds a photon within R, on the same object, that arrives on the side that the
    /// viewer sees. The distance is rounded to f32 at each step as there, so that both count the same photons.
    fn gather(&self, photon: &Photon, sum: &mut Sum) {
        let here = position(photon.position_object);
        let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| here[axis] - self.position[axis]);
        let distance2 = x * x + y * y + z * z;
        let direction = decode_direction(word(photon.flux_direction));
        if distance2 <= self.radius2 && word(photon.position_object) == self.object && direction.dot(self.normal) < 0.0
        {
            let response = self.reflector.map_or(DVec3::ONE, |(reflector, viewer)| {
                // Photons on coated objects have their flux across their rays, since each layer has a normal of its own.
                let cosine = -direction.dot(self.shading_normal);
                let cosine = if self.coated { cosine.max(0.0) } else { 1.0 };
                reflector.brdf(self.shading_normal, viewer, -direction) * cosine
            });
            sum.add(xyz(photon.flux_direction) * response, distance2);
        }
    }
}

/// Adds to each slot, for each photon map, what `gather` sums up for its receiver. `radii2` and `gathered` have all slots of
/// one map, then those of the next.
fn for_each_receiver(
    seen: SeenSlice<'_>,
    radii2: &[f32],
    gathered: &mut [Gathered],
    gather: impl Fn(&Receiver, &mut Sum) + Sync,
) {
    let receivers = gathered.par_iter_mut().zip(radii2).enumerate();
    receivers.for_each(|(index, (gathered, &radius2))| {
        let (map, slot) = (index / seen.points.len(), index % seen.points.len());
        if let Some(receiver) = Receiver::new(&seen.points[slot], map, radius2, seen, slot) {
            let mut sum = Sum::default();
            gather(&receiver, &mut sum);
            sum.add_to(gathered);
        }
    });
}

/// Adds to each slot, for each photon map, the photons that it accepts, by testing every photon. `radii2`: R² of each.
pub fn gather_naive<'a>(seen: impl Into<SeenSlice<'a>>, radii2: &[f32], photons: &[Photon], gathered: &mut [Gathered]) {
    for_each_receiver(seen.into(), radii2, gathered, |receiver, sum| {
        photons.iter().for_each(|photon| receiver.gather(photon, sum));
    });
}

/// The same by asking a kd-tree for those nearby: the paper's CPU version.
///
/// # Errors
/// [`Error::Config`] if there are more photons than the tree can number.
pub fn gather_kd_tree<'a>(
    seen: impl Into<SeenSlice<'a>>,
    radii2: &[f32],
    photons: &[Photon],
    gathered: &mut [Gathered],
) -> Result<()> {
    if photons.is_empty() {
        return Ok(());
    }
    let positions: Vec<[f32; 3]> = photons.iter().map(|photon| position(photon.position_object)).collect();
    let tree = ImmutableKdTree::new_from_slice(&positions)
        .map_err(|error| Error::Config(format!("kd-tree: {error}; try fewer --photons")))?;
    for_each_receiver(seen.into(), radii2, gathered, |receiver, sum| {
        tree.query(&receiver.position)
            .within::<SquaredEuclidean<f32>>(receiver.radius2 * MARGIN)
            .unsorted()
            .visit(|found| receiver.gather(&photons[found.item as usize], sum));
    });
    Ok(())
}
