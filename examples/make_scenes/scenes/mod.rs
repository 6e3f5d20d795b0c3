//! The scenes of this repository. Units are metres, y is up; radiance is linear RGB.

mod document;
mod hard;
mod known;
mod mesh;
mod spheres;

use document::{Document, File, Filter, clear, glass, light, matte, metallic_roughness, mirror, png, with_texture};
use glam::{DVec3, dvec2, dvec3};
use mesh::Mesh;
use serde_json::json;
use std::f64::consts::FRAC_PI_2;

/// Half the side of the rooms, which stand on the origin.
const ROOM: f64 = 1.0;
const WHITE: [f64; 3] = [0.73; 3];
const BLACK: [f64; 3] = [0.0; 3];

/// Every file of every scene.
pub fn all() -> Vec<File> {
    [
        cornell(),
        spheres::cornell_spheres(),
        spheres::glossy(),
        spheres::glasses(),
        spheres::coats(),
        textures(),
        instances(),
        ring(),
        pool("pool", false),
        pool("pool-tiles", true),
        known::furnace_diffuse(),
        known::furnace_specular(),
        known::furnace_closed(),
        known::light_area(),
        lights(),
        plaza(),
        known::slab(),
        hard::table(),
        hard::stadium(),
        hard::sun_room(),
        hard::sun_room_open(),
        hard::blinds(),
        hard::far_lamp(),
        hard::many_lamps(),
    ]
    .into_iter()
    .flat_map(Document::finish)
    .collect()
}

/// A Cornell box: matte walls, a square light, two blocks.
fn cornell() -> Document {
    let mut scene = cornell_room("cornell");
    let white = scene.material(matte("box", WHITE));
    let block = |height: f64| Mesh::cuboid(dvec3(-0.3, 0.0, -0.3), dvec3(0.3, height, 0.3));
    // The gap separates the blocks' lower sides from the floor.
    let mut tall = scene.object("tall", &block(1.2), white);
    tall.at([-0.35, 0.0005, -0.3])
        .rotated([0.0, 1.0, 0.0], 18_f64.to_radians());
    let mut short = scene.object("short", &block(0.6), white);
    short
        .at([0.33, 0.0005, 0.35])
        .rotated([0.0, 1.0, 0.0], -17_f64.to_radians());
    scene.camera([1.0, 3.9], [1.0, 0.0], 39.3);
    scene
}

/// A golden ring on a table, lit from the side: the cardioid caustic.
fn ring() -> Document {
    let mut scene = Document::new("ring");
    let table = scene.material(matte("table", [0.75; 3]));
    let gold = scene.material(mirror("gold", [1.0, 0.782, 0.344]));
    let lamp = scene.material(light("light", [160.0, 150.0, 135.0]));
    scene.object("table", &Mesh::facing_up(3.0, 0.0), table);
    scene.object("ring", &Mesh::ring(0.46, 0.5, 0.002, 0.24, 256), gold);
    scene.object("light", &Mesh::facing(dvec3(2.2, 1.9, -0.6), DVec3::ZERO, 0.12), lamp);
    scene.camera([2.0, 1.35], [0.0, 0.0], 40.0);
    scene
}

/// Wavy water over a floor, under a small light: caustics seen through the surface that causes them.
fn pool(name: &'static str, tiles: bool) -> Document {
    const HEIGHT: f64 = 2.6;
    let mut scene = Document::new(name);
    let floor = if tiles {
        let texture = scene.texture(&tile_png(), Filter::Nearest);
        let tiles = matte("tiles", [1.0; 3]);
        scene.material(with_texture(tiles, "/pbrMetallicRoughness/baseColorTexture", texture))
    } else {
        scene.material(matte("floor", [0.7; 3]))
    };
    let white = scene.material(matte("white", WHITE));
    let lamp = scene.material(light("light", [170.0, 160.65, 142.12]));
    let water = scene.material(clear("water", 1.33));
    scene.object("floor", &Mesh::facing_up(ROOM, 0.0).tiled(8.0), floor);
    for (name, wall) in walls(HEIGHT) {
        scene.object(name, &wall, white);
    }
    scene.object("ceiling", &Mesh::facing_down(ROOM, HEIGHT), white);
    scene.object("light", &Mesh::facing_down(0.08, HEIGHT - 0.002), lamp);
    // The water reaches into the walls and the floor, so that there is no gap and no coincident faces.
    let body = Mesh::body_of_liquid(ROOM + 0.03, -0.03, 96, waves);
    scene.object("water", &body, water);
    scene.camera([2.15, 0.93], [0.25, -0.25], 62.0);
    scene
}

