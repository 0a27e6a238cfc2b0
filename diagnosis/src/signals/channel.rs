//! The measured channels that a model can predict.

use freeplay_laws::Prediction;
use freeplay_recording::Recording;

use crate::signals::missing::masked;
use crate::statistics::difference;

/// The measured quantity of a channel, and its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Torque of the joint with this index: measured, against inverse dynamics of the measured motion, nominal friction and effects.
    Torque(usize),
    /// Tool position along x, y or z (0 to 2): tracked, against forward kinematics of the measured joint positions.
    Tool(usize),
    /// Link-side encoder of the joint with this index, against the motor-side position.
    Link(usize),
    /// Position of the joint with this index: measured, against the position simulated from the commands.
    Position(usize),
}

impl Kind {
    /// Its column of `prediction`; empty for positions, which a prediction takes as given.
    pub(crate) fn of(self, prediction: &Prediction) -> &[f64] {
        match self {
            Kind::Torque(joint) => &prediction.torque[joint],
            Kind::Tool(axis) => &prediction.tool[axis],
            Kind::Link(joint) => &prediction.link[joint],
            Kind::Position(_) => &[],
        }
    }

    /// Its column of `prediction`, to be written.
    pub(crate) fn of_mut(self, prediction: &mut Prediction) -> &mut [f64] {
        match self {
            Kind::Torque(joint) => &mut prediction.torque[joint],
            Kind::Tool(axis) => &mut prediction.tool[axis],
            Kind::Link(joint) => &mut prediction.link[joint],
            Kind::Position(_) => &mut [],
        }
    }

    /// Its column of `recording`, if it was recorded.
    pub(super) fn measured(self, recording: &Recording) -> Option<&[f64]> {
        Some(match self {
            Kind::Torque(joint) => &recording.tau.as_ref()?[joint],
            Kind::Tool(axis) => &recording.tool.as_ref()?[axis],
            Kind::Link(joint) => recording.q_link.get(joint)?.as_ref()?,
            Kind::Position(joint) => recording.q.get(joint)?,
        })
    }
}

/// One channel: measured and predicted values, point by point.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name of its column in the recording.
    pub name: String,
    /// The measured quantity.
    pub kind: Kind,
    /// Unit of all its values: `N*m` or `N`, `m`, `rad`.
    pub unit: &'static str,
    /// Measured values, filtered.
    pub measured: Vec<f64>,
    /// Prediction of the model for the measured motion, nominal friction included.
    pub model: Vec<f64>,
    /// Points with a measurement. Elsewhere `measured` bridges the missing samples and has no weight. `None`: all points have one.
    pub present: Option<Vec<bool>>,
    /// The nominal friction in it; only torque channels of a joint with friction in the model.
    pub friction: Option<Vec<f64>>,
}

impl Channel {
    /// Measured minus model at every point; zero without a measurement.
    pub fn residual(&self) -> Vec<f64> {
        masked(difference(&self.measured, &self.model), self.present.as_deref())
    }

    /// Returns true if no point has a measurement.
    pub fn is_missing(&self) -> bool {
        self.present.as_ref().is_some_and(|present| !present.contains(&true))
    }

    /// Measured minus model without its friction; `None` if the channel has none.
    pub fn residual_without_friction(&self) -> Option<Vec<f64>> {
        let friction = self.friction.as_ref()?;
        let without =
            self.residual().iter().zip(friction).map(|(residual, friction)| residual + friction).collect();
        Some(masked(without, self.present.as_deref()))
    }
}
