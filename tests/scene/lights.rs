//! Emissive triangles.

use std::f64::consts::PI;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use ppm_vk::internals::loader::{LightUnits, LoadOptions};
use ppm_vk::internals::packing::{EmissiveTriangle, PackedScene};
use ppm_vk::internals::scene::{Environment, LightKind};
use ppm_vk::{LoadChoice, Remark};
use serde_json::{Value, json};

use crate::fixture::Fixture;

#[test]
fn power_is_mean_radiance_times_pi_times_area_and_sides() {
    let mut room = Fixture::room();
    room.set("/materials/1/emissiveFactor", json!([1, 0.5, 0]));
    room.set(
        "/materials/1/extensions/KHR_materials_emissive_strength",
        json!({"emissiveStrength": 8}),
    );
    let mut wanted = EmissiveTriangle {
        triangle: 2,
        area: 0.5,
        power: 4.0 * PI * 0.5,
    };
    assert_eq!(room.scene().emissive_triangles(), [wanted]);
    room.set("/materials/1/doubleSided", json!(true));
    wanted.power *= 2.0;
    assert_eq!(room.scene().emissive_triangles(), [wanted]);
}

#[test]
fn areas_are_in_render_units() {
    let mut room = Fixture::room();
    room.add_parent(json!({"scale": [1000, 1000, 1000]}));
    let lights = room.scene().emissive_triangles();
    assert!((lights[0].area - 0.5).abs() < 1e-6, "{lights:?}");
}

#[test]
fn every_instance_of_a_light_emits() {
    let mut room = Fixture::room();
    room.add_root(json!({"mesh": 1, "translation": [0, -0.5, 0]}));
    assert_eq!(room.scene().emissive_triangles().len(), 2);
}

#[test]
fn a_scene_without_light_is_lit_by_radiance_1_from_all_around_with_a_note() {
    let mut unlit = Fixture::room();
    unlit.set("/materials/1/emissiveFactor", json!([0, 0, 0]));
    let mut without_lamp = Fixture::room();
    without_lamp.set("/scenes/0/nodes", json!([0, 2]));
    let mut turned_off = Fixture::room();
    turned_off.set(
        "/materials/1/extensions/KHR_materials_emissive_strength",
        json!({"emissiveStrength": 0}),
    );
    for room in [&mut unlit, &mut without_lamp, &mut turned_off] {
        let scene = room.assert_warns(&["no light", "radiance 1"]);
        assert_eq!(scene.environment, Some(Environment::constant(Vec3::ONE)));
    }
    let dim = Environment::constant(Vec3::splat(0.1));
    let scene = unlit.load_under(dim.clone()).expect("a scene");
    assert_eq!((scene.environment, scene.warnings), (Some(dim), vec![]));
    assert_eq!(Fixture::room().scene().environment, None);
}

/// The room with a lamp of this number of texels along a side, white where `shines`.
fn room_with_texels(side: u32, shines: impl Fn(u32, u32) -> bool) -> Fixture {
    let mut room = Fixture::room();
    let image = image::RgbaImage::from_fn(side, side, |x, y| image::Rgba([if shines(x, y) { 255 } else { 0 }; 4]));
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).expect("a PNG");
    let uri = format!("data:image/png;base64,{}", STANDARD.encode(png.into_inner()));
    room.set("/images", json!([{ "uri": uri }]));
    room.set("/textures", json!([{"source": 0}]));
    let texcoords = room.add_floats("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    room.set("/meshes/1/primitives/0/attributes/TEXCOORD_0", json!(texcoords));
    room.set("/materials/1/emissiveTexture", json!({"index": 0}));
    room
}

