//! Behaviour that scripts rely on: exit codes, one line for an error, output files that are complete or absent.

#[path = "program/mod.rs"]
mod program;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use program::{ppm_vk, stderr};
use tempfile::TempDir;

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

fn small_render(folder: &Path, scene: &Path, more: &[&str]) -> Output {
    let scene = scene.to_str().expect("UTF-8");
    let mut arguments = vec![
        "--scene",
        scene,
        "--resolution",
        "16x16",
        "--iterations",
        "1",
        "--photons",
        "1000",
    ];
    arguments.extend(more);
    ppm_vk(folder, &arguments)
}

fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("folder");
    entries
        .map(|entry| entry.expect("entry").file_name().to_string_lossy().into_owned())
        .collect()
}

/// The run failed: exit code 1, one line that contains these words, no panic, no output file.
fn assert_fails(folder: &TempDir, output: &Output, words: &[&str]) {
    let text = stderr(output);
    let errors: Vec<&str> = text.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(output.status.code(), Some(1), "exit code; stderr: {text}");
    assert_eq!(errors.len(), 1, "one error line expected: {text}");
    assert!(!text.contains("panicked"), "{text}");
    for word in words {
        assert!(errors[0].contains(word), "«{word}» isn't in: {}", errors[0]);
    }
    let left: Vec<_> = files(folder.path())
        .into_iter()
        .filter(|file| file.ends_with(".exr"))
        .collect();
    assert!(left.is_empty(), "left behind: {left:?}");
}

/// The arguments are invalid: exit code 2, and the message names the flag.
fn assert_refused(output: &Output, flag: &str) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(2), "exit code for {flag}; stderr: {text}");
    assert!(text.contains(flag), "{flag} isn't named: {text}");
    assert!(!text.contains("panicked"), "{text}");
}

