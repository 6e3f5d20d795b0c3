//! Layers of a picture: `--aov` and `--layer-name`.

#[path = "program/mod.rs"]
mod program;

use std::collections::BTreeMap;
use std::path::Path;

use exr::prelude::{AttributeValue, Text, read_first_flat_layer_from_file};
use program::{ppm_vk, stderr};
use tempfile::TempDir;

const ALL: &str = "albedo,normal,depth,position,object,material,direct,indirect,caustic,samples,error";
const SIDE: usize = 32;

/// Channels and texts of attributes of a picture.
struct File {
    channels: BTreeMap<String, Vec<f32>>,
    texts: BTreeMap<String, String>,
}

impl File {
    fn read(path: &Path) -> Self {
        let layer = read_first_flat_layer_from_file(path).expect("a picture").layer_data;
        let channels = layer.channel_data.list.iter().map(|channel| {
            let samples: Vec<f32> = channel.sample_data.values_as_f32().collect();
            (channel.name.to_string(), samples)
        });
        let texts = layer
            .attributes
            .other
            .iter()
            .filter_map(|(name, value): (&Text, _)| match value {
                AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
                _ => None,
            });
        Self {
            channels: channels.collect(),
            texts: texts.collect(),
        }
    }

    fn at(&self, channel: &str, pixel: usize) -> f32 {
        let channel = self.channels.get(channel);
        channel.unwrap_or_else(|| panic!("{:?}", self.channels.keys()))[pixel]
    }

    fn vector(&self, layer: &str, components: [&str; 3], pixel: usize) -> [f32; 3] {
        components.map(|component| self.at(&format!("{layer}.{component}"), pixel))
    }

    /// The manifest of a Cryptomatte: names by the values of their channels.
    fn manifest(&self, matte: &str) -> BTreeMap<u32, String> {
        let is_name = |(name, text): &(&String, &String)| name.ends_with("/name") && *text == matte;
        let (key, _) = self.texts.iter().find(is_name).expect("a name");
        let text = &self.texts[&key.replace("/name", "/manifest")];
        let manifest: BTreeMap<String, String> = serde_json::from_str(text).expect("a manifest");
        let id = |hash: &str| u32::from_str_radix(hash, 16).expect("a hash");
        manifest.into_iter().map(|(name, hash)| (id(&hash), name)).collect()
    }

    /// What covers a pixel, with its shares.
    fn covers(&self, matte: &str, pixel: usize) -> Vec<(String, f32)> {
        let manifest = self.manifest(matte);
        let ranks = [0, 1, 2]
            .into_iter()
            .flat_map(|level| [(level, "R", "G"), (level, "B", "A")]);
        ranks
            .map(|(level, id, share)| {
                let channel = |component| self.at(&format!("{matte}{level:02}.{component}"), pixel);
                (channel(id).to_bits(), channel(share))
            })
            .filter(|(_, share)| *share > 0.0)
            .map(|(id, share)| (manifest[&id].clone(), share))
            .collect()
    }
}

