//! Tests that the appearance of the sealed folder does not reveal the truth: a classifier on names, sizes and order has to be at chance.
//!
//! The classifier gives each case the sort of its nearest neighbours in name, sizes of its files and place in the order of names. The test compares its
//! accuracy with that for randomly permuted sorts.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::judged::Judged;
use super::nearest_neighbours::Tree;
use super::receipt::Part;
use super::truth::Sort;

/// Number of neighbours.
const NEIGHBOURS: usize = 7;
/// Number of random permutations of the sorts.
const PERMUTATIONS: usize = 400;
/// A leak is found if a smaller share of the permutations reaches the accuracy of the true sorts.
const SIGNIFICANCE: f64 = 0.005;

/// Result of a classifier on the appearance of a folder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Leak {
    /// Accuracy for the true sorts.
    pub right: f64,
    /// Mean accuracy over permuted sorts.
    pub chance: f64,
    /// Share of the permutations with at least this accuracy.
    pub p: f64,
}

impl Leak {
    /// True if the folder reveals nothing.
    pub fn is_tight(&self) -> bool {
        self.p > SIGNIFICANCE
    }

    /// The result for the cases of `part` among `cases`, which are in the order of their names, as in a receipt; `None` for too few of them.
    pub fn of(part: &Part, cases: &[Judged]) -> Option<Self> {
        let place = |name: &String| cases.binary_search_by(|case| case.name.cmp(name)).ok();
        let cases: Vec<&Judged> = part.sealed.keys().filter_map(|name| cases.get(place(name)?)).collect();
        let features: Vec<Vec<f64>> =
            cases.iter().enumerate().map(|(place, case)| features_of(part, &case.name, place)).collect();
        let sorts: Vec<Sort> = cases.iter().map(|case| case.truth.sort()).collect();
        (cases.len() > 2 * NEIGHBOURS).then(|| Self::among(&features, sorts))
    }

    fn among(features: &[Vec<f64>], mut sorts: Vec<Sort>) -> Self {
        let near = neighbours(&standardised(features));
        let right = accuracy(&near, &sorts);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let accuracies: Vec<f64> = (0..PERMUTATIONS)
            .map(|_| {
                sorts.shuffle(&mut rng);
                accuracy(&near, &sorts)
            })
            .collect();
        let as_good = accuracies.iter().filter(|accuracy| **accuracy >= right).count();
        let chance = accuracies.iter().sum::<f64>() / PERMUTATIONS as f64;
        Self { right, chance, p: (as_good + 1) as f64 / (PERMUTATIONS + 1) as f64 }
    }
}

/// The features of a case that are visible without opening its files.
fn features_of(part: &Part, name: &str, place: usize) -> Vec<f64> {
    let number = u64::from_str_radix(name, 16).unwrap_or_default() as f64;
    let sizes =
        part.sealed.get(name).into_iter().flat_map(|files| files.values().map(|file| file.bytes as f64));
    [number, place as f64].into_iter().chain(sizes.map(f64::ln_1p)).collect()
}

/// Each column scaled to mean 0 and standard deviation 1.
fn standardised(features: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let width = features.iter().map(Vec::len).min().unwrap_or(0);
    let n = features.len() as f64;
    let mut standardised = vec![vec![0.0; width]; features.len()];
    for column in 0..width {
        let mean = features.iter().map(|row| row[column]).sum::<f64>() / n;
        let square = features.iter().map(|row| (row[column] - mean).powi(2)).sum::<f64>() / n;
        for (to, from) in standardised.iter_mut().zip(features) {
            to[column] = (from[column] - mean) / square.sqrt().max(1e-12);
        }
    }
    standardised
}

/// The nearest others of each.
fn neighbours(features: &[Vec<f64>]) -> Vec<Vec<usize>> {
    let tree = Tree::new(features);
    (0..features.len()).map(|at| tree.nearest(at, NEIGHBOURS)).collect()
}

/// Accuracy of the commonest sort among the neighbours.
fn accuracy(near: &[Vec<usize>], sorts: &[Sort]) -> f64 {
    let right = near.iter().zip(sorts).filter(|(near, sort)| {
        let count = |sort: Sort| near.iter().filter(|other| sorts[**other] == sort).count();
        Sort::ALL.into_iter().max_by_key(|sort| count(*sort)) == Some(**sort)
    });
    right.count() as f64 / sorts.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::Leak;
    use crate::blind::truth::Sort;

    /// The classifier detects a leak, a size that depends on the sort, and reports none without one.
    #[test]
    fn a_leak_is_found_where_there_is_one() {
        let sorts: Vec<Sort> = (0..200).map(|k| Sort::ALL[[0, 1, 1, 1, 2, 3][k % 6]]).collect();
        let features = |leaks: bool| -> Vec<Vec<f64>> {
            let size = |k: usize| (k * 7919 % 200) as f64 * 0.01;
            (0..200)
                .map(|k| vec![size(k), if leaks { sorts[k] as u8 as f64 + size(k) } else { size(k * 31) }])
                .collect()
        };
        let (leaking, tight) =
            (Leak::among(&features(true), sorts.clone()), Leak::among(&features(false), sorts.clone()));
        println!("leaking {leaking:?}, tight {tight:?}");
        assert!(!leaking.is_tight() && leaking.right > 0.6);
        assert!(tight.is_tight() && tight.right < 0.6);
    }
}