#[test]
fn a_render_writes_the_picture_under_the_scenes_name() {
    let folder = TempDir::new().expect("folder");
    let output = small_render(folder.path(), &scene("cornell.gltf"), &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(files(folder.path()), ["cornell.exr"]);
    assert!(
        stderr(&output).contains("initial radius"),
        "the automatic radius is printed: {}",
        stderr(&output)
    );
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
    let folder = TempDir::new().expect("folder");
    let mut pictures = Vec::new();
    for (file, seed) in [("a.exr", "7"), ("b.exr", "7"), ("c.exr", "8")] {
        let arguments = ["-o", file, "--seed", seed, "--iterations", "3"];
        let scene = scene("cornell-spheres.gltf");
        let mut all = vec![
            "--scene",
            scene.to_str().expect("UTF-8"),
            "--resolution",
            "48x32",
            "--photons",
            "5000",
        ];
        all.extend(arguments);
        let output = ppm_vk(folder.path(), &all);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        pictures.push(ppm_vk::internals::film::read_exr(&folder.path().join(file)).expect("picture"));
    }
    assert!(
        pictures[0] == pictures[1],
        "two runs with one seed differ: an order that isn't fixed somewhere"
    );
    assert!(pictures[0] != pictures[2], "the seed has no effect");
}

#[test]
fn manual_writes_a_page_for_every_command_and_completions() {
    let folder = TempDir::new().expect("folder");
    let output = ppm_vk(folder.path(), &["manual", "."]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let written = files(folder.path());
    let commands = [
        "merge",
        "compare",
        "converge",
        "inspect",
        "devices",
        "gathers",
        "bench-gather",
    ];
    let pages = commands.map(|command| format!("ppm-vk-{command}.1"));
    let others = ["ppm-vk.1", "ppm-vk.bash", "_ppm-vk", "ppm-vk.fish"].map(str::to_owned);
    for name in pages.into_iter().chain(others) {
        assert!(written.contains(&name), "no {name} among {written:?}");
    }
    let page = std::fs::read_to_string(folder.path().join("ppm-vk.1")).expect("page");
    assert!(page.contains("\\-\\-target\\-error"), "a flag is missing:\n{page}");
    let output = ppm_vk(folder.path(), &["manual", "nowhere"]);
    assert_fails(&folder, &output, &["nowhere"]);
}

#[test]
fn profiles_and_traces_list_every_stage() {
    let folder = TempDir::new().expect("folder");
    let more = [
        "--profile",
        "--profile-json",
        "p.json",
        "--trace",
        "t.json",
        "--png",
        "p.png",
        "--quiet",
    ];
    let output = small_render(folder.path(), &scene("cornell.gltf"), &more);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    let read = |file: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(folder.path().join(file)).expect(file)).expect("JSON")
    };
    let profile = read("p.json");
    let events = read("t.json")["traceEvents"].as_array().expect("events").len();
    let stages = profile["stages"].as_array().expect("stages");
    for stage in ["camera", "photons", "gather_clustered", "direct", "update"] {
        assert!(table.contains(stage), "{stage} isn't in the table:\n{table}");
        assert!(
            stages.iter().any(|entry| entry["stage"] == stage),
            "{stage} isn't in the JSON: {profile}"
        );
    }
    let launches: u64 = stages
        .iter()
        .map(|stage| stage["launches"].as_u64().expect("launches"))
        .sum();
    assert_eq!(launches, events as u64, "every launch is an event of the trace");
    assert!(
        table.contains("timestamps of"),
        "the timestamp period is in the table:\n{table}"
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_writes_the_picture_and_exits_with_130() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    let arguments = [
        "--resolution",
        "32x32",
        "--iterations",
        "1000000",
        "--photons",
        "1000",
        "-o",
        "o.exr",
    ];
    let mut child = Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
        .args(["--scene", scene.to_str().expect("UTF-8")])
        .args(arguments)
        .current_dir(folder.path())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("ppm-vk starts");
    // The radius is printed when the iterations begin.
    let mut stderr = std::io::BufReader::new(child.stderr.take().expect("stderr"));
    std::io::BufRead::read_line(&mut stderr, &mut String::new()).expect("a line");
    std::thread::sleep(std::time::Duration::from_millis(500));
    let kill = Command::new("sh")
        .args(["-c", &format!("kill -INT {}", child.id())])
        .status()
        .expect("sh");
    assert!(kill.success());
    let status = child.wait().expect("exit");
    assert_eq!(status.code(), Some(130));
    assert_eq!(files(folder.path()), ["o.exr"]);
    ppm_vk::internals::film::read_exr(&folder.path().join("o.exr")).expect("the picture is whole");
}

#[test]
fn bad_scene_files_give_one_line_and_no_picture() {
    let folder = TempDir::new().expect("folder");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("file");
        path
    };
    let missing = folder.path().join("missing.gltf");
    assert_fails(&folder, &small_render(folder.path(), &missing, &[]), &["missing.gltf"]);
    let truncated = write("truncated.glb", b"glTF\x02\x00\x00\x00\xff\xff\x00\x00");
    assert_fails(
        &folder,
        &small_render(folder.path(), &truncated, &[]),
        &["truncated.glb"],
    );
    let cyclic = write(
        "cyclic.gltf",
        br#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"children":[1]},{"children":[0]}]}"#,
    );
    assert_fails(
        &folder,
        &small_render(folder.path(), &cyclic, &[]),
        &["cyclic.gltf", "node"],
    );
    let extension = write(
        "extension.gltf",
        br#"{"asset":{"version":"2.0"},"extensionsUsed":["XYZ_new"],"extensionsRequired":["XYZ_new"]}"#,
    );
    assert_fails(&folder, &small_render(folder.path(), &extension, &[]), &["XYZ_new"]);
    let empty = write(
        "empty.gltf",
        br#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[]}]}"#,
    );
    assert_fails(&folder, &small_render(folder.path(), &empty, &[]), &["triangle"]);
}

