//! States of renders: gone on from after any interruption, and merged from parts.

#[path = "program/mod.rs"]
mod program;

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::Duration;

use ppm_vk::{Image, compare, read_exr};
use program::{ppm_vk, stderr};
use tempfile::TempDir;

fn run(folder: &TempDir, name: &str, more: &[&str]) -> Output {
    let arguments = arguments(name, more);
    ppm_vk(folder.path(), &arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Renders a scene of `scenes/` in a folder; returns what the program told.
#[track_caller]
fn render(folder: &TempDir, name: &str, more: &[&str]) -> String {
    let output = run(folder, name, more);
    assert_eq!(output.status.code(), Some(0), "{more:?}: {}", stderr(&output));
    stderr(&output)
}

/// The one line of a render that fails.
#[track_caller]
fn failure(folder: &TempDir, name: &str, more: &[&str]) -> String {
    let output = run(folder, name, more);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{more:?}: {text}");
    let errors: Vec<&str> = text.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{text}");
    errors[0].to_owned()
}

fn arguments(name: &str, more: &[&str]) -> Vec<String> {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let mut arguments = vec!["--scene".to_owned(), scene.to_str().expect("UTF-8").to_owned()];
    let small = ["--resolution", "48x32", "--photons", "5000", "--quiet"];
    // What comes later replaces these.
    let replaced = |flag: &str| more.contains(&flag);
    for pair in small[..4].chunks(2).filter(|pair| !replaced(pair[0])) {
        arguments.extend(pair.iter().map(|&argument| argument.to_owned()));
    }
    arguments.push(small[4].to_owned());
    arguments.extend(more.iter().map(|&argument| argument.to_owned()));
    arguments
}

fn picture(folder: &TempDir, name: &str) -> Image {
    read_exr(&folder.path().join(name)).expect("a picture")
}

/// The estimators, photons that are aimed, several camera paths, and the plain renderer.
#[test]
fn a_render_that_goes_on_gives_the_bits_of_one_that_was_not_interrupted() {
    for (name, more) in [
        ("cornell-spheres.gltf", &["--emission", "aimed"][..]),
        ("pool.gltf", &[]),
        ("cornell-spheres.gltf", &["--estimator", "ppm"]),
        ("cornell-spheres.gltf", &["--backend", "cpu", "--resolution", "16x16"]),
        (
            "cornell-spheres.gltf",
            &["--backend", "cpu", "--estimator", "ppm", "--resolution", "16x16"],
        ),
    ] {
        let folder = TempDir::new().expect("a folder");
        let run = |last: &[&str]| render(&folder, name, &[more, last].concat());
        run(&["--iterations", "7", "-o", "whole.exr"]);
        run(&["--iterations", "3", "-o", "a.exr", "--state", "a.state"]);
        let told = run(&["--iterations", "7", "-o", "a.exr", "--state", "a.state", "--resume"]);
        assert!(told.contains("after 3 iterations"), "{told}");
        assert!(
            picture(&folder, "a.exr") == picture(&folder, "whole.exr"),
            "{name} {more:?}: what was restored is not all that iterations depend on"
        );
        // With nothing left to do, the picture is that of the state.
        run(&["--iterations", "7", "-o", "b.exr", "--state", "a.state", "--resume"]);
        assert!(
            picture(&folder, "b.exr") == picture(&folder, "whole.exr"),
            "{name} {more:?}"
        );
    }
}

#[cfg(unix)]
#[test]
fn a_render_that_is_killed_goes_on_from_its_last_save() {
    let folder = TempDir::new().expect("a folder");
    let sized = ["--resolution", "64x64", "--iterations", "24", "--photons", "20000"];
    let of = |more: &[&'static str]| [&sized[..], more].concat();
    render(&folder, "cornell-spheres.gltf", &of(&["-o", "whole.exr"]));
    let kills = if std::env::var_os("PPM_VK_LONG").is_some() {
        10
    } else {
        2
    };
    let saving = of(&["-o", "a.exr", "--state", "a.state", "--save-every", "0.01", "--resume"]);
    let mut gone_on = 0;
    for kill in 0..kills {
        let mut child = Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
            .args(arguments("cornell-spheres.gltf", &saving))
            .current_dir(folder.path())
            .stderr(Stdio::null())
            .spawn()
            .expect("ppm-vk runs");
        sleep(Duration::from_millis(700 + 137 * kill));
        // SIGKILL: nothing can be written after it.
        child.kill().expect("killed");
        child.wait().expect("ended");
        gone_on += u32::from(folder.path().join("a.state").exists());
    }
    println!("{gone_on} of {kills} kills left a state");
    render(&folder, "cornell-spheres.gltf", &saving);
    assert!(
        picture(&folder, "a.exr") == picture(&folder, "whole.exr"),
        "other bits after {kills} kills"
    );
}

#[test]
fn a_state_of_another_render_is_refused_with_what_differs() {
    let folder = TempDir::new().expect("a folder");
    let of = |more: &[&'static str]| [&["--iterations", "1", "--state", "a.state"][..], more].concat();
    render(&folder, "cornell.gltf", &of(&[]));
    let before = fs::read(folder.path().join("a.state")).expect("a state");
    for (name, more, words) in [
        (
            "cornell.gltf",
            &["--photons", "6000"][..],
            "photons is 5000 instead of 6000",
        ),
        ("cornell.gltf", &["--seed", "1"], "seed is 0 instead of 1"),
        (
            "cornell.gltf",
            &["--resolution", "32x32"],
            "resolution is 48x32 instead of 32x32",
        ),
        ("cornell.gltf", &["--shift", "0.1,0"], "the camera"),
        ("cornell-spheres.gltf", &[], "the scene"),
        (
            "cornell.gltf",
            &["--backend", "cpu"],
            "the renderer is vulkan instead of cpu",
        ),
        ("cornell.gltf", &["--part", "1/2"], "the part is 1/1 instead of 1/2"),
    ] {
        let line = failure(&folder, name, &of(&[&["--resume"], more].concat()));
        assert!(line.contains("a.state") && line.contains(words), "{more:?}: {line}");
    }
    let whole = fs::read(folder.path().join("a.state")).expect("a state");
    assert!(whole == before, "a refused state was changed");
    for (bytes, words) in [
        (&whole[..whole.len() / 2], "cut short"),
        (&b"not a state"[..], "no state"),
        (&[], "no state"),
    ] {
        fs::write(folder.path().join("a.state"), bytes).expect("a file");
        let line = failure(&folder, "cornell.gltf", &of(&["--resume"]));
        assert!(line.contains("a.state") && line.contains(words), "{line}");
    }
    let output = ppm_vk(folder.path(), &["--scene", "x.gltf", "--resume"]);
    assert_eq!(output.status.code(), Some(2), "--resume without --state");
}

#[test]
fn more_iterations_and_other_outputs_are_no_other_render() {
    let folder = TempDir::new().expect("a folder");
    render(
        &folder,
        "cornell.gltf",
        &["--iterations", "2", "--state", "a.state", "-o", "a.exr"],
    );
    let more = [
        "--iterations",
        "3",
        "--state",
        "a.state",
        "--resume",
        "-o",
        "b.exr",
        "--png",
        "b.png",
    ];
    render(&folder, "cornell.gltf", &more);
    let told = render(&folder, "cornell.gltf", &["--iterations", "1", "--state", "a.state"]);
    assert!(told.contains("will be replaced"), "{told}");
    let told = render(
        &folder,
        "cornell.gltf",
        &["--iterations", "1", "--state", "new.state", "--resume"],
    );
    assert!(told.contains("no new.state yet"), "{told}");
}

/// A limit on file sizes is to a program as a full disk.
#[cfg(unix)]
#[test]
fn a_disk_that_fills_leaves_the_older_state_whole() {
    let folder = TempDir::new().expect("a folder");
    render(
        &folder,
        "cornell.gltf",
        &["--iterations", "1", "--state", "a.state", "-o", "a.exr"],
    );
    let state = folder.path().join("a.state");
    let before = fs::read(&state).expect("a state");
    // In blocks of 512 or 1024 bytes: room for the picture, not for the state.
    let blocks = before.len() / 2048;
    let more = [
        "--iterations",
        "4",
        "--state",
        "a.state",
        "--resume",
        "-o",
        "a.exr",
        "--save-every",
        "0.001",
    ];
    let output = Command::new("sh")
        .arg("-c")
        .arg(format!("ulimit -f {blocks}; exec \"$0\" \"$@\""))
        .arg(env!("CARGO_BIN_EXE_ppm-vk"))
        .args(arguments("cornell.gltf", &more))
        .current_dir(folder.path())
        .output()
        .expect("ppm-vk runs");
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("a.state: can't be written") && text.contains("free space"),
        "{text}"
    );
    assert!(
        fs::read(&state).expect("a state") == before,
        "the older state has changed"
    );
    let left = fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!(left, 2, "files beside a.state and a.exr");
}

/// The states of all parts of a render.
fn parts(folder: &TempDir, name: &str, count: u32, more: &[&str]) -> Vec<String> {
    let of = |number: u32| {
        let state = format!("{number}.state");
        let part = format!("{number}/{count}");
        render(
            folder,
            name,
            &[more, &["--part", &part, "--state", &state, "-o", "part.exr"]].concat(),
        );
        state
    };
    (1..=count).map(of).collect()
}

#[track_caller]
fn merge(folder: &TempDir, states: &[&str], more: &[&str]) -> String {
    let output = ppm_vk(folder.path(), &[&["merge"], states, more].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    stderr(&output)
}

#[test]
fn neither_order_nor_grouping_of_parts_makes_a_difference_to_the_bit() {
    let folder = TempDir::new().expect("a folder");
    parts(&folder, "cornell-spheres.gltf", 4, &["--iterations", "5"]);
    let told = merge(
        &folder,
        &["1.state", "2.state", "3.state", "4.state"],
        &["-o", "a.exr", "--state", "a.state"],
    );
    assert!(
        told.contains("4 of 4 parts, 20 iterations, 100000 photon paths"),
        "{told}"
    );
    merge(
        &folder,
        &["4.state", "2.state"],
        &["-o", "b.exr", "--state", "42.state"],
    );
    merge(
        &folder,
        &["3.state", "42.state", "1.state"],
        &["-o", "b.exr", "--state", "b.state"],
    );
    for (a, b) in [("a.exr", "b.exr"), ("a.state", "b.state")] {
        let [a, b] = [a, b].map(|file| fs::read(folder.path().join(file)).expect("a file"));
        assert!(a == b, "sums depend on their order");
    }
}

#[test]
fn parts_that_do_not_belong_together_are_refused_and_missing_ones_told() {
    let folder = TempDir::new().expect("a folder");
    parts(&folder, "cornell.gltf", 2, &["--iterations", "1"]);
    render(
        &folder,
        "cornell.gltf",
        &[
            "--iterations",
            "1",
            "--part",
            "2/2",
            "--state",
            "other.state",
            "--seed",
            "5",
        ],
    );
    render(
        &folder,
        "cornell.gltf",
        &["--iterations", "1", "--state", "whole.state"],
    );
    let told = merge(&folder, &["2.state"], &["-o", "a.exr"]);
    assert!(told.contains("of 2 parts, 1 are missing (1)"), "{told}");
    for (states, words) in [
        (
            &["1.state", "other.state"][..],
            "other.state: the state is of another render: seed is 5 instead of 0",
        ),
        (&["1.state", "2.state", "1.state"], "contains part 1"),
        (&["whole.state"], "not of a part"),
    ] {
        let output = ppm_vk(folder.path(), &[&["merge", "-o", "b.exr"], states].concat());
        assert_eq!(output.status.code(), Some(1), "{states:?}");
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
        assert!(!folder.path().join("b.exr").exists());
    }
}

/// The errors of the merged picture and of the whole are both noise and blur of the same size: their relMSE may differ by a fifth.
#[test]
#[ignore = "takes a minute: scripts/test --long"]
fn merged_quarters_have_the_error_of_the_whole() {
    let folder = TempDir::new().expect("a folder");
    let sized = ["--resolution", "64x64", "--photons", "30000"];
    let with = |more: &[&'static str]| [&sized[..], more].concat();
    let name = "cornell-spheres.gltf";
    render(
        &folder,
        name,
        &with(&["--iterations", "1500", "--seed", "9", "-o", "reference.exr"]),
    );
    let reference = picture(&folder, "reference.exr");
    let mut errors = [0.0; 2];
    for seed in ["1", "2", "3"] {
        let seeded = [&with(&["--seed"])[..], &[seed]].concat();
        render(
            &folder,
            name,
            &[&seeded[..], &["--iterations", "128", "-o", "whole.exr"]].concat(),
        );
        let states = parts(&folder, name, 4, &[&seeded[..], &["--iterations", "32"]].concat());
        let told = merge(
            &folder,
            &states.iter().map(String::as_str).collect::<Vec<_>>(),
            &["-o", "merged.exr"],
        );
        println!("{told}");
        for (error, file) in errors.iter_mut().zip(["whole.exr", "merged.exr"]) {
            *error += compare(&picture(&folder, file), &reference)
                .expect("the same size")
                .rel_mse;
        }
    }
    let [whole, merged] = errors;
    println!("relMSE of the whole {:.2e}, merged {:.2e}", whole / 3.0, merged / 3.0);
    assert!(
        merged < 1.2 * whole,
        "merged {merged}, whole {whole}: see Part::radius2_factor"
    );
}
