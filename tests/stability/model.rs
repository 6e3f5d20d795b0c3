//! Scenes of a few simple shapes, as glTF.

use glam::{DVec3, Vec3};
use ppm_vk::internals::scene::Scene;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::fixture::Fixture;

/// A scene under construction. Materials and cameras are referred to by index.
pub struct Model {
    pub file: Fixture,
}

impl Model {
    /// An empty scene.
    pub fn new() -> Self {
        Self {
            file: Fixture {
                json: json!({
                    "asset": {"version": "2.0"},
                    "scenes": [{"nodes": []}],
                    "nodes": [], "meshes": [], "materials": [], "cameras": [],
                    "accessors": [], "bufferViews": [], "buffers": [{"uri": "room.bin"}]
                }),
                binary: Vec::new(),
                folder: TempDir::new().expect("a temporary folder"),
            },
        }
    }

    fn add(&mut self, list: &str, value: Value) -> usize {
        let index = self.file.json[list].as_array().expect("a list").len();
        self.file.set(&format!("/{list}/-"), value);
        index
    }

    /// A matte material that also emits.
    pub fn matte(&mut self, albedo: [f32; 3], radiance: f32) -> usize {
        let [r, g, b] = albedo;
        self.add(
            "materials",
            json!({
                "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0},
                "emissiveFactor": if radiance > 0.0 { [1.0, 1.0, 1.0] } else { [0.0; 3] },
                "extensions": {
                    "KHR_materials_specular": {"specularFactor": 0},
                    "KHR_materials_emissive_strength": {"emissiveStrength": radiance}
                }
            }),
        )
    }

    /// A black matte material.
    pub fn black(&mut self, radiance: f32) -> usize {
        self.matte([0.0; 3], radiance)
    }

    /// A perfect mirror.
    pub fn mirror(&mut self) -> usize {
        self.add(
            "materials",
            json!({"pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0}}),
        )
    }

    /// Clear glass.
    pub fn glass(&mut self, ior: f32) -> usize {
        self.add(
            "materials",
            json!({
                "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
                "extensions": {
                    "KHR_materials_transmission": {"transmissionFactor": 1},
                    "KHR_materials_volume": {"thicknessFactor": 1},
                    "KHR_materials_ior": {"ior": ior}
                }
            }),
        )
    }

    /// An object of flat triangles; returns its node.
    pub fn mesh(&mut self, material: usize, triangles: &[[Vec3; 3]]) -> usize {
        let positions: Vec<[f32; 3]> = triangles.iter().flatten().map(|corner| corner.to_array()).collect();
        let accessor = self.file.add_vectors(&positions);
        let mesh = self.add(
            "meshes",
            json!({"primitives": [{"attributes": {"POSITION": accessor}, "material": material}]}),
        );
        self.file.add_root(json!({"mesh": mesh}))
    }

    /// A parallelogram whose front is the side of `a` × `b`.
    pub fn quad(&mut self, material: usize, corner: Vec3, a: Vec3, b: Vec3) {
        self.mesh(material, &parallelogram(corner, a, b));
    }

    /// The six sides of a box whose fronts face its inside, an object each.
    pub fn room(&mut self, material: usize, low: Vec3, high: Vec3) {
        for side in box_sides(low, high) {
            self.mesh(material, &side.map(|[a, b, c]| [a, c, b]));
        }
    }

    /// A solid box: one object.
    pub fn block(&mut self, material: usize, low: Vec3, high: Vec3) {
        self.mesh(material, box_sides(low, high).as_flattened());
    }

    /// A box with a hollow: one object. Without an outside, only the hollow, with fronts facing inwards.
    pub fn shell(&mut self, material: usize, outer: [Vec3; 2], hollow: [Vec3; 2]) {
        let [low, high] = hollow;
        let inside = box_sides(low, high).as_flattened().to_vec();
        let mut triangles: Vec<_> = inside.into_iter().map(|[a, b, c]| [a, c, b]).collect();
        if outer[0] != outer[1] {
            triangles.extend(box_sides(outer[0], outer[1]).as_flattened());
        }
        self.mesh(material, &triangles);
    }

    /// A sphere of flat triangles, or with the shading normals of a true sphere. Its corners lie on the sphere.
    pub fn sphere(&mut self, material: usize, centre: Vec3, radius: f32, smooth: bool) {
        let triangles = sphere_triangles(16);
        let placed: Vec<[Vec3; 3]> = triangles.iter().map(|t| t.map(|n| centre + radius * n)).collect();
        let node = self.mesh(material, &placed);
        if smooth {
            let normals: Vec<[f32; 3]> = triangles.iter().flatten().map(|n| n.to_array()).collect();
            let accessor = self.file.add_vectors(&normals);
            let mesh = self.file.json["nodes"][node]["mesh"].as_u64().expect("a mesh");
            self.file.set(
                &format!("/meshes/{mesh}/primitives/0/attributes/NORMAL"),
                json!(accessor),
            );
        }
    }

    /// A camera with this vertical field of view, rad.
    pub fn camera(&mut self, from: Vec3, to: Vec3, fov: f32) {
        let camera = self.add(
            "cameras",
            json!({"type": "perspective", "perspective": {"yfov": fov, "znear": 0.1}}),
        );
        let back = (from - to).as_dvec3().normalize();
        let up = if back.y.abs() > 0.99 { DVec3::X } else { DVec3::Y };
        let right = up.cross(back).normalize();
        let rotation = glam::DQuat::from_mat3(&glam::DMat3::from_cols(right, back.cross(right), back));
        self.file.add_root(json!({
            "camera": camera, "translation": from.to_array(), "rotation": rotation.to_array()
        }));
    }

    /// The scene, which must load without warnings.
    #[track_caller]
    pub fn scene(&self) -> Scene {
        let scene = self.file.scene();
        assert_eq!(scene.warnings, [""; 0]);
        scene
    }
}

pub fn parallelogram(corner: Vec3, a: Vec3, b: Vec3) -> [[Vec3; 3]; 2] {
    let [x, y, z] = [corner + a, corner + a + b, corner + b];
    [[corner, x, y], [corner, y, z]]
}

/// The sides of a box, fronts facing outwards.
fn box_sides(low: Vec3, high: Vec3) -> [[[Vec3; 3]; 2]; 6] {
    let size = high - low;
    let [x, y, z] = [Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z];
    [
        parallelogram(low, z, y),
        parallelogram(low, x, z),
        parallelogram(low, y, x),
        parallelogram(high, -y, -z),
        parallelogram(high, -z, -x),
        parallelogram(high, -x, -y),
    ]
}

/// A unit sphere: the faces of a cube, each divided into `pieces`² squares, projected.
fn sphere_triangles(pieces: u32) -> Vec<[Vec3; 3]> {
    let step = 2.0 / pieces as f32;
    let mut triangles = Vec::new();
    for [[corner, beside, opposite], _] in box_sides(Vec3::NEG_ONE, Vec3::ONE) {
        let (a, b) = (0.5 * (beside - corner), 0.5 * (opposite - beside));
        for i in 0..pieces {
            for j in 0..pieces {
                let start = corner + a * (step * i as f32) + b * (step * j as f32);
                let square = parallelogram(start, a * step, b * step);
                // Equal angles, so that the triangles are of about equal size.
                let blown = |p: Vec3| (p * std::f32::consts::FRAC_PI_4).map(f32::tan).normalize();
                triangles.extend(square.map(|t| t.map(blown)));
            }
        }
    }
    triangles
}
