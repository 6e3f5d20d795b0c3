//! Kernels fit a GPU, as far as a compiler can tell: Mesa's RADV compiles them for a card that isn't there.

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

/// What the compiler says of each kernel; `None`, with a line that says so, where RADV isn't there.
fn compiled(features: &str) -> Option<Vec<Value>> {
    let Some(driver) = DRIVERS.into_iter().find(|driver| Path::new(driver).exists()) else {
        println!("skipped: no RADV on this machine (Debian: mesa-vulkan-drivers)");
        return None;
    };
    let output = Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
        .args(["bench", "kernels", "--json", "--features", features])
        .env("RADV_FORCE_FAMILY", CARD)
        .env("VK_DRIVER_FILES", driver)
        .env("VK_ICD_FILENAMES", driver)
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

/// Asserts that no kernel spills more registers than it may, and that enough subgroups of each fit a SIMD at once: memory's latency
/// is hidden by as many.
fn assert_fit(features: &str, most_spills: &[(&str, u64)], least_subgroups: &[(&str, u64)], of_others: u64) {
    let Some(kernels) = compiled(features) else { return };
    assert!(kernels.len() > 30, "{features}: {} kernels", kernels.len());
    for kernel in &kernels {
        let stage = kernel["stage"].as_str().expect("a stage");
        let of = |list: &[(&str, u64)], others: u64| {
            let found = list.iter().find(|(name, _)| *name == stage);
            found.map_or(others, |(_, figure)| *figure)
        };
        let registers = figure(kernel, "VGPRs");
        let spills = figure(kernel, "Spilled VGPRs");
        assert!(
            spills <= of(most_spills, 0),
            "{stage} with {features}: {spills} spilled registers"
        );
        let subgroups = figure(kernel, "Subgroups per SIMD");
        assert!(
            subgroups >= of(least_subgroups, of_others),
            "{stage} with {features}: {subgroups} subgroups a SIMD, {registers} registers"
        );
    }
}

#[test]
fn kernels_that_know_no_feature_fit_ten_times_and_nearly_all_twelve_times() {
    assert_fit("none", &[], &[("photons", 10), ("sort_scatter", 10)], 12);
}

#[test]
fn kernels_of_usual_scenes_fit_eight_times_and_most_of_an_iterations_twelve_times() {
    let eight = [("camera", 8), ("photons", 8), ("sort_scatter", 10)];
    assert_fit("mirrors,dielectrics,glossy,textured", &[], &eight, 12);
}

/// No scene has everything. The figures are what has been reached, so that they don't get worse unseen.
#[test]
fn kernels_that_know_everything_spill_no_more_than_they_did() {
    let spills = [("camera", 860), ("photons", 20)];
    let few = [("camera", 4), ("photons", 4), ("direct", 4)];
    assert_fit("all", &spills, &few, 8);
}
