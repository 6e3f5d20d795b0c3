//! Materials: which are supported, which cause a warning, and which are refused.

use glam::Vec3;
use ppm_vk::internals::scene::{Dielectric, Material, Surface};
use serde_json::{Value, json};

use crate::fixture::{Fixture, assert_close};

/// The room whose floor has the given material.
fn floor_of(material: Value) -> Fixture {
    let mut room = Fixture::room();
    room.set("/materials/0", material);
    room.set("/materials/0/name", json!("floor"));
    room
}

/// A material without specular lobe, with more fields.
fn matte(fields: Value) -> Value {
    let mut material = json!({
        "pbrMetallicRoughness": {"metallicFactor": 0},
        "extensions": {"KHR_materials_specular": {"specularFactor": 0}}
    });
    for (key, value) in fields.as_object().expect("an object") {
        material[key] = value.clone();
    }
    material
}

/// Clear glass, with more extensions.
fn glass(extensions: Value) -> Value {
    let mut material = json!({
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": {"thicknessFactor": 1}
        }
    });
    for (key, value) in extensions.as_object().expect("an object") {
        material["extensions"][key] = value.clone();
    }
    material
}

/// The floor's material after loading, without warnings.
#[track_caller]
fn loaded(material: Value) -> Material {
    let mut scene = floor_of(material).scene();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    scene.materials.remove(0)
}

#[test]
fn the_base_colour_is_the_albedo_of_a_matte_surface() {
    let pbr = json!({"metallicFactor": 0, "baseColorFactor": [0.25, 0.5, 0.75, 1]});
    let material = loaded(matte(json!({"pbrMetallicRoughness": pbr, "doubleSided": true})));
    assert_eq!(material.surface, Surface::Matte);
    assert_eq!(material.base_color.to_array(), [0.25, 0.5, 0.75]);
    assert_eq!(material.emission.to_array(), [0.0; 3]);
    assert_eq!(material.name, "floor");
    assert!(material.back_emits);
}

#[test]
fn metallic_1_with_roughness_0_is_a_mirror() {
    let pbr = json!({"metallicFactor": 1, "roughnessFactor": 0, "baseColorFactor": [1, 0.75, 0.25, 1]});
    let material = loaded(json!({"pbrMetallicRoughness": pbr}));
    assert_eq!(material.surface, Surface::Mirror);
    assert_eq!(material.base_color.to_array(), [1.0, 0.75, 0.25]);
    assert!(!material.back_emits);
}

#[test]
fn transmission_is_a_dielectric_with_the_files_index_or_1_5() {
    assert_close_ior(&loaded(glass(json!({}))), 1.5);
    let water = glass(json!({"KHR_materials_ior": {"ior": 1.33}}));
    assert_close_ior(&loaded(water), 1.33);
    let nothing = glass(json!({"KHR_materials_ior": {"ior": 1}}));
    assert_close_ior(&loaded(nothing), 1.0);
    let none = matte(json!({"extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 0}, "KHR_materials_specular": {"specularFactor": 0}
    }}));
    assert_eq!(loaded(none).surface, Surface::Matte);
}

#[test]
fn emission_is_factor_times_strength() {
    let mut material = matte(json!({"emissiveFactor": [1, 0.5, 3]}));
    assert_close(loaded(material.clone()).emission, [1.0, 0.5, 3.0]);
    material["extensions"]["KHR_materials_emissive_strength"] = json!({"emissiveStrength": 4});
    assert_close(loaded(material).emission, [4.0, 2.0, 12.0]);
}

#[test]
fn unnamed_materials_are_numbered_and_the_default_material_is_appended() {
    let mut room = Fixture::room();
    room.remove("/materials/0/name");
    let scene = room.scene();
    assert_eq!(scene.materials[0].name, "material 0");
    assert_eq!(scene.materials.len(), 2);

    room.remove("/meshes/0/primitives/0/material");
    let scene = room.scene();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(scene.objects[0].material, 2);
    assert_eq!(scene.materials[2].base_color.to_array(), [1.0; 3]);
}

