//! Bounding spheres.

use glam::DVec3;

/// A sphere in render space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sphere {
    pub centre: DVec3,
    pub radius: f64,
}

impl Sphere {
    /// Factor by which spheres are larger than their content.
    pub const MARGIN: f64 = 1.0 + 1e-4;

    /// Around points, centred on their bounds; `None` without points.
    pub fn around(points: impl Iterator<Item = DVec3> + Clone) -> Option<Self> {
        let mut bounds: Option<(DVec3, DVec3)> = None;
        for point in points.clone() {
            let (low, high) = bounds.unwrap_or((point, point));
            bounds = Some((low.min(point), high.max(point)));
        }
        let (low, high) = bounds?;
        let centre = 0.5 * (low + high);
        let radius2 = points.map(|point| (point - centre).length_squared());
        Some(Self {
            centre,
            radius: radius2.fold(0.0, f64::max).sqrt(),
        })
    }

    /// In the device's layout.
    pub fn packed(&self) -> [f32; 4] {
        self.centre.as_vec3().extend(self.radius as f32).to_array()
    }

    /// The smallest one around two.
    pub fn joint(&self, other: &Self) -> Self {
        let way = other.centre - self.centre;
        let distance = way.length();
        if distance + other.radius <= self.radius {
            return *self;
        }
        if distance + self.radius <= other.radius {
            return *other;
        }
        let radius = 0.5 * (distance + self.radius + other.radius);
        Self {
            centre: self.centre + way * ((radius - self.radius) / distance),
            radius,
        }
    }

    /// Whether it contains another sphere.
    pub fn contains(&self, other: &Self) -> bool {
        self.centre.distance(other.centre) + Self::MARGIN * other.radius <= self.radius
    }

    /// 1 − cos of the angle between the axis and the sides of the cone that it subtends; 2 from inside.
    pub fn versine(&self, from: DVec3) -> f64 {
        let sin2 = self.radius * self.radius / self.centre.distance_squared(from);
        if sin2 < 1.0 {
            sin2 / (1.0 + (1.0 - sin2).sqrt())
        } else {
            2.0
        }
    }
}
