//! Bounds of a light source, from which the largest irradiance at a point follows: its position and its directions of emission,
//! after Conty Estévez and Kulla, «Importance Sampling of Many Lights with Adaptive Tree Splitting», HPG 2018, and pbrt-v4's
//! `LightBounds`.

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

use super::light_table::Lights;
use super::part::Part;
use super::sphere::Sphere;
use crate::layout::{
    DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, LightSource, POINT_LIGHT, SPOT_LIGHT, TRIANGLE_LIGHT,
};
use crate::scene::Environment;

/// Cosine of the widest cone: all directions.
const ALL_AROUND: f64 = -1.0;

/// The bounds of each source, in their order. `corners`: of all triangles; `two_sided`: whether a triangle's back emits too.
pub(crate) fn light_sources(
    lights: &Lights,
    corners: &[[Vec3; 3]],
    two_sided: impl Fn(u32) -> bool,
    environment: Option<&Environment>,
) -> Vec<LightSource> {
    let source = |range: &std::ops::Range<u32>| {
        let within = range.start as usize..range.end as usize;
        let (of_source, powers) = (&lights.lights[within.clone()], &lights.powers[within]);
        let common = LightSource {
            kind: of_source[0].kind,
            first_light: range.start,
            light_count: range.len() as u32,
            probability: of_source.iter().map(|light| f64::from(light.probability)).sum::<f64>() as f32,
            ..LightSource::zeroed()
        };
        match common.kind {
            TRIANGLE_LIGHT => of_triangles(common, of_source, powers, corners, &two_sided),
            POINT_LIGHT | SPOT_LIGHT => of_points(common, of_source),
            DIRECTIONAL_LIGHT => of_suns(common, of_source),
            ENVIRONMENT_LIGHT => LightSource {
                // The irradiance of a uniform environment.
                strength: environment.map_or(0.0, |environment| 0.25 * environment.total()) as f32,
                ..common
            },
            other => unreachable!("light of kind {other}"),
        }
    };
    lights.sources.iter().map(source).collect()
}

fn of_triangles(
    common: LightSource,
    lights: &[Light],
    powers: &[f64],
    corners: &[[Vec3; 3]],
    two_sided: &impl Fn(u32) -> bool,
) -> LightSource {
    // Parts that are surely dark emit nothing.
    let lit_parts = || {
        lights
            .iter()
            .zip(powers)
            .filter(|(_, power)| **power > 0.0)
            .map(|(light, _)| light)
    };
    let corners_of = |light: &Light| Part::of(light).corners(corners[light.triangle as usize].map(Vec3::as_dvec3));
    let sphere = Sphere::around(lit_parts().flat_map(corners_of)).unwrap_or(Sphere {
        centre: DVec3::ZERO,
        radius: 0.0,
    });
    let normals = || {
        lit_parts().map(|light| {
            let [a, b, c] = corners_of(light);
            (b - a).cross(c - a)
        })
    };
    let axis = normals().sum::<DVec3>().normalize_or_zero();
    let both = lit_parts().any(|light| two_sided(light.triangle));
    let narrowest = normals()
        .map(|normal| axis.dot(normal.normalize_or_zero()))
        .fold(1.0, f64::min);
    // A Lambertian emitter's intensity along its normal.
    let intensity = |(light, power): (&Light, &f64)| power / (if two_sided(light.triangle) { 2.0 * PI } else { PI });
    LightSource {
        centre: sphere.centre.as_vec3().to_array(),
        radius: sphere.radius as f32,
        axis: axis.as_vec3().to_array(),
        cos_cone: if both { ALL_AROUND } else { narrowest } as f32,
        strength: lights.iter().zip(powers).map(intensity).sum::<f64>() as f32,
        ..common
    }
}

fn mean(rgb: [f32; 3]) -> f64 {
    rgb.map(f64::from).iter().sum::<f64>() / 3.0
}

fn of_points(common: LightSource, lights: &[Light]) -> LightSource {
    let position = |light: &Light| Vec3::from_array(light.position).as_dvec3();
    let centre = lights.iter().map(position).sum::<DVec3>() / lights.len() as f64;
    let reach = |light: &Light| position(light).distance(centre) + f64::from(light.extent);
    let (axis, cos_cone) = match lights {
        [spot] if spot.kind == SPOT_LIGHT => (spot.direction, 1.0 - f64::from(spot.outer)),
        _ => ([0.0; 3], ALL_AROUND),
    };
    // 0 if any of them has no range.
    let inverse_range = lights
        .iter()
        .map(|light| light.inverse_range)
        .fold(f32::INFINITY, f32::min);
    LightSource {
        centre: centre.as_vec3().to_array(),
        radius: lights.iter().map(reach).fold(0.0, f64::max) as f32,
        axis,
        cos_cone: cos_cone as f32,
        strength: lights.iter().map(|light| mean(light.intensity)).sum::<f64>() as f32,
        inverse_range,
        ..common
    }
}

fn of_suns(common: LightSource, lights: &[Light]) -> LightSource {
    let (axis, cos_cone) = match lights {
        [sun] => (sun.direction, 1.0 - f64::from(sun.extent)),
        _ => ([0.0; 3], ALL_AROUND),
    };
    LightSource {
        axis,
        cos_cone: cos_cone as f32,
        strength: lights.iter().map(|light| mean(light.intensity)).sum::<f64>() as f32,
        ..common
    }
}