#[test]
fn arguments_out_of_range_are_refused() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    for (flag, value) in [
        ("--resolution", "0x10"),
        ("--resolution", "10"),
        ("--resolution", "100000x10"),
        ("--alpha", "0"),
        ("--alpha", "1"),
        ("--alpha", "nan"),
        ("--radius", "0"),
        ("--radius", "-1"),
        ("--radius", "inf"),
        ("--photons", "0"),
        ("--iterations", "0"),
        ("--max-depth", "0"),
        ("--time", "0"),
        ("--time", "1e300"),
        ("--time", "nan"),
        ("--time", "inf"),
        ("--target-error", "inf"),
        ("--memory-limit", "0"),
        ("--frame-time", "inf"),
        ("--gather", "magic"),
        ("--estimator", "magic"),
        ("--seed", "-1"),
    ] {
        let argument = format!("{flag}={value}");
        assert_refused(
            &ppm_vk(folder.path(), &["--scene", scene.to_str().expect("UTF-8"), &argument]),
            flag,
        );
    }
    assert_refused(&ppm_vk(folder.path(), &["--quiet"]), "--scene");
    assert!(files(folder.path()).is_empty());
}

#[test]
fn refusals_name_the_valid_range_of_a_number() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    let scene = scene.to_str().expect("UTF-8");
    for (arguments, words) in [
        (&["--time=nan"][..], "must be above 0 and finite"),
        (&["--target-error=inf"], "must be above 0 and finite"),
        (&["--time=1e300"], "more than can be counted"),
        (&["--aperture=1e20"], "the maximum radius of a lens is"),
        (&["--aperture=0.1", "--focus=1e-300"], "is too wide for that"),
    ] {
        let output = ppm_vk(folder.path(), &[&["--scene", scene], arguments].concat());
        let text = stderr(&output);
        assert!(
            !output.status.success() && text.contains(words),
            "{arguments:?}: {text}"
        );
        assert!(!text.contains("00000000"), "{arguments:?}: {text}");
    }
    // Beyond the range of the device's numbers, but the meaning is clear.
    let output = small_render(
        folder.path(),
        Path::new(scene),
        &["--aperture", "0.01", "--focus", "1e300"],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn names_do_not_reach_the_terminal_as_commands() {
    let folder = TempDir::new().expect("folder");
    let text = std::fs::read_to_string(scene("cornell.gltf")).expect("scene");
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    json["cameras"][0]["name"] = "red \u{1b}[31m \u{202e}\u{9b}2J\n".into();
    json["materials"][0]["name"] = "\u{1b}]0;title\u{7}".into();
    json["materials"][0]["pbrMetallicRoughness"] = serde_json::json!({"baseColorFactor": [2, 1, 1, 1]});
    let file = if cfg!(unix) {
        "a\u{1b}[31m\n\u{202e}.gltf"
    } else {
        "a\u{202e}.gltf"
    };
    std::fs::write(folder.path().join(file), json.to_string()).expect("scene");
    std::fs::copy(scene("cornell.bin"), folder.path().join("cornell.bin")).expect("buffer");
    let missing = folder.path().join(file).with_extension("glb");
    let missing = missing.to_str().expect("UTF-8");
    for arguments in [
        vec!["inspect", file],
        vec!["inspect", file, "--json"],
        vec!["--scene", file, "--camera", "none"],
        vec!["--scene", missing],
        vec!["--scene", file, "--time", "\u{1b}[31m\u{202e}"],
        vec![
            "--scene",
            file,
            "--resolution",
            "16x16",
            "--iterations",
            "1",
            "--photons",
            "1000",
            "--profile",
        ],
    ] {
        let output = ppm_vk(folder.path(), &arguments);
        let said = [output.stdout, output.stderr]
            .map(|bytes| String::from_utf8(bytes).expect("UTF-8"))
            .concat();
        let command = said
            .chars()
            .find(|&c| c != '\n' && (c.is_control() || ('\u{202a}'..='\u{202e}').contains(&c)));
        assert_eq!(command, None, "{arguments:?}: {}", said.escape_debug());
        assert!(!said.contains("title\n"), "{arguments:?}: {said}");
    }
}

#[test]
fn a_frame_time_asks_for_the_animations() {
    let folder = TempDir::new().expect("folder");
    let text = std::fs::read_to_string(scene("cornell.gltf")).expect("scene");
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let channel = serde_json::json!({"sampler": 7, "target": {"node": 0, "path": "translation"}});
    json["animations"] = serde_json::json!([{"samplers": [], "channels": [channel]}]);
    let copy = folder.path().join("animated.gltf");
    std::fs::write(&copy, json.to_string()).expect("scene");
    std::fs::copy(scene("cornell.bin"), folder.path().join("cornell.bin")).expect("buffer");
    let output = small_render(folder.path(), &copy, &["--frame-time", "-1.5"]);
    assert_fails(&folder, &output, &["animation 0, channel 0", "sampler 7"]);
}

#[test]
fn an_unwritable_output_fails_before_any_work() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    let output = small_render(folder.path(), &scene, &["-o", "no-such-folder/o.exr"]);
    assert_fails(&folder, &output, &["no-such-folder"]);
    let output = small_render(folder.path(), &scene, &["--png", "no-such-folder/o.png"]);
    assert_fails(&folder, &output, &["no-such-folder"]);
}

