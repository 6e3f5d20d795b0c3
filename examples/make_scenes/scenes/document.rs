//! A small writer of glTF 2.0: one JSON document and one binary buffer.

use super::mesh::Mesh;
use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};
use std::collections::BTreeSet;

// Constants of glTF, which are OpenGL's.
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const UNSIGNED_SHORT: u32 = 5123;
const FLOAT: u32 = 5126;
const NEAREST: u32 = 9728;
const LINEAR: u32 = 9729;
const REPEAT: u32 = 10497;

/// How texels become a value; the index of the sampler.
#[derive(Clone, Copy)]
pub enum Filter {
    Nearest = 0,
    Linear = 1,
}

/// A PNG of this size, by a function of the texel's position that returns RGBA.
pub fn png(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_fn(width, height, |x, y| image::Rgba(texel(x, y)))
        .write_to(&mut png, image::ImageFormat::Png)
        .expect("memory takes any PNG");
    png.into_inner()
}

/// `material` with a texture in a slot, such as `/normalTexture`.
pub fn with_texture(mut material: Value, slot: &str, texture: usize) -> Value {
    let (parent, name) = slot.rsplit_once('/').expect("a path");
    let parent = material.pointer_mut(parent).expect("the slot's object");
    parent[name] = json!({ "index": texture });
    material
}

/// A file to write: its name in the scenes' folder, and its content.
pub struct File {
    pub name: String,
    pub bytes: Vec<u8>,
}

/// A Lambertian surface: a rough dielectric without its specular lobe. Scatters on both sides.
pub fn matte(name: &str, [r, g, b]: [f64; 3]) -> Value {
    json!({
        "name": name,
        "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0 },
        "doubleSided": true,
        "extensions": { "KHR_materials_specular": { "specularFactor": 0.0 } },
    })
}

/// A black area light that emits from its front.
pub fn light(name: &str, radiance: [f64; 3]) -> Value {
    one_sided(emitting(matte(name, [0.0; 3]), radiance))
}

/// A smooth metal.
pub fn mirror(name: &str, [r, g, b]: [f64; 3]) -> Value {
    json!({
        "name": name,
        "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.0 },
    })
}

/// A dielectric of index 1.5, partly transmissive; with attenuation colour and distance inside, or a thin wall.
pub fn glass(name: &str, roughness: f64, transmission: f64, inside: Option<([f64; 3], f64)>) -> Value {
    let mut material = metallic_roughness(name, [1.0; 3], 0.0, roughness);
    material["extensions"] = json!({ "KHR_materials_transmission": { "transmissionFactor": transmission } });
    if let Some((color, distance)) = inside {
        material["extensions"]["KHR_materials_volume"] = json!({
            "thicknessFactor": 1.0, "attenuationColor": color, "attenuationDistance": distance
        });
    }
    material
}

/// A metallic-roughness surface.
pub fn metallic_roughness(name: &str, [r, g, b]: [f64; 3], metallic: f64, roughness: f64) -> Value {
    json!({
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [r, g, b, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness
        }
    })
}

/// A smooth, clear dielectric; meshes that have it must be closed.
pub fn clear(name: &str, ior: f64) -> Value {
    json!({
        "name": name,
        "pbrMetallicRoughness": { "baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.0 },
        "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 1.0 },
            "KHR_materials_ior": { "ior": ior },
            "KHR_materials_volume": { "thicknessFactor": 1.0 },
        },
    })
}

/// `material`, also emitting `radiance`. glTF's factor is at most 1; larger values use an extension.
pub fn emitting(mut material: Value, radiance: [f64; 3]) -> Value {
    let strength = radiance.into_iter().fold(1.0, f64::max);
    material["emissiveFactor"] = json!(radiance.map(|value| value / strength));
    if strength > 1.0 {
        material["extensions"]["KHR_materials_emissive_strength"] = json!({ "emissiveStrength": strength });
    }
    material
}

/// `material` whose back does not emit, and is hidden from cameras.
pub fn one_sided(mut material: Value) -> Value {
    material["doubleSided"] = json!(false);
    material
}

/// A glTF document under construction. A new element gets the next index of its kind.
pub struct Document {
    name: &'static str,
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    cameras: Vec<Value>,
    lights: Vec<Value>,
    accessors: Vec<Value>,
    buffer_views: Vec<Value>,
    images: Vec<Value>,
    textures: Vec<Value>,
    buffer: Vec<u8>,
    transforms: bool,
}

