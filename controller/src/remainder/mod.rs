//! The learned remainder: what a model leaves of the tool's deviation, as a network learned it while the tool was tracked.
//!
//! The network looks at nothing but the planned motion ([`Inputs`]), so that it says the same on standby and after a hand-over, needs no
//! tracker, and closes no loop that could swing. What it says is bounded three times, axis by axis of the base frame:
//!
//! - by the [`Axis`]: it is multiplied by the share that held-out paths confirmed, and never leaves the range that was seen in training;
//! - by the [`Region`]: it fades with the distance of the motion from those that trained, as fast as held-out paths say;
//! - by the receipt of the [`WeightFile`]: a file that was not proved in simulated runs is not used.

mod file;
mod inputs;
mod region;

use freeplay_arm::Arm;
use freeplay_predictor::{Network, Scratch};
use nalgebra::Vector3;

use crate::compensation::Motion;
use region::NearestCentre;

pub use file::{
    Axis, Condition, FORMAT, Learned, Machine, Receipt, Rehearsed, VERSION, WeightError, WeightFile,
};
pub use inputs::{InputGroup, Inputs};
pub use region::Region;

/// The remainder along one motion, instant by instant; nothing is allocated after [`Remainder::new`].
pub struct Remainder {
    inputs: Inputs,
    network: Network,
    scratch: Scratch,
    region: Region,
    nearest: NearestCentre,
    axes: [Axis; 3],
    usage: Usage,
}

/// How far a motion was inside the trained region, and what was taken out there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// Instants asked for.
    pub instants: u64,
    /// Of these, the instants at which the region trusts the network at least by half.
    pub inside: u64,
    /// Of these, the instants at which nothing was said: beyond the region.
    pub outside: u64,
    /// Instants at which the network had no finite answer; nothing was said.
    pub not_finite: u64,
    /// Sum of the trust over all instants.
    pub trust: f64,
    /// Greatest length of what was said, m.
    pub greatest: f64,
}

impl Remainder {
    /// The remainder that `file` holds, for the nominal `arm` of its model and ticks of `period` s.
    ///
    /// # Errors
    /// Numbers that don't fit together.
    pub fn new(file: &WeightFile, arm: &Arm, period: f64) -> Result<Remainder, WeightError> {
        let network = file
            .narx()?
            .in_own_units()
            .map_err(|source| WeightError::Inconsistent { what: source.to_string() })?;
        let learned = &file.learned;
        Ok(Remainder {
            inputs: Inputs::new(arm, &learned.region.inputs, period),
            scratch: network.scratch(),
            network,
            nearest: NearestCentre::new(&learned.region),
            region: learned.region.clone(),
            axes: learned.axes.clone(),
            usage: Usage::default(),
        })
    }

    /// What is expected beyond the model's deviation at the instant of `tick`, where the arm moves along `motion`: base frame, m. To be
    /// called for instants in their order; after a gap the memory of the motion starts anew.
    pub fn at(&mut self, tick: u64, motion: Motion<'_>) -> Vector3<f64> {
        let row = self.inputs.at(tick, motion);
        let trust = self.region.trust_at(self.nearest.distance(row));
        self.usage.instants += 1;
        self.usage.trust += trust;
        self.usage.inside += u64::from(trust >= 0.5);
        if trust <= 0.0 {
            self.usage.outside += 1;
            return Vector3::zeros();
        }
        // What the network looks at stands first in what the region looks at.
        let said = self.network.forward(&row[..self.network.inputs()], &mut self.scratch);
        let said = Vector3::new(said[0], said[1], said[2]);
        if !said.iter().all(|value| value.is_finite()) {
            self.usage.not_finite += 1;
            return Vector3::zeros();
        }
        let bounded = Vector3::from_fn(|axis, _| self.axes[axis].bounded(said[axis]) * trust);
        self.usage.greatest = self.usage.greatest.max(bounded.norm());
        bounded
    }

    /// What became of the instants so far.
    pub fn usage(&self) -> Usage {
        self.usage
    }
}
