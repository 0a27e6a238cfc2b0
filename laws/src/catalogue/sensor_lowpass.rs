//! A torque measurement behind a low-pass of the drive.
//!
//! Law: T ẏ + y = τ with T = 1/(2π f_c), f_c \[Hz\] > 0 the cutoff; the recording contains y, initially in steady state. The term is T: for
//! slow motions y = τ − T τ̇.
//! Source: Franklin, Powell & Workman 1998, Digital Control of Dynamic Systems, §4.3 (first order, ramp-invariant: exact for a signal that
//! is linear between samples).

use std::f64::consts::TAU;

use freeplay_model::export::Element;
use toml::Table;

use crate::archive::Archive;
use crate::basis::{Term, with};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{Injection, Readings, SensorLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, small_and_about};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::prediction::Prediction;
use crate::scene::Scene;

/// Greatest cutoff, Hz.
const MOST: f64 = 1e6;
/// Greatest plausible time constant in a diagnosis, s: a drive with a cutoff below 0.8 Hz practically hides its torque.
const GREATEST_PLAUSIBLE: f64 = 0.2;

/// Operating points of the law for long time constants, s: for friction that jumps, the effect of a low-pass is not proportional to its
/// time constant.
const SLOW: [f64; 3] = [0.02, 0.06, 0.16];

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "sensor_lowpass",
    title: "low-pass of the torque measurement",
    words: "a torque measurement with a low-pass at {cutoff}",
    site: Site::Joint,
    parameters: &[Parameter::number(
        "cutoff",
        "frequency at which 71 % of the amplitude pass",
        "Hz",
        [1e-3, MOST],
    )],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "ẏ/(2π f_c) + y = τ",
    source: "Franklin, Powell & Workman 1998, §4.3",
    signature: "fast changes of the torque are smaller and late; slow ones are correct",
    confounders: &[
        ("time_delay", "is late without being smaller"),
        ("rotor_inertia", "follows the acceleration of the joint, not dτ/dt"),
        ("viscous_friction", "follows the speed, not dτ/dt"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Motion],
    terms: Terms {
        list: |_, _, shape| {
            /// Well below a period of any recorded signal, s.
            const STEP: f64 = 1e-5;
            let filtered = with(shape, [("cutoff", 1.0 / (TAU * STEP))]);
            vec![Term::new("time_constant", "s", [0.0, GREATEST_PLAUSIBLE], filtered).stepped(STEP)]
        },
        compose: |_, shape, coefficients| {
            with(shape, [("cutoff", (1.0 / (TAU * coefficients[0].max(0.0))).min(MOST))])
        },
    },
    shapes: |_| small_and_about(Table::new(), SLOW),
    build: |values| {
        let lag = Lag { time_constant: 1.0 / (TAU * values.number("cutoff")?), last: None };
        Ok(Box::new(SensorLowpass { joint: values.joint()?, lag }))
    },
};

/// A first-order lag.
#[derive(Clone, Copy, Debug)]
struct Lag {
    time_constant: f64,
    /// Previous input and output.
    last: Option<(f64, f64)>,
}

impl Lag {
    /// The output `step` seconds after the last one, for an input that changed linearly to `input`: with the slope s, y = u − T s + (y₋ −
    /// u₋ + T s) e^{−h/T}.
    fn after(&mut self, input: f64, step: f64) -> f64 {
        let output = match self.last {
            None => input,
            Some((before, output)) => {
                let behind = self.time_constant * (input - before) / step;
                input - behind + (output - before + behind) * (-step / self.time_constant).exp()
            }
        };
        self.last = Some((input, output));
        output
    }
}

#[derive(Clone, Copy, Debug)]
struct SensorLowpass {
    joint: usize,
    lag: Lag,
}

impl Effect for SensorLowpass {
    fn measures(&self) -> bool {
        true
    }

    fn measure(&self, scene: &Scene, prediction: &mut Prediction) {
        for stretch in &scene.motion.stretches {
            let (step, mut lag) = (scene.motion.step(stretch), self.lag);
            for torque in &mut prediction.torque[self.joint][stretch.clone()] {
                *torque = lag.after(*torque, step);
            }
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.sensors.push(Box::new(*self));
    }

    fn export_elements(&self, _: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Never("sensors of other tools have no filter")
    }
}

impl SensorLaw for SensorLowpass {
    fn read(&mut self, readings: &mut Readings) {
        let torque = &mut readings.torque[self.joint];
        *torque = self.lag.after(*torque, readings.period);
    }

    fn restart(&mut self) {
        self.lag.last = None;
    }

    fn transfer_state(&mut self, archive: &mut Archive) {
        let (mut begun, (mut input, mut output)) =
            (self.lag.last.is_some(), self.lag.last.unwrap_or_default());
        archive.flag(&mut begun);
        archive.reals([&mut input, &mut output]);
        self.lag.last = begun.then_some((input, output));
    }
}
