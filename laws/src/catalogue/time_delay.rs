//! A channel with a delay against the others.
//!
//! Law: the channels in `channel` record at t their value at t − d, with d \[s\] ≥ 0. `position` means the motor-side encoders: since the
//! prediction starts from their readings, the other channels then seem early. For small d the change is −d times the derivative. A
//! zero-order hold alone makes a delay of half a sample.
//! Source: Ljung 1999, System Identification, §10.1 (dead time); cubic Hermite interpolation with centred slopes (Catmull & Rom 1974).

use freeplay_model::export::{Channel, Element};
use toml::{Table, Value};

use crate::archive::Archive;
use crate::basis::{Term, with};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{Injection, Readings, SensorLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance, small_and_about};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::place::Site;
use crate::prediction::Prediction;
use crate::scene::Scene;
use crate::trajectory::Trajectory;

/// Channels that can have a delay, in arm files.
const CHANNELS: &[&str] = &["torque", "tool", "link", "position"];
/// Greatest delay, s.
const MOST: f64 = 0.1;
/// Greatest plausible delay of the encoders in the loops of a machine, s: with more, no loop would be stable.
const IN_LOOP: f64 = 0.015;
/// Operating points of the law for long delays, s: for a signal that jumps, the change is not proportional to the delay.
const LONG: [f64; 3] = [0.01, 0.03, 0.08];
/// Name of the parameter that selects the delayed channels.
const CHANNEL: &str = "channel";
/// Ticks that the plant stores.
const TICKS: usize = 1024;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "time_delay",
    title: "delay of a channel",
    words: "a delay of {delay} in the {channel} channels",
    site: Site::Arm,
    parameters: &[
        Parameter::number("delay", "delay of the channel", "s", [0.0, MOST]),
        Parameter { name: CHANNEL, meaning: "channels that are late", range: Range::Word(CHANNELS) },
    ],
    occurs: Occurrence::Occasional,
    tolerance: Some(Tolerance::Delay),
    seen: Seen::BOTH,
    rough: true,
    shakes: false,
    equation: "y_recorded(t) = y(t − d)",
    source: "Ljung 1999, §10.1",
    signature: "the residual follows the derivative of the channel; its phase grows with the frequency",
    confounders: &[
        ("rotor_inertia", "follows the acceleration of one joint, not dτ/dt"),
        ("viscous_friction", "follows the speed, not dτ/dt"),
        ("joint_elasticity", "follows the load, not the speed"),
        ("sensor_lowpass", "also attenuates fast changes"),
    ],
    contains: &[],
    needs: &[Need::TorqueOrPose],
    terms: Terms {
        list: |_, _, shape| {
            /// Well below a period of any recorded signal.
            const STEP: f64 = 1e-5;
            vec![Term::new("delay", "s", [0.0, most(shape)], with(shape, [("delay", STEP)])).stepped(STEP)]
        },
        compose: |_, shape, coefficients| with(shape, [("delay", coefficients[0])]),
    },
    shapes: |_| {
        let of_channel = |word: &&str| -> Vec<Table> {
            let small: Table = [(CHANNEL.to_owned(), Value::from(*word))].into_iter().collect();
            let most = most(&small);
            small_and_about(small, LONG.into_iter().filter(|delay| *delay <= most))
        };
        CHANNELS.iter().flat_map(of_channel).collect()
    },
    build: |values| {
        let (delay, channel) = (values.number("delay")?, values.word(CHANNEL)?);
        Ok(Box::new(TimeDelay { delay, channel, joints: values.arm().dof() }))
    },
};

/// The greatest plausible delay of the channels of `shape`, s.
fn most(shape: &Table) -> f64 {
    if shape.get(CHANNEL).and_then(Value::as_str) == Some("position") { IN_LOOP } else { MOST }
}

#[derive(Clone, Copy, Debug)]
struct TimeDelay {
    delay: f64,
    channel: &'static str,
    joints: usize,
}

impl Effect for TimeDelay {
    fn measures(&self) -> bool {
        true
    }

