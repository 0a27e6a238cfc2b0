//! Reflexes: limits of the arm's motion, independent of the controller's commands. The brakes stop an arm that is beyond one of these
//! limits.
//!
//! A command that passes the [`Gate`](crate::Gate) may still drive a light joint far beyond its speed limit. Reflexes therefore watch the
//! motor side of every joint as the drives' own encoders measure it: without the noise and the delay that `[sensors]` gives to controllers.
//!
//! Each limit follows from the limits of the arm file:
//!
//! - **speed**: a joint may move at [`ReflexSpec::speed`] times its speed limit. The drive checks every sub-step and looks ahead by one: it
//!   compares the speed that the present acceleration would lead to. The brakes bring a joint to rest without accelerating it, so that no
//!   joint exceeds this limit under a torque.
//! - **position**: the point where the brakes would bring a joint to rest, q + v|v|/(2 a), must be within its range; a is the deceleration
//!   of the brakes. A motion within range and acceleration limits always satisfies this.
//! - **acceleration**: a landing journal changes the speed of a light joint within a tick, by impacts that no drive makes or prevents. The
//!   reflex therefore compares the acceleration after a low-pass with the time constant t = v_max/a_max: the time that the joint needs from
//!   rest to its speed limit at its acceleration limit. An impact that changes the speed by less than v_max passes, whatever its
//!   acceleration; a lasting acceleration beyond the limit does not.
//! - **tracking**: a feedback of natural frequency ω answers the error e with a speed of ω e. If reference and joint diverge, each at its
//!   speed limit, their relative speed is 2 v_max; an error beyond 2 v_max/ω demands a speed that neither can have.
//! - **torque rate** (the gate enforces it): the greatest change in a tick that a correct controller commands reverses every joint from its
//!   greatest deceleration to its greatest acceleration, and answers an impact that gives each joint its speed limit: the mass matrix times
//!   2 (a_max + ω v_max). Without an acceleration limit a_max is v_max/T: no joint goes from rest to full speed within less than a tick T.
//!   The torque of a heavy joint, whose effort limit just suffices for its acceleration, may thus change by the whole limit; that of a
//!   light joint by a small part. A light joint that reacts to the motion of heavy joints would need a large change: no change of its
//!   torque alone may give it its speed limit within a tick.

use freeplay_arm::{Arm, Workspace, crba, jacobian};
use freeplay_shm::{Joints, MAX_JOINTS};
use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit_violation::{LimitViolation, Quantity};

/// Deceleration of a braking joint whose file gives neither acceleration nor effort limit, and the lower bound for a joint whose file gives
/// only an effort limit (some files give zero), rad/s² (m/s²).
const BRAKE_RATE: f64 = 10.0;

/// Limits beyond which the plant stops the arm. `inf` switches a limit off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ReflexSpec {
    /// Greatest speed of a joint, as a multiple of its speed limit.
    pub speed: f64,
    /// Greatest acceleration of a joint after a low-pass, as a multiple of its acceleration limit. Short impacts therefore do not stop the
    /// arm.
    pub acceleration: f64,
    /// True if the plant stops a joint that could not come to rest within its range.
    pub position: bool,
    /// Greatest tracking error of each joint, rad (m). Absent: twice its speed limit divided by `controller.gains.natural_frequency`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking: Option<Vec<f64>>,
    /// Greatest rate of each joint's commanded torque, N·m/s (N/s). Absent: the rate that reverses the greatest accelerations and corrects
    /// the greatest speed error in one tick, but at most the effort limit per tick.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_rate: Option<Vec<f64>>,
}

impl Default for ReflexSpec {
    fn default() -> Self {
        Self { speed: SPEED_MARGIN, acceleration: 1.0, position: true, tracking: None, torque_rate: None }
    }
}

/// Multiple of a speed limit up to which a measured speed counts as within it.
pub const SPEED_MARGIN: f64 = 1.05;

