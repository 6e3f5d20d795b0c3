//! Reduces glTF materials to what the renderer does, and says what is left out.

pub(crate) mod layers;

use glam::Vec3;
use gltf_json::extensions::material::Volume;
use gltf_json::material::{AlphaMode, NormalTexture};
use gltf_json::texture::Info;
use gltf_json::validation::Checked;

use super::diagnostic::{Check, Warnings, damaged, label};
use super::texture::{TextureReader, TextureUse};
use crate::scene::{Alpha, Dielectric, Gloss, Layers, Material, MaterialTextures, Surface, normal_reflectance};
use crate::text::shorten;

/// Index of refraction where the file gives none.
const DEFAULT_IOR: f32 = 1.5;

/// Largest index of refraction: far above any material's, and its square is far from the end of f32.
const MAX_IOR: f32 = 100.0;

/// Largest scale of a normal texture: what leans further lies in the surface.
const STEEPEST: f32 = 1e4;

/// Converts every material of the file, and the default material after them.
///
/// Only those that `used` marks (one flag for each, the default's last) give rise to warnings.
pub(crate) fn materials(
    root: &gltf_json::Root,
    used: &[bool],
    textures: &mut TextureReader<'_>,
    warnings: &mut Warnings,
) -> Check<Vec<Material>> {
    let default = gltf_json::Material {
        name: Some("default".into()),
        ..Default::default()
    };
    let mut materials = Vec::with_capacity(root.materials.len() + 1);
    for (index, json) in root.materials.iter().chain([&default]).enumerate() {
        let mut reader = Reader {
            json,
            solid: false,
            warnings: Vec::new(),
        };
        let label = label("material", index, json.name.as_deref());
        let mut material = reader.read(index).map_err(|what| format!("{label}: {what}"))?;
        if used[index] {
            material.textures = reader.textures(textures).map_err(|what| format!("{label}: {what}"))?;
            if material.unlit {
                // The one colour that it has.
                material.textures.emission = material.textures.base_color;
            }
            for warning in reader.warnings {
                warnings.push(format!("{label}: {warning}"));
            }
        }
        materials.push(material);
    }
    Ok(materials)
}

/// What the material at `index`, which was read as `thin`, is if it isn't taken for a thin wall.
pub(crate) fn solid(root: &gltf_json::Root, index: usize, thin: &Material) -> Check<Material> {
    let mut reader = Reader {
        json: &root.materials[index],
        solid: true,
        warnings: Vec::new(),
    };
    Ok(Material {
        textures: thin.textures,
        ..reader.read(index)?
    })
}

/// One material with the warnings about it.
struct Reader<'a> {
    json: &'a gltf_json::Material,
    /// Whether it is solid where it has no volume.
    solid: bool,
    warnings: Vec<String>,
}

