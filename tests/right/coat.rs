//! Clear coats, and glass that reflects another part than its index says.

use glam::{DVec3, dvec3};
use ppm_vk::internals::config::{Direct, RenderConfig};
use ppm_vk::internals::cpu::Reflector;
use serde_json::{Value, json};

use crate::document::{Document, Filter, emitting, glass, light, matte, metallic_roughness, mirror, png, with_texture};
use crate::gloss::{albedo, metal, plastic};
use crate::lamp::{self, assert_floor_is_lit_by};
use crate::measure::{Region, measure};
use crate::mesh::Mesh;
use crate::picture::small;
use crate::stage::{camera_ray, subject};

const SIDE: usize = 32;

pub fn with_extension(mut material: Value, name: &str, extension: Value) -> Value {
    material["extensions"][name] = extension;
    material
}

fn coated(material: Value, factor: f64, roughness: f64) -> Value {
    let extension = json!({"clearcoatFactor": factor, "clearcoatRoughnessFactor": roughness});
    with_extension(material, "KHR_materials_clearcoat", extension)
}

/// A component of a normal in a texture.
fn normal_byte(part: f64) -> u8 {
    (127.5 + 127.5 * part).round() as u8
}

/// Schlick's curve of a dielectric of index 1.5.
fn schlick(cosine: f64) -> f64 {
    0.04 + 0.96 * (1.0 - cosine).powi(5)
}

/// The radiance of a plate of this material in a room whose walls all have radiance 1, as a function of the cosine to the
/// viewer.
pub fn assert_plate_shows(
    material: impl FnOnce(&mut Document) -> Value,
    direct: Direct,
    photons: u32,
    what: &str,
    expected: impl Fn(f64) -> f64,
    tolerance: f64,
) {
    assert_plate_shows_towards(material, direct, photons, what, |v| expected(v.z), tolerance);
}

/// As a function of the direction to the viewer: the plate's texture coordinates grow along x and against y, and z is its normal.
pub fn assert_plate_shows_towards(
    material: impl FnOnce(&mut Document) -> Value,
    direct: Direct,
    photons: u32,
    what: &str,
    expected: impl Fn(DVec3) -> f64,
    tolerance: f64,
) {
    let mut scene = Document::new("plate");
    let material = material(&mut scene);
    let plate = scene.material(material);
    let wall = scene.material(light("wall", [1.0; 3]));
    scene.object("plate", &Mesh::facing_up(0.9, 0.0), plate);
    let room = Mesh::cuboid(dvec3(-1.0, -0.1, -1.0), dvec3(1.0, 1.4, 1.0)).flipped();
    scene.object("room", &room, wall);
    scene.camera([0.8, 0.85], [0.0, 0.0], 20.0);
    let scene = subject(scene);
    let middle = Region::around([SIDE / 2; 2], 6);
    let expected = middle.mean(|[column, row]| {
        let (_, direction) = camera_ray(&scene, SIDE, [column as f64 + 0.5, row as f64 + 0.5]);
        expected(dvec3(-direction.x, direction.z, -direction.y))
    });
    let config = RenderConfig {
        direct,
        radius: Some(0.1),
        ..small(SIDE as u32, photons)
    };
    let measured = measure(&scene, config, 32, |image| vec![middle.of(image, 0)]);
    let slack = tolerance * expected;
    measured[0].assert_between(
        expected - slack,
        expected + slack,
        &format!("{what}, direct light by {direct:?}"),
    );
}

