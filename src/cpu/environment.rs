//! The environment light: `glsl/lights/environment.glsl` in f64.

use std::f64::consts::PI;

use glam::DVec3;

use super::vector::xyz;

/// Radiance from a direction, with the direction's sampling density.
#[derive(Debug, Clone, Copy)]
pub struct EnvironmentSample {
    /// Linear RGB.
    pub radiance: DVec3,
    /// Density of [`Environment::sample`], per solid angle.
    pub density: f64,
}

/// The image and its sampling tables; see [`crate::scene::Environment`].
#[derive(Debug, Clone, Copy)]
pub struct Environment<'a> {
    width: usize,
    height: usize,
    /// Rotation about +Y, in full turns.
    rotation: f64,
    /// Cosines at the upper and the lower edge, unused, cumulative probability.
    rows: &'a [[f32; 4]],
    /// Radiance, cumulative probability within the row.
    pixels: &'a [[f32; 4]],
}

impl<'a> Environment<'a> {
    /// From [`crate::packing::PackedScene::environment`].
    pub fn of(table: &'a [[f32; 4]]) -> Self {
        let [width, height] = [0, 1].map(|side| table[0][side].to_bits() as usize);
        let (rows, pixels) = table[1..].split_at(height);
        Self {
            width,
            height,
            rotation: table[0][2].into(),
            rows,
            pixels,
        }
    }

    /// Samples a direction nearly in proportion to its radiance; uniform within a pixel.
    pub fn sample(&self, u: f64, v: f64) -> (DVec3, EnvironmentSample) {
        let (row, in_row) = choose(self.rows, v);
        let (column, in_column) = choose(self.row(row), u);
        let [upper, lower, ..] = self.rows[row].map(f64::from);
        let up = upper + (lower - upper) * in_row;
        let across = ((1.0 - up) * (1.0 + up)).max(0.0).sqrt();
        let turn = column as f64 + in_column;
        let phi = 2.0 * PI * (turn / self.width as f64 - 0.5 - self.rotation);
        let direction = DVec3::new(-across * phi.sin(), up, across * phi.cos()).normalize();
        let sample = EnvironmentSample {
            radiance: self.radiance(turn, self.rows_below_pole(across, up)),
            density: self.density(column, row),
        };
        (direction, sample)
    }

    /// Radiance from a direction (a unit vector), with its density.
    pub fn at(&self, direction: DVec3) -> EnvironmentSample {
        let turn = (0.5 + (-direction.x).atan2(direction.z) / (2.0 * PI) + self.rotation).rem_euclid(1.0);
        let x = turn * self.width as f64;
        let y = self.rows_below_pole(direction.x.hypot(direction.z), direction.y);
        let column = (x as usize).min(self.width - 1);
        let row = (y as usize).min(self.height - 1);
        EnvironmentSample {
            radiance: self.radiance(x, y),
            density: self.density(column, row),
        }
    }

    fn rows_below_pole(&self, across: f64, up: f64) -> f64 {
        across.atan2(up) / PI * self.height as f64
    }

    /// Bilinear interpolation at a position in pixels.
    fn radiance(&self, x: f64, y: f64) -> DVec3 {
        let (left, upper) = ((x - 0.5).floor(), (y - 0.5).floor());
        let column_at = |x: f64| x.rem_euclid(self.width as f64) as usize;
        let row_at = |y: f64| y.clamp(0.0, (self.height - 1) as f64) as usize;
        let in_row = |y: f64| {
            let row = self.row(row_at(y));
            let [left_pixel, right_pixel] = [left, left + 1.0].map(|x| xyz(row[column_at(x)]));
            left_pixel.lerp(right_pixel, x - 0.5 - left)
        };
        in_row(upper).lerp(in_row(upper + 1.0), y - 0.5 - upper)
    }

    /// Density of [`Environment::sample`] in a pixel, per solid angle.
    fn density(&self, column: usize, row: usize) -> f64 {
        let [upper, lower, ..] = self.rows[row].map(f64::from);
        let solid_angle = 2.0 * PI / self.width as f64 * (upper - lower);
        probability(self.rows, row) * probability(self.row(row), column) / solid_angle
    }

    fn row(&self, row: usize) -> &'a [[f32; 4]] {
        &self.pixels[row * self.width..][..self.width]
    }
}

