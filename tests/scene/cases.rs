//! Files after public bug reports. Where the folder that holds them isn't there, nothing is checked.

use std::fs;
use std::path::{Path, PathBuf};

use ppm_vk::scene::Scene;

/// The glTF files of the cases of these numbers.
fn files(numbers: &[&str]) -> Vec<PathBuf> {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases");
    let Ok(folders) = fs::read_dir(cases) else {
        println!("skipped, for it isn't there: ../shared/cases");
        return Vec::new();
    };
    let mut found = Vec::new();
    for folder in folders.map(|folder| folder.expect("a folder").path()) {
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !numbers.iter().any(|number| name.starts_with(number)) {
            continue;
        }
        let entries = [folder.join("sub"), folder]
            .into_iter()
            .flat_map(fs::read_dir)
            .flatten();
        let scenes = entries.map(|entry| entry.expect("an entry").path());
        let scenes = scenes.filter(|path| path.extension().is_some_and(|end| end == "gltf" || end == "glb"));
        found.extend(scenes);
    }
    assert!(found.len() > 3 * numbers.len(), "only {} files", found.len());
    found
}

#[test]
fn every_case_loads_or_says_what_in_it_gltf_forbids() {
    // These break the format, and its validator says so.
    let refused = [
        "bin-is-buffer-1.glb",
        "length-too-long.glb",
        "length-too-short.glb",
        "length-zero.glb",
        "uri-empty-string.glb",
        "alphaMode-lower-case.gltf",
        "aspect-0.gltf",
        "child-of-two.gltf",
        "fewer-normals.gltf",
        "ior-below-1.gltf",
        "metallic-slightly-negative.gltf",
        "nan-normals.gltf",
        "node-listed-twice.gltf",
        "root-node-also-child.gltf",
        "spot-outer-over-half-pi.gltf",
        "texcoord-u16-not-normalized-unused.gltf",
        "version-number.gltf",
    ];
    for path in files(&["02", "07", "08", "09", "15", "16"]) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match Scene::load(&path) {
            Ok(_) => {}
            Err(error) => assert!(
                refused.contains(&&*name) && !error.to_string().contains('\n'),
                "{error}"
            ),
        }
    }
}

#[test]
fn images_are_found_by_every_uri_that_is_valid() {
    // No such file, another one where names are told apart by case, no URI, base64 of another alphabet.
    let unreadable = [
        "missing.gltf",
        "case-differs.gltf",
        "backslash.gltf",
        "data-urlsafe.gltf",
    ];
    for path in files(&["07"]) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let scene = Scene::load(&path).expect(&name);
        let left_out = scene.warnings.iter().filter(|line| line.contains("left out")).count();
        assert_eq!(
            left_out,
            usize::from(unreadable.contains(&&*name)),
            "{name}: {:?}",
            scene.warnings
        );
    }
}