/// One texel of 4,096 emits, interpolated with its neighbours: nearly all choices go to parts of the lamp that it reaches, and
/// none to the others, though together they are the whole lamp.
#[test]
fn a_lamp_is_chosen_by_its_bright_texel() {
    let room = room_with_texels(64, |x, y| [x, y] == [20, 9]);
    let scene = room.scene();
    let packed = PackedScene::new(&scene).expect("a hierarchy");
    assert!(packed.features.parted && packed.notes.is_empty(), "{:?}", packed.notes);
    assert_eq!(packed.lights.len(), 128 * 128);
    let area: f64 = packed.lights.iter().map(|light| f64::from(light.area)).sum();
    assert!((area / scene.emissive_triangles()[0].area - 1.0).abs() < 1e-4, "{area}");
    let chosen: Vec<_> = packed.lights.iter().filter(|light| light.probability > 0.0).collect();
    assert!((32..=72).contains(&chosen.len()), "{} parts are chosen", chosen.len());
    let power = scene.emissive_triangles()[0].power;
    let mut untextured = room;
    untextured.remove("/materials/1/emissiveTexture");
    // The triangle has half of the texture's texels.
    let expected = untextured.scene().emissive_triangles()[0].power / 2048.0;
    assert!(
        (power / expected - 1.0).abs() < 0.1,
        "a power of {power}, {expected} expected"
    );
}

/// A uniform emitter is one light, and so is a dark one, which still has a probability.
#[test]
fn a_uniform_lamp_has_no_parts() {
    for is_bright in [true, false] {
        let scene = room_with_texels(64, |_, _| is_bright).scene();
        let packed = PackedScene::new(&scene).expect("a hierarchy");
        assert_eq!(
            (packed.lights.len(), packed.features.parted),
            (1, false),
            "bright: {is_bright}"
        );
        assert_eq!(packed.lights[0].probability, 1.0, "bright: {is_bright}");
    }
}

/// Of 1,024² texels every seventh emits: parts are larger than those, and a message says so.
#[test]
fn a_lamp_of_too_many_texels_has_coarser_parts_with_a_note() {
    let scene = room_with_texels(1024, |x, y| (x + 3 * y) % 49 == 0).scene();
    let packed = PackedScene::new(&scene).expect("a hierarchy");
    assert_eq!(packed.lights.len(), 256 * 256);
    assert!(
        packed.notes.len() == 1 && packed.notes[0].contains("noisier"),
        "{:?}",
        packed.notes
    );
}