#[test]
fn outputs_overwrite_neither_each_other_nor_the_scene() {
    let folder = TempDir::new().expect("folder");
    let copy = folder.path().join("a.b.gltf");
    std::fs::copy(scene("cornell.gltf"), &copy).expect("scene");
    std::fs::copy(scene("cornell.bin"), folder.path().join("cornell.bin")).expect("buffer");
    for [trace, profile] in [
        ["a.b.gltf", "p.json"],
        ["cornell.bin", "p.json"],
        ["one", "./one"],
        ["one", "d/../one"],
    ] {
        std::fs::create_dir_all(folder.path().join("d")).expect("a folder");
        let more = ["--trace", trace, "--profile-json", profile];
        let output = small_render(folder.path(), &copy, &more);
        // The name alone shows that some of them contain something else.
        let text = stderr(&output);
        assert!(
            matches!(output.status.code(), Some(1 | 2))
                && (text.contains("overwrite") || text.contains("JSON is written")),
            "{more:?}: {text}"
        );
        assert!(
            !folder.path().join("a.b.exr").exists(),
            "{more:?}: rendered before the check"
        );
    }
    let buffer = std::fs::read(scene("cornell.bin")).expect("buffer");
    assert!(std::fs::read(folder.path().join("cornell.bin")).expect("buffer") == buffer);
    let output = small_render(folder.path(), &copy, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(folder.path().join("a.b.exr").exists(), "{:?}", files(folder.path()));
}

/// A scene whose buffer and texture are named like outputs, so that the names alone do not protect them.
#[test]
fn files_of_the_scene_are_not_overwritten() {
    let folder = TempDir::new().expect("folder");
    let text = std::fs::read_to_string(scene("cornell.gltf")).expect("scene");
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    json["buffers"][0]["uri"] = "geometry".into();
    json["images"] = serde_json::json!([{"uri": "wood.png"}]);
    std::fs::write(folder.path().join("a.gltf"), json.to_string()).expect("scene");
    std::fs::copy(scene("cornell.bin"), folder.path().join("geometry")).expect("buffer");
    std::fs::write(folder.path().join("wood.png"), "a picture that no material uses").expect("image");
    for more in [["--trace", "geometry"], ["--png", "wood.png"]] {
        let output = small_render(folder.path(), &folder.path().join("a.gltf"), &more);
        assert_fails(&folder, &output, &["would overwrite", more[1]]);
    }
}

#[test]
fn names_that_say_another_format_are_refused() {
    let folder = TempDir::new().expect("folder");
    let path = scene("cornell.gltf");
    let path = path.to_str().expect("UTF-8");
    for (flag, name) in [
        ("--output", "x.png"),
        ("--output", "x"),
        ("--png", "x.exr"),
        ("--trace", "x.exr"),
        ("--profile-json", "x.PNG"),
    ] {
        assert_refused(&ppm_vk(folder.path(), &["--scene", path, flag, name]), flag);
    }
    assert!(files(folder.path()).is_empty());
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_not_read() {
    let folder = TempDir::new().expect("folder");
    for name in ["pipe.hdr", "pipe.exr"] {
        let made = Command::new("mkfifo").arg(folder.path().join(name)).status();
        assert!(made.expect("mkfifo").success());
        let output = small_render(
            folder.path(),
            &scene("lights.gltf"),
            &["--environment", name, "-o", "o.exr"],
        );
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.contains(name) && text.contains("it is no regular file"), "{text}");
    }
    let output = ppm_vk(folder.path(), &["compare", "pipe.exr", "/dev/zero"]);
    assert!(
        stderr(&output).contains("pipe.exr: can't be opened: it is no regular file"),
        "{}",
        stderr(&output)
    );
}

#[cfg(unix)]
#[test]
fn an_output_that_cannot_be_written_does_not_stop_the_others() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    let scene = scene.to_str().expect("UTF-8");
    // Limits files to 16 blocks of 512 or 1,024 bytes, depending on the shell.
    let script = format!(
        "ulimit -f 16; exec '{}' --scene '{scene}' --resolution 64x64 --iterations 4 --photons 1000 -o o.exr --png p.png \
         --profile-json p.json --trace t.json",
        env!("CARGO_BIN_EXE_ppm-vk")
    );
    let output = Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder.path())
        .env("XDG_CACHE_HOME", folder.path().join("cache"))
        .output()
        .expect("sh");
    assert_fails(&folder, &output, &["o.exr: can't be written", "File too large"]);
    let left = files(folder.path());
    assert!(left.contains(&"p.json".to_owned()), "{left:?}");
    assert!(
        !left.iter().any(|file| file.starts_with(".ppm-vk")),
        "a temporary file is left: {left:?}"
    );
}

