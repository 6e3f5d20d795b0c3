//! The memory that `ppm-vk inspect` foretells is what a render takes.

// Each test program uses a part of what they share.
#[allow(dead_code)]
#[path = "picture/mod.rs"]
mod picture;

use ppm_vk::backend::Backend;
use ppm_vk::config::{Estimator, RenderConfig};
use ppm_vk::gpu::best_device;
use ppm_vk::pipeline::Memory;

use picture::{Subject, small};

#[test]
fn a_render_takes_the_memory_that_was_foretold() {
    let device = best_device().expect("a Vulkan device");
    for (name, estimator) in [
        ("cornell", Estimator::Sppm),
        ("glossy", Estimator::Sppm),
        ("pool", Estimator::Ppm),
        ("glasses", Estimator::Ppm),
    ] {
        let subject = Subject::named(name);
        let config = RenderConfig {
            estimator,
            ..small(160, 20_000)
        };
        let foretold = Memory::of(&subject.packed, &config, &device);
        let mut renderer = subject.renderer(config);
        let at_first = renderer.gpu().bytes();
        for _ in 0..4 {
            renderer.iterate().expect("iteration");
        }
        let later = renderer.gpu().bytes();
        let total = foretold.scene + foretold.render;
        println!("{name}: foretold {total}, at first {at_first}, later {later}");
        let ratio = at_first as f64 / total as f64;
        assert!(
            (0.9..=1.1).contains(&ratio),
            "{name}: {at_first} bytes instead of {total}"
        );
        assert!(later <= at_first, "{name}: {later} bytes after {at_first}");
    }
}
