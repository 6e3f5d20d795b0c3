//! Reduces glTF materials to what the renderer does, and says what is left out.

use glam::Vec3;
use gltf::json;
use gltf::json::extensions::material::Volume;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;

use super::diagnostic::{Check, Warnings, damaged, label, list, shorten};
use super::{Dielectric, Gloss, Material, Surface};

/// Index of refraction where the file gives none.
const DEFAULT_IOR: f32 = 1.5;

/// Largest index of refraction: far above any material's, and its square is far from the end of f32.
const MAX_IOR: f32 = 100.0;

/// Converts every material of the file, and the default material after them.
///
/// Only those that `used` marks (one flag for each, the default's last) give rise to warnings.
pub(super) fn materials(root: &json::Root, used: &[bool], warnings: &mut Warnings) -> Check<Vec<Material>> {
    let default = json::Material {
        name: Some("default".into()),
        ..Default::default()
    };
    let mut materials = Vec::with_capacity(root.materials.len() + 1);
    for (index, json) in root.materials.iter().chain([&default]).enumerate() {
        let mut reader = Reader {
            json,
            warnings: Vec::new(),
        };
        let label = label("material", index, json.name.as_deref());
        let material = reader.read(index).map_err(|what| format!("{label}: {what}"))?;
        if used[index] {
            for warning in reader.warnings {
                warnings.push(format!("{label}: {warning}"));
            }
        }
        materials.push(material);
    }
    Ok(materials)
}

/// One material with the warnings about it.
struct Reader<'a> {
    json: &'a json::Material,
    warnings: Vec<String>,
}