/// A render that would take an hour.
#[cfg(unix)]
fn long_render(folder: &Path, more: &[&str]) -> std::process::Child {
    let scene = scene("cornell.gltf");
    let scene = scene.to_str().expect("UTF-8");
    let mut child = Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
        .args(["--scene", scene, "--resolution", "16x16", "-o", "o.exr"])
        .args(more)
        .current_dir(folder)
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("ppm-vk starts");
    // The radius is printed when the iterations begin.
    let mut stderr = std::io::BufReader::new(child.stderr.take().expect("stderr"));
    std::io::BufRead::read_line(&mut stderr, &mut String::new()).expect("a line");
    // Keeps reading messages while the program runs.
    std::thread::spawn(move || std::io::copy(&mut stderr, &mut std::io::sink()));
    child
}

#[cfg(unix)]
fn send(signal: &str, child: &std::process::Child) {
    let kill = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(kill.expect("kill").success());
}

#[cfg(unix)]
#[test]
fn signals_that_are_sent_twice_at_once_still_leave_the_picture() {
    let folder = TempDir::new().expect("folder");
    for signal in ["-TERM", "-INT", "-HUP"] {
        let mut child = long_render(folder.path(), &["--iterations", "10000000", "--photons", "1000"]);
        send(signal, &child);
        send(signal, &child);
        assert_eq!(child.wait().expect("exit").code(), Some(130), "{signal}");
        assert_eq!(files(folder.path()), ["o.exr"], "{signal}");
        ppm_vk::internals::film::read_exr(&folder.path().join("o.exr")).expect("the picture is whole");
        std::fs::remove_file(folder.path().join("o.exr")).expect("removed");
    }
}

#[cfg(unix)]
#[test]
fn an_iteration_that_is_too_long_is_cut_by_the_time_and_by_ctrl_c() {
    let folder = TempDir::new().expect("folder");
    let endless = ["--photons", "4000000000", "--iterations", "3"];
    for backend in ["vulkan", "cpu"] {
        let start = std::time::Instant::now();
        let timed = [&endless[..], &["--time", "0.5", "--backend", backend]].concat();
        let status = long_render(folder.path(), &timed).wait().expect("exit");
        assert_eq!(status.code(), Some(0), "{backend}");
        let picture = ppm_vk::internals::film::read_exr(&folder.path().join("o.exr")).expect("the picture is whole");
        let mean = ppm_vk::internals::metrics::mean(&picture)[1];
        // Relative to the whole picture, although few pixels are affected.
        assert!(
            (0.2..0.8).contains(&mean),
            "{backend}: the photons aren't divided by those emitted: {mean}"
        );
        let mut child = long_render(folder.path(), &[&endless[..], &["--backend", backend]].concat());
        send("-INT", &child);
        assert_eq!(child.wait().expect("exit").code(), Some(130), "{backend}");
        let took = start.elapsed().as_secs();
        assert!(took < 100, "{backend}: two renders took {took} s: they weren't cut");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn signals_that_were_ignored_at_the_start_stay_ignored() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    let scene = scene.to_str().expect("UTF-8");
    let script = format!(
        "trap '' HUP; '{}' --scene '{scene}' --resolution 16x16 --time 2 --photons 1000 -o o.exr & sleep 1.5; kill -HUP $!; \
         wait $!",
        env!("CARGO_BIN_EXE_ppm-vk")
    );
    let output = Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder.path())
        .output()
        .expect("sh");
    assert_eq!(output.status.code(), Some(0), "SIGHUP ended it: {}", stderr(&output));
}

