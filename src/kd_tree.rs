//! A k-d tree of points, to find those near a position.

use std::collections::BinaryHeap;

/// Maximum number of points in a leaf.
const LEAF: usize = 12;
/// Minimum number of points in a part for a parallel task.
const TASK: usize = 1 << 14;

/// A k-d tree of points. Each part of [`KdTree::points`] is split at its median, along its longest axis.
pub struct KdTree {
    /// Position and index of each point.
    points: Vec<([f32; 3], u32)>,
    /// The axis of the split at each median.
    axes: Vec<u8>,
}

impl KdTree {
    /// A tree of points with their indices.
    pub fn new(positions: &[[f32; 3]]) -> Self {
        let mut points: Vec<_> = positions.iter().copied().zip(0..).collect();
        let mut axes = vec![0; points.len()];
        part(&mut points, &mut axes);
        Self { points, axes }
    }

    /// Calls `visit` with the index of each point whose squared distance is no more than `radius2`.
    pub fn within(&self, centre: [f32; 3], radius2: f32, visit: &mut (impl FnMut(usize) + ?Sized)) {
        self.search(0, self.points.len(), centre, &mut |distance2, index| {
            if distance2 <= radius2 {
                visit(index as usize);
            }
            radius2
        });
    }

    /// Squared distances and indices of the `count` nearest points, in ascending order.
    pub fn nearest(&self, centre: [f32; 3], count: usize) -> Vec<(f32, usize)> {
        // Positive floats are ordered like their bits.
        let mut found: BinaryHeap<(u32, u32)> = BinaryHeap::with_capacity(count + 1);
        self.search(0, self.points.len(), centre, &mut |distance2, index| {
            found.push((distance2.to_bits(), index));
            if found.len() > count {
                found.pop();
            }
            match found.peek() {
                Some((bits, _)) if found.len() == count => f32::from_bits(*bits),
                _ => f32::INFINITY,
            }
        });
        let sorted = found.into_sorted_vec().into_iter();
        sorted
            .map(|(bits, index)| (f32::from_bits(bits), index as usize))
            .collect()
    }

    /// Calls `see` with the squared distance and the index of points of a part; it returns the maximum squared distance of
    /// further points.
    fn search(&self, begin: usize, end: usize, centre: [f32; 3], see: &mut impl FnMut(f32, u32) -> f32) {
        if end - begin <= LEAF {
            for (position, index) in &self.points[begin..end] {
                see(distance2(centre, *position), *index);
            }
            return;
        }
        let middle = begin + (end - begin) / 2;
        let axis = usize::from(self.axes[middle]);
        let (position, index) = self.points[middle];
        let beyond = centre[axis] - position[axis];
        let [near, far] = if beyond < 0.0 {
            [(begin, middle), (middle + 1, end)]
        } else {
            [(middle + 1, end), (begin, middle)]
        };
        self.search(near.0, near.1, centre, see);
        if beyond * beyond <= see(distance2(centre, position), index) {
            self.search(far.0, far.1, centre, see);
        }
    }
}

fn distance2(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

/// Orders the points of a part, recursively.
fn part(points: &mut [([f32; 3], u32)], axes: &mut [u8]) {
    if points.len() <= LEAF {
        return;
    }
    let middle = points.len() / 2;
    let (mut least, mut most) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (position, _) in &*points {
        for axis in 0..3 {
            least[axis] = least[axis].min(position[axis]);
            most[axis] = most[axis].max(position[axis]);
        }
    }
    let length = |axis: usize| most[axis] - least[axis];
    let axis = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
    points.select_nth_unstable_by(middle, |(a, _), (b, _)| a[axis].total_cmp(&b[axis]));
    axes[middle] = axis as u8;
    let large = points.len() > TASK;
    let (before, rest) = points.split_at_mut(middle);
    let (axes_before, axes_rest) = axes.split_at_mut(middle);
    let after = &mut rest[1..];
    let axes_after = &mut axes_rest[1..];
    if large {
        rayon::join(|| part(before, axes_before), || part(after, axes_after));
    } else {
        part(before, axes_before);
        part(after, axes_after);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::pcg4d;

    /// Points in a cube, some of them in the same places.
    fn points(count: u32) -> Vec<[f32; 3]> {
        let place = |index: u32| {
            let words = pcg4d([index % (count - count / 8), 1, 2, 3]);
            [0, 1, 2].map(|axis| (words[axis] >> 8) as f32 / (1 << 24) as f32)
        };
        (0..count).map(place).collect()
    }

    #[test]
    fn what_is_found_is_what_looking_at_all_points_finds() {
        for count in [1, 12, 13, 1000, 40_000] {
            let points = points(count);
            let tree = KdTree::new(&points);
            for (centre, radius2) in [
                ([0.5; 3], 0.01),
                ([0.1, 0.9, 0.3], 1e-4),
                ([2.0, 0.5, 0.5], 1.1),
                (points[0], 0.0),
            ] {
                let mut found = Vec::new();
                tree.within(centre, radius2, &mut |index| found.push(index));
                found.sort_unstable();
                let near = |index: &usize| distance2(centre, points[*index]) <= radius2;
                let expected: Vec<usize> = (0..points.len()).filter(near).collect();
                assert_eq!(found, expected, "{count} points, {centre:?}, {radius2}");

                let wanted = 7.min(points.len());
                let distances: Vec<f32> = tree.nearest(centre, wanted).into_iter().map(|(d2, _)| d2).collect();
                let mut all: Vec<f32> = points.iter().map(|&point| distance2(centre, point)).collect();
                all.sort_by(f32::total_cmp);
                assert_eq!(distances, all[..wanted], "{count} points near {centre:?}");
            }
        }
    }

    #[test]
    fn no_points_are_found_where_there_are_none() {
        let tree = KdTree::new(&[]);
        tree.within([0.0; 3], 1.0, &mut |_| panic!("nothing is there"));
        assert_eq!(tree.nearest([0.0; 3], 3), []);
    }
}
