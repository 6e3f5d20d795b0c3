//! `ppm-vk bench`, `compare`, `converge` and --target-error, on small pictures.

#[path = "program/mod.rs"]
mod program;

use program::{ppm_vk, stderr};
use tempfile::TempDir;

#[test]
fn the_gather_bench_prints_tables_and_writes_its_files() {
    let folder = TempDir::new().expect("folder");
    let files = ["b.json", "b.svg", "c.png"].map(|name| folder.path().join(name));
    let [json, plot, clusters] = files.each_ref().map(|path| path.to_str().expect("UTF-8"));
    let output = ppm_vk(
        folder.path(),
        &[
            "bench",
            "gather",
            "--resolution",
            "24x21",
            "--photons",
            "2000",
            "--repeats",
            "1",
            "--json",
            json,
            "--plot",
            plot,
            "--clusters",
            clusters,
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout);
    for word in [
        "All methods at 24x21",
        "cluster-grid",
        "cpu-kdtree",
        "% fillers",
        "photons",
    ] {
        assert!(text.contains(word), "no «{word}» in:\n{text}");
    }
    let value: serde_json::Value = serde_json::from_slice(&std::fs::read(&files[0]).expect("JSON")).expect("JSON");
    let methods = value["resolutions"][0]["methods"].as_array().expect("methods");
    assert_eq!(methods.len(), ppm_vk::internals::gather::METHODS.len());
    for method in methods {
        assert!(method["gather_us"].as_f64().expect("a time") > 0.0, "{method}");
    }
    assert!(std::fs::read_to_string(&files[1]).expect("SVG").contains("</svg>"));
    assert!(std::fs::read(&files[2]).expect("PNG").starts_with(b"\x89PNG"));
}

#[test]
fn the_scaling_bench_reports_slopes() {
    let folder = TempDir::new().expect("folder");
    let output = ppm_vk(
        folder.path(),
        &[
            "bench",
            "gather",
            "--resolution",
            "24x21",
            "--photons",
            "500",
            "--repeats",
            "1",
            "--scaling",
            "--methods",
            "clustered",
            "--most-photons",
            "31623",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(text.matches("slope of the log-log line").count(), 3, "{text}");
}

#[test]
fn compare_measures_a_picture_against_its_reference() {
    let folder = TempDir::new().expect("folder");
    let reference = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/references/cornell.exr");
    let equal = ppm_vk(
        folder.path(),
        &["compare", reference, reference, "--json", "--heatmap", "e.png"],
    );
    assert_eq!(equal.status.code(), Some(0), "{}", stderr(&equal));
    let value: serde_json::Value = serde_json::from_slice(&equal.stdout).expect("JSON");
    for key in ["rmse", "rel_mse", "mae", "flip"] {
        assert!(value[key].as_f64().expect(key) < 1e-6, "{key}: {value}");
    }
    assert_eq!(value["mean_ratio"][1], 1.0);
    assert!(
        std::fs::read(folder.path().join("e.png"))
            .expect("PNG")
            .starts_with(b"\x89PNG")
    );
    let missing = ppm_vk(folder.path(), &["compare", "nothing.exr", reference]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(stderr(&missing).contains("nothing.exr"), "{}", stderr(&missing));
}

#[test]
fn compare_tells_of_nan_in_json_too() {
    let folder = TempDir::new().expect("folder");
    let reference = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/references/cornell.exr");
    let mut image = ppm_vk::internals::film::read_exr(std::path::Path::new(reference)).expect("the reference");
    let mut pixels = image.pixels().to_vec();
    pixels[7][1] = f32::NAN;
    image = ppm_vk::internals::film::Image::new(image.width(), image.height(), pixels);
    let metadata = ppm_vk::internals::film::Metadata::default();
    ppm_vk::internals::film::write_exr(
        &image,
        ppm_vk::internals::film::Additions::default(),
        &folder.path().join("nan.exr"),
        &metadata,
    )
    .expect("a file");
    let output = ppm_vk(folder.path(), &["compare", "nan.exr", reference, "--json"]);
    assert!(
        stderr(&output).contains("nan.exr: 1 pixels with NaN"),
        "{}",
        stderr(&output)
    );
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(value["defects"]["image"]["nan"], 1);
    assert_eq!(value["defects"]["reference"]["nan"], 0);
    assert!(value["flip"].is_null() && value["rel_mse"].is_null(), "{value}");
    let refused = ppm_vk(folder.path(), &["compare", "nan.exr", reference, "--heatmap", "e.jpg"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains(".png"), "{}", stderr(&refused));
}

#[test]
fn converge_follows_the_error_of_each_setting() {
    let folder = TempDir::new().expect("folder");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.gltf");
    let rendered = ppm_vk(
        folder.path(),
        &[
            "--scene",
            scene,
            "--resolution",
            "16x14",
            "--photons",
            "2000",
            "--iterations",
            "300",
            "-o",
            "reference.exr",
        ],
    );
    assert_eq!(rendered.status.code(), Some(0), "{}", stderr(&rendered));
    let output = ppm_vk(
        folder.path(),
        &[
            "converge",
            "--scene",
            scene,
            "--reference",
            "reference.exr",
            "--time",
            "600",
            "--iterations",
            "64",
            "--photons",
            "2000",
            "--seed",
            "1",
            "--vary",
            "direct",
            "--csv",
            "c.csv",
            "--plot",
            "c.svg",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let csv = std::fs::read_to_string(folder.path().join("c.csv")).expect("CSV");
    let columns = csv.lines().next().expect("a heading").split(',').count();
    let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == columns), "{csv}");
    for setting in ["direct light", "direct photons"] {
        let errors = rows
            .iter()
            .filter(|row| row[0] == setting)
            .map(|row| row[4].parse::<f64>().expect("relMSE"));
        let errors: Vec<f64> = errors.collect();
        // After 1, 2, 4, … iterations.
        assert_eq!(errors.len(), 7, "{setting}: {errors:?}");
        assert!(errors[6] < errors[0], "{setting}: {errors:?}");
    }
    assert!(
        std::fs::read_to_string(folder.path().join("c.svg"))
            .expect("SVG")
            .contains("</svg>")
    );
}

#[test]
fn a_render_stops_at_the_target_error_and_writes_its_estimate() {
    let folder = TempDir::new().expect("folder");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.gltf");
    let render = |target: &str| {
        let output = ppm_vk(
            folder.path(),
            &[
                "--scene",
                scene,
                "--resolution",
                "32x28",
                "--photons",
                "5000",
                "--target-error",
                target,
                "-o",
                "p.exr",
            ],
        );
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let text = stderr(&output);
        let words: Vec<&str> = text.split_whitespace().collect();
        let before = |what: &str| {
            let index = words
                .iter()
                .position(|word| word.starts_with(what))
                .expect("the summary");
            words[index - 1].parse::<f64>().expect("a number")
        };
        let about = words.iter().position(|word| *word == "about").expect("an estimate");
        (before("iterations"), words[about + 1].parse::<f64>().expect("an error"))
    };
    let (coarse, coarse_error) = render("0.5");
    let (fine, fine_error) = render("0.05");
    assert!(
        coarse_error <= 50.0 && fine_error <= 5.0,
        "{coarse_error} %, {fine_error} %"
    );
    assert!(
        coarse == 16.0 && fine > coarse,
        "{coarse} iterations, {fine} iterations"
    );
    let file = std::fs::read(folder.path().join("p.exr")).expect("EXR");
    for name in ["estimatedError", "error_R", "error_G", "error_B"] {
        let found = file.windows(name.len()).any(|bytes| bytes == name.as_bytes());
        assert!(found, "no {name} in the picture");
    }
}

#[test]
fn no_measurement_overwrites_its_inputs() {
    let folder = TempDir::new().expect("folder");
    let reference = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/references/cornell.exr");
    let copy = folder.path().join("r");
    std::fs::copy(reference, &copy).expect("a copy");
    std::fs::copy(reference, folder.path().join("r.png")).expect("a copy");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.gltf");
    for arguments in [
        vec!["compare", reference, "r.png", "--heatmap", "r.png"],
        vec!["converge", "--scene", scene, "--reference", "r", "--csv", "r"],
        vec!["bench", "gather", "--json", "f", "--plot", "f"],
    ] {
        let output = ppm_vk(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("would overwrite"), "{}", stderr(&output));
    }
    assert_eq!(
        std::fs::read(&copy).expect("r"),
        std::fs::read(reference).expect("the reference")
    );
}
