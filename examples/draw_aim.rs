//! Draws the learned distribution of the starts of a light source's photon paths: `cargo run --release --example draw_aim --
//! SCENE.gltf OUT.png [ITERATIONS]` For a directional light: starts on the plane across its rays, for the whole scene and for the
//! surroundings of the smallest target, with outlined targets. Colours show the density of starts relative to sampling by power,
//! on a logarithmic scale. Without a directional light: the unit square of directions towards the target of most paths of the
//! first source, relative to a uniform density. The strip below shows the colours from the smallest to the largest density, which
//! are printed.

use std::f64::consts::PI;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Error, Result};
use glam::{DVec2, DVec3, Vec2Swizzles as _, Vec3};
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::emission::Table;
use ppm_vk::internals::film::write_rgb8;
use ppm_vk::internals::gpu::Device;
use ppm_vk::internals::layout::{DIRECTIONAL_LIGHT, EmissionCell, Light};
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::scene::Scene;

/// Pixels of a panel's side.
const SIDE: usize = 256;
/// Pixels between panels.
const GAP: usize = 4;
/// Colours from the smallest density to the largest.
const COLOURS: [[f64; 3]; 5] = [
    [10.0, 8.0, 40.0],
    [80.0, 20.0, 110.0],
    [185.0, 55.0, 85.0],
    [250.0, 140.0, 40.0],
    [252.0, 250.0, 190.0],
];
const OUTLINE: [u8; 3] = [120, 200, 220];

/// Densities from the top left; 0 where no path starts, NaN on an outline.
type Panel = Vec<f64>;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().context("name a scene")?;
    let out = arguments.next().context("name a picture to write")?;
    let iterations = arguments.next().map_or(Ok(8), |word| word.parse::<u32>())?;
    let scene = Scene::load(Path::new(&scene))?;
    let packed = PackedScene::new(&scene).map_err(Error::msg)?;
    let config = RenderConfig {
        resolution: [192, 192],
        aims_anyway: true,
        ..RenderConfig::default()
    };
    let camera = scene.cameras.first().context("the scene has no camera")?;
    let mut renderer = Renderer::new(Device::open(None)?, &packed, camera, config)?;
    for _ in 0..iterations {
        renderer.iterate()?;
    }
    let table = renderer.aim().context("paths aren't aimed")?.table();
    let is_directional = |source: &&Range<u32>| packed.lights[source.start as usize].kind == DIRECTIONAL_LIGHT;
    let directional = packed.sources.iter().find(is_directional);
    let source = directional.or(packed.sources.first()).context("no light")?.clone();
    println!("{} cells, {} targets", table.cells.len(), table.spheres.len());
    let of_source = |cell: &&EmissionCell| cell.weight > 0.0 && cell.first_light == source.start;
    let cells = table.cells.iter().filter(of_source).collect();
    let starts = Starts { table, cells };
    let lights = &packed.lights[source.start as usize..source.end as usize];
    let panels = match directional {
        Some(_) => starts.across(lights, packed.scale),
        None => vec![starts.directions()],
    };
    draw(&panels, Path::new(&out))
}

/// The share of paths that start in a cell.
fn probability(cell: &EmissionCell) -> f64 {
    let volume = cell.size.iter().product::<f32>() * cell.size_light;
    f64::from(volume) / f64::from(cell.weight)
}

/// The starts of one source.
struct Starts<'a> {
    table: &'a Table,
    cells: Vec<&'a EmissionCell>,
}

