//! What of the renderer a scene needs: the kernels are specialised for it and have no code for the rest.

use crate::layout::{Material, ShadingTriangle, TOUCHED};

/// [`Material::surface`] of a mirror.
pub(super) const MIRROR: u32 = 1;
/// [`Material::surface`] of a dielectric.
pub(super) const DIELECTRIC: u32 = 2;
/// [`Material::surface`] of what reflects as microfacets do, over a Lambertian base.
pub(super) const GLOSSY: u32 = 3;

/// What a scene has. Each is a specialisation constant of the stages that trace rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SceneFeatures {
    /// Mirrors.
    pub mirror: bool,
    /// Boundaries of dielectrics.
    pub dielectric: bool,
    /// Microfacets.
    pub glossy: bool,
    /// Boundaries of dielectrics that lie on faces of other objects.
    pub contact: bool,
}

impl SceneFeatures {
    /// Everything that a scene can have.
    pub const ALL: Self = Self {
        mirror: true,
        dielectric: true,
        glossy: true,
        contact: true,
    };

    /// The features of what is seen: of materials that triangles have.
    pub(super) fn of(triangles: &[ShadingTriangle], materials: &[Material]) -> Self {
        let mut features = Self::default();
        for triangle in triangles {
            let surface = materials[triangle.material as usize].surface;
            features.mirror |= surface == MIRROR;
            features.dielectric |= surface == DIELECTRIC;
            features.glossy |= surface == GLOSSY;
            features.contact |= triangle.flags & TOUCHED != 0;
        }
        features
    }

    /// Each feature's constant in the kernels, and its value.
    pub fn constants(self) -> [(&'static str, bool); 4] {
        [
            ("MIRRORS", self.mirror),
            ("DIELECTRICS", self.dielectric),
            ("GLOSSY", self.glossy),
            ("CONTACT", self.contact),
        ]
    }

    /// Names of those that the scene has.
    pub fn names(self) -> Vec<String> {
        let present = self.constants().into_iter().filter(|(_, present)| *present);
        present.map(|(name, _)| name.to_lowercase()).collect()
    }
}
