//! Spectral dispersion. `glsl/bsdf/dispersion.glsl` cites the sources.

use glam::{DVec3, dvec3};

use crate::layout::{DIELECTRIC, LONGEST_WAVELENGTH, Material, SHORTEST_WAVELENGTH};
use crate::random::Random;

/// A wavelength's linear sRGB colour; the mean over all wavelengths is 1 in each channel.
fn color_of(wavelength: f64) -> DVec3 {
    let lobe = |centre: f64, left: f64, right: f64| {
        let t = (wavelength - centre) * if wavelength < centre { left } else { right };
        (-0.5 * t * t).exp()
    };
    let x =
        1.056 * lobe(599.8, 0.0264, 0.0323) + 0.362 * lobe(442.0, 0.0624, 0.0374) - 0.065 * lobe(501.1, 0.0490, 0.0382);
    let y = 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322);
    let z = 1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725);
    let rgb = dvec3(
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266_0 * x + 1.876_010_8 * y + 0.041_556_0 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    );
    rgb.max(DVec3::ZERO) * dvec3(1.705_112_9, 2.599_647_8, 2.757_881_1)
}

/// KHR_materials_dispersion: Cauchy's equation through the index at 587.56 nm, with Abbe number 20 / dispersion.
pub fn ior_at(material: &Material, wavelength: f64) -> f64 {
    let (ior, micrometres) = (f64::from(material.ior), wavelength * 1e-3);
    let spread = (ior - 1.0) * f64::from(material.dispersion) / 20.0;
    (ior + spread * (0.523_655 / (micrometres * micrometres) - 1.5168)).max(1.0)
}

/// Chooses a wavelength (nm) at a path's first dispersive material. Returns a factor of the path's throughput.
pub fn disperse(material: &Material, wavelength: &mut Option<f64>, random: &mut Random) -> DVec3 {
    if wavelength.is_some() || material.surface != DIELECTRIC || material.dispersion <= 0.0 {
        return DVec3::ONE;
    }
    let chosen = SHORTEST_WAVELENGTH + (LONGEST_WAVELENGTH - SHORTEST_WAVELENGTH) * random.next4()[0];
    *wavelength = Some(chosen);
    color_of(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn all_wavelengths_together_are_white() {
        const COUNT: u32 = 100_000;
        let step = (LONGEST_WAVELENGTH - SHORTEST_WAVELENGTH) / f64::from(COUNT);
        let mean = (0..COUNT)
            .map(|i| color_of(SHORTEST_WAVELENGTH + (f64::from(i) + 0.5) * step))
            .sum::<DVec3>()
            / f64::from(COUNT);
        assert!((mean - DVec3::ONE).abs().max_element() < 1e-6, "{mean}");
    }

    #[test]
    fn the_index_has_the_abbe_number_that_dispersion_says() {
        let glass = Material {
            ior: 1.5,
            dispersion: 0.5,
            ..Material::zeroed()
        };
        let at = |nanometres| ior_at(&glass, nanometres);
        assert!((at(587.56) - 1.5).abs() < 1e-4, "{}", at(587.56));
        let abbe = (at(587.56) - 1.0) / (at(486.13) - at(656.27));
        assert!((abbe / 40.0 - 1.0).abs() < 1e-3, "{abbe}");
    }
}
