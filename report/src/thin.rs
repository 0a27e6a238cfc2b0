//! Fewer points, every peak kept.

/// Points of all charts of a document together; at most about 20 bytes each in the file.
pub(crate) const MOST_IN_DOCUMENT: usize = 230_000;
/// Points of one series, if the document has room for them.
pub(crate) const MOST_IN_SERIES: usize = 12_000;
/// Least number of points of one series, however many series there are.
pub(crate) const LEAST_IN_SERIES: usize = 400;

/// At most `most` points (but at least five) of the curve y(x), with every peak kept.
///
/// The points are split into runs of equal length. The result has the lowest and the highest point of each run, the first gap (y not finite) of a run with
/// gaps, and the first and the last point of all. So the curve has the same minimum and maximum within each run, and no gap is closed. `x` must be ascending;
/// of unequal lengths the surplus is ignored.
#[must_use]
pub fn thin(x: &[f64], y: &[f64], most: usize) -> (Vec<f64>, Vec<f64>) {
    let length = x.len().min(y.len());
    let kept = extremes(&[&y[..length]], most);
    (pick(x, &kept), pick(y, &kept))
}

/// The values at these indices.
pub(crate) fn pick(values: &[f64], positions: &[usize]) -> Vec<f64> {
    positions.iter().map(|&i| values[i]).collect()
}

/// Indices, ascending, of at most `most` points that keep first, last and, in each run, the extremes of every coordinate. All coordinates have the same length.
pub(crate) fn extremes(coordinates: &[&[f64]], most: usize) -> Vec<usize> {
    let length = coordinates.first().map_or(0, |values| values.len());
    if length <= most {
        return (0..length).collect();
    }
    let is_gap = |i: usize| coordinates.iter().any(|values| !values[i].is_finite());
    let per_run = 2 * coordinates.len() + usize::from((0..length).any(is_gap));
    let runs = (most.saturating_sub(2) / per_run).max(1);
    let mut kept = vec![0, length - 1];
    for run in 0..runs {
        let range = run * length / runs..(run + 1) * length / runs;
        kept.extend(range.clone().find(|&i| is_gap(i)));
        for values in coordinates {
            let drawn = || range.clone().filter(|&i| !is_gap(i));
            kept.extend(drawn().min_by(|&a, &b| values[a].total_cmp(&values[b])));
            kept.extend(drawn().max_by(|&a, &b| values[a].total_cmp(&values[b])));
        }
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

/// Indices, ascending, of at most `most` points of a cloud (but at least eight): every n-th, so that dense parts stay dense, and the extremes of both
/// coordinates.
pub(crate) fn spread(x: &[f64], y: &[f64], most: usize) -> Vec<usize> {
    let length = x.len().min(y.len());
    if length <= most {
        return (0..length).collect();
    }
    let mut kept = extremes(&[&x[..length], &y[..length]], 0);
    let stride = length.div_ceil(most.saturating_sub(kept.len()).max(1));
    kept.extend((0..length).step_by(stride));
    kept.sort_unstable();
    kept.dedup();
    kept
}

#[cfg(test)]
mod tests {
    use super::{extremes, spread, thin};

    /// 12 s at 1 kHz: a slow wave, one spike of one sample and one of the other sign.
    fn wave() -> (Vec<f64>, Vec<f64>) {
        let x: Vec<f64> = (0..12_000).map(|i| f64::from(i) * 1e-3).collect();
        let mut y: Vec<f64> = x.iter().map(|t| t.sin()).collect();
        y[7_001] = 9.0;
        y[3_333] = -8.0;
        (x, y)
    }

    #[test]
    fn peaks_survive_and_the_count_holds() {
        let (x, y) = wave();
        assert!(!y.iter().step_by(12).any(|&v| v == 9.0), "every twelfth point alone would lose the spike");
        let (thin_x, thin_y) = thin(&x, &y, 1_000);
        println!("{} of {} points kept, at most 1000", thin_y.len(), y.len());
        assert!(thin_y.len() <= 1_000 && thin_y.len() > 900);
        assert_eq!(thin_x.len(), thin_y.len());
        assert!(thin_y.contains(&9.0) && thin_y.contains(&-8.0));
        assert!(thin_x.windows(2).all(|w| w[0] < w[1]));
        assert_eq!((thin_x[0], thin_x[thin_x.len() - 1]), (x[0], x[x.len() - 1]));
    }

    #[test]
    fn each_run_keeps_its_extremes() {
        let (_, y) = wave();
        let kept = extremes(&[&y], 102);
        let runs = 50;
        for run in 0..runs {
            let range = run * y.len() / runs..(run + 1) * y.len() / runs;
            let highest =
                |values: &mut dyn Iterator<Item = usize>| values.map(|i| y[i]).fold(f64::MIN, f64::max);
            let before = highest(&mut range.clone());
            let after = highest(&mut kept.iter().copied().filter(|i| range.contains(i)));
            assert_eq!(before, after, "run {run}");
        }
    }

    #[test]
    fn gaps_stay_gaps() {
        let (x, mut y) = wave();
        y[5_000..5_010].fill(f64::NAN);
        y[6_000] = f64::INFINITY;
        let (thin_x, thin_y) = thin(&x, &y, 500);
        assert!(thin_y.len() <= 500);
        for at in [5.0, 6.0] {
            let gap = thin_x.iter().zip(&thin_y).any(|(t, v)| (t - at).abs() < 0.01 && !v.is_finite());
            assert!(gap, "the gap at {at} s is closed");
        }
        assert!(thin_y.contains(&9.0));
    }

    #[test]
    fn short_and_odd_input_is_left_alone() {
        assert_eq!(thin(&[], &[], 10), (vec![], vec![]));
        assert_eq!(thin(&[1.0], &[2.0], 10), (vec![1.0], vec![2.0]));
        assert_eq!(thin(&[1.0, 2.0, 3.0], &[5.0], 10), (vec![1.0], vec![5.0]));
        let nothing = vec![f64::NAN; 100];
        assert_eq!(thin(&nothing, &nothing, 10).0.len(), 3, "both ends, and the gap of the second run");
        assert!(thin(&wave().0, &wave().1, 0).0.len() <= 5);
    }

    #[test]
    fn a_cloud_keeps_its_outliers_and_its_density() {
        let (x, y) = wave();
        let kept = spread(&x, &y, 600);
        assert!(kept.len() <= 600, "{}", kept.len());
        assert!(kept.contains(&7_001) && kept.contains(&3_333));
        let left = kept.iter().filter(|&&i| i < 6_000).count();
        println!("{left} of {} points in the left half", kept.len());
        assert!((left as f64 / kept.len() as f64 - 0.5).abs() < 0.02);
    }
}
