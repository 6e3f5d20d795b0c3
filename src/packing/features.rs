//! What of the renderer a scene needs: the kernels are specialised for it and have no code for the rest.

use super::part::Part;
use crate::layout::{
    BACKED, COINCIDENT, DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, Material, POINT_LIGHT, SEE_THROUGH, SPOT_LIGHT,
    ShadingTriangle, TEXTURED_TRIANGLE, TOUCHED, TRIANGLE_LIGHT, VISIBLE_LOBES, VisibleLobes,
};
use crate::scene::material_features;

/// Declares the features, each with its constant in the kernels, and with the materials' records that have it.
macro_rules! features {
    ($($(#[$doc:meta])* $feature:ident: $constant:literal $(= $has:expr)?,)*) => {
        /// What a scene has. Each is a specialisation constant of the stages that trace rays.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub struct SceneFeatures {
            $($(#[$doc])* pub $feature: bool,)*
        }

        const COUNT: usize = [$($constant),*].len();

        impl SceneFeatures {
            /// Everything that a scene can have.
            pub const ALL: Self = Self { $($feature: true,)* };

            /// Each feature's constant in the kernels, and its value.
            pub fn constants(self) -> [(&'static str, bool); COUNT] {
                [$(($constant, self.$feature),)*]
            }

            /// Those of these values, in the order of [`SceneFeatures::constants`].
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
    /// Boundaries of dielectrics that lie on other faces.
    contact: "CONTACT",
    /// Dielectrics inside of others, or overlapping them.
    nested: "NESTED",
    /// Paths that start in a dielectric.
    immersed: "IMMERSED",
    /// Faces in one place.
    coincidence: "COINCIDENCE",
    /// Lights that are points or directions.
    punctual: "PUNCTUAL_LIGHTS",
    /// Some of those with an extent.
    soft: "SOFT_LIGHTS",
    /// Triangles of several lights.
    parted: "PARTED_LIGHTS",
    /// An environment.
    environment: "ENVIRONMENT",
    /// Textures, or colours of corners.
    textured: "TEXTURED",
    /// Surfaces that aren't there everywhere.
    alpha: "ALPHA",
    /// Instances that share triangles.
    instanced: "INSTANCED",
    /// Several sources of light, so few that direct light asks each.
    few_sources: "FEW_SOURCES",
    /// So many that one is chosen by what it can bring.
    many_sources: "MANY_SOURCES",
    /// A lens before the camera that is rendered.
    lens: "LENS",
}

impl Light {
    /// Whether it is a point, a spot or a direction.
    pub(crate) fn is_punctual(&self) -> bool {
        [POINT_LIGHT, SPOT_LIGHT, DIRECTIONAL_LIGHT].contains(&self.kind)
    }
}

impl SceneFeatures {
    /// The features of what is seen, of materials that triangles have, and of the lights.
    pub(crate) fn of(triangles: &[ShadingTriangle], materials: &[Material], lights: &[Light]) -> Self {
        let mut features = Self::default();
        for triangle in triangles {
            let material = &materials[triangle.material as usize];
            features.add_material(material);
            features.textured |= triangle.flags & TEXTURED_TRIANGLE != 0;
            features.alpha |= triangle.flags & SEE_THROUGH != 0;
            features.contact |= triangle.flags & TOUCHED != 0;
            features.coincidence |= triangle.flags & (COINCIDENT | BACKED) != 0;
        }
        for light in lights {
            features.punctual |= light.is_punctual();
            features.soft |= light.extent > 0.0;
            features.parted |= light.kind == TRIANGLE_LIGHT && !Part::of(light).is_whole();
            features.environment |= light.kind == ENVIRONMENT_LIGHT;
        }
        features
    }

    /// Those that the BSDFs of visible points have.
    pub fn visible_lobes(self) -> VisibleLobes {
        let constants = self.constants();
        VISIBLE_LOBES.map(|lobe| constants.contains(&(lobe, true)))
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
