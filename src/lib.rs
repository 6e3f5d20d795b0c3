//! Progressive photon mapping on Vulkan: a glTF scene in, an OpenEXR picture out.
//!
//! # The life of a pass
//!
//! [`scene::Scene::load`] reads a file, [`packing::PackedScene`] lays it out for the device. [`pipeline::Renderer`] uploads
//! it and then repeats iterations, whose stages [`pipeline::Stages::iteration`] lists: `camera` finds visible points,
//! `emission` starts photon paths, `photons` traces them, a method of [`gather::METHODS`] finds each visible point's
//! photons, `direct` samples the lights, `update` shrinks the radii (the paper's equations 2 and 3). `resolve` makes the
//! picture (equation 4), and [`film`] writes it.
//!
//! [`record::Recording`] turns stages into commands with barriers; [`gpu`] alone knows Vulkan. [`cpu`] is a plain renderer in
//! f64, made of the functions that kernels are tested against. ARCHITECTURE.md walks through the rest.

#![warn(missing_docs)]

pub mod alias;
pub mod backend;
#[path = "../program/bench/mod.rs"]
pub mod bench;
#[path = "../program/cli/mod.rs"]
pub mod cli;
pub mod config;
pub mod cpu;
pub mod emission;
pub mod error;
pub mod estimate;
pub mod files;
pub mod film;
pub mod gather;
pub mod gpu;
pub mod layout;
pub mod loader;
pub mod metrics;
pub mod packing;
pub mod pipeline;
pub mod radius;
pub mod random;
pub mod record;
pub mod report;
pub mod scene;
pub mod shaders;
pub mod sizes;
pub mod stage;
pub mod text;