/// The entry that u in [0, 1) chooses, and the relative position of u within it.
fn choose(entries: &[[f32; 4]], u: f64) -> (usize, f64) {
    let index = entries
        .partition_point(|entry| f64::from(entry[3]) <= u)
        .min(entries.len() - 1);
    // The middle of the interval that the number's last bit covers.
    let half_a_step = 0.5 / f64::from(1 << 24);
    (
        index,
        (u - before(entries, index) + half_a_step) / probability(entries, index),
    )
}

fn before(entries: &[[f32; 4]], index: usize) -> f64 {
    index.checked_sub(1).map_or(0.0, |before| entries[before][3].into())
}

fn probability(entries: &[[f32; 4]], index: usize) -> f64 {
    f64::from(entries[index][3]) - before(entries, index)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Image;
    use crate::random::{PathKind, Random};
    use crate::scene;

    /// The density integrates to 1 over all directions, and directions are sampled with it: the mean of radiance over density is
    /// the integral of radiance.
    #[test]
    fn directions_are_chosen_by_their_density() {
        for degrees in [0.0, 123.0] {
            assert_chosen_by_density(degrees);
        }
    }

    fn assert_chosen_by_density(degrees: f64) {
        let pixel = |i: usize| [i as f32 * 0.1, 1.0, if i == 77 { 1e4 } else { 0.0 }];
        let image = Image::new(16, 9, (0..144).map(pixel).collect());
        let environment = scene::Environment::new(image).expect("an environment");
        let table = environment.rotated(degrees).table();
        let environment = Environment::of(&table);
        let count = 1 << 16;
        let (mut sampled, mut uniform) = (DVec3::ZERO, DVec3::ZERO);
        let (mut density, mut squares) = (0.0, DVec3::ZERO);
        for path in 0..count {
            let [u, v, s, t] = Random::new(PathKind::Photon, path, 0, 0).next4();
            let (direction, sample) = environment.sample(u, v);
            let looked_up = environment.at(direction);
            assert!(
                (sample.radiance - looked_up.radiance).length() < 1e-6 * (1.0 + sample.radiance.length()),
                "{direction}"
            );
            let estimate = sample.radiance / sample.density;
            sampled += estimate / f64::from(count);
            squares += estimate * estimate / f64::from(count);
            // A uniform direction.
            let y = 1.0 - 2.0 * s;
            let (sin, cos) = (2.0 * PI * t).sin_cos();
            let across = (1.0 - y * y).sqrt();
            let sample = environment.at(DVec3::new(across * cos, y, across * sin));
            uniform += 4.0 * PI * sample.radiance / f64::from(count);
            density += 4.0 * PI * sample.density / f64::from(count);
        }
        // The second channel is 1 everywhere. Six standard errors: a correct program fails once in 10⁸ runs.
        let errors = ((squares - sampled * sampled) / f64::from(count)).map(f64::sqrt);
        assert!((sampled.y - 4.0 * PI).abs() < 6.0 * errors.y, "{sampled} ± {errors}");
        // The density is below 2000 / 4π, and its integral is 1.
        assert!(
            (density - 1.0).abs() < 6.0 * (2000.0 / f64::from(count)).sqrt(),
            "{density}"
        );
        assert!((sampled.x / uniform.x - 1.0).abs() < 0.05, "{sampled} {uniform}");
    }

    #[test]
    fn the_pictures_centre_is_plus_z_and_minus_x_lies_right_of_it() {
        // Four columns: their centres lie at 1/8, 3/8, 5/8 and 7/8 of the turn from −Z over +X, +Z and −X.
        let image = Image::new(4, 1, vec![[1.0; 3], [2.0; 3], [3.0; 3], [4.0; 3]]);
        let table = scene::Environment::new(image).expect("an environment").table();
        let seen = |x: f64, z: f64| Environment::of(&table).at(DVec3::new(x, 0.0, z).normalize()).radiance.x;
        for (x, z, wanted) in [
            (1.0, -1.0, 1.0),
            (1.0, 1.0, 2.0),
            (-1.0, 1.0, 3.0),
            (-1.0, -1.0, 4.0),
            (1.0, 0.0, 1.5),
            (0.0, 1.0, 2.5),
            (-1.0, 0.0, 3.5),
            (0.0, -1.0, 2.5),
        ] {
            assert!((seen(x, z) - wanted).abs() < 1e-12, "{x} {z}: {}", seen(x, z));
        }
        let image = Image::new(1, 2, vec![[1.0; 3], [2.0; 3]]);
        let table = scene::Environment::new(image).expect("an environment").table();
        assert_eq!(Environment::of(&table).at(DVec3::Y).radiance.x, 1.0, "+Y is above");
    }
}
