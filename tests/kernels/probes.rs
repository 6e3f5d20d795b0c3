//! Single functions of the kernels, over lists of inputs, against the CPU's in f64.
//!
//! Tolerances follow from rounding: f32 keeps 6e-8 of a number. A few of those, of directions, are divided by whatever is small:
//! a cosine, GGX's α, the length of v + l. Where a number chooses (a microfacet at its pole, a texel, a light's part) rounding may
//! choose another one: those few may differ, and are counted.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3};
use ppm_vk::internals::config::{RenderConfig, Sampler};
use ppm_vk::internals::cpu;
use ppm_vk::internals::layout::{
    CAMERA_PATH, COVERAGE_SAMPLE, DIELECTRIC, GLOSSY_SURFACE, LIGHT_SAMPLE, Material, NO_TEXTURE, PHOTON_PATH,
    SMOOTH_ALPHA, SPECULAR_CHANGED,
};
use ppm_vk::internals::packing::SceneFeatures;
use ppm_vk::internals::random::{CameraTurn, PathKind, Random};
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::shaders;
use ppm_vk::internals::stage::{BufferId, Shader, StageDesc};

use super::agreement::{Agreement, relative_difference};
use super::bench::{Bench, random_numbers, small, xyz};

/// What a probe finds for each of these.
pub fn probe<A: Pod, F: Pod>(
    bench: &mut Bench,
    shader: &'static Shader,
    features: SceneFeatures,
    sampler: Sampler,
    asked: &[A],
) -> Vec<F> {
    let count = asked.len();
    let gpu = bench.renderer.gpu();
    gpu.upload(BufferId::ProbeFrom, asked).expect("an upload");
    gpu.create(BufferId::ProbeTo, (count * size_of::<F>()) as u64)
        .expect("a buffer");
    let constants = features.constants().map(|(name, present)| (name, u32::from(present)));
    let constants: Vec<_> = [("SAMPLER", sampler as u32)].into_iter().chain(constants).collect();
    let mut recording = Recording::new();
    recording.dispatch(
        StageDesc::new(shader, count as u32)
            .constants(constants)
            .push(shaders::CountPush { count: count as u32 }),
    );
    gpu.run(&recording).expect("a run");
    gpu.download(BufferId::ProbeTo, Some(count)).expect("a download")
}