    fn measure(&self, scene: &Scene, prediction: &mut Prediction) {
        let late = |columns: &mut [Vec<f64>], delay: f64| {
            for column in columns {
                *column = delayed(scene.motion, column, delay);
            }
        };
        match self.channel {
            "torque" => late(&mut prediction.torque, self.delay),
            "tool" => late(&mut prediction.tool, self.delay),
            "link" => late(&mut prediction.link, self.delay),
            _ => {
                late(&mut prediction.torque, -self.delay);
                late(&mut prediction.tool, -self.delay);
                late(&mut prediction.link, -self.delay);
            }
        }
    }

    fn inject(&self, injection: &mut Injection) {
        let width = if self.channel == "tool" { 3 } else { self.joints };
        let columns = if self.channel == "position" { 2 * width } else { width };
        let memory = vec![0.0; columns * TICKS];
        injection.sensors.push(Box::new(Late { of: *self, columns, memory, seen: 0 }));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        let channel = match self.channel {
            "torque" => Channel::Torque,
            "tool" => Channel::Tool,
            "position" => Channel::Motor,
            _ => return ExportCoverage::Never("the file has no sensor on the links' side"),
        };
        elements.push(Element::Delay { channel, delay: self.delay });
        ExportCoverage::Whole
    }
}

/// `column` with the delay `delay`; before the stretch, its first value.
fn delayed(motion: &Trajectory, column: &[f64], delay: f64) -> Vec<f64> {
    let mut out = column.to_vec();
    for stretch in &motion.stretches {
        let (part, step) = (&column[stretch.clone()], motion.step(stretch));
        for (point, out) in out[stretch.clone()].iter_mut().enumerate() {
            *out = interpolated(part, point as f64 - delay / step);
        }
    }
    out
}

/// Value of `column` at the point number `at`, by cubic Hermite interpolation; beyond the ends, the value at the end.
fn interpolated(column: &[f64], at: f64) -> f64 {
    let last = column.len() - 1;
    let place = at.clamp(0.0, last as f64);
    let left = (place as usize).min(last.saturating_sub(1));
    let x = place - left as f64;
    let value = |i: usize| column[i.min(last)];
    let slope = |i: usize| {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
        if after > before { (column[after] - column[before]) / (after - before) as f64 } else { 0.0 }
    };
    let (y0, y1, m0, m1) = (value(left), value(left + 1), slope(left), slope((left + 1).min(last)));
    let (rise, bend) = (y1 - y0, m0 + m1 - 2.0 * (y1 - y0));
    y0 + x * (m0 + x * ((rise - m0 - bend) + x * bend))
}

/// The plant's memory of a channel's readings.
#[derive(Clone, Debug)]
struct Late {
    of: TimeDelay,
    columns: usize,
    /// A ring of [`TICKS`] rows.
    memory: Vec<f64>,
    seen: usize,
}

impl Late {
    /// Column `column` `ticks` before the latest row, by linear interpolation; never before the first row.
    fn value(&self, column: usize, ticks: f64) -> f64 {
        let ticks = ticks.min((self.seen.min(TICKS) - 1) as f64);
        let row = |back: usize| {
            let back = back.min(self.seen.min(TICKS) - 1);
            self.memory[((self.seen - 1 - back) % TICKS) * self.columns + column]
        };
        let whole = ticks as usize;
        let part = ticks - whole as f64;
        row(whole) * (1.0 - part) + row(whole + 1) * part
    }
}

impl SensorLaw for Late {
    fn read(&mut self, readings: &mut Readings) {
        let ticks = self.of.delay / readings.period;
        let width = self.columns / if self.of.channel == "position" { 2 } else { 1 };
        let (first, second): (&mut [f64], &mut [f64]) = match self.of.channel {
            "torque" => (readings.torque, &mut []),
            "tool" => (readings.tool, &mut []),
            "link" => (readings.link, &mut []),
            _ => (readings.q, readings.v),
        };
        let row = (self.seen % TICKS) * self.columns;
        for (column, value) in first.iter().take(width).chain(second.iter().take(width)).enumerate() {
            self.memory[row + column] = *value;
        }
        self.seen += 1;
        for (column, value) in first.iter_mut().take(width).chain(second.iter_mut().take(width)).enumerate() {
            *value = self.value(column, ticks);
        }
    }

    fn restart(&mut self) {
        self.seen = 0;
    }

    fn transfer_state(&mut self, archive: &mut Archive) {
        let mut seen = self.seen as u64;
        archive.count(&mut seen);
        self.seen = seen as usize;
        archive.reals(&mut self.memory);
    }
}