/// An attenuationColor above 1 would amplify light.
#[test]
fn a_volume_amplifies_no_light() {
    let glass = |color: Value| {
        matte(json!({
            "pbrMetallicRoughness": {"metallicFactor": 0},
            "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.5, "attenuationColor": color}
            }
        }))
    };
    let clear = floor_of(glass(json!([1, 0.5, 0.25]))).scene();
    let cut = floor_of(glass(json!([5123, 0.5, 0.25]))).assert_warns(&["attenuationColor 5123 0.5 0.25", "above 1"]);
    assert_eq!(cut.materials[0].surface, clear.materials[0].surface);
}

#[test]
fn factors_above_1_are_cut_with_a_warning() {
    let pbr = json!({"metallicFactor": 0, "baseColorFactor": [0.5, 1.5, 2, 1]});
    let scene = floor_of(matte(json!({"pbrMetallicRoughness": pbr}))).assert_warns(&[
        "material 0 \"floor\"",
        "baseColorFactor 0.5 1.5 2",
        "above 1",
    ]);
    assert_eq!(scene.materials[0].base_color.to_array(), [0.5, 1.0, 1.0]);
    let pbr = json!({"metallicFactor": 2, "roughnessFactor": 0});
    floor_of(json!({"pbrMetallicRoughness": pbr})).assert_warns(&["metallicFactor 2 is above 1"]);
}

#[test]
fn negative_and_infinite_factors_are_refused() {
    let pbr = |key: &str, value: Value| matte(json!({"pbrMetallicRoughness": {key: value}}));
    let extension = |name: &str, key: &str, value: Value| glass(json!({name: {key: value}}));
    let cases = [
        (
            pbr("baseColorFactor", json!([0, -0.5, 0, 1])),
            "baseColorFactor is 0 -0.5 0",
        ),
        (pbr("baseColorFactor", json!([1e39, 0, 0, 1])), "baseColorFactor is inf"),
        (pbr("metallicFactor", json!(-1)), "metallicFactor is -1"),
        (pbr("roughnessFactor", json!(-1)), "roughnessFactor is -1"),
        (matte(json!({"emissiveFactor": [0, 0, -1]})), "emissiveFactor is 0 0 -1"),
        (matte(json!({"emissiveFactor": [1e39, 0, 0]})), "emissiveFactor is inf"),
        (
            extension("KHR_materials_emissive_strength", "emissiveStrength", json!(-2)),
            "emissiveStrength is -2",
        ),
        (
            extension("KHR_materials_transmission", "transmissionFactor", json!(-1)),
            "transmissionFactor is -1",
        ),
        (
            extension("KHR_materials_ior", "ior", json!(-1)),
            "index of refraction is -1",
        ),
        (
            extension("KHR_materials_ior", "ior", json!(0.5)),
            "index of refraction is 0.5",
        ),
        (
            extension("KHR_materials_ior", "ior", json!(1e30)),
            "index of refraction",
        ),
        (
            extension("KHR_materials_specular", "specularFactor", json!(-1)),
            "specularFactor is -1",
        ),
        (
            extension("KHR_materials_specular", "specularColorFactor", json!([1, 1, -1])),
            "specularColorFactor is 1 1 -1",
        ),
        (
            extension("KHR_materials_volume", "thicknessFactor", json!(-1)),
            "thicknessFactor is -1",
        ),
        (
            extension("KHR_materials_volume", "attenuationColor", json!([-1, 1, 1])),
            "attenuationColor is -1 1 1",
        ),
        (
            extension("KHR_materials_volume", "attenuationDistance", json!(0)),
            "attenuationDistance is 0",
        ),
        (
            extension("KHR_materials_clearcoat", "clearcoatFactor", json!(-1)),
            "clearcoatFactor is -1",
        ),
        (
            extension("KHR_materials_clearcoat", "clearcoatRoughnessFactor", json!(-1)),
            "clearcoatRoughnessFactor is -1",
        ),
        (
            extension(
                "KHR_materials_clearcoat",
                "clearcoatNormalTexture",
                json!({"index": 0, "scale": 1e6}),
            ),
            "clearcoatNormalTexture's scale is 1000000",
        ),
    ];
    for (material, part) in cases {
        floor_of(material).assert_fails(&["material 0 \"floor\"", part, "correct it"]);
    }
    let mut bright = matte(json!({"emissiveFactor": [3e38, 0, 0]}));
    bright["extensions"]["KHR_materials_emissive_strength"] = json!({"emissiveStrength": 10});
    floor_of(bright).assert_fails(&["material 0", "emissiveFactor times emissiveStrength"]);
}

