//! The motion of a machine under its servo controller.

use freeplay_arm::{Arm, Workspace, forward_kinematics};

use super::plan::{Plan, PlanError};
use super::step::Stepper;
use crate::motion::Motion;
use crate::servo::Servo;

/// The long step, s.
pub(crate) const LONG_STEP: f64 = 0.5e-3;
/// Long steps from one servo cycle to the next: 1 kHz.
const SERVO_EVERY: u64 = 2;
/// Long steps from one point of the trace to the next.
const TRACE_EVERY: u64 = 1;
/// Time constant of the motors' currents, s.
const CURRENT_LAG: f64 = 0.4e-3;
/// The machine holds its first posture for this time before the recording begins, s.
const SETTLING: f64 = 1.5;
/// The simulation continues for this time beyond the motion's end, s, for delayed channels.
const AFTER: f64 = 0.02;

/// Motion of a machine, without noise: rows at equal time steps.
#[derive(Clone, Debug)]
pub struct Trace {
    joints: usize,
    /// Time of the first row, s.
    pub(crate) start: f64,
    /// Time between rows, s.
    pub(crate) step: f64,
    /// Motor positions, link positions, torques by current, tool position; row by row.
    rows: Vec<f64>,
}

impl Trace {
    fn width(joints: usize) -> usize {
        3 * joints + 3
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len() / Self::width(self.joints)
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Motor positions (rad or m) of row `row`.
    pub fn motor(&self, row: usize) -> &[f64] {
        self.part(row, 0, self.joints)
    }

    /// Link positions (rad or m) of row `row`.
    pub fn link(&self, row: usize) -> &[f64] {
        self.part(row, self.joints, self.joints)
    }

    /// Torques (N·m or N) by the motors' currents of row `row`.
    pub fn torque(&self, row: usize) -> &[f64] {
        self.part(row, 2 * self.joints, self.joints)
    }

    /// Tool position (m) of row `row`.
    pub fn tool(&self, row: usize) -> &[f64] {
        self.part(row, 3 * self.joints, 3)
    }

    fn part(&self, row: usize, from: usize, len: usize) -> &[f64] {
        let begin = row * Self::width(self.joints) + from;
        &self.rows[begin..begin + len]
    }
}

impl Plan {
    /// Runs the machine through `motion` for `duration` s, under a servo controller whose model is the data sheet `nominal`.
    ///
    /// # Errors
    /// [`PlanError::NotFinite`].
    pub fn run(
        &self,
        nominal: &Arm,
        servo: &Servo,
        motion: &Motion,
        duration: f64,
    ) -> Result<Trace, PlanError> {
        let n = self.joints();
        let mut reference = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
        let [q, v, a] = &mut reference;
        motion.at(0.0, q, v, a);
        let first: Vec<f64> =
            q.iter().zip(&self.encoders).map(|(q, e)| q - (e.reading(*q, 0.0) - q)).collect();
        let settling = (SETTLING / LONG_STEP).round() as u64;
        let steps = settling + ((duration + AFTER) / LONG_STEP).ceil() as u64;
        let mut machine = Stepper::new(self, -SETTLING, &first);
        let mut controller = servo.start(nominal);
        let (mut wanted, mut current) = (vec![0.0; n], vec![0.0; n]);
        let mut readings = vec![0.0; n];
        let mut trace =
            Trace { joints: n, start: -0.02, step: TRACE_EVERY as f64 * LONG_STEP, rows: Vec::new() };
        let recorded = settling - (0.02 / LONG_STEP).round() as u64;
        let mut pose = Workspace::new(&self.arm);
        let follow = 1.0 - (-LONG_STEP / CURRENT_LAG).exp();
        for k in 0..steps {
            let t = (k as f64 - settling as f64) * LONG_STEP;
            machine.t = t;
            if k.is_multiple_of(SERVO_EVERY) {
                let [q, v, a] = &mut reference;
                motion.at(t, q, v, a);
                for (joint, reading) in readings.iter_mut().enumerate() {
                    *reading = self.encoders[joint].reading(machine.x[self.motor[joint]], t);
                }
                controller.torque(nominal, &reference, &readings, &mut wanted);
                if k == 0 {
                    current.copy_from_slice(&wanted);
                }
            }
            if k >= recorded && (k - recorded).is_multiple_of(TRACE_EVERY) {
                self.note(&mut trace, &mut pose, &machine, &current);
            }
            machine.long_step(&current, LONG_STEP)?;
            current.iter_mut().zip(&wanted).for_each(|(i, wanted)| *i += follow * (wanted - *i));
        }
        Ok(trace)
    }

    fn note(&self, trace: &mut Trace, ws: &mut Workspace, machine: &Stepper<'_>, current: &[f64]) {
        trace.rows.extend(self.motor.iter().map(|&at| machine.x[at]));
        trace.rows.extend(self.link.iter().map(|&at| machine.x[at]));
        trace.rows.extend_from_slice(current);
        forward_kinematics(&self.arm, ws, &machine.x[..self.arm.dof()]);
        let tool = ws.link_pose(self.tool_link) * self.tool;
        trace.rows.extend_from_slice(tool.translation.vector.as_slice());
    }
}