/// The room with lights of KHR_lights_punctual, each at a node of its own (3, 4, …).
fn room_with(lights: &[Value]) -> Fixture {
    let mut room = Fixture::room();
    room.set("/extensionsUsed", json!(["KHR_lights_punctual"]));
    room.set("/extensionsRequired", json!(["KHR_lights_punctual"]));
    room.set("/extensions", json!({"KHR_lights_punctual": {"lights": lights}}));
    for light in 0..lights.len() {
        room.add_root(json!({"translation": [0, 2, 0], "extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    room
}

#[test]
fn punctual_lights_stand_where_their_nodes_are_and_shine_along_minus_z() {
    let mut room = room_with(&[
        json!({"type": "point", "color": [1, 0.5, 0.25], "intensity": 8, "range": 3}),
        json!({"type": "spot", "intensity": 2, "spot": {"innerConeAngle": 0.5, "outerConeAngle": 1.0}}),
        json!({"type": "directional", "intensity": 5, "range": 3}),
        json!({"type": "spot"}),
        json!({"type": "point", "intensity": 0}),
    ]);
    // Straight down; a node's scale does not affect an intensity.
    let half = 0.5_f64.sqrt();
    for node in [4, 5] {
        room.set(&format!("/nodes/{node}/rotation"), json!([-half, 0, 0, half]));
    }
    room.set("/nodes/3/scale", json!([7, 7, 7]));
    let scene = room.scene();
    let [point, spot, sun, default_spot] = scene.lights[..] else {
        panic!("{:?}", scene.lights);
    };
    // The bounds of the triangles are centred half a unit up, and scaled by 1.
    let place = Vec3::new(0.0, 1.5, 0.0);
    assert_eq!(point.kind, LightKind::Point);
    assert_eq!((point.position, point.intensity), (place, Vec3::new(8.0, 4.0, 2.0)));
    assert_eq!((point.range, spot.range, sun.range), (Some(3.0), None, None));
    let LightKind::Spot {
        direction,
        inner,
        outer,
        smooth: false,
    } = spot.kind
    else {
        panic!("{spot:?}");
    };
    assert!(direction.distance(Vec3::NEG_Y) < 1e-6 && spot.position == place);
    assert!((inner - (1.0 - 0.5_f64.cos())).abs() < 1e-7 && (outer - (1.0 - 1_f64.cos())).abs() < 1e-7);
    let LightKind::Directional { direction } = sun.kind else {
        panic!("{sun:?}");
    };
    assert!(direction.distance(Vec3::NEG_Y) < 1e-6 && sun.intensity == Vec3::splat(5.0));
    let LightKind::Spot { inner, outer, .. } = default_spot.kind else {
        panic!("{default_spot:?}");
    };
    assert!(inner == 0.0 && (outer - (1.0 - (PI / 4.0).cos())).abs() < 1e-7);
}

/// `PPMVK_light_shape` is of one light, and comes before what the options say of all.
#[test]
fn a_lights_own_shape_comes_before_that_of_all() {
    let shaped = |kind: &str, shape: Value| json!({"type": kind, "extensions": {"PPMVK_light_shape": shape}});
    let mut room = room_with(&[
        shaped("point", json!({"radius": 0.25})),
        shaped("spot", json!({"smooth": true})),
        shaped("directional", json!({"angle": 0.5})),
        shaped("point", json!({"radius": 0})),
    ]);
    room.set("/extensionsUsed", json!(["KHR_lights_punctual", "PPMVK_light_shape"]));
    let options = || LoadOptions {
        light_radius: 0.125,
        sun_angle: 1.0,
        ..LoadOptions::default()
    };
    let scene = room.load_with(options()).expect("a scene");
    let extents: Vec<f64> = scene.lights.iter().map(|light| light.extent).collect();
    assert_eq!(extents, [0.25, 0.125, 0.25, 0.0], "in units of the room");
    assert!(
        matches!(scene.lights[1].kind, LightKind::Spot { smooth: true, .. }),
        "{:?}",
        scene.lights[1]
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    for shape in [json!({"radius": -1}), json!({"angle": 4}), json!({"radius": "wide"})] {
        let error = room_with(&[shaped("point", shape.clone())])
            .load_with(options())
            .expect_err("a shape");
        assert!(error.to_string().contains("light 0"), "{shape}: {error}");
    }
}

/// Irradiance does not change when lengths are scaled: intensities scale with their squares.
#[test]
fn intensities_and_ranges_are_in_render_units() {
    let mut room = room_with(&[
        json!({"type": "point", "intensity": 8, "range": 3}),
        json!({"type": "directional", "intensity": 5}),
    ]);
    room.add_parent(json!({"scale": [10, 10, 10]}));
    let scene = room.scene();
    let [point, sun] = scene.lights[..] else {
        panic!("{:?}", scene.lights);
    };
    assert!((point.intensity.x - 0.08).abs() < 1e-8 && (sun.intensity.x - 5.0).abs() < 1e-8);
    assert!((point.range.expect("a range") - 0.3).abs() < 1e-8);
}

#[test]
fn damaged_punctual_lights_are_named() {
    for (light, parts) in [
        (json!({"type": "lamp"}), &["light 0", "type"][..]),
        (
            json!({"type": "point", "name": "sun", "intensity": -1}),
            &["light 0 \"sun\"", "intensity"],
        ),
        (json!({"type": "point", "color": [-1, 0, 0]}), &["light 0", "color"]),
        (json!({"type": "point", "range": 0}), &["light 0", "range"]),
        (
            json!({"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}}),
            &["light 0", "innerConeAngle"],
        ),
        (
            json!({"type": "spot", "spot": {"outerConeAngle": 2}}),
            &["light 0", "outerConeAngle"],
        ),
    ] {
        room_with(&[light]).assert_fails(parts);
    }
    let mut room = room_with(&[json!({"type": "point"})]);
    room.set("/nodes/3/extensions/KHR_lights_punctual/light", json!(9));
    room.assert_fails(&["node 3", "no light 9", "the file has 1"]);
    let mut room = room_with(&[json!({"type": "directional"})]);
    room.remove("/nodes/3/translation");
    room.set(
        "/nodes/3/matrix",
        json!([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1]),
    );
    room.assert_warns(&["light 0", "direction", "skipped"]);
}

/// Lights too dim or small to be chosen by their flux are still chosen: all probabilities sum up to 1.
#[test]
fn every_light_has_a_share_of_the_choices() {
    let mut room = room_with(&[
        json!({"type": "point", "intensity": 1e-12}),
        json!({"type": "directional", "intensity": 1e6}),
    ]);
    room.add_root(json!({"mesh": 1, "translation": [0, 0.5, 0], "scale": [1e-6, 1e-6, 1e-6]}));
    let scene = room.load_under(Environment::constant(Vec3::ONE)).expect("a scene");
    let packed = PackedScene::new(&scene).expect("a hierarchy");
    assert_eq!(packed.lights.len(), 5);
    // A tenth of the choices is distributed equally to the two lamps, the two punctual lights and the environment.
    assert!(
        packed.lights.iter().all(|light| light.probability >= 0.1 / 5.0),
        "{:?}",
        packed.lights
    );
    let sum: f64 = packed.lights.iter().map(|light| f64::from(light.probability)).sum();
    assert!((sum - 1.0).abs() < 1e-6, "{sum}");
}

/// Blender's exporter multiplies lamps by 683 in its default units, but not emissive surfaces.
#[test]
fn lamps_of_blenders_exporter_are_divided_by_683_with_a_note() {
    let lights = [
        json!({"type": "point", "intensity": 6830}),
        json!({"type": "directional", "intensity": 683}),
    ];
    let mut room = room_with(&lights);
    let intensities = |room: &Fixture, light_units: LightUnits| {
        let options = LoadOptions {
            light_units,
            ..LoadOptions::default()
        };
        let scene = room.load_with(options).expect("a scene");
        let found = scene.lights.iter().map(|light| light.intensity.x).collect::<Vec<_>>();
        let power = scene.emissive_triangles()[0].power;
        (found, scene.notes, power)
    };
    let (taken, divided) = (vec![6830.0, 683.0], vec![10.0, 1.0]);
    let power = intensities(&room, LightUnits::Spec).2;
    for (generator, units, expected, said) in [
        ("Khronos glTF Blender I/O v5.3.43", LightUnits::Auto, &divided, true),
        ("Khronos glTF Blender I/O v5.3.43", LightUnits::Spec, &taken, false),
        ("another", LightUnits::Auto, &taken, false),
        ("another", LightUnits::Blender, &divided, false),
    ] {
        room.set("/asset/generator", json!(generator));
        let (found, notes, lamp) = intensities(&room, units);
        assert_eq!(&found, expected, "{generator}, {units:?}");
        assert_eq!(lamp, power, "what emits is taken as it is: {generator}, {units:?}");
        assert_eq!(notes.len(), usize::from(said), "{generator}, {units:?}: {notes:?}");
        let says = |note: &Remark| note.contains("683") && note.choice() == Some(LoadChoice::LightUnits);
        assert!(notes.iter().all(says), "{notes:?}");
    }
    let mut unlit = Fixture::room();
    unlit.set("/asset/generator", json!("Khronos glTF Blender I/O v5.3.43"));
    assert_eq!(unlit.scene().notes, [""; 0], "without a lamp there is nothing to say");
}
