//! A tool that drifts as the machine warms up.
//!
//! Law: the tool is displaced by d (1 − exp(−t/T)), with d \[m\] the final displacement, base frame, T \[s\] the time constant of the
//! warming, and t \[s\] since the start of the run.
//! Source: a body with one thermal time constant (Mayr et al. 2012, CIRP Annals 61(2):771, thermal issues in machine tools).

use nalgebra::Vector3;

use crate::archive::Archive;
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{Injection, Readings, SensorLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "thermal_drift",
    title: "a drift of the tool",
    words: "a tool that drifts by {drift} within {time}",
    site: Site::Arm,
    parameters: &[
        Parameter::vector("drift", "final displacement of the tool, base frame", "m"),
        Parameter::number("time", "time constant", "s", [1e-3, 1e6]),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::POSE,
    rough: false,
    shakes: false,
    equation: "d (1 − exp(−t/T))",
    source: "Mayr et al. 2012",
    signature: "the deviation of the tool grows with time, at every position",
    confounders: &[("link_length", "does not change with time")],
    contains: &[],
    needs: &[Need::Tool],
    terms: Terms::LINEAR,
    shapes: one_shape,
    build: |values| {
        Ok(Box::new(ThermalDrift {
            drift: values.vector("drift")?.into(),
            time: values.number("time")?,
            ticks: 0,
        }))
    },
};

#[derive(Clone, Copy, Debug)]
struct ThermalDrift {
    drift: Vector3<f64>,
    time: f64,
    /// Readings so far.
    ticks: u64,
}

impl ThermalDrift {
    fn at(&self, t: f64) -> Vector3<f64> {
        self.drift * -(-t / self.time).exp_m1()
    }
}

impl Effect for ThermalDrift {
    fn displace(&self, scene: &Scene, tool: &mut Columns) {
        let first = scene.motion.t.first().copied().unwrap_or(0.0);
        for (point, t) in scene.motion.t.iter().enumerate() {
            self.at(t - first).iter().enumerate().for_each(|(axis, off)| tool[axis][point] += off);
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.tool.push(Box::new(*self));
    }
}

impl SensorLaw for ThermalDrift {
    fn read(&mut self, readings: &mut Readings) {
        let off = self.at(self.ticks as f64 * readings.period);
        readings.tool.iter_mut().zip(off.iter()).for_each(|(tool, off)| *tool += off);
        self.ticks += 1;
    }

    fn restart(&mut self) {
        self.ticks = 0;
    }

    fn transfer_state(&mut self, archive: &mut Archive) {
        archive.count(&mut self.ticks);
    }
}

#[cfg(test)]
mod tests {
    use super::ThermalDrift;
    use crate::injection::{Readings, SensorLaw};
    use nalgebra::Vector3;

    #[test]
    fn the_drift_is_two_thirds_after_its_time_and_starts_anew() {
        let mut law = ThermalDrift { drift: Vector3::new(0.0, 3e-4, 0.0), time: 0.1, ticks: 0 };
        let mut read = || {
            let (mut tool, none) = ([0.0; 7], &mut []);
            let [mut v, mut torque, mut link] = [[0.0; 0]; 3];
            let (v, torque, link) = (&mut v[..], &mut torque[..], &mut link[..]);
            law.read(&mut Readings { period: 1e-3, q: none, v, torque, link, tool: &mut tool });
            tool[1]
        };
        let course: Vec<f64> = (0..=100).map(|_| read()).collect();
        assert!(course[0] == 0.0 && (course[100] / 3e-4 - 0.632_120_558).abs() < 1e-8, "{}", course[100]);
        law.restart();
        assert_eq!(law.ticks, 0);
    }
}
