//! The paper's equations 2, 3 and 4.

use std::f64::consts::PI;

use glam::{DVec3, Vec4};
use serde::{Deserialize, Serialize};

use crate::layout::{self, SMALLEST_RADIUS2};

/// Photon statistics of a visible point over all iterations.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// R².
    pub radius2: f64,
    /// Number of photons: N is α times this, the sum of equation 2's recurrence.
    pub accepted: u64,
    /// τ.
    pub flux: DVec3,
}

impl Statistics {
    /// Equations 2 and 3: adds M photons with their flux, and shrinks the disc.
    pub fn take(&mut self, photons: u32, flux: DVec3, alpha: f64) {
        if photons == 0 {
            return;
        }
        let (n, m) = (alpha * self.accepted as f64, f64::from(photons));
        let ratio = (n + alpha * m) / (n + m);
        let ratio = if self.radius2 * ratio < SMALLEST_RADIUS2 {
            1.0
        } else {
            ratio
        };
        self.radius2 *= ratio;
        self.flux = (self.flux + flux) * ratio;
        self.accepted += u64::from(photons);
    }

    /// Equation 4, for this number of emitted paths. `covered`: the fraction of the disc that can receive photons.
    pub fn radiance(&self, covered: f64, emitted: u64) -> DVec3 {
        if self.radius2 > 0.0 {
            self.flux / (PI * self.radius2 * covered * emitted as f64)
        } else {
            DVec3::ZERO
        }
    }
}

/// From the kernels' statistics, without the flux's curvature.
impl From<&layout::Statistics> for Statistics {
    fn from(statistics: &layout::Statistics) -> Self {
        let flux = Vec4::from(statistics.flux_high).as_dvec4() + Vec4::from(statistics.flux_low).as_dvec4();
        Self {
            radius2: f64::from(statistics.radius2_high) + f64::from(statistics.radius2_low),
            accepted: statistics.accepted(),
            flux: flux.truncate(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disc_shrinks_so_that_the_density_of_its_photons_is_kept() {
        let (alpha, photons) = (2.0 / 3.0, 9);
        let mut statistics = Statistics {
            radius2: 4.0,
            ..Statistics::default()
        };
        statistics.take(photons, DVec3::ONE, alpha);
        // Initially N = 0. M = 9, and 6 of these photons remain.
        assert!((statistics.radius2 - 4.0 * alpha).abs() < 1e-15);
        assert!((statistics.flux - DVec3::splat(alpha)).length() < 1e-15);
        let before = statistics;
        statistics.take(3, DVec3::ONE, alpha);
        let ratio = (6.0 + 2.0) / (6.0 + 3.0);
        assert!((statistics.radius2 / before.radius2 - ratio).abs() < 1e-15);
        assert!((statistics.flux / (before.flux + 1.0) - ratio).length() < 1e-15);
        let kept = statistics;
        statistics.take(0, DVec3::ZERO, alpha);
        assert_eq!(statistics, kept, "N = M = 0 leaves all as it is");
    }

    #[test]
    fn radiance_is_flux_over_area_and_paths() {
        let statistics = Statistics {
            radius2: 0.25,
            accepted: 1,
            flux: DVec3::splat(PI),
        };
        assert!((statistics.radiance(0.5, 16) - 0.5).length() < 1e-15);
    }
}