impl ReflexSpec {
    /// Describes the first invalid field for an arm of `joints` joints, in words.
    pub fn fault(&self, joints: usize) -> Option<String> {
        for (key, value) in [("speed", self.speed), ("acceleration", self.acceleration)] {
            if value.is_nan() || value <= 0.0 {
                return Some(format!(
                    "reflex.{key} = {value} is out of range; it must be above 0 (inf switches it off)"
                ));
            }
        }
        for (key, values) in [("tracking", &self.tracking), ("torque_rate", &self.torque_rate)] {
            let Some(values) = values else { continue };
            if values.len() != joints {
                return Some(format!(
                    "reflex.{key} has {} values; the arm has {joints} joints: give one for each",
                    values.len()
                ));
            }
            if let Some(value) = values.iter().find(|value| value.is_nan() || **value <= 0.0) {
                return Some(format!(
                    "reflex.{key} = {value} is out of range; it must be above 0 (inf switches it off)"
                ));
            }
        }
        None
    }
}

/// The limits of one arm, by joint; infinite where there is no limit.
#[derive(Clone, Debug, PartialEq)]
pub struct ReflexLimits {
    /// Greatest speed, rad/s (m/s).
    pub speed: Joints,
    /// Greatest lasting acceleration, rad/s² (m/s²).
    pub acceleration: Joints,
    /// Time constant of the low-pass of the acceleration, s.
    pub rise: Joints,
    /// Range, rad (m).
    pub range: [Joints; 2],
    /// Greatest distance from the reference, rad (m).
    pub tracking: Joints,
    /// Greatest rate of a commanded torque, N·m/s (N/s).
    pub torque_rate: Joints,
    /// Deceleration of the brakes, rad/s² (m/s²): the acceleration limit; without one, the effort limit over the joint's inertia.
    pub braking: Joints,
    /// Braking distance over the square of the speed, rad·s²/rad² (s²/m): stored, since every sub-step uses it.
    pub stopping: Joints,
    /// Greatest distance of the tool from its position on the nominal arm while every joint is within `tracking`, m.
    pub deviation: f64,
}

impl ReflexLimits {
    /// Limits of `arm` (with its motors and its load) along `postures`, under a feedback of the `natural_frequency`, rad/s, in ticks of
    /// `period` s.
    pub fn of(
        arm: &Arm,
        spec: &ReflexSpec,
        natural_frequency: f64,
        period: f64,
        postures: &[Vec<f64>],
    ) -> Self {
        let none = [f64::INFINITY; MAX_JOINTS];
        let mut limits = Self {
            speed: none,
            acceleration: none,
            rise: none,
            range: [[f64::NEG_INFINITY; MAX_JOINTS], none],
            tracking: none,
            torque_rate: none,
            braking: [BRAKE_RATE; MAX_JOINTS],
            stopping: [0.5 / BRAKE_RATE; MAX_JOINTS],
            deviation: 0.0,
        };
        let along = Along::of(arm, postures, |joint| {
            let of = &arm.joints()[joint].limits;
            let acceleration =
                if of.acceleration.is_finite() { of.acceleration } else { of.velocity / period };
            2.0 * (acceleration + natural_frequency * of.velocity)
        });
        for (i, joint) in arm.joints().iter().enumerate().take(MAX_JOINTS) {
            let of = &joint.limits;
            limits.speed[i] = spec.speed * of.velocity;
            if of.acceleration.is_finite() && of.velocity.is_finite() {
                limits.acceleration[i] = spec.acceleration * of.acceleration;
                limits.rise[i] = of.velocity / of.acceleration;
            }
            if spec.position {
                (limits.range[0][i], limits.range[1][i]) = (of.lower, of.upper);
            }
            let own = |given: &Option<Vec<f64>>| given.as_ref().and_then(|given| given.get(i).copied());
            limits.tracking[i] = own(&spec.tracking).unwrap_or(2.0 * of.velocity / natural_frequency);
            limits.torque_rate[i] = own(&spec.torque_rate).unwrap_or_else(|| {
                // In ticks so long that the feedback alone may exceed the speed limit within one tick, the feedback sets the bound.
                let at_once = (1.0 / period).max(2.0 * natural_frequency) * of.velocity / along.mobility[i];
                let needed = along.change[i].min(at_once) + 2.0 * joint.friction.coulomb;
                needed.min(of.effort) / period
            });
            limits.braking[i] = match (of.acceleration.is_finite(), of.effort.is_finite()) {
                (true, _) => of.acceleration,
                (false, true) => (of.effort / along.inertia[i]).max(BRAKE_RATE),
                (false, false) => BRAKE_RATE,
            };
            limits.stopping[i] = 0.5 / limits.braking[i];
            limits.deviation += along.lever[i] * limits.tracking[i];
        }
        limits
    }