impl Reader<'_> {
    fn read(&mut self, index: usize) -> Check<Material> {
        let [red, green, blue, alpha] = self.json.pbr_metallic_roughness.base_color_factor.0;
        let [alpha] = self.fractions("alpha of its baseColorFactor", [alpha])?;
        let base_color = self.fractions("baseColorFactor", [red, green, blue])?;
        let unlit = self.extension(|extensions| extensions.unlit.as_ref()).is_some();
        let layers = self.layers()?;
        let (surface, emission) = (self.surface(&layers)?, self.emission()?);
        let (surface, layers, base_color, emission) = if unlit {
            (Surface::Matte, Layers::default(), Vec3::ZERO, base_color.into())
        } else {
            (surface, layers, base_color.into(), emission)
        };
        Ok(Material {
            name: match &self.json.name {
                Some(name) => shorten(name),
                None => format!("material {index}"),
            },
            surface,
            layers,
            base_color,
            emission,
            back_emits: self.json.double_sided || unlit,
            // Glass has an inside to be seen from.
            back_hidden: !self.json.double_sided && !matches!(surface, Surface::Dielectric(_)),
            unlit,
            alpha: match self.json.alpha_mode {
                Checked::Valid(AlphaMode::Opaque) => Alpha::Opaque,
                Checked::Valid(AlphaMode::Mask) => Alpha::Mask {
                    alpha,
                    cutoff: self.json.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0),
                },
                Checked::Valid(AlphaMode::Blend) => Alpha::Blend { alpha },
                Checked::Invalid => return Err(damaged("its alphaMode is none of OPAQUE, MASK and BLEND")),
            },
            textures: MaterialTextures::default(),
        })
    }

    /// A metal is a metal even where it claims to transmit: glTF mixes the two lobes by metallicFactor first.
    fn surface(&mut self, layers: &Layers) -> Check<Surface> {
        let pbr = &self.json.pbr_metallic_roughness;
        let [metallic] = self.fractions("metallicFactor", [pbr.metallic_factor.0])?;
        let [roughness] = self.fractions("roughnessFactor", [pbr.roughness_factor.0])?;
        let transmission = self.extension(|extensions| extensions.transmission.as_ref());
        let transmission = transmission.map_or(0.0, |transmission| transmission.transmission_factor.0);
        let [transmission] = self.fractions("transmissionFactor", [transmission])?;
        let ior = self.ior()?;
        let (specular, specular_color) = self.specular()?;
        let attenuation_color = self.attenuation_color()?;

        // A texture may make less of a factor, and other things from place to place.
        let textured = pbr.metallic_roughness_texture.is_some();
        let all_metal = metallic == 1.0 && !textured;
        if all_metal && transmission > 0.0 {
            self.warn("metallicFactor 1 leaves nothing of its transmission, and it is rendered as metal; set it to 0 for glass".into());
        }
        if all_metal && roughness == 0.0 && !layers.hide_mirrors() {
            return Ok(Surface::Mirror);
        }
        let is_clear = transmission > 0.0 && !all_metal;
        if !is_clear && metallic == 0.0 && specular == 0.0 && !layers.are_glossy() {
            return Ok(Surface::Matte);
        }
        // KHR_materials_ior and KHR_materials_specular.
        let of_ior = normal_reflectance(ior);
        let gloss = Gloss {
            metallic,
            roughness,
            specular_f0: (specular_color * of_ior).min(Vec3::ONE) * specular,
            specular_f90: specular,
        };
        if !is_clear {
            return Ok(Surface::Glossy(gloss));
        }
        // Where all is reflected, nothing is bent.
        let ior = if ior == 0.0 { DEFAULT_IOR } else { ior };
        let volume = self.extension(|extensions| extensions.volume.as_ref());
        let thin = !self.solid && volume.is_none_or(|volume| volume.thickness_factor.0 == 0.0);
        Ok(Surface::Dielectric(Dielectric {
            ior,
            roughness,
            transmission,
            gloss,
            thin,
            absorption: volume
                .filter(|_| !thin)
                .map_or(Vec3::ZERO, |volume| absorption(attenuation_color, volume)),
            // A thin wall doesn't bend light.
            dispersion: if thin { 0.0 } else { self.dispersion()? },
        }))
    }

    /// 0 stands for infinity.
    fn ior(&self) -> Check<f32> {
        let ior = self.extension(|extensions| extensions.ior.as_ref());
        let ior = ior.map_or(DEFAULT_IOR, |ior| ior.ior.0);
        if ior != 0.0 && !(1.0..=MAX_IOR).contains(&ior) {
            return Err(format!(
                "its index of refraction is {ior}, but it must be 0 or from 1 to {MAX_IOR}; correct it in the file"
            ));
        }
        Ok(ior)
    }

    /// Of KHR_materials_dispersion, which the `gltf` crate doesn't know.
    fn dispersion(&self) -> Check<f32> {
        let extension = self.extension(|extensions| extensions.others.get("KHR_materials_dispersion"));
        let dispersion = extension
            .and_then(|extension| extension.get("dispersion"))
            .map_or(Some(0.0), |it| it.as_f64());
        let dispersion = dispersion.ok_or_else(|| damaged("its dispersion isn't a number"))?;
        let [dispersion] = not_negative("dispersion", [dispersion as f32])?;
        Ok(dispersion)
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

    /// Factor and colour of KHR_materials_specular.
    fn specular(&mut self) -> Check<(f32, Vec3)> {
        let Some(specular) = self.extension(|extensions| extensions.specular.as_ref()) else {
            return Ok((1.0, Vec3::ONE));
        };
        let (factor, color) = (specular.specular_factor.0, specular.specular_color_factor.0);
        let [factor] = self.fractions("specularFactor", [factor])?;
        Ok((factor, not_negative("specularColorFactor", color)?.into()))
    }

    /// Of KHR_materials_volume, whose other values are checked.
    fn attenuation_color(&mut self) -> Check<Vec3> {
        let Some(volume) = self.extension(|extensions| extensions.volume.as_ref()) else {
            return Ok(Vec3::ONE);
        };
        let (color, distance) = (volume.attenuation_color.0, volume.attenuation_distance.0);
        not_negative("thicknessFactor", [volume.thickness_factor.0])?;
        let color = self.fractions("attenuationColor", color)?;
        // Infinity is the default.
        if distance.is_nan() || distance <= 0.0 {
            return Err(format!(
                "its attenuationDistance is {distance}, but it must be positive; correct it in the file"
            ));
        }
        Ok(color.into())
    }

    /// The textures. Not the thickness's: it is for renderers that don't trace through the solid.
    fn textures(&mut self, reader: &mut TextureReader<'_>) -> Check<MaterialTextures> {
        let json = self.json;
        let pbr = &json.pbr_metallic_roughness;
        let transmission = self.extension(|extensions| extensions.transmission.as_ref());
        let specular = self.extension(|extensions| extensions.specular.as_ref());
        let normals = json.normal_texture.as_ref();
        let mut textures = MaterialTextures {
            normal_scale: normals.map_or(0.0, |texture| texture.scale),
            ..MaterialTextures::default()
        };
        let normals = normals.map(|texture| used_normals("normalTexture", texture));
        let uses = [
            (&mut textures.base_color, pbr.base_color_texture.as_ref().map(color)),
            (
                &mut textures.metallic_roughness,
                pbr.metallic_roughness_texture.as_ref().map(linear),
            ),
            (&mut textures.normal, normals.transpose()?),
            (&mut textures.emission, json.emissive_texture.as_ref().map(color)),
            (
                &mut textures.transmission,
                transmission.and_then(|it| it.transmission_texture.as_ref()).map(linear),
            ),
            (
                &mut textures.specular,
                specular.and_then(|it| it.specular_texture.as_ref()).map(linear),
            ),
            (
                &mut textures.specular_color,
                specular.and_then(|it| it.specular_color_texture.as_ref()).map(color),
            ),
        ];
        look_up(uses, reader, &mut self.warnings)?;
        let of_layers = self.layer_textures(&mut textures)?;
        look_up(of_layers, reader, &mut self.warnings)?;
        Ok(textures)
    }

    fn extension<'s, T>(
        &'s self,
        select: impl FnOnce(&'s gltf_json::extensions::material::Material) -> Option<&'s T>,
    ) -> Option<&'s T> {
        self.json.extensions.as_ref().and_then(select)
    }

    /// Factors from 0 to 1. Larger ones are cut to 1 with a warning.
    fn fractions<const N: usize>(&mut self, what: &str, values: [f32; N]) -> Check<[f32; N]> {
        let values = not_negative(what, values)?;
        if values.iter().any(|&value| value > 1.0) {
            self.warn(format!(
                "{what} {} is above 1, which would make light out of nothing, and cut to it; correct it in the file",
                spell(&values)
            ));
        }
        Ok(values.map(|value| value.min(1.0)))
    }

    fn warn(&mut self, warning: String) {
        self.warnings.push(warning);
    }
}