/// All of a reflector's albedo, with what a smooth boundary mirrors.
fn whole_albedo(reflector: Reflector, cosine: f64) -> f64 {
    let mirrored = if reflector.alpha == 0.0 {
        let v = dvec3((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        reflector.reflected_weight(DVec3::Z, v, v).x
    } else {
        0.0
    };
    albedo(reflector, cosine, 96).x + mirrored
}

/// KHR_materials_clearcoat: the coat's reflection, and what it lets through to the base.
#[test]
fn a_coated_plate_in_uniform_light_shows_its_coat_and_its_base() {
    const BASE: [f64; 3] = [0.9, 0.6, 0.3];
    let lacquer = Reflector {
        diffuse: DVec3::from(BASE),
        ..plastic(0.36)
    };
    let brushed = Reflector {
        f0: DVec3::from(BASE),
        ..metal(0.16)
    };
    let polished = Reflector { alpha: 0.0, ..brushed };
    let black = Reflector {
        diffuse: DVec3::ZERO,
        f0: DVec3::ZERO,
        f90: 0.0,
        over_base: [0.0; 2],
        alpha: 1.0,
        coat: 0.0,
        sheen: Default::default(),
        along: None,
    };
    let nothing = json!({"specularFactor": 0});
    let black_material = with_extension(matte("black", [0.0; 3]), "KHR_materials_specular", nothing);
    let cases = [
        (black_material, black, 1.0, 0.0),
        (metallic_roughness("lacquer", BASE, 0.0, 0.6), lacquer, 1.0, 0.0),
        (metallic_roughness("lacquer", BASE, 0.0, 0.6), lacquer, 0.5, 0.5),
        (metallic_roughness("brushed", BASE, 1.0, 0.4), brushed, 1.0, 0.2),
        (mirror("polished", BASE), polished, 0.7, 0.6),
    ];
    for (material, base, factor, roughness) in cases {
        let coat = Reflector {
            diffuse: DVec3::ZERO,
            f0: DVec3::splat(0.04 * factor),
            f90: factor,
            over_base: [0.0; 2],
            alpha: roughness * roughness,
            coat: 0.0,
            sheen: Default::default(),
            along: None,
        };
        let below = Reflector { coat: factor, ..base };
        for direct in [Direct::Light, Direct::Photons] {
            let what = format!("{} under {factor} of a coat of roughness {roughness}", material["name"]);
            let expected = |cosine| whole_albedo(below, cosine) + whole_albedo(coat, cosine);
            let material = coated(material.clone(), factor, roughness);
            assert_plate_shows(|_| material, direct, 20_000, &what, expected, 1e-3);
        }
    }
}

/// A smooth coat over a black base, in closed form.
#[test]
fn a_smooth_coat_reflects_by_schlicks_curve_of_index_1_5() {
    let black = with_extension(
        matte("black", [0.0; 3]),
        "KHR_materials_specular",
        json!({"specularFactor": 0}),
    );
    let expected = |cosine: f64| 0.8 * schlick(cosine);
    assert_plate_shows(
        |_| coated(black, 0.8, 0.0),
        Direct::Light,
        100,
        "a coat",
        expected,
        1e-3,
    );
}

/// Its normals lean by 30° across the view; those of the base, and the mesh, which has no tangents, don't.
#[test]
fn a_coat_has_normals_of_its_own() {
    let lean = 30_f64.to_radians();
    let leaning = |scene: &mut Document| {
        let texel = [normal_byte(lean.sin()), normal_byte(0.0), normal_byte(lean.cos()), 255];
        let normals = scene.texture(&png(1, 1, |_, _| texel), Filter::Nearest);
        let slot = "/extensions/KHR_materials_clearcoat/clearcoatNormalTexture";
        let nothing = json!({"specularFactor": 0});
        let black = with_extension(matte("black", [0.0; 3]), "KHR_materials_specular", nothing);
        with_texture(coated(black, 1.0, 0.0), slot, normals)
    };
    // Of bytes, the angle is right to 0.3°.
    let expected = |cosine: f64| schlick(lean.cos() * cosine);
    assert_plate_shows(leaning, Direct::Light, 100, "a leaning coat", expected, 1e-2);
}

/// The normals of the black base lean by 45°, those of the rough coat don't. Photons and rays bring it the same light.
#[test]
fn the_normals_of_the_base_change_nothing_of_a_rough_coat() {
    let coat = Reflector {
        diffuse: DVec3::ZERO,
        f0: DVec3::splat(0.04),
        f90: 1.0,
        over_base: [0.0; 2],
        alpha: 0.36,
        coat: 0.0,
        sheen: Default::default(),
        along: None,
    };
    for direct in [Direct::Light, Direct::Photons] {
        for lean in [0.0, 45_f64.to_radians()] {
            let leaning = |scene: &mut Document| {
                let texel = [normal_byte(lean.sin()), normal_byte(0.0), normal_byte(lean.cos()), 255];
                let normals = scene.texture(&png(1, 1, |_, _| texel), Filter::Nearest);
                let nothing = json!({"specularFactor": 0});
                let black = with_extension(matte("black", [0.0; 3]), "KHR_materials_specular", nothing);
                with_texture(coated(black, 1.0, 0.6), "/normalTexture", normals)
            };
            let what = format!("a coat over normals that lean by {lean} rad");
            let expected = |cosine| whole_albedo(coat, cosine);
            assert_plate_shows(leaning, direct, 20_000, &what, expected, 1e-3);
        }
    }
}

/// A thin wall sees radiance 1 on both sides: coat and wall together lose nothing.
#[test]
fn a_coated_pane_vanishes_in_uniform_light() {
    let pane = coated(glass("pane", 0.0, 1.0, None), 1.0, 0.0);
    assert_plate_shows(|_| pane, Direct::Light, 100, "a coated pane", |_| 1.0, 1e-6);
}

/// Over a black plate a pane shows what it reflects: Fresnel's curve with the ends that KHR_materials_specular gives it.
#[test]
fn panes_reflect_as_their_specular_factor_and_colour_say() {
    let fresnel = |cos_i: f64| {
        let cos_t = (1.0 - (1.0 - cos_i * cos_i) / 2.25).sqrt();
        let parallel = (1.5 * cos_i - cos_t) / (1.5 * cos_i + cos_t);
        let perpendicular = (cos_i - 1.5 * cos_t) / (cos_i + 1.5 * cos_t);
        0.5 * (parallel.powi(2) + perpendicular.powi(2))
    };
    for (factor, red) in [(0.5, 1.0), (1.0, 3.0), (0.3, 30.0)] {
        let specular = json!({"specularFactor": factor, "specularColorFactor": [red, 1, 1]});
        let mut pane = glass("pane", 0.0, 1.0, None);
        // What passes is absorbed.
        pane["pbrMetallicRoughness"]["baseColorFactor"] = json!([0, 0, 0, 1]);
        let pane = with_extension(pane, "KHR_materials_specular", specular);
        let f0 = f64::min(0.04 * red, 1.0) * factor;
        let expected = |cosine| f0 + (factor - f0) * (fresnel(cosine) - 0.04) / 0.96;
        let what = format!("specular {factor}, red {red}");
        assert_plate_shows(|_| pane, Direct::Light, 100, &what, expected, 2e-3);
    }
}

/// Only what passes the coat leaves a lamp, to the viewer, by shadow rays and by photons alike.
#[test]
fn a_coated_lamp_is_darker_at_grazing_angles() {
    const HEIGHT: f64 = 0.6;
    let mut scene = Document::new("coated-lamp");
    let grey = scene.material(matte("grey", [0.5; 3]));
    let lamp = scene.material(coated(emitting(matte("lamp", [0.0; 3]), [1e4; 3]), 1.0, 0.0));
    scene.object("floor", &Mesh::facing_up(1.0, 0.0), grey);
    scene.object("lamp", &Mesh::facing_down(0.004, HEIGHT), lamp);
    scene.camera([0.9, 0.55], [0.0, 0.0], 30.0);
    let scene = subject(scene);
    let irradiance = |point: DVec3| {
        let distance2 = HEIGHT * HEIGHT + point.length_squared();
        let cosine = HEIGHT / distance2.sqrt();
        1e4 * 6.4e-5 * cosine * cosine / distance2 * (1.0 - schlick(cosine))
    };
    for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 50_000)] {
        let config = lamp::config(direct, photons, 0.1);
        let regions = [Region::around([24, 24], 20)];
        let by_photons = direct == Direct::Photons;
        assert_floor_is_lit_by(&scene, &config, 0.5, irradiance, &regions, by_photons, 1.0 + 1e-3);
    }
}
