//! Parts of triangles that emit unevenly, each a light of its own. A triangle is divided by its barycentric coordinates u and v
//! into columns² parts of the same shape, about half of them upside down. Parts are numbered as cells of a square of columns²:
//! upright parts have the cells with column + row < columns; upside-down parts have the others, by the point reflection of the
//! square. So every number is a part, and its row and column are a quotient and a remainder.

use glam::{DVec2, DVec3, dvec2};

use crate::layout::Light;

/// A part of a triangle, as in `glsl/lights/light.glsl`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    column: f64,
    row: f64,
    columns: f64,
}

impl Part {
    /// The part with this number among columns² parts.
    pub fn numbered(number: u32, columns: u32) -> Self {
        Self {
            column: f64::from(number % columns),
            row: f64::from(number / columns),
            columns: columns.into(),
        }
    }

    /// The part that contains a point, given by the barycentric coordinates of the second and the third corner.
    pub fn around(place: DVec2, columns: u32) -> Self {
        let n = f64::from(columns);
        let at = place * n;
        let row = at.y.floor().clamp(0.0, n - 1.0);
        let column = at.x.floor().clamp(0.0, n - 1.0 - row);
        let upside_down = at.x - column + at.y - row > 1.0 && column + row + 1.0 < n;
        let turned = |cell: f64| if upside_down { n - 1.0 - cell } else { cell };
        Self {
            column: turned(column),
            row: turned(row),
            columns: n,
        }
    }

    /// The part of a triangle's light.
    pub fn of(light: &Light) -> Self {
        let [column, row, columns] = light.position.map(f64::from);
        Self { column, row, columns }
    }

    /// In the layout of [`Light::position`].
    pub fn packed(self) -> [f32; 3] {
        [self.column as f32, self.row as f32, self.columns as f32]
    }

    /// Whether it is the whole triangle.
    pub fn is_whole(self) -> bool {
        self.columns == 1.0
    }

    /// Its number among those of its triangle.
    pub fn number(self) -> u32 {
        (self.row * self.columns + self.column) as u32
    }

    /// The point of the triangle at a point of the part.
    pub fn place(self, within: DVec2) -> DVec2 {
        let at = (dvec2(self.column, self.row) + within) / self.columns;
        if self.column + self.row >= self.columns {
            DVec2::ONE - at
        } else {
            at
        }
    }

    /// Its corners, for those of the triangle.
    pub fn corners(self, [a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
        if self.is_whole() {
            return [a, b, c];
        }
        [DVec2::ZERO, DVec2::X, DVec2::Y].map(|corner| {
            let place = self.place(corner);
            a + place.x * (b - a) + place.y * (c - a)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_one_part_and_its_places_are_found_again() {
        let places = [dvec2(0.3, 0.3), dvec2(0.9, 0.05), dvec2(0.05, 0.9), dvec2(0.02, 0.02)];
        for columns in [1, 2, 4, 32] {
            let mut middle = DVec2::ZERO;
            for number in 0..columns * columns {
                let part = Part::numbered(number, columns);
                assert_eq!(part.number(), number);
                for within in places {
                    let place = part.place(within);
                    assert!(
                        place.min_element() > 0.0 && place.element_sum() < 1.0,
                        "{part:?}: {place}"
                    );
                    assert_eq!(Part::around(place, columns), part, "{place}");
                }
                middle += part.place(DVec2::splat(1.0 / 3.0)) / f64::from(columns * columns);
            }
            assert!((middle - 1.0 / 3.0).abs().max_element() < 1e-12, "{middle}");
        }
        // By rounding, a point may lie on the triangle's edge, or beyond it.
        for place in [
            dvec2(1.0, 0.0),
            dvec2(0.0, 1.0),
            dvec2(0.5, 0.5 + 1e-9),
            dvec2(-1e-9, 0.3),
        ] {
            assert!(Part::around(place, 8).number() < 64, "{place}");
        }
    }
}
