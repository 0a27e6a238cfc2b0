//! The machine's own controller: computed feed-forward from the data sheet, and a PID on quantised encoders at 1 kHz.

use freeplay_arm::{Arm, Workspace, rnea};

use crate::effective_inertia::EffectiveInertia;

/// Servo period, s.
const PERIOD: f64 = 1e-3;
/// Cutoff of the filter of differentiated encoder readings, Hz.
const SPEED_CUTOFF: f64 = 200.0;
/// Damping ratio of a joint with its effective inertia.
const DAMPING: f64 = 0.9;

/// Settings of a servo.
#[derive(Clone, Debug, PartialEq)]
pub struct Servo {
    /// Undamped frequency of each joint's loop, rad/s.
    pub bandwidth: f64,
    /// Integral over proportional gain, 1/s.
    pub integral: f64,
    /// Speed below which the feed-forward of dry friction is faded, as a share of the joint's largest speed.
    pub creep: f64,
    /// Step of each encoder, rad or m.
    pub resolution: Vec<f64>,
}

/// A running servo.
pub(crate) struct Controller<'a> {
    servo: &'a Servo,
    ws: Workspace,
    effective_inertia: EffectiveInertia,
    last: Option<Vec<f64>>,
    speed: Vec<f64>,
    sum: Vec<f64>,
}

impl Servo {
    /// A servo for the arm `nominal`, at rest.
    pub(crate) fn start<'a>(&'a self, nominal: &Arm) -> Controller<'a> {
        let n = nominal.dof();
        Controller {
            servo: self,
            ws: Workspace::new(nominal),
            effective_inertia: EffectiveInertia::new(nominal),
            last: None,
            speed: vec![0.0; n],
            sum: vec![0.0; n],
        }
    }
}

impl Controller<'_> {
    /// One cycle: computes the torque of each motor for the reference position, velocity and acceleration, and the encoders' positions.
    pub fn torque(&mut self, nominal: &Arm, reference: &[Vec<f64>; 3], positions: &[f64], out: &mut [f64]) {
        let [q, v, a] = reference;
        rnea(nominal, &mut self.ws, q, v, a, out);
        let rounded: Vec<f64> =
            positions.iter().zip(&self.servo.resolution).map(|(x, step)| (x / step).round() * step).collect();
        // The effective inertia with the other joints free: gains for more would make a joint chatter if its neighbours yield.
        let inertias = self.effective_inertia.at(nominal, q);
        let share = 1.0 - (-std::f64::consts::TAU * SPEED_CUTOFF * PERIOD).exp();
        for (i, joint) in nominal.joints().iter().enumerate() {
            let difference = self.last.as_ref().map_or(0.0, |last| (rounded[i] - last[i]) / PERIOD);
            self.speed[i] += share * (difference - self.speed[i]);
            let error = q[i] - rounded[i];
            let inertia = inertias.as_ref().map_or(0.0, |inertias| inertias[i]);
            let stiffness = inertia * self.servo.bandwidth * self.servo.bandwidth;
            self.sum[i] += stiffness * self.servo.integral * PERIOD * error;
            self.sum[i] = self.sum[i].clamp(-0.3 * joint.limits.effort, 0.3 * joint.limits.effort);
            let damping = 2.0 * DAMPING * inertia * self.servo.bandwidth;
            let creep = self.servo.creep * joint.limits.velocity;
            let friction =
                joint.friction.viscous * v[i] + joint.friction.coulomb * (v[i] / creep).clamp(-1.0, 1.0);
            let torque =
                out[i] + friction + stiffness * error + damping * (v[i] - self.speed[i]) + self.sum[i];
            out[i] = torque.clamp(-joint.limits.effort, joint.limits.effort);
        }
        self.last = Some(rounded);
    }
}