impl Starts<'_> {
    fn towards(&self, target: u32) -> impl Iterator<Item = &&EmissionCell> {
        self.cells.iter().filter(move |cell| cell.target == target)
    }

    /// Density of two neighbouring coordinates of the starts towards a target.
    fn density(&self, target: u32, first: usize, at: DVec2) -> f64 {
        let is_in = |cell: &EmissionCell, i: usize, coordinate: f64| {
            let (low, size) = (f64::from(cell.low[i]), f64::from(cell.size[i]));
            (low..low + size).contains(&coordinate)
        };
        let cells = self.towards(target);
        let holding = cells.filter(|cell| is_in(cell, first, at.x) && is_in(cell, first + 1, at.y));
        let density = |cell: &&EmissionCell| probability(cell) / f64::from(cell.size[first] * cell.size[first + 1]);
        holding.map(density).sum()
    }

    /// Panels of the plane across a directional light.
    fn across(&self, lights: &[Light], scale: f64) -> Vec<Panel> {
        let light = lights[0];
        // The same as those of `glsl/common/sampling.glsl`.
        let (x, y) = Vec3::from(light.direction).as_dvec3().any_orthonormal_pair();
        let disc = |[a, b, c]: [f32; 3], radius: f64| {
            let point = DVec3::new(a.into(), b.into(), c.into());
            (DVec2::new(x.dot(point), y.dot(point)), radius)
        };
        let whole = disc(light.position, (f64::from(light.area) / PI).sqrt());
        let spheres = self.table.spheres.iter();
        let mut discs: Vec<_> = spheres
            .map(|&[a, b, c, radius]| disc([a, b, c], radius.into()))
            .collect();
        discs.push(whole);
        let power: f64 = lights.iter().map(|light| f64::from(light.probability)).sum();
        let density = |at: DVec2, pixel: f64| {
            let off = |disc: &(DVec2, f64)| at.distance(disc.0) - disc.1;
            let is_on = |disc: &(DVec2, f64)| disc.1 > 4.0 * pixel && off(disc).abs() < 0.5 * pixel;
            match discs.iter().position(|disc| off(disc) < 0.0) {
                None => 0.0,
                Some(_) if discs.iter().any(is_on) => f64::NAN,
                Some(first) => {
                    let (centre, radius) = discs[first];
                    let of_disc = self.density(first as u32, 0, square_point((at - centre) / radius));
                    of_disc / power * (whole.1 / radius).powi(2)
                }
            }
        };
        let (smallest, near) = (discs[0].0, 2.0 * discs[0].1);
        let views = [whole, (smallest, (near * whole.1).sqrt()), (smallest, near)];
        let draw = |(centre, radius): (DVec2, f64)| {
            let half = 1.05 * radius;
            println!("a panel is {:.3} scene units wide", 2.0 * half / scale);
            panel(|at| density(centre + half * at, 2.0 * half / SIDE as f64))
        };
        views.map(draw).to_vec()
    }

    /// The panel of the unit square of directions towards the target that most paths are aimed at.
    fn directions(&self) -> Panel {
        let part = |target| self.towards(target).map(|cell| probability(cell)).sum::<f64>();
        let targets = 0..=self.table.spheres.len() as u32;
        let parts = targets.map(|target| (target, part(target)));
        let (most, part) = parts.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        println!("{:.0} % of the paths are aimed at target {most}", 100.0 * part);
        panel(|at| self.density(most, 2, 0.5 + 0.5 * at) / part)
    }
}

/// A point of a square from −1 to 1.
fn panel(density: impl Fn(DVec2) -> f64) -> Panel {
    let place = |i: usize| (i as f64 + 0.5) / SIDE as f64 * 2.0 - 1.0;
    let pixels = 0..SIDE * SIDE;
    pixels
        .map(|i| density(DVec2::new(place(i % SIDE), -place(i / SIDE))))
        .collect()
}

/// The inverse of `disc_point` in `glsl/common/sampling.glsl`.
fn square_point(p: DVec2) -> DVec2 {
    let wide = p.x.abs() > p.y.abs();
    let q = if wide { p } else { p.yx() };
    let radius = p.length().copysign(q.x);
    let square = DVec2::new(radius, radius * (q.y / q.x).atan() * 4.0 / PI);
    let square = 0.5 + 0.5 * if wide { square } else { square.yx() };
    square.clamp(DVec2::ZERO, DVec2::splat(1.0 - 1e-9))
}

/// Panels side by side, with the colour scale below.
fn draw(panels: &[Panel], out: &Path) -> Result<()> {
    let densities = panels.iter().flatten().filter(|&&density| density > 0.0);
    let (low, high) = densities.fold((f64::INFINITY, 0.0f64), |(low, high), &d| (low.min(d), high.max(d)));
    println!("densities from {low:.3} to {high:.0} times the other one");
    let width = panels.len() * (SIDE + GAP) - GAP;
    let height = SIDE + 3 * GAP;
    let colour_at = |pixel: usize| {
        let (row, column) = (pixel / width, pixel % width);
        let x = column % (SIDE + GAP);
        match panels[column / (SIDE + GAP)].get(row * SIDE + x) {
            Some(&density) if x < SIDE && density.is_nan() => OUTLINE,
            Some(&density) if x < SIDE && density > 0.0 => colour((density / low).ln() / (high / low).ln()),
            Some(_) if x < SIDE => [0; 3],
            None if row >= SIDE + GAP => colour(column as f64 / width as f64),
            _ => [255; 3],
        }
    };
    let bytes: Vec<u8> = (0..width * height).flat_map(colour_at).collect();
    Ok(write_rgb8([width, height], &bytes, out)?)
}

fn colour(part: f64) -> [u8; 3] {
    let place = part.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let first = (place as usize).min(COLOURS.len() - 2);
    let mix = |i: usize| COLOURS[first][i] + (place - first as f64) * (COLOURS[first + 1][i] - COLOURS[first][i]);
    std::array::from_fn(|i| mix(i) as u8)
}
