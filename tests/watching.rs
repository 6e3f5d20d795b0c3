//! Renders seen while they go on: events for scripts, a viewer, a page for browsers.

#[path = "watching/browser.rs"]
mod browser;
#[path = "watching/events.rs"]
mod events;
#[path = "watching/page.rs"]
mod page;
#[path = "watching/viewer.rs"]
mod viewer;

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// The program, which renders a small picture of a scene in a folder, to `o.exr`: of 32x24 pixels, unless the
/// arguments say otherwise.
fn small(folder: &Path, arguments: &[&str]) -> Command {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.gltf");
    let mut command = Command::new(env!("CARGO_BIN_EXE_ppm-vk"));
    command
        .current_dir(folder)
        .arg("--scene")
        .arg(scene)
        .args(["-o", "o.exr", "--photons", "2000"])
        .args(arguments);
    if !arguments.contains(&"--resolution") {
        command.args(["--resolution", "32x24"]);
    }
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    small(folder, arguments).output().expect("ppm-vk runs")
}

/// A program that runs. It is killed with its guard, so that a failed test leaves none behind.
struct Running {
    child: Child,
    /// Its lines on stderr.
    lines: Receiver<String>,
}

impl Running {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut child = small(folder, arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("ppm-vk runs");
        let (send, lines) = channel();
        let stderr = BufReader::new(child.stderr.take().expect("stderr"));
        std::thread::spawn(move || {
            for line in stderr.lines().map_while(Result::ok) {
                let _ = send.send(line);
            }
        });
        Self { child, lines }
    }

    /// The next line that contains this.
    fn line(&self, text: &str) -> String {
        loop {
            let line = self.lines.recv_timeout(Duration::from_secs(60));
            let line = line.unwrap_or_else(|_| panic!("no line contains «{text}»"));
            if line.contains(text) {
                return line;
            }
        }
    }

    /// Waits for its end.
    fn code(&mut self) -> Option<i32> {
        self.child.wait().expect("an end").code()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The pixels of the picture that the program wrote.
fn written(folder: &Path) -> ppm_vk::Image {
    ppm_vk::read_exr(&folder.join("o.exr")).expect("a picture")
}

#[test]
fn wrong_arguments_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for arguments in [
        ["--view", "localhost"],
        ["--view", "localhost:0x1"],
        ["--serve", "65536"],
        ["--serve", "localhost"],
        ["--serve", ":80"],
        ["--progress", "xml"],
    ] {
        let output = run(folder.path(), &arguments);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(arguments[0]), "{arguments:?}: {text}");
    }
}
