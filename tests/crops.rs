//! Crops of a picture: `--crop`.

#[path = "program/mod.rs"]
mod program;

use std::collections::BTreeMap;
use std::path::Path;

use exr::prelude::{AttributeValue, Text, read_first_flat_layer_from_file};
use program::{ppm_vk, stderr};
use tempfile::TempDir;

/// More pixels than all of which would be guides.
const WHOLE: [usize; 2] = [304, 220];

/// The pixels of a file's channels, by their places in the whole picture.
struct File {
    origin: [usize; 2],
    size: [usize; 2],
    channels: BTreeMap<String, Vec<f32>>,
    whole: [usize; 2],
}

impl File {
    fn render(folder: &Path, scene: &str, name: &str, more: &[&str]) -> Self {
        let scene = format!("{}/scenes/{scene}.gltf", env!("CARGO_MANIFEST_DIR"));
        let resolution = WHOLE.map(|side| side.to_string()).join("x");
        let mut arguments = vec!["--scene", &scene, "-o", name, "--quiet", "--resolution", &resolution];
        arguments.extend(["--iterations", "5", "--photons", "20000"]);
        arguments.extend(["--aov", "albedo,depth,object,direct,indirect,caustic"]);
        arguments.extend(more);
        let output = ppm_vk(folder, &arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        let file = Self::read(&folder.join(name));
        assert_eq!(file.whole, WHOLE, "{arguments:?}");
        file
    }

    fn read(path: &Path) -> Self {
        let image = read_first_flat_layer_from_file(path).expect("a picture");
        let layer = image.layer_data;
        let side = |side: i32| side as usize;
        let position = layer.attributes.layer_position;
        let window = image.attributes.display_window;
        assert_eq!(
            window.position.0, 0,
            "the display window begins at the picture's first pixel"
        );
        let is_text = |value: &AttributeValue| matches!(value, AttributeValue::Text(_));
        let seed = layer.attributes.other.get(&Text::from("seed"));
        assert!(seed.is_some_and(is_text), "metadata is written");
        let channels = layer.channel_data.list.iter().map(|channel| {
            let samples = channel.sample_data.values_as_f32().collect();
            (channel.name.to_string(), samples)
        });
        Self {
            origin: [side(position.0), side(position.1)],
            size: [layer.size.0, layer.size.1],
            channels: channels.collect(),
            whole: [window.size.0, window.size.1],
        }
    }

    /// The row of a channel from one of its pixels on.
    fn row(&self, channel: &str, [x, y]: [usize; 2], length: usize) -> &[f32] {
        let first = (y - self.origin[1]) * self.size[0] + x - self.origin[0];
        &self.channels[channel][first..first + length]
    }

    fn assert_shows_the_same(&self, whole: &Self, what: &str) {
        assert_eq!(self.whole, whole.whole, "{what}");
        // The estimate of an error uses the pixels around.
        let is_exact = |name: &&String| !name.starts_with("error");
        for channel in whole.channels.keys().filter(is_exact) {
            for y in self.origin[1]..self.origin[1] + self.size[1] {
                let at = [self.origin[0], y];
                let rows = [self, whole].map(|file| file.row(channel, at, self.size[0]));
                let [found, expected] = rows.map(|row| row.iter().map(|value| value.to_bits()).collect::<Vec<_>>());
                let differing = found
                    .iter()
                    .zip(&expected)
                    .filter(|(found, expected)| found != expected);
                assert_eq!(
                    differing.count(),
                    0,
                    "{what}, {channel}, row {y}: pixels of the crop differ from those of the whole: {:?}, {:?}",
                    rows[0],
                    rows[1]
                );
            }
        }
    }
}

/// Caustics and glass; aimed photons that are guided, whose table is learned.
#[test]
fn a_crop_has_the_bits_of_the_whole() {
    let folder = TempDir::new().expect("folder");
    let folder = folder.path();
    for scene in ["cornell-spheres", "blinds"] {
        let whole = File::render(folder, scene, "whole.exr", &[]);
        assert_eq!((whole.origin, whole.size), ([0, 0], WHOLE));
        // Inside, and at two edges.
        for (crop, origin, size) in [
            ("101,77,45x30", [101, 77], [45, 30]),
            ("274,0,30x220", [274, 0], [30, 220]),
        ] {
            let part = File::render(folder, scene, "part.exr", &["--crop", crop]);
            assert_eq!((part.origin, part.size), (origin, size), "{scene}, {crop}: data window");
            part.assert_shows_the_same(&whole, &format!("{scene}, {crop}"));
        }
    }
}

#[test]
fn crops_of_the_papers_estimator_and_of_fixed_radii_have_the_bits_of_the_whole() {
    let folder = TempDir::new().expect("folder");
    for more in [["--estimator", "ppm"], ["--radius", "0.05"]] {
        let whole = File::render(folder.path(), "glasses", "whole.exr", &more);
        let crop = ["--crop", "64,64,20x24"];
        let part = File::render(folder.path(), "glasses", "part.exr", &[more, crop].concat());
        part.assert_shows_the_same(&whole, more[0]);
    }
}

#[test]
fn a_crop_outside_of_the_picture_is_refused() {
    let folder = TempDir::new().expect("folder");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.gltf");
    for (crop, code) in [("290,0,21x5", 1), ("0,0,0x5", 2), ("1,2", 2), ("5,5,4294967295x1", 2)] {
        let output = ppm_vk(
            folder.path(),
            &["--scene", scene, "--resolution", "304x220", "--crop", crop],
        );
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{crop}: {text}");
        assert!(text.contains("--crop"), "{crop}: {text}");
    }
    let files = folder.path().read_dir().expect("a folder").count();
    assert_eq!(files, 0, "no picture is written");
}

/// 7680×4320 pixels on a device that binds 128 MiB, such as lavapipe; at once on one that binds more.
#[test]
#[ignore = "renders 33 million pixels"]
fn a_picture_larger_than_a_devices_buffers_is_rendered_in_crops() {
    let folder = TempDir::new().expect("folder");
    let folder = folder.path();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-spheres.gltf");
    let file = |name: &str, more: &[&str]| {
        let mut arguments = vec!["--scene", scene, "-o", name, "--resolution", "7680x4320"];
        arguments.extend(["--iterations", "1", "--photons", "20000"]);
        let output = ppm_vk(folder, &[&arguments, more].concat());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(0), "{more:?}: {text}");
        (File::read(&folder.join(name)), text)
    };
    let (whole, text) = file("whole.exr", &[]);
    println!("{text}");
    assert_eq!((whole.origin, whole.size), ([0, 0], [7680, 4320]));
    let alpha = &whole.channels["A"];
    let seen = alpha.iter().filter(|&&alpha| alpha > 0.0).count();
    // The box is as high as wide, and fills the picture's height.
    assert!(seen > 4000 * 4000, "{seen} pixels show a surface");
    let (part, _) = file("part.exr", &["--crop", "3600,2000,400x300"]);
    assert!(part.channels["A"].contains(&1.0));
    part.assert_shows_the_same(&whole, "7680×4320");
}
