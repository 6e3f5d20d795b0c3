//! Photon paths, from lights chosen by their power.

use glam::{DVec2, DVec3};

use super::bsdf::choose;
use super::dispersion::disperse;
use super::emission::{Emission, choose_by_power, sample_emission};
use super::interaction::Interaction;
use super::lights::range_window;
use super::media::{Media, transmittance};
use super::sampling::encode_direction;
use super::texture::nearest_visible;
use super::{FAR, Inputs};
use crate::config::Direct;
use crate::layout::Photon;
use crate::random::Random;

/// How a path ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// It left the scene or was absorbed.
    Absorbed,
    /// By the bounce limit.
    Truncated,
    /// Its flux is not finite.
    NonFinite,
}

/// Traces a photon path of an iteration, and appends the photons that it deposits on receivers.
pub fn trace_photon_path(inputs: &Inputs<'_>, path: u32, iteration: u32, photons: &mut Vec<Photon>) -> Ending {
    let samples_lights = inputs.config.direct == Direct::Light;
    let mut random = Random::of_photon(inputs.config, path, iteration);
    let (u, w) = (random.next4(), random.next4());
    let (light, rest) = choose_by_power(&inputs.scene.lights, u[0], [w[0], w[2]]);
    let chosen = &inputs.scene.lights[light as usize];
    let (place, direction) = (DVec2::new(rest, u[1]), DVec2::new(u[2], u[3]));
    let Emission {
        mut ray,
        flux,
        mut ignored,
    } = sample_emission(inputs, light, place, direction, w[1]);
    let mut flux = flux / f64::from(chosen.probability);
    let mut media = Media::of(inputs.scene.media_of_lights[light as usize]);
    let mut inverse_range = f64::from(chosen.inverse_range);
    let mut wavelength = None;
    // No bounce since the light: light samples account for this light.
    let mut is_direct = true;
    let mut depth = 0;
    while depth < inputs.settings.max_depth {
        if flux.max_element() <= 0.0 {
            return Ending::Absorbed;
        }
        let Some(hit) = nearest_visible(inputs, ray, FAR, ignored, &random) else {
            return Ending::Absorbed;
        };
        let incoming = ray.direction;
        let met = Interaction::new(inputs, hit, incoming, media, false, &random);
        // A range limits the light itself, not the light that surfaces scatter.
        flux *= transmittance(inputs, met.through, hit.t) * range_window(inverse_range, hit.t);
        ignored = Some(met.surface.triangle);
        if met.hidden {
            flux *= met.tint;
            media = met.beyond;
            is_direct = false;
            ray.origin = met.surface.origin_towards(incoming);
            continue;
        }
        depth += 1;
        flux *= disperse(&met.surface.material, &mut wavelength, &mut random);
        let (v, bsdf) = (-incoming, met.bsdf(wavelength));
        // The adjoint BSDF, because flux is per area of the geometric surface: Veach, «Robust Monte Carlo Methods for Light
        // Transport Simulation», 1997, section 5.3.
        let arriving = |normal: DVec3| v.dot(normal) / v.dot(met.normals.geometric);
        if bsdf.is_receiver() && !(samples_lights && is_direct) {
            // Camera paths see a partly transparent surface with the same probability as photons hit it.
            let landing = flux * arriving(met.normals.shading) / met.opacity;
            if !landing.as_vec3().is_finite() {
                return Ending::NonFinite;
            }
            photons.push(Photon {
                position: met.surface.position.as_vec3().into(),
                object: met.surface.object,
                flux: landing.as_vec3().into(),
                direction: encode_direction(incoming),
            });
        }
        let [place, turn, choice, survival] = random.next4();
        let branches = bsdf.branches(v, [place, turn]);
        let Some(branch) = choose(&branches, choice) else {
            return Ending::Absorbed;
        };
        let mut scattered = flux * branch.weight / branch.probability;
        if scattered != DVec3::ZERO {
            // The cosines of a mirror to the shading normal cancel.
            let is_mirrored = branch.is_delta && branch.passes.is_none();
            let of_shading = if is_mirrored { v } else { branch.direction }
                .dot(branch.normal)
                .abs()
                .max(1e-6);
            scattered *= arriving(branch.normal) * branch.direction.dot(met.normals.geometric).abs() / of_shading;
        }
        // Russian roulette that keeps the photons' powers similar.
        let probability = (scattered.max_element() / flux.max_element()).min(1.0);
        if survival >= probability {
            return Ending::Absorbed;
        }
        flux = scattered / probability;
        ray.origin = met.surface.origin_towards(branch.direction);
        ray.direction = branch.direction;
        media = if branch.passes.is_some() {
            met.beyond
        } else {
            met.through
        };
        is_direct = false;
        inverse_range = 0.0;
    }
    Ending::Truncated
}
