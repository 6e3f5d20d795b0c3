//! Scenes made for a test, and what their cameras see.

use std::f64::consts::PI;
use std::fs;

use glam::{DVec3, dvec3};
use ppm_vk::internals::loader::LoadOptions;
use ppm_vk::internals::scene::{Environment, Projection, Scene};
use tempfile::TempDir;

use crate::document::Document;
use crate::mesh::Mesh;
use crate::picture::Subject;

/// Loads a document.
pub fn subject(document: Document) -> Subject {
    subject_under(document, None)
}

/// Loads a document with an environment around it.
pub fn subject_under(document: Document, environment: Option<Environment>) -> Subject {
    let folder = TempDir::new().expect("a temporary folder");
    let [file, buffer] = document.finish();
    for file in [&file, &buffer] {
        fs::write(folder.path().join(&file.name), &file.bytes).expect("a file in the temporary folder");
    }
    let options = LoadOptions {
        environment,
        ..LoadOptions::default()
    };
    let scene = Scene::load_with(&folder.path().join(&file.name), options);
    let subject = Subject::of(scene.unwrap_or_else(|error| panic!("{error}")));
    assert_eq!(subject.scene.warnings, [""; 0], "{}", file.name);
    subject
}

/// The mesh with the normals of its facets: light then goes exactly as geometry says, and as much of it everywhere.
pub fn faceted(mesh: &Mesh) -> Mesh {
    let mut facets = Mesh::default();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|corner| mesh.positions[usize::from(corner)]);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let first = facets.positions.len() as u16;
        facets.positions.extend(corners);
        facets.normals.extend([normal; 3]);
        facets.triangles.push([first, first + 1, first + 2]);
    }
    facets
}

/// Walls of a square room that is closed to all sides but up and down, facing inward.
pub fn walls(half_side: f64, bottom: f64, top: f64) -> [Mesh; 4] {
    let h = half_side;
    [[-h, -h, h, -h], [-h, h, -h, -h], [h, -h, h, h], [h, h, -h, h]].map(|[x0, z0, x1, z1]| {
        Mesh::quad([
            dvec3(x0, bottom, z0),
            dvec3(x1, bottom, z1),
            dvec3(x1, top, z1),
            dvec3(x0, top, z0),
        ])
    })
}

/// Origin and unit direction, in the scene's units, of the ray through a point of the picture: from the upper left corner,
/// in pixels of a square picture.
pub fn camera_ray(subject: &Subject, side: usize, [x, y]: [f64; 2]) -> (DVec3, DVec3) {
    let camera = &subject.scene.cameras[0];
    let normalisation = subject.scene.normalisation;
    let Projection::Perspective { tan_half_fov } = camera.projection else {
        panic!("{:?}", camera.projection);
    };
    let film = |at: f64| (2.0 * at / side as f64 - 1.0) * f64::from(tan_half_fov);
    let direction = camera.forward.as_dvec3() + film(x) * camera.right.as_dvec3() - film(y) * camera.up.as_dvec3();
    let origin = camera.position.as_dvec3() / normalisation.scale + normalisation.centre;
    (origin, direction.normalize())
}

/// Mean over a pixel of a function of the point that is seen of the plane y = 0.
pub fn mean_on_floor(subject: &Subject, side: usize, [column, row]: [usize; 2], value: impl Fn(DVec3) -> f64) -> f64 {
    let places = [0.125, 0.375, 0.625, 0.875];
    let at = |x: f64, y: f64| {
        let (origin, direction) = camera_ray(subject, side, [column as f64 + x, row as f64 + y]);
        value(origin - direction * (origin.y / direction.y))
    };
    places
        .iter()
        .map(|&x| places.iter().map(|&y| at(x, y)).sum::<f64>())
        .sum::<f64>()
        / 16.0
}

/// Mean over a horizontal disc.
pub fn mean_over_disc(value: impl Fn(DVec3) -> f64, centre: DVec3, radius: f64) -> f64 {
    const RINGS: u32 = 8;
    const SPOKES: u32 = 12;
    let mut sum = 0.0;
    for ring in 0..RINGS {
        let r = radius * ((f64::from(ring) + 0.5) / f64::from(RINGS)).sqrt();
        for spoke in 0..SPOKES {
            let (sin, cos) = (2.0 * PI * f64::from(spoke) / f64::from(SPOKES)).sin_cos();
            sum += value(centre + r * dvec3(cos, 0.0, sin));
        }
    }
    sum / f64::from(RINGS * SPOKES)
}