impl Document {
    /// An empty scene.
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            nodes: Vec::new(),
            meshes: Vec::new(),
            materials: Vec::new(),
            cameras: Vec::new(),
            lights: Vec::new(),
            accessors: Vec::new(),
            buffer_views: Vec::new(),
            images: Vec::new(),
            textures: Vec::new(),
            buffer: Vec::new(),
            transforms: false,
        }
    }

    /// Adds a material and returns its index.
    pub fn material(&mut self, material: Value) -> usize {
        self.transforms |= material.to_string().contains("KHR_texture_transform");
        push(&mut self.materials, material)
    }

    /// Adds a texture, a PNG that repeats, and returns its index.
    pub fn texture(&mut self, png: &[u8], filter: Filter) -> usize {
        let view = self.view(png, None);
        let source = push(&mut self.images, json!({ "bufferView": view, "mimeType": "image/png" }));
        push(
            &mut self.textures,
            json!({ "sampler": filter as usize, "source": source }),
        )
    }

    /// Adds a mesh and a node that shows it.
    pub fn object(&mut self, name: &str, mesh: &Mesh, material: usize) -> Node<'_> {
        let mesh = self.mesh(name, mesh, material);
        self.again(name, mesh)
    }

    /// Adds a mesh and returns its index.
    pub fn mesh(&mut self, name: &str, mesh: &Mesh, material: usize) -> usize {
        let positions: Vec<_> = mesh.positions.iter().map(|p| p.as_vec3().to_array()).collect();
        let normals: Vec<_> = mesh.normals.iter().map(|n| n.as_vec3().to_array()).collect();
        let texcoords: Vec<_> = mesh.texcoords.iter().map(|t| t.as_vec2().to_array()).collect();
        let mut attributes = json!({ "POSITION": self.vertex_data(&positions), "NORMAL": self.vertex_data(&normals) });
        if !texcoords.is_empty() {
            attributes["TEXCOORD_0"] = json!(self.vertex_data(&texcoords));
        }
        let colors: Vec<_> = mesh.colors.iter().map(|color| color.as_vec3().to_array()).collect();
        if !colors.is_empty() {
            attributes["COLOR_0"] = json!(self.vertex_data(&colors));
        }
        let primitive = json!({
            "attributes": attributes,
            "indices": self.indices(mesh.triangles.as_flattened()),
            "material": material,
        });
        push(&mut self.meshes, json!({ "name": name, "primitives": [primitive] }))
    }

    /// Adds a node that shows a mesh; several nodes may show the same mesh.
    pub fn again(&mut self, name: &str, mesh: usize) -> Node<'_> {
        self.node(json!({ "name": name, "mesh": mesh }))
    }

    /// Adds a node that is the parent of this number of last nodes.
    pub fn group(&mut self, name: &str, count: usize) -> Node<'_> {
        let children: Vec<usize> = (self.nodes.len() - count..self.nodes.len()).collect();
        self.node(json!({ "name": name, "children": children }))
    }

    /// Adds a camera in the plane x = 0 at `eye` that looks at `target` (each y, z), with an aspect ratio of 1.
    pub fn camera(&mut self, eye: [f64; 2], target: [f64; 2], field_of_view_degrees: f64) {
        self.place_camera(perspective(field_of_view_degrees), eye, target);
    }

    /// The same at any place.
    pub fn camera_from(&mut self, eye: DVec3, target: DVec3, field_of_view_degrees: f64) {
        let camera = push(&mut self.cameras, perspective(field_of_view_degrees));
        let mut node = self.node(json!({ "name": "camera", "camera": camera }));
        node.at(eye.to_array()).towards(target - eye);
    }

    /// The same with an orthographic projection, showing this much on either side of `target`.
    pub fn parallel_camera(&mut self, eye: [f64; 2], target: [f64; 2], half_side: f64) {
        let lens = json!({ "xmag": half_side, "ymag": half_side, "znear": 0.01, "zfar": 1000.0 });
        let camera = json!({ "name": "camera", "type": "orthographic", "orthographic": lens });
        self.place_camera(camera, eye, target);
    }

    fn place_camera(&mut self, camera: Value, eye: [f64; 2], target: [f64; 2]) {
        let camera = push(&mut self.cameras, camera);
        let pitch = (target[0] - eye[0]).atan2(eye[1] - target[1]);
        let mut node = self.node(json!({ "name": "camera", "camera": camera }));
        node.at([0.0, eye[0], eye[1]]).rotated([1.0, 0.0, 0.0], pitch);
    }

    /// Adds a light of KHR_lights_punctual and its node; it emits along −z.
    pub fn punctual(&mut self, light: Value) -> Node<'_> {
        let light = push(&mut self.lights, light);
        self.node(json!({ "extensions": { "KHR_lights_punctual": { "light": light } } }))
    }

    /// The document as NAME.gltf and NAME.bin.
    pub fn finish(self) -> [File; 2] {
        let mut extensions: BTreeSet<&str> = self
            .materials
            .iter()
            .filter_map(|material| material.get("extensions")?.as_object())
            .flat_map(|extensions| extensions.keys().map(String::as_str))
            .collect();
        if !self.lights.is_empty() {
            extensions.insert("KHR_lights_punctual");
        }
        let is_child = |node: usize| {
            let children = self.nodes.iter().filter_map(|node| node["children"].as_array());
            children.flatten().any(|child| *child == json!(node))
        };
        let roots: Vec<usize> = (0..self.nodes.len()).filter(|&node| !is_child(node)).collect();
        if self.transforms {
            extensions.insert("KHR_texture_transform");
        }
        let binary = format!("{}.bin", self.name);
        let mut document = json!({
            "asset": { "version": "2.0", "generator": "ppm-vk make_scenes", "copyright": "CC0-1.0" },
            "scene": 0,
            "scenes": [{ "name": self.name, "nodes": roots }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "cameras": self.cameras,
            "accessors": self.accessors,
            "bufferViews": self.buffer_views,
            "buffers": [{ "byteLength": self.buffer.len(), "uri": binary }],
            "extensionsUsed": extensions,
        });
        if !self.lights.is_empty() {
            document["extensions"] = json!({ "KHR_lights_punctual": { "lights": self.lights } });
        }
        if !self.textures.is_empty() {
            let samplers = [NEAREST, LINEAR]
                .map(|filter| json!({ "magFilter": filter, "minFilter": filter, "wrapS": REPEAT, "wrapT": REPEAT }));
            document["images"] = json!(self.images);
            document["samplers"] = json!(samplers);
            document["textures"] = json!(self.textures);
        }
        [
            File {
                name: format!("{}.gltf", self.name),
                bytes: format!("{document:#}\n").into_bytes(),
            },
            File {
                name: binary,
                bytes: self.buffer,
            },
        ]
    }

    fn node(&mut self, node: Value) -> Node<'_> {
        let index = push(&mut self.nodes, node);
        Node(&mut self.nodes[index])
    }

    /// Adds vectors with their bounds, and returns the accessor.
    fn vertex_data<const N: usize>(&mut self, vectors: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = vectors
            .as_flattened()
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            let bound = vectors
                .iter()
                .copied()
                .reduce(|a, b| std::array::from_fn(|i| pick(a[i], b[i])));
            // Adding 0 turns −0 into 0. `min` and `max` may return either.
            bound.map(|bound| bound.map(|value| f64::from(value) + 0.0).to_vec())
        };
        let accessor = json!({
            "bufferView": self.view(&bytes, ARRAY_BUFFER),
            "componentType": FLOAT,
            "count": vectors.len(),
            "type": format!("VEC{N}"),
            "min": bound(f32::min),
            "max": bound(f32::max),
        });
        push(&mut self.accessors, accessor)
    }

    /// Adds vertex indices, and returns the accessor.
    fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let accessor = json!({
            "bufferView": self.view(&bytes, ELEMENT_ARRAY_BUFFER),
            "componentType": UNSIGNED_SHORT,
            "count": indices.len(),
            "type": "SCALAR",
        });
        push(&mut self.accessors, accessor)
    }

    /// Appends `bytes` to the buffer, and returns the view of them.
    fn view(&mut self, bytes: &[u8], target: impl Into<Option<u32>>) -> usize {
        // Accessors must start at multiples of their component's size.
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len() });
        if let Some(target) = target.into() {
            view["target"] = json!(target);
        }
        self.buffer.extend_from_slice(bytes);
        push(&mut self.buffer_views, view)
    }
}

