//! Force of a bearing on its journal, which is affine in the accelerations of the joints.
//!
//! M and h are the mass matrix and the bias of the arm with play, c denotes the two slide rows of a joint with play, and r the
//! other rows:
//!
//! `b(a) = M_ca a + M_cc p̈ + h_c`
//!
//! is the force on the journal along the two slides while the joints accelerate by a and the journals by p̈. A journal in contact
//! with its bearing along the normal n stays in contact while `−nᵀ b(a) > 0`: the bearing can push, not pull.

use freeplay_arm::{Workspace, crba, rnea};
use freeplay_laws::ArmWithPlay;
use nalgebra::DMatrix;

use crate::compensation::Motion;

/// Forces on journals and drives of one arm with play.
pub struct PinForce {
    arm: ArmWithPlay,
    workspace: Workspace,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    force: Vec<f64>,
    mass: DMatrix<f64>,
}

impl PinForce {
    /// Creates the forces of the arm with play `arm`.
    pub fn new(arm: &ArmWithPlay) -> PinForce {
        let m = arm.arm().dof();
        PinForce {
            workspace: Workspace::new(arm.arm()),
            arm: arm.clone(),
            q: vec![0.0; m],
            v: vec![0.0; m],
            a: vec![0.0; m],
            force: vec![0.0; m],
            mass: DMatrix::zeros(m, m),
        }
    }

    /// The arm with play.
    pub fn arm(&self) -> &ArmWithPlay {
        &self.arm
    }

    /// The forces, N or N·m, in the coordinates of the arm with play, that move its joints along `joints` and its journals along
    /// `journals` (two displacements for each joint with play, m, with derivatives). The rows of the slides are the bearing
    /// forces.
    pub fn forces(&mut self, joints: Motion<'_>, journals: Motion<'_>) -> &[f64] {
        self.place(joints, journals);
        rnea(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &self.a, &mut self.force);
        &self.force
    }

    /// Computes [`Self::mass`] at the posture of the last call of [`Self::forces`].
    pub fn update_mass(&mut self) {
        crba(self.arm.arm(), &mut self.workspace, &self.q, &mut self.mass);
    }

    /// The mass matrix of the arm with play, in its coordinates, of the last [`Self::update_mass`]: the derivative of the forces with
    /// respect to the accelerations.
    pub fn mass(&self) -> &DMatrix<f64> {
        &self.mass
    }

    fn place(&mut self, joints: Motion<'_>, journals: Motion<'_>) {
        let pairs = [
            (&mut self.q, joints.q, journals.q),
            (&mut self.v, joints.v, journals.v),
            (&mut self.a, joints.a, journals.a),
        ];
        for (extended, joints, journals) in pairs {
            self.arm.spread(joints, extended);
            for (slide, &value) in self.arm.plays().iter().flat_map(|play| play.slides).zip(journals) {
                extended[slide] = value;
            }
        }
    }
}
