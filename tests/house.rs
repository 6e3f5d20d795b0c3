//! Structure rules: which module may import which, and where Vulkan and `unsafe` are allowed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use ppm_vk::internals::packing::SceneFeatures;

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("folder") {
        let path = entry.expect("entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Every source file of the library, by its path under src, and its code without comments.
fn code() -> Vec<(String, String)> {
    let code = code_of("src");
    assert!(code.len() > 20, "only {} source files found", code.len());
    code
}

/// The same of a folder.
fn code_of(folder: &str) -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut found = Vec::new();
    sources(&root, &mut found);
    found
        .iter()
        .map(|path| {
            let text = fs::read_to_string(path).expect("source");
            let lines: Vec<&str> = text
                .lines()
                .filter(|line| !line.trim_start().starts_with("//"))
                .collect();
            (
                path.strip_prefix(&root).expect("under src").display().to_string(),
                lines.join("\n"),
            )
        })
        .collect()
}

#[test]
fn vulkan_lives_in_gpu_alone_and_unsafe_there_and_in_the_denoisers_api() {
    for (file, text) in code().into_iter().filter(|(file, _)| !file.starts_with("gpu")) {
        let is_denoiser = file == "denoise/oidn.rs";
        let words = ["ash::", "use ash", "gpu_allocator", "unsafe ", "libloading"];
        let forbidden = &words[..if is_denoiser { 3 } else { 5 }];
        for word in forbidden {
            assert!(!text.contains(word), "src/{file} has «{word}»");
        }
    }
}

#[test]
fn imports_go_downward() {
    const SCENES: &[&str] = &["scene", "loader", "packing"];
    const RENDERERS: &[&str] = &["gpu", "pipeline", "session", "cpu"];
    // The modules that a layer must not import.
    let forbidden: &[(&str, &[&[&str]])] = &[
        ("layout", &[&[""]]),
        ("alias.rs", &[&[""]]),
        ("state", &[SCENES, RENDERERS, &["record", "config", "layout"]]),
        ("stage.rs", &[SCENES, RENDERERS, &["record"]]),
        ("record.rs", &[SCENES, RENDERERS]),
        ("gather", &[SCENES, RENDERERS]),
        ("gpu", &[SCENES, &["pipeline", "session", "cpu", "gather"]]),
        ("random", &[SCENES, RENDERERS, &["emission", "record"]]),
        ("emission", &[RENDERERS, &["record"]]),
        ("cpu", &[&["gpu", "pipeline", "session"]]),
        ("scene", &[RENDERERS, &["loader", "packing", "record"]]),
        ("denoise", &[SCENES, RENDERERS, &["record", "config", "estimate"]]),
        ("loader", &[RENDERERS, &["packing", "record"]]),
        ("packing", &[RENDERERS, &["loader", "record"]]),
        ("pipeline", &[&["session", "cpu"]]),
    ];
    for (file, text) in code() {
        for (_, modules) in forbidden.iter().filter(|(layer, _)| file.starts_with(layer)) {
            for module in modules.concat() {
                let import = format!("crate::{module}");
                assert!(!text.contains(&import), "src/{file} imports {import}");
            }
        }
    }
    for (file, text) in code_of("program/bench") {
        assert!(!text.contains("crate::cli"), "program/bench/{file} imports crate::cli");
    }
}

/// Files of a folder under glsl, each by its path there, without comments.
fn glsl(folder: &str) -> Vec<(String, String)> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl").join(folder);
    let files = fs::read_dir(&path).expect("folder").map(|entry| entry.expect("entry"));
    files
        .map(|file| {
            let text = fs::read_to_string(file.path()).expect("GLSL");
            let lines: Vec<&str> = text.lines().map(|line| line.split("//").next().unwrap_or("")).collect();
            (format!("{folder}/{}", file.file_name().display()), lines.join("\n"))
        })
        .collect()
}

#[test]
fn kernels_know_no_lobe_and_no_kind_of_light() {
    // How a camera's rays begin, and how many light samples a visible point has.
    const OF_KERNELS: [&str; 2] = ["LENS", "FEW_SOURCES"];
    let fields = [
        "is_mirror",
        "is_dielectric",
        "is_glossy",
        "is_matte",
        "is_coated",
        "is_mixed",
        "is_thin",
        "is_punctual",
        "_LIGHT)",
        ".roughness",
        ".metallic",
        ".base_color",
        ".coat",
        ".sheen",
        ".anisotropy",
    ];
    let features = SceneFeatures::ALL.constants().map(|(name, _)| name);
    let words = features
        .into_iter()
        .filter(|name| !OF_KERNELS.contains(name))
        .chain(fields);
    let words: Vec<&str> = words.collect();
    for (file, text) in glsl("stages").into_iter().chain(glsl("gather")) {
        for word in &words {
            assert!(
                !text.contains(word),
                "glsl/{file} has «{word}»: it belongs behind the interface of glsl/bsdf, glsl/lights or glsl/trace"
            );
        }
    }
}

