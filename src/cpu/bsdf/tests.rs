//! Properties of every BSDF, whatever its formulas.

use std::f64::consts::PI;

use bytemuck::Zeroable;

use super::*;
use crate::cpu::sampling::encode_direction;
use crate::random::{PathKind, Random};

fn normals(front: bool) -> Normals {
    Normals {
        geometric: DVec3::Z,
        shading: DVec3::Z,
        coat: DVec3::Z,
        front,
    }
}

/// Named materials, lit from either side.
fn bsdfs() -> Vec<(String, Bsdf)> {
    let white = Material {
        base_color: [1.0; 3],
        specular_f0: [0.04; 3],
        specular_f90: 1.0,
        transmission: 1.0,
        ior: 1.5,
        ..Material::zeroed()
    };
    let mut all = Vec::new();
    let mut add = |name: String, material: Material, front: bool| {
        all.push((name, Bsdf::new(&material, normals(front), 1.0, DVec3::ONE)));
    };
    add("matte".into(), white, true);
    for roughness in [0.4, 0.7, 1.0] {
        for (metallic, coat, anisotropy) in [
            (0.0, 0.0, 0.0),
            (1.0, 0.0, 0.0),
            (0.3, 0.8, 0.0),
            (0.0, 0.0, 0.9),
            (1.0, 0.0, 0.5),
        ] {
            let glossy = Material {
                surface: GLOSSY_SURFACE,
                roughness,
                metallic,
                coat,
                coat_roughness: 0.5,
                anisotropy,
                anisotropy_direction: encode_direction(towards(0.0, 1.0)),
                ..white
            };
            add(
                format!("glossy {roughness}, metal {metallic}, coat {coat}, anisotropy {anisotropy}"),
                glossy,
                true,
            );
        }
        for (front, thin) in [(true, 0), (false, 0), (true, 1)] {
            let glass = Material {
                surface: DIELECTRIC,
                roughness,
                thin,
                ..white
            };
            add(format!("glass {roughness}, front {front}, thin {thin}"), glass, front);
        }
    }
    all
}

const COSINES: [f64; 3] = [0.3, 0.8, 1.0];

fn towards(cosine: f64, phi: f64) -> DVec3 {
    let across = (1.0 - cosine * cosine).max(0.0).sqrt();
    DVec3::new(across * phi.cos(), across * phi.sin(), cosine)
}

/// Eight cells of the sphere.
fn cell_of(l: DVec3) -> usize {
    usize::from(l.z < 0.0) * 4 + usize::from(l.z.abs() < 0.7) * 2 + usize::from(l.x < 0.0)
}

/// Integrals over each cell of the sphere.
fn integrals(value: impl Fn(DVec3) -> f64) -> [f64; 8] {
    const STEPS: u32 = 600;
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
    let mut sums = [0.0; 8];
    for i in 0..STEPS * STEPS {
        let theta = PI * at(i / STEPS);
        let l = towards(theta.cos(), 2.0 * PI * at(i % STEPS));
        sums[cell_of(l)] += value(l) * theta.sin() * 2.0 * PI * PI / f64::from(STEPS * STEPS);
    }
    sums
}

/// Sampling frequencies match the integral of the density, and the summed weights match the integral of BSDF · cos. The mean of
/// 50,000 samples exceeds six standard errors with a probability of 2·10⁻⁹. The midpoint rule is accurate to 2·10⁻³ where the
/// horizon or a cell's edge cuts a lobe.
#[test]
fn samples_are_as_frequent_as_their_density_and_weigh_what_the_bsdf_does() {
    const SAMPLES: u32 = 50_000;
    for (name, bsdf) in bsdfs() {
        for cosine in COSINES {
            let v = towards(cosine, 0.0);
            for width in [Width::Wide, Width::Narrow] {
                let density = integrals(|l| bsdf.density(width, v, l));
                let value = integrals(|l| bsdf.evaluate(width, v, l).x);
                let (mut counts, mut sums, mut squares) = ([0.0; 8], [0.0; 8], [0.0; 8]);
                for index in 0..SAMPLES {
                    let [u0, u1, choice, _] = Random::new(PathKind::Camera, index, 0, 0).next4();
                    let mut branches = bsdf.branches(v, [u0, u1]);
                    branches.retain(|branch| branch.width == width && !branch.is_delta);
                    let chance: f64 = branches.iter().map(|branch| branch.probability).sum();
                    let Some(branch) = choose(&branches, choice) else {
                        continue;
                    };
                    let cell = cell_of(branch.direction);
                    let radiance = branch.passes.map_or(1.0, |eta| eta * eta);
                    let weight = branch.weight.x * radiance * chance / branch.probability;
                    // A reflection into the surface has no density, whatever direction replaces it.
                    let counts_there = weight > 0.0 && (branch.passes.is_some() || branch.direction.z > 0.0);
                    counts[cell] += f64::from(u8::from(counts_there)) / f64::from(SAMPLES);
                    sums[cell] += weight / f64::from(SAMPLES);
                    squares[cell] += weight * weight / f64::from(SAMPLES);
                }
                for cell in 0..8 {
                    let what = format!("{name}, cos {cosine}, {width:?}, cell {cell}");
                    let slack = |second: f64, mean: f64| {
                        2e-3 + 6.0 * ((second - mean * mean).max(0.0) / f64::from(SAMPLES)).sqrt()
                    };
                    let (found, expected) = (counts[cell], density[cell]);
                    assert!(
                        (found - expected).abs() < slack(found, found),
                        "{what}: {found} sampled, density {expected}"
                    );
                    let (found, expected) = (sums[cell], value[cell]);
                    assert!(
                        (found - expected).abs() < slack(squares[cell], found),
                        "{what}: samples weigh {found}, integral {expected}"
                    );
                }
                assert!(
                    density.iter().sum::<f64>() < 1.0 + 2e-3,
                    "{name}, cos {cosine}, {width:?}: {density:?}"
                );
            }
        }
    }
}

/// Reciprocity, and energy conservation. Radiance that passes a boundary scales with the square of the ratio of the refractive
/// indices.
#[test]
fn light_and_viewer_change_places_and_no_light_is_made() {
    for (name, bsdf) in bsdfs() {
        for cosine in COSINES {
            let v = towards(cosine, 0.4);
            let all = |v, l| bsdf.evaluate(Width::Wide, v, l) + bsdf.evaluate(Width::Narrow, v, l);
            for (other, phi) in [(0.1, 0.0), (0.5, 2.0), (0.9, 4.0)] {
                let l = towards(other, phi);
                let (there, back) = (all(v, l) / other, all(l, v) / cosine);
                let difference = (there - back).length();
                assert!(
                    difference <= 1e-9 * there.length(),
                    "{name}: {there} one way, {back} the other"
                );
            }
            let mut sum = 0.0;
            const SAMPLES: u32 = 4096;
            for index in 0..SAMPLES {
                let [u0, u1, ..] = Random::new(PathKind::Camera, index, 1, 0).next4();
                let branches = bsdf.branches(v, [u0, u1]);
                sum += branches.iter().map(|branch| branch.weight.x).sum::<f64>() / f64::from(SAMPLES);
            }
            // glTF's base gets what the boundary does not reflect at the half vector. At grazing angles that is more than what is
            // left.
            let most = if name.starts_with("glossy") && !name.contains("metal 1") {
                1.1
            } else {
                1.0
            };
            assert!(
                sum < most + 0.01,
                "{name}, cos {cosine}: {sum} of the light is scattered"
            );
        }
    }
}