/// Height of the pool's water, and its derivatives in x and z.
fn waves(x: f64, z: f64) -> [f64; 3] {
    /// Amplitude, wave numbers in x and z, phase.
    const WAVES: [[f64; 4]; 5] = [
        [0.012, 10.2, 4.6, 0.3],
        [0.0096, -7.4, 12.4, 1.1],
        [0.0054, 16.6, -9.8, 2.7],
        [0.0048, 4.4, 19.4, 4.0],
        [0.00264, -22.6, -12.2, 0.9],
    ];
    WAVES
        .iter()
        .fold([0.7, 0.0, 0.0], |[y, slope_x, slope_z], [a, kx, kz, phase]| {
            let (sin, cos) = (kx * x + kz * z + phase).sin_cos();
            [y + a * sin, slope_x + a * kx * cos, slope_z + a * kz * cos]
        })
}

/// One tile with half of its joints, 8 × 8 texels.
fn tile_png() -> Vec<u8> {
    png(8, 8, |x, y| {
        if x == 0 || y == 0 {
            [235, 240, 240, 255]
        } else {
            [150, 190, 200, 255]
        }
    })
}

/// A normal map of a round stud.
fn stud_png() -> Vec<u8> {
    png(32, 32, |x, y| {
        let at = |place: u32| (f64::from(place) + 0.5) / 16.0 - 1.0;
        let (x, y) = (at(x), -at(y));
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let normal = if z > 0.5 { [x, y, z] } else { [0.0, 0.0, 1.0] };
        let [r, g, b] = normal.map(|value| (127.5 + 127.5 * value).round() as u8);
        [r, g, b, 255]
    })
}

/// The same room with a few meshes that many nodes show: rotated, stretched, mirrored, in rotated and stretched groups; glass
/// that stands on the floor, and one glass inside another.
fn instances() -> Document {
    const UP: [f64; 3] = [0.0, 1.0, 0.0];
    let tilted = DVec3::new(1.0, 2.0, 2.0).normalize().to_array();
    let mut scene = cornell_room("instances");
    let studs = scene.texture(&stud_png(), Filter::Linear);
    let tiles = scene.texture(&tile_png(), Filter::Nearest);
    let studded = metallic_roughness("studded", [0.9, 0.7, 0.5], 0.0, 0.4);
    let studded = with_texture(studded, "/normalTexture", studs);
    let studded = scene.material(with_texture(studded, "/pbrMetallicRoughness/baseColorTexture", tiles));
    let mut ball = Mesh::icosphere(0.25, 2);
    let place = |p: &DVec3| dvec2(2.0 * p.x.atan2(p.z), 4.0 * p.y) * 2.0;
    ball.texcoords = ball.positions.iter().map(place).collect();
    let ball = scene.mesh("ball", &ball, studded);
    scene.again("ball", ball).at([-0.6, 1.0, -0.5]);
    let mut mirrored = scene.again("mirrored", ball);
    mirrored
        .at([0.0, 1.1, -0.6])
        .rotated(tilted, 0.7)
        .scaled([-1.0, 1.0, 1.0]);
    let mut egg = scene.again("egg", ball);
    egg.at([0.6, 1.0, -0.5]).rotated(tilted, 2.0).scaled([0.7, 1.5, 0.9]);
    scene.again("left", ball).at([-0.4, 0.0, 0.0]).rotated(tilted, 1.0);
    scene.again("right", ball).at([0.4, 0.0, 0.0]).scaled([0.8, -0.8, 0.8]);
    let mut pair = scene.group("pair", 2);
    pair.at([0.0, 0.4, -0.2]).rotated(UP, 0.3).scaled([1.2, 0.6, 0.8]);

    let white = scene.material(matte("hoop", WHITE));
    let hoop = scene.mesh("hoop", &Mesh::ring(0.2, 0.24, -0.04, 0.04, 24), white);
    scene.again("hoop", hoop);
    scene
        .again("smaller", hoop)
        .rotated([0.0, 0.0, 1.0], 1.2)
        .scaled([0.7, 0.7, 0.7]);
    let mut hoops = scene.group("hoops", 2);
    hoops.at([0.1, 0.3, 0.5]).rotated([1.0, 0.0, 0.0], 0.9);

    let glass = scene.material(clear("glass", 1.5));
    let glass = scene.mesh("glass", &Mesh::ring(0.12, 0.25, 0.0, 0.16, 20), glass);
    scene.again("glass", glass).at([-0.55, 0.0, 0.5]);
    let mut other = scene.again("other glass", glass);
    other.at([0.6, 0.0, 0.5]).rotated(UP, 0.5).scaled([1.0, 1.5, 0.7]);
    scene.camera([1.0, 3.9], [1.0, 0.0], 39.3);
    scene
}

