//! Statistics of compiled kernels by the driver: registers, spills, subgroups. No kernel runs.

use std::fmt::Write as _;

use serde::Serialize;

use ppm_vk::internals::error::Result;
use ppm_vk::internals::gpu::Compiler;
use ppm_vk::internals::packing::SceneFeatures;
use ppm_vk::internals::shaders;
use ppm_vk::internals::sizes::clustered_run;
use ppm_vk::internals::stage::{RAY_QUERY, Shader, StageDesc};

/// Kernels compiled for one set of features.
#[derive(Debug, Clone, Serialize)]
pub struct CompiledKernels {
    /// Name and driver of the device.
    pub device: String,
    /// Features that are compiled in; empty: none.
    pub features: Vec<String>,
    /// In the order of their names.
    pub kernels: Vec<CompiledKernel>,
}

/// A kernel, and its statistics.
#[derive(Debug, Clone, Serialize)]
pub struct CompiledKernel {
    /// Its stage.
    pub stage: &'static str,
    /// Whether it uses ray queries: stages that trace rays are compiled both ways if the device has them.
    pub ray_query: bool,
    /// The driver's figures by its names, in its order.
    pub statistics: Vec<(String, f64)>,
}

impl CompiledKernel {
    /// A figure by the driver's name.
    pub fn get(&self, name: &str) -> Option<f64> {
        let found = self.statistics.iter().find(|(other, _)| other == name);
        found.map(|(_, value)| *value)
    }
}

/// Compiles every kernel for a scene with these features, with aimed photon paths and the estimator `sppm`.
///
/// # Errors
/// No such device, or a driver that reports no statistics.
pub fn compiled_kernels(device: Option<&str>, features: SceneFeatures) -> Result<CompiledKernels> {
    let mut compiler = Compiler::open(device)?;
    let run = clustered_run(compiler.summary().kind);
    let mut constants = vec![("AIMED", 1), ("BEHIND_GLASS", 0), ("RUN", run)];
    constants.extend(features.constants().map(|(name, present)| (name, u32::from(present))));
    let by_query = compiler.summary().ray_query;
    let mut compile = |shader: &'static Shader, ray_query: bool| {
        let stage = StageDesc::new(shader, 1)
            .constants(constants.clone())
            .constant(RAY_QUERY, u32::from(ray_query));
        Ok(CompiledKernel {
            stage: shader.name,
            ray_query,
            statistics: compiler.statistics(&stage)?,
        })
    };
    let mut kernels = Vec::new();
    for shader in shaders::ALL {
        kernels.push(compile(shader, false)?);
        if by_query && shader.ray_query.is_some() {
            kernels.push(compile(shader, true)?);
        }
    }
    let summary = compiler.summary();
    Ok(CompiledKernels {
        device: format!("{} ({})", summary.name, summary.driver),
        features: features.names(),
        kernels,
    })
}

/// The figures as a table, with a column for each figure that differs among the kernels, except hashes.
pub fn kernels_table(compiled: &CompiledKernels) -> String {
    let features = if compiled.features.is_empty() {
        "none".to_owned()
    } else {
        compiled.features.join(", ")
    };
    let mut text = format!(
        "on {}\nfeatures compiled in: {features}\n\n{:<22}",
        compiled.device, "kernel"
    );
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in compiled.kernels.iter().flat_map(|kernel| &kernel.statistics) {
        let values = || compiled.kernels.iter().map(|kernel| kernel.get(name));
        let is_hash = name.to_lowercase().contains("hash");
        if !is_hash && !names.contains(&name.as_str()) && values().any(|value| Some(value) != values().next()) {
            names.push(name);
        }
    }
    for name in &names {
        // Writing to a String can't fail.
        let _ = write!(text, " {name:>width$}", width = name.len().max(8));
    }
    text.push('\n');
    for kernel in &compiled.kernels {
        let name = if kernel.ray_query {
            format!("{}, ray query", kernel.stage)
        } else {
            kernel.stage.to_owned()
        };
        let _ = write!(text, "{name:<22}");
        for name in &names {
            let value = kernel.get(name).map_or("-".to_owned(), |value| format!("{value}"));
            let _ = write!(text, " {value:>width$}", width = name.len().max(8));
        }
        text.push('\n');
    }
    text
}
