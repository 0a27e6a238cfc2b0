//! The contributions of effects to a plant. The plant calls these laws at every sub-step, or at every tick for sensors; none of them
//! allocates.

use std::fmt::Debug;

use nalgebra::Vector3;

use crate::{Archive, Clearance};

/// Everything that the effects of an arm file add to a plant, besides their changes of the arm.
#[derive(Debug, Default)]
pub struct Injection {
    /// Radial play by joint index.
    pub clearances: Vec<(usize, Clearance)>,
    /// Joints whose journals float in oil.
    pub films: Vec<usize>,
    /// Transmissions between motor and link, by joint index; at most one per joint in [`crate::Effects::injection`].
    pub transmissions: Vec<(usize, Transmission)>,
    /// Rotor inertia that the effects add, by joint index, kg·m² (kg): to be added to [`freeplay_arm::Joint::rotor_inertia`].
    pub rotors: Vec<(usize, f64)>,
    /// Torques on the drives.
    pub drives: Vec<Box<dyn DriveLaw>>,
    /// Position servos by joint index.
    pub servos: Vec<(usize, ServoLaw)>,
    /// Time from a command to its effect, by joint index, s.
    pub command_delays: Vec<(usize, f64)>,
    /// Torque beyond which a drive clips, by joint index, N·m (N).
    pub saturations: Vec<(usize, f64)>,
    /// Forces on the tool.
    pub forces: Vec<ToolForce>,
    /// Displacements of the tool from its position by the joints: bending, elastic or floating. The plant applies these laws to the true
    /// state, before the sensors.
    pub tool: Vec<Box<dyn SensorLaw>>,
    /// Laws of the sensors, which turn the true state into measurements.
    pub sensors: Vec<Box<dyn SensorLaw>>,
}

/// A position servo: τ = k e′ − d q̇, with e′ the error less the dead band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoLaw {
    /// k, N·m/rad (N/m), > 0.
    pub stiffness: f64,
    /// d, N·m·s/rad (N·s/m), ≥ 0.
    pub damping: f64,
    /// Error below which it gives no torque, rad (m), ≥ 0.
    pub deadband: f64,
    /// Greatest torque, N·m (N); infinite if none.
    pub torque_limit: f64,
    /// Greatest speed of the set-point, rad/s (m/s); infinite if none.
    pub speed_limit: f64,
    /// Step to which commands are rounded down, rad (m); 0 if none.
    pub resolution: f64,
    /// Set-point minus command, rad (m).
    pub offset: f64,
}

/// A torque on the drives that depends on the state of the joints. It may have state variables.
pub trait DriveLaw: Debug + Send {
    /// Adds the torque on each joint to `torque`, N·m (N): friction opposes the motion, so a law subtracts it.
    fn act(&mut self, now: &DriveState, torque: &mut [f64]);

    /// Resets the state variables: the plant starts anew.
    fn restart(&mut self) {}

    /// Saves the state variables of the law to `archive`, or restores them from it. A law without state does nothing here.
    fn transfer_state(&mut self, archive: &mut Archive);
}

/// The joints at a sub-step.
#[derive(Clone, Copy, Debug)]
pub struct DriveState<'a> {
    /// Simulated time, s.
    pub t: f64,
    /// Length of the sub-step, s.
    pub step: f64,
    /// Motor-side positions of the nominal joints, rad (m).
    pub q: &'a [f64],
    /// Their velocities, rad/s (m/s).
    pub v: &'a [f64],
    /// The share of its dry friction that acts on each joint, −1 to 1. A joint that slides has the sign of its velocity; a joint that sticks has the share that holds it.
    pub sign: &'a [f64],
    /// Torques that stop a unit of velocity of each joint within the sub-step, N·m·s/rad (N·s/m): for laws whose dry friction has a sign of its own.
    pub stopping: &'a [f64],
    /// Their accelerations in the sub-step before, rad/s² (m/s²).
    pub a: &'a [f64],
    /// Torque that each transmission carried to its link in the sub-step before, N·m (N).
    pub load: &'a [f64],
}

/// A transmission between a motor and its link: τ = k·dead(θ − q) + d(θ̇ − q̇) while the flanks touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// k, N·m/rad (N/m), > 0.
    pub stiffness: f64,
    /// d, N·m·s/rad (N·s/m), ≥ 0.
    pub damping: f64,
    /// Full width of the gap, rad (m), ≥ 0.
    pub gap: f64,
}

impl Transmission {
    /// Both transmissions in series: gaps and compliances add up. Two dampings combine in series; a single one stays.
    pub fn in_series(self, other: Transmission) -> Transmission {
        let series = |a: f64, b: f64| a * b / (a + b);
        let damping = match (self.damping > 0.0, other.damping > 0.0) {
            (true, true) => series(self.damping, other.damping),
            _ => self.damping.max(other.damping),
        };
        let stiffness = series(self.stiffness, other.stiffness);
        Transmission { stiffness, damping, gap: self.gap + other.gap }
    }
}

/// A force on the tool in the base frame during a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolForce {
    /// Force, base frame, N.
    pub force: Vector3<f64>,
    /// Start of the window, s.
    pub start: f64,
    /// End of the window, s.
    pub end: f64,
}

/// A law of a sensor, or of a displacement of the tool. The plant calls it once a tick, in the order of the arm file; the law may have
/// state variables.
pub trait SensorLaw: Debug + Send {
    /// Changes the readings of a tick.
    fn read(&mut self, readings: &mut Readings);

    /// Resets the state variables: the plant starts anew.
    fn restart(&mut self) {}

    /// Saves the state variables of the law to `archive`, or restores them from it. A law without state does nothing here.
    fn transfer_state(&mut self, archive: &mut Archive);
}

/// Measurements of one tick, before noise and rounding.
#[derive(Debug)]
pub struct Readings<'a> {
    /// Time between two readings, s.
    pub period: f64,
    /// Motor-side positions, rad (m).
    pub q: &'a mut [f64],
    /// Velocities, rad/s (m/s).
    pub v: &'a mut [f64],
    /// Torques, N·m (N).
    pub torque: &'a mut [f64],
    /// Link-side positions, rad (m).
    pub link: &'a mut [f64],
    /// Tool position in the base frame, m.
    pub tool: &'a mut [f64],
}
