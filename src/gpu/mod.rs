//! The Vulkan host: the only place that uses ash, and the only one with `unsafe`.
//!
//! [`Device`] owns the device's buffers by [`crate::stage::BufferId`] and runs [`crate::record::Recording`]s on them.

mod buffer;
mod context;
mod descriptors;
mod device;
mod execute;
mod instance;
mod pipeline;
mod pipeline_cache;
mod ray_tracing;
mod self_check;
mod statistics;
mod structures;
mod submission;

pub(crate) use device::remedy;
pub use device::{Device, best_device, devices};
pub use execute::{Done, Ticket};
pub use instance::DeviceSummary;
pub use ray_tracing::StructureBytes;
pub(crate) use ray_tracing::{no_ray_query, structure_bytes};
pub use statistics::Compiler;
