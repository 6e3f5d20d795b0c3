//! Progressive photon mapping on Vulkan: a glTF scene in, pictures out.
//!
//! It renders what path tracers can't: light that passes glass, meets a matte surface and passes glass again. A [`Scene`] is
//! read, [prepared](PreparedScene), and rendered by a [`Session`] until a limit is [reached](Until):
//!
//! ```no_run
//! use std::path::Path;
//!
//! use ppm_vk::{LoadOptions, Look, Platform, PreparedScene, RenderConfig, Scene, Session, Until};
//!
//! fn main() -> ppm_vk::Result<()> {
//!     let scene = Scene::load_with(Path::new("room.gltf"), LoadOptions::default())?;
//!     for remark in &scene.warnings {
//!         eprintln!("{remark}");
//!     }
//!     let camera = &scene.cameras[scene.camera_index(Some("by the window"))?];
//!     let config = RenderConfig {
//!         resolution: [640, 480],
//!         photons: 500_000,
//!         ..RenderConfig::default()
//!     };
//!     let prepared = PreparedScene::new(&scene)?;
//!     let mut session = Session::new(&prepared, camera, &config, &Platform::default())?;
//!
//!     // Until its error is 2 % by its own estimate; then it may go on.
//!     let rendered = session.render(Until::error(0.02))?;
//!     rendered.write_exr(Path::new("room.exr"))?;
//!     let better = session.render(Until::iterations(2 * rendered.iterations()))?;
//!     better.write_png(Path::new("room.png"), Look::default())?;
//!     if let Some(error) = better.error() {
//!         println!("{error}");
//!     }
//!     Ok(())
//! }
//! ```
//!
//! A program that shows how far a render is, or stops it, gives [`Hooks`] to [`Session::render_with`].
//!
//! # Messages
//!
//! An [`Error`], a [`Warning`] and a [`Remark`] is one line that names no program's flags. Their kinds tell a program what to
//! add: the [`Setting`] that is wrong, the [`Remedy`] that helps, the [`LoadChoice`] that decides otherwise.
//!
//! # Features
//!
//! `program`, on by default, is what the program `ppm-vk` needs besides: without it (`default-features = false`) no crate for
//! command lines, progress bars, signals or plots is built. Building compiles the kernels by the shaderc library.
//!
//! ARCHITECTURE.md in the repository walks through the code.

mod alias;
mod backend;
mod config;
mod cpu;
mod denoise;
mod emission;
mod error;
mod estimate;
mod files;
mod film;
mod gather;
mod gpu;
#[doc(hidden)]
pub mod internals;
mod kd_tree;
mod layout;
mod loader;
mod metrics;
mod packing;
mod pipeline;
mod radius;
mod random;
mod record;
mod report;
mod scene;
mod session;
mod shaders;
mod sizes;
mod stage;
mod state;
mod text;

pub use backend::{Counters, DeviceDescription, Phase};
pub use config::{
    Accel, Choice, Direct, EmissionChoice, Estimator, Layer, Layers, Part, PixelFilter, Region, RenderConfig, Sampler,
    TriangleTest,
};
pub use denoise::{Denoiser, Guides};
pub use error::{Error, Remedy, Result, Setting};
pub use estimate::RelativeError;
pub use film::{Exposure, Image, Look, Tone, read_exr};
pub use gpu::{DeviceSummary, best_device, devices};
pub use loader::{LightUnits, LoadOptions, SceneFile};
pub use metrics::{Comparison, compare, flip};
pub use pipeline::Memory;
pub use record::Run;
pub use report::{Profile, StageTimes, Subject};
pub use scene::{Camera, Environment, Lens, LoadChoice, Normalisation, Remark, Scene};
pub use session::{
    Failure, Flicker, Hooks, Merge, Mosaic, Motion, Platform, PreparedScene, Progress, Rendered, Session, Snapshot,
    Snapshots, State, Until, Wanted, Warning, crops,
};
