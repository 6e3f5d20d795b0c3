//! `--progress json`.

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use serde_json::Value;

use super::{run, small, stderr};

fn events(stdout: &[u8]) -> Vec<Value> {
    let text = std::str::from_utf8(stdout).expect("UTF-8");
    let parse = |line: &str| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"));
    text.lines().map(parse).collect()
}

fn of<'a>(events: &'a [Value], kind: &str) -> Vec<&'a Value> {
    events.iter().filter(|event| event["event"] == kind).collect()
}

#[test]
fn every_event_is_a_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let arguments = ["--progress", "json", "--iterations", "8", "--png", "o.png", "--profile"];
    let output = run(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let events = events(&output.stdout);
    let phases: Vec<_> = of(&events, "phase")
        .iter()
        .map(|event| event["phase"].clone())
        .collect();
    assert_eq!(phases, ["load", "build", "compile", "pilot", "iterate", "write"]);
    let iterations = of(&events, "iteration");
    for (done, event) in (1..).zip(&iterations) {
        assert_eq!(event["iteration"], done, "{event}");
        assert_eq!(event["iterations"], 8, "{event}");
        let number = |key: &str| event[key].as_f64().unwrap_or_else(|| panic!("{key}: {event}"));
        assert!((number("share") - f64::from(done) / 8.0).abs() < 1e-12, "{event}");
        assert_eq!(number("photons_emitted"), 2000.0 * f64::from(done), "{event}");
        let rate = number("photons_emitted") / number("rendering_seconds");
        assert!((number("photons_per_second") / rate - 1.0).abs() < 1e-9, "{event}");
        assert!(number("seconds_left") >= 0.0, "{event}");
    }
    assert_eq!(iterations.len(), 8);
    assert!(
        iterations[0]["estimated_error"].is_null(),
        "unknown yet: {}",
        iterations[0]
    );
    assert!(
        iterations[7]["estimated_error"]
            .as_f64()
            .is_some_and(|error| error > 0.0)
    );
    let paths: Vec<_> = of(&events, "written")
        .iter()
        .map(|event| event["path"].clone())
        .collect();
    assert_eq!(paths, ["o.exr", "o.png"]);
    let seconds: Vec<f64> = events.iter().filter_map(|event| event["seconds"].as_f64()).collect();
    assert!(seconds.len() == events.len() && seconds.is_sorted(), "{seconds:?}");
    assert_eq!(events.last().expect("an event")["event"], "done");
    assert!(
        stderr(&output).contains("timestamps of"),
        "the profile is on stderr: {}",
        stderr(&output)
    );
}

#[test]
fn a_profile_that_goes_to_a_file_goes_there_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let arguments = [
        "--progress",
        "json",
        "--iterations",
        "1",
        "--profile",
        "--profile-json",
        "p.json",
    ];
    let output = run(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(folder.path().join("p.json").exists());
    assert!(!stderr(&output).contains("timestamps of"), "{}", stderr(&output));
    let paths = of(&events(&output.stdout), "written").len();
    assert_eq!(paths, 2, "the picture and the profile");
}

#[test]
fn pictures_that_are_saved_on_the_way_are_events() {
    let folder = tempfile::tempdir().expect("a folder");
    let arguments = ["--progress", "json", "--time", "2", "--save-every", "0.3"];
    let output = run(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let events = events(&output.stdout);
    let written: Vec<_> = of(&events, "written")
        .iter()
        .filter_map(|event| event["iteration"].as_u64())
        .collect();
    assert!(written.len() >= 3 && written.is_sorted(), "{written:?}");
}

#[test]
fn warnings_and_failures_are_events() {
    let folder = tempfile::tempdir().expect("a folder");
    let missing = ["--progress", "json", "--camera", "none of this name"];
    let output = run(folder.path(), &missing);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let found = events(&output.stdout);
    let last = found.last().expect("an event");
    assert_eq!(last["event"], "error");
    let text = last["text"].as_str().expect("a text");
    assert!(stderr(&output).contains(text), "{text}: {}", stderr(&output));

    let arguments = [
        "--progress",
        "json",
        "--iterations",
        "1",
        "--max-depth",
        "1",
        "--estimator",
        "ppm",
        "--light-radius",
        "0.1",
    ];
    let output = run(folder.path(), &arguments);
    let found = events(&output.stdout);
    for event in of(&found, "warning") {
        let text = event["text"].as_str().expect("a text");
        assert!(stderr(&output).contains(&format!("warning: {text}")), "{text}");
    }
    let count = stderr(&output)
        .lines()
        .filter(|line| line.starts_with("warning: "))
        .count();
    assert_eq!(of(&found, "warning").len(), count, "{}", stderr(&output));
    assert!(count > 0, "this render has warnings: {}", stderr(&output));
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut child = small(folder.path(), &["--progress", "json", "--iterations", "4"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("ppm-vk runs");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("stdout"))
        .read_line(&mut line)
        .expect("a line");
    assert!(line.contains("load"), "a line is there as soon as its event: {line}");
    assert_eq!(child.wait().expect("an end").code(), Some(0));
    assert!(folder.path().join("o.exr").exists());
}
