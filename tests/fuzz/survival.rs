//! The permitted effects of a damaged file.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

use ppm_vk::internals::error::Result;
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::scene::{Environment, Projection, Scene};

/// Time limit for a small file, with whatever damage, on a busy machine.
const MOST_TIME: Duration = Duration::from_secs(30);

/// The current file, for failures that cannot panic: a hang, and exhausted memory.
static NUMBER: AtomicU64 = AtomicU64::new(0);

/// The result for a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    Loaded,
    Refused,
}

impl Outcome {
    /// Checks that an error is one line.
    pub fn of<T>(result: Result<T>, check: impl FnOnce(T)) -> Self {
        match result {
            Ok(value) => {
                check(value);
                Self::Loaded
            }
            Err(error) => {
                assert_line(&error.to_string());
                Self::Refused
            }
        }
    }
}

/// Aborts the process if a file takes too long: a hang cannot be caught.
pub struct Watch {
    since: Arc<AtomicU64>,
    over: Arc<AtomicBool>,
    start: Instant,
}

impl Watch {
    pub fn start() -> Self {
        let watch = Self {
            since: Arc::new(AtomicU64::new(0)),
            over: Arc::new(AtomicBool::new(false)),
            start: Instant::now(),
        };
        let (since, over, start) = (watch.since.clone(), watch.over.clone(), watch.start);
        thread::spawn(move || {
            while !over.load(Relaxed) {
                thread::sleep(Duration::from_millis(200));
                let time = start
                    .elapsed()
                    .saturating_sub(Duration::from_millis(since.load(Relaxed)));
                if time > MOST_TIME && !over.load(Relaxed) {
                    eprintln!("file {} takes longer than {MOST_TIME:?}", NUMBER.load(Relaxed));
                    std::process::exit(1);
                }
            }
        });
        watch
    }

    /// Reads a file, and names it if reading panics.
    pub fn over(&self, number: u64, name: &str, read: impl FnOnce() -> Outcome) -> Outcome {
        NUMBER.store(number, Relaxed);
        self.since.store(self.start.elapsed().as_millis() as u64, Relaxed);
        catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| panic!("file {number}, made from {name}: see above"))
    }

    /// Peak memory of all files, in bytes.
    pub fn peak(&self) -> usize {
        crate::allocations::peak()
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.over.store(true, Relaxed);
    }
}

/// Names the file that allocates too much. Allocates nothing.
pub fn report_memory(bytes: usize) {
    eprintln!("file {} asks for {bytes} bytes beyond the limit", NUMBER.load(Relaxed));
}

fn assert_line(line: &str) {
    let is_line = !line.contains(['\n', '\r']) && line.chars().count() < 1000;
    assert!(is_line, "not a line: {line:?}");
}

/// Invariants of a loaded scene, however damaged its file.
pub fn assert_sound(scene: Scene) {
    assert!(!scene.triangles.is_empty() && !scene.cameras.is_empty());
    assert_eq!(scene.positions.len(), scene.normals.len());
    assert!(scene.positions.iter().all(|position| position.is_finite()));
    assert!(scene.normals.iter().all(|normal| normal.is_normalized()));
    let vertices = scene.triangles.iter().flat_map(|triangle| triangle.vertices);
    assert!(
        vertices
            .max()
            .is_none_or(|vertex| (vertex as usize) < scene.positions.len())
    );
    for object in &scene.objects {
        assert!(!object.triangles.is_empty() && (object.material as usize) < scene.materials.len());
    }
    for camera in &scene.cameras {
        let size = match camera.projection {
            Projection::Perspective { tan_half_fov } => tan_half_fov,
            Projection::Orthographic { half_height } => half_height,
        };
        assert!(camera.position.is_finite() && size > 0.0 && size.is_finite());
    }
    for light in scene.emissive_triangles() {
        assert!(light.power > 0.0 && light.power.is_finite());
    }
    scene
        .warnings
        .iter()
        .chain(&scene.notes)
        .for_each(|line| assert_line(line));
    PackedScene::new(&scene).expect("a hierarchy");
}

/// Invariants of a loaded environment.
pub fn assert_shines(environment: Environment) {
    let [width, height] = environment.size();
    assert!(width > 0 && height > 0);
}