#[test]
fn extreme_radii_and_alphas_end_with_a_finite_picture() {
    let folder = TempDir::new().expect("folder");
    for more in [
        ["--radius", "1e-9"],
        ["--radius", "1e9"],
        ["--alpha", "1e-9"],
        ["--alpha", "0.999999"],
    ] {
        let mut arguments = vec!["--iterations", "3", "-o", "o.exr", "--scene"];
        let scene = scene("cornell.gltf");
        arguments.extend([
            scene.to_str().expect("UTF-8"),
            "--resolution",
            "16x16",
            "--photons",
            "1000",
        ]);
        arguments.extend(more);
        let output = ppm_vk(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(0), "{more:?}: {}", stderr(&output));
        let image = ppm_vk::internals::film::read_exr(&folder.path().join("o.exr")).expect("picture");
        let defects = ppm_vk::internals::metrics::defects(&image);
        assert_eq!(defects, ppm_vk::internals::metrics::Defects::default(), "{more:?}");
        assert!(!stderr(&output).contains("NaN"), "{more:?}: {}", stderr(&output));
    }
}

#[test]
fn the_processor_renders_without_vulkan() {
    let folder = TempDir::new().expect("folder");
    let output = small_render(
        folder.path(),
        &scene("cornell.gltf"),
        &["--backend", "cpu", "--profile"],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(
        String::from_utf8_lossy(&output.stdout).contains("cpu-kdtree"),
        "the profile names the CPU's gather"
    );
    let conflict = small_render(
        folder.path(),
        &scene("cornell.gltf"),
        &["--backend", "cpu", "--gather", "naive"],
    );
    assert_refused(&conflict, "--backend");
    let implied = small_render(
        folder.path(),
        &scene("cornell.gltf"),
        &["--gather", "cpu-naive", "--profile"],
    );
    assert!(
        String::from_utf8_lossy(&implied.stdout).contains("gather cpu-naive\non CPU"),
        "a method of the CPU brings its backend: {}",
        stderr(&implied)
    );
}

#[test]
fn unknown_cameras_and_devices_are_named_with_the_available_ones() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    assert_fails(
        &folder,
        &small_render(folder.path(), &scene, &["--camera", "nobody"]),
        &["nobody", "camera"],
    );
    assert_fails(
        &folder,
        &small_render(folder.path(), &scene, &["--device", "nothing"]),
        &["nothing", "device"],
    );
}

#[cfg(target_os = "linux")]
#[test]
fn without_vulkan_the_error_names_the_packages_to_install() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    let arguments = ["--scene", scene.to_str().expect("UTF-8"), "--resolution", "16x16"];
    // A file named like the Vulkan loader, but not a library, is found before the real one.
    let libraries = TempDir::new().expect("folder");
    std::fs::write(libraries.path().join("libvulkan.so.1"), b"").expect("file");
    std::fs::write(libraries.path().join("libvulkan.so"), b"").expect("file");
    let mut command = Command::new(env!("CARGO_BIN_EXE_ppm-vk"));
    command.args(arguments).current_dir(folder.path());
    let no_loader = command
        .env("LD_LIBRARY_PATH", libraries.path())
        .output()
        .expect("ppm-vk starts");
    assert_fails(&folder, &no_loader, &["loader", "--backend cpu"]);

    let mut command = Command::new(env!("CARGO_BIN_EXE_ppm-vk"));
    command.args(arguments).current_dir(folder.path());
    let nowhere = libraries.path().join("no-driver.json");
    let no_driver = command
        .env("VK_DRIVER_FILES", &nowhere)
        .env("VK_ICD_FILENAMES", &nowhere)
        .output()
        .expect("ppm-vk starts");
    assert_fails(&folder, &no_driver, &["driver", "--backend cpu"]);
}

