//! `ppm-vk bench` and `ppm-vk compare`, on small pictures.

use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

fn ppm_vk(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("ppm-vk runs")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

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
    assert_eq!(methods.len(), ppm_vk::gather::METHODS.len());
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
