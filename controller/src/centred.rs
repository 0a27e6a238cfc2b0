//! A signal at four ticks: its derivatives at the second, and the value to hold from there to the third.

use crate::compensation::Motion;

/// The values of a signal at the ticks j − 1, j, j + 1 and j + 2.
///
/// Velocity and acceleration at j are the centred differences. A value held from j to j + 1 (a torque) has to give the mean
/// acceleration of that tick, which leads from the velocity at j to that at j + 1; the acceleration at j would be late by half a tick.
#[derive(Clone, Debug)]
pub struct Centred {
    period: f64,
    older: Vec<f64>,
    middle: Vec<f64>,
    next: Vec<f64>,
    newest: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    held: Vec<f64>,
    /// Values pushed since [`Centred::clear`], up to four.
    known: usize,
}

/// Number of stored values.
const KEPT: usize = 4;

impl Centred {
    /// Creates a signal of `width` channels, at rest at zero, in ticks of `period` seconds.
    pub fn new(width: usize, period: f64) -> Centred {
        let zeros = vec![0.0; width];
        Centred {
            period,
            older: zeros.clone(),
            middle: zeros.clone(),
            next: zeros.clone(),
            newest: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros.clone(),
            held: zeros,
            known: KEPT,
        }
    }

    /// Sets the signal to rest at `values`, now and in the past.
    pub fn rest(&mut self, values: &[f64]) {
        self.known = 0;
        self.push(values);
        self.known = KEPT;
    }

    /// Clears the past: the next value fills all ticks, and there are no derivatives before four values are known.
    pub fn clear(&mut self) {
        self.known = 0;
    }

    /// Advances by one tick to the newest value.
    pub fn push(&mut self, values: &[f64]) {
        self.known = (self.known + 1).min(KEPT);
        if self.known == 1 {
            self.middle.copy_from_slice(values);
            self.next.copy_from_slice(values);
            self.newest.copy_from_slice(values);
        }
        std::mem::swap(&mut self.older, &mut self.middle);
        std::mem::swap(&mut self.middle, &mut self.next);
        std::mem::swap(&mut self.next, &mut self.newest);
        self.newest.copy_from_slice(values);
        let per_tick = if self.known == KEPT { 1.0 / self.period } else { 0.0 };
        for (i, &newest) in self.newest.iter().enumerate() {
            let (older, middle, next) = (self.older[i], self.middle[i], self.next[i]);
            self.velocity[i] = 0.5 * (next - older) * per_tick;
            self.acceleration[i] = (next - 2.0 * middle + older) * per_tick * per_tick;
            self.held[i] = 0.5 * (newest - next - middle + older) * per_tick * per_tick;
        }
    }

    /// The newest value.
    pub fn newest(&self) -> &[f64] {
        &self.newest
    }

    /// Value and derivatives at the tick j.
    pub fn motion(&self) -> Motion<'_> {
        Motion { q: &self.middle, v: &self.velocity, a: &self.acceleration }
    }

    /// The acceleration to hold from the tick j to j + 1.
    pub fn held(&self) -> &[f64] {
        &self.held
    }
}
