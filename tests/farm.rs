//! The job descriptions in `jobs/`, run by the schedulers that they are for.
#![cfg(unix)]

#[path = "program/animated.rs"]
mod animated;
#[path = "program/mod.rs"]
mod program;

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use program::{ppm_vk, stderr};
use tempfile::TempDir;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const SIZE: [&str; 6] = ["--resolution", "32x24", "--photons", "2000", "--seed", "5"];
/// Enough for a task to be ended before it is done.
const MANY: u32 = 300;

/// A folder with an animated scene, and the program under its name in `bin`, which notes its process's number.
struct Farm {
    folder: TempDir,
}

impl Farm {
    fn new() -> Self {
        let farm = Self {
            folder: TempDir::new().expect("folder"),
        };
        animated::cornell(farm.folder.path());
        fs::create_dir(farm.path("bin")).expect("folder");
        let script = format!(
            "#!/bin/sh\necho $$ >>'{}'\nexec '{}' \"$@\"\n",
            farm.text("processes"),
            env!("CARGO_BIN_EXE_ppm-vk")
        );
        fs::write(farm.path("bin/ppm-vk"), script).expect("script");
        fs::set_permissions(farm.path("bin/ppm-vk"), fs::Permissions::from_mode(0o755)).expect("permissions");
        farm
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// A command that finds the program.
    fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let path = std::env::var("PATH").unwrap_or_default();
        let mut command = Command::new(program);
        command
            .env("PATH", format!("{}:{path}", self.text("bin")))
            .current_dir(self.folder.path());
        command
    }

    /// The picture of two merged parts at a time, without a scheduler.
    fn merged(&self, time: &str, iterations: u32) -> Vec<[f32; 3]> {
        let iterations = iterations.to_string();
        for part in ["1", "2"] {
            let (state, share) = (format!("direct{part}.state"), format!("{part}/2"));
            let own = [
                "--scene",
                "scene.gltf",
                "--frame-time",
                time,
                "--iterations",
                &iterations,
            ];
            let files = ["--part", &share, "--state", &state, "-o", "part.exr"];
            run(self.folder.path(), &[&own[..], &SIZE, &files].concat());
        }
        let merge = ["merge", "direct1.state", "direct2.state", "-o", "direct.exr"];
        run(self.folder.path(), &merge);
        self.pixels("direct.exr")
    }

    fn pixels(&self, name: &str) -> Vec<[f32; 3]> {
        let picture = ppm_vk::internals::film::read_exr(&self.path(name));
        let picture = picture.unwrap_or_else(|error| panic!("{name}: {error}"));
        picture.pixels().to_vec()
    }

    /// Each frame's picture is that of its own time, to the bit.
    fn assert_frames(&self, iterations: u32) {
        for (frame, time) in [("0000", "0"), ("0001", "0.5")] {
            let name = format!("out/picture.{frame}.exr");
            assert!(
                self.pixels(&name) == self.merged(time, iterations),
                "{name} is not what its two parts at {time} s merge to"
            );
        }
        assert!(
            self.pixels("out/picture.0000.exr") != self.pixels("out/picture.0001.exr"),
            "both frames show the same time"
        );
    }

    /// Waits for a file.
    fn await_file(&self, name: &str) {
        let begin = Instant::now();
        while !self.path(name).exists() {
            assert!(begin.elapsed() < Duration::from_secs(300), "no {name} after 300 s");
            sleep(Duration::from_millis(20));
        }
    }
}

fn run(folder: &Path, arguments: &[&str]) {
    let output = ppm_vk(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
}

fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), stderr(output))
}

/// `openjd run jobs/openjd.yaml` with the settings of these tests; `None` where there is no openjd.
fn openjd(farm: &Farm, iterations: u32, more: &[&str]) -> Option<Command> {
    let program = if std::env::var_os("PPM_VK_LONG").is_some() {
        Path::new(ROOT).join("scripts/openjd")
    } else {
        let folders = std::env::var_os("PATH").unwrap_or_default();
        let found = std::env::split_paths(&folders).map(|folder| folder.join("openjd"));
        let found = found.into_iter().find(|program| program.exists());
        if found.is_none() {
            println!(
                "skipped: openjd is missing (pip install openjd-cli, or scripts/test --long, which installs it below target)"
            );
        }
        found?
    };
    let mut command = farm.command(program);
    let template = format!("{ROOT}/jobs/openjd.yaml");
    command.args(["run", &template]).args(more);
    let flags = format!("Flags={} --save-every 0.1", SIZE[4..].join(" "));
    for parameter in [
        &format!("Scene={}", farm.text("scene.gltf")),
        &format!("Folder={}", farm.text("out")),
        "Resolution=32x24",
        "Photons=2000",
        &format!("Iterations={iterations}"),
        &flags,
        "Frames=0-1",
        "FPS=2",
        "Parts=2",
    ] {
        command.args(["-p", parameter]);
    }
    Some(command)
}