    /// True if `joint` at `[q, v, a]`, checked again after `step` s, is within its limits of speed and position. The plant calls
    /// [`Self::excess`] only if this is false.
    #[inline]
    pub(crate) fn is_clear(&self, joint: usize, [q, v, a]: [f64; 3], step: f64) -> bool {
        let rest = q + v * v.abs() * self.stopping[joint];
        let [lower, upper] = &self.range;
        (v + a * step).abs() <= self.speed[joint] && rest <= upper[joint] && rest >= lower[joint]
    }

    /// The limit that `joint` at `[q, v, a]` violates before the next check, `step` s later.
    #[inline]
    pub(crate) fn excess(&self, joint: usize, [q, v, a]: [f64; 3], step: f64) -> Option<LimitViolation> {
        let next = v + a * step;
        let excess = |quantity, value, limit| Some(LimitViolation { quantity, joint, value, limit });
        if next.abs() > self.speed[joint] {
            return excess(Quantity::Speed, next.abs(), self.speed[joint]);
        }
        let rest = q + v * v.abs() * self.stopping[joint];
        let [lower, upper] = [self.range[0][joint], self.range[1][joint]];
        if rest > upper && v > 0.0 {
            return excess(Quantity::Position, rest, upper);
        }
        if rest < lower && v < 0.0 {
            return excess(Quantity::Position, rest, lower);
        }
        None
    }
}

/// Properties of an arm along its postures, by joint.
struct Along {
    /// Greatest change of the torque if the acceleration of every joint changes by the given amount, N·m (N).
    change: Joints,
    /// Greatest inertia about the joint with all others at rest, kg·m² (kg).
    inertia: Joints,
    /// Greatest acceleration of the joint per unit of its torque with all others free, 1/(kg·m²) (1/kg).
    mobility: Joints,
    /// Greatest displacement of the tool per unit of the joint, m/rad (1).
    lever: Joints,
}

impl Along {
    fn of(arm: &Arm, postures: &[Vec<f64>], acceleration: impl Fn(usize) -> f64) -> Self {
        let n = arm.dof().min(MAX_JOINTS);
        let none = [0.0; MAX_JOINTS];
        let mut along = Self { change: none, inertia: none, mobility: none, lever: none };
        let mut workspace = Workspace::new(arm);
        let (mut mass, mut lever) = (DMatrix::zeros(arm.dof(), arm.dof()), DMatrix::zeros(6, arm.dof()));
        for q in postures {
            crba(arm, &mut workspace, q, &mut mass);
            jacobian(arm, &mut workspace, q, &mut lever);
            let mobility = mass.clone().cholesky().map(|factor| factor.inverse());
            for joint in 0..n {
                if let Some(mobility) = &mobility {
                    along.mobility[joint] = along.mobility[joint].max(mobility[(joint, joint)]);
                }
                // Skips joints without inertial coupling: their acceleration limit may be infinite, and 0 · ∞ is NaN.
                let coupled = (0..n).filter(|&other| mass[(joint, other)] != 0.0);
                let change: f64 = coupled.map(|other| mass[(joint, other)].abs() * acceleration(other)).sum();
                along.change[joint] = along.change[joint].max(change);
                along.inertia[joint] = along.inertia[joint].max(mass[(joint, joint)]);
                along.lever[joint] = along.lever[joint].max(lever.fixed_view::<3, 1>(0, joint).norm());
            }
        }
        along
    }
}

/// Checks the joints at every tick.
#[derive(Clone, Debug)]
pub struct Reflexes {
    limits: ReflexLimits,
    period: f64,
    /// Each joint's speed through the low-pass, rad/s (m/s); absent before the first tick.
    slow: Option<Joints>,
}

impl Reflexes {
    /// Reflexes with these `limits` in ticks of `period` s.
    pub fn new(limits: ReflexLimits, period: f64) -> Self {
        Self { limits, period, slow: None }
    }

    /// The limits.
    pub fn limits(&self) -> &ReflexLimits {
        &self.limits
    }