/// The same room with a checkered floor, a studded wall, a fence, a half transparent pane, a ball of metal and plaster, and a
/// lamp of two colours: every kind of texture.
fn textures() -> Document {
    let mut scene = cornell_room("textures");
    let color = "/pbrMetallicRoughness/baseColorTexture";
    let checker = scene.texture(
        &png(2, 2, |x, y| {
            if x == y {
                [200, 60, 40, 255]
            } else {
                [230, 225, 210, 255]
            }
        }),
        Filter::Nearest,
    );
    let studs = scene.texture(&stud_png(), Filter::Linear);
    let fence = scene.texture(
        &png(8, 8, |x, y| [120, 90, 50, if x % 4 == 0 || y == 4 { 255 } else { 0 }]),
        Filter::Nearest,
    );
    let metal = scene.texture(
        &png(8, 8, |x, y| {
            [
                0,
                if y % 2 == 0 { 80 } else { 200 },
                if x % 4 < 2 { 255 } else { 0 },
                255,
            ]
        }),
        Filter::Nearest,
    );
    let shine = scene.texture(
        &png(2, 1, |x, _| {
            if x == 0 {
                [255, 120, 60, 255]
            } else {
                [60, 120, 255, 255]
            }
        }),
        Filter::Linear,
    );
    let panel = |z: f64, low: f64, high: f64| {
        Mesh::quad([[-0.5, low], [0.5, low], [0.5, high], [-0.5, high]].map(|[x, y]| dvec3(x, y, z)))
    };
    let checkered = scene.material(with_texture(matte("checkered", [1.0; 3]), color, checker));
    let mut tiles = Mesh::facing_up(0.9, 0.001);
    tiles.texcoords.iter_mut().for_each(|place| *place *= 3.0);
    scene.object("checkered", &tiles, checkered);
    let studded = metallic_roughness("studded", [0.9, 0.8, 0.6], 0.0, 0.4);
    let studded = scene.material(with_texture(studded, "/normalTexture", studs));
    let mut wall = panel(-0.95, 0.4, 1.4);
    wall.texcoords.iter_mut().for_each(|place| *place *= 4.0);
    scene.object("studded", &wall, studded);
    let mut fenced = with_texture(matte("fence", [1.0; 3]), color, fence);
    fenced["alphaMode"] = "MASK".into();
    let fenced = scene.material(fenced);
    scene.object("fence", &panel(0.5, 0.002, 0.4), fenced);
    let mut smoke = matte("smoke", [0.1; 3]);
    smoke["alphaMode"] = "BLEND".into();
    smoke["pbrMetallicRoughness"]["baseColorFactor"][3] = 0.4.into();
    let smoke = scene.material(smoke);
    scene.object("smoke", &panel(0.0, 0.6, 1.2), smoke).at([0.4, 0.0, 0.2]);
    let mixed = metallic_roughness("mixed", [0.9, 0.7, 0.5], 1.0, 1.0);
    let mixed = scene.material(with_texture(
        mixed,
        "/pbrMetallicRoughness/metallicRoughnessTexture",
        metal,
    ));
    scene
        .object("mixed", &panel(0.1, 0.002, 0.6), mixed)
        .at([-0.4, 0.0, 0.0]);
    let glow = with_texture(light("glow", [3.0; 3]), "/emissiveTexture", shine);
    let glow = scene.material(glow);
    scene.object("glow", &panel(0.0, 0.0, 0.2), glow).at([0.0, 0.05, -0.6]);
    scene.camera([1.0, 3.9], [1.0, 0.0], 39.3);
    scene
}

