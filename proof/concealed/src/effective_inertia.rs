//! The effective inertia of a joint.

use freeplay_arm::{Arm, Workspace, crba};
use nalgebra::DMatrix;

/// The effective inertia of each coordinate of an arm with the others free: 1/(M⁻¹)_ii.
pub(crate) struct EffectiveInertia {
    ws: Workspace,
    mass: DMatrix<f64>,
}

impl EffectiveInertia {
    /// A workspace for `arm`.
    pub fn new(arm: &Arm) -> Self {
        Self { ws: Workspace::new(arm), mass: DMatrix::zeros(arm.dof(), arm.dof()) }
    }

    /// The effective inertias at the positions `q` of `arm`, kg·m² (kg for a slide); `None` for a singular mass matrix.
    pub fn at(&mut self, arm: &Arm, q: &[f64]) -> Option<Vec<f64>> {
        crba(arm, &mut self.ws, q, &mut self.mass);
        let inverse = self.mass.clone().cholesky()?.inverse();
        Some(inverse.diagonal().iter().map(|x| 1.0 / x).collect())
    }
}