#[test]
fn lists_go_to_stdout() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell-spheres.gltf");
    for (arguments, words) in [
        (
            vec!["gathers"],
            vec!["naive", "cluster-grid", "clustered", "cpu-kdtree"],
        ),
        (vec!["devices"], vec!["driver", "storage buffer"]),
        (
            vec!["inspect", scene.to_str().expect("UTF-8")],
            vec!["triangles", "1 mirror", "1 dielectric", "camera 0", "memory", "MiB"],
        ),
        (
            vec!["inspect", scene.to_str().expect("UTF-8"), "--environment", "1,1,1"],
            vec!["environment", "2 emissive"],
        ),
        (vec!["--help"], vec!["--scene", "--profile-json"]),
        (vec!["--version"], vec!["ppm-vk"]),
    ] {
        let output = ppm_vk(folder.path(), &arguments);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        for word in words {
            assert!(text.contains(word), "{arguments:?} doesn't say «{word}»: {text}");
        }
    }
}

/// A file with two scenes, hall and attic, and two variants of an emissive plate, in a folder.
fn write_choices(folder: &Path) -> PathBuf {
    let file = folder.join("choices.gltf");
    let corners: [f32; 9] = [-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0];
    let bytes: String = corners
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .map(|byte| format!("%{byte:02x}"))
        .collect();
    let json = serde_json::json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_variants"],
        "extensions": {"KHR_materials_variants": {"variants": [{"name": "red"}, {"name": "blue"}]}},
        "scene": 0,
        "scenes": [{"name": "hall", "nodes": [0]}, {"name": "attic", "nodes": [1]}],
        "nodes": [{"mesh": 0}, {"mesh": 0, "scale": [2, 2, 2]}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0}, "material": 0,
            "extensions": {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}}
        }]}],
        "materials": [{"emissiveFactor": [1, 0, 0]}, {"emissiveFactor": [0, 0, 1]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": format!("data:,{bytes}"), "byteLength": 36}]
    });
    std::fs::write(&file, json.to_string()).expect("a scene");
    file
}

