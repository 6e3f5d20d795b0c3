//! Prefix sums and sorting.

/// Replaces each number by the sum of those before it, modulo 2³²; returns the sum of all.
pub fn scan(numbers: &mut [u32]) -> u32 {
    let mut before = 0u32;
    for number in numbers {
        let here = *number;
        *number = before;
        before = before.wrapping_add(here);
    }
    before
}

/// Sorts keys, and values along with them, by the low `bits` bits of the keys; equal ones keep their order.
///
/// # Panics
/// If there are more values than keys, or fewer.
pub fn sort(keys: &mut [u32], values: &mut [u32], bits: u32) {
    assert_eq!(keys.len(), values.len(), "each key needs one value");
    let mask = u32::MAX.checked_shr(32 - bits).unwrap_or(0);
    let mut pairs: Vec<(u32, u32)> = keys.iter().copied().zip(values.iter().copied()).collect();
    pairs.sort_by_key(|(key, _)| key & mask);
    for (i, pair) in pairs.into_iter().enumerate() {
        (keys[i], values[i]) = pair;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scan_is_exclusive() {
        let mut numbers = [3, 1, 4, 1, 5];
        assert_eq!(scan(&mut numbers), 14);
        assert_eq!(numbers, [0, 3, 4, 8, 9]);
        assert_eq!(scan(&mut []), 0);
    }

    #[test]
    fn sort_looks_at_the_low_bits_and_keeps_the_order_of_equal_keys() {
        let (mut keys, mut values) = ([0x13, 0x21, 0x03, 0x11], [0, 1, 2, 3]);
        sort(&mut keys, &mut values, 4);
        assert_eq!((keys, values), ([0x21, 0x11, 0x13, 0x03], [1, 3, 0, 2]));
        sort(&mut keys, &mut values, 32);
        assert_eq!((keys, values), ([0x03, 0x11, 0x13, 0x21], [2, 3, 0, 1]));
    }
}