    /// Checks the `joints`, each `[q, v, a]`, against their limits and against `reference`; returns the first violation.
    pub fn watch(&mut self, joints: &[[f64; 3]], reference: &[f64]) -> Option<LimitViolation> {
        let limits = &self.limits;
        let slow = self.slow.get_or_insert_with(|| {
            let mut slow = [0.0; MAX_JOINTS];
            slow.iter_mut().zip(joints).for_each(|(slow, [_, v, _])| *slow = *v);
            slow
        });
        let mut found = None;
        for (joint, &[q, v, a]) in joints.iter().enumerate().take(MAX_JOINTS) {
            // The output of the low-pass for v̇ is (v − v_slow)/t.
            let lasting = (v - slow[joint]).abs() / limits.rise[joint];
            slow[joint] += (v - slow[joint]) * (self.period / limits.rise[joint]).min(1.0);
            let error = reference.get(joint).map_or(0.0, |reference| (q - reference).abs());
            let beyond = |quantity, value: f64, limit: f64| {
                (value > limit).then_some(LimitViolation { quantity, joint, value, limit })
            };
            found = found
                .or_else(|| limits.excess(joint, [q, v, a], 0.0))
                .or_else(|| beyond(Quantity::Acceleration, lasting, limits.acceleration[joint]))
                .or_else(|| beyond(Quantity::Tracking, error, limits.tracking[joint]));
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::{ReflexLimits, ReflexSpec, Reflexes};
    use crate::Quantity;
    use freeplay_arm::{Workspace, crba};
    use freeplay_model::paper_arm;
    use nalgebra::DMatrix;

    const PERIOD: f64 = 1e-3;

    fn limits(spec: &ReflexSpec) -> ReflexLimits {
        ReflexLimits::of(&paper_arm().arm, spec, 50.0, PERIOD, &[vec![0.0; 6]])
    }

    /// The first violation of joint 6 of the paper's arm, which follows its reference, at the speeds `speed(tick)`.
    fn found(speed: impl Fn(u32) -> f64) -> Option<(u32, Quantity)> {
        let mut reflexes = Reflexes::new(limits(&ReflexSpec::default()), PERIOD);
        (0..500).find_map(|tick| {
            let mut joints = [[0.0; 3]; 6];
            joints[5][1] = speed(tick);
            reflexes.watch(&joints, &[0.0; 6]).map(|excess| (tick, excess.quantity))
        })
    }

    #[test]
    fn an_impact_passes_and_an_acceleration_that_lasts_does_not() {
        // Joint 6: 10.7 rad/s, 200 rad/s². An impact that changes its speed by 9 rad/s is 45 times its acceleration limit.
        assert_eq!(found(|tick| if tick < 100 { 0.0 } else { 9.0 }), None);
        assert_eq!(found(|tick| if tick % 40 < 20 { 4.0 } else { -4.0 }), None);
        // A reversal from one speed limit to the other at the acceleration limit is allowed; at twice that acceleration it is not.
        let reversal = |rate: f64| move |tick: u32| (-10.7 + rate * PERIOD * f64::from(tick)).min(10.7);
        assert_eq!(found(reversal(200.0)), None);
        let (tick, quantity) = found(reversal(400.0)).expect("too fast a reversal");
        assert_eq!(quantity, Quantity::Acceleration);
        assert!((30..54).contains(&tick), "{tick}");
        assert_eq!(found(|_| -11.3), Some((0, Quantity::Speed)));
    }

    #[test]
    fn a_joint_that_cannot_stop_within_its_range_is_found_in_time() {
        let limits = limits(&ReflexSpec::default());
        // Joint 2: up to 2.18 rad; from 2.0 rad/s it comes to rest in 2²/(2·80) = 25 mrad.
        let at = |q: f64, v: f64| limits.excess(1, [q, v, 0.0], 0.0).map(|excess| excess.quantity);
        assert_eq!((at(2.154, 2.0), at(2.156, 2.0)), (None, Some(Quantity::Position)));
        assert_eq!((at(2.156, -2.0), at(-1.12, -2.0)), (None, Some(Quantity::Position)));
        let off = ReflexSpec { position: false, ..ReflexSpec::default() };
        assert_eq!(self::limits(&off).excess(1, [9.0, 2.0, 0.0], 0.0), None);
    }

    #[test]
    fn a_joint_far_from_its_reference_is_found() {
        let mut reflexes = Reflexes::new(limits(&ReflexSpec::default()), PERIOD);
        let joints = [[0.0; 3]; 6];
        let mut reference = [0.0; 6];
        // 2 · 2.7/50 rad.
        reference[2] = 0.107;
        assert_eq!(reflexes.watch(&joints, &reference), None);
        reference[2] = 0.109;
        let excess = reflexes.watch(&joints, &reference).expect("too far");
        assert_eq!((excess.quantity, excess.joint), (Quantity::Tracking, 2));
        assert!((excess.limit - 0.108).abs() < 1e-12 && excess.value > excess.limit);
    }

    #[test]
    fn no_step_of_a_torque_gives_its_joint_the_speed_limit_within_a_tick() {
        let arm = paper_arm().arm;
        let postures: Vec<Vec<f64>> =
            (0..6).map(|k| (0..6).map(|joint| 0.4 * f64::from((k * joint) % 5) - 0.8).collect()).collect();
        let limits = ReflexLimits::of(&arm, &ReflexSpec::default(), 50.0, PERIOD, &postures);
        let (mut workspace, mut mass) = (Workspace::new(&arm), DMatrix::zeros(6, 6));
        let mut greatest = [0.0_f64; 6];
        for q in &postures {
            crba(&arm, &mut workspace, q, &mut mass);
            let mobility = mass.clone().try_inverse().expect("a mass matrix");
            for (joint, greatest) in greatest.iter_mut().enumerate() {
                let torque = limits.torque_rate[joint] * PERIOD;
                let speed = mobility[(joint, joint)] * torque * PERIOD;
                *greatest = greatest.max(speed / limits.speed[joint]);
            }
        }
        println!("of the speed limit in a tick: {greatest:.3?}");
        let (heavy, light) = greatest.split_at(3);
        // No torque step alone gives a joint its speed limit within a tick.
        assert!(light.iter().all(|light| *light <= 1.0), "{greatest:?}");
        for (joint, share) in heavy.iter().enumerate() {
            assert_eq!(limits.torque_rate[joint], arm.joints()[joint].limits.effort / PERIOD);
            assert!(light.iter().all(|light| share < light), "joint {joint}: {greatest:?}");
        }
    }

    #[test]
    fn without_acceleration_limits_the_effort_brakes() {
        let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/arm.urdf");
        let arm = freeplay_model::load(urdf.as_ref()).expect("the arm").arm;
        let limits = ReflexLimits::of(&arm, &ReflexSpec::default(), 50.0, PERIOD, &[vec![0.0; 6]]);
        println!("rad/s²: {:?}", &limits.braking[..6]);
        // 100 N·m on 0.0021 kg·m² about the last joint, 3000 N·m on some tens about the first.
        assert!((4e4..6e4).contains(&limits.braking[5]), "{}", limits.braking[5]);
        assert!((30.0..300.0).contains(&limits.braking[0]), "{}", limits.braking[0]);
        assert!(limits.acceleration[..6].iter().all(|limit| limit.is_infinite()));
        assert!(
            self::limits(&ReflexSpec::default()).braking[..6] == [80.0, 80.0, 100.0, 200.0, 200.0, 200.0]
        );
    }

    #[test]
    fn limits_follow_from_the_arm_and_faults_are_told() {
        let limits = limits(&ReflexSpec::default());
        let effort = paper_arm().arm.joints().iter().map(|joint| joint.limits.effort).collect::<Vec<_>>();
        println!("N·m/s: {:?}", &limits.torque_rate[..6]);
        // Heavy joints may use the whole effort limit as rate; a light joint needs a small part of it.
        assert_eq!(limits.torque_rate[0], effort[0] / PERIOD);
        assert!(limits.torque_rate[5] < 0.1 * effort[5] / PERIOD, "{}", limits.torque_rate[5]);
        assert!(limits.torque_rate[6].is_infinite() && limits.deviation > 0.1, "{}", limits.deviation);
        let given = ReflexSpec { torque_rate: Some(vec![5.0; 6]), ..ReflexSpec::default() };
        assert_eq!(self::limits(&given).torque_rate[3], 5.0);
        let few = ReflexSpec { tracking: Some(vec![1.0; 5]), ..ReflexSpec::default() };
        assert!(few.fault(6).is_some_and(|fault| fault.contains("5 values; the arm has 6 joints")));
        let nan = ReflexSpec { speed: f64::NAN, ..ReflexSpec::default() };
        assert!(nan.fault(6).is_some_and(|fault| fault.contains("reflex.speed")));
        assert_eq!(given.fault(6), None);
    }
}
