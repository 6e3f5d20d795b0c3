//! Uniform radiance, which nothing that doesn't absorb can change.

use glam::{DVec3, Vec3, dvec3};
use ppm_vk::internals::config::{Direct, RenderConfig};
use ppm_vk::internals::metrics::mean;
use ppm_vk::internals::scene::Environment;

use crate::document::{Document, clear, emitting, light, matte, mirror};
use crate::measure::{Region, measure};
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::{faceted, subject, subject_under, walls};

/// Light goes round in a sphere of facets for long: of 1,000 paths one bounces 64 times.
pub const MAX_DEPTH: u32 = 256;

fn config(direct: Direct, photons: u32) -> RenderConfig {
    RenderConfig {
        direct,
        radius: Some(0.02),
        max_depth: MAX_DEPTH,
        ..small(32, photons)
    }
}

/// A mirror and a glass sphere beside each other, of facets.
fn add_specular_spheres(scene: &mut Document, height: f64) {
    let mirror = scene.material(mirror("mirror", [1.0; 3]));
    let glass = scene.material(clear("glass", 1.5));
    let sphere = faceted(&Mesh::icosphere(0.35, 2));
    scene.object("mirror", &sphere, mirror).at([-0.5, height, -0.2]);
    scene.object("glass", &sphere, glass).at([0.5, height, 0.1]);
}

pub const ALBEDO: [f64; 3] = [0.2, 0.5, 0.8];

/// A closed room with walls of radiance 1 and albedo ρ, with and without spheres that don't absorb.
pub fn closed_room(with_spheres: bool) -> Subject {
    let mut scene = Document::new("closed-room");
    let wall = scene.material(emitting(matte("wall", ALBEDO), [1.0; 3]));
    scene.object("floor", &Mesh::facing_up(1.0, 0.0), wall);
    scene.object("ceiling", &Mesh::facing_down(1.0, 2.0), wall);
    for mesh in walls(1.0, 0.0, 2.0) {
        scene.object("wall", &mesh, wall);
    }
    if with_spheres {
        add_specular_spheres(&mut scene, 0.8);
    }
    scene.camera([1.0, 0.9], [1.0, 0.0], 90.0);
    subject(scene)
}

/// L = Le + ρL.
fn assert_shines_with_le_over_one_minus_rho(with_spheres: bool, direct: Direct, photons: u32) {
    let room = closed_room(with_spheres);
    let config = config(direct, photons);
    let measured = measure(&room, config, 32, |image| mean(image).to_vec());
    for (measured, albedo) in measured.iter().zip(ALBEDO) {
        let what = format!("albedo {albedo}, spheres: {with_spheres}, direct light by {direct:?}");
        measured.assert_is(1.0 / (1.0 - albedo), &what);
    }
}

#[test]
fn a_closed_furnace_shines_with_le_over_one_minus_rho() {
    assert_shines_with_le_over_one_minus_rho(false, Direct::Light, 50_000);
}

#[test]
fn a_closed_furnace_lit_by_photons_alone_shines_alike() {
    assert_shines_with_le_over_one_minus_rho(false, Direct::Photons, 50_000);
}

#[test]
fn a_mirror_and_glass_change_nothing_in_a_closed_furnace() {
    assert_shines_with_le_over_one_minus_rho(true, Direct::Light, 25_000);
    assert_shines_with_le_over_one_minus_rho(true, Direct::Photons, 25_000);
}

/// A white plate, a mirror and a glass sphere, where radiance 1 comes from everywhere. The plate reflects all it gets, by
/// photons as well: its discs reach past its rims, but no light is lost there.
fn assert_vanish(mut scene: Document, environment: Option<Environment>) {
    let white = scene.material(matte("white", [1.0; 3]));
    let corner = |x, y| dvec3(x, y, -0.8);
    let plate = Mesh::quad([
        corner(-0.8, -0.8),
        corner(0.8, -0.8),
        corner(0.8, 0.8),
        corner(-0.8, 0.8),
    ]);
    scene.object("plate", &plate, white);
    add_specular_spheres(&mut scene, 0.0);
    scene.camera([0.0, 1.45], [0.0, 0.0], 60.0);
    let vanishing = subject_under(scene, environment);
    for (direct, photons) in [(Direct::Light, 20_000), (Direct::Photons, 100_000)] {
        let config = RenderConfig {
            radius: Some(0.05),
            ..config(direct, photons)
        };
        let measured = measure(&vanishing, config, 32, |image| mean(image).to_vec());
        for measured in measured {
            measured.assert_is(1.0, &format!("direct light by {direct:?}"));
        }
    }
}

#[test]
fn a_white_plate_a_mirror_and_glass_vanish_before_walls_of_radiance_one() {
    let mut scene = Document::new("vanishing");
    let walls = scene.material(light("walls", [1.0; 3]));
    let room = Mesh::cuboid(DVec3::splat(-1.5), DVec3::splat(1.5)).flipped();
    scene.object("walls", &room, walls);
    assert_vanish(scene, None);
}

#[test]
fn a_white_plate_a_mirror_and_glass_vanish_in_an_environment_of_radiance_one() {
    assert_vanish(Document::new("vanishing-afar"), Some(Environment::constant(Vec3::ONE)));
}

/// Each pixel by itself: facets of a convex body see nothing of each other.
#[test]
fn a_white_sphere_has_the_radiance_of_the_constant_environment_around_it() {
    let mut scene = Document::new("white-sphere");
    let white = scene.material(matte("white", [1.0; 3]));
    scene.object("sphere", &faceted(&Mesh::icosphere(1.0, 2)), white);
    scene.camera([0.0, 2.5], [0.0, 0.0], 60.0);
    let radiance = Vec3::new(0.5, 1.0, 3.0);
    let sphere = subject_under(scene, Some(Environment::constant(radiance)));
    let regions = [([16, 16], 4), ([10, 16], 3), ([16, 22], 3), ([4, 4], 3), ([16, 16], 16)];
    let measured = measure(&sphere, config(Direct::Light, 1000), 32, |image| {
        let means = regions.map(|(centre, half_side)| {
            let region = Region::around(centre, half_side);
            [0, 1, 2].map(|channel| region.of(image, channel))
        });
        means.as_flattened().to_vec()
    });
    for (measured, expected) in measured.iter().zip(radiance.to_array().iter().cycle()) {
        measured.assert_is(f64::from(*expected), "a part of a sphere and what is around it");
    }
}
