//! Kernels fit a GPU, according to a compiler: Mesa's RADV compiles them for a card that need not be present. The limits are those
//! of Debian 12's Mesa; `scripts/driver backports-radv` checks the kernels with ray queries by a newer one.

use std::env;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// RDNA 2, subgroups of 64 invocations.
const CARD: &str = "navi21";
/// RADV for this machine's processor.
const DRIVERS: [&str; 2] = [
    "/usr/share/vulkan/icd.d/radeon_icd.x86_64.json",
    "/usr/share/vulkan/icd.d/radeon_icd.json",
];

/// The newer RADV of `scripts/driver backports-radv`.
fn chosen_driver() -> Option<String> {
    env::var("PPM_VK_NEWER_RADV").ok()
}

/// The compiler's statistics of each kernel; `None`, with a message, without RADV.
fn compiled(features: &str) -> Option<Vec<Value>> {
    let of_system = DRIVERS.into_iter().find(|driver| Path::new(driver).exists());
    let Some(driver) = chosen_driver().or(of_system.map(str::to_owned)) else {
        println!("skipped: no RADV on this machine (Debian: mesa-vulkan-drivers)");
        return None;
    };
    let output = Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
        .args(["bench", "kernels", "--json", "--features", features])
        .env("RADV_FORCE_FAMILY", CARD)
        .env("VK_DRIVER_FILES", &driver)
        .env("VK_ICD_FILENAMES", &driver)
        .output()
        .expect("ppm-vk");
    assert!(
        output.status.success(),
        "{features}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    Some(json["kernels"].as_array().expect("kernels").clone())
}

fn figure(kernel: &Value, name: &str) -> u64 {
    let figures = kernel["statistics"].as_array().expect("statistics");
    let found = figures.iter().find(|figure| figure[0] == name);
    found
        .and_then(|figure| figure[1].as_f64())
        .unwrap_or_else(|| panic!("{name} of {kernel}")) as u64
}

/// Asserts that no kernel spills registers, and that enough subgroups of each fit a SIMD at once to hide the latency of memory.
/// With ray queries, the driver's traversal is a part of the kernel; a driver that the environment chooses checks only those kernels.
fn assert_fit(features: &str, least: u64, least_by_query: u64) {
    let Some(mut kernels) = compiled(features) else { return };
    assert!(kernels.len() > 30, "{features}: {} kernels", kernels.len());
    if chosen_driver().is_some() {
        kernels.retain(|kernel| kernel["ray_query"] == true);
        assert!(
            !kernels.is_empty(),
            "{features}: the driver has no ray queries for {CARD}"
        );
    }
    for kernel in &kernels {
        let mut stage = kernel["stage"].as_str().expect("a stage").to_owned();
        let by_query = kernel["ray_query"] == true;
        if by_query {
            stage += " by ray query";
        }
        let least = if by_query { least_by_query } else { least };
        let spills = figure(kernel, "Spilled VGPRs");
        assert_eq!(spills, 0, "{stage} with {features}: spilled registers");
        let registers = figure(kernel, "VGPRs");
        let subgroups = figure(kernel, "Subgroups per SIMD");
        assert!(
            subgroups >= least,
            "{stage} with {features}: {subgroups} subgroups a SIMD, {registers} registers"
        );
    }
}

#[test]
fn kernels_without_features_have_twelve_subgroups() {
    assert_fit("none", 12, 12);
}

#[test]
fn kernels_of_usual_scenes_have_twelve_subgroups_and_ten_by_ray_query() {
    assert_fit("mirrors,dielectrics,glossy,textured", 12, 10);
}

/// No scene uses all features.
#[test]
fn kernels_with_all_features_have_eight_subgroups() {
    // Debian 12's Mesa takes 144 registers for `camera` with ray queries, Mesa 25 takes 128.
    let by_query = if chosen_driver().is_some() { 8 } else { 6 };
    assert_fit("all", 8, by_query);
}
