//! Scenes whose pictures are known in closed form.

use glam::{DVec3, dvec3};

use super::document::{Document, clear, emitting, light, matte, mirror, one_sided};
use super::mesh::Mesh;
use super::{BLACK, ROOM, walls};

/// A grey sphere in a box of radiance 1.
pub fn furnace_diffuse() -> Document {
    let mut scene = furnace("furnace-diffuse");
    let grey = scene.material(one_sided(matte("grey", [0.5; 3])));
    scene.object("diffuse", &Mesh::icosphere(0.5, 4), grey);
    scene.camera([0.0, 2.9], [0.0, 0.0], 60.0);
    scene
}

/// A glass and a mirror sphere without absorption, in a box of radiance 1.
pub fn furnace_specular() -> Document {
    let mut scene = furnace("furnace-specular");
    let glass = scene.material(clear("glass", 1.5));
    let mirror = scene.material(mirror("mirror", [1.0; 3]));
    let sphere = Mesh::icosphere(0.5, 4);
    scene.object("glass", &sphere, glass).at([-0.7, 0.0, 0.0]);
    scene.object("mirror", &sphere, mirror).at([0.7, 0.0, 0.0]);
    scene.camera([0.0, 2.9], [0.0, 0.0], 60.0);
    scene
}

/// A closed matte room whose six sides emit Le and reflect ρ: radiance is Le / (1 − ρ) everywhere.
pub fn furnace_closed() -> Document {
    const ALBEDO: [f64; 3] = [0.2, 0.5, 0.8];
    const EMISSION: [f64; 3] = [1.0; 3];
    let mut scene = Document::new("furnace-closed");
    let wall = scene.material(emitting(matte("wall", ALBEDO), EMISSION));
    scene.object("floor", &Mesh::facing_up(ROOM, 0.0), wall);
    for (name, mesh) in walls(2.0) {
        scene.object(name, &mesh, wall);
    }
    scene.object("ceiling", &Mesh::facing_down(ROOM, 2.0), wall);
    scene.camera([1.0, 0.9], [1.0, 0.0], 90.0);
    scene
}

/// A square light above a floor, for which irradiance has a closed form.
pub fn light_area() -> Document {
    let mut scene = Document::new("light-area");
    let grey = scene.material(matte("grey", [0.5; 3]));
    let lamp = scene.material(light("light", [10.0, 5.0, 2.5]));
    scene.object("floor", &Mesh::facing_up(2.0, 0.0), grey);
    scene.object("light", &Mesh::facing_down(0.5, 2.0), lamp);
    scene.camera([1.8, 1.8], [0.0, 0.0], 40.0);
    scene
}

/// A black room with an emissive ceiling and a grey floor, part of which lies under water.
pub fn slab() -> Document {
    const HEIGHT: f64 = 2.0;
    let mut scene = Document::new("slab");
    let grey = scene.material(matte("grey", [0.5; 3]));
    let black = scene.material(matte("black", BLACK));
    let lamp = scene.material(light("light", [1.0; 3]));
    let water = scene.material(clear("water", 1.33));
    scene.object("floor", &Mesh::facing_up(ROOM, 0.0), grey);
    for (name, wall) in walls(HEIGHT) {
        scene.object(name, &wall, black);
    }
    scene.object("ceiling", &Mesh::facing_down(ROOM, HEIGHT), lamp);
    let reach = ROOM + 0.03;
    let body = Mesh::cuboid(dvec3(-0.5, -0.03, -reach), dvec3(reach, 0.4, reach));
    scene.object("water", &body, water);
    scene.camera([1.7, 0.6], [0.2, 0.0], 60.0);
    scene
}

/// A box of 6 m with walls of radiance 1 that reflect nothing.
fn furnace(name: &'static str) -> Document {
    let mut scene = Document::new(name);
    let environment = scene.material(light("env", [1.0; 3]));
    let walls = Mesh::cuboid(DVec3::splat(-3.0), DVec3::splat(3.0)).flipped();
    scene.object("env", &walls, environment);
    scene
}
