//! Finding the files, and rendering them.

use std::fs;
use std::path::{Path, PathBuf};

use ppm_vk::internals::film::{Image, read_exr};
use ppm_vk::internals::metrics::{Defects, defects};
use tempfile::TempDir;

use super::program::{ppm_vk, stderr};

/// The folder of the case with this number, if it exists.
pub fn folder(number: &str) -> Option<PathBuf> {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases");
    let Ok(folders) = fs::read_dir(cases) else {
        println!("skipped: missing: ../shared/cases");
        return None;
    };
    let folders = folders.map(|folder| folder.expect("a folder").path());
    let found = folders
        .into_iter()
        .find(|folder| name(folder).starts_with(number))
        .unwrap_or_else(|| panic!("no case {number}"));
    Some(found)
}

/// The glTF files in a folder, sorted; their number is known.
pub fn scenes(folder: &Path, count: usize) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let mut scenes: Vec<PathBuf> = paths
        .filter(|path| path.extension().is_some_and(|end| end == "gltf" || end == "glb"))
        .collect();
    scenes.sort();
    assert_eq!(
        scenes.len(),
        count,
        "{}: the files differ from the known ones",
        folder.display()
    );
    scenes
}

/// A file's name.
pub fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A picture, and the messages.
pub struct Seen {
    pub image: Image,
    pub said: String,
    name: String,
}

/// Renders a scene. The picture has no NaN, infinity or negative value.
pub fn render(scene: &Path, side: u32, iterations: u32, photons: u32, more: &[&str]) -> Seen {
    let folder = TempDir::new().expect("a folder");
    let [size, iterations, photons] = [format!("{side}x{side}"), iterations.to_string(), photons.to_string()];
    let mut arguments = vec!["--scene", scene.to_str().expect("UTF-8"), "-o", "out.exr", "--quiet"];
    arguments.extend([
        "--resolution",
        &size,
        "--iterations",
        &iterations,
        "--photons",
        &photons,
    ]);
    arguments.extend(more);
    let output = ppm_vk(folder.path(), &arguments);
    let name = name(scene);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{name}: {said}");
    assert!(!said.contains("panicked"), "{name}: {said}");
    let image = read_exr(&folder.path().join("out.exr")).expect(&name);
    assert_eq!(defects(&image), Defects::default(), "{name}: {said}");
    Seen { image, said, name }
}

/// The scene is refused: exit code 1, one line that begins with its name and contains these words, and no output file.
pub fn assert_refused(scene: &Path, words: &str, more: &[&str]) {
    let folder = TempDir::new().expect("a folder");
    let arguments = ["--scene", scene.to_str().expect("UTF-8"), "-o", "out.exr", "--quiet"];
    let output = ppm_vk(folder.path(), &[&arguments, more].concat());
    let (name, said) = (name(scene), stderr(&output));
    assert_eq!(output.status.code(), Some(1), "{name}: {said}");
    let mut lines = said.lines();
    let line = lines.next().unwrap_or_default();
    assert!(
        line.starts_with("error: ") && line.contains(&name) && line.contains(words) && lines.next().is_none(),
        "{name}: one line with «{words}» expected: {said}"
    );
    let left: Vec<_> = fs::read_dir(folder.path()).expect("the folder").collect();
    assert!(left.is_empty(), "{name}: left behind: {left:?}");
}

impl Seen {
    /// A picture of another renderer.
    pub fn of(image: Image, name: &str) -> Self {
        Self {
            image,
            said: String::new(),
            name: name.to_owned(),
        }
    }

    /// The lines that begin with «warning: ».
    pub fn warnings(&self) -> Vec<&str> {
        self.said.lines().filter(|line| line.starts_with("warning: ")).collect()
    }

    /// Mean over the pixels for which a function of (x, y), from −1 to 1 across the picture, is true.
    pub fn mean(&self, is_asked: impl Fn(f64, f64) -> bool) -> [f64; 3] {
        let (width, height) = (self.image.width(), self.image.height());
        let place = |index: usize, count: usize| (2.0 * index as f64 + 1.0) / count as f64 - 1.0;
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for (index, pixel) in self.image.pixels().iter().enumerate() {
            if is_asked(place(index % width, width), place(index / width, height)) {
                count += 1.0;
                for (sum, value) in sum.iter_mut().zip(pixel) {
                    *sum += f64::from(*value);
                }
            }
        }
        sum.map(|sum| sum / count)
    }

    /// All three channels of such a mean have the expected value.
    #[track_caller]
    pub fn assert_mean(&self, expected: f64, tolerance: f64, place: &str, is_asked: impl Fn(f64, f64) -> bool) {
        let mean = self.mean(is_asked);
        assert!(
            mean.iter().all(|value| (value - expected).abs() <= tolerance),
            "{}, {place}: {mean:?} instead of {expected} ± {tolerance}; {}",
            self.name,
            self.said
        );
    }
}
