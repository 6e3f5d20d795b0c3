//! Cases about the file itself: each shows one matte plate of reflectance ½, by default in uniform light of radiance 1. A reading
//! error changes the value.
//!
//! The intended plate, `plain`, is checked for its absolute value. All others are compared with `plain` with the same samples, as
//! many as are needed to distinguish the possible readings: direct light is proportional to reflectance, so that the ratio has no
//! noise.

use std::path::Path;
use std::sync::OnceLock;

use super::files::{Seen, assert_refused, folder, name, render, scenes};

/// For rounding, and for the few samples that hit other points because a number in the file is rounded differently.
const TOLERANCE: f64 = 1e-3;

/// The same samples for all files. The renderer does not matter here, and the CPU needs no pipelines.
fn look(scene: &Path, more: &[&str]) -> Seen {
    render(scene, 8, 4, 512, &[&["--backend", "cpu"], more].concat())
}

/// In white light.
fn look_in_white(scene: &Path) -> Seen {
    look(scene, &["--environment", "1,1,1"])
}

/// The left and the right half of the plate relative to `plain`'s, in the unit in which `plain` has ½.
fn halves(seen: &Seen) -> [[f64; 3]; 2] {
    static PLAIN: OnceLock<[f64; 2]> = OnceLock::new();
    let plain = PLAIN.get_or_init(|| {
        let folder = folder("02").expect("the folder is there");
        let plain = look_in_white(&folder.join("plain.gltf"));
        [plain.mean(|x, _| x < 0.0)[0], plain.mean(|x, _| x > 0.0)[0]]
    });
    let sides = [seen.mean(|x, _| x < 0.0), seen.mean(|x, _| x > 0.0)];
    [0, 1].map(|side| sides[side].map(|value| 0.5 * value / plain[side]))
}

#[track_caller]
fn assert_color(seen: &Seen, expected: [f64; 3], file: &str) {
    for found in halves(seen) {
        let is_right = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < TOLERANCE);
        assert!(is_right, "{file}: {found:?} instead of {expected:?}; {}", seen.said);
    }
}

/// False alarms: 16,384 independent light samples, uniform over directions, with a standard deviation of .65, would have one of
/// .005 for their mean; the tolerance is five of those. Actual samples are spread more evenly, so that an alarm is rarer than 1
/// in 10⁶.
#[test]
fn the_plain_plate_has_half_of_the_light() {
    let Some(folder) = folder("02") else { return };
    for backend in ["vulkan", "cpu"] {
        let more = ["--environment", "1,1,1", "--backend", backend];
        let plain = render(&folder.join("plain.gltf"), 8, 32, 512, &more);
        plain.assert_mean(0.5, 0.025, backend, |_, _| true);
        assert!(plain.warnings().is_empty(), "{}", plain.said);
    }
}

#[test]
fn integers_may_be_written_with_a_fraction_and_extras_may_be_anything() {
    for (number, count) in [("02", 3), ("15", 9)] {
        let Some(folder) = folder(number) else { return };
        for scene in scenes(&folder, count) {
            let seen = look_in_white(&scene);
            assert_color(&seen, [0.5; 3], &name(&scene));
            // Nothing in them is forbidden.
            assert!(seen.warnings().is_empty(), "{}: {}", name(&scene), seen.said);
        }
    }
}

/// The image is one texel of this colour: in sRGB 188, 64, 128 of 255.
const TEXEL: [f64; 3] = [0.503, 0.051, 0.216];

#[test]
fn an_image_is_found_by_every_uri_that_is_valid_and_missed_with_a_warning() {
    // A missing file, a file name of different case, no URI, base64 of another alphabet.
    let missed = [
        "missing.gltf",
        "case-differs.gltf",
        "backslash.gltf",
        "data-urlsafe.gltf",
    ];
    let Some(folder) = folder("07") else { return };
    for scene in scenes(&folder.join("sub"), 22) {
        let (seen, file) = (look_in_white(&scene), name(&scene));
        let is_missed = missed.contains(&&*file);
        assert_color(&seen, if is_missed { [1.0; 3] } else { TEXEL }, &file);
        let warnings = seen.warnings();
        assert_eq!(warnings.len(), usize::from(is_missed), "{file}: {}", seen.said);
        assert!(
            warnings
                .iter()
                .all(|line| line.contains("image 0") && line.contains("left out")),
            "{file}: {}",
            seen.said
        );
    }
}

#[test]
fn a_glb_that_is_damaged_is_refused_and_one_that_is_only_padded_otherwise_is_read() {
    let refused = [
        ("bin-is-buffer-1.glb", "buffer 1: it has no uri"),
        ("length-too-long.glb", "truncated .glb"),
        ("length-too-short.glb", "damaged .glb"),
        ("length-zero.glb", "damaged .glb"),
        ("uri-empty-string.glb", "buffer 0"),
    ];
    let warned = [
        ("byteLength-3-more-than-bin.glb", "is taken for padding"),
        ("json-nul-padded.glb", "NUL"),
    ];
    let Some(folder) = folder("08") else { return };
    for scene in scenes(&folder, 13) {
        let file = name(&scene);
        if let Some((_, words)) = refused.iter().find(|(refused, _)| *refused == file) {
            assert_refused(&scene, words, &[]);
            continue;
        }
        let seen = look_in_white(&scene);
        assert_color(&seen, [0.5; 3], &file);
        let expected: Vec<_> = warned.iter().filter(|(warned, _)| *warned == file).collect();
        let warnings = seen.warnings();
        assert!(
            warnings.len() == expected.len() && expected.iter().all(|(_, words)| warnings[0].contains(words)),
            "{file}: {}",
            seen.said
        );
    }
}

