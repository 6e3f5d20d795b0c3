//! Scenes in which nearly all photons miss the visible surfaces, unless they are aimed.

use glam::{DVec3, dvec3};
use serde_json::json;

use super::document::{Document, clear, light, matte, metallic_roughness, mirror};
use super::mesh::Mesh;

/// Index of refraction of the glass in these scenes.
const GLASS: f64 = 1.5;

/// A glass ball on a table in the sun.
pub fn table() -> Document {
    ball_in_the_sun("table", 0.3)
}

/// The same ball on the ground of a stadium.
pub fn stadium() -> Document {
    ball_in_the_sun("stadium", 100.0)
}

/// A glass ball with a radius of 5 cm over a floor, in the sun.
fn ball_in_the_sun(name: &'static str, half_side: f64) -> Document {
    let mut scene = Document::new(name);
    let floor = scene.material(matte("floor", [0.5; 3]));
    let glass = scene.material(clear("glass", GLASS));
    scene.object("floor", &Mesh::facing_up(half_side, 0.0), floor);
    scene
        .object("ball", &Mesh::icosphere(0.05, 3), glass)
        .at([0.0, 0.06, 0.0]);
    sun(&mut scene, dvec3(0.6, -1.0, -0.3), 5.0);
    scene.camera_from(dvec3(0.1, 0.45, 0.35), dvec3(0.05, 0.01, -0.02), 34.4);
    scene
}

/// A room with the sun in a window of glass, and a large courtyard outside.
pub fn sun_room() -> Document {
    let mut scene = room_in_a_courtyard("sun-room", 50.0, SUN);
    let pane = scene.material(clear("pane", GLASS));
    // The pane reaches into the wall, so that there is no gap and no coincident faces.
    let [min, max] = [WINDOW[0] - dvec3(0.0, 0.01, 0.01), WINDOW[1] + dvec3(0.0, 0.01, 0.01)];
    let pane_of_glass = Mesh::cuboid(min.with_x(2.1), max.with_x(2.12));
    scene.object("pane", &pane_of_glass, pane);
    scene
}

/// The same room without the pane, the sun weakened by the pane's reflection.
pub fn sun_room_open() -> Document {
    let reflected = reflectance(-TO_ROOM.normalize().x, GLASS);
    // Light is reflected between the pane's two faces.
    room_in_a_courtyard("sun-room-open", 50.0, SUN * (1.0 - reflected) / (1.0 + reflected))
}

/// Direction of the sun's light in the room, and its irradiance.
const TO_ROOM: DVec3 = dvec3(-1.0, -0.8, 0.15);
const SUN: f64 = 20.0;

/// Fresnel reflectance of unpolarised light for a cosine and a relative index.
fn reflectance(cosine: f64, index: f64) -> f64 {
    let inside = (1.0 - (1.0 - cosine * cosine) / (index * index)).sqrt();
    let across = (cosine - index * inside) / (cosine + index * inside);
    let along = (index * cosine - inside) / (index * cosine + inside);
    0.5 * (across * across + along * along)
}

/// A smaller courtyard, and half-closed blinds in the window.
pub fn blinds() -> Document {
    const SLATS: u32 = 20;
    let mut scene = room_in_a_courtyard("blinds", 10.0, 3.0 * SUN);
    let slat = scene.material(matte("slat", [0.8, 0.75, 0.65]));
    let half = dvec3(0.035, 0.003, 0.79);
    let slats = scene.mesh("slat", &Mesh::cuboid(-half, half), slat);
    let [low, high] = WINDOW;
    let step = (high.y - low.y) / f64::from(SLATS);
    for number in 0..SLATS {
        let y = low.y + (f64::from(number) + 0.5) * step;
        let mut slat = scene.again("slat", slats);
        // The outer edge is the upper one, and lets a quarter of the sun pass.
        slat.at([0.5 * (low.x + high.x), y, 0.0]).rotated([0.0, 0.0, 1.0], 0.2);
    }
    scene
}

/// Corners of the room's window, in the wall to the east.
const WINDOW: [DVec3; 2] = [dvec3(2.0, 0.9, -0.8), dvec3(2.25, 2.2, 0.8)];

