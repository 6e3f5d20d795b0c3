//! Files written by Blender, pictures as Blender reads them, and the add-on.
//!
//! `../shared/assets/blender` has files by Blender 5.3. Its calibration scenes are a floor of albedo ½ with one lamp, 2 m above
//! it or a sun: 100 W for point and spot lights, 3 W/m² for the sun. The tests report it when the folder is missing.

#[path = "program/mod.rs"]
mod program;

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::Command;

use ppm_vk::internals::film::{Image, read_exr};
use program::{ppm_vk, stderr};
use tempfile::TempDir;

/// A file written by Blender, if the folder exists.
fn by_blender(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets/blender");
    let path = folder.join(name);
    if !path.is_file() {
        println!("skipped: there is no {}", path.display());
        return None;
    }
    Some(path)
}

/// A small picture of a scene, and the program's messages.
fn render(folder: &Path, scene: &Path, more: &[&str]) -> (Image, String) {
    let scene = scene.to_str().expect("UTF-8");
    let mut arguments = vec!["--scene", scene, "-o", "out.exr", "--resolution", "9x9", "--quiet"];
    arguments.extend(["--iterations", "16", "--photons", "500"]);
    arguments.extend(more);
    let output = ppm_vk(folder, &arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    (read_exr(&folder.join("out.exr")).expect("a picture"), stderr(&output))
}

/// Directly below the lamp: the radiance of a floor of albedo ½ is half of the irradiance over π.
#[test]
fn lamps_are_as_bright_as_blender_has_them_in_the_units_that_flags_cover() {
    let folder = TempDir::new().expect("folder");
    let by_100_watts = 0.5 / PI * 100.0 / (4.0 * PI) / 4.0;
    let by_3_watts = 0.5 / PI * 3.0;
    for (lamp, expected) in [("point", by_100_watts), ("spot", by_100_watts), ("sun", by_3_watts)] {
        for (units, flags) in [
            ("SPEC", &[][..]),
            ("SPEC", &["--light-units", "blender"]),
            ("COMPAT", &["--light-units", "spec"]),
        ] {
            let Some(scene) = by_blender(&format!("calib-{lamp}-{units}.glb")) else {
                return;
            };
            let (image, said) = render(folder.path(), &scene, flags);
            let middle = f64::from(image.pixels()[4 * 9 + 4][0]);
            assert!(
                (middle / expected - 1.0).abs() < 0.01,
                "{lamp}, {units}, {flags:?}: {middle}, not {expected}: look at scene::LightUnits"
            );
            let notes = said
                .lines()
                .filter(|line| line.starts_with("note: ") && line.contains("683"))
                .count();
            assert_eq!(
                notes,
                usize::from(flags.is_empty()),
                "{lamp}, {units}, {flags:?}: {said}"
            );
        }
    }
}

/// In «Raw» units a sun has no factor of 4π, and emissive surfaces have the same unit in all modes.
#[test]
fn suns_in_raw_units_and_emissive_surfaces_need_no_division() {
    let folder = TempDir::new().expect("folder");
    let (Some(sun), Some(emitting)) = (by_blender("calib-sun-RAW.glb"), by_blender("calib-emis-SPEC.glb")) else {
        return;
    };
    let (image, _) = render(folder.path(), &sun, &["--light-units", "spec"]);
    let middle = f64::from(image.pixels()[4 * 9 + 4][0]);
    assert!((middle / (0.5 / PI * 3.0) - 1.0).abs() < 0.01, "{middle}");
    let pictures = ["auto", "spec", "blender"].map(|units| render(folder.path(), &emitting, &["--light-units", units]));
    assert!(
        pictures.iter().all(|(image, _)| *image == pictures[0].0),
        "the lamp isn't a punctual light"
    );
    assert!(!pictures[0].1.contains("683"), "{}", pictures[0].1);
}

/// The left half of the picture shows a wall.
fn half_a_wall(folder: &Path) -> PathBuf {
    let corners: [f32; 12] = [-1.0, -1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 1.0, 0.0];
    let mut bytes: Vec<u8> = corners.iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    let scene = serde_json::json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 2]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"doubleSided": true}],
        "cameras": [{"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 10}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [0, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12}
        ],
        "buffers": [{"uri": "wall.bin", "byteLength": bytes.len()}]
    });
    std::fs::write(folder.join("wall.bin"), bytes).expect("a buffer");
    let path = folder.join("wall.gltf");
    std::fs::write(&path, scene.to_string()).expect("a scene");
    path
}

