//! Emissive triangles.

use std::f64::consts::PI;

use ppm_vk::scene::EmissiveTriangle;
use serde_json::json;

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
        emitting_area: 0.5,
        power: 4.0 * PI * 0.5,
    };
    assert_eq!(room.scene().emissive_triangles(), [wanted]);
    room.set("/materials/1/doubleSided", json!(true));
    wanted.emitting_area *= 2.0;
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
fn a_scene_without_light_is_refused() {
    let mut room = Fixture::room();
    room.set("/materials/1/emissiveFactor", json!([0, 0, 0]));
    room.assert_fails(&["no light", "emissiveFactor"]);

    let mut room = Fixture::room();
    room.set("/scenes/0/nodes", json!([0, 2]));
    room.assert_fails(&["no light"]);

    let mut room = Fixture::room();
    room.set(
        "/materials/1/extensions/KHR_materials_emissive_strength",
        json!({"emissiveStrength": 0}),
    );
    room.assert_fails(&["no light"]);
}

#[test]
fn punctual_lights_are_skipped_with_a_warning() {
    let mut room = Fixture::room();
    room.set("/extensionsUsed", json!(["KHR_lights_punctual"]));
    room.set(
        "/extensions",
        json!({"KHR_lights_punctual": {"lights": [{"type": "point"}, {"type": "spot", "spot": {}}]}}),
    );
    for light in 0..2 {
        room.add_root(json!({"extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    room.assert_warns(&["KHR_lights_punctual", "2 lights are skipped"]);
    room.set("/extensionsRequired", json!(["KHR_lights_punctual"]));
    room.assert_fails(&["requires the extension \"KHR_lights_punctual\""]);
}
