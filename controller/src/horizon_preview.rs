//! Preview of the ticks ahead for a [`Horizon`]: the motion on the planned path, the Jacobian there, and the deviation by the physical
//! prediction, not smoothed.

use freeplay_arm::{Arm, Workspace, jacobian};
use freeplay_laws::ArmWithPlay;
use freeplay_path::JointPath;
use nalgebra::{DMatrix, DVector, Vector6};

use crate::compensation::Weights;
use crate::correctable_deviation::correctable_deviation;
use crate::deviation::QuasiStatic;
use crate::displacement_preview::{DisplacementPreview, JointMotion};
use crate::horizon::{Horizon, HorizonError};
use crate::passage::Passages;

/// A horizon that moves along the path.
pub struct HorizonPreview {
    horizon: Horizon,
    outlook: DisplacementPreview,
    workspace: Workspace,
    motion: JointMotion,
    jacobian: DMatrix<f64>,
    planned: DVector<f64>,
}

impl HorizonPreview {
    /// Creates a horizon on `path`, for `arm` with the play of `with_play`, over `ticks` ticks of `period` seconds.
    ///
    /// # Errors
    /// See [`HorizonError`].
    pub fn new(
        path: JointPath,
        arm: &Arm,
        with_play: &ArmWithPlay,
        period: f64,
        weights: &Weights,
        ticks: usize,
    ) -> Result<HorizonPreview, HorizonError> {
        let n = arm.dof();
        Ok(HorizonPreview {
            horizon: Horizon::new(arm, period, weights, ticks)?,
            outlook: DisplacementPreview::new(path, with_play, period, 0),
            workspace: Workspace::new(arm),
            motion: JointMotion::new(n),
            jacobian: DMatrix::zeros(6, n),
            planned: DVector::zeros(n),
        })
    }

    /// Moves the horizon to start at the tick `first`; `predictor` computes the displacement of the tool by the journals. Within a
    /// passage the horizon follows the planned corrections. The function computes one new tick if the last call was for the tick
    /// before, otherwise all.
    pub fn seen_from(
        &mut self,
        first: u64,
        arm: &Arm,
        passages: &Passages,
        predictor: &mut QuasiStatic,
    ) -> &mut Horizon {
        for tick in self.horizon.missing(first) {
            self.motion.copy(self.outlook.on_path(tick));
            let motion = self.motion.as_motion();
            jacobian(arm, &mut self.workspace, motion.q, &mut self.jacobian);
            let mut deviation = Vector6::zeros();
            let journals = self.outlook.at(tick);
            if let Some(step) = passages.at(tick) {
                self.planned.copy_from_slice(step.corrections);
                deviation.gemv(-1.0, &self.jacobian, &self.planned, 0.0);
            } else {
                let moved = predictor.deviation_with(motion.q, journals);
                deviation.fixed_rows_mut::<3>(0).copy_from(&correctable_deviation(&self.jacobian, moved));
            }
            self.horizon.push(tick, motion, &self.jacobian, &deviation);
        }
        &mut self.horizon
    }
}
