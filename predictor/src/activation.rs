//! Hidden units: hyperbolic tangent (MATLAB's `tansig`) and logistic sigmoid (`logsig`).
//!
//! The standard library's `tanh` takes 10–20 ns and does not vectorise; 40 calls would take longer than the rest of the network.
//! Both functions here are branch-free, so that the compiler evaluates four at a time.
//!
//! # Formula
//! With 2x = k·ln 2 + r, k an integer and |r| ≤ ln 2 / 2, and the rational e^r = (Q + P) / (Q − P), P odd and Q even in r
//! (S. L. Moshier, Cephes mathematical library, 1984–2000, `exp.c`):
//!
//! tanh x = (e^2x − 1) / (e^2x + 1) = ((2^k − 1) Q + (2^k + 1) P) / ((2^k + 1) Q + (2^k − 1) P)
//!
//! The formula needs one division and has no cancellation near zero (k = 0 leaves P / Q). Unlike Cephes, it clips |x| at
//! [`SATURATION`], where tanh is 1 to within half a unit in the last place.
//!
//! # Error
//! At most [`TANH_ERROR`] relative to the true value, from the smallest normal number to saturation (tested against the
//! standard library). NaN stays NaN. The result may exceed 1 by no more than one unit in the last place.

use serde::{Deserialize, Serialize};

/// Largest relative error of this module's tanh, and largest absolute error of its logistic function.
pub const TANH_ERROR: f64 = 1.0e-15;

/// Beyond this argument tanh is 1 in double precision.
pub const SATURATION: f64 = 20.0;

/// Adding this number moves the nearest integer of a small double into its lowest mantissa bits (1.5 · 2^52).
const ROUND: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts; the first has so few digits that k times it is exact (Cephes `exp.c`, C1 and C2).
const LN_2: [f64; 2] = [6.931_457_519_531_25e-1, 1.428_606_820_309_417_3e-6];
/// Coefficients of P(r) / r in r², highest power first (Cephes `exp.c`).
const P: [f64; 3] = [1.261_771_930_748_105_8e-4, 3.029_944_077_074_419_5e-2, 1.0];
/// Coefficients of Q(r) in r², highest power first (Cephes `exp.c`).
const Q: [f64; 4] = [3.001_985_051_386_644_6e-6, 2.524_483_403_496_841e-3, 2.272_655_482_081_550_3e-1, 2.0];

/// Kind of hidden unit; output units are always linear.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Activation {
    /// tanh z, in (-1, 1).
    Tanh,
    /// 1 / (1 + e^-z), in (0, 1).
    Logistic,
}

impl Activation {
    /// Value of one unit at `z`.
    #[must_use]
    pub fn value(self, z: f64) -> f64 {
        self.lane::<false>(z)
    }

    /// Slope dy/dz as a function of the unit's value `y`.
    #[must_use]
    #[inline]
    pub fn slope(self, y: f64) -> f64 {
        match self {
            Self::Tanh => 1.0 - y * y,
            Self::Logistic => y * (1.0 - y),
        }
    }

    /// Replaces every z in `values` by the unit's value, using the widest instructions of the machine.
    pub fn apply(self, arch: pulp::Arch, values: &mut [f64]) {
        arch.dispatch(Apply { activation: self, values });
    }

    /// [`Activation::value`] for code that is compiled for a known instruction set; see [`fused`].
    #[inline(always)]
    pub(crate) fn lane<const FUSED: bool>(self, z: f64) -> f64 {
        match self {
            Self::Tanh => tanh::<FUSED>(z),
            Self::Logistic => 0.5 + 0.5 * tanh::<FUSED>(0.5 * z),
        }
    }
}

struct Apply<'a> {
    activation: Activation,
    values: &'a mut [f64],
}

impl pulp::WithSimd for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        match (self.activation, S::IS_SCALAR) {
            (Activation::Tanh, true) => self.values.iter_mut().for_each(|z| *z = tanh::<false>(*z)),
            (Activation::Tanh, false) => self.values.iter_mut().for_each(|z| *z = tanh::<true>(*z)),
            (kind, true) => self.values.iter_mut().for_each(|z| *z = kind.lane::<false>(*z)),
            (kind, false) => self.values.iter_mut().for_each(|z| *z = kind.lane::<true>(*z)),
        }
    }
}

/// a·b + c, as one instruction if the caller is compiled for a machine with fused multiply-add; without it, the standard
/// library's `mul_add` would be a slow call.
#[inline(always)]
pub(crate) fn fused<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

