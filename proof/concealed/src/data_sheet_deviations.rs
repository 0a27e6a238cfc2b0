//! Deviations of the true arm from its data sheet, drawn within the tolerances.

use freeplay_arm::{Arm, ArmError};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;

use crate::random::{normal, uniform};

/// Mass and inertia of a link, as a fraction.
const INERTIA: f64 = 0.02;
/// Nominal friction of a joint, as a fraction.
const FRICTION: f64 = 0.05;
/// Zero of an encoder, rad (m for a slide).
const ZERO: f64 = 1e-4;
/// Length between two joints, m.
const LENGTH: f64 = 1e-4;
/// Delay of a channel, s.
const DELAY: f64 = 6e-4;

/// The deviations of one machine, within the tolerances that the diagnosis allows for: masses and inertias ±2 %, nominal friction ±5 %, encoder
/// zeros ±0.1 mrad, lengths ±0.1 mm, delay of torque and of tool against the encoders ±0.6 ms.
#[derive(Clone, Debug, PartialEq)]
pub struct DataSheetDeviations {
    /// Factor of each link's mass.
    pub mass: Vec<f64>,
    /// Factor of each link's inertia about its centre of mass.
    pub inertia: Vec<f64>,
    /// Factor of each joint's viscous friction.
    pub viscous: Vec<f64>,
    /// Factor of each joint's Coulomb friction.
    pub coulomb: Vec<f64>,
    /// Offset of each encoder, rad or m.
    pub zero: Vec<f64>,
    /// Additional length of each joint's placement and of the tool, m.
    pub length: Vec<f64>,
    /// Delay of the torques, s.
    pub torque_delay: f64,
    /// Delay of the tool's tracker, s.
    pub tool_delay: f64,
}

impl DataSheetDeviations {
    /// A machine that equals its data sheet.
    pub fn none(dof: usize) -> Self {
        let ones = vec![1.0; dof];
        Self {
            mass: ones.clone(),
            inertia: ones.clone(),
            viscous: ones.clone(),
            coulomb: ones,
            zero: vec![0.0; dof],
            length: vec![0.0; dof + 1],
            torque_delay: 0.0,
            tool_delay: 0.0,
        }
    }

    /// Draws a machine: half of all machines deviate uniformly over the tolerance, half normally with half of the tolerance as standard deviation.
    pub(crate) fn draw(dof: usize, rng: &mut ChaCha8Rng) -> Self {
        let even = uniform(rng, 0.0, 1.0) < 0.5;
        let mut within = |tolerance: f64| {
            if even {
                return uniform(rng, -tolerance, tolerance);
            }
            loop {
                let value = 0.5 * tolerance * normal(rng);
                if value.abs() <= tolerance {
                    return value;
                }
            }
        };
        let mut factors = |tolerance| (0..dof).map(|_| 1.0 + within(tolerance)).collect::<Vec<_>>();
        let (mass, inertia) = (factors(INERTIA), factors(INERTIA));
        let (viscous, coulomb) = (factors(FRICTION), factors(FRICTION));
        let zero = (0..dof).map(|_| within(ZERO)).collect();
        let length = (0..=dof).map(|_| within(LENGTH)).collect();
        Self {
            mass,
            inertia,
            viscous,
            coulomb,
            zero,
            length,
            torque_delay: within(DELAY),
            tool_delay: within(DELAY),
        }
    }

    /// The true arm of the data sheet `nominal`; friction included.
    ///
    /// # Errors
    /// None in practice: an arm within the tolerances stays valid.
    pub fn apply(&self, nominal: &Arm) -> Result<Arm, ArmError> {
        let mut joints = nominal.joints().to_vec();
        for (i, joint) in joints.iter_mut().enumerate() {
            joint.inertia.mass *= self.mass[i];
            joint.inertia.about_com *= self.inertia[i];
            joint.friction.viscous *= self.viscous[i];
            joint.friction.coulomb *= self.coulomb[i];
            lengthen(&mut joint.placement.translation.vector, self.length[i]);
        }
        let mut tool = *nominal.tool();
        lengthen(&mut tool.translation.vector, self.length[nominal.dof()]);
        Arm::new(nominal.name(), joints, tool, *nominal.gravity())
    }
}

/// Adds `amount` to the length of `way`; a vector of length zero stays.
pub(crate) fn lengthen(way: &mut Vector3<f64>, amount: f64) {
    if let Some(direction) = way.try_normalize(1e-6) {
        *way += direction * amount;
    }
}

#[cfg(test)]
mod tests {
    use super::{DELAY, DataSheetDeviations, FRICTION, INERTIA, LENGTH, ZERO};
    use crate::random::stream;

    /// No machine is outside the tolerances that a diagnosis allows for, and the tolerances are used.
    #[test]
    fn machines_are_inside_their_tolerances() {
        let mut most = [0.0_f64; 5];
        for seed in 0..400 {
            let drawn = DataSheetDeviations::draw(6, &mut stream(seed, "bench"));
            let off = |factors: &[f64]| factors.iter().fold(0.0_f64, |most, x| most.max((x - 1.0).abs()));
            let size = |values: &[f64]| values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let used = [
                off(&drawn.mass).max(off(&drawn.inertia)) / INERTIA,
                off(&drawn.viscous).max(off(&drawn.coulomb)) / FRICTION,
                size(&drawn.zero) / ZERO,
                size(&drawn.length) / LENGTH,
                size(&[drawn.torque_delay, drawn.tool_delay]) / DELAY,
            ];
            most.iter_mut().zip(used).for_each(|(most, used)| *most = most.max(used));
        }
        println!("largest use of each tolerance: {most:?}");
        assert!(most.iter().all(|used| (0.9..=1.0 + 1e-9).contains(used)));
    }
}
