//! Common parts of effects of the form a·sin(Nq + φ): the linear pair of coefficients, and the orders of the search.

use toml::Table;

use crate::basis::{Term, with};
use crate::kind::{Kind, Terms};
use crate::parameter::Parameter;
use crate::place::Place;
use crate::{LawError, Values};

/// Name of the parameter with the number of periods of a wave.
pub const PERIODS: &str = "periods";

/// The parameters of a torque with the form of a [`Wave`] over the joint's position.
pub const TORQUE_PARAMETERS: &[Parameter] = &[
    Parameter::number("amplitude", "greatest torque of the wave", "N*m", [0.0, 1e6]).prismatic("N"),
    Parameter::number(PERIODS, "periods N of the wave in one turn", "1/rev", [1e-3, 1e5])
        .prismatic("rad/m")
        .shape(),
    Parameter::number("phase", "phase φ of the wave at q = 0", "rad", [-7.0, 7.0]).or(0.0),
];

/// a·sin(Nq + φ) over the position q of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Wave {
    amplitude: f64,
    periods: f64,
    phase: f64,
}

impl Wave {
    /// The wave of [`TORQUE_PARAMETERS`].
    ///
    /// # Errors
    /// [`LawError`] if one of them is missing or not a number.
    pub fn of(values: &Values) -> Result<Wave, LawError> {
        Ok(Wave {
            amplitude: values.number("amplitude")?,
            periods: values.number(PERIODS)?,
            phase: values.number("phase")?,
        })
    }

    /// Its value at the position `q`, rad (m).
    pub fn at(&self, q: f64) -> f64 {
        wave(self.amplitude, self.periods, self.phase, q)
    }
}

/// a·sin(Nq + φ) = s·sin Nq + c·cos Nq with s = a cos φ and c = a sin φ.
pub const TERMS: Terms = Terms {
    list: |kind, place, shape| {
        let unit = kind.unit("amplitude", place.joint());
        let most = kind.most("amplitude");
        [("sine", 0.0), ("cosine", std::f64::consts::FRAC_PI_2)]
            .map(|(name, phase)| {
                let plus = with(shape, [("amplitude", STEP), ("phase", phase)]);
                Term::new(name, unit, [-most, most], plus).stepped(STEP)
            })
            .into()
    },
    compose: |_: &Kind, shape, coefficients| {
        let (sine, cosine) = (coefficients[0], coefficients[1]);
        with(shape, [("amplitude", sine.hypot(cosine)), ("phase", cosine.atan2(sine))])
    },
};

/// Small enough for an encoder's error to act linearly, exact for a torque.
const STEP: f64 = 1e-4;

/// a·sin(Nq + φ).
pub fn wave(amplitude: f64, periods: f64, phase: f64, q: f64) -> f64 {
    amplitude * (periods * q + phase).sin()
}

/// Periods per unit of q that the motion can identify: from one period over the joint's travel up to `MOST` times that, in steps of half a
/// period over the travel, and no faster than a fifth of the sampling rate at the joint's ninth decile of speed.
pub fn orders(place: &Place) -> Vec<Table> {
    const MOST: usize = 120;
    let (Some(joint), motion) = (place.joint, place.scene.motion) else { return Vec::new() };
    let (least, most) = motion.q[joint].iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
    let (way, speeds) = (most - least, place.speeds());
    let Some(stretch) = motion.stretches.first().filter(|stretch| stretch.len() > 2) else {
        return Vec::new();
    };
    if way.is_nan() || way <= 1e-6 {
        return Vec::new();
    }
    let fast = speeds[(speeds.len() - 1) * 9 / 10];
    let greatest = 0.2 * std::f64::consts::TAU / (motion.step(stretch) * fast);
    let step = std::f64::consts::PI / way;
    let orders = (2..MOST).map(|i| step * i as f64).take_while(|order| *order < greatest);
    orders.map(|order| with(&Table::new(), [(PERIODS, order)])).collect()
}