fn render(folder: &Path, scene: &str, more: &[&str]) -> File {
    let scene = format!("{}/scenes/{scene}.gltf", env!("CARGO_MANIFEST_DIR"));
    let mut arguments = vec!["--scene", &scene, "-o", "out.exr", "--resolution", "32x32", "--quiet"];
    arguments.extend(["--photons", "2000"]);
    arguments.extend(more);
    let output = ppm_vk(folder, &arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    File::read(&folder.join("out.exr"))
}

fn assert_near(found: [f32; 3], expected: [f32; 3], what: &str) {
    let off = found
        .iter()
        .zip(expected)
        .map(|(found, expected)| (found - expected).abs());
    assert!(
        off.fold(0.0, f32::max) < 2e-4,
        "{what}: {found:?} instead of {expected:?}"
    );
}

/// A pixel's name, object, and what its layers show there: of `cornell`, whose camera is at (0, 1, 3.9) and looks along −z.
#[test]
fn layers_show_where_surfaces_are_and_what_they_reflect() {
    let folder = TempDir::new().expect("folder");
    let file = render(folder.path(), "cornell", &["--iterations", "8", "--aov", ALL]);
    let mut found = BTreeMap::new();
    for pixel in 0..SIDE * SIDE {
        let objects = file.covers("CryptoObject", pixel);
        let [objects_cover, materials_cover] = ["CryptoObject", "CryptoMaterial"].map(|matte| {
            let covers = file.covers(matte, pixel);
            covers.iter().map(|(_, share)| share).sum::<f32>()
        });
        assert!(
            objects_cover <= 1.0 && (objects_cover - materials_cover).abs() < 1e-6,
            "pixel {pixel}: {objects_cover} covered by objects, {materials_cover} by materials"
        );
        // All eight paths meet one wall, and so do those of the pixels around: the first path passes the pixel's centre for the
        // objects, and another point of it for albedo and normal.
        let [(object, share)] = &objects[..] else { continue };
        let (x, y) = (pixel % SIDE, pixel / SIDE);
        if !(1..SIDE - 1).contains(&x) || !(1..SIDE - 1).contains(&y) {
            continue;
        }
        let around = [pixel - 1, pixel + 1, pixel - SIDE, pixel + SIDE];
        if around
            .iter()
            .any(|&pixel| file.covers("CryptoObject", pixel) != objects)
        {
            continue;
        }
        if *share < 1.0 {
            continue;
        }
        let (albedo, normal, axis, place) = match object.as_str() {
            "back" => ([0.73; 3], [0.0, 0.0, 1.0], 2, -1.0),
            "left" => ([0.63, 0.065, 0.05], [1.0, 0.0, 0.0], 0, -1.0),
            "right" => ([0.14, 0.45, 0.091], [-1.0, 0.0, 0.0], 0, 1.0),
            "floor" => ([0.73; 3], [0.0, 1.0, 0.0], 1, 0.0),
            _ => continue,
        };
        *found.entry(object.clone()).or_insert(0) += 1;
        let what = format!("pixel {pixel} on {object}");
        assert_near(file.vector("albedo", ["R", "G", "B"], pixel), albedo, &what);
        assert_near(file.vector("normal", ["X", "Y", "Z"], pixel), normal, &what);
        let position = file.vector("position", ["X", "Y", "Z"], pixel);
        let depth = file.at("Z", pixel);
        assert!((position[axis] - place).abs() < 1e-4, "{what}: {position:?}");
        assert!(
            (3.9 - position[2] - depth).abs() < 1e-4,
            "{what}: {position:?}, {depth}"
        );
        // The pixel's centre, at its depth.
        let across = |index: usize| (index as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0;
        let half = depth * (0.5f32 * 0.685_914_4).tan();
        assert_near(
            position,
            [
                across(pixel % SIDE) * half,
                1.0 - across(pixel / SIDE) * half,
                position[2],
            ],
            &what,
        );
        assert_eq!(
            (file.at("samples", pixel), file.at("A", pixel)),
            (8.0 * 2.0, 1.0),
            "{what}"
        );
    }
    for wall in ["back", "left", "right", "floor"] {
        assert!(found.get(wall).is_some_and(|&pixels| pixels > 20), "{wall}: {found:?}");
    }
}

#[test]
fn direct_indirect_and_caustic_light_add_up_to_the_picture() {
    let folder = TempDir::new().expect("folder");
    let file = render(
        folder.path(),
        "cornell-spheres",
        &["--iterations", "4", "--aov", "direct,indirect,caustic"],
    );
    let mut sums = [0.0; 3];
    for pixel in 0..SIDE * SIDE {
        for component in ["R", "G", "B"] {
            let parts = ["direct", "indirect", "caustic"].map(|layer| file.at(&format!("{layer}.{component}"), pixel));
            let (sum, picture) = (parts.iter().sum::<f32>(), file.at(component, pixel));
            assert!(
                (sum - picture).abs() <= 1e-5 * picture,
                "pixel {pixel}, {component}: {parts:?} of {picture}"
            );
            sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
        }
    }
    assert!(sums.iter().all(|&sum| sum > 1.0), "direct, indirect, caustic: {sums:?}");
}

#[test]
fn a_view_layer_has_the_names_that_blender_reads() {
    let folder = TempDir::new().expect("folder");
    let options = [
        "--iterations",
        "1",
        "--layer-name",
        "ViewLayer",
        "--aov",
        "normal,depth,object",
    ];
    let file = render(folder.path(), "cornell", &options);
    for name in [
        "ViewLayer.Combined.R",
        "ViewLayer.Combined.A",
        "ViewLayer.Denoising Normal.X",
        "ViewLayer.Depth.Z",
        "ViewLayer.CryptoObject00.R",
    ] {
        assert!(file.channels.contains_key(name), "{name}: {:?}", file.channels.keys());
    }
    assert!(!file.channels.contains_key("R"));
    assert!(
        file.manifest("ViewLayer.CryptoObject")
            .values()
            .any(|name| name == "back")
    );
}

#[test]
fn layers_of_a_render_that_was_interrupted_are_the_same_to_the_bit() {
    let folder = TempDir::new().expect("folder");
    let run = |more: &[&str]| {
        let arguments = [&["--aov", ALL][..], more].concat();
        render(folder.path(), "cornell-spheres", &arguments).channels
    };
    let whole = run(&["--iterations", "5"]);
    run(&["--iterations", "2", "--state", "a.state"]);
    let resumed = run(&["--iterations", "5", "--state", "a.state", "--resume"]);
    assert_eq!(whole.len(), resumed.len());
    for (name, samples) in whole {
        let bits = |samples: &[f32]| samples.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&samples), bits(&resumed[&name]), "{name}");
    }
}

#[test]
fn layers_that_nobody_can_make_are_refused() {
    let folder = TempDir::new().expect("folder");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.gltf");
    for (options, word) in [
        (&["--aov", "beauty"][..], "beauty"),
        (&["--aov", "normal", "--backend", "cpu"], "--backend cpu"),
        (&["--aov", "normal", "--part", "1/2", "--state", "a.state"], "merge"),
        (&["--layer-name", "a.b"], "dot"),
    ] {
        let output = ppm_vk(folder.path(), &[&["--scene", scene], options].concat());
        assert_eq!(output.status.code(), Some(2), "{options:?}");
        assert!(stderr(&output).contains(word), "{options:?}: {}", stderr(&output));
    }
}
