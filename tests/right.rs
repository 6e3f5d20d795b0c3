//! Answers known independently of this program: closed forms, conservation, theory, and pictures of other renderers.
//!
//! A tolerance has two parts. The statistical part is a number of standard errors, measured in the test from independent samples,
//! so that a correct program fails a comparison with a probability of 1e-8 or less. The other part bounds the known bias of the
//! photon radius, from the geometry; each test says how. Seeds are fixed.

#[path = "right/aimed.rs"]
mod aimed;
#[path = "right/anisotropy.rs"]
mod anisotropy;
#[path = "right/camera.rs"]
mod camera;
#[path = "right/coat.rs"]
mod coat;
#[path = "right/convergence.rs"]
mod convergence;
#[path = "../examples/make_scenes/scenes/document.rs"]
#[expect(dead_code, reason = "the generator of scenes/ needs more of it")]
mod document;
#[path = "right/energy.rs"]
mod energy;
#[path = "right/estimate.rs"]
mod estimate;
#[path = "right/furnace.rs"]
mod furnace;
#[path = "right/glass.rs"]
mod glass;
#[path = "right/gloss.rs"]
mod gloss;
#[path = "right/lamp.rs"]
mod lamp;
#[path = "right/leaning.rs"]
mod leaning;
#[path = "right/lights.rs"]
mod lights;
#[path = "right/measure.rs"]
mod measure;
#[path = "../examples/make_scenes/scenes/mesh.rs"]
#[expect(dead_code, reason = "the generator of scenes/ needs more of it")]
mod mesh;
#[path = "picture/mod.rs"]
mod picture;
#[path = "right/prism.rs"]
mod prism;
#[path = "right/references.rs"]
mod references;
#[path = "right/sheen.rs"]
mod sheen;
#[path = "right/soft.rs"]
mod soft;
#[path = "right/stage.rs"]
mod stage;
#[path = "right/texture.rs"]
mod texture;
#[path = "right/transmission.rs"]
mod transmission;
