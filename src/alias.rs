//! The alias method: Vose, «A Linear Algorithm For Generating Random Numbers With a Given Distribution», IEEE Transactions
//! on Software Engineering 17(9), 1991. `glsl/lights/alias_table.glsl` chooses in the same way.

/// A cell of the table, which has one cell for each item.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AliasCell {
    /// The part of the cell that chooses the cell's own index.
    pub accept: f32,
    /// The index that the rest of it chooses.
    pub alias: u32,
}

/// The table for probabilities whose sum is 1.
pub fn alias_table(probabilities: &[f64]) -> Vec<AliasCell> {
    let count = probabilities.len() as f64;
    // The remainder of each probability to be put into cells, whose width is 1.
    let mut left: Vec<f64> = probabilities.iter().map(|probability| probability * count).collect();
    let own = |alias| AliasCell { accept: 1.0, alias };
    let mut cells: Vec<AliasCell> = (0..probabilities.len() as u32).map(own).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..left.len()).partition(|&i| left[i] < 1.0);
    // Remainders of rounding fill their own cells.
    while let (Some(&donor), Some(cell)) = (large.last(), small.pop()) {
        cells[cell] = AliasCell {
            accept: left[cell] as f32,
            alias: donor as u32,
        };
        left[donor] -= 1.0 - left[cell];
        if left[donor] < 1.0 {
            large.pop();
            small.push(donor);
        }
    }
    cells
}

/// The chosen index, and the remainder of the number that chose it, uniform in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// The index.
    pub index: usize,
    /// The remainder.
    pub rest: f64,
}

/// Chooses one of `count` items, whose cells `cell` returns, with the digits of `u` in [0, 1) and of two lower numbers, multiples
/// of 2⁻²⁴ each.
pub fn choose(count: usize, u: f64, digits: [f64; 2], cell: impl Fn(usize) -> AliasCell) -> Choice {
    let [first, second, third] = [u, digits[0], digits[1]].map(|number| (number * f64::from(1 << 24)) as u64);
    // A fraction of 64 bits times the number of cells.
    let fraction = first << 40 | second << 16 | third >> 8;
    let product = u128::from(fraction) * count as u128;
    let index = (product >> 64) as usize;
    let within = (product as u64) as f64 / 2f64.powi(64);
    let AliasCell { accept, alias } = cell(index);
    let accept = f64::from(accept);
    if within < accept || accept >= 1.0 {
        return Choice {
            index,
            rest: (within / accept).min(1.0),
        };
    }
    Choice {
        index: alias as usize,
        rest: ((within - accept) / (1.0 - accept)).min(1.0),
    }
}
