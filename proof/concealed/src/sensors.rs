//! The sensors: they turn a machine's motion into a recording.
//!
//! Encoders on the motors (and in some cases on the links), torque from the motor currents, an external tracker on the tool. Each has a quantisation step,
//! noise and a delay; the sampling instants jitter.

use rand_chacha::ChaCha8Rng;

use crate::data_sheet_deviations::DataSheetDeviations;
use crate::machine::{Plan, Trace};
use crate::random::normal;

/// Quality of the sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Noise {
    /// A laboratory.
    Low,
    /// A good machine.
    Middle,
    /// A workshop.
    High,
}

impl Noise {
    /// Every level.
    pub const ALL: [Noise; 3] = [Noise::Low, Noise::Middle, Noise::High];

    /// Standard deviation of the torque noise, as a share of the joint's largest torque.
    pub(crate) fn torque(self) -> f64 {
        [0.0005, 0.0015, 0.004][self as usize]
    }

    /// Quantisation step of the torque, as a share of the joint's largest torque.
    pub(crate) fn torque_step(self) -> f64 {
        [2e-5, 1e-4, 5e-4][self as usize]
    }

    /// Quantisation step of an encoder at the joint, rad (half of it in m for a slide).
    pub(crate) fn encoder_step(self) -> f64 {
        [3e-7, 1e-6, 4e-6][self as usize]
    }

    /// Standard deviation of the tracker noise in each direction, m.
    pub(crate) fn tool(self) -> f64 {
        [1e-5, 3e-5, 1e-4][self as usize]
    }

    /// Standard deviation of the sampling instants, as a share of the sampling period.
    pub(crate) fn jitter(self) -> f64 {
        [0.001, 0.01, 0.04][self as usize]
    }
}

/// Sensors and recorder of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// Samples per second, Hz.
    pub rate: f64,
    /// Standard deviation of each joint's torque, N·m or N.
    pub torque_noise: Vec<f64>,
    /// Quantisation step of each joint's torque, N·m or N.
    pub torque_step: Vec<f64>,
    /// Quantisation step of each encoder, rad or m.
    pub encoder_step: Vec<f64>,
    /// Standard deviation of the tracker in each direction, m.
    pub tool_noise: f64,
    /// Rate of a tracker with a clock of its own, Hz; the recorder interpolates linearly between its readings. `None`: the recorder triggers each reading.
    pub tracker: Option<f64>,
    /// Standard deviation of the sampling instants, s.
    pub jitter: f64,
    /// True if the links have encoders.
    pub link_encoders: bool,
    /// True if the commanded position is recorded.
    pub reference: bool,
}

/// Recorded samples; every column has the same length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Time stamps, s.
    pub t: Vec<f64>,
    /// Names of the columns after `t`.
    pub names: Vec<String>,
    /// Those columns.
    pub columns: Vec<Vec<f64>>,
}

/// Noise-free sensor signals along a trace, at any time.
pub(crate) struct Clean<'a> {
    plan: &'a Plan,
    trace: &'a Trace,
    /// Torque from the current after its filter, row by row; `None` for a joint without filter.
    filtered: Vec<Option<Vec<f64>>>,
    torque_delay: f64,
    tool_delay: f64,
}

impl<'a> Clean<'a> {
    pub fn new(plan: &'a Plan, trace: &'a Trace, deviations: &DataSheetDeviations) -> Self {
        let filtered = plan
            .sensor_dynamics
            .cutoff
            .iter()
            .enumerate()
            .map(|(joint, &cutoff)| cutoff.is_finite().then(|| lowpass(trace, joint, cutoff)));
        Self {
            plan,
            trace,
            filtered: filtered.collect(),
            torque_delay: deviations.torque_delay + plan.sensor_dynamics.torque_delay,
            tool_delay: deviations.tool_delay + plan.sensor_dynamics.tool_delay,
        }
    }

    /// Encoder readings at time `t`.
    pub fn positions(&self, t: f64, out: &mut [f64]) {
        for (joint, out) in out.iter_mut().enumerate() {
            let q = self.cubic(t, |row| self.trace.motor(row)[joint]);
            *out = self.plan.encoders[joint].reading(q, t);
        }
    }

    /// Readings of encoders on the links at time `t`; their zeros are those of the motors.
    pub fn links(&self, t: f64, out: &mut [f64]) {
        for (joint, out) in out.iter_mut().enumerate() {
            *out = self.cubic(t, |row| self.trace.link(row)[joint]);
        }
    }

    /// Torque readings at time `t`.
    pub fn torques(&self, t: f64, out: &mut [f64]) {
        for (joint, out) in out.iter_mut().enumerate() {
            let by_current = match &self.filtered[joint] {
                Some(filtered) => self.linear(t - self.torque_delay, |row| filtered[row]),
                None => self.linear(t - self.torque_delay, |row| self.trace.torque(row)[joint]),
            };
            *out = self.plan.drives[joint].measured(by_current);
        }
    }

    /// The tracker's reading at time `t`.
    pub fn tool(&self, t: f64) -> [f64; 3] {
        [0, 1, 2].map(|i| self.cubic(t - self.tool_delay, |row| self.trace.tool(row)[i]))
    }

    fn place(&self, t: f64) -> (usize, f64) {
        let place = ((t - self.trace.start) / self.trace.step).max(1.0);
        let row = (place as usize).min(self.trace.len() - 3);
        (row, place - row as f64)
    }

