//! The load of one joint's bearing, and the tool's displacement by its journal: from the inverse dynamics of the arm with play.

use freeplay_arm::{Arm, Workspace, jacobian, rnea};
use nalgebra::{DMatrix, Vector3};

use crate::{ArmWithPlay, Clearance, LawError};

/// The bearing of one joint in a moving arm, its journal at the centre. The constructor allocates all memory.
#[derive(Clone, Debug)]
pub struct BearingLoad {
    play: ArmWithPlay,
    workspace: Workspace,
    joint: usize,
    slides: [usize; 2],
    /// Position, velocity and acceleration of the joints; write them before [`BearingLoad::force`].
    pub motion: [Vec<f64>; 3],
    spread: [Vec<f64>; 3],
    tau: Vec<f64>,
    columns: DMatrix<f64>,
}

impl BearingLoad {
    /// The bearing of `joint` of `arm`.
    ///
    /// # Errors
    /// [`LawError::Arm`] if the arm with play is impossible.
    pub fn new(arm: &Arm, joint: usize, clearance: Clearance) -> Result<BearingLoad, LawError> {
        let play = ArmWithPlay::new(arm, &[(joint, clearance)])?;
        let (n, joints) = (play.arm().dof(), arm.dof());
        Ok(BearingLoad {
            workspace: Workspace::new(play.arm()),
            joint,
            slides: play.plays()[0].slides,
            motion: [vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]],
            spread: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
            tau: vec![0.0; n],
            columns: DMatrix::zeros(6, n),
            play,
        })
    }

    /// Force b that the bearing must carry in the present motion, along the two slides, N.
    pub fn force(&mut self) -> [f64; 2] {
        for (spread, nominal) in self.spread.iter_mut().zip(&self.motion) {
            self.play.spread(nominal, spread);
        }
        let [q, v, a] = &self.spread;
        rnea(self.play.arm(), &mut self.workspace, q, v, a, &mut self.tau);
        self.slides.map(|slide| self.tau[slide])
    }

    /// Adds to `torques`, one for each joint, `weight` times the drives' torque with the journal at `displacement`, m along the two slides,
    /// N·m (N); after [`BearingLoad::force`].
    pub fn add_torques(&mut self, displacement: [f64; 2], weight: f64, torques: &mut [f64]) {
        let put = |spread: &mut [f64], at: [f64; 2]| {
            self.slides.iter().zip(at).for_each(|(&slide, d)| spread[slide] = d);
        };
        let [q, v, a] = &mut self.spread;
        put(q, displacement);
        rnea(self.play.arm(), &mut self.workspace, q, v, a, &mut self.tau);
        put(q, [0.0; 2]);
        for (joint, torque) in torques.iter_mut().enumerate() {
            *torque += weight * self.tau[self.play.joint(joint)];
        }
    }

    /// Speed of the joint, rad/s.
    pub fn turning(&self) -> f64 {
        self.motion[1][self.joint]
    }

    /// Displacement of the tool by the journal's `displacement`, m along the two slides; after [`BearingLoad::force`].
    pub fn moved(&mut self, displacement: [f64; 2]) -> Vector3<f64> {
        jacobian(self.play.arm(), &mut self.workspace, &self.spread[0], &mut self.columns);
        let slides = self.slides.iter().zip(displacement);
        slides.map(|(&slide, d)| self.columns.fixed_view::<3, 1>(0, slide) * d).sum()
    }
}
