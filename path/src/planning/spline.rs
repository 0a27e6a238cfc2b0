//! Cubic spline through rows of numbers.
//!
//! Source: de Boor (1978), *A Practical Guide to Splines*, ch. IV: the interpolant with two continuous derivatives.
//! With natural ends it is exact for straight lines and of order h⁴ inside; within a few rows of an end whose true
//! second derivative is not zero the order falls to h². With not-a-knot ends it is exact for cubics.

/// A curve of `columns` values over time, piecewise cubic, with two continuous derivatives.
#[derive(Clone, Debug)]
pub(crate) struct Spline {
    columns: usize,
    times: Vec<f64>,
    values: Vec<f64>,
    /// Second derivatives at the knots, laid out as `values`.
    curvature: Vec<f64>,
}

/// The end conditions of a spline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ends {
    /// The second derivative is zero.
    Natural,
    /// The third derivative is continuous at the second and at the penultimate knot.
    NotAKnot,
}

impl Spline {
    /// Fits the rows `values` (row-major, `columns` wide) at the strictly increasing `times`: at least two, or four
    /// for [`Ends::NotAKnot`].
    pub fn through(columns: usize, times: Vec<f64>, values: Vec<f64>, ends: Ends) -> Spline {
        let rows = times.len();
        let step = |i: usize| times[i + 1] - times[i];
        let mut curvature = vec![0.0; rows * columns];
        let mut upper = vec![0.0; rows];
        // Thomas elimination; the first and last row already include the end conditions.
        for i in 1..rows - 1 {
            let (before, after) = (step(i - 1), step(i));
            let (mut below, mut middle, mut above) = (before, 2.0 * (before + after), after);
            if ends == Ends::NotAKnot && i == 1 {
                (middle, above) =
                    (middle + before * (before + after) / after, above - before * before / after);
            }
            if ends == Ends::NotAKnot && i == rows - 2 {
                (middle, below) =
                    (middle + after * (before + after) / before, below - after * after / before);
            }
            let pivot = middle - if i == 1 { 0.0 } else { below * upper[i - 1] };
            upper[i] = if i == rows - 2 { 0.0 } else { above / pivot };
            for c in 0..columns {
                let (k, previous, next) = (i * columns + c, (i - 1) * columns + c, (i + 1) * columns + c);
                let slopes = (values[next] - values[k]) / after - (values[k] - values[previous]) / before;
                let carried = if i == 1 { 0.0 } else { below * curvature[previous] };
                curvature[k] = (6.0 * slopes - carried) / pivot;
            }
        }
        for i in (1..rows - 1).rev() {
            for c in 0..columns {
                curvature[i * columns + c] -= upper[i] * curvature[(i + 1) * columns + c];
            }
        }
        if ends == Ends::NotAKnot {
            for c in 0..columns {
                let m = |i: usize| curvature[i * columns + c];
                let first = m(1) + (m(1) - m(2)) * step(0) / step(1);
                let last = m(rows - 2) + (m(rows - 2) - m(rows - 3)) * step(rows - 2) / step(rows - 3);
                curvature[c] = first;
                curvature[(rows - 1) * columns + c] = last;
            }
        }
        Spline { columns, times, values, curvature }
    }

