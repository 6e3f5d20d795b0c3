//! The kernels compared with the CPU's functions (`src/cpu`), on the machine's best Vulkan device. In debug builds, a message of
//! the validation layer also fails a test.

#[path = "kernels/agreement.rs"]
mod agreement;
#[path = "kernels/bench.rs"]
mod bench;
#[path = "kernels/coverage.rs"]
mod coverage;
#[path = "kernels/emission.rs"]
mod emission;
#[path = "kernels/gather.rs"]
mod gather;
#[path = "kernels/instances.rs"]
mod instances;
#[path = "kernels/limits.rs"]
mod limits;
#[path = "kernels/oracle.rs"]
mod oracle;
#[path = "kernels/orders.rs"]
mod orders;
#[path = "kernels/photons.rs"]
mod photons;
#[path = "kernels/pictures.rs"]
mod pictures;
#[path = "kernels/primitives.rs"]
mod primitives;
#[path = "kernels/probes.rs"]
mod probes;
#[path = "kernels/rays.rs"]
mod rays;
#[path = "kernels/statistics.rs"]
mod statistics;
#[path = "kernels/visible_points.rs"]
mod visible_points;
