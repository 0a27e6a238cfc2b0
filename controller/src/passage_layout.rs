//! Indices of the variables of a passage's programme, and the derivatives of a course's accelerations.

use crate::passage_trajectory::PassageTrajectory;

/// From SI to mm and mrad.
pub const MILLI: f64 = 1e3;
/// Fixed ticks at either end of a passage; position, velocity and acceleration thus join the motion before and after.
pub const FIXED: usize = 2;

/// Indices of the variables of the programme.
pub struct Layout {
    /// Number of joints.
    pub joints: usize,
    /// Number of joints with play.
    pub plays: usize,
    /// Number of ticks.
    pub ticks: usize,
}

impl Layout {
    /// Returns true if tick `k` may change.
    pub fn is_free(&self, k: usize) -> bool {
        k >= FIXED && k + FIXED < self.ticks
    }

    /// Number of variables of one tick: δΔq, δφ, y, s.
    pub fn width(&self) -> usize {
        self.joints + 3 * self.plays
    }

    /// Index of δΔq of `joint` at tick `k`.
    pub fn joint(&self, k: usize, joint: usize) -> usize {
        k * self.width() + joint
    }

    /// Index of δφ of `play` at tick `k`.
    pub fn angle_index(&self, k: usize, play: usize) -> usize {
        self.joint(k, self.joints + play)
    }

    /// Index of y of `play` at tick `k`.
    pub fn lateral_index(&self, k: usize, play: usize) -> usize {
        self.joint(k, self.joints + self.plays + play)
    }

    /// Index of s of `play` at tick `k`.
    pub fn slack_index(&self, k: usize, play: usize) -> usize {
        self.joint(k, self.joints + 2 * self.plays + play)
    }
}

/// The ticks and coefficients of the second difference at tick `k`, 1/s².
pub fn stencil(period: f64, k: usize) -> [(usize, f64); 3] {
    let share = 1.0 / (period * period);
    [(k - 1, share), (k, -2.0 * share), (k + 1, share)]
}

/// Derivative of the acceleration of joint `i` at tick `k` with respect to the corrections, rad/s² per mrad.
pub fn second_difference(
    course: &PassageTrajectory,
    layout: &Layout,
    k: usize,
    i: usize,
) -> Vec<(usize, f64)> {
    let free = stencil(course.period, k).into_iter().filter(|&(tick, _)| layout.is_free(tick));
    free.map(|(tick, share)| (layout.joint(tick, i), share / MILLI)).collect()
}
