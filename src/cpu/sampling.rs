//! Sampled directions and points, and directions packed into 32 bits: `glsl/common/sampling.glsl` in f64.

use std::f64::consts::PI;

use glam::{DMat3, DVec2, DVec3};

/// An orthonormal basis around the unit vector `n`: Duff and others, «Building an Orthonormal Basis, Revisited», 2017.
/// The same basis as on the device, so that the same numbers give the same direction.
pub(super) fn basis(n: DVec3) -> DMat3 {
    let s = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    DMat3::from_cols(
        DVec3::new(1.0 + s * n.x * n.x * a, s * b, -s * n.x),
        DVec3::new(b, s + n.y * n.y * a, -n.y),
        n,
    )
}

/// A point uniform on the unit disc: Shirley and Chiu, «A Low Distortion Map Between Disk and Square», Journal of Graphics
/// Tools 2(3), 1997.
pub(super) fn disc_point(u: f64, v: f64) -> DVec2 {
    let p = 2.0 * DVec2::new(u, v) - 1.0;
    if p == DVec2::ZERO {
        return p;
    }
    let (radius, phi) = if p.x.abs() > p.y.abs() {
        (p.x, PI / 4.0 * (p.y / p.x))
    } else {
        (p.y, PI / 2.0 - PI / 4.0 * (p.x / p.y))
    };
    radius * DVec2::from_angle(phi)
}

/// A unit vector around the unit vector `n` with density cos θ / π (Malley's method).
pub fn cosine_direction(n: DVec3, u: f64, v: f64) -> DVec3 {
    let p = disc_point(u, v);
    (basis(n) * p.extend((1.0 - p.length_squared()).max(0.0).sqrt())).normalize()
}

/// A direction uniform in a cone around an axis, with 1 − cos of the angle between its sides and the axis.
pub(super) fn direction_in_cone(axis: DVec3, versine: f64, u: DVec2) -> DVec3 {
    let p = disc_point(u.x, u.y);
    let off = p.length_squared() * versine;
    (basis(axis) * (p * (versine * (2.0 - off)).max(0.0).sqrt()).extend(1.0 - off)).normalize()
}

/// Barycentric coordinates (of the second and the third corner) of a point uniform on a triangle.
pub(super) fn triangle_point(u: f64, v: f64) -> (f64, f64) {
    let s = u.sqrt();
    (1.0 - s, v * s)
}

/// Reflects the octahedron's lower half to the square's corners, and back.
fn fold(x: f64, y: f64) -> (f64, f64) {
    let sign = |value: f64| if value >= 0.0 { 1.0 } else { -1.0 };
    ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y))
}

/// Encodes a unit vector in two 16-bit numbers by the octahedral map: Cigolle and others, «A Survey of Efficient Representations
/// for Independent Unit Vectors», JCGT 3(2), 2014.
pub fn encode_direction(d: DVec3) -> u32 {
    let p = d / d.abs().element_sum();
    let (x, y) = if d.z < 0.0 { fold(p.x, p.y) } else { (p.x, p.y) };
    let quantise = |value: f64| u32::from((value.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    quantise(x) | quantise(y) << 16
}

/// Decodes a unit vector from [`encode_direction`], within 6.5e-5 rad.
pub fn decode_direction(code: u32) -> DVec3 {
    let value = |bits: u32| (f64::from(bits as u16 as i16) / 32767.0).max(-1.0);
    let (x, y) = (value(code), value(code >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z < 0.0 { fold(x, y) } else { (x, y) };
    DVec3::new(x, y, z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{PathKind, Random};

    #[test]
    fn cosine_directions_have_the_moments_of_cos_over_pi() {
        let n = DVec3::new(0.36, 0.48, -0.8);
        let count = 1 << 16;
        let mut sum = DVec3::ZERO;
        let mut cos2 = 0.0;
        for path in 0..count {
            let [u, v, ..] = Random::new(PathKind::Photon, path, 0, 0).next4();
            let direction = cosine_direction(n, u, v);
            assert!((direction.length() - 1.0).abs() < 1e-12 && direction.dot(n) >= 0.0);
            sum += direction;
            cos2 += direction.dot(n).powi(2);
        }
        // E[ω] = 2n/3 and E[cos²θ] = 1/2; five standard deviations of the means are below 0.01.
        let count = f64::from(count);
        assert!((sum / count - 2.0 / 3.0 * n).length() < 0.01, "mean {}", sum / count);
        assert!(
            (cos2 / count - 0.5).abs() < 0.01,
            "mean of the squared cosine {}",
            cos2 / count
        );
    }

    #[test]
    fn points_on_a_triangle_have_its_centroid() {
        let count = 1 << 16;
        let mut sum = (0.0, 0.0);
        for path in 0..count {
            let [u, v, ..] = Random::new(PathKind::LightSample, path, 0, 0).next4();
            let (x, y) = triangle_point(u, v);
            assert!(x >= 0.0 && y >= 0.0 && x + y <= 1.0 + 1e-12, "({x}, {y}) lies outside");
            sum = (sum.0 + x / f64::from(count), sum.1 + y / f64::from(count));
        }
        assert!(
            (sum.0 - 1.0 / 3.0).abs() < 0.005 && (sum.1 - 1.0 / 3.0).abs() < 0.005,
            "centroid {sum:?}"
        );
    }

    #[test]
    fn encoded_directions_come_back_within_half_a_step() {
        for path in 0..10_000 {
            let [u, v, ..] = Random::new(PathKind::Photon, path, 1, 0).next4();
            let z = 2.0 * u - 1.0;
            let (sin, cos) = (2.0 * PI * v).sin_cos();
            let direction = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let back = decode_direction(encode_direction(direction));
            assert!(
                direction.angle_between(back) < 6.5e-5,
                "{direction} came back as {back}"
            );
        }
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            assert_eq!(decode_direction(encode_direction(axis)), axis);
            assert_eq!(decode_direction(encode_direction(-axis)), -axis);
        }
    }
}