#[inline(always)]
fn tanh<const FUSED: bool>(x: f64) -> f64 {
    // `min` and `max` would turn NaN into a number; these comparisons keep it.
    let x = if x > SATURATION { SATURATION } else { x };
    let x = if x < -SATURATION { -SATURATION } else { x };
    let twice = x + x;
    let shifted = fused::<FUSED>(twice, std::f64::consts::LOG2_E, ROUND);
    let k = shifted - ROUND;
    let r = fused::<FUSED>(k, -LN_2[1], fused::<FUSED>(k, -LN_2[0], twice));
    // The lowest bits of `shifted` hold k; moved into the exponent and biased they give 2^k.
    let power = f64::from_bits((shifted.to_bits() << 52).wrapping_add(1.0_f64.to_bits()));
    let rr = r * r;
    let p = r * fused::<FUSED>(fused::<FUSED>(P[0], rr, P[1]), rr, P[2]);
    let q = fused::<FUSED>(fused::<FUSED>(fused::<FUSED>(Q[0], rr, Q[1]), rr, Q[2]), rr, Q[3]);
    let (less, more) = (power - 1.0, power + 1.0);
    fused::<FUSED>(less, q, more * p) / fused::<FUSED>(more, q, less * p)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arguments of all magnitudes and both signs, dense where tanh is curved and where 2^k changes.
    fn arguments() -> Vec<f64> {
        let dense = (0..400_000).map(|i| f64::from(i) * 1.0e-4 - 20.0);
        let small = (0..3000).map(|i| 10.0_f64.powf(f64::from(i) * 0.1 - 300.0));
        let steps = (1..58).flat_map(|k| {
            let x = f64::from(k) * std::f64::consts::LN_2 / 4.0;
            [x, x.next_up(), x.next_down()]
        });
        dense.chain(small).chain(steps).flat_map(|x| [x, -x]).collect()
    }

    fn worst(kind: Activation, compute: impl Fn(&mut [f64]), reference: impl Fn(f64) -> f64) -> f64 {
        let x = arguments();
        let mut y = x.clone();
        compute(&mut y);
        let error = |(x, y): (&f64, &f64)| {
            let truth = reference(*x);
            let scale = if kind == Activation::Tanh && truth != 0.0 { truth.abs() } else { 1.0 };
            (y - truth).abs() / scale
        };
        x.iter().zip(&y).map(error).fold(0.0, f64::max)
    }

    #[test]
    fn tanh_and_logistic_stay_within_their_stated_error() {
        let logistic = |x: f64| 1.0 / (1.0 + (-x).exp());
        for (kind, reference) in
            [(Activation::Tanh, f64::tanh as fn(f64) -> f64), (Activation::Logistic, logistic)]
        {
            let plain = worst(kind, |y| y.iter_mut().for_each(|z| *z = kind.value(*z)), reference);
            let vector = worst(kind, |y| kind.apply(pulp::Arch::new(), y), reference);
            eprintln!(
                "{kind:?}: largest error {plain:.1e} plain, {vector:.1e} vectorised, stated {TANH_ERROR:.1e}"
            );
            assert!(plain > 0.0, "the reference is a different computation");
            assert!(plain <= TANH_ERROR && vector <= TANH_ERROR);
        }
    }

    #[test]
    fn tanh_keeps_nan_zero_infinity_and_its_range() {
        let tanh = |x| Activation::Tanh.value(x);
        assert!(tanh(f64::NAN).is_nan());
        assert_eq!(tanh(0.0), 0.0);
        assert_eq!([tanh(f64::INFINITY), tanh(f64::NEG_INFINITY), tanh(1.0e300)], [1.0, -1.0, 1.0]);
        let largest = arguments().into_iter().map(tanh).fold(0.0, f64::max);
        assert!(largest <= 1.0_f64.next_up(), "largest value {largest:e}");
        assert_eq!(Activation::Logistic.value(f64::NEG_INFINITY), 0.0);
    }

    #[test]
    fn slopes_equal_central_differences() {
        for kind in [Activation::Tanh, Activation::Logistic] {
            for z in [-3.0, -0.4, 0.0, 0.7, 2.5] {
                let h = 1.0e-5;
                let difference = (kind.value(z + h) - kind.value(z - h)) / (2.0 * h);
                let slope = kind.slope(kind.value(z));
                assert!(
                    slope > 1.0e-3 && (slope - difference).abs() < 1.0e-9,
                    "{kind:?} at {z}: {slope} {difference}"
                );
            }
        }
    }
}
