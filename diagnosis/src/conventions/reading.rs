//! The reading of a recording: the arm's joint positions, torques and clock from the recorded columns.

use freeplay_arm::{Arm, JointKind};
use freeplay_recording::{Recording, shifted, unwrapped};
use nalgebra::Vector3;

/// Reading of one joint's position.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionReading {
    /// The recorded column, from 0.
    pub source: usize,
    /// Factor from the recorded unit to rad (m): π/180 for degrees.
    pub unit: f64,
    /// 1, or −1 for a joint of inverted direction.
    pub sign: f64,
    /// Offset to subtract from the signed position, rad (m).
    pub zero: f64,
    /// Another joint whose position times a factor is subtracted: the recorded position is relative to that joint.
    pub relative: Option<(usize, f64)>,
}

/// Reading of one joint's torque.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueReading {
    /// The recorded column, from 0.
    pub source: usize,
    /// Factor from the recorded value to N·m (N), sign included.
    pub factor: f64,
}

/// Reading of a recording for a model; [`Reading::plain`] changes nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// Factor from the recorded time to s.
    pub time_unit: f64,
    /// True if positions that jump by whole turns are unwrapped.
    pub unwrap: bool,
    /// Reading of each position, by joint of the model.
    pub positions: Vec<PositionReading>,
    /// Reading of each torque, by joint of the model.
    pub torques: Vec<TorqueReading>,
    /// True if the model's gravity has to be added to the recorded torques, from which it was subtracted.
    pub gravity_added: bool,
    /// Gravity in the base frame if it differs from the model's, m/s².
    pub gravity: Option<Vector3<f64>>,
    /// Delay of the torques behind the positions, s.
    pub torque_delay: f64,
    /// Delay of the tool behind the positions, s.
    pub tool_delay: f64,
}

impl Reading {
    /// The recording of an arm of `joints` joints as it stands.
    pub fn plain(joints: usize) -> Self {
        let position = |source| PositionReading { source, unit: 1.0, sign: 1.0, zero: 0.0, relative: None };
        Self {
            time_unit: 1.0,
            unwrap: false,
            positions: (0..joints).map(position).collect(),
            torques: (0..joints).map(|source| TorqueReading { source, factor: 1.0 }).collect(),
            gravity_added: false,
            gravity: None,
            torque_delay: 0.0,
            tool_delay: 0.0,
        }
    }

    /// Returns true if the reading changes nothing.
    pub fn is_plain(&self) -> bool {
        *self == Self::plain(self.positions.len())
    }

    /// Exchanges the readings of two joints of the model, positions and torques.
    pub(crate) fn exchange(&mut self, one: usize, other: usize) {
        let sources = (self.positions[one].source, self.positions[other].source);
        (self.positions[other].source, self.positions[one].source) = sources;
        let sources = (self.torques[one].source, self.torques[other].source);
        (self.torques[other].source, self.torques[one].source) = sources;
    }

    /// Positions, velocities or accelerations of the model's joints from the recorded `columns`; only positions have zeros.
    pub(crate) fn motion(&self, columns: &[Vec<f64>], has_zeros: bool) -> Vec<Vec<f64>> {
        let read = |reading: &PositionReading| -> Vec<f64> {
            let (factor, zero) = (reading.sign * reading.unit, if has_zeros { reading.zero } else { 0.0 });
            columns[reading.source].iter().map(|x| factor * x - zero).collect()
        };
        let mut motion: Vec<Vec<f64>> = self.positions.iter().map(read).collect();
        for (joint, reading) in self.positions.iter().enumerate() {
            let Some((other, factor)) = reading.relative else { continue };
            let others = motion[other].clone();
            motion[joint].iter_mut().zip(&others).for_each(|(x, other)| *x -= factor * other);
        }
        motion
    }

    /// The model's arm under the gravity that the recording shows.
    pub fn arm(&self, arm: &Arm) -> Arm {
        self.gravity.map_or_else(|| arm.clone(), |gravity| arm.with_gravity(gravity))
    }

    /// `recording` under this reading: rad, N·m and s, joints in the order of the model, on one clock.
    pub fn mended(&self, arm: &Arm, recording: &Recording) -> Recording {
        let mut mended = recording.clone();
        mended.t.iter_mut().for_each(|t| *t *= self.time_unit);
        let unwrapped = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let one = |(source, column): (usize, &Vec<f64>)| {
                let is_turning =
                    arm.joints().get(source).is_some_and(|joint| joint.kind == JointKind::Revolute);
                let smooth = if self.unwrap && is_turning { unwrapped(column) } else { None };
                smooth.unwrap_or_else(|| column.clone())
            };
            columns.iter().enumerate().map(one).collect()
        };
        mended.q = self.motion(&unwrapped(&recording.q), true);
        mended.q_ref = recording.q_ref.as_ref().map(|columns| self.motion(&unwrapped(columns), true));
        mended.qd = recording.qd.as_ref().map(|columns| self.motion(columns, false));
        mended.q_link = self.links(recording, &mended.q);
        self.mend_torques(&self.arm(arm), recording, &mut mended);
        if let Some(tool) = &mut mended.tool {
            tool.iter_mut().for_each(|column| *column = shifted(&mended.t, column, self.tool_delay));
        }
        if let Some(turned) = &mut mended.orientation {
            turned.iter_mut().for_each(|column| *column = shifted(&mended.t, column, self.tool_delay));
        }
        mended
    }

    /// Link encoders, with the reading of the motors' positions; relative coordinates use the positions `q` of the other joints.
    fn links(&self, recording: &Recording, q: &[Vec<f64>]) -> Vec<Option<Vec<f64>>> {
        let read = |reading: &PositionReading| -> Option<Vec<f64>> {
            let column = recording.q_link.get(reading.source)?.as_ref()?;
            let factor = reading.sign * reading.unit;
            let relative = |row: usize| reading.relative.map_or(0.0, |(other, k)| k * q[other][row]);
            let rows = column.iter().enumerate();
            Some(rows.map(|(row, x)| factor * x - reading.zero - relative(row)).collect())
        };
        self.positions.iter().map(read).collect()
    }

    fn mend_torques(&self, arm: &Arm, recording: &Recording, mended: &mut Recording) {
        let Some(recorded) = &recording.tau else { return };
        let read = |reading: &TorqueReading| -> Vec<f64> {
            let column: Vec<f64> = recorded[reading.source].iter().map(|x| reading.factor * x).collect();
            shifted(&mended.t, &column, self.torque_delay)
        };
        let mut torques: Vec<Vec<f64>> = self.torques.iter().map(read).collect();
        if self.gravity_added {
            let (mut ws, n) = (freeplay_arm::Workspace::new(arm), arm.dof());
            let (mut q, mut held) = (vec![0.0; n], vec![0.0; n]);
            for row in 0..mended.t.len() {
                q.iter_mut().zip(&mended.q).for_each(|(q, column)| *q = column[row]);
                freeplay_arm::gravity_torque(arm, &mut ws, &q, &mut held);
                torques.iter_mut().zip(&held).for_each(|(column, held)| column[row] += held);
            }
        }
        mended.tau = Some(torques);
    }
}