/// A node of a document, to be placed.
pub struct Node<'a>(&'a mut Value);

impl Node<'_> {
    /// Moves it to `translation`.
    pub fn at(&mut self, translation: [f64; 3]) -> &mut Self {
        self.0["translation"] = json!(translation);
        self
    }

    /// Rotates it about the unit vector `axis`, before the translation.
    pub fn rotated(&mut self, axis: [f64; 3], radians: f64) -> &mut Self {
        let (sin, cos) = (0.5 * radians).sin_cos();
        self.0["rotation"] = json!([axis[0] * sin, axis[1] * sin, axis[2] * sin, cos]);
        self
    }

    /// Turns its −z along `direction`, before the translation, with x horizontal.
    pub fn towards(&mut self, direction: DVec3) -> &mut Self {
        let back = -direction.normalize();
        let right = DVec3::Y.cross(back).normalize();
        let turn = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back));
        self.0["rotation"] = json!(turn.to_array());
        self
    }

    /// Scales it along its axes, before the rotation.
    pub fn scaled(&mut self, factors: [f64; 3]) -> &mut Self {
        self.0["scale"] = json!(factors);
        self
    }
}

/// A camera with an aspect ratio of 1.
fn perspective(field_of_view_degrees: f64) -> Value {
    let lens = json!({
        "yfov": field_of_view_degrees.to_radians(),
        "aspectRatio": 1.0,
        "znear": 0.01,
        "zfar": 1000.0,
    });
    json!({ "name": "camera", "type": "perspective", "perspective": lens })
}

/// Appends `value` and returns its index.
fn push(list: &mut Vec<Value>, value: Value) -> usize {
    list.push(value);
    list.len() - 1
}