#[test]
fn a_variant_and_a_scene_are_chosen_by_name() {
    let folder = TempDir::new().expect("folder");
    let scene = write_choices(folder.path());
    let centre = |more: &[&str]| {
        let output = small_render(folder.path(), &scene, &[more, &["-o", "out.exr"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let image = ppm_vk::internals::film::read_exr(&folder.path().join("out.exr")).expect("picture");
        let middle = image.pixels()[image.height() / 2 * image.width() + image.width() / 2];
        (middle, stderr(&output))
    };
    let (red, text) = centre(&[]);
    assert!(red[0] > 0.5 && red[2] == 0.0, "{red:?}");
    let note = text
        .lines()
        .find(|line| line.contains("--scene-name"))
        .unwrap_or_default();
    assert!(
        note.starts_with("note: scene 0 \"hall\" is rendered") && note.contains("1 \"attic\""),
        "{text}"
    );
    let (blue, text) = centre(&["--variant", "blue", "--scene-name", "attic"]);
    assert!(blue[2] > 0.5 && blue[0] == 0.0, "{blue:?}");
    assert!(!text.contains("--scene-name") && !text.contains("variant"), "{text}");
    for (arguments, words) in [
        (["--variant", "green"], ["\"green\"", "\"red\" and \"blue\""]),
        (["--scene-name", "2"], ["no scene \"2\"", "0 \"hall\" and 1 \"attic\""]),
    ] {
        let _ = std::fs::remove_file(folder.path().join("out.exr"));
        let output = small_render(folder.path(), &scene, &arguments);
        assert_eq!(output.status.code(), Some(1));
        let text = stderr(&output);
        assert!(
            text.lines().count() == 1 && words.iter().all(|word| text.contains(word)),
            "{text}"
        );
    }
    let scene = scene.to_str().expect("UTF-8");
    let output = ppm_vk(folder.path(), &["inspect", scene, "--variant", "blue"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    for line in ["variant      red", "variant      blue", "note         scene 0"] {
        assert!(text.contains(line), "{text}");
    }
}

/// A picture of 2 × 1 pixels in the Radiance format: both channels' mantissas and a shared exponent.
fn write_hdr(file: &Path, pixels: [[u8; 4]; 2]) {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
    bytes.extend(pixels.as_flattened());
    std::fs::write(file, bytes).expect("a picture");
}

#[test]
fn an_environment_is_a_radiance_or_a_picture() {
    let folder = TempDir::new().expect("folder");
    let one = [128, 128, 128, 129];
    write_hdr(&folder.path().join("sky.HDR"), [one, one]);
    let mut pictures = Vec::new();
    for (environment, file) in [("1,1,1", "constant.exr"), ("sky.HDR", "picture.exr")] {
        let more = ["--environment", environment, "-o", file];
        let output = small_render(folder.path(), &scene("lights.gltf"), &more);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        pictures.push(ppm_vk::internals::film::read_exr(&folder.path().join(file)).expect("picture"));
    }
    let [constant, picture] = [0, 1].map(|i| ppm_vk::internals::metrics::mean(&pictures[i])[0]);
    assert!(
        (picture / constant - 1.0).abs() < 0.1,
        "{picture} is not about {constant}"
    );
}

#[test]
fn environments_that_cannot_be_read_are_one_line() {
    let folder = TempDir::new().expect("folder");
    let at = |name: &str| folder.path().join(name);
    write_hdr(&at("black.hdr"), [[0; 4]; 2]);
    std::fs::write(at("text.hdr"), "no picture").expect("a file");
    std::fs::write(at("text.jpg"), "no picture").expect("a file");
    for (file, words) in [
        ("none.hdr", &["none.hdr", "can't be opened"][..]),
        ("none.exr", &["none.exr"]),
        ("text.hdr", &["text.hdr", "Radiance HDR"]),
        ("text.jpg", &["text.jpg", ".exr or .hdr"]),
        ("1,1", &["three numbers"]),
        ("black.hdr", &["black.hdr", "black"]),
    ] {
        let output = small_render(folder.path(), &scene("lights.gltf"), &["--environment", file]);
        assert_fails(&folder, &output, words);
    }
    for radiance in ["0,0,0", "1,nan,1", "-1,0,0", "1,1,inf"] {
        let flag = format!("--environment={radiance}");
        let output = small_render(folder.path(), &scene("lights.gltf"), &[&flag]);
        assert_refused(&output, "--environment");
    }
}

#[test]
fn an_environment_takes_no_more_memory_than_the_scene_may() {
    let folder = TempDir::new().expect("folder");
    // A few bytes that claim to be an image of 134 million pixels.
    std::fs::write(
        folder.path().join("sky.hdr"),
        "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 16384\n",
    )
    .expect("a file");
    let output = small_render(folder.path(), &scene("lights.gltf"), &["--environment", "sky.hdr"]);
    assert_fails(&folder, &output, &["sky.hdr", "134217728 pixels", "--memory-limit 3"]);
    let more = ["--environment", "sky.hdr", "--memory-limit", "3"];
    assert_fails(
        &folder,
        &small_render(folder.path(), &scene("lights.gltf"), &more),
        &["sky.hdr", "cut short"],
    );
}

#[test]
fn values_of_an_environment_that_are_no_radiance_are_counted() {
    let folder = TempDir::new().expect("folder");
    let image = ppm_vk::internals::film::Image::new(2, 1, vec![[f32::NAN, 1.0, -1.0], [1.0; 3]]);
    let metadata = ppm_vk::internals::film::Metadata {
        iterations: 1,
        photons_emitted: 0,
        seed: 0,
        device: String::new(),
        seconds: 0.0,
        estimated_error: None,
        denoised_by: None,
    };
    ppm_vk::internals::film::write_exr(
        &image,
        ppm_vk::internals::film::Additions::default(),
        &folder.path().join("sky.exr"),
        &metadata,
    )
    .expect("a picture");
    let output = small_render(folder.path(), &scene("lights.gltf"), &["--environment", "sky.exr"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = stderr(&output);
    assert!(text.contains("warning: 2 values of the environment"), "{text}");
}
