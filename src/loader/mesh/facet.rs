//! Normals and degenerate triangles.

use glam::{DMat3, DVec3, Vec3};

/// Factor of the f64 rounding unit below which the height of a triangle is rounding noise of its transform.
const ROUNDING_STEPS: f64 = 16.0;

/// The matrix that transforms normals under a linear map, up to a positive factor, and whether the map mirrors.
///
/// It is the cofactor matrix, the inverse transpose times the determinant, which exists for singular maps as well.
pub(crate) fn normal_matrix(linear: DMat3) -> (DMat3, bool) {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    // The largest entry becomes 1, so that the products below neither overflow nor underflow.
    let largest = [x, y, z]
        .map(|axis| axis.abs().max_element())
        .into_iter()
        .fold(0.0, f64::max);
    let [x, y, z] = [x, y, z].map(|axis| axis / if largest > 0.0 { largest } else { 1.0 });
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let is_mirrored = x.dot(cofactors.x_axis) < 0.0;
    (if is_mirrored { -cofactors } else { cofactors }, is_mirrored)
}

/// Unit normal of a triangle, or `None` if its height is within the rounding error of its coordinates.
pub(crate) fn face_normal([a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    let edges = [b - a, c - b, a - c];
    let longest = edges
        .map(|edge| edge.abs().max_element())
        .into_iter()
        .fold(0.0, f64::max);
    if longest == 0.0 || !longest.is_finite() {
        return None;
    }
    // In units of the longest edge the cross product is the height over it, whatever the scene's scale.
    let normal = (edges[0] / longest).cross(-edges[2] / longest);
    let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
    let noise = ROUNDING_STEPS * f64::EPSILON * (largest / longest);
    (normal.length() > noise).then(|| normal.normalize())
}

/// Whether three positions, as rounded, form a triangle. Exact: differences and products of f32 fit into f64.
pub(crate) fn spans_area([a, b, c]: [Vec3; 3]) -> bool {
    let [a, b, c] = [a, b, c].map(|corner| corner.as_dvec3());
    (b - a).cross(c - a) != DVec3::ZERO
}
