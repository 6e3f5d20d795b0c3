//! BSDFs: evaluate, sample, density.
//!
//! A BSDF is a sum of layers, each with a weight and a normal: a clear coat, and the surface below it, which has two layers if it
//! transmits only a part of the light. A layer is a [`Reflector`] or [`Glass`].

use glam::DVec3;

use super::glass::{Glass, mirrored_above};
use super::reflector::{Reflector, coat_passes};
use super::sampling::cosine_direction;
use super::surface::Normals;
use super::vector::rgb;
use crate::layout::{DIELECTRIC, FOLLOWED_ALPHA, GLOSSY_SURFACE, MATTE, MIRROR, Material};

/// Wide lobes, where camera paths end and photons are gathered, or narrow lobes, which camera paths follow.
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

/// A sampled direction of one lobe.
#[derive(Debug, Clone, Copy)]
pub struct Branch {
    /// Probability of choosing this branch among all branches.
    pub probability: f64,
    /// Unit vector.
    pub direction: DVec3,
    /// BSDF · cos (to the layer's normal) over the density of the direction, for this lobe alone. A path that follows only this
    /// branch divides by its probability.
    pub weight: DVec3,
    /// The layer's normal.
    pub normal: DVec3,
    /// Of its lobe.
    pub width: Width,
    /// Of a mirror or smooth glass: a delta distribution.
    pub is_delta: bool,
    /// For transmission: refractive index before over that behind the boundary.
    pub passes: Option<f64>,
}

/// The BSDF at a point. Directions are unit vectors away from the surface; `v` points to the path's previous vertex.
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

/// The lobes of this width: the base is wide, the boundary's width depends on its roughness.
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

/// The fraction of a surface that transmits light.
fn clear_part(material: &Material) -> f64 {
    match material.surface {
        DIELECTRIC => f64::from(material.transmission) * (1.0 - f64::from(material.metallic)),
        _ => 0.0,
    }
}

impl Bsdf {
    /// From a material with textures applied. `outside`: refractive index on the outer side; `tint`: of transmitted light.
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
        // A clear coat lies only on the outside of glass.
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
                // Relative to the part that does not transmit.
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

    /// Whether photons are stored and camera paths can end here.
    pub fn is_receiver(&self) -> bool {
        self.is_receiver
    }

    /// BSDF · cos, 1/sr, of the lobes of this width, for radiance from `l` to `v`; 0 for delta lobes.
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

    /// Relative sampling weight of each lobe: base and boundary of a reflector, or all of glass.
    fn importance(&self, layer: &Layer, v: DVec3) -> [f64; 2] {
        match layer.lobe {
            Lobe::Glass(..) => [0.0, layer.share],
            Lobe::Reflector(reflector) => {
                let nv = layer.normal.dot(v);
                // A lower bound, so that light below a coat at grazing angles is not sampled too rarely.
                let passes = coat_passes(reflector.coat, nv).max(0.25);
                // The same for reflections, which may be bright.
                let reflected = reflector.fresnel(nv).max_element().max(0.25 * reflector.f90);
                let base = reflector.base_albedo() * (1.0 - reflected).max(0.25);
                [base, reflected].map(|part| layer.share * passes * part)
            }
        }
    }

    /// Density per solid angle with which the [`Self::branches`] of this width are sampled when one is chosen by its probability.
    /// Branches without a density count as 0.
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

    /// One sample of each lobe for light from `v`. Black lobes have none.
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
                    // Around the geometric normal, so that photons need no second correction.
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
                    let samples = glass.sample(n, geometric, v, u);
                    let is_delta = glass.is_smooth();
                    let refracted = samples.refracted.map(|sample| (sample, tint, Some(glass.eta())));
                    for (sample, tint, passes) in [(samples.reflected, DVec3::ONE, None)].into_iter().chain(refracted) {
                        let (probability, weight) =
                            (boundary * sample.probability, tint * sample.weight * sample.probability);
                        add(probability, sample.direction, weight, Width::Narrow, is_delta, passes);
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

    /// A direction of the wide lobes, chosen among them by `choice`; `None` if all are black.
    pub fn sample_wide(&self, v: DVec3, u: [f64; 2], choice: f64) -> Option<DVec3> {
        let mut branches = self.branches(v, u);
        branches.retain(|branch| branch.width == Width::Wide);
        choose(&branches, choice).map(|branch| branch.direction)
    }
}

/// Chooses a branch in proportion to its probability.
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
