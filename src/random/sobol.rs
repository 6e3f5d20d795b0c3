//! Sobol' points in four dimensions with Owen's scrambling: `glsl/common/sobol.glsl`, bit for bit.

/// A primitive polynomial over GF(2) and initial numbers: Joe and Kuo, «Constructing Sobol sequences with better
/// two-dimensional projections», 2008 (degree, inner coefficients, m).
const DIMENSIONS: [(usize, u32, &[u32]); 3] = [(1, 0, &[1]), (2, 1, &[1, 3]), (3, 1, &[1, 3, 1])];

/// The columns of a dimension's generator matrix, the first digit highest.
const fn columns((degree, coefficients, first): (usize, u32, &[u32])) -> [u32; 32] {
    let mut v = [0; 32];
    let mut i = 0;
    while i < 32 {
        if i < degree {
            v[i] = first[i] << (31 - i);
        } else {
            v[i] = v[i - degree] ^ v[i - degree] >> degree;
            let mut k = 1;
            while k < degree {
                if coefficients >> (degree - 1 - k) & 1 == 1 {
                    v[i] ^= v[i - k];
                }
                k += 1;
            }
        }
        i += 1;
    }
    v
}

/// For each byte of an index, what its digits add to a coordinate.
type Sums = [[u32; 256]; 4];

const fn sums(columns: [u32; 32]) -> Sums {
    let mut sums = [[0; 256]; 4];
    let mut byte = 0;
    while byte < 4 {
        let mut value = 1;
        while value < 256usize {
            let highest = value.ilog2();
            // Without its highest digit it is a value before.
            sums[byte][value] = sums[byte][value ^ 1 << highest] ^ columns[8 * byte + highest as usize];
            value += 1;
        }
        byte += 1;
    }
    sums
}

static SUMS: [Sums; 3] = [
    sums(columns(DIMENSIONS[0])),
    sums(columns(DIMENSIONS[1])),
    sums(columns(DIMENSIONS[2])),
];

/// The coordinates of the point `index`, times 2³².
fn unscrambled(index: u32) -> [u32; 4] {
    let bytes = index.to_le_bytes();
    let coordinate = |sums: &Sums| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|byte| sums[byte][usize::from(bytes[byte])]);
        a ^ b ^ c ^ d
    };
    let [y, z, w] = &SUMS;
    [index.reverse_bits(), coordinate(y), coordinate(z), coordinate(w)]
}

/// Flips each digit or not, depending on those above it.
fn scramble(p: u32, seed: u32) -> u32 {
    let mut p = p.reverse_bits();
    p ^= p.wrapping_mul(0x3d20_adea);
    p = p.wrapping_add(seed);
    p = p.wrapping_mul(seed >> 16 | 1);
    p ^= p.wrapping_mul(0x0552_6c56);
    p ^= p.wrapping_mul(0x53a2_2864);
    p.reverse_bits()
}

/// A point of the sequence with this seed, coordinates times 2³².
pub(super) fn point(index: u32, seed: [u32; 4]) -> [u32; 4] {
    let order = seed[0] ^ seed[1].rotate_left(16);
    let point = unscrambled(scramble(index, order));
    [0, 1, 2, 3].map(|i| scramble(point[i], seed[i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::pcg4d;

    /// Of 2^m points from a multiple of 2^m on, each interval of length 2^−m has one in every coordinate, and each of the
    /// m + 1 ways to cut the square into 2^m equal rectangles of powers of two gives one a rectangle in the first two.
    #[test]
    fn points_are_spread_evenly() {
        for m in [4, 9, 13] {
            let count = 1u32 << m;
            for first in [0, 5 * count] {
                let seed = pcg4d([m, first, 3, 7]);
                let points: Vec<[u32; 4]> = (first..first + count).map(|index| point(index, seed)).collect();
                let each_once = |cell: &dyn Fn(&[u32; 4]) -> u32, what: &str| {
                    let mut seen = vec![false; count as usize];
                    points.iter().for_each(|p| seen[cell(p) as usize] = true);
                    assert!(
                        seen.iter().all(|&seen| seen),
                        "2^{m} points from {first}: {what} has an empty cell"
                    );
                };
                for i in 0..4 {
                    each_once(&|p| p[i] >> (32 - m), &format!("coordinate {i}"));
                }
                for x_digits in 1..m {
                    let y_digits = m - x_digits;
                    each_once(
                        &|p| p[0] >> (32 - x_digits) << y_digits | p[1] >> (32 - y_digits),
                        &format!("2^{x_digits} × 2^{y_digits}"),
                    );
                }
            }
        }
    }

    /// Sets of four dimensions of one sequence, and sequences, are independent of each other: in a table of 16 × 16 cells
    /// the sum of (n − e)²/e over 2^14 points is χ² with 225 degrees of freedom or, of better spread points, less; above
    /// 400 with a probability of 10⁻¹¹.
    #[test]
    fn other_seeds_give_sequences_that_have_nothing_to_do_with_each_other() {
        let (a, b) = (pcg4d([1, 2, 3, 4]), pcg4d([1, 2, 3, 5]));
        for (i, j) in [(0, 0), (0, 1), (1, 2), (3, 3)] {
            let mut counts = [0.0f64; 256];
            let count = 1 << 14;
            for index in 0..count {
                counts[(point(index, a)[i] >> 28 << 4 | point(index, b)[j] >> 28) as usize] += 1.0;
            }
            let expected = f64::from(count) / 256.0;
            let chi2: f64 = counts.iter().map(|n| (n - expected).powi(2) / expected).sum();
            assert!(chi2 < 400.0, "coordinates {i} and {j} of two sequences: χ² {chi2}");
        }
    }
}
