//! Aimed photon paths bring the light that those by power bring, only sooner.

use ppm_vk::internals::config::{EmissionChoice, RenderConfig};
use ppm_vk::internals::metrics;

use crate::measure::measure;
use crate::picture::{Subject, small};

/// Iterations, four for each sample.
const ITERATIONS: u32 = 128;

/// Direct light by rays has the same numbers whatever the photons do, so that differences are those of photons. Out of the
/// room of `blinds` photons are guided. A right program fails once in 10⁸ times, see [`crate::measure::Measured`].
#[test]
fn aimed_paths_bring_as_much_light_as_those_by_power() {
    for name in ["cornell-spheres", "ring", "glasses", "blinds"] {
        let subject = Subject::named(name);
        let [aimed, by_power] = [EmissionChoice::Aimed, EmissionChoice::Power].map(|emission| {
            let config = RenderConfig {
                emission,
                aims_anyway: true,
                radius: Some(0.1),
                max_depth: 128,
                ..small(32, 5000)
            };
            let mean = |image: &_| vec![metrics::mean(image).iter().sum::<f64>() / 3.0];
            measure(&subject, config, ITERATIONS, mean).remove(0)
        });
        println!("{name}: {} aimed, {} by power", aimed.mean, by_power.mean);
        let difference = aimed.minus(&by_power);
        difference.assert_is(0.0, &format!("{name}: aimed without by power"));
    }
}
