//! Shares and medians with their 95 % intervals.

use serde::Serialize;

/// The normal quantile of 97.5 %.
const Z: f64 = 1.959_964;

/// A count out of a total, with its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Share {
    /// The count.
    pub count: usize,
    /// The total.
    pub of: usize,
    /// Bounds of the share at 95 %, 0 to 1.
    pub ci95: [f64; 2],
}

impl Share {
    /// `count` out of `of`: Wilson (1927); for all or none, the exact bound of Clopper & Pearson (1934), which has a closed form there.
    pub fn new(count: usize, of: usize) -> Self {
        let n = of as f64;
        let ci95 = if of == 0 {
            [0.0, 1.0]
        } else if count == 0 {
            [0.0, 1.0 - 0.025_f64.powf(1.0 / n)]
        } else if count == of {
            [0.025_f64.powf(1.0 / n), 1.0]
        } else {
            let p = count as f64 / n;
            let middle = p + Z * Z / (2.0 * n);
            let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
            [middle - half, middle + half].map(|x| x / (1.0 + Z * Z / n))
        };
        Self { count, of, ci95 }
    }

    /// Counts the `items` with `is`.
    pub fn among<T>(items: impl Iterator<Item = T>, is: impl Fn(&T) -> bool) -> Self {
        let (mut count, mut of) = (0, 0);
        for item in items {
            of += 1;
            count += usize::from(is(&item));
        }
        Self::new(count, of)
    }

    /// The share, 0 to 1; NaN for a total of zero.
    pub fn value(&self) -> f64 {
        self.count as f64 / self.of as f64
    }
}

/// A median with the 95 % interval of the order statistics, which assumes no distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Median {
    /// The median.
    pub value: f64,
    /// Its interval.
    pub ci95: [f64; 2],
    /// Number of values.
    pub of: usize,
}

impl Median {
    /// The median of `values`; `None` without values.
    pub fn new(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let n = values.len();
        let half = 0.5 * Z * (n as f64).sqrt();
        let at = |place: f64| values[(place.max(0.0) as usize).min(n - 1)];
        (n > 0).then(|| {
            let (low, high) = (0.5 * n as f64 - half, 0.5 * n as f64 + half);
            let value = 0.5 * (values[(n - 1) / 2] + values[n / 2]);
            Self { value, ci95: [at(low.floor()), at(high.ceil())], of: n }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Median, Share};

    /// Wilson's interval of 8 in 10 is 0.490 to 0.943 (Brown, Cai & DasGupta 2001); the exact upper bound for none of 300 is 1.22 %.
    #[test]
    fn intervals_are_those_of_the_books() {
        let some = Share::new(8, 10).ci95;
        println!("8 of 10: {some:?}; 0 of 300: {:?}", Share::new(0, 300).ci95);
        assert!((some[0] - 0.490).abs() < 5e-4 && (some[1] - 0.943).abs() < 5e-4);
        assert!((Share::new(0, 300).ci95[1] - 0.01222).abs() < 1e-5);
        assert_eq!(Share::new(0, 0).ci95, [0.0, 1.0]);
        assert!((Share::new(7, 7).ci95[0] - 0.5904).abs() < 1e-4);
    }

    /// For 100 numbers the interval is from about the 40th to the 61st.
    #[test]
    fn a_median_lies_inside_its_interval() {
        let median = Median::new((1..=100).map(f64::from).collect()).expect("a median");
        println!("{median:?}");
        assert_eq!(median.value, 50.5);
        assert!((median.ci95[0] - 41.0).abs() < 1.5 && (median.ci95[1] - 61.0).abs() < 1.5);
        assert!(Median::new(Vec::new()).is_none());
    }
}
