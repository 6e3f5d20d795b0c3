//! The Cornell box with spheres.

use glam::dvec3;
use serde_json::{Value, json};

use super::document::{Document, Filter, clear, glass, matte, metallic_roughness, mirror, png, with_texture};
use super::mesh::Mesh;
use super::{cornell_room, stud_png};

/// The same room with a mirror and a glass sphere.
pub fn cornell_spheres() -> Document {
    let mut scene = cornell_room("cornell-spheres");
    let mirror = scene.material(mirror("mirror", [0.95; 3]));
    let glass = scene.material(clear("glass", 1.5));
    let sphere = Mesh::icosphere(0.38, 4);
    scene
        .object("mirror-sphere", &sphere, mirror)
        .at([-0.45, 0.3805, -0.35]);
    scene.object("glass-sphere", &sphere, glass).at([0.42, 0.3805, 0.35]);
    scene.camera([1.0, 3.9], [1.0, 0.0], 39.3);
    scene
}

/// The same room with a sphere of each of these materials.
fn four_spheres(name: &'static str, materials: [Value; 4]) -> Document {
    let mut scene = cornell_room(name);
    let sphere = Mesh::icosphere(0.3, 4);
    let places = [[-0.6, -0.4], [0.1, -0.55], [-0.25, 0.35], [0.5, 0.25]];
    for (material, [x, z]) in materials.into_iter().zip(places) {
        let material = scene.material(material);
        scene.object("sphere", &sphere, material).at([x, 0.3005, z]);
    }
    scene.camera([1.0, 3.9], [1.0, 0.0], 39.3);
    scene
}

/// The same room with spheres of satin and of polished metal and of plastic, rough and smooth.
pub fn glossy() -> Document {
    four_spheres(
        "glossy",
        [
            metallic_roughness("satin", [0.95, 0.7, 0.4], 1.0, 0.5),
            metallic_roughness("polished", [0.9, 0.9, 0.92], 1.0, 0.2),
            metallic_roughness("plastic", [0.15, 0.3, 0.7], 0.0, 0.35),
            metallic_roughness("lacquer", [0.6, 0.08, 0.06], 0.0, 0.0),
        ],
    )
}

/// The same room with spheres of tinted, frosted, thin and half transmissive glass.
pub fn glasses() -> Document {
    four_spheres(
        "glasses",
        [
            glass("tinted", 0.0, 1.0, Some(([0.1, 0.6, 0.3], 0.4))),
            glass("frosted", 0.35, 1.0, Some(([1.0; 3], 1.0))),
            glass("thin", 0.0, 1.0, None),
            glass("half-clear", 0.2, 0.6, Some(([0.9, 0.7, 0.2], 0.5))),
        ],
    )
}

/// The same room with coats on spheres of lacquer, metal and glass, a gem with a blue reflection, and a wall whose coat varies:
/// in patches, scratched and studded.
pub fn coats() -> Document {
    const COAT: &str = "KHR_materials_clearcoat";
    let coated = |mut material: Value, coat: Value| {
        material["extensions"][COAT] = coat;
        material
    };
    let mut gem = glass("gem", 0.0, 1.0, Some(([0.5, 0.7, 0.95], 0.5)));
    gem["extensions"]["KHR_materials_specular"] = json!({ "specularColorFactor": [0.5, 1.0, 4.0] });
    let mut scene = four_spheres(
        "coats",
        [
            coated(
                metallic_roughness("brushed", [0.7, 0.25, 0.1], 1.0, 0.5),
                json!({ "clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.35 }),
            ),
            coated(
                glass("varnished", 0.0, 1.0, Some(([0.9, 0.6, 0.2], 0.6))),
                json!({ "clearcoatFactor": 0.8, "clearcoatRoughnessFactor": 0.1 }),
            ),
            coated(
                metallic_roughness("lacquer", [0.5, 0.02, 0.02], 0.0, 0.7),
                json!({ "clearcoatFactor": 1.0 }),
            ),
            gem,
        ],
    );
    let patches = scene.texture(
        &png(4, 4, |x, y| {
            [if (x + y) % 2 == 0 { 255 } else { 0 }, 40 * y as u8 + 60, 0, 255]
        }),
        Filter::Linear,
    );
    let studs = scene.texture(&stud_png(), Filter::Linear);
    let mut wall = coated(
        matte("wall", [0.15, 0.3, 0.2]),
        json!({ "clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.8 }),
    );
    for (slot, texture) in [
        ("clearcoatTexture", patches),
        ("clearcoatRoughnessTexture", patches),
        ("clearcoatNormalTexture", studs),
    ] {
        wall = with_texture(wall, &format!("/extensions/{COAT}/{slot}"), texture);
    }
    let wall = scene.material(wall);
    let corners = [[-0.7, 0.9], [0.7, 0.9], [0.7, 1.7], [-0.7, 1.7]].map(|[x, y]| dvec3(x, y, -0.95));
    scene.object("wall", &Mesh::quad(corners).tiled(2.0), wall);
    scene
}
