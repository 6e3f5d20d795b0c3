//! What photon paths report.

/// What a path was worth, for where later ones are aimed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathValue {
    /// The square of what it brought that the picture needs, in any unit; 0 or more.
    pub value: f32,
    /// Rays that it traced.
    pub rays: u32,
}

impl PathValue {
    /// As the device stores it: in the upper 24 bits the value without its sign and the last 7 bits, and the rays up to 255.
    /// Squares span many orders of magnitude.
    pub fn packed(self) -> u32 {
        (self.value.to_bits() << 1 & 0xffff_ff00) | self.rays.min(255)
    }

    /// What a device has stored.
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
