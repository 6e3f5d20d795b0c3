//! How a surface scatters: evaluate, sample, density.
//!
//! A BSDF is a sum of layers, each with a share and a normal of its own: a clear coat, what lies below it, and of a surface
//! that passes a part of the light only both parts. A layer is a [`Reflector`] or [`Glass`].

use glam::DVec3;

use super::glass::{Glass, mirrored_above};
use super::reflector::{Reflector, coat_passes};
use super::sampling::cosine_direction;
use super::surface::Normals;
use super::vector::rgb;
use crate::layout::{DIELECTRIC, FOLLOWED_ALPHA, GLOSSY_SURFACE, MATTE, MIRROR, Material};

/// Which lobes are meant: a camera path ends at wide ones, where photons are gathered, and follows narrow ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// Lambertian, and microfacets from [`FOLLOWED_ALPHA`] on.
    Wide,
    /// Other microfacets, mirrors, and glass.
    Narrow,
}

#[derive(Debug, Clone, Copy)]
enum Lobe {
    Reflector(Reflector),
    Glass(Glass, DVec3),
}

#[derive(Debug, Clone, Copy)]
struct Layer {
    share: f64,
    normal: DVec3,
    lobe: Lobe,
}

/// One of the ways that light can take at a surface.
#[derive(Debug, Clone, Copy)]
pub struct Branch {
    /// Chance that it is taken, of all ways together.
    pub probability: f64,
    /// Unit vector.
    pub direction: DVec3,
    /// Part of the flux that goes there: BSDF · cos of the layer's normal over the density of the direction, of one lobe. A path that
    /// takes this branch alone divides by its probability.
    pub weight: DVec3,
    /// The layer's.
    pub normal: DVec3,
    /// Of its lobe.
    pub width: Width,
    /// A mirror's or smooth glass's: no other direction is possible.
    pub is_delta: bool,
    /// Through the boundary of a dielectric: index before over that behind it.
    pub passes: Option<f64>,
}

/// Scattering at a point. Directions are unit vectors away from the surface; `v` is where the path came from.
#[derive(Debug, Clone)]
pub struct Bsdf {
    normals: Normals,
    layers: Vec<Layer>,
    is_receiver: bool,
}

fn width(reflector: &Reflector) -> Width {
    if reflector.alpha >= FOLLOWED_ALPHA {
        Width::Wide
    } else {
        Width::Narrow
    }
}

/// The lobes of this width: the base is wide, the boundary has its own.
fn lobes_of(reflector: Reflector, of: Width) -> Reflector {
    let base = Reflector {
        f0: DVec3::ZERO,
        f90: 0.0,
        ..reflector
    };
    match (of, width(&reflector)) {
        (Width::Wide, Width::Wide) => reflector,
        (Width::Wide, Width::Narrow) => base,
        (Width::Narrow, Width::Narrow) => reflector.boundary(),
        (Width::Narrow, Width::Wide) => base.boundary(),
    }
}

/// The part of a surface that passes light.
fn clear_part(material: &Material) -> f64 {
    match material.surface {
        DIELECTRIC => f64::from(material.transmission) * (1.0 - f64::from(material.metallic)),
        _ => 0.0,
    }
}

impl Bsdf {
    /// Of a material at a place, with its textures. `outside`: index of refraction; `tint` of what passes.
    pub fn new(material: &Material, normals: Normals, outside: f64, tint: DVec3) -> Self {
        let mut layers = Vec::with_capacity(2);
        let mut add = |share: f64, normal: DVec3, lobe: Lobe| {
            if share > 0.0 {
                layers.push(Layer { share, normal, lobe });
            }
        };
        let clear = clear_part(material);
        let coat = f64::from(material.coat);
        let mut is_receiver =
            [MATTE, GLOSSY_SURFACE].contains(&material.surface) || (material.surface == DIELECTRIC && clear < 1.0);
        // The inside of glass has no coat.
        if coat > 0.0 && (normals.front || material.surface != DIELECTRIC || material.thin != 0) {
            let coat = Reflector::coat(material);
            is_receiver |= width(&coat) == Width::Wide;
            add(1.0, normals.coat, Lobe::Reflector(coat));
        }
        let base_color = rgb(material.base_color);
        let opaque = match material.surface {
            MATTE => Reflector::matte(base_color),
            MIRROR => Reflector::mirror(base_color, coat),
            _ => Reflector::glossy(&Material {
                // Of what isn't clear.
                metallic: (f64::from(material.metallic) / (1.0 - clear).max(1e-10)).min(1.0) as f32,
                ..*material
            }),
        };
        add(1.0 - clear, normals.shading, Lobe::Reflector(opaque));
        let glass = Glass::new(material, outside, normals.front);
        add(clear, normals.shading, Lobe::Glass(glass, tint));
        Self {
            normals,
            layers,
            is_receiver,
        }
    }

    /// The normals, on the side of `v`.
    pub fn normals(&self) -> Normals {
        self.normals
    }

    /// Whether a camera path can end there: photons land there.
    pub fn is_receiver(&self) -> bool {
        self.is_receiver
    }

    /// BSDF · cos, 1/sr, of the lobes of this width, for radiance from `l` to `v`; 0 of mirrors and smooth glass.
    pub fn evaluate(&self, of: Width, v: DVec3, l: DVec3) -> DVec3 {
        let above = l.dot(self.normals.geometric) > 0.0;
        let value = |layer: &Layer| match layer.lobe {
            Lobe::Reflector(reflector) if above => {
                lobes_of(reflector, of).brdf(layer.normal, v, l) * layer.normal.dot(l).max(0.0)
            }
            Lobe::Glass(glass, tint) if of == Width::Narrow => {
                let (value, _) = glass.evaluate(layer.normal, self.normals.geometric, v, l);
                value * if above { DVec3::ONE } else { tint }
            }
            _ => DVec3::ZERO,
        };
        self.layers.iter().map(|layer| layer.share * value(layer)).sum()
    }

