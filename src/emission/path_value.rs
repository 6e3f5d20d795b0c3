//! Values that photon paths report.

/// The value and the cost of a path, from which the emission table is learned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathValue {
    /// The squared error of the picture that its photons remove, in any unit; 0 or more.
    pub value: f32,
    /// Number of rays that it traced.
    pub rays: u32,
}

impl PathValue {
    /// In the device's layout: the upper 24 bits hold the value without its sign and the last 7 bits, the lower 8 bits the rays,
    /// up to 255. Squares span many orders of magnitude.
    pub fn packed(self) -> u32 {
        (self.value.to_bits() << 1 & 0xffff_ff00) | self.rays.min(255)
    }

    /// From the device's layout.
    pub fn unpacked(word: u32) -> Self {
        Self {
            value: f32::from_bits(word >> 1 & 0x7fff_ff80),
            rays: word & 255,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_any_size_come_back() {
        for exponent in -30..=30 {
            let value = 1.7f32 * 10f32.powi(exponent);
            let back = PathValue::unpacked(PathValue { value, rays: 300 }.packed());
            assert!((back.value / value - 1.0).abs() < 1.0 / 65536.0, "{back:?} of {value}");
            assert_eq!(back.rays, 255);
        }
        assert_eq!(PathValue { value: 0.0, rays: 7 }.packed(), 7);
    }
}
