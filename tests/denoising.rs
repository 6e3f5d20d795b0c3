//! Denoised pictures: by a fake of Open Image Denoise that halves them, and by the library itself where it is installed.
#![cfg(unix)]

#[path = "denoising/real.rs"]
mod real;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use exr::prelude::{AnyChannel, AttributeValue, FlatSamples, Text, read_first_flat_layer_from_file};
use ppm_vk::read_exr;
use tempfile::TempDir;

/// Renders a small picture with the denoiser of this file. After two iterations errors are not estimated, so that nothing of the
/// noisy picture is kept.
fn render(folder: &Path, library: &Path, arguments: &[&str]) -> Output {
    let mut all = vec!["--scene", concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.gltf")];
    all.extend([
        "-o",
        "o.exr",
        "--photons",
        "2000",
        "--resolution",
        "32x24",
        "--iterations",
        "2",
    ]);
    all.extend(arguments);
    run(folder, library, &all)
}

fn run(folder: &Path, library: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
        .current_dir(folder)
        .env("PPM_VK_OIDN", library)
        .args(arguments)
        .output()
        .expect("ppm-vk runs")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A library in the folder that stands for Open Image Denoise.
fn fake(folder: &Path, major: u32, fails: bool) -> PathBuf {
    compiled(
        folder,
        Path::new("tests/denoising/fake.c"),
        &[format!("-DMAJOR={major}"), format!("-DFAILS={}", u32::from(fails))],
    )
}

fn compiled(folder: &Path, source: &Path, flags: &[String]) -> PathBuf {
    let library = folder.join("fake.so");
    let compiler = Command::new("cc")
        .args(["-shared", "-fPIC", "-w", "-o"])
        .arg(&library)
        .args(flags)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(source))
        .output()
        .expect("cc, which the build needs too");
    assert!(
        compiler.status.success(),
        "{}",
        String::from_utf8_lossy(&compiler.stderr)
    );
    library
}

fn assert_done(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
}

/// A file's channels by name.
fn channels(file: &Path) -> Vec<(String, Vec<f32>)> {
    let samples = |channel: AnyChannel<FlatSamples>| {
        let FlatSamples::F32(values) = channel.sample_data else {
            panic!("channel {} isn't of floats", channel.name);
        };
        (channel.name.to_string(), values)
    };
    let picture = read_first_flat_layer_from_file(file).expect("a picture");
    picture.layer_data.channel_data.list.into_iter().map(samples).collect()
}

fn denoised_by(file: &Path) -> Option<String> {
    let picture = read_first_flat_layer_from_file(file).expect("a picture");
    match picture.layer_data.attributes.other.get(&Text::from("denoisedBy")) {
        Some(AttributeValue::Text(text)) => Some(text.to_string()),
        _ => None,
    }
}

#[test]
fn a_library_that_cannot_be_used_is_told_before_the_render_in_one_line() {
    let folder = TempDir::new().expect("folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("text.so"), "no library").expect("a file");
    std::fs::write(at("empty.c"), "int nothing;").expect("a file");
    let without_functions = compiled(folder.path(), &at("empty.c"), &[]);
    std::fs::rename(without_functions, at("other.so")).expect("a file");
    for (library, words) in [
        (at("missing.so"), "there is no such file"),
        (at("text.so"), "can't be loaded"),
        (at("other.so"), "is not Open Image Denoise 2 ("),
        (fake(folder.path(), 3, false), "is version 3.1.1, not 2"),
    ] {
        let output = render(folder.path(), &library, &["--denoise", "--png", "o.png"]);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{}: {text}", library.display());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 1, "more than the error: {text}");
        let library = library.display().to_string();
        for word in [&library, words, "pip install pyoidn", "PPM_VK_OIDN", "--denoise"] {
            assert!(lines[0].contains(word), "«{word}» isn't in: {text}");
        }
        assert!(
            !at("o.exr").exists() && !at("o.png").exists(),
            "{library}: a picture was written"
        );
    }
    let without = render(folder.path(), &at("missing.so"), &[]);
    assert_done(&without);
}

#[test]
fn the_picture_is_denoised_and_the_noisy_one_is_a_layer_with_the_same_bits() {
    let folder = TempDir::new().expect("folder");
    let library = fake(folder.path(), 2, false);
    let exr = folder.path().join("o.exr");
    for backend in ["vulkan", "cpu"] {
        assert_done(&render(
            folder.path(),
            &library,
            &["--backend", backend, "--png", "noisy.png"],
        ));
        let noisy = channels(&exr);
        assert_eq!(denoised_by(&exr), None);
        let output = render(
            folder.path(),
            &library,
            &["--backend", backend, "--png", "o.png", "--denoise"],
        );
        assert_done(&output);
        assert!(
            stderr(&output).contains("denoised by Open Image Denoise 2.1.1"),
            "{}",
            stderr(&output)
        );
        let denoised = channels(&exr);
        assert_eq!(denoised_by(&exr).as_deref(), Some("Open Image Denoise 2.1.1"));
        let find = |channels: &[(String, Vec<f32>)], name: &str| {
            let channel = channels.iter().find(|(of, _)| of == name);
            channel
                .unwrap_or_else(|| panic!("{backend}: no channel {name}"))
                .1
                .clone()
        };
        for name in ["R", "G", "B"] {
            let before = find(&noisy, name);
            let halves: Vec<f32> = before.iter().map(|value| value / 2.0).collect();
            assert!(
                find(&denoised, name) == halves,
                "{backend}: {name} isn't what the library gave"
            );
            assert!(
                find(&denoised, &format!("noisy_{name}")) == before,
                "{backend}: noisy_{name} differs"
            );
        }
        assert!(
            find(&denoised, "A") == find(&noisy, "A"),
            "{backend}: the alpha differs"
        );
        let png = |name: &str| std::fs::read(folder.path().join(name)).expect("a PNG");
        assert!(
            png("o.png") != png("noisy.png"),
            "{backend}: the PNG is the noisy picture"
        );
    }
}

#[test]
fn layers_of_albedo_and_normals_guide_the_denoiser() {
    let folder = TempDir::new().expect("folder");
    let library = fake(folder.path(), 2, false);
    for (layers, divisor) in [("albedo,normal", 4.0), ("samples", 2.0)] {
        assert_done(&render(folder.path(), &library, &["--aov", layers, "--denoise"]));
        let channels: BTreeMap<_, _> = channels(&folder.path().join("o.exr")).into_iter().collect();
        let pixels = channels["R"].iter().zip(&channels["noisy_R"]);
        for (found, noisy) in pixels {
            let expected = noisy / divisor;
            assert!(
                (found - expected).abs() <= 1e-6 * expected,
                "{layers}: {found} of {noisy}"
            );
        }
    }
}

#[test]
fn merged_parts_are_denoised_together() {
    let folder = TempDir::new().expect("folder");
    let library = fake(folder.path(), 2, false);
    for part in ["1/2", "2/2"] {
        let state = format!("{}.state", &part[..1]);
        assert_done(&render(folder.path(), &library, &["--part", part, "--state", &state]));
    }
    let merge = |more: &[&str], library: &Path| {
        let arguments = [&["merge", "1.state", "2.state", "-o"], more].concat();
        let output = run(folder.path(), library, &arguments);
        (output.status.code(), stderr(&output))
    };
    assert_eq!(merge(&["noisy.exr"], &library).0, Some(0));
    assert_eq!(merge(&["denoised.exr", "--denoise"], &library).0, Some(0));
    let image = |name: &str| read_exr(&folder.path().join(name)).expect("a picture");
    let (noisy, denoised) = (image("noisy.exr"), image("denoised.exr"));
    let halves: Vec<[f32; 3]> = noisy
        .pixels()
        .iter()
        .map(|pixel| pixel.map(|value| value / 2.0))
        .collect();
    assert!(denoised.pixels() == halves, "not what the library gave");
    let (code, text) = merge(&["missing.exr", "--denoise"], Path::new("missing.so"));
    assert_eq!(code, Some(1), "{text}");
    assert!(!folder.path().join("missing.exr").exists());
}

#[test]
fn a_denoiser_that_fails_costs_no_picture() {
    let folder = TempDir::new().expect("folder");
    let library = fake(folder.path(), 2, true);
    let exr = folder.path().join("o.exr");
    assert_done(&render(folder.path(), &library, &[]));
    let noisy = channels(&exr);
    let output = render(folder.path(), &library, &["--denoise"]);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    let line = text.lines().last().unwrap_or_default();
    let expected = "error: the picture is not denoised: Open Image Denoise failed: not enough memory";
    assert_eq!(line, expected);
    assert!(channels(&exr) == noisy, "not the picture as it was rendered");
    assert_eq!(denoised_by(&exr), None);
}
