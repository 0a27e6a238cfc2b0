//! The learned remainder: a network's prediction of the tool's deviation beyond the model, trained while the tool was tracked.
//!
//! The only input of the network is the planned motion ([`Inputs`]). Its output is therefore the same on standby and after a hand-over,
//! needs no tracker, and closes no loop that could oscillate. Three bounds limit the output, axis by axis of the base frame:
//!
//! - by the [`Axis`]: the output is multiplied by the share that held-out paths confirmed, and never leaves the range of the training;
//! - by the [`Region`]: the output fades with the distance of the motion from the training motions, at the rate that held-out paths
//!   gave;
//! - by the receipt of the [`WeightFile`]: the controller does not use a file without a proof in simulated runs.

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

/// Statistics of the trust in the network and of its output along a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// Number of evaluated instants.
    pub instants: u64,
    /// Number of instants at which the trust is at least one half.
    pub inside: u64,
    /// Number of instants outside the region, with zero output.
    pub outside: u64,
    /// Number of instants at which the network's output was not finite; the output is then zero.
    pub not_finite: u64,
    /// Sum of the trust over all instants.
    pub trust: f64,
    /// Greatest length of the output, m.
    pub greatest: f64,
}

impl Remainder {
    /// Creates the remainder of `file`, for the nominal `arm` of its model and ticks of `period` s.
    ///
    /// # Errors
    /// Numbers that contradict each other.
    pub fn new(file: &WeightFile, arm: &Arm, period: f64) -> Result<Remainder, WeightError> {
        let network = file
            .narx()?
            .in_physical_units()
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

    /// Expected deviation beyond the model at the instant of `tick`, where the arm moves along `motion`: base frame, m. Call it for
    /// instants in their order; after a gap the history of the motion restarts.
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
        // The inputs of the network come first among those of the region.
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

    /// Statistics of all instants so far.
    pub fn usage(&self) -> Usage {
        self.usage
    }
}