impl Reader<'_> {
    fn read(&mut self, index: usize) -> Check<Material> {
        self.warn_of_textures();
        match self.json.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) => {}
            Checked::Valid(mode) => self.warn(format!("alphaMode {mode:?} isn't supported yet; it is rendered opaque")),
            Checked::Invalid => return Err(damaged("its alphaMode is none of OPAQUE, MASK and BLEND")),
        }
        let [red, green, blue, _] = self.json.pbr_metallic_roughness.base_color_factor.0;
        let base_color = self.fractions("baseColorFactor", [red, green, blue])?;
        Ok(Material {
            name: match &self.json.name {
                Some(name) => shorten(name),
                None => format!("material {index}"),
            },
            surface: self.surface()?,
            base_color: base_color.into(),
            emission: self.emission()?,
            double_sided: self.json.double_sided,
        })
    }

    /// A metal is a metal even where it claims to transmit: glTF mixes the two lobes by metallicFactor first.
    fn surface(&mut self) -> Check<Surface> {
        let pbr = &self.json.pbr_metallic_roughness;
        let [metallic] = self.fractions("metallicFactor", [pbr.metallic_factor.0])?;
        let [roughness] = self.fractions("roughnessFactor", [pbr.roughness_factor.0])?;
        let transmission = self.extension(|extensions| extensions.transmission.as_ref());
        let transmission = transmission.map_or(0.0, |transmission| transmission.transmission_factor.0);
        let [transmission] = self.fractions("transmissionFactor", [transmission])?;
        let ior = self.ior()?;
        let (specular, specular_color) = self.specular()?;
        self.check_volume()?;

        if metallic == 1.0 && transmission > 0.0 {
            self.warn("metallicFactor 1 leaves nothing of its transmission; set it to 0 for glass".into());
        }
        if metallic == 1.0 && roughness == 0.0 {
            return Ok(Surface::Mirror);
        }
        let clear = transmission * (1.0 - metallic);
        if clear == 0.0 && metallic == 0.0 && specular == 0.0 {
            return Ok(Surface::Matte);
        }
        // KHR_materials_ior and KHR_materials_specular.
        let of_ior = ((ior - 1.0) / (ior + 1.0)).powi(2);
        let gloss = Gloss {
            // Of what isn't clear.
            metallic: if clear < 1.0 { metallic / (1.0 - clear) } else { 0.0 },
            roughness,
            specular_f0: (specular_color * of_ior).min(Vec3::ONE) * specular,
            specular_f90: specular,
        };
        if clear == 0.0 {
            return Ok(Surface::Glossy(gloss));
        }
        self.warn_of_glass();
        let volume = self.extension(|extensions| extensions.volume.as_ref());
        let thin = volume.is_none_or(|volume| volume.thickness_factor.0 == 0.0);
        Ok(Surface::Dielectric(Dielectric {
            ior,
            roughness,
            transmission: clear,
            gloss,
            thin,
            absorption: volume.filter(|_| !thin).map_or(Vec3::ZERO, absorption),
        }))
    }

    fn ior(&mut self) -> Check<f32> {
        let ior = self.extension(|extensions| extensions.ior.as_ref());
        let ior = ior.map_or(DEFAULT_IOR, |ior| ior.ior.0);
        if ior == 0.0 {
            self.warn(format!(
                "an index of refraction of 0 (total reflection) isn't supported; {DEFAULT_IOR} is used"
            ));
            return Ok(DEFAULT_IOR);
        }
        if !(1.0..=MAX_IOR).contains(&ior) {
            return Err(format!(
                "its index of refraction is {ior}, but it must be 0 or from 1 to {MAX_IOR}; correct it in the file"
            ));
        }
        Ok(ior)
    }

    fn emission(&mut self) -> Check<Vec3> {
        let strength = self.extension(|extensions| extensions.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
        let [strength] = not_negative("emissiveStrength", [strength])?;
        // Factors above 1 occur in files that are older than the extension, and mean what they say.
        let factor = not_negative("emissiveFactor", self.json.emissive_factor.0)?;
        let emission = factor.map(|factor| factor * strength);
        Ok(not_negative("emissiveFactor times emissiveStrength", emission)?.into())
    }

    fn warn_of_glass(&mut self) {
        let specular = self.extension(|extensions| extensions.specular.as_ref());
        let is_changed = |specular: &json::extensions::material::Specular| {
            specular.specular_factor.0 != 1.0 || specular.specular_color_factor.0 != [1.0; 3]
        };
        if specular.is_some_and(is_changed) {
            self.warn(
                "KHR_materials_specular on glass isn't supported yet; its reflection follows the ior alone".into(),
            );
        }
    }

    /// Factor and colour of KHR_materials_specular.
    fn specular(&mut self) -> Check<(f32, Vec3)> {
        let Some(specular) = self.extension(|extensions| extensions.specular.as_ref()) else {
            return Ok((1.0, Vec3::ONE));
        };
        let (factor, color) = (specular.specular_factor.0, specular.specular_color_factor.0);
        let [factor] = self.fractions("specularFactor", [factor])?;
        Ok((factor, not_negative("specularColorFactor", color)?.into()))
    }

    fn check_volume(&mut self) -> Check<()> {
        let Some(volume) = self.extension(|extensions| extensions.volume.as_ref()) else {
            return Ok(());
        };
        let (color, distance) = (volume.attenuation_color.0, volume.attenuation_distance.0);
        not_negative("thicknessFactor", [volume.thickness_factor.0])?;
        self.fractions("attenuationColor", color)?;
        // Infinity is the default.
        if distance.is_nan() || distance <= 0.0 {
            return Err(format!(
                "its attenuationDistance is {distance}, but it must be positive; correct it in the file"
            ));
        }
        Ok(())
    }

    /// Names the textures. Not the thickness's: it is for renderers that don't trace through the solid.
    fn warn_of_textures(&mut self) {
        let json = self.json;
        let pbr = &json.pbr_metallic_roughness;
        let transmission = self.extension(|extensions| extensions.transmission.as_ref());
        let specular = self.extension(|extensions| extensions.specular.as_ref());
        let slots = [
            ("baseColorTexture", pbr.base_color_texture.is_some()),
            ("metallicRoughnessTexture", pbr.metallic_roughness_texture.is_some()),
            ("normalTexture", json.normal_texture.is_some()),
            ("occlusionTexture", json.occlusion_texture.is_some()),
            ("emissiveTexture", json.emissive_texture.is_some()),
            (
                "transmissionTexture",
                transmission.is_some_and(|transmission| transmission.transmission_texture.is_some()),
            ),
            (
                "specularTexture",
                specular.is_some_and(|specular| specular.specular_texture.is_some()),
            ),
            (
                "specularColorTexture",
                specular.is_some_and(|specular| specular.specular_color_texture.is_some()),
            ),
        ];
        let present: Vec<String> = slots
            .into_iter()
            .filter(|(_, is_present)| *is_present)
            .map(|(slot, _)| slot.to_owned())
            .collect();
        if !present.is_empty() {
            self.warn(format!(
                "textures aren't supported yet; the factors are used without {}",
                list(&present)
            ));
        }
    }

    fn extension<'s, T>(
        &'s self,
        select: impl FnOnce(&'s json::extensions::material::Material) -> Option<&'s T>,
    ) -> Option<&'s T> {
        self.json.extensions.as_ref().and_then(select)
    }

    /// Factors from 0 to 1. Larger ones are cut to 1 with a warning.
    fn fractions<const N: usize>(&mut self, what: &str, values: [f32; N]) -> Check<[f32; N]> {
        let values = not_negative(what, values)?;
        if values.iter().any(|&value| value > 1.0) {
            self.warn(format!("{what} {} is above 1 and cut to it", spell(&values)));
        }
        Ok(values.map(|value| value.min(1.0)))
    }

    fn warn(&mut self, warning: String) {
        self.warnings.push(warning);
    }
}

/// Beer's absorption coefficient: light keeps attenuationColor over attenuationDistance. 1/scene unit.
fn absorption(volume: &Volume) -> Vec3 {
    // A black channel keeps next to nothing, and no infinity gets into the kernels.
    const DARKEST: f32 = 1e-10;
    let color = Vec3::from(volume.attenuation_color.0).max(Vec3::splat(DARKEST));
    -color.map(f32::ln) / volume.attenuation_distance.0
}

/// Checks that no value is negative, infinite or not a number.
fn not_negative<const N: usize>(what: &str, values: [f32; N]) -> Check<[f32; N]> {
    if values.iter().all(|&value| value >= 0.0 && value.is_finite()) {
        Ok(values)
    } else {
        Err(format!(
            "its {what} is {}, but it must be finite and not negative; correct it in the file",
            spell(&values)
        ))
    }
}

fn spell(values: &[f32]) -> String {
    let values: Vec<String> = values.iter().map(f32::to_string).collect();
    values.join(" ")
}
