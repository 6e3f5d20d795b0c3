//! Host and shaders agree on every struct that they share.

use ppm_vk::layout::LAYOUTS;
use ppm_vk::shaders::ALL;
use ppm_vk::stage::Access;

#[test]
fn every_struct_of_a_block_has_the_same_fields_in_rust_and_glsl() {
    let mut compared = 0;
    for shader in ALL {
        for binding in shader.bindings {
            let glsl = binding.element;
            let Some((_, rust)) = LAYOUTS.iter().find(|(name, _)| *name == glsl.name) else {
                continue;
            };
            let reflected: Vec<_> = glsl
                .fields
                .iter()
                .map(|field| (field.name, field.offset, field.size))
                .collect();
            assert_eq!(
                reflected, *rust,
                "{} in stage {} (left) isn't layout::{} (right)",
                glsl.name, shader.name, glsl.name
            );
            compared += 1;
        }
    }
    assert!(
        compared > 20,
        "only {compared} blocks were compared: does reflection still give struct names?"
    );
}

#[test]
fn every_block_of_structs_has_a_rust_struct() {
    for shader in ALL {
        for binding in shader.bindings {
            // Blocks of plain numbers are named like their buffer, structs otherwise.
            let name = binding.element.name;
            let is_buffer = name == format!("{:?}", binding.buffer) && binding.access != Access::Uniform;
            let known = LAYOUTS.iter().any(|(rust, _)| *rust == name);
            assert!(
                known || is_buffer || binding.access == Access::Texels,
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