/// Files that glTF forbids are refused if their meaning is unclear. If other viewers agree on it, they are shown with a warning.
#[test]
fn forbidden_gltf_is_refused_or_shown_with_a_warning_as_other_viewers_do() {
    let refused = [
        ("alphaMode-lower-case.gltf", "alphaMode"),
        ("aspect-0.gltf", "aspectRatio"),
        ("child-of-two.gltf", "node 3: it is a child of both"),
        ("fewer-normals.gltf", "3 normals for 4 positions"),
        ("ior-below-1.gltf", "index of refraction is 0.9"),
        ("metallic-slightly-negative.gltf", "metallicFactor is -0.0001"),
        ("nan-normals.gltf", "normal of vertex 0"),
        ("node-listed-twice.gltf", "it lists node 0, twice"),
        ("root-node-also-child.gltf", "it lists node 0, which is the child"),
        ("spot-outer-over-half-pi.gltf", "outerConeAngle 1.6"),
        ("texcoord-u16-not-normalized-unused.gltf", "TEXCOORD_0, accessor 4"),
        ("version-number.gltf", "asset.version is \"2\""),
    ];
    let warned = [
        ("color-u8-not-normalized.gltf", "accessor 4: its colours"),
        ("custom-attributes.gltf", "\"COLOR\" and \"CUSTOM\""),
        ("empty-arrays.gltf", "\"images\", \"skins\""),
        ("empty-primitives.gltf", "lists without elements, \"primitives\""),
        // Not forbidden, but not shown.
        ("lines-too.gltf", "Lines"),
        ("null-array.gltf", "null, \"textures\""),
        ("nulls-optional.gltf", "null, \"extensions\" and \"normalTexture\""),
        ("odd-sampler-unused.gltf", "sampler 0"),
        ("zero-count-accessor.gltf", "accessor 4"),
    ];
    let Some(folder) = folder("09") else { return };
    for scene in scenes(&folder, 23) {
        let file = name(&scene);
        if let Some((_, words)) = refused.iter().find(|(refused, _)| *refused == file) {
            assert_refused(&scene, words, &[]);
            continue;
        }
        let seen = look_in_white(&scene);
        // A colour of 128 of 255.
        let expected = if file.starts_with("color") { 0.251 } else { 0.5 };
        assert_color(&seen, [expected; 3], &file);
        let warnings = seen.warnings();
        let words = warned
            .iter()
            .find(|(warned, _)| *warned == file)
            .map(|(_, words)| *words);
        assert!(
            warnings.len() == usize::from(words.is_some()) && words.is_none_or(|words| warnings[0].contains(words)),
            "{file}: a warning with {words:?} expected; {}",
            seen.said
        );
    }
}

#[test]
fn every_graph_of_nodes_shows_the_plate() {
    let Some(folder) = folder("16") else { return };
    for scene in scenes(&folder, 12) {
        let file = name(&scene);
        match &*file {
            // The file's own lights illuminate the plate.
            "light-thrice.gltf" | "spot-in-mirrored-node.gltf" => {
                let seen = look(&scene, &[]);
                seen.assert_mean(0.5, 0.001, "the centre", |x, y| x.abs().max(y.abs()) < 0.25);
            }
            "mirrored-plate.gltf" => look(&scene, &[]).assert_mean(0.5, 0.001, "all", |_, _| true),
            // With the default camera, which frames the plate and sees the light next to it.
            "camera-in-other-scene.gltf" => {
                let seen = look_in_white(&scene);
                let framed = seen.warnings().iter().any(|line| line.contains("framed on its bounds"));
                assert!(framed, "{file}: {}", seen.said);
                let plain = look_in_white(&folder.join("no-scenes.gltf"));
                let middle = |x: f64, y: f64| x.abs().max(y.abs()) < 0.5;
                seen.assert_mean(plain.mean(middle)[0], TOLERANCE, "the middle", middle);
            }
            "camera-in-scaled-node.gltf" | "camera-in-unevenly-scaled-node.gltf" => {
                let halves = halves(&look_in_white(&scene));
                for (found, expected) in halves.iter().flatten().zip([0.2, 0.2, 0.2, 0.8, 0.8, 0.8]) {
                    assert!((found - expected).abs() < TOLERANCE, "{file}: {halves:?}");
                }
            }
            _ => {
                let seen = look_in_white(&scene);
                assert_color(&seen, [0.5; 3], &file);
                let has_empty_list = file.contains("no-default");
                assert_eq!(
                    seen.warnings().len(),
                    usize::from(has_empty_list),
                    "{file}: {}",
                    seen.said
                );
                // Which of several scenes is rendered.
                let is_said = seen.said.lines().any(|line| line.starts_with("note: scene "));
                let has_several = file.contains("no-default") || file.starts_with("scene-without");
                assert_eq!(is_said, has_several, "{file}: {}", seen.said);
            }
        }
    }
}
