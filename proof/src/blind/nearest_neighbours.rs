//! The nearest neighbours among many points, by a k-d tree (Bentley 1975): searching for all points takes n log n, comparing all pairs n².

/// Points of a leaf.
const LEAF: usize = 16;

/// Points, repeatedly divided along their longest side.
pub struct Tree<'a> {
    points: &'a [Vec<f64>],
    root: Node,
}

enum Node {
    Leaf(Vec<usize>),
    /// Points with a coordinate up to `at` along `axis` are in the first half, those with at least `at` in the second.
    Split {
        axis: usize,
        at: f64,
        halves: Box<[Node; 2]>,
    },
}

impl<'a> Tree<'a> {
    /// A tree of `points`, all of one length.
    pub fn new(points: &'a [Vec<f64>]) -> Self {
        let mut indices: Vec<usize> = (0..points.len()).collect();
        Self { points, root: Node::of(points, &mut indices) }
    }

    /// The `count` points nearest to the one at `index`, without it: the nearest first, with equal distances in the order of `points`.
    pub fn nearest(&self, index: usize, count: usize) -> Vec<usize> {
        let mut found = Found { near: Vec::with_capacity(count + 1), count };
        self.visit(&self.root, index, &mut found);
        found.near.into_iter().map(|(_, other)| other).collect()
    }

    fn visit(&self, node: &Node, index: usize, found: &mut Found) {
        let point = &self.points[index];
        match node {
            Node::Leaf(indices) => {
                for other in indices.iter().copied().filter(|other| *other != index) {
                    let distance = point.iter().zip(&self.points[other]).map(|(x, y)| (x - y).powi(2)).sum();
                    found.offer(distance, other);
                }
            }
            Node::Split { axis, at, halves } => {
                let gap = point[*axis] - at;
                let [near, far] = if gap < 0.0 { [&halves[0], &halves[1]] } else { [&halves[1], &halves[0]] };
                self.visit(near, index, found);
                // An equal distance counts, too: the point may come first in the order.
                if found.farthest().is_none_or(|farthest| gap * gap <= farthest) {
                    self.visit(far, index, found);
                }
            }
        }
    }
}

impl Node {
    fn of(points: &[Vec<f64>], indices: &mut [usize]) -> Self {
        let width = indices.first().map_or(0, |index| points[*index].len());
        let side = |axis: usize| {
            let values = || indices.iter().map(|index| points[*index][axis]);
            values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
        };
        let longest = (0..width).max_by(|a, b| side(*a).total_cmp(&side(*b)));
        match longest {
            Some(axis) if indices.len() > LEAF => {
                let middle = indices.len() / 2;
                indices.select_nth_unstable_by(middle, |a, b| points[*a][axis].total_cmp(&points[*b][axis]));
                let at = points[indices[middle]][axis];
                let (below, above) = indices.split_at_mut(middle);
                Node::Split { axis, at, halves: Box::new([Node::of(points, below), Node::of(points, above)]) }
            }
            _ => Node::Leaf(indices.to_vec()),
        }
    }
}

/// The nearest points so far, with the squares of their distances.
struct Found {
    near: Vec<(f64, usize)>,
    count: usize,
}

impl Found {
    fn farthest(&self) -> Option<f64> {
        (self.near.len() == self.count).then(|| self.near.last().map(|(distance, _)| *distance)).flatten()
    }

    fn offer(&mut self, distance: f64, other: usize) {
        let place = self.near.partition_point(|held| (held.0, held.1) < (distance, other));
        self.near.insert(place, (distance, other));
        self.near.truncate(self.count);
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::Tree;

    /// The tree and the comparison of all pairs find the same points in the same order, also with equal coordinates.
    #[test]
    fn the_nearest_are_those_of_all_pairs() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for count in [1, 7, 40, 300] {
            let mut coordinate = || f64::from(rng.random_range(0_i32..20)) * 0.25;
            let points: Vec<Vec<f64>> =
                (0..count).map(|_| vec![coordinate(), coordinate(), coordinate()]).collect();
            let tree = Tree::new(&points);
            for index in 0..count {
                let distance = |other: usize| -> f64 {
                    points[index].iter().zip(&points[other]).map(|(x, y)| (x - y).powi(2)).sum()
                };
                let mut all: Vec<usize> = (0..count).filter(|other| *other != index).collect();
                all.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)).then(a.cmp(b)));
                all.truncate(7);
                assert_eq!(tree.nearest(index, 7), all, "point {index} of {count}");
            }
        }
    }
}