/// A texture of normals whose scale is one.
fn used_normals(name: &str, texture: &NormalTexture) -> Check<TextureUse> {
    let scale = texture.scale;
    if scale.is_nan() || scale.abs() > STEEPEST {
        return Err(format!(
            "its {name}'s scale is {scale}, but its size must be {STEEPEST} at the most; correct it in the file"
        ));
    }
    let others = texture.extensions.as_ref().map(|extensions| &extensions.others);
    let transform = others.and_then(|others| others.get("KHR_texture_transform")).cloned();
    let transform = transform.map(serde_json::from_value).transpose();
    Ok(TextureUse {
        texture: texture.index.value(),
        set: texture.tex_coord,
        transform: transform.map_err(|error| damaged(format_args!("its {name}: {error}")))?,
        srgb: false,
    })
}

/// Looks textures up, each for its place.
fn look_up<'t>(
    uses: impl IntoIterator<Item = (&'t mut Option<u32>, Option<TextureUse>)>,
    reader: &mut TextureReader<'_>,
    warnings: &mut Vec<String>,
) -> Check<()> {
    for (found, wanted) in uses {
        if let Some(wanted) = wanted {
            *found = reader.lookup(&wanted, warnings)?;
        }
    }
    Ok(())
}

/// A texture of numbers.
fn linear(info: &Info) -> TextureUse {
    used(info, false)
}

/// A texture of colours.
fn color(info: &Info) -> TextureUse {
    used(info, true)
}

fn used(info: &Info, srgb: bool) -> TextureUse {
    TextureUse {
        texture: info.index.value(),
        set: info.tex_coord,
        transform: info
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.texture_transform.clone()),
        srgb,
    }
}

/// Beer's absorption coefficient: light keeps attenuationColor over attenuationDistance. 1/scene unit.
fn absorption(color: Vec3, volume: &Volume) -> Vec3 {
    // A black channel keeps next to nothing, and no infinity gets into the kernels.
    const DARKEST: f32 = 1e-10;
    let color = color.max(Vec3::splat(DARKEST));
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
