//! What of the renderer a scene needs: the kernels are specialised for it and have no code for the rest.

use crate::layout::{
    DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, Material, NO_TEXTURE, POINT_LIGHT, SEE_THROUGH, SPOT_LIGHT,
    ShadingTriangle, TEXTURED, TOUCHED,
};

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
    /// Microfacets over a base.
    pub glossy: bool,
    /// Microfacets of dielectrics.
    pub rough_glass: bool,
    /// Dielectrics without an inside.
    pub thin_walls: bool,
    /// Dielectrics that pass a part of the light only.
    pub partly_clear: bool,
    /// Dielectrics that absorb light inside.
    pub absorption: bool,
    /// Dielectrics that bend each wavelength its own way.
    pub dispersion: bool,
    /// Boundaries of dielectrics that lie on faces of other objects.
    pub contact: bool,
    /// Lights that are points or directions.
    pub punctual: bool,
    /// An environment.
    pub environment: bool,
    /// Textures, or colours of corners.
    pub textured: bool,
    /// Surfaces that aren't there everywhere.
    pub alpha: bool,
    /// A lens before the camera that is rendered.
    pub lens: bool,
}

impl SceneFeatures {
    /// Everything that a scene can have.
    pub const ALL: Self = Self {
        mirror: true,
        dielectric: true,
        glossy: true,
        rough_glass: true,
        thin_walls: true,
        partly_clear: true,
        absorption: true,
        dispersion: true,
        contact: true,
        punctual: true,
        environment: true,
        textured: true,
        alpha: true,
        lens: true,
    };

    /// The features of what is seen, of materials that triangles have, and of the lights.
    pub(super) fn of(triangles: &[ShadingTriangle], materials: &[Material], lights: &[Light]) -> Self {
        let mut features = Self::default();
        for triangle in triangles {
            let material = &materials[triangle.material as usize];
            let glass = material.surface == DIELECTRIC;
            // Textures make less of a factor.
            let varies = |texture: u32| texture != NO_TEXTURE;
            let clear = material.transmission == 1.0 && material.metallic == 0.0;
            let mixed = glass && (!clear || varies(material.transmission_texture));
            features.mirror |= material.surface == MIRROR;
            features.dielectric |= glass;
            features.glossy |= material.surface == GLOSSY || mixed;
            features.rough_glass |= glass && material.roughness > 0.0;
            features.thin_walls |= glass && material.thin != 0;
            features.partly_clear |= mixed;
            features.absorption |= glass && material.absorption != [0.0; 3];
            features.dispersion |= glass && material.dispersion > 0.0;
            features.textured |= triangle.flags & TEXTURED != 0;
            features.alpha |= triangle.flags & SEE_THROUGH != 0;
            features.contact |= triangle.flags & TOUCHED != 0;
        }
        for light in lights {
            features.punctual |= [POINT_LIGHT, SPOT_LIGHT, DIRECTIONAL_LIGHT].contains(&light.kind);
            features.environment |= light.kind == ENVIRONMENT_LIGHT;
        }
        features
    }

    /// Each feature's constant in the kernels, and its value.
    pub fn constants(self) -> [(&'static str, bool); 14] {
        [
            ("MIRRORS", self.mirror),
            ("DIELECTRICS", self.dielectric),
            ("GLOSSY", self.glossy),
            ("ROUGH_GLASS", self.rough_glass),
            ("THIN_WALLS", self.thin_walls),
            ("PARTLY_CLEAR", self.partly_clear),
            ("ABSORPTION", self.absorption),
            ("DISPERSION", self.dispersion),
            ("CONTACT", self.contact),
            ("PUNCTUAL_LIGHTS", self.punctual),
            ("ENVIRONMENT", self.environment),
            ("TEXTURED", self.textured),
            ("ALPHA", self.alpha),
            ("LENS", self.lens),
        ]
    }

    /// Those of these values, in the order of [`SceneFeatures::constants`].
    pub fn of_constants(values: [bool; 14]) -> Self {
        let [
            mirror,
            dielectric,
            glossy,
            rough_glass,
            thin_walls,
            partly_clear,
            absorption,
            dispersion,
            contact,
            punctual,
            environment,
            textured,
            alpha,
            lens,
        ] = values;
        Self {
            mirror,
            dielectric,
            glossy,
            rough_glass,
            thin_walls,
            partly_clear,
            absorption,
            dispersion,
            contact,
            punctual,
            environment,
            textured,
            alpha,
            lens,
        }
    }

    /// A constant's name for people.
    pub fn spell(constant: &str) -> String {
        constant.to_lowercase().replace('_', " ")
    }

    /// Names of those that the scene has.
    pub fn names(self) -> Vec<String> {
        let present = self.constants().into_iter().filter(|(_, present)| *present);
        present.map(|(name, _)| Self::spell(name)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_in_the_order_of_the_constants_are_the_same_features() {
        for index in 0..SceneFeatures::ALL.constants().len() {
            let values = std::array::from_fn(|other| other == index);
            let constants = SceneFeatures::of_constants(values).constants();
            assert_eq!(constants.map(|(_, value)| value), values);
        }
    }
}
