//! Glass without a volume: thin by the specification, or solid by `LoadOptions::solid_glass` if its mesh is closed.

use ppm_vk::internals::loader::LoadOptions;
use ppm_vk::internals::scene::{Dielectric, Scene, Surface};
use serde_json::json;

use crate::fixture::Fixture;

/// A tetrahedron's corners, three for each face, without normals, so that faces share no vertices.
fn tetrahedron() -> Vec<[f32; 3]> {
    let [a, b, c, d] = [[0.0, 0.1, 0.0], [0.4, 0.1, 0.0], [0.0, 0.5, 0.0], [0.0, 0.1, 0.4]];
    [[a, c, b], [a, b, d], [b, c, d], [a, d, c]].concat()
}

/// The room, with a floor of glass without a volume, and an object of the same glass with these corners.
fn room_with_glass(corners: &[[f32; 3]]) -> Fixture {
    let mut room = Fixture::room();
    room.set(
        "/materials/0",
        json!({
            "name": "glass",
            "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
            "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_ior": {"ior": 1.33}
            }
        }),
    );
    let positions = room.add_vectors(corners);
    room.set(
        "/meshes/-",
        json!({"name": "drop", "primitives": [{"attributes": {"POSITION": positions}, "material": 0}]}),
    );
    room.add_root(json!({"name": "drop", "mesh": 2}));
    room
}

fn solid_glass(room: &Fixture) -> Scene {
    let options = LoadOptions {
        solid_glass: true,
        ..LoadOptions::default()
    };
    room.load_with(options).expect("a scene")
}

/// The glass of an object.
fn glass_of(scene: &Scene, name: &str) -> Dielectric {
    let object = scene
        .objects
        .iter()
        .find(|object| object.name == name)
        .expect("an object");
    match scene.materials[object.material as usize].surface {
        Surface::Dielectric(glass) => glass,
        other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn glass_without_a_volume_is_thin_and_named() {
    let scene = room_with_glass(&tetrahedron()).scene();
    assert!(glass_of(&scene, "drop").thin && glass_of(&scene, "floor").thin);
    let [note] = &scene.notes[..] else {
        panic!("one note expected: {:?}", scene.notes);
    };
    for part in ["material 0 \"glass\"", "thin wall", "bend light"] {
        assert!(note.contains(part), "no {part:?} in: {note}");
    }
}

#[test]
fn closed_meshes_of_it_are_solid_where_that_is_asked_for_and_open_ones_named() {
    let scene = solid_glass(&room_with_glass(&tetrahedron()));
    let drop = glass_of(&scene, "drop");
    assert_eq!((drop.thin, drop.ior), (false, 1.33));
    assert!(glass_of(&scene, "floor").thin, "a floor of two triangles has no inside");
    let [note] = &scene.notes[..] else {
        panic!("one note expected: {:?}", scene.notes);
    };
    assert!(note.contains("\"floor\"") && !note.contains("\"drop\""), "{note}");
}

/// A hole, a flipped face, and all faces flipped.
#[test]
fn glass_without_an_inside_stays_thin() {
    let turned = |corners: &[[f32; 3]]| -> Vec<[f32; 3]> {
        corners.chunks(3).flat_map(|face| [face[0], face[2], face[1]]).collect()
    };
    let whole = tetrahedron();
    let one_turned = [&whole[..9], &turned(&whole[9..])].concat();
    for (what, corners) in [
        ("a hole", whole[..9].to_vec()),
        ("a face turned round", one_turned),
        ("inside out", turned(&whole)),
    ] {
        let scene = solid_glass(&room_with_glass(&corners));
        assert!(glass_of(&scene, "drop").thin, "{what}");
        assert!(scene.notes[0].contains("\"drop\""), "{what}: {:?}", scene.notes);
    }
}

/// Blender splits a mesh by material: half of it alone is not closed.
#[test]
fn a_mesh_of_two_materials_is_closed_as_a_whole() {
    let whole = tetrahedron();
    let mut room = room_with_glass(&whole[..6]);
    let rest = room.add_vectors(&whole[6..]);
    room.set(
        "/meshes/2/primitives/-",
        json!({"attributes": {"POSITION": rest}, "material": 1}),
    );
    assert!(!glass_of(&solid_glass(&room), "drop").thin);
}

/// A volume of thickness 0 defines the glass's absorption.
#[test]
fn solid_glass_absorbs_as_a_volume_without_thickness_says() {
    let mut room = room_with_glass(&tetrahedron());
    room.set(
        "/materials/0/extensions/KHR_materials_volume",
        json!({"thicknessFactor": 0, "attenuationColor": [1, 0.5, 1], "attenuationDistance": 1}),
    );
    let scene = solid_glass(&room);
    let absorbed = glass_of(&scene, "drop").absorption.y * scene.normalisation.scale as f32;
    assert!((absorbed - 0.5_f32.recip().ln()).abs() < 1e-6, "{absorbed}");
    assert_eq!(glass_of(&scene, "floor").absorption.y, 0.0);
}

#[test]
fn instances_that_share_triangles_become_solid_together() {
    let mut room = room_with_glass(&tetrahedron());
    for i in 0..40 {
        room.add_root(json!({"name": "drop", "mesh": 2, "translation": [0.01 * f64::from(i), 0, 0]}));
    }
    let scene = solid_glass(&room);
    let drops = scene.objects.iter().filter(|object| object.name == "drop");
    let materials: Vec<u32> = drops.map(|drop| drop.material).collect();
    assert_eq!(materials, [materials[0]; 41]);
    assert!(!glass_of(&scene, "drop").thin);
}