/// A glass and a matte sphere under a point light, a spotlight and a sun, all without extent.
fn lights() -> Document {
    let mut scene = Document::new("lights");
    let floor = scene.material(matte("floor", [0.7; 3]));
    let glass = scene.material(clear("glass", 1.5));
    let clay = scene.material(matte("clay", [0.7, 0.4, 0.3]));
    let sphere = Mesh::icosphere(0.4, 4);
    scene.object("floor", &Mesh::facing_up(3.0, 0.0), floor);
    scene.object("glass", &sphere, glass).at([-0.5, 0.5, 0.0]);
    scene.object("clay", &sphere, clay).at([0.6, 0.4005, -0.2]);
    let down = -FRAC_PI_2;
    let lamp = json!({ "name": "lamp", "type": "point", "color": [1.0, 0.7, 0.4], "intensity": 3.0, "range": 6.0 });
    scene.punctual(lamp).at([1.5, 1.2, 1.0]);
    let cone = json!({ "innerConeAngle": 0.3, "outerConeAngle": 0.5 });
    let spot = json!({ "name": "spot", "type": "spot", "color": [0.5, 0.8, 1.0], "intensity": 20.0, "spot": cone });
    scene.punctual(spot).at([-0.5, 2.5, 0.0]).rotated([1.0, 0.0, 0.0], down);
    let sun = json!({ "name": "sun", "type": "directional", "intensity": 0.7 });
    scene.punctual(sun).rotated([1.0, 0.0, 0.0], 0.6 * down);
    scene.camera([1.8, 3.2], [0.3, 0.0], 35.0);
    scene
}

