//! Units of punctual lights, which differ between exporters.

use gltf_json::Root;

use crate::config::choices;
use crate::scene::{LoadChoice, Remark};
use crate::text::quote;

/// Lumens per watt, by which Blender's exporter multiplies punctual lights in its «Standard» units, but not emissive materials.
const LUMENS_PER_WATT: f64 = 683.0;

/// Prefix of the generator of Blender's exporter.
const BLENDER: &str = "Khronos glTF Blender I/O";

/// Its first version with such units; older ones write what is «Unitless» now.
const FIRST_IN_LUMENS: (u32, u32) = (3, 6);

choices! {
    /// Units of the intensities of punctual lights.
    #[derive(Default)]
    pub enum LightUnits {
        /// `blender` for files of Blender's exporter, with a note, otherwise `spec`.
        #[default]
        Auto => "auto",
        /// Intensity and irradiance on the scale of emitted radiance, as in `KHR_lights_punctual`.
        Spec => "spec",
        /// 683 times as much, as in Blender's «Standard» units.
        Blender => "blender",
    }
}

impl LightUnits {
    /// Divisor of a file's intensities.
    pub(crate) fn divisor(self, root: &Root) -> f64 {
        match self {
            Self::Auto if is_in_lumens(generator(root)) => LUMENS_PER_WATT,
            Self::Auto | Self::Spec => 1.0,
            Self::Blender => LUMENS_PER_WATT,
        }
    }

    /// The note for a file with punctual lights.
    pub(crate) fn note(self, root: &Root) -> Option<Remark> {
        let taken = self == Self::Auto && is_in_lumens(generator(root));
        taken.then(|| {
            let what = format!(
                "{} wrote it: its lights are divided by {LUMENS_PER_WATT}, as Blender's «Standard» lighting wants it; where it was \
                 exported as «Unitless», the specification's units are right",
                quote(generator(root))
            );
            Remark::with(LoadChoice::LightUnits, what)
        })
    }
}

fn generator(root: &Root) -> &str {
    root.asset.generator.as_deref().unwrap_or_default()
}

fn is_in_lumens(generator: &str) -> bool {
    let Some(version) = generator.strip_prefix(BLENDER) else {
        return false;
    };
    let mut numbers = version.trim_start().trim_start_matches('v').split('.').map(str::parse);
    match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => (major, minor) >= FIRST_IN_LUMENS,
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blenders_exporter_writes_lumens_since_version_3_6() {
        for (generator, expected) in [
            ("Khronos glTF Blender I/O v5.3.43", true),
            ("Khronos glTF Blender I/O v3.6.27", true),
            ("Khronos glTF Blender I/O v3.5.30", false),
            ("Khronos glTF Blender I/O v1.8.19", false),
            ("Khronos glTF Blender I/O", true),
            ("Blender", false),
            ("", false),
        ] {
            assert_eq!(is_in_lumens(generator), expected, "{generator}");
        }
    }
}