/// The alpha channel of a picture.
fn alpha(path: &Path) -> Vec<f32> {
    let file = exr::prelude::read_first_flat_layer_from_file(path).expect("a picture");
    let channels = &file.layer_data.channel_data.list;
    let alpha = channels
        .iter()
        .find(|channel| channel.name.eq("A"))
        .expect("a channel A");
    alpha.sample_data.values_as_f32().collect()
}

/// The middle column is half covered by a wall; an environment is not a surface.
#[test]
fn alpha_is_the_share_of_the_camera_paths_that_met_a_surface() {
    let folder = TempDir::new().expect("folder");
    let wall = half_a_wall(folder.path());
    for more in [
        &[][..],
        &["--sampler", "independent"],
        &["--backend", "cpu"],
        &["--direct", "photons"],
        &["--estimator", "ppm"],
    ] {
        render(folder.path(), &wall, more);
        let alpha = alpha(&folder.path().join("out.exr"));
        for row in alpha.chunks(9) {
            assert_eq!((&row[..4], &row[5..]), (&[1.0; 4][..], &[0.0; 4][..]), "{more:?}");
            let whole = more.contains(&"ppm");
            let middle = if whole {
                row[4] == 0.0 || row[4] == 1.0
            } else {
                (row[4] - 0.5).abs() < 0.3
            };
            assert!(middle, "{more:?}: {}", row[4]);
        }
    }
}

