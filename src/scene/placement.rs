//! Placement of shared triangles by an instance.

use glam::{DAffine3, DMat3, DVec3, Mat3, Vec3};

/// Minimum thickness of an instance, in render units: below it, the rounding of the local ray is as large as the triangles.
const THINNEST: f64 = 1e-5;
/// Maximum ratio of its scales along different axes, relative to its triangles in their own space.
const LONGEST: f64 = 1e4;
/// Half a unit in the last place of 1.0f32: the largest relative rounding error.
const ROUNDING: f32 = 0.5 * f32::EPSILON;

/// An affine map from the space of shared triangles, whose coordinates lie within −1 ..= 1, to render space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// A row for each coordinate of render space: factors, then the translation.
    pub rows: [[f32; 4]; 3],
}

impl Placement {
    /// The map, rounded; `None` for one that flattens or stretches too much to be inverted.
    pub(crate) fn new(map: DAffine3) -> Option<Self> {
        let columns = [map.x_axis, map.y_axis, map.z_axis, map.w_axis].map(DVec3::as_vec3);
        let rows = [0, 1, 2].map(|row| columns.map(|column| column[row]));
        let placement = Self { rows };
        let linear = placement.map().matrix3;
        let size = |m: DMat3| m.to_cols_array().map(|entry| entry * entry).iter().sum::<f64>().sqrt();
        let (grows, shrinks) = (size(linear), size(linear.inverse()));
        // NaN fails as well.
        (map.is_finite() && shrinks * THINNEST < 1.0 && grows * shrinks < LONGEST).then_some(placement)
    }

    /// The map as it is after rounding.
    pub fn map(&self) -> DAffine3 {
        let column = |i: usize| DVec3::from_array(self.rows.map(|row| row[i].into()));
        DAffine3::from_cols(column(0), column(1), column(2), column(3))
    }

    /// Transforms a point, with the same rounding as `placed` in `glsl/trace/triangles.glsl`.
    pub fn point(&self, p: Vec3) -> Vec3 {
        Vec3::from_array(self.rows.map(|[x, y, z, w]| x * p.x + y * p.y + z * p.z + w))
    }

    /// Whether it mirrors: front faces become back faces.
    pub fn is_mirrored(&self) -> bool {
        self.map().matrix3.determinant() < 0.0
    }

    /// The inverse map, and a bound of the rounding error of corners, in the triangles' space.
    pub(crate) fn inverse(&self) -> ([[f32; 4]; 3], f32) {
        let inverse = self.map().inverse();
        let columns = [inverse.x_axis, inverse.y_axis, inverse.z_axis, inverse.w_axis].map(DVec3::as_vec3);
        let rows = [0, 1, 2].map(|row| columns.map(|column| column[row]));
        let linear = Mat3::from_cols(columns[0].abs(), columns[1].abs(), columns[2].abs());
        // Three products and three sums.
        (rows, 6.0 * ROUNDING * (linear * self.reach()).max_element())
    }

    /// Upper bound of the sums of absolute terms of a point's coordinates.
    pub(crate) fn reach(&self) -> Vec3 {
        Vec3::from_array(self.rows.map(|row| row.map(f32::abs).iter().sum()))
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    fn map(scale: [f64; 3], translation: [f64; 3]) -> DAffine3 {
        let turn = DQuat::from_xyzw(0.1, 0.2, 0.3, 0.9).normalize();
        DAffine3::from_scale_rotation_translation(scale.into(), turn, translation.into())
    }

    #[test]
    fn corners_lie_within_the_bound_of_where_they_belong() {
        let mut farthest: f64 = 0.0;
        for scale in [[0.3, 0.2, -0.1], [1e-3, 1.0, 0.5], [1e-4, 1e-4, 2e-4]] {
            let placement = Placement::new(map(scale, [0.5, -0.7, 0.01])).expect("a placement");
            let (_, bound) = placement.inverse();
            for i in 0..1000 {
                let angle = f64::from(i);
                let corner = DVec3::new(angle.sin(), (1.7 * angle).cos(), (2.3 * angle).sin()).as_vec3();
                let back = placement.map().inverse();
                let off = back.transform_point3(placement.point(corner).as_dvec3()) - corner.as_dvec3();
                farthest = farthest.max(off.abs().max_element() / f64::from(bound));
            }
        }
        assert!((0.01..1.0).contains(&farthest), "{farthest} of the bound");
    }

    #[test]
    fn what_is_flat_or_hardly_there_is_no_placement() {
        for scale in [[1.0, 0.0, 1.0], [1e-6, 1e-6, 1e-6], [1.0, 1e-5, 1.0], [f64::NAN; 3]] {
            assert_eq!(Placement::new(map(scale, [0.0; 3])), None, "{scale:?}");
        }
    }
}
