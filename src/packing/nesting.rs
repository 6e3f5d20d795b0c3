//! Priorities of overlapping dielectrics: Schmidt and Budge, «Simple Nested Dielectrics in Ray Traced Images», Journal of
//! Graphics Tools 7(2), 2002. Their priorities are set by hand; here the smaller volume has priority, so that a stone in water
//! stays a stone.

use glam::{DVec3, Vec3};

use crate::scene::{Scene, Surface};

/// The rank of an object that overlaps no other.
pub(crate) const ALONE: u32 = 0xfffe;
/// Faces within this distance touch, for rays, in render units.
const APART: f32 = 1e-5;
/// A medium has 16 bits for its material: see `glsl/trace/media.glsl`.
const MOST_MATERIALS: usize = 0xffff;

/// The order of the objects that are solid dielectrics.
pub(crate) struct Nesting {
    /// The rank of each object; where several overlap, the lowest counts.
    pub ranks: Vec<u32>,
    /// Whether any objects overlap, so that the ranks matter.
    pub overlaps: bool,
}

/// Whether a material is a dielectric with an inside.
pub(crate) fn is_solid(scene: &Scene, material: u32) -> bool {
    let surface = scene.materials[material as usize].surface;
    matches!(surface, Surface::Dielectric(glass) if !glass.thin)
}

struct Solid {
    object: usize,
    low: Vec3,
    high: Vec3,
    volume: f64,
}

impl Nesting {
    /// The ranks of a scene's objects, by their bounds and volumes.
    ///
    /// # Errors
    /// A text, if solids overlap and there are more materials than the bits of a medium can hold.
    pub(crate) fn of(scene: &Scene) -> Result<Self, String> {
        let objects = scene.objects.iter().enumerate();
        let mut solids: Vec<Solid> = objects
            .filter(|(_, object)| is_solid(scene, object.material))
            .map(|(object, _)| Solid::of(scene, object))
            .collect();
        let any_solid = !solids.is_empty();
        let mut nests = vec![false; scene.objects.len()];
        solids.sort_by(|a, b| a.low.x.total_cmp(&b.low.x));
        for (i, solid) in solids.iter().enumerate() {
            let in_reach = solids[i + 1..]
                .iter()
                .take_while(|other| other.low.x - APART <= solid.high.x);
            for other in in_reach.filter(|other| solid.meets(other)) {
                nests[solid.object] = true;
                nests[other.object] = true;
            }
        }
        solids.retain(|solid| nests[solid.object]);
        solids.sort_by(|a, b| a.volume.total_cmp(&b.volume).then(a.object.cmp(&b.object)));
        if any_solid && scene.materials.len() > MOST_MATERIALS {
            return Err(format!(
                "has {} materials, but with solid glass at most {MOST_MATERIALS} are supported; merge equal ones",
                scene.materials.len()
            ));
        }
        let mut ranks = vec![ALONE; scene.objects.len()];
        for (rank, solid) in (0..ALONE).zip(&solids) {
            ranks[solid.object] = rank;
        }
        Ok(Self {
            ranks,
            overlaps: !solids.is_empty(),
        })
    }
}

impl Solid {
    fn of(scene: &Scene, index: usize) -> Self {
        let object = &scene.objects[index];
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let mut volume = 0.0;
        let mut centre = None;
        for triangle in object.triangles.clone() {
            let corners = scene.corners_of(triangle).map(|corner| object.placed(corner));
            for corner in corners {
                low = low.min(corner);
                high = high.max(corner);
            }
            // Relative to a point of the object: far from the scene's centre, the terms would cancel.
            let centre: DVec3 = *centre.get_or_insert(corners[0].as_dvec3());
            let [a, b, c] = corners.map(|corner| corner.as_dvec3() - centre);
            volume += a.dot(b.cross(c)) / 6.0;
        }
        Self {
            object: index,
            low,
            high,
            volume: volume.abs(),
        }
    }

    /// Touching faces may be a few roundings apart.
    fn meets(&self, other: &Self) -> bool {
        let is_low = |low: Vec3, high: Vec3| (low - APART).cmple(high).all();
        is_low(self.low, other.high) && is_low(other.low, self.high)
    }
}