/// Objects under punctual lights, with an orthographic camera: enamel with a coloured reflection, an alloy, polished metal, a
/// studded column, a thin frosted pane, ground with vertex colours. Nothing is smooth, so that a path tracer finds all light.
fn plaza() -> Document {
    let mut scene = Document::new("plaza");
    let ground = scene.material(matte("ground", [0.8; 3]));
    let color = |x: f64, z: f64| dvec3(0.5 + 0.4 * (2.0 * x).sin(), 0.5 + 0.4 * (2.0 * z).cos(), 0.4);
    scene.object("ground", &Mesh::colored(2.0, 16, color), ground);
    let mut enamel = metallic_roughness("enamel", [0.5, 0.5, 0.6], 0.0, 0.4);
    enamel["extensions"] = json!({
        "KHR_materials_ior": { "ior": 2.2 },
        "KHR_materials_specular": { "specularFactor": 0.9, "specularColorFactor": [2.5, 0.8, 0.2] },
    });
    let sphere = Mesh::icosphere(0.4, 4);
    let polished = metallic_roughness("polished", [0.95, 0.8, 0.5], 1.0, 0.25);
    let alloy = metallic_roughness("alloy", [0.3, 0.5, 0.8], 0.5, 0.4);
    for (material, [x, z]) in [(enamel, [-1.1, 0.5]), (polished, [0.0, 0.9]), (alloy, [1.1, 0.5])] {
        let material = scene.material(material);
        scene.object("sphere", &sphere, material).at([x, 0.4005, z]);
    }
    let studs = scene.texture(&stud_png(), Filter::Linear);
    let studded = metallic_roughness("studded", [0.8, 0.7, 0.6], 0.0, 0.5);
    let mut studded = with_texture(studded, "/normalTexture", studs);
    studded["normalTexture"]["extensions"] =
        json!({ "KHR_texture_transform": { "scale": [1.0, 2.0], "offset": [0.1, 0.2], "rotation": 0.3 } });
    studded["doubleSided"] = true.into();
    let studded = scene.material(studded);
    let column = Mesh::column(0.5, 1.5, 24, 6.0);
    scene.object("column", &column, studded).at([-0.5, 0.001, -0.7]);
    let mut pane = glass("pane", 0.4, 0.8, None);
    pane["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.9, 0.6, 0.3, 1.0]);
    let pane = scene.material(pane);
    let square = [[-0.5, 0.0], [0.5, 0.0], [0.5, 1.2], [-0.5, 1.2]].map(|[x, y]| dvec3(x, y, 0.0));
    scene
        .object("pane", &Mesh::quad(square), pane)
        .at([0.9, 0.002, -0.5])
        .rotated([0.0, 1.0, 0.0], -0.5);
    let lamp = json!({ "name": "lamp", "type": "point", "color": [1.0, 0.7, 0.4], "intensity": 4.0, "range": 3.0 });
    scene.punctual(lamp).at([0.6, 1.4, 1.4]);
    let cone = json!({ "innerConeAngle": 0.2, "outerConeAngle": 0.6 });
    let spot = json!({ "name": "spot", "type": "spot", "color": [0.5, 0.8, 1.0], "intensity": 20.0, "spot": cone });
    let down = -FRAC_PI_2;
    scene.punctual(spot).at([-0.8, 2.5, 0.4]).rotated([1.0, 0.0, 0.0], down);
    let sun = json!({ "name": "sun", "type": "directional", "intensity": 1.2 });
    scene
        .punctual(sun)
        .rotated(dvec3(-1.0, 0.8, 0.0).normalize().to_array(), 0.8);
    scene.parallel_camera([2.5, 4.0], [0.5, 0.0], 1.7);
    scene
}

/// The empty Cornell box.
fn cornell_room(name: &'static str) -> Document {
    const HEIGHT: f64 = 2.0;
    let mut scene = Document::new(name);
    let white = scene.material(matte("white", WHITE));
    let red = scene.material(matte("red", [0.63, 0.065, 0.05]));
    let green = scene.material(matte("green", [0.14, 0.45, 0.091]));
    let lamp = scene.material(light("light", [17.0, 14.45, 11.05]));
    scene.object("floor", &Mesh::facing_up(ROOM, 0.0), white);
    scene.object("ceiling", &Mesh::facing_down(ROOM, HEIGHT), white);
    let [back, left, right, _] = walls(HEIGHT);
    for ((name, wall), material) in [(back, white), (left, red), (right, green)] {
        scene.object(name, &wall, material);
    }
    scene.object("light", &Mesh::facing_down(0.25, HEIGHT - 0.002), lamp);
    scene
}

/// The walls of a room, facing inwards, with their names: back, left, right, front.
fn walls(height: f64) -> [(&'static str, Mesh); 4] {
    // From the lower left corner to the lower right one, seen from inside.
    [
        ("back", [-1.0, -1.0], [1.0, -1.0]),
        ("left", [-1.0, 1.0], [-1.0, -1.0]),
        ("right", [1.0, -1.0], [1.0, 1.0]),
        ("front", [1.0, 1.0], [-1.0, 1.0]),
    ]
    .map(|(name, left, right)| {
        let corner = |[x, z]: [f64; 2], y| dvec3(ROOM * x, y, ROOM * z);
        let quad = [
            corner(left, 0.0),
            corner(right, 0.0),
            corner(right, height),
            corner(left, height),
        ];
        (name, Mesh::quad(quad))
    })
}
