//! The features that a scene uses. Kernels are specialised for them: unused features are compiled out.

use super::part::Part;
use crate::layout::{
    BACKED, COINCIDENT, DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, Material, POINT_LIGHT, SEE_THROUGH, SPOT_LIGHT,
    ShadingTriangle, TEXTURED_TRIANGLE, TOUCHED, TRIANGLE_LIGHT, VISIBLE_LOBES, VisibleLobes,
};
use crate::scene::material_features;

/// Declares the features: the specialisation constant of each, and which materials use it.
macro_rules! features {
    ($($(#[$doc:meta])* $feature:ident: $constant:literal $(= $has:expr)?,)*) => {
        /// The features of a scene. Each is a specialisation constant of the stages that trace rays.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub struct SceneFeatures {
            $($(#[$doc])* pub $feature: bool,)*
        }

        const COUNT: usize = [$($constant),*].len();

        impl SceneFeatures {
            /// All features.
            pub const ALL: Self = Self { $($feature: true,)* };

            /// The name and value of each specialisation constant.
            pub fn constants(self) -> [(&'static str, bool); COUNT] {
                [$(($constant, self.$feature),)*]
            }

            /// From values in the order of [`SceneFeatures::constants`].
            pub fn of_constants(values: [bool; COUNT]) -> Self {
                let [$($feature,)*] = values;
                Self { $($feature,)* }
            }

            fn add_material(&mut self, material: &Material) {
                $($(
                    let has: fn(&Material) -> bool = $has;
                    self.$feature |= has(material);
                )?)*
            }
        }
    };
}

material_features! { features
    /// Dielectric faces that coincide with other faces.
    coincident_interfaces: "COINCIDENT_INTERFACES",
    /// Dielectrics inside others, or overlapping them.
    nested: "NESTED",
    /// Paths that start in a dielectric.
    immersed: "IMMERSED",
    /// Coincident faces.
    coincident_faces: "COINCIDENT_FACES",
    /// Point, spot and directional lights.
    punctual: "PUNCTUAL_LIGHTS",
    /// Some of those with an extent, or spots with a smooth falloff.
    soft: "SOFT_LIGHTS",
    /// Emissive triangles that are divided into several lights.
    parted: "PARTED_LIGHTS",
    /// Environment lighting.
    environment: "ENVIRONMENT",
    /// Textures or vertex colours.
    textured: "TEXTURED",
    /// Partly transparent surfaces (alpha).
    alpha: "ALPHA",
    /// Instances that share triangles.
    instanced: "INSTANCED",
    /// Several light sources, few enough that direct light samples each of them.
    few_sources: "FEW_SOURCES",
    /// So many light sources that direct light samples one, chosen by a bound of its contribution.
    many_sources: "MANY_SOURCES",
    /// The camera has a lens (depth of field).
    lens: "LENS",
}

impl Light {
    /// Whether it is a point, spot or directional light.
    pub(crate) fn is_punctual(&self) -> bool {
        [POINT_LIGHT, SPOT_LIGHT, DIRECTIONAL_LIGHT].contains(&self.kind)
    }

    fn is_smooth_spot(&self) -> bool {
        self.kind == SPOT_LIGHT && self.area > 0.0
    }

    /// Spot: 1 − cos of the angle of a spot with full intensity that has the same flux.
    pub(crate) fn full_versine(&self) -> f64 {
        let (inner, outer, smooth) = (f64::from(self.inner), f64::from(self.outer), f64::from(self.area));
        // The integral of the falloff over its width.
        inner + (outer - inner) * (1.0 / 3.0 + smooth / 6.0)
    }
}

impl SceneFeatures {
    /// The features of triangles, of their materials, and of lights.
    pub(crate) fn of(triangles: &[ShadingTriangle], materials: &[Material], lights: &[Light]) -> Self {
        let mut features = Self::default();
        for triangle in triangles {
            let material = &materials[triangle.material as usize];
            features.add_material(material);
            features.textured |= triangle.flags & TEXTURED_TRIANGLE != 0;
            features.alpha |= triangle.flags & SEE_THROUGH != 0;
            features.coincident_interfaces |= triangle.flags & TOUCHED != 0;
            features.coincident_faces |= triangle.flags & (COINCIDENT | BACKED) != 0;
        }
        for light in lights {
            features.punctual |= light.is_punctual();
            features.soft |= light.extent > 0.0 || light.is_smooth_spot();
            features.parted |= light.kind == TRIANGLE_LIGHT && !Part::of(light).is_whole();
            features.environment |= light.kind == ENVIRONMENT_LIGHT;
        }
        features
    }

    /// Those of this scene or of another.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        let [these, those] = [self, other].map(Self::constants);
        Self::of_constants(std::array::from_fn(|index| these[index].1 || those[index].1))
    }

    /// The lobes that the BSDFs of visible points can have.
    pub fn visible_lobes(self) -> VisibleLobes {
        let constants = self.constants();
        VISIBLE_LOBES.map(|lobe| constants.contains(&(lobe, true)))
    }

    /// A constant's name in messages.
    pub fn spell(constant: &str) -> String {
        constant.to_lowercase().replace('_', " ")
    }

    /// Names of the features that the scene uses.
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