#[test]
fn metal_that_claims_to_be_glass_is_named_in_a_warning() {
    let mut metal_glass = glass(json!({}));
    metal_glass["pbrMetallicRoughness"]["metallicFactor"] = json!(1);
    floor_of(metal_glass).assert_warns(&["material 0 \"floor\"", "metallicFactor 1", "transmission"]);
}

fn with_sheen(mut material: Value, sheen: Value) -> Value {
    material["extensions"]["KHR_materials_sheen"] = sheen;
    material
}

#[test]
fn a_sheen_has_the_values_of_the_file() {
    let sheen = json!({"sheenColorFactor": [0.25, 0.5, 1], "sheenRoughnessFactor": 0.75});
    let mirror = json!({"pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0}});
    for material in [matte(json!({})), mirror] {
        let material = loaded(with_sheen(material, sheen.clone()));
        assert!(matches!(material.surface, Surface::Glossy(_)), "{:?}", material.surface);
        let sheen = material.layers.sheen;
        assert_eq!((sheen.color, sheen.roughness), (Vec3::new(0.25, 0.5, 1.0), 0.75));
    }
    // Its colour is black unless the file sets one.
    let none = loaded(with_sheen(matte(json!({})), json!({"sheenRoughnessFactor": 0.5})));
    assert_eq!(none.surface, Surface::Matte);
}

#[test]
fn invalid_sheens_are_refused_or_reported() {
    let refused = [
        (json!({"sheenColorFactor": [0, -1, 0]}), "sheenColorFactor is 0 -1 0"),
        (json!({"sheenRoughnessFactor": -1}), "sheenRoughnessFactor is -1"),
        (json!({"sheenColorFactor": 1}), "KHR_materials_sheen"),
    ];
    for (sheen, what) in refused {
        floor_of(with_sheen(matte(json!({})), sheen)).assert_fails(&["material 0", what]);
    }
    let bright = json!({"sheenColorFactor": [2, 0, 0]});
    floor_of(with_sheen(matte(json!({})), bright)).assert_warns(&["sheenColorFactor 2 0 0 is above 1"]);
    let on_glass = glass(json!({}));
    floor_of(with_sheen(on_glass, json!({"sheenColorFactor": [1, 0, 0]})))
        .assert_warns(&["its sheen", "passes no light"]);
}

fn with_anisotropy(mut material: Value, anisotropy: Value) -> Value {
    material["extensions"]["KHR_materials_anisotropy"] = anisotropy;
    material
}

/// A floor with texture coordinates, which anisotropy needs.
fn anisotropic_floor(material: Value, anisotropy: Value) -> Fixture {
    let mut room = floor_of(with_anisotropy(material, anisotropy));
    let texcoords = room.add_floats("VEC2", 2, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(texcoords));
    room
}

#[test]
fn anisotropy_is_what_the_file_says() {
    let mirror = json!({"pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0}});
    let loaded = |anisotropy| {
        let scene = anisotropic_floor(mirror.clone(), anisotropy).scene();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        scene.materials[0].clone()
    };
    let brushed = loaded(json!({"anisotropyStrength": 0.5, "anisotropyRotation": -2}));
    assert!(matches!(brushed.surface, Surface::Glossy(_)), "{:?}", brushed.surface);
    let anisotropy = brushed.layers.anisotropy;
    assert_eq!((anisotropy.strength, anisotropy.rotation), (0.5, -2.0));
    let none = loaded(json!({"anisotropyRotation": 1}));
    assert_eq!(none.surface, Surface::Mirror);
}

#[test]
fn anisotropy_that_cannot_be_is_refused_or_told_of() {
    let refused = [
        (json!({"anisotropyStrength": -1}), "anisotropyStrength is -1"),
        (json!({"anisotropyRotation": 1e39}), "anisotropyRotation is inf"),
        (json!({"anisotropyStrength": "much"}), "KHR_materials_anisotropy"),
    ];
    for (anisotropy, what) in refused {
        anisotropic_floor(matte(json!({})), anisotropy).assert_fails(&["material 0", what]);
    }
    let strong = json!({"anisotropyStrength": 2});
    anisotropic_floor(matte(json!({})), strong).assert_warns(&["anisotropyStrength 2 is above 1"]);
    let weak = json!({"anisotropyStrength": 0.5});
    anisotropic_floor(glass(json!({})), weak).assert_warns(&["its anisotropy", "transmits no light"]);
}

#[test]
fn a_coat_lies_on_any_surface() {
    let coat = |mut material: Value| {
        material["extensions"]["KHR_materials_clearcoat"] =
            json!({"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25});
        loaded(material)
    };
    let mirror = json!({"pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0}});
    for material in [matte(json!({})), glass(json!({})), mirror.clone()] {
        let coat = coat(material).layers.coat;
        assert_eq!((coat.factor, coat.roughness), (0.5, 0.25));
    }
    assert_eq!(loaded(mirror).layers.coat.factor, 0.0);
    // A Lambertian surface without a coat has no microfacets.
    match coat(matte(json!({}))).surface {
        Surface::Glossy(gloss) => assert_eq!((gloss.specular_f0, gloss.specular_f90), (Vec3::ZERO, 0.0)),
        surface => panic!("{surface:?}"),
    }
}

#[test]
fn an_index_of_0_reflects_all_at_every_angle() {
    let plastic = json!({
        "pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {"KHR_materials_ior": {"ior": 0}}
    });
    for material in [plastic, glass(json!({"KHR_materials_ior": {"ior": 0}}))] {
        let gloss = match loaded(material).surface {
            Surface::Glossy(gloss) => gloss,
            Surface::Dielectric(glass) => glass.gloss,
            surface => panic!("{surface:?}"),
        };
        assert_eq!((gloss.specular_f0, gloss.specular_f90), (Vec3::ONE, 1.0));
    }
}

fn dielectric(material: &Material) -> Dielectric {
    match material.surface {
        Surface::Dielectric(glass) => glass,
        surface => panic!("{surface:?}"),
    }
}

#[track_caller]
fn assert_close_ior(material: &Material, ior: f32) {
    assert_eq!(dielectric(material).ior, ior);
}

#[test]
fn glass_may_be_rough_a_thin_wall_a_part_of_a_surface_and_absorbing() {
    let mut frosted = glass(json!({}));
    frosted["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.5);
    let frosted = dielectric(&loaded(frosted));
    assert_eq!(
        (frosted.roughness, frosted.transmission, frosted.thin),
        (0.5, 1.0, false)
    );

    let thin = glass(json!({"KHR_materials_volume": {"thicknessFactor": 0}}));
    assert!(dielectric(&loaded(thin)).thin);
    let without_volume = json!({
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}
    });
    assert!(dielectric(&loaded(without_volume)).thin);

    // The kernels mix metal and transmission, because textures may change both.
    let mut half = glass(json!({"KHR_materials_transmission": {"transmissionFactor": 0.5}}));
    half["pbrMetallicRoughness"]["metallicFactor"] = json!(0.5);
    let half = dielectric(&loaded(half));
    assert_eq!((half.transmission, half.gloss.metallic), (0.5, 0.5));

    let absorbing = json!({"thicknessFactor": 1, "attenuationColor": [1, 0.5, 0], "attenuationDistance": 2});
    let absorbing = floor_of(glass(json!({"KHR_materials_volume": absorbing}))).scene();
    let scale = absorbing.normalisation.scale as f32;
    let absorption = dielectric(&absorbing.materials[0]).absorption * scale;
    assert_close(absorption, [0.0, 0.5f32.ln() / -2.0, 1e-10f32.ln() / -2.0]);
}

#[test]
fn absorption_that_absorbs_nothing_is_no_reason_to_warn() {
    let volume = json!({"thicknessFactor": 1, "attenuationColor": [1, 0.5, 1]});
    loaded(glass(json!({"KHR_materials_volume": volume})));
    let volume = json!({"thicknessFactor": 1, "attenuationDistance": 2});
    loaded(glass(json!({"KHR_materials_volume": volume})));
}

/// KHR_materials_ior and KHR_materials_specular; metal is mixed in by the kernels.
#[test]
fn surfaces_that_are_neither_matte_nor_mirrors_are_glossy() {
    let glossy = |material: Value| match loaded(material).surface {
        Surface::Glossy(gloss) => gloss,
        surface => panic!("{surface:?}"),
    };
    let metal = json!({"metallicFactor": 1, "roughnessFactor": 0.25});
    let metal = glossy(json!({"pbrMetallicRoughness": metal}));
    assert_eq!((metal.metallic, metal.roughness), (1.0, 0.25));

    let half = json!({"metallicFactor": 0.5, "roughnessFactor": 0.75});
    let half = glossy(json!({"pbrMetallicRoughness": half, "extensions": {
        "KHR_materials_ior": {"ior": 2},
        "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 20]}
    }}));
    assert_eq!((half.metallic, half.roughness), (0.5, 0.75));
    // With index 2 a ninth is reflected; a colour cannot increase that above 1.
    assert_close(half.specular_f0, [0.5 / 9.0, 0.25 / 9.0, 0.5]);
    assert_eq!(half.specular_f90, 0.5);

    let plain = glossy(json!({}));
    assert_eq!((plain.metallic, plain.roughness), (1.0, 1.0));
    assert_close(plain.specular_f0, [0.04; 3]);
    assert_eq!(plain.specular_f90, 1.0);
}

#[test]
fn unused_materials_give_no_warnings() {
    let mut room = Fixture::room();
    room.set("/materials/-", json!({"name": "spare", "alphaMode": "BLEND"}));
    assert!(room.scene().warnings.is_empty());
}

#[test]
fn an_unknown_alpha_mode_is_refused() {
    floor_of(matte(json!({"alphaMode": "DITHER"}))).assert_fails(&["material 0 \"floor\"", "alphaMode"]);
}

#[test]
fn parts_of_meshes_and_nodes_that_are_left_out_are_named() {
    let mut room = Fixture::room();
    let sampler = json!({"input": 0, "output": 0});
    let channel = json!({"sampler": 0, "target": {"node": 0, "path": "translation"}});
    room.set("/animations", json!([{"samplers": [sampler], "channels": [channel]}]));
    room.assert_warns(&["animations"]);

    let mut room = Fixture::room();
    room.set("/meshes/0/primitives/0/attributes", json!({"NORMAL": 1, "_CUSTOM": 2}));
    room.assert_warns(&["mesh 0 \"floor\", primitive 0", "no POSITION", "skipped"]);
}

#[test]
fn attributes_of_ones_own_are_fine() {
    let mut room = Fixture::room();
    room.set("/meshes/0/primitives/0/attributes/_BATCH", json!(2));
    room.set("/meshes/0/primitives/0/attributes/_OTHER", json!(2));
    assert!(room.scene().warnings.is_empty());
}

#[test]
fn unknown_extensions_are_named_and_refused_where_required() {
    let mut room = Fixture::room();
    let supported = json!([
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_volume"
    ]);
    room.set("/extensionsUsed", supported.clone());
    room.set("/extensionsRequired", supported);
    assert!(room.scene().warnings.is_empty());

    room.set("/extensionsUsed/-", json!("EXT_new"));
    room.assert_warns(&["extension \"EXT_new\"", "ignored"]);
    room.set("/extensionsRequired/-", json!("EXT_new"));
    room.assert_fails(&["requires the extension \"EXT_new\"", "without it"]);
}

#[test]
fn a_required_extension_is_named_even_if_it_changes_the_format() {
    let mut room = Fixture::room();
    room.set("/extensionsRequired", json!(["MSFT_texture_dds"]));
    room.set(
        "/textures",
        json!([{"extensions": {"MSFT_texture_dds": {"source": 0}}}]),
    );
    room.assert_fails(&["MSFT_texture_dds"]);
}