/// Runs Python code with arguments; `None`, with a message, if Python or a module is missing.
fn python(module: &str, program: &str, argument: &Path) -> Option<String> {
    let interpreter = std::env::var("PPM_VK_TEST_PYTHON").unwrap_or_else(|_| "python3".into());
    let runs = |text: &str| {
        let mut command = Command::new(&interpreter);
        command.arg("-c").arg(text).arg(argument).output().ok()
    };
    let has_module = runs(&format!("import {module}")).is_some_and(|output| output.status.success());
    if !has_module {
        println!("skipped: {interpreter} has no module {module}");
        return None;
    }
    let output = runs(program).expect("Python");
    assert!(
        output.status.success(),
        "{module}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The numbers after the first word of a line.
fn numbers(text: &str, word: &str) -> Vec<f32> {
    let line = text.lines().find_map(|line| line.strip_prefix(word));
    let line = line.unwrap_or_else(|| panic!("no line {word}: {text}"));
    line.split_whitespace()
        .map(|number| number.parse().expect("a number"))
        .collect()
}

/// RGBA of the second pixel from the left and the pixel right of the middle, in the top row.
fn expected(folder: &Path) -> Vec<f32> {
    let image = read_exr(&folder.join("out.exr")).expect("a picture");
    let alpha = alpha(&folder.join("out.exr"));
    [1, 5]
        .iter()
        .flat_map(|&x| [&image.pixels()[x][..], &[alpha[x]]].concat())
        .collect()
}

#[test]
fn the_openexr_library_reads_the_picture() {
    let folder = TempDir::new().expect("folder");
    render(folder.path(), &half_a_wall(folder.path()), &[]);
    let program = r#"
import OpenEXR, sys
channels = OpenEXR.File(sys.argv[1], separate_channels=True).channels()
print("names", *sorted(channels))
print("pixels", *[channels[name].pixels[0][x] for x in (1, 5) for name in "RGBA"])
"#;
    let Some(text) = python("OpenEXR", program, &folder.path().join("out.exr")) else {
        return;
    };
    assert!(text.contains("names A B G R error_B error_G error_R"), "{text}");
    assert_eq!(numbers(&text, "pixels"), expected(folder.path()));
}

/// As an image, and as the result of an external render engine; since Blender 5.3 the latter accepts plain channels.
#[test]
fn blender_reads_the_picture() {
    let folder = TempDir::new().expect("folder");
    render(folder.path(), &half_a_wall(folder.path()), &[]);
    let program = r#"
import bpy, sys
image = bpy.data.images.load(sys.argv[1])
pixels = list(image.pixels)
print()
print("image", *[pixels[4 * (8 * 9 + x) + c] for x in (1, 5) for c in range(4)])
class Engine(bpy.types.RenderEngine):
    bl_idname = "PPM_VK_TEST"
    bl_label = "test"
    def render(self, depsgraph):
        result = self.begin_result(0, 0, 9, 9)
        layer = result.layers[0]
        layer.load_from_file(sys.argv[1])
        pixels = layer.passes["Combined"].rect
        print()
        print("layer", *[value for x in (1, 5) for value in pixels[8 * 9 + x]])
        self.end_result(result)
if bpy.app.version >= (5, 3, 0):
    bpy.utils.register_class(Engine)
    render = bpy.context.scene.render
    render.engine, render.resolution_x, render.resolution_y, render.resolution_percentage = "PPM_VK_TEST", 9, 9, 100
    bpy.ops.render.render()
"#;
    let Some(text) = python("bpy", program, &folder.path().join("out.exr")) else {
        return;
    };
    let expected = expected(folder.path());
    for reader in ["image", "layer"] {
        if reader == "layer" && !text.contains("layer ") {
            println!("skipped: this Blender's RenderLayer.load_from_file takes names with «Combined» alone");
            continue;
        }
        assert_eq!(numbers(&text, reader), expected, "{reader}: {text}");
    }
}

#[test]
fn values_that_mean_nothing_are_refused_by_the_name_of_their_flag() {
    let folder = TempDir::new().expect("folder");
    let wall = half_a_wall(folder.path());
    let wall = wall.to_str().expect("UTF-8");
    for (flag, value) in [
        ("--light-units", "lumen"),
        ("--sun-angle", "-1"),
        ("--sun-angle", "181"),
        ("--sun-angle", "nan"),
        ("--light-radius", "-0.1"),
        ("--light-radius", "inf"),
        ("--shift", "0.5"),
        ("--shift", "nan,0"),
        ("--environment-rotation", "nan"),
        ("--environment-strength", "0"),
    ] {
        let output = ppm_vk(folder.path(), &["--scene", wall, flag, value]);
        assert_eq!(output.status.code(), Some(2), "{flag} {value}: {}", stderr(&output));
        assert!(stderr(&output).contains(flag), "{flag} {value}: {}", stderr(&output));
    }
    for (rotation, strength) in [("inf", "1"), ("0", "0"), ("0", "nan")] {
        let flags = ["--environment-rotation", rotation, "--environment-strength", strength];
        let arguments = [&["--scene", wall, "--environment", "1,1,1"][..], &flags].concat();
        let output = ppm_vk(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(2), "{flags:?}: {}", stderr(&output));
    }
}

/// Also for a scene's default light. For a scene without any, one line says that the flags have no effect.
#[test]
fn an_environment_is_scaled_and_rotated_where_there_is_one() {
    let folder = TempDir::new().expect("folder");
    let wall = half_a_wall(folder.path());
    let flags = ["--environment-rotation", "90", "--environment-strength", "2"];
    let picture = |scene: &Path, flags: &[&str]| render(folder.path(), scene, flags);
    let mean = |image: &Image| ppm_vk::internals::metrics::mean(image)[1];
    let without_effect = |said: &str| said.lines().filter(|line| line.contains("without effect")).count();

    let ((once, _), (twice, said)) = (picture(&wall, &[]), picture(&wall, &flags[2..]));
    assert!(
        (mean(&twice) / mean(&once) - 2.0).abs() < 1e-5,
        "{}, {}",
        mean(&once),
        mean(&twice)
    );
    assert_eq!(without_effect(&said), 0, "{said}");

    let lamp = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/lights.gltf");
    let (plain, said) = picture(&lamp, &["--environment-rotation", "0", "--environment-strength", "1"]);
    assert_eq!(without_effect(&said), 0, "{said}");
    for (flags, words) in [
        (
            &flags[..],
            "note: --environment-rotation and --environment-strength are without effect",
        ),
        (&flags[..2], "note: --environment-rotation is without effect"),
        (&flags[2..], "note: --environment-strength is without effect"),
    ] {
        let (image, said) = picture(&lamp, flags);
        assert!(image == plain, "{flags:?}: the pictures differ");
        assert!(without_effect(&said) == 1 && said.contains(words), "{flags:?}: {said}");
    }
}

#[test]
fn each_kind_of_lamp_has_its_own_extent() {
    let folder = TempDir::new().expect("folder");
    for (lamp, own, other) in [
        ("sun", "--sun-angle", "--light-radius"),
        ("point", "--light-radius", "--sun-angle"),
    ] {
        let Some(scene) = by_blender(&format!("calib-{lamp}-SPEC.glb")) else {
            return;
        };
        let picture = |more: &[&str]| render(folder.path(), &scene, more).0;
        let plain = picture(&[]);
        assert_ne!(picture(&[own, "1"]), plain, "{lamp}, {own}");
        assert_eq!(picture(&[other, "1"]), plain, "{lamp}, {other}");
    }
}

/// A script of the add-on's tests, in a version of Blender's module; false where the module is missing.
fn passes_in_blender(version: &str, arguments: &[&str]) -> bool {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = Path::new(env!("CARGO_BIN_EXE_ppm-vk"));
    let output = Command::new(root.join("scripts/blender"))
        .args(["--version", version, "-u", "-W", "ignore"])
        .args(arguments)
        .env("PPM_VK_FOLDER", program.parent().expect("a folder"))
        .current_dir(root)
        .output()
        .expect("scripts/blender runs");
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), stderr(&output));
    if output.status.code() == Some(77) {
        println!("skipped with Blender {version}: {said}");
        return false;
    }
    assert!(
        output.status.success(),
        "Blender {version}, {arguments:?}, {}: {said}",
        output.status
    );
    let measured = said.lines().filter(|line| line.contains("worst block"));
    println!("{}", measured.collect::<Vec<_>>().join("\n"));
    true
}

#[test]
#[ignore = "needs Blender's Python module (1 GB) and minutes: scripts/test --long"]
fn the_add_on_renders_what_cycles_does() {
    for version in ["5.3", "4.2"] {
        let files = [
            "test_parts.py",
            "test_renders.py",
            "test_materials.py",
            "test_light_levels.py",
        ];
        let _ = files
            .iter()
            .all(|file| passes_in_blender(version, &[&format!("blender/tests/{file}")]));
    }
}

#[test]
#[ignore = "needs Blender's Python module (1 GB): scripts/test --long"]
fn the_extension_installs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = TempDir::new().expect("folder");
    let packed = Command::new(root.join("scripts/blender-extension"))
        .arg(folder.path())
        .output()
        .expect("scripts/blender-extension runs");
    assert!(packed.status.success(), "{}", stderr(&packed));
    let zip = std::fs::read_dir(folder.path()).expect("folder").next();
    let zip = zip.expect("an extension").expect("an entry").path();
    let zip = zip.to_str().expect("UTF-8");
    for version in ["5.3", "4.2"] {
        passes_in_blender(version, &["blender/tests/test_extension.py", zip]);
    }
}
