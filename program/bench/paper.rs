//! The paper's figures, in milliseconds: GeForce GT 750M (nVidia Nsight's timeline) and i7-4702MQ.

/// The paper's resolutions.
pub const RESOLUTIONS: [[u32; 2]; 2] = [[320, 280], [1920, 1080]];

/// Steps of tables 1 and 2: GPU at both resolutions, CPU at both.
pub const STEPS: [(&str, [f64; 2], [f64; 2]); 4] = [
    ("Raytracing", [0.706, 12.107], [1172.0, 6197.0]),
    ("Photon tracing", [7.897, 7.897], [317.0, 317.0]),
    ("Hitpoint Illumination", [2041.0, 38_603.0], [1593.0, 23_957.0]),
    ("Synthesize", [0.247, 4.924], [3.0, 91.0]),
];

/// Section 6: brute force on the CPU at 320×280.
pub const CPU_NAIVE: f64 = 68_000.0;

/// A row of tables 3 and 4: our method's name, the paper's row, the gather at both resolutions.
pub type Row = (&'static str, &'static str, [f64; 2]);

/// Table 3, and its last row's times after distance() was replaced by hand (section 8).
pub const TABLE_3: [Row; 6] = [
    ("naive", "Naive solution", [2041.0, 38_603.0]),
    ("local", "Local memory", [1109.0, 17_750.0]),
    ("photon-sort", "Photon sorting", [611.0, 10_539.0]),
    ("hitpoint-sort", "Hitpoint sorting", [484.0, 8384.0]),
    (
        "hitpoint-sort-local-distance",
        "Hitpoint sorting, local memory",
        [327.0, 5422.0],
    ),
    (
        "hitpoint-sort-local",
        "the same, manual distance (section 8)",
        [125.0, 1941.0],
    ),
];

/// Table 4.
pub const TABLE_4: [Row; 2] = [
    ("cluster", "Hitpoint sorting, local memory (clustered)", [172.0, 2852.0]),
    ("cluster-grid", "Grid structure", [87.0, 730.0]),
];

/// Column of a resolution in the arrays above.
pub fn column(resolution: [u32; 2]) -> Option<usize> {
    RESOLUTIONS.iter().position(|paper| *paper == resolution)
}
