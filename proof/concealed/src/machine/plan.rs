//! The constant description of the true machine.

use freeplay_arm::{Arm, ArmError};
use nalgebra::{Isometry3, Vector3};
use thiserror::Error;

use super::bristles::Bristles;
use super::cable::Cable;
use super::drive::Drive;
use super::dry_bearing::{DryBearing, Push};
use super::film::OilBearing;
use super::transmission::Transmission;

/// Reason why a machine can't be built, or failed while running.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PlanError {
    /// The effects give no valid arm.
    #[error("the arm with these effects can't be built: {0}")]
    Arm(#[from] ArmError),
    /// An effect at an impossible place.
    #[error("{kind} can't sit at joint number {joint:?} (from 0): {why}")]
    Seat {
        /// Kind of the effect.
        kind: String,
        /// The joint.
        joint: Option<usize>,
        /// The reason.
        why: &'static str,
    },
    /// A coordinate is no longer finite.
    #[error(
        "coordinate number {coordinate} is not finite at t = {time} s: the effects are too strong for this machine"
    )]
    NotFinite {
        /// Its index, from 0.
        coordinate: usize,
        /// Time, s.
        time: f64,
    },
}

/// The true machine. Its coordinates are those of `Plan::arm`, the arm with all further moving parts (journals in their bearings, a rocking base, a swinging
/// load), then one for each motor that can move against its link.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(crate) arm: Arm,
    /// From this time on, s, the machine has another arm.
    pub(crate) after: Option<(f64, Arm)>,
    /// The coordinate of every joint.
    pub(crate) link: Vec<usize>,
    /// The coordinate of every motor: that of its joint, or one of its own.
    pub(crate) motor: Vec<usize>,
    pub(crate) tool_link: usize,
    pub(crate) tool: Isometry3<f64>,
    pub(crate) drives: Vec<Drive>,
    pub(crate) encoders: Vec<Encoder>,
    pub(crate) bristles: Vec<Option<Bristles>>,
    pub(crate) cables: Vec<Option<Cable>>,
    pub(crate) transmissions: Vec<Transmission>,
    pub(crate) springs: Vec<Spring>,
    pub(crate) bearings: Vec<Bearing>,
    /// Inertia in addition to the arm's: coordinate, coordinate, kg·m², both triangles.
    pub(crate) inertia: Vec<(usize, usize, f64)>,
    pub(crate) shafts: Vec<Shaft>,
    pub(crate) push: Option<ToolForce>,
    /// Delays and filters of the sensors.
    pub(crate) sensor_dynamics: SensorDynamics,
    /// Short steps in each long one.
    pub(crate) substeps: usize,
}

/// A spring and damper on one coordinate, N·m/rad and N·m·s/rad.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spring {
    pub coordinate: usize,
    pub stiffness: f64,
    pub damping: f64,
    pub rest: f64,
}

/// A journal free in its bearing: coordinates `slides` and the next are its position in the plane, `turn` is its joint.
#[derive(Clone, Debug)]
pub(crate) struct Bearing {
    pub slides: usize,
    pub turn: usize,
    pub law: BearingLaw,
}

#[derive(Clone, Debug)]
pub(crate) enum BearingLaw {
    Dry(DryBearing),
    Oil(OilBearing),
}

impl BearingLaw {
    pub fn push(&self, x: [f64; 2], u: [f64; 2], spin: f64) -> Push {
        match self {
            BearingLaw::Dry(law) => law.push(x, u, spin),
            BearingLaw::Oil(law) => law.push(x, u, spin),
        }
    }
}

/// A shaft that turns with v_i + s v_j: friction, N·m·s/rad and N·m. Its inertia is in [`Plan::inertia`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaft {
    pub joint: usize,
    pub with: usize,
    pub sign: f64,
    pub viscous: f64,
    pub coulomb: f64,
}

/// A force on the tool in a window of time: N, s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToolForce {
    pub force: Vector3<f64>,
    pub start: f64,
    pub end: f64,
}

/// Errors of an encoder.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Encoder {
    /// Zero, rad.
    pub zero: f64,
    /// Amplitude and phase of a sin(q + φ).
    pub eccentricity: Option<(f64, f64)>,
    /// Jump, rad, at a time, s.
    pub slip: Option<(f64, f64)>,
}

impl Encoder {
    /// The reading at position `q` and time `t`, before it is rounded.
    pub fn reading(&self, q: f64, t: f64) -> f64 {
        let mut reading = q + self.zero;
        if let Some((amplitude, phase)) = self.eccentricity {
            reading += amplitude * (q + phase).sin();
        }
        match self.slip {
            Some((jump, at)) if t >= at => reading + jump,
            _ => reading,
        }
    }
}

/// Delays and filters of the recording, beyond the tolerances.
#[derive(Clone, Debug, Default)]
pub(crate) struct SensorDynamics {
    /// Delay of the torques, s.
    pub torque_delay: f64,
    /// Delay of the tool, s.
    pub tool_delay: f64,
    /// Cutoff of the filter of each joint's torque, Hz; infinite without a filter.
    pub cutoff: Vec<f64>,
}

impl Plan {
    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.link.len()
    }

    /// Number of coordinates: the arm's and the motors'.
    pub(crate) fn coordinates(&self) -> usize {
        self.arm.dof() + self.transmissions.len()
    }

    /// The arm at time `t`, s.
    pub(crate) fn arm_at(&self, t: f64) -> &Arm {
        match &self.after {
            Some((at, arm)) if t >= *at => arm,
            _ => &self.arm,
        }
    }
}
