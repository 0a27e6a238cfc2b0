//! The concealed truth of a case.

use serde::Serialize;

use crate::distinct::Equivalent;

/// One concealed effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TruthEffect {
    /// Its kind.
    pub kind: String,
    /// Name of its joint in the arm file; `None` for the whole arm.
    pub joint: Option<String>,
    /// Its parameters, SI.
    pub parameters: serde_json::Value,
    /// Parameters with hardly any trace of their own: not to be scored.
    pub weak: Vec<&'static str>,
    /// Other names that explain the recording as well: to be accepted as right.
    pub equivalents: Vec<Equivalent>,
    /// True if it belongs to the catalogue.
    pub catalogued: bool,
    /// `slight`, `clear` or `strong`.
    pub severity: &'static str,
    /// Root mean square of its trace over that of noise and tolerances, in the channel where this is largest.
    pub signal_to_floor: f64,
    /// That channel.
    pub channel: String,
}

/// The concealed effects of a case, and its settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Truth {
    /// Name of the format.
    pub schema: &'static str,
    /// The seed of the case.
    pub seed: u64,
    /// The machine.
    pub machine: String,
    /// Its joints.
    pub joints: usize,
    /// Noise level.
    pub noise: String,
    /// Family of the motion, and of the second one.
    pub families: [String; 2],
    /// Samples per second, Hz, and length of both recordings, s.
    pub rate: f64,
    /// See `rate`.
    pub duration: f64,
    /// The effects; empty for a negative control.
    pub effects: Vec<TruthEffect>,
}

/// The schema of [`Truth`] as JSON.
pub(crate) const SCHEMA: &str = "freeplay.truth/1";

/// Parameters of `kind` with hardly any trace of their own.
pub(crate) fn weak(kind: &str) -> Vec<&'static str> {
    match kind {
        "joint_clearance" => vec!["stiffness", "restitution", "friction"],
        "lubricated_clearance" => vec!["viscosity"],
        "backlash" => vec!["stiffness"],
        "joint_elasticity" | "presliding_friction" => vec!["damping"],
        _ => Vec::new(),
    }
}