    fn linear(&self, t: f64, value: impl Fn(usize) -> f64) -> f64 {
        let (row, s) = self.place(t);
        value(row) * (1.0 - s) + value(row + 1) * s
    }

    /// Cubic Lagrange interpolation through four rows.
    fn cubic(&self, t: f64, value: impl Fn(usize) -> f64) -> f64 {
        let (row, s) = self.place(t);
        let [a, b, c, d] = [row - 1, row, row + 1, row + 2].map(value);
        let (before, after, far) = (s + 1.0, s - 1.0, s - 2.0);
        -a * s * after * far / 6.0 + b * before * after * far / 2.0 - c * before * s * far / 2.0
            + d * before * s * after / 6.0
    }
}

/// A first-order low-pass along the trace, exact for inputs that are linear between its rows.
fn lowpass(trace: &Trace, joint: usize, cutoff: f64) -> Vec<f64> {
    let rate = std::f64::consts::TAU * cutoff * trace.step;
    let decay = (-rate).exp();
    let mean = (1.0 - decay) / rate;
    let mut output = trace.torque(0)[joint];
    let mut before = output;
    (0..trace.len())
        .map(|row| {
            let input = trace.torque(row)[joint];
            // ẏ = ω (u − y) with u linear from `before` to `input`.
            output = decay * output + (mean - decay) * before + (1.0 - mean) * input;
            before = input;
            output
        })
        .collect()
}

impl Chain {
    /// Samples `duration` s of `trace`; `reference` writes the commanded position at a given time.
    pub fn sample(
        &self,
        plan: &Plan,
        trace: &Trace,
        deviations: &DataSheetDeviations,
        duration: f64,
        reference: impl Fn(f64, &mut [f64]),
        rng: &mut ChaCha8Rng,
    ) -> Samples {
        let clean = Clean::new(plan, trace, deviations);
        let n = plan.joints();
        let mut samples = self.empty(n);
        let mut row = vec![0.0; n];
        let readings = self.tracker.map(|rate| self.readings(&clean, rate, duration, rng));
        let count = (duration * self.rate) as usize;
        let period = 1.0 / self.rate;
        for k in 0..count {
            let t = period * k as f64 + (self.jitter * normal(rng)).clamp(-0.3 * period, 0.3 * period);
            // The clock counts whole microseconds.
            let t = if k == 0 { 0.0 } else { (t * 1e6).round() * 1e-6 };
            samples.t.push(t);
            let mut columns = samples.columns.iter_mut();
            let mut put = |row: &[f64]| {
                row.iter().zip(columns.by_ref()).for_each(|(value, column)| column.push(*value));
            };
            clean.positions(t, &mut row);
            round(&mut row, &self.encoder_step);
            put(&row);
            clean.torques(t, &mut row);
            row.iter_mut().zip(&self.torque_noise).for_each(|(x, noise)| *x += noise * normal(rng));
            round(&mut row, &self.torque_step);
            put(&row);
            if self.reference {
                reference(t, &mut row);
                round(&mut row, &[1e-8]);
                put(&row);
            }
            if self.link_encoders {
                clean.links(t, &mut row);
                round(&mut row, &self.encoder_step);
                put(&row);
            }
            let mut tool = match &readings {
                Some((rate, readings)) => between(readings, t * rate),
                None => clean.tool(t).map(|x| x + self.tool_noise * normal(rng)),
            };
            round(&mut tool, &[1e-7]);
            put(&tool);
        }
        samples
    }

    /// Readings of a tracker with its own clock of `rate` Hz, and that rate.
    fn readings(
        &self,
        clean: &Clean<'_>,
        rate: f64,
        duration: f64,
        rng: &mut ChaCha8Rng,
    ) -> (f64, Vec<[f64; 3]>) {
        let count = (duration * rate) as usize + 2;
        let read = |k: usize| clean.tool(k as f64 / rate).map(|x| x + self.tool_noise * normal(rng));
        (rate, (0..count).map(read).collect())
    }

    fn empty(&self, joints: usize) -> Samples {
        let mut prefixes = vec!["q", "tau"];
        if self.reference {
            prefixes.push("q_ref");
        }
        if self.link_encoders {
            prefixes.push("q_link");
        }
        let mut names: Vec<String> =
            prefixes.iter().flat_map(|prefix| (1..=joints).map(move |j| format!("{prefix}{j}"))).collect();
        names.extend(["x", "y", "z"].map(str::to_owned));
        let columns = vec![Vec::new(); names.len()];
        Samples { t: Vec::new(), names, columns }
    }
}

/// Linear interpolation between readings at `place`, counted in readings.
fn between(readings: &[[f64; 3]], place: f64) -> [f64; 3] {
    let before = (place.max(0.0) as usize).min(readings.len() - 2);
    let share = place - before as f64;
    [0, 1, 2].map(|i| readings[before][i] * (1.0 - share) + readings[before + 1][i] * share)
}

/// Rounds each value to its step; the last step applies to all further values. Dividing by the reciprocal keeps the decimals short.
fn round(values: &mut [f64], steps: &[f64]) {
    for (i, value) in values.iter_mut().enumerate() {
        let step = steps[i.min(steps.len() - 1)];
        *value = ((*value / step).round() * step * 1e10).round() / 1e10;
    }
}
