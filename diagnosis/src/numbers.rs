//! How exact a number is, how often a step is repeated and between which numbers one is looked for: one answer each for the whole crate.

/// What is below this share of a number is not seen beside it: the root of the machine's precision, 2⁻²⁶. Sums of squares keep that much of what they are
/// made of, and a difference over a step of it is as exact as one over any (Higham 2002, Accuracy and Stability of Numerical Algorithms, §1.14).
pub(crate) const ROUNDING: f64 = 1.0 / (1_u64 << 26) as f64;

/// What no sensor of a robot resolves, as a share of what it spans: a converter of 23 bits. Without it a simulated recording, which has no noise at all, would
/// make every rounding error a finding.
pub(crate) const FINEST: f64 = 1e-7;

/// Most turns of steps of which each changes less than the one before; what is not settled then goes to and fro.
pub(crate) const TURNS: usize = 4;

/// Share from which on something is as good as all: what is left are glitches.
pub(crate) const MOSTLY: f64 = 0.9;

/// Share of a square that another column says for both to be the same.
pub(crate) const SAME: f64 = 0.99;

/// As many as are read at a glance: findings that a verdict repeats with their numbers, alternatives of one, channels that are shown first.
pub(crate) const FEW: usize = 3;

/// Bins of a variable over which something is looked at: what is in one of them is not told apart.
pub(crate) const BINS: usize = 12;

/// Shares of a step that are tried: the whole, or less where that is too far.
pub(crate) const SHARES_OF_A_STEP: [f64; 3] = [1.0, 0.5, 0.25];

/// Numbers from `least` up to `most`, each twice the one before: for what is known by its order of magnitude.
pub(crate) fn doublings(least: f64, most: f64) -> impl Iterator<Item = f64> + Clone {
    std::iter::successors(Some(least), |x| Some(2.0 * x)).take_while(move |x| *x <= most)
}