#[test]
fn openjd_renders_the_parts_of_frames_and_merges_them() {
    let farm = Farm::new();
    let Some(mut command) = openjd(&farm, 4, &["--step", "Merge", "--run-dependencies"]) else {
        return;
    };
    let output = command.output().expect("openjd runs");
    assert!(output.status.success(), "{}", text(&output));
    farm.assert_frames(4);
}

#[test]
fn a_killed_task_of_openjd_goes_on_from_its_state() {
    let farm = Farm::new();
    let task = ["--step", "Render", "-tp", "Frame=1", "-tp", "Part=2"];
    let Some(mut command) = openjd(&farm, MANY, &task) else {
        return;
    };
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let running = command.spawn().expect("openjd runs");
    farm.await_file("out/picture.0001.part2.state");
    let process = fs::read_to_string(farm.path("processes")).expect("the program's process");
    let killed = Command::new("kill").args(["-KILL", process.trim()]).status();
    assert!(
        killed.expect("kill runs").success(),
        "the task was done before it was killed"
    );
    let output = running.wait_with_output().expect("openjd ends");
    assert!(
        !output.status.success(),
        "openjd takes a killed task for done: {}",
        text(&output)
    );

    let output = openjd(&farm, MANY, &task)
        .expect("openjd")
        .output()
        .expect("openjd runs");
    assert!(output.status.success(), "{}", text(&output));
    assert!(
        text(&output).contains("going on after"),
        "it began anew: {}",
        text(&output)
    );
    farm.merged("0.5", MANY);
    assert!(
        farm.pixels("out/picture.0001.part2.exr") == farm.pixels("part.exr"),
        "the picture is not that of a task that nothing killed"
    );
}

/// Two frames of two parts, on a Slurm of this machine alone; tasks are queued again while they run.
#[test]
#[ignore = "needs Slurm's daemons and some minutes: scripts/test --long"]
fn slurm_renders_the_parts_of_frames_and_merges_them() {
    let farm = Farm::new();
    let script = format!(
        r#"set -euo pipefail
        PARTS=2 FRAMES='0 1' FPS=2 '{ROOT}/jobs/slurm.sh' scene.gltf out/picture {} --iterations {MANY} --save-every 0.1
        until [[ -e out/picture.0000.part1.state ]]; do sleep 0.02; done
        # Of the first job. The second is the signal that comes before a time limit.
        scontrol requeue 1_1
        until [[ -e out/picture.0000.part2.state ]]; do sleep 0.02; done
        scancel --signal=USR1 --batch 1_2
        while [[ $(squeue -h) ]]; do sleep 0.5; done"#,
        SIZE.join(" ")
    );
    let mut command = farm.command(Path::new(ROOT).join("scripts/slurm"));
    let output = command
        .args(["bash", "-c", &script])
        .output()
        .expect("scripts/slurm runs");
    if output.status.code() == Some(77) {
        println!("skipped: {}", text(&output));
        return;
    }
    assert!(output.status.success(), "{}", text(&output));
    let logs = || {
        let files = fs::read_dir(farm.path("out"))
            .expect("folder")
            .map(|entry| entry.expect("entry").path());
        let logs = files.filter(|file| file.extension().is_some_and(|extension| extension == "log"));
        let texts = logs.map(|log| format!("{}:\n{}", log.display(), fs::read_to_string(&log).expect("log")));
        texts.collect::<Vec<_>>().join("\n")
    };
    assert!(
        farm.path("out/picture.0001.exr").exists(),
        "not merged: {}{}",
        text(&output),
        logs()
    );
    for part in ["part1", "part2"] {
        let log = fs::read_to_string(farm.path(&format!("out/picture.0000.{part}.log"))).expect("log");
        assert!(
            log.contains("going on after"),
            "the task was not queued again, or began anew:\n{log}"
        );
    }
    farm.assert_frames(MANY);
}