    /// How often each lobe is sampled, up to a factor: base and boundary of each reflector, then all of glass.
    fn importance(&self, layer: &Layer, v: DVec3) -> [f64; 2] {
        match layer.lobe {
            Lobe::Glass(..) => [0.0, layer.share],
            Lobe::Reflector(reflector) => {
                let nv = layer.normal.dot(v);
                // What a coat passes at grazing angles shall not be a rare choice.
                let passes = coat_passes(reflector.coat, nv).max(0.25);
                // Nor what a boundary mirrors, which may be bright.
                let reflected = reflector.fresnel(nv).max_element().max(0.25 * reflector.f90);
                let base = reflector.base_albedo() * (1.0 - reflected).max(0.25);
                [base, reflected].map(|part| layer.share * passes * part)
            }
        }
    }

    /// Density per solid angle of directions by the [`Self::branches`] of this width, one of them by its probability. Those that
    /// have none count as 0.
    pub fn density(&self, of: Width, v: DVec3, l: DVec3) -> f64 {
        let (mut sum, mut all) = (0.0, 0.0);
        let above = l.dot(self.normals.geometric) > 0.0;
        for layer in &self.layers {
            let [base, boundary] = self.importance(layer, v);
            match layer.lobe {
                Lobe::Reflector(reflector) => {
                    if of == Width::Wide {
                        sum += base * l.dot(self.normals.geometric).max(0.0) / std::f64::consts::PI;
                        all += base;
                    }
                    if width(&reflector) == of {
                        all += boundary;
                        if above && !reflector.is_smooth() {
                            sum += boundary * reflector.reflected_density(layer.normal, v, l);
                        }
                    }
                }
                Lobe::Glass(glass, _) if of == Width::Narrow => {
                    let (_, density) = glass.evaluate(layer.normal, self.normals.geometric, v, l);
                    sum += boundary * density;
                    all += boundary;
                }
                Lobe::Glass(..) => {}
            }
        }
        if all > 0.0 { sum / all } else { 0.0 }
    }

    /// All ways that light from `v` can take, one direction for each. None of what is black.
    pub fn branches(&self, v: DVec3, u: [f64; 2]) -> Vec<Branch> {
        let geometric = self.normals.geometric;
        let mut branches = Vec::with_capacity(4);
        for layer in &self.layers {
            let n = layer.normal;
            let [base, boundary] = self.importance(layer, v);
            let mut add = |probability: f64, direction: DVec3, weight: DVec3, width, is_delta, passes| {
                if probability > 0.0 {
                    branches.push(Branch {
                        probability,
                        direction,
                        weight: layer.share * weight,
                        normal: n,
                        width,
                        is_delta,
                        passes,
                    });
                }
            };
            match layer.lobe {
                Lobe::Reflector(reflector) => {
                    // About the geometric normal, so that photons need no second correction.
                    let direction = cosine_direction(geometric, u[0], u[1]);
                    let over_density = std::f64::consts::PI / direction.dot(geometric).max(1e-20);
                    let diffuse = Reflector {
                        alpha: 0.0,
                        ..reflector
                    };
                    let weight = diffuse.brdf(n, v, direction) * (n.dot(direction).max(0.0) * over_density);
                    add(base, direction, weight, Width::Wide, false, None);
                    let direction = if reflector.is_smooth() {
                        mirrored_above(geometric, n, v)
                    } else {
                        reflector.reflected_direction(n, v, u)
                    };
                    let above = direction.dot(geometric) > 0.0;
                    let weight = if above {
                        reflector.reflected_weight(n, v, direction)
                    } else {
                        DVec3::ZERO
                    };
                    add(
                        boundary,
                        direction,
                        weight,
                        width(&reflector),
                        reflector.is_smooth(),
                        None,
                    );
                }
                Lobe::Glass(glass, tint) => {
                    let turns = glass.turns(n, geometric, v, u);
                    let is_delta = glass.is_smooth();
                    let refracted = turns.refracted.map(|turn| (turn, tint, Some(glass.eta())));
                    for (turn, tint, passes) in [(turns.reflected, DVec3::ONE, None)].into_iter().chain(refracted) {
                        let (probability, weight) =
                            (boundary * turn.probability, tint * turn.weight * turn.probability);
                        add(probability, turn.direction, weight, Width::Narrow, is_delta, passes);
                    }
                }
            }
        }
        let all: f64 = branches.iter().map(|branch| branch.probability).sum();
        for branch in &mut branches {
            branch.probability /= all;
        }
        branches
    }

    /// A direction of the wide lobes, chosen among them by `choice`; `None` where all are black.
    pub fn sample_wide(&self, v: DVec3, u: [f64; 2], choice: f64) -> Option<DVec3> {
        let mut branches = self.branches(v, u);
        branches.retain(|branch| branch.width == Width::Wide);
        choose(&branches, choice).map(|branch| branch.direction)
    }
}

/// One of some branches, in proportion to their probabilities.
pub fn choose(branches: &[Branch], u: f64) -> Option<Branch> {
    let mut left = u * branches.iter().map(|branch| branch.probability).sum::<f64>();
    let chosen = branches.iter().find(|branch| {
        left -= branch.probability;
        left < 0.0
    });
    chosen.or(branches.last()).copied()
}

#[cfg(test)]
mod tests;