/// Compilers inline functions. The result of a function with several returns, and a variable that is not always set, stay in
/// registers through all iterations of the kernel's loop: 33 registers in `photons`.
#[test]
fn functions_that_kernels_call_in_loops_return_once() {
    for (file, text) in ["bsdf", "lights", "trace"].into_iter().flat_map(glsl) {
        for function in text.split("\n}") {
            let returns = function.matches("return ").count() + function.matches("return;").count();
            let name = function
                .lines()
                .find(|line| line.ends_with(") {") || line.contains('('));
            assert!(returns <= 1, "glsl/{file}: {returns} returns in {}", name.unwrap_or(""));
        }
    }
}

/// What only the program needs.
const OF_THE_PROGRAM: [&str; 9] = [
    "anyhow",
    "clap",
    "clap_complete",
    "clap_mangen",
    "ctrlc",
    "httparse",
    "indicatif",
    "plotters",
    "signal-hook",
];

#[test]
fn the_library_builds_without_the_programs_dependencies() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = fs::read_to_string(root.join("Cargo.toml")).expect("Cargo.toml");
    let dependencies = manifest
        .split("\n[")
        .filter(|table| table.starts_with("dependencies]") || table.contains("\".dependencies]"));
    let lines: Vec<&str> = dependencies.flat_map(str::lines).collect();
    for name in OF_THE_PROGRAM {
        let line = lines.iter().find(|line| line.starts_with(&format!("{name} = ")));
        let line = line.unwrap_or_else(|| panic!("{name} isn't among the dependencies"));
        assert!(line.contains("optional = true"), "the library depends on {line}");
    }
    for (file, text) in code() {
        for name in OF_THE_PROGRAM {
            let name = name.replace('-', "_");
            assert!(!text.contains(&format!("{name}::")), "src/{file} uses {name}");
        }
    }
    let tree = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--no-default-features",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--offline",
        ])
        .current_dir(root)
        .output()
        .expect("cargo tree");
    assert!(tree.status.success(), "{}", String::from_utf8_lossy(&tree.stderr));
    let tree = String::from_utf8_lossy(&tree.stdout);
    assert!(tree.contains("ash v"), "no dependencies in:\n{tree}");
    for name in OF_THE_PROGRAM {
        let is_there = tree.lines().any(|line| line.starts_with(&format!("{name} v")));
        assert!(
            !is_there,
            "a dependency of the library depends on {name}: cargo tree --no-default-features -i {name}"
        );
    }
}

/// The program adds them: `program/cli/advice.rs`.
#[test]
fn the_librarys_messages_name_no_flags() {
    for (file, text) in code() {
        for line in text.lines() {
            let flag = line.match_indices("--").find(|(at, _)| {
                let before = line[..*at].chars().next_back();
                let after = line[at + 2..].chars().next();
                before.is_none_or(|c| !c.is_alphanumeric() && c != '-') && after.is_some_and(|c| c.is_ascii_lowercase())
            });
            assert!(flag.is_none(), "src/{file} names a flag: {}", line.trim());
        }
    }
}

/// A render is a `Session`; only benches of its stages look inside.
#[test]
fn the_command_line_renders_by_the_public_interface() {
    let code = code_of("program/cli");
    assert!(code.len() > 5, "only {} source files found", code.len());
    for (file, text) in code {
        for module in [
            "backend", "cpu", "emission", "gpu", "pipeline", "record", "session", "stage",
        ] {
            let module = format!("internals::{module}");
            assert!(!text.contains(&module), "program/cli/{file} uses {module}");
        }
    }
}

#[test]
fn every_stage_is_documented_where_it_is_written() {
    let folders = ["glsl/stages", "glsl/ladder", "glsl/probes"];
    let files = folders.iter().flat_map(|folder| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        fs::read_dir(folder).expect("folder")
    });
    let paths = files.map(|entry| entry.expect("entry").path());
    for path in paths.filter(|path| path.extension().is_some_and(|extension| extension == "comp")) {
        let text = fs::read_to_string(&path).expect("stage");
        let comment = text.lines().find(|line| !line.starts_with('#')).unwrap_or("");
        assert!(
            comment.starts_with("// "),
            "{} does not start with a description",
            path.display()
        );
        // Before this line gl_WorkGroupSize is (1, 1, 1), and shared arrays sized by it are too small.
        let size = text.find("layout(local_size_x").expect("a workgroup size");
        let include = text.find("#include").unwrap_or(text.len());
        assert!(
            size < include,
            "{} includes files before it declares its workgroup size",
            path.display()
        );
    }
}