    /// The knots, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Value and two derivatives of `column` at time `t`, by the polynomial of interval `piece`.
    pub fn evaluate(&self, piece: usize, column: usize, t: f64) -> [f64; 3] {
        let (i, j) = (piece * self.columns + column, (piece + 1) * self.columns + column);
        let h = self.times[piece + 1] - self.times[piece];
        let u = t - self.times[piece];
        let (m0, m1) = (self.curvature[i], self.curvature[j]);
        let slope = (self.values[j] - self.values[i]) / h - h * (2.0 * m0 + m1) / 6.0;
        let jerk = (m1 - m0) / h;
        [
            self.values[i] + u * (slope + u * (m0 / 2.0 + u * jerk / 6.0)),
            slope + u * (m0 + u * jerk / 2.0),
            m0 + u * jerk,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::{Ends, Spline};

    /// Uneven knots on [0, 2π]: the second derivative of sin is zero at both ends, so that the natural spline has full order.
    fn sine_errors(rows: usize) -> [f64; 3] {
        let span = 2.0 * std::f64::consts::PI;
        let times: Vec<f64> = (0..=rows)
            .map(|k| k as f64 / rows as f64)
            .map(|s| span * (s + 0.02 * (2.0 * span * s).sin()))
            .collect();
        let values = times.iter().flat_map(|t| [t.sin(), 2.0 - 3.0 * t]).collect();
        let spline = Spline::through(2, times, values, Ends::Natural);
        let mut errors = [0.0_f64; 3];
        for piece in 0..rows {
            let (t0, t1) = (spline.times()[piece], spline.times()[piece + 1]);
            for u in [0.0, 0.3, 0.5, 0.8, 1.0] {
                let t = t0 + u * (t1 - t0);
                let found = spline.evaluate(piece, 0, t);
                for (error, (a, b)) in errors.iter_mut().zip(found.iter().zip([t.sin(), t.cos(), -t.sin()])) {
                    *error = error.max((a - b).abs());
                }
                let line = spline.evaluate(piece, 1, t);
                assert!((line[0] - (2.0 - 3.0 * t)).abs() < 1e-12 && (line[1] + 3.0).abs() < 1e-11);
            }
        }
        errors
    }

    #[test]
    fn converges_to_a_sine_with_the_orders_of_de_boor() {
        let (coarse, fine) = (sine_errors(40), sine_errors(80));
        for (k, order) in [4.0, 3.0, 2.0].into_iter().enumerate() {
            let found = (coarse[k] / fine[k]).log2();
            println!(
                "derivative {k}: errors {:.2e}, {:.2e}; order {found:.2}, expected {order}",
                coarse[k], fine[k]
            );
            assert!(coarse[k] > 1e-8, "the coarse spline must err, or nothing is tested");
            assert!((found - order).abs() < 0.35);
        }
    }

    #[test]
    fn not_a_knot_ends_reproduce_a_cubic() {
        let cubic = |t: f64| {
            [1.0 - 2.0 * t + 3.0 * t * t - 0.5 * t.powi(3), -2.0 + 6.0 * t - 1.5 * t * t, 6.0 - 3.0 * t]
        };
        for times in [vec![0.0, 0.3, 0.5, 1.2], vec![-1.0, 0.0, 0.2, 1.0, 1.5, 3.0]] {
            let values = times.iter().map(|&t| cubic(t)[0]).collect();
            let spline = Spline::through(1, times.clone(), values, Ends::NotAKnot);
            for (piece, ends) in times.windows(2).enumerate() {
                let t = 0.4 * ends[0] + 0.6 * ends[1];
                for (found, expected) in spline.evaluate(piece, 0, t).into_iter().zip(cubic(t)) {
                    println!("margin {:.1e} of 1e-12", (found - expected).abs());
                    assert!((found - expected).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn neighbours_agree_in_two_derivatives() {
        let times = vec![0.0, 0.1, 0.9, 1.0, 3.0];
        let spline = Spline::through(1, times.clone(), vec![1.0, -2.0, 4.0, 0.0, 0.5], Ends::Natural);
        let mut worst = 0.0_f64;
        for (knot, &t) in times.iter().enumerate().take(4).skip(1) {
            let (left, right) = (spline.evaluate(knot - 1, 0, t), spline.evaluate(knot, 0, t));
            assert!(
                right[2].abs() > 0.1,
                "a kink in the third derivative only shows where the second is not zero"
            );
            worst = (0..3).fold(worst, |w, k| w.max((left[k] - right[k]).abs() / (1.0 + right[k].abs())));
        }
        println!("worst jump at a knot {worst:.1e}, allowed 1e-12");
        assert!(worst < 1e-12);
        assert_eq!(spline.evaluate(0, 0, 0.0)[2], 0.0);
    }
}