fn four(v: DVec3, w: f32) -> [f32; 4] {
    v.as_vec3().extend(w).to_array()
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct AskedRandom {
    kind: u32,
    path: u32,
    iteration: u32,
    number: u32,
    paths: u32,
    seed: u32,
    dimension: u32,
    sampled: u32,
}

#[test]
fn random_numbers_are_the_same_to_the_last_bit() {
    let mut bench = Bench::new("cornell", small());
    for sampler in [Sampler::Sobol, Sampler::Independent, Sampler::Congruential] {
        let config = RenderConfig {
            sampler,
            ..bench.config.clone()
        };
        let (mut asked, mut expected) = (Vec::new(), Vec::new());
        for (i, [a, b, c, d]) in (0..20_000u32).zip(random_numbers(20_000)) {
            let config = RenderConfig {
                seed: (d * 4e9) as u32,
                photons: 1 + (a * 1e6) as u32,
                ..config.clone()
            };
            // Small ones and large ones.
            let path = ((1u64 << (1 + i % 31)) as f32 * a) as u32;
            let iteration = (100_000.0 * b * b) as u32;
            let paths = 1 + (7.0 * c) as u32;
            let turn = CameraTurn {
                iteration,
                path: i % paths,
                paths,
            };
            let dimension = i / 4 % 7;
            let sampled = i % paths;
            let (kind, number, paths, mut random) = match i % 4 {
                0 => (
                    CAMERA_PATH,
                    turn.path,
                    paths,
                    Random::of_pixel(&config, PathKind::Camera, path, turn),
                ),
                1 => (
                    LIGHT_SAMPLE,
                    turn.path,
                    paths,
                    Random::of_pixel(&config, PathKind::LightSample, path, turn),
                ),
                2 => {
                    let (block, first) = (config.block_of(iteration), config.first_of_sequence(iteration));
                    (PHOTON_PATH, block, first, Random::of_photon(&config, path, iteration))
                }
                _ => {
                    let random = Random::of_disc(&config, path, iteration, paths);
                    (COVERAGE_SAMPLE, 0, paths, random.sample_of(sampled, paths))
                }
            };
            asked.push(AskedRandom {
                kind,
                path,
                iteration,
                number,
                paths,
                seed: config.seed,
                dimension,
                sampled,
            });
            let quadruple = (0..=dimension).map(|_| random.next4()).last().expect("one");
            expected.push((quadruple, random.number_of([3, 5])));
        }
        let features = SceneFeatures::default();
        let found: Vec<[[f32; 4]; 2]> = probe(&mut bench, &shaders::RANDOM_PROBE, features, sampler, &asked);
        for ((asked, found), (quadruple, number)) in asked.iter().zip(&found).zip(&expected) {
            assert_eq!(found[0].map(f64::from), *quadruple, "{sampler:?}, {asked:?}");
            assert_eq!(
                f64::from(found[1][0]),
                *number,
                "{sampler:?}, number of a thing, {asked:?}"
            );
        }
    }
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct AskedBsdf {
    material: Material,
    geometric: [f32; 4],
    shading: [f32; 4],
    coat: [f32; 4],
    incoming: [f32; 4],
    towards: [f32; 4],
    u: [f32; 4],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct FoundBsdf {
    brdf: [f32; 4],
    scattered: [f32; 4],
    outgoing: [f32; 4],
    reflected: [f32; 4],
    refracted: [f32; 4],
    reflected_weight: [f32; 4],
    refracted_weight: [f32; 4],
    glass: [f32; 4],
    layer: [f32; 4],
    layer_normal: [f32; 4],
}

/// A direction of length 1 from two numbers.
fn direction(u: f32, v: f32) -> DVec3 {
    let (z, phi) = (2.0 * f64::from(u) - 1.0, std::f64::consts::TAU * f64::from(v));
    let across = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(across * phi.cos(), across * phi.sin(), z)
}

/// Materials of every roughness, on leaning surfaces, seen from all angles up to grazing ones.
fn bsdfs(count: u32) -> Vec<AskedBsdf> {
    let numbers: Vec<[f32; 4]> = random_numbers(6 * count).collect();
    let of_numbers = |(i, n): (usize, &[[f32; 4]])| {
        let geometric = direction(n[0][0], n[0][1]);
        let lean = |u: f32, v: f32| (geometric + 0.2 * direction(u, v)).normalize();
        // Every third is seen at a grazing angle.
        let toward = direction(n[1][0], n[1][1]);
        let toward = if toward.dot(geometric) < 0.0 { -toward } else { toward };
        let flat = (toward - toward.dot(geometric) * geometric).normalize();
        let v = if i % 3 == 0 {
            (flat + 10f64.powf(-4.0 * f64::from(n[1][2])) * geometric).normalize()
        } else {
            toward
        };
        let shading = if i % 2 == 0 { lean(n[2][0], n[2][1]) } else { geometric };
        // Half of the lights are seen near the mirrored direction.
        let l = direction(n[2][2], n[2][3]);
        let mirrored = 2.0 * v.dot(shading) * shading - v;
        let l = if i / 2 % 2 == 0 {
            (mirrored + 0.1 * l).normalize()
        } else {
            l
        };
        let roughness = [0.0, 0.02, 0.032, 0.1, 0.316, 0.7, 1.0][i % 7];
        let material = Material {
            base_color: [n[3][0], n[3][1], n[3][2]],
            surface: if i % 5 < 2 { GLOSSY_SURFACE } else { DIELECTRIC },
            ior: 1.0 + 1.5 * n[3][3],
            flags: if i % 4 == 0 { SPECULAR_CHANGED } else { 0 },
            metallic: n[4][0] * f32::from(u8::from(i % 3 == 0)),
            roughness,
            transmission: 1.0,
            specular_f0: [0.04 + 0.2 * n[4][1], 0.04, 0.04],
            specular_f90: n[4][2],
            thin: u32::from(i % 6 == 5),
            dispersion: n[4][3] * f32::from(u8::from(i % 5 == 0)),
            coat: n[5][0] * f32::from(u8::from(i % 2 == 0)),
            coat_roughness: [0.0, 0.1, 0.5][i % 3],
            sheen_color: [n[5][3], n[4][1], n[3][2]].map(|value| value * f32::from(u8::from(i % 3 == 1))),
            sheen_roughness: n[1][1],
            anisotropy: n[5][2] * f32::from(u8::from(i % 4 == 3)),
            anisotropy_direction: cpu::encode_direction(direction(n[2][2], n[1][3])),
            color_texture: NO_TEXTURE,
            ..Material::zeroed()
        };
        // The kernels face a normal to the ray: the back too.
        let incoming = if i % 4 < 2 { -v } else { v };
        let outside = if i % 7 == 3 { 1.33 } else { 1.0 };
        AskedBsdf {
            material,
            geometric: four(geometric, outside),
            shading: four(shading, 0.0),
            coat: four(lean(n[5][1], n[5][2]), 0.0),
            incoming: four(incoming, if i % 3 == 1 { 400.0 + 300.0 * n[0][2] } else { 0.0 }),
            towards: four(l, 0.0),
            u: [n[0][3], n[1][3], n[5][3], n[0][2]],
        }
    };
    numbers.chunks_exact(6).enumerate().map(of_numbers).collect()
}

/// The f64 view of a probe's input.
struct Case {
    normals: cpu::Normals,
    v: DVec3,
    l: DVec3,
    u: [f64; 4],
    material: Material,
    /// At its wavelength.
    glass: cpu::Glass,
    ior: f64,
}

impl Case {
    fn of(asked: &AskedBsdf) -> Self {
        let v = -xyz(asked.incoming);
        let normals = cpu::Normals::of([asked.geometric, asked.shading, asked.coat].map(xyz), v);
        let wavelength = Some(f64::from(asked.incoming[3])).filter(|&wavelength| wavelength > 0.0);
        let ior = wavelength.map_or(asked.material.ior.into(), |wavelength| {
            cpu::ior_at(&asked.material, wavelength)
        });
        let material = Material {
            ior: ior as f32,
            ..asked.material
        };
        Self {
            glass: cpu::Glass::new(&material, asked.geometric[3].into(), normals.front),
            normals,
            v,
            l: xyz(asked.towards),
            u: asked.u.map(f64::from),
            material: asked.material,
            ior,
        }
    }

    /// What some roundings of directions are of a lobe's value, at most.
    fn tolerance(&self, l: DVec3) -> f64 {
        let n = self.normals.shading;
        let alpha = f64::from(self.material.roughness).powi(2).max(SMOOTH_ALPHA);
        let narrow = 1.0 / (alpha * (self.v + l).length().max(1e-6));
        // The sheen's power of a sine: its rounding grows with the exponent.
        let has_sheen = self.material.sheen_color != [0.0; 3];
        let sheen = f64::from(self.material.sheen_roughness).max(0.1).powi(-2);
        let narrow = narrow + if has_sheen { sheen } else { 0.0 };
        2e-6 * (2.0 + narrow + 1.0 / n.dot(self.v).abs().max(1e-9) + 1.0 / n.dot(l).abs().max(1e-9))
    }
}

fn bsdf_probe(count: u32) -> Vec<(AskedBsdf, FoundBsdf, Case)> {
    let mut bench = Bench::new("cornell", small());
    let asked = bsdfs(count);
    let found = probe(
        &mut bench,
        &shaders::BSDF_PROBE,
        SceneFeatures::ALL,
        Sampler::Independent,
        &asked,
    );
    let cases = asked.iter().map(Case::of).collect::<Vec<_>>();
    asked
        .into_iter()
        .zip(found)
        .zip(cases)
        .map(|((asked, found), case)| (asked, found, case))
        .collect()
}

const COUNT: u32 = 20_000;

#[test]
fn brdfs_and_the_densities_of_reflections_are_those_of_f64() {
    let (mut values, mut densities, mut chances) = Default::default();
    let (values, densities, chances): (&mut Agreement, &mut Agreement, &mut Agreement) =
        (&mut values, &mut densities, &mut chances);
    for (asked, found, case) in bsdf_probe(COUNT) {
        let reflector = cpu::Reflector::glossy(&case.material);
        let n = case.normals.shading;
        let tolerance = case.tolerance(case.l);
        if n.dot(case.l) > 1e-6 {
            let expected = reflector.brdf(n, case.v, case.l);
            let error = (xyz(found.brdf) - expected).length();
            values.note(error <= tolerance * expected.length(), || {
                format!(
                    "{:?} instead of {expected}, {tolerance:e} tolerated, {asked:?}",
                    found.brdf
                )
            });
            if !reflector.is_smooth() {
                let expected = reflector.reflected_density(n, case.v, case.l);
                let difference = relative_difference(found.brdf[3].into(), expected);
                densities.note(difference <= tolerance, || {
                    format!(
                        "density {} instead of {expected}, {tolerance:e} tolerated, {asked:?}",
                        found.brdf[3]
                    )
                });
            }
        }
        let expected = reflector.reflection_probability(n.dot(case.v));
        let difference = (f64::from(found.scattered[3]) - expected).abs();
        chances.note(difference < 2e-6, || {
            format!("{} instead of {expected}, {asked:?}", found.scattered[3])
        });
    }
    values.assert("BRDFs", 1.0, 8000);
    densities.assert("densities", 1.0, 6000);
    chances.assert("probabilities of reflection", 1.0, COUNT as usize);
}

/// The direction is that of the same numbers, and what goes there is BRDF · cos over the density of both ways to choose it.
#[test]
fn scattered_photons_carry_brdf_times_cosine_over_density() {
    let mut agreement = Agreement::default();
    for (asked, found, case) in bsdf_probe(COUNT) {
        let reflector = cpu::Reflector::glossy(&case.material);
        let (n, geometric, v) = (case.normals.shading, case.normals.geometric, case.v);
        let p = f64::from(found.scattered[3]);
        if reflector.is_smooth() || (case.u[3] - p).abs() < 1e-5 {
            continue;
        }
        let by_cosine = cpu::cosine_direction(geometric, case.u[2], case.u[1]);
        let expected = if case.u[3] < p {
            reflector.reflected_direction(n, v, [case.u[0], case.u[1]])
        } else {
            by_cosine
        };
        let l = xyz(found.outgoing);
        let cosine = l.dot(geometric).max(0.0);
        let density = (1.0 - p) * cosine / std::f64::consts::PI + p * reflector.reflected_density(n, v, l);
        let weight = reflector.brdf(n, v, l) * cosine / density.max(1e-20);
        let (error, tolerance) = ((xyz(found.scattered) - weight).length(), case.tolerance(l));
        let above = n.dot(l) > 1e-5 && cosine > 1e-5;
        // Microfacets at the pole have a root of a rounding.
        let same = l.distance(expected) < 1e-3 && (!above || error <= 2.0 * tolerance * weight.length() + 1e-6);
        agreement.note(same, || {
            format!(
                "{:?} of {weight}, direction {l} instead of {expected}, {asked:?}",
                found.scattered
            )
        });
    }
    agreement.assert("scattered photons", 0.999, 10_000);
}

#[test]
fn boundaries_of_glass_are_those_of_f64() {
    let (mut samples, mut values) = (Agreement::default(), Agreement::default());
    let mut total = 0;
    for (asked, found, case) in bsdf_probe(COUNT) {
        let (n, geometric, v) = (case.normals.shading, case.normals.geometric, case.v);
        assert!(
            (f64::from(found.outgoing[3]) - case.ior).abs() < 1e-6,
            "index {} of {asked:?}",
            found.outgoing[3]
        );
        let expected = case.glass.sample(n, geometric, v, [case.u[0], case.u[1]]);
        // Next to the critical angle reflectance has an infinite slope.
        let reflectance = expected.reflected.probability;
        let steep = (1.0 - reflectance).max(1e-6);
        let tolerance = 1e-5 + 3e-6 / steep + 1e-6 / n.dot(v).max(1e-6);
        let near = |found: [f32; 4], expected: DVec3, tolerance: f64| xyz(found).distance(expected) <= tolerance;
        // Of power: what is hardly ever chosen may weigh much.
        let near_weight = |found: [f32; 4], sample: cpu::DielectricSample| {
            xyz(found).distance(sample.weight) * sample.probability
                <= tolerance.max(1e-3) * (1.0 + sample.weight.length())
        };
        let mut same = (f64::from(found.reflected[3]) - reflectance).abs() <= tolerance
            && near(found.reflected, expected.reflected.direction, 1e-3)
            && near_weight(found.reflected_weight, expected.reflected);
        if let Some(refracted) = expected.refracted {
            same &= near(found.refracted, refracted.direction, 1e-3 + tolerance)
                && near_weight(found.refracted_weight, refracted);
        } else {
            total += 1;
        }
        samples.note(same, || format!("{found:?} instead of {expected:?}, {asked:?}"));
        let (value, _) = case.glass.evaluate(n, geometric, v, case.l);
        let flat = n.dot(v) < 1e-4 || n.dot(case.l).abs() < 1e-4;
        if value.length() > 1e-6 && !flat {
            let error = xyz(found.glass).distance(value) / value.length();
            let alpha = f64::from(case.material.roughness).powi(2);
            // The half vector of refraction is a difference where the index is near 1.
            let tolerance = tolerance + 2e-5 / (alpha * (case.ior - 1.0).clamp(1e-3, 1.0)) + 1e-5 / n.dot(case.l).abs();
            values.note(error <= tolerance, || {
                format!(
                    "{:?} instead of {value}, off by {error:e}, {tolerance:e} tolerated, {asked:?}",
                    found.glass
                )
            });
        }
    }
    samples.assert("boundaries", 0.998, COUNT as usize);
    values.assert("lobes of rough glass", 0.999, 1500);
    assert!(total > 300, "only {total} total reflections");
}

/// A layer is chosen with the probability that its factor divides by.
#[test]
fn coats_are_chosen_as_often_as_their_factor_says() {
    let mut bench = Bench::new("cornell", small());
    let mut asked = bsdfs(4000);
    let mut coated = 0;
    let mut layers = |asked: &[AskedBsdf]| -> Vec<FoundBsdf> {
        probe(
            &mut bench,
            &shaders::BSDF_PROBE,
            SceneFeatures::ALL,
            Sampler::Independent,
            asked,
        )
    };
    asked.iter_mut().for_each(|asked| asked.u[2] = 0.0);
    let coats = layers(&asked);
    asked.iter_mut().for_each(|asked| asked.u[2] = 0.999_999);
    let bases = layers(&asked);
    for ((asked, coat), base) in asked.iter().zip(&coats).zip(&bases) {
        let case = Case::of(asked);
        let has_coat = case.material.coat > 0.0
            && (case.normals.front || case.material.surface != DIELECTRIC || case.material.thin != 0);
        assert_eq!(coat.layer[3] > 0.0, has_coat, "{asked:?}");
        if has_coat {
            coated += 1;
            let sum = 1.0 / f64::from(coat.layer[0]) + 1.0 / f64::from(base.layer[0]);
            assert!((sum - 1.0).abs() < 1e-5, "{coat:?}, {base:?}, {asked:?}");
            let distance = xyz(coat.layer_normal).distance(case.normals.coat);
            assert!(distance < 1e-6, "{coat:?} instead of {:?}, {asked:?}", case.normals);
        } else {
            assert_eq!((coat.layer[0], base.layer[0]), (1.0, 1.0), "{asked:?}");
        }
        let distance = xyz(base.layer_normal).distance(case.normals.shading);
        assert!(distance < 1e-6, "{base:?} instead of {:?}, {asked:?}", case.normals);
    }
    assert!(coated > 1000, "only {coated} coats");
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct AskedLight {
    point: [f32; 4],
    direction: [f32; 4],
    u: [f32; 4],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct FoundLight {
    ray: [f32; 4],
    irradiance: [f32; 4],
    sampled: [f32; 4],
    radiance: [f32; 4],
    seen: [f32; 4],
}

/// From afar, from beside a light, and from within one.
#[test]
fn light_that_arrives_is_that_of_f64() {
    for name in ["cornell, lit", "cornell, softly lit"] {
        let mut bench = Bench::new(name, small());
        let lights = bench.scene.lights.clone();
        let numbers: Vec<[f32; 4]> = random_numbers(3 * 8000).collect();
        let asked: Vec<AskedLight> = (0..)
            .zip(numbers.chunks_exact(3))
            .map(|(i, n)| {
                let index = i % lights.len();
                let position = Vec3::from(lights[index].position);
                let near = [1.0, 0.1, 1e-3][i / lights.len() % 3];
                let point = position + near * (2.0 * Vec3::new(n[0][0], n[0][1], n[0][2]) - 1.0);
                AskedLight {
                    point: point.extend(f32::from_bits(index as u32)).to_array(),
                    direction: four(direction(n[1][0], n[1][1]), 0.0),
                    u: n[2],
                }
            })
            .collect();
        let (features, sampler) = (bench.scene.features, bench.config.sampler);
        let found: Vec<FoundLight> = probe(&mut bench, &shaders::LIGHT_PROBE, features, sampler, &asked);
        let environment = cpu::Environment::of(&bench.scene.environment);
        let (mut arriving, mut skies) = (Agreement::default(), Agreement::default());
        for (asked, found) in asked.iter().zip(&found) {
            let light = &lights[asked.point[3].to_bits() as usize];
            let u = DVec2::from([asked.u[0], asked.u[1]].map(f64::from));
            if found.irradiance[3] > 0.0 {
                let point = xyz(asked.point);
                let (ray, end, irradiance) = cpu::punctual(light, point, u);
                // Coordinates are rounded before they are subtracted. A spot's falloff is steep.
                let rounding = 2e-7
                    / (xyz(asked.point) - Vec3::from(light.position).as_dvec3())
                        .length()
                        .max(1e-6);
                let rounding = 4e-6 + 8.0 * rounding / f64::from(light.outer - light.inner).max(0.05);
                let same = xyz(found.ray).distance(ray) <= (2e-5 + rounding) * ray.length()
                    && relative_difference(found.ray[3].into(), end) < 1e-6
                    && xyz(found.irradiance).distance(irradiance)
                        <= 10.0 * rounding * (irradiance.length() + 1e-3 * Vec3::from(light.intensity).length() as f64);
                arriving.note(same, || {
                    format!("{found:?} instead of {ray}, end {end}, irradiance {irradiance}, {asked:?}, {light:?}")
                });
            }
            let (towards, sky) = environment.sample(asked.u[2].into(), asked.u[3].into());
            let seen = environment.at(xyz(asked.direction));
            let near = |found: f32, expected: f64| relative_difference(found.into(), expected) < 1e-4;
            // Radiance differs by 200 from one pixel to the next, and arctangents tell places to a few 1e-5 of a pixel.
            let near_radiance = |found: [f32; 4], expected: DVec3| xyz(found).distance(expected) < 5e-3;
            let same = xyz(found.sampled).distance(towards) < 1e-5
                && near(found.sampled[3], sky.density)
                && near_radiance(found.radiance, sky.radiance)
                && near_radiance(found.seen, seen.radiance)
                && near(found.seen[3], seen.density);
            skies.note(same, || format!("{found:?} instead of {towards}, {sky:?}, {seen:?}"));
        }
        arriving.assert(&format!("light that arrives in {name}"), 0.999, 4000);
        skies.assert(&format!("the environment in {name}"), 0.999, 8000);
    }
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct AskedSurface {
    triangle: u32,
    instance: u32,
    u: f32,
    v: f32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct FoundSurface {
    position: [f32; 4],
    geometric_normal: [f32; 4],
    shading_normal: [f32; 4],
    coat_normal: [f32; 4],
    base_color: [f32; 4],
    emission: [f32; 4],
    specular: [f32; 4],
    others: [f32; 4],
    direction: [f32; 4],
}

#[test]
fn surfaces_are_what_their_textures_say_in_f64() {
    for name in [
        "textures",
        "coats",
        "instances",
        "glasses",
        "cornell-spheres, patterned",
        "textures, brushed",
        "instances, brushed",
        "glasses, brushed",
    ] {
        let mut bench = Bench::new(name, small());
        let own = bench.scene.own_triangles;
        let asked: Vec<AskedSurface> = random_numbers(20_000)
            .map(|[a, b, u, v]| {
                let instances = &bench.scene.instances;
                let placed = !instances.is_empty() && b < 0.5;
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                if placed {
                    let index = (2.0 * b * instances.len() as f32) as usize;
                    let instance = &instances[index];
                    let triangle = instance.first_triangle + (a * instance.triangle_count as f32) as u32;
                    return AskedSurface {
                        triangle,
                        instance: index as u32,
                        u,
                        v,
                    };
                }
                AskedSurface {
                    triangle: (a * own as f32) as u32,
                    instance: u32::MAX,
                    u,
                    v,
                }
            })
            .collect();
        let (features, sampler) = (bench.scene.features, bench.config.sampler);
        let found: Vec<FoundSurface> = probe(&mut bench, &shaders::SURFACE_PROBE, features, sampler, &asked);
        let mut agreement = Agreement::default();
        for (asked, found) in asked.iter().zip(&found) {
            let at = cpu::PlacedTriangle {
                triangle: asked.triangle,
                instance: (asked.instance != u32::MAX).then_some(asked.instance),
            };
            let mut surface = cpu::surface_at(&bench.scene, at, asked.u.into(), asked.v.into());
            let share = cpu::opacity(&bench.scene, &surface);
            cpu::apply_textures(&bench.scene, &mut surface);
            let material = &surface.material;
            let rgbw = |rgb: [f32; 3], w: f32| [rgb[0], rgb[1], rgb[2], w];
            // Between texels values are as steep as a texel is wide: places are rounded by a few 1e-7 of a texture's width.
            let near = |found: [f32; 4], expected: [f32; 4]| {
                found
                    .iter()
                    .zip(expected)
                    .all(|(a, b)| (a - b).abs() <= 2e-4 * (1.0 + b.abs()))
            };
            let same = xyz(found.position).distance(surface.position) < 1e-6
                && (f64::from(found.position[3]) - share).abs() < 2e-4
                && xyz(found.geometric_normal).distance(surface.geometric_normal) < 1e-4
                && xyz(found.shading_normal).distance(surface.shading_normal) < 1e-3
                && xyz(found.coat_normal).distance(surface.coat_normal) < 1e-3
                && near(found.base_color, rgbw(material.base_color, material.roughness))
                && near(found.emission, rgbw(material.emission, material.metallic))
                && near(found.specular, rgbw(material.specular_f0, material.specular_f90))
                && near(
                    found.others,
                    [
                        material.transmission,
                        material.coat,
                        material.coat_roughness,
                        material.anisotropy,
                    ],
                )
                && (material.anisotropy == 0.0
                    || xyz(found.direction).distance(cpu::decode_direction(material.anisotropy_direction)) < 1e-3);
            agreement.note(same, || format!("{found:?} instead of {surface:?}, {share} there"));
        }
        // Slivers have uncertain normals; a nearest texel may be the next one.
        agreement.assert(&format!("surfaces of {name}"), 0.998, 20_000);
    }
}
