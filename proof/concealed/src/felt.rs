//! The inertia that a joint feels.

use freeplay_arm::{Arm, Workspace, crba};
use nalgebra::DMatrix;

/// What inertia each coordinate of an arm feels with the others free: 1/(M⁻¹)_ii.
pub(crate) struct Felt {
    ws: Workspace,
    mass: DMatrix<f64>,
}

impl Felt {
    /// For `arm`.
    pub fn new(arm: &Arm) -> Self {
        Self { ws: Workspace::new(arm), mass: DMatrix::zeros(arm.dof(), arm.dof()) }
    }

    /// At the positions `q` of `arm`, kg·m² (kg for a slide); `None` where the mass matrix is singular.
    pub fn at(&mut self, arm: &Arm, q: &[f64]) -> Option<Vec<f64>> {
        crba(arm, &mut self.ws, q, &mut self.mass);
        let inverse = self.mass.clone().cholesky()?.inverse();
        Some(inverse.diagonal().iter().map(|x| 1.0 / x).collect())
    }
}