/// A room of 4 m with a window and thick walls, the sun outside, and a camera in a corner.
fn room_in_a_courtyard(name: &'static str, half_courtyard: f64, irradiance: f64) -> Document {
    let mut scene = Document::new(name);
    let wall = scene.material(matte("wall", [0.75, 0.75, 0.72]));
    let boards = scene.material(matte("boards", [0.5, 0.35, 0.22]));
    let [low, high] = WINDOW;
    for (name, material, min, max) in [
        ("floor", boards, [-2.25, -0.25, -2.25], [2.25, 0.0, 2.25]),
        ("ceiling", wall, [-2.25, 2.8, -2.25], [2.25, 3.05, 2.25]),
        ("west", wall, [-2.25, 0.0, -2.25], [-2.0, 2.8, 2.25]),
        ("north", wall, [-2.0, 0.0, -2.25], [2.0, 2.8, -2.0]),
        ("south", wall, [-2.0, 0.0, 2.0], [2.0, 2.8, 2.25]),
        ("sill", wall, [low.x, 0.0, -2.25], [high.x, low.y, 2.25]),
        ("lintel", wall, [low.x, high.y, -2.25], [high.x, 2.8, 2.25]),
        ("left", wall, [low.x, low.y, -2.25], [high.x, high.y, low.z]),
        ("right", wall, [low.x, low.y, high.z], [high.x, high.y, 2.25]),
    ] {
        scene.object(name, &Mesh::cuboid(min.into(), max.into()), material);
    }
    let court = scene.material(matte("court", [0.3; 3]));
    scene.object("court", &Mesh::facing_up(half_courtyard, -0.5), court);
    sun(&mut scene, TO_ROOM, irradiance);
    scene.camera_from(dvec3(-1.7, 1.5, 1.7), dvec3(0.6, 0.7, -0.6), 57.3);
    scene
}

/// Light of the sun: its direction, and the irradiance across it.
fn sun(scene: &mut Document, direction: DVec3, irradiance: f64) {
    let sun = json!({ "name": "sun", "type": "directional", "intensity": irradiance });
    scene.punctual(sun).towards(direction);
}

/// A golden ring in a floor, under a lamp of 60 cm at a distance of 25 m.
pub fn far_lamp() -> Document {
    let mut scene = Document::new("far-lamp");
    let floor = scene.material(matte("floor", [0.75; 3]));
    let gold = scene.material(mirror("gold", [1.0, 0.782, 0.344]));
    let lamp = scene.material(light("lamp", [1900.0, 1780.0, 1600.0]));
    scene.object("floor", &Mesh::facing_up(3.0, 0.0), floor);
    scene.object("ring", &Mesh::ring(0.46, 0.5, -0.02, 0.24, 256), gold);
    let place = 25.0 * dvec3(2.2, 1.9, -0.6).normalize();
    scene.object("lamp", &Mesh::facing(place, DVec3::ZERO, 0.3), lamp);
    scene.camera([2.0, 1.35], [0.0, 0.0], 40.0);
    scene
}

/// A building of 64 cells, each with its own lamp; the camera sees one of them.
pub fn many_lamps() -> Document {
    const CELLS: u32 = 8;
    const CELL: f64 = 2.5;
    const HEIGHT: f64 = 2.2;
    let half = 0.5 * CELL * f64::from(CELLS);
    let mut scene = Document::new("many-lamps");
    let plaster = scene.material(matte("plaster", [0.7, 0.68, 0.62]));
    let tiles = scene.material(matte("tiles", [0.35, 0.4, 0.5]));
    let lamp = scene.material(light("lamp", [150.0, 135.0, 110.0]));
    let reach = half + 0.1;
    let slab = |half_side: f64, bottom: f64, top: f64| {
        Mesh::cuboid(dvec3(-half_side, bottom, -half_side), dvec3(half_side, top, half_side))
    };
    scene.object("floor", &slab(reach, -0.1, 0.0), tiles);
    scene.object("ceiling", &slab(reach, HEIGHT, HEIGHT + 0.1), plaster);
    // The walls reach into floor and ceiling.
    for wall in 0..=CELLS {
        let at = CELL * f64::from(wall) - half;
        let across = Mesh::cuboid(dvec3(-half, -0.05, at - 0.05), dvec3(half, HEIGHT + 0.05, at + 0.05));
        let along = Mesh::cuboid(dvec3(at - 0.05, -0.05, -half), dvec3(at + 0.05, HEIGHT + 0.05, half));
        scene.object("across", &across, plaster);
        scene.object("along", &along, plaster);
    }
    let lamps = scene.mesh("lamp", &Mesh::facing_down(0.1, HEIGHT - 0.002), lamp);
    for (x, z) in (0..CELLS).flat_map(|x| (0..CELLS).map(move |z| (x, z))) {
        let [x, z] = [x, z].map(|cell| CELL * (f64::from(cell) + 0.5) - half);
        scene.again("lamp", lamps).at([x, 0.0, z]);
    }
    // The visible cell: between x = 0, z = 0 and x = CELL, z = CELL.
    scene
        .object("block", &slab(0.3, 0.0005, 0.7), plaster)
        .at([1.7, 0.0, 0.8])
        .rotated([0.0, 1.0, 0.0], 0.4);
    let satin = scene.material(metallic_roughness("satin", [0.95, 0.7, 0.4], 1.0, 0.5));
    let ball = Mesh::icosphere(0.3, 3);
    scene.object("ball", &ball, satin).at([1.0, 0.3005, 1.2]);
    scene.camera_from(dvec3(0.3, 1.5, 2.2), dvec3(1.5, 0.6, 0.9), 70.0);
    scene
}
