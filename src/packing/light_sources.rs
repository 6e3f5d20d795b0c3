//! Sources: ranges of lights that photon paths are aimed from. The triangles of an object are one source.

use std::ops::Range;

use crate::layout::Light;

/// Maximum number of sources: each has paths towards each target.
pub const MOST_SOURCES: usize = 32;

/// The share of choices within a source that is equal for each of its triangles and other lights, instead of by power.
const ALIKE: f64 = 0.1;

/// The step of cumulative probabilities, like that of random numbers.
const STEPS: f64 = 16_777_216.0;

/// Joins neighbours of the same kind until there are no more than [`MOST_SOURCES`].
pub(crate) fn bundled(lights: &[Light], sources: Vec<Range<u32>>) -> Vec<Range<u32>> {
    if sources.len() <= MOST_SOURCES {
        return sources;
    }
    let kind_of = |source: &Range<u32>| lights[source.start as usize].kind;
    let kinds: Vec<&[Range<u32>]> = sources.chunk_by(|a, b| kind_of(a) == kind_of(b)).collect();
    let to_share = MOST_SOURCES.saturating_sub(kinds.len());
    let bundles = kinds.iter().flat_map(|of_kind| {
        let count = 1 + to_share * of_kind.len() / sources.len();
        of_kind.chunks(of_kind.len().div_ceil(count))
    });
    bundles
        .map(|bundle| bundle[0].start..bundle[bundle.len() - 1].end)
        .collect()
}

/// Sets the cumulative probabilities of a source's lights, mostly by power. Each has at least one step. `of_triangles`: each
/// light's share of its triangle's power.
pub(crate) fn set_cumulative(lights: &mut [Light], powers: &[f64], of_triangles: &[f64]) {
    let count = lights.len() as f64;
    let total: f64 = powers.iter().sum();
    let triangles: f64 = of_triangles.iter().sum();
    let mut sum = 0.0;
    for (number, ((light, power), of_triangle)) in (1u32..).zip(lights.iter_mut().zip(powers).zip(of_triangles)) {
        let by_power = if total > 0.0 { power / total } else { 1.0 / count };
        sum += (1.0 - ALIKE) * by_power + ALIKE * of_triangle / triangles;
        let steps = f64::from(number) + sum * (STEPS - count);
        light.cumulative = (steps.round() / STEPS).min(1.0) as f32;
    }
    if let Some(last) = lights.last_mut() {
        last.cumulative = 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn every_light_of_a_source_has_its_turn() {
        let mut lights = vec![Light::zeroed(); 1000];
        let powers: Vec<f64> = (0..1000).map(|i| 10f64.powi(-(i % 20))).collect();
        set_cumulative(&mut lights, &powers, &[1.0; 1000]);
        let mut before = 0.0;
        for light in &lights {
            assert!(light.cumulative > before, "{} after {before}", light.cumulative);
            assert_eq!((f64::from(light.cumulative) * STEPS).fract(), 0.0);
            before = light.cumulative;
        }
        assert_eq!(before, 1.0);
    }

    #[test]
    fn many_sources_become_few_of_one_kind_each() {
        let light = |kind| Light {
            kind,
            ..Light::zeroed()
        };
        let kinds: Vec<u32> = (0..500).map(|i| if i < 450 { 0 } else { 1 }).chain([4]).collect();
        let lights: Vec<Light> = kinds.iter().map(|&kind| light(kind)).collect();
        let bundles = bundled(&lights, (0..501).map(|i| i..i + 1).collect());
        assert!(
            (16..=MOST_SOURCES).contains(&bundles.len()),
            "{} sources",
            bundles.len()
        );
        let mut next = 0;
        for bundle in &bundles {
            assert_eq!(bundle.start, next);
            next = bundle.end;
            assert!(
                bundle
                    .clone()
                    .all(|i| kinds[i as usize] == kinds[bundle.start as usize])
            );
        }
        assert_eq!(next, 501);
    }
}
