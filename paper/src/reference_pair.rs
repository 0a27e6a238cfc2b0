//! Figures of a reference run and of our run of the same case.

use serde::{Deserialize, Serialize};

/// Figures of a run, of the reference or ours.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Figures {
    /// Share of the time in free flight.
    pub free: Option<f64>,
    /// Share in impacts.
    pub impact: Option<f64>,
    /// Share in continuous contact.
    pub continuous: Option<f64>,
    /// Number of contacts.
    pub n_contacts: Option<f64>,
    /// Peak normal force, N.
    #[serde(rename = "peak_FN")]
    pub peak_normal: Option<f64>,
    /// Peak force of joint 1, N.
    #[serde(rename = "peak_J1")]
    pub peak_base: f64,
    /// RMS of the deviation along x, mm.
    pub rms_x: f64,
    /// RMS along y, mm.
    pub rms_y: f64,
    /// RMS along z, mm.
    pub rms_z: f64,
    /// RMS of its norm, mm.
    pub norm_rms: f64,
    /// Maximum of its norm, mm.
    pub norm_max: f64,
}

impl Figures {
    /// Replaces every figure that both have by `choose` of the two.
    pub fn merge(&mut self, other: &Self, choose: fn(f64, f64) -> f64) {
        let optional = [
            (&mut self.free, other.free),
            (&mut self.impact, other.impact),
            (&mut self.continuous, other.continuous),
            (&mut self.n_contacts, other.n_contacts),
            (&mut self.peak_normal, other.peak_normal),
        ];
        for (mine, theirs) in optional {
            *mine = mine.zip(theirs).map(|(mine, theirs)| choose(mine, theirs));
        }
        let plain = [
            (&mut self.peak_base, other.peak_base),
            (&mut self.rms_x, other.rms_x),
            (&mut self.rms_y, other.rms_y),
            (&mut self.rms_z, other.rms_z),
            (&mut self.norm_rms, other.norm_rms),
            (&mut self.norm_max, other.norm_max),
        ];
        for (mine, theirs) in plain {
            *mine = choose(*mine, theirs);
        }
    }
}

/// One run of the reference with ours.
#[derive(Clone, Debug, Serialize)]
pub struct Pair {
    /// Name of the run.
    pub run: String,
    /// True if the path is free of corners.
    pub smooth: bool,
    /// The reference's figures.
    pub theirs: Figures,
    /// Our figures.
    pub ours: Figures,
    /// Figures out of tolerance, in words; empty if there are none.
    pub faults: Vec<String>,
    /// The least and greatest figures over indistinguishable clearances, for a chaotic run.
    pub spread: Option<[Figures; 2]>,
}
