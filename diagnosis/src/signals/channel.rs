//! What a recording measures that a model can predict.

use freeplay_laws::Prediction;
use freeplay_recording::Recording;

use crate::signals::missing::masked;
use crate::statistics::difference;

/// What a channel measures, and what the model says in its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Torque of the joint with this index: measured, against inverse dynamics of the measured motion, nominal friction and effects.
    Torque(usize),
    /// Tool position along x, y or z (0 to 2): tracked, against forward kinematics of the measured joint positions.
    Tool(usize),
    /// Link-side encoder of the joint with this index, against the motor-side position.
    Link(usize),
    /// Position of the joint with this index: measured, against the one simulated from the commanded positions.
    Position(usize),
}

impl Kind {
    /// Its column of `prediction`; none for positions, which a prediction takes as given.
    pub(crate) fn of(self, prediction: &Prediction) -> &[f64] {
        match self {
            Kind::Torque(joint) => &prediction.torque[joint],
            Kind::Tool(axis) => &prediction.tool[axis],
            Kind::Link(joint) => &prediction.link[joint],
            Kind::Position(_) => &[],
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

/// One channel: what was measured and what the model says, point by point.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name of its column in the recording.
    pub name: String,
    /// The channel measures this.
    pub kind: Kind,
    /// Unit of all its numbers: `N*m` or `N`, `m`, `rad`.
    pub unit: &'static str,
    /// Measured, treated.
    pub measured: Vec<f64>,
    /// The model's answer to the measured motion, nominal friction included.
    pub model: Vec<f64>,
    /// Whether it was measured, point by point: where it was not, `measured` bridges what is missing and counts for nothing. `None`: at all.
    pub present: Option<Vec<bool>>,
    /// The nominal friction in it; torque channels of a joint for which the model names friction.
    pub friction: Option<Vec<f64>>,
}

impl Channel {
    /// Measured minus model at every point; zero where nothing was measured.
    pub fn residual(&self) -> Vec<f64> {
        masked(difference(&self.measured, &self.model), self.present.as_deref())
    }

    /// Nothing of it was measured.
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
