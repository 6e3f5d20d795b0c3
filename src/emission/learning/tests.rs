//! Tests of learning where paths start.

use super::*;

fn two_strata() -> Aim {
    let stratum = |target, floor, initial| Stratum {
        lights: 0..3,
        target,
        share: floor,
        floor,
        initial,
    };
    Aim::of_strata(vec![stratum(0, 0.01, 0.5), stratum(1, 0.2, 0.5)], vec![[0.0; 4]], None)
}

/// Paths of the first stratum are worth something where each coordinate lies within a part of this length.
const SIDE: f64 = 0.2;
const LOW: f64 = 0.35;

/// Values that are squared contributions: a path's is 1 over its density.
fn values(aim: &Aim, config: &RenderConfig, iteration: u32) -> Vec<u32> {
    let value = |path| {
        let mut random = Random::of_photon(config, path, iteration);
        let (u, w) = (random.next4(), random.next4());
        let chosen = aim.table().choose(u, w);
        let cell = &aim.table().cells[chosen.cell];
        let coordinates = aim.table().coordinates(chosen);
        let inside = |&coordinate: &f64| (LOW..LOW + SIDE).contains(&coordinate);
        let worth = cell.target == 0 && coordinates.iter().take(4).all(inside);
        let value = if worth { cell.weight.powi(2) } else { 0.0 };
        PathValue { value, rays: 1 }.packed()
    };
    (0..counted_paths(iteration)).map(value).collect()
}

fn assert_sound(aim: &Aim) {
    let sum: f64 = aim.cells.iter().map(|cell| cell.probability).sum();
    assert!((sum - 1.0).abs() < 1e-9, "sum {sum}");
    for (cell, packed) in aim.cells.iter().zip(&aim.table().cells) {
        let floor = aim.strata[cell.stratum].floor * cell.volume();
        assert!(cell.probability >= floor * (1.0 - 1e-9), "{cell:?}");
        let density = f64::from(packed.weight) * cell.probability / cell.volume();
        assert!((density - 1.0).abs() < 1e-6);
    }
    let volume: f64 = aim.cells.iter().map(Cell::volume).sum();
    assert!((volume - aim.strata.len() as f64).abs() < 1e-9, "volume {volume}");
}

#[test]
fn paths_come_to_start_where_they_are_worth_something() {
    let config = RenderConfig::default();
    let mut aim = two_strata();
    assert_sound(&aim);
    let mut share = 0.0;
    for iteration in 0..12 {
        let values = values(&aim, &config, iteration);
        share = values.iter().filter(|&&value| value > 255).count() as f64 / values.len() as f64;
        println!(
            "{iteration}: {} cells, {share} of the paths are worth something",
            aim.cells.len()
        );
        aim.learn(&config, iteration, 0, &values);
        aim.update();
        assert_sound(&aim);
    }
    let useful = |cell: &&EmissionCell| {
        let covers = |i: usize| f64::from(cell.low[i]) < LOW + SIDE && f64::from(cell.low[i] + cell.size[i]) > LOW;
        cell.target == 0 && (0..4).all(covers)
    };
    let cells = aim.table().cells.iter();
    let probability: f64 = cells
        .filter(useful)
        .map(|cell| {
            let volume: f32 = cell.size.iter().product::<f32>() * cell.size_light;
            f64::from(volume / cell.weight)
        })
        .sum();
    // All but the floors.
    assert!(probability > 0.6, "{probability}");
    // 1 in 1250 at first.
    assert!(share > 0.2, "{share} of the paths are worth something");
    assert!(aim.cells.len() <= MOST_EMISSION_CELLS as usize);
}

#[test]
fn without_any_value_nothing_changes() {
    let config = RenderConfig::default();
    let mut aim = two_strata();
    let before = aim.table().cells.clone();
    aim.learn(&config, 0, 0, &[1; 1000]);
    aim.update();
    assert_eq!(before, aim.table().cells);
}

#[test]
fn a_table_never_has_more_cells_than_room() {
    let config = RenderConfig::default();
    let mut aim = two_strata();
    for iteration in 0..60 {
        // Noise of a new kind each time.
        let value = |path: u32| PathValue {
            value: (crate::random::pcg4d([path / 64, iteration, 0, 0])[0] >> 20) as f32,
            rays: 1,
        };
        let value = |path| value(path).packed();
        let values: Vec<u32> = (0..counted_paths(iteration)).map(value).collect();
        aim.learn(&config, iteration, 0, &values);
        aim.update();
    }
    assert_sound(&aim);
    assert!(aim.cells.len() <= MOST_EMISSION_CELLS as usize, "{}", aim.cells.len());
}

#[test]
fn where_paths_take_many_rays_some_are_not_traced_and_the_others_carry_their_flux() {
    let config = RenderConfig::default();
    let mut aim = two_strata();
    // Those by power take one ray of twelve, nearly.
    let rays = |path: u32| {
        let mut random = Random::of_photon(&config, path, 0);
        let (u, w) = (random.next4(), random.next4());
        if aim.cells[aim.table().choose(u, w).cell].stratum == 0 {
            12
        } else {
            1
        }
    };
    let values: Vec<u32> = (0..counted_paths(0))
        .map(|path| {
            PathValue {
                value: if rays(path) > 1 { 1.0 } else { 0.1 },
                rays: rays(path),
            }
            .packed()
        })
        .collect();
    aim.learn(&config, 0, 0, &values);
    aim.update();
    let untraced = aim.table().cells[aim.cells.len()];
    assert_eq!(untraced.weight, 0.0, "{untraced:?}");
    let traced = aim.traced();
    assert!((0.3..0.9).contains(&traced), "{traced} of the paths are traced");
    for (cell, packed) in aim.cells.iter().zip(&aim.table().cells) {
        // The flux of all is that of each cell's volume.
        let flux = f64::from(packed.weight) * traced * cell.probability;
        assert!((flux / cell.volume() - 1.0).abs() < 1e-6, "{flux}: {cell:?}");
    }
    let mean_rays: f64 = aim
        .cells
        .iter()
        .map(|cell| traced * cell.probability * cell.counts.rays / cell.counts.paths)
        .sum();
    assert!((mean_rays / FEWEST_RAYS - 1.0).abs() < 1e-6, "{mean_rays} rays a path");
}
