//! A signal at three ticks, and its derivatives at the one in the middle.

use crate::compensation::Motion;

/// The values of a signal at the ticks j − 1, j and j + 1; velocity and acceleration at j are the centred differences.
#[derive(Clone, Debug)]
pub struct Centred {
    period: f64,
    older: Vec<f64>,
    middle: Vec<f64>,
    newest: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    /// Values pushed since [`Centred::clear`], up to three.
    known: usize,
}

impl Centred {
    /// A signal of `width` numbers, at rest at zero, in ticks of `period` seconds.
    pub fn new(width: usize, period: f64) -> Centred {
        let zeros = vec![0.0; width];
        Centred {
            period,
            older: zeros.clone(),
            middle: zeros.clone(),
            newest: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros,
            known: 3,
        }
    }

    /// Is at rest at `values` from now on, and has been before.
    pub fn rest(&mut self, values: &[f64]) {
        self.known = 0;
        self.push(values);
        self.known = 3;
    }

    /// Forgets the past: the next value counts for all three ticks, and there are no derivatives before three values are known.
    pub fn clear(&mut self) {
        self.known = 0;
    }

    /// Moves on by one tick to the newest value.
    pub fn push(&mut self, values: &[f64]) {
        self.known = (self.known + 1).min(3);
        if self.known == 1 {
            self.middle.copy_from_slice(values);
            self.newest.copy_from_slice(values);
        }
        std::mem::swap(&mut self.older, &mut self.middle);
        std::mem::swap(&mut self.middle, &mut self.newest);
        self.newest.copy_from_slice(values);
        let derivatives = if self.known == 3 { 1.0 / self.period } else { 0.0 };
        for (i, &newest) in self.newest.iter().enumerate() {
            let (older, middle) = (self.older[i], self.middle[i]);
            self.velocity[i] = 0.5 * (newest - older) * derivatives;
            self.acceleration[i] = (newest - 2.0 * middle + older) * derivatives * derivatives;
        }
    }

    /// The newest value.
    pub fn newest(&self) -> &[f64] {
        &self.newest
    }

    /// Value and derivatives at the tick in the middle.
    pub fn motion(&self) -> Motion<'_> {
        Motion { q: &self.middle, v: &self.velocity, a: &self.acceleration }
    }
}
