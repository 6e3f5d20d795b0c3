//! Host and shaders agree on all shared structs.

use std::collections::BTreeSet;

use ppm_vk::internals::layout::layouts;
use ppm_vk::internals::shaders::{ALL, STRUCTS};
use ppm_vk::internals::stage::{Access, BufferId};

#[test]
fn every_struct_has_the_same_fields_in_rust_and_glsl() {
    let bound = ALL
        .iter()
        .flat_map(|shader| shader.bindings.iter().map(|binding| (shader.name, &binding.element)));
    let mut compared = BTreeSet::new();
    for (place, glsl) in bound.chain(STRUCTS.iter().map(|glsl| ("the build's probe", glsl))) {
        let Some(rust) = layouts().find(|layout| layout.name == glsl.name) else {
            continue;
        };
        let expected: Vec<_> = rust
            .fields
            .iter()
            .map(|field| (field.name, field.offset, field.shape.size()))
            .collect();
        let reflected: Vec<_> = glsl
            .fields
            .iter()
            .map(|field| (field.name, field.offset, field.size))
            .collect();
        assert_eq!(
            reflected, expected,
            "{} in {place} (left) isn't layout::{} (right)",
            glsl.name, glsl.name
        );
        compared.insert(glsl.name);
    }
    let all: BTreeSet<_> = layouts().map(|layout| layout.name).collect();
    assert_eq!(compared, all, "structs compared (left) aren't those of layout (right)");
}

#[test]
fn every_block_of_structs_has_a_rust_struct() {
    for shader in ALL {
        for binding in shader.bindings {
            // Blocks of plain numbers are named like their buffer, structs otherwise.
            let name = binding.element.name;
            // The lists of probes are declared by tests.
            let is_probed = [BufferId::ProbeFrom, BufferId::ProbeTo].contains(&binding.buffer);
            let is_buffer = name == format!("{:?}", binding.buffer) && binding.access != Access::Uniform;
            let known = layouts().any(|rust| rust.name == name);
            assert!(
                known || is_buffer || is_probed || binding.access == Access::Texels,
                "stage {} binds {:?} of struct {name}, which layout.rs doesn't have",
                shader.name,
                binding.buffer
            );
        }
    }
}

#[test]
fn push_constants_fit_every_device() {
    for shader in ALL {
        if let Some(block) = shader.push_constants {
            assert!(
                block.size() <= 128,
                "stage {}: {} bytes of push constants",
                shader.name,
                block.size()
            );
        }
    }
}
