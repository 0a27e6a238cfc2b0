//! The commanded motion: three families, scaled to the arm's limits.

mod fourier;
mod point_to_point;
mod sweep;

use freeplay_arm::Arm;
use rand_chacha::ChaCha8Rng;

use crate::arms::Machine;
use crate::random::uniform;
use fourier::Fourier;
use point_to_point::PointToPoint;
use sweep::Sweep;

/// The three families.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Sums of sines, as for identification (Swevers et al. 1997).
    Fourier,
    /// From point to point, with dwells.
    Points,
    /// Slow sweeps at constant speed with many reversals.
    Sweep,
}

impl Family {
    /// Every family.
    pub const ALL: [Family; 3] = [Family::Fourier, Family::Points, Family::Sweep];
}

/// A motion of all joints: position, velocity and acceleration at any time; at rest at time 0 and before.
#[derive(Clone, Debug)]
pub struct Motion {
    kind: Kind,
    duration: f64,
}

#[derive(Clone, Debug)]
enum Kind {
    Fourier(Vec<Fourier>),
    Points(PointToPoint),
    Sweep(Vec<Sweep>),
}

/// Limits of one joint in a motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionLimits {
    /// Position in the middle, rad or m.
    pub home: f64,
    /// Largest distance from it.
    pub reach: f64,
    /// Largest speed, per s.
    pub speed: f64,
    /// Largest acceleration, per s².
    pub acceleration: f64,
}

impl Motion {
    /// A motion of `family` for `machine`, lasting `duration` s, at random.
    pub(crate) fn draw(
        machine: Machine,
        arm: &Arm,
        family: Family,
        duration: f64,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let haste = uniform(rng, 0.5, 0.95);
        let limits_of_joints: Vec<MotionLimits> = arm
            .joints()
            .iter()
            .zip(machine.home().iter().zip(machine.reach()))
            .map(|(joint, (&home, &reach))| MotionLimits {
                home: home + 0.1 * reach * uniform(rng, -1.0, 1.0),
                reach: reach * uniform(rng, 0.7, 0.9),
                speed: 0.9 * haste * joint.limits.velocity,
                acceleration: 0.7 * haste * joint.limits.acceleration,
            })
            .collect();
        let kind = match family {
            Family::Fourier => {
                Kind::Fourier(limits_of_joints.iter().map(|limits| Fourier::draw(limits, rng)).collect())
            }
            Family::Points => Kind::Points(PointToPoint::draw(&limits_of_joints, duration, rng)),
            Family::Sweep => {
                Kind::Sweep(limits_of_joints.iter().map(|limits| Sweep::draw(limits, rng)).collect())
            }
        };
        Self { kind, duration }
    }

    /// Its duration, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Position, velocity and acceleration of every joint at time `t`, s.
    ///
    /// # Panics
    /// If a slice is shorter than the number of joints.
    pub fn at(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        let t = t.max(0.0);
        let mut set = |i: usize, state: [f64; 3]| [q[i], v[i], a[i]] = state;
        match &self.kind {
            Kind::Fourier(joints) => joints.iter().enumerate().for_each(|(i, joint)| set(i, joint.at(t))),
            Kind::Points(points) => points.at(t, set),
            Kind::Sweep(joints) => joints.iter().enumerate().for_each(|(i, joint)| set(i, joint.at(t))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Family, Motion};
    use crate::arms::Machine;
    use crate::random::stream;

    /// Velocity and acceleration are the derivatives of position and velocity, the limits hold, and the start is at rest.
    #[test]
    fn motions_are_consistent_and_within_limits() {
        let mut worst = 0.0_f64;
        for machine in Machine::ALL {
            let arm = machine.data_sheet().expect("a data sheet");
            let n = arm.dof();
            for family in Family::ALL {
                let motion = Motion::draw(machine, &arm, family, 16.0, &mut stream(7, "motion"));
                let at = |t: f64| {
                    let mut s = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
                    motion.at(t, &mut s.0, &mut s.1, &mut s.2);
                    s
                };
                let mut moved = vec![0.0_f64; n];
                let (start, h) = (at(0.0), 1e-5);
                for k in 0..1600 {
                    let t = 0.003 + f64::from(k) * 0.01;
                    let (before, now, after) = (at(t - h), at(t), at(t + h));
                    for (j, joint) in arm.joints().iter().enumerate() {
                        assert!(
                            now.1[j].abs() < joint.limits.velocity,
                            "{machine:?} {family:?} joint {j} at {t}"
                        );
                        assert!(
                            now.2[j].abs() < joint.limits.acceleration,
                            "{machine:?} {family:?} joint {j} at {t}"
                        );
                        assert!(now.0[j] > joint.limits.lower && now.0[j] < joint.limits.upper);
                        let slope = (after.0[j] - before.0[j]) / (2.0 * h);
                        worst = worst.max((slope - now.1[j]).abs() / joint.limits.velocity);
                        let bend = (after.1[j] - before.1[j]) / (2.0 * h);
                        // Trapezoidal profiles have jumps in acceleration, at which the two halves differ.
                        if (before.2[j] - after.2[j]).abs() < 1e-2 {
                            assert!(
                                (bend - now.2[j]).abs() < 1e-2,
                                "{machine:?} {family:?} joint {j} at {t}"
                            );
                        }
                        moved[j] = moved[j].max((now.0[j] - start.0[j]).abs());
                    }
                }
                assert!(start.1.iter().all(|v| v.abs() < 1e-12), "{family:?} starts at rest");
                assert!(moved.iter().all(|m| *m > 0.05), "{machine:?} {family:?} {moved:?}");
            }
        }
        println!("worst difference of velocity and slope: {worst:.1e} of the limit");
        assert!(worst < 1e-4);
    }
}
