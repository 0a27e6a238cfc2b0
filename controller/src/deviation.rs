//! The quasi-static predictor: the rest position of each journal with play, and the resulting position of the tool.
//!
//! A journal that stays in contact with its bearing rests at the displacement that [`settle`] computes from the bearing force b. This
//! force is given by the two slide rows of the inverse dynamics of the arm with play, with the slides at rest in the centre. The
//! displacement d of the journals moves the tool by Σ J_slides d.
//!
//! Source: the contact laws of Erkaya (2018), Eqs. 3–7, solved for rest. The prediction fails if the journal detaches (|b| → 0).

use freeplay_arm::{Workspace, jacobian, rnea};
use freeplay_laws::{ArmWithPlay, Rest, settle};
use nalgebra::{DMatrix, Vector3};

use crate::compensation::Motion;

/// The predictor of one arm with play; it follows one motion tick by tick.
pub struct QuasiStatic {
    arm: ArmWithPlay,
    workspace: Workspace,
    period: f64,
    rests: Vec<Rest>,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
    jacobian: DMatrix<f64>,
}

impl QuasiStatic {
    /// Creates a predictor for the arm with play `arm` and ticks of `period` seconds.
    pub fn new(arm: &ArmWithPlay, period: f64) -> QuasiStatic {
        let n = arm.arm().dof();
        QuasiStatic {
            workspace: Workspace::new(arm.arm()),
            period,
            rests: vec![Rest::default(); arm.plays().len()],
            q: vec![0.0; n],
            v: vec![0.0; n],
            a: vec![0.0; n],
            tau: vec![0.0; n],
            jacobian: DMatrix::zeros(6, n),
            arm: arm.clone(),
        }
    }

    /// Rest positions of the journals, in the order of the joints with play.
    pub fn rests(&self) -> &[Rest] {
        &self.rests
    }

    /// Clears the history, for a motion that does not continue the last one.
    pub fn restart(&mut self) {
        self.rests.fill(Rest::default());
    }

    /// Computes [`Self::rests`] during the nominal motion `motion`, one tick after the motion of the last call.
    pub fn advance(&mut self, motion: Motion<'_>) {
        self.spread(motion);
        rnea(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        for (play, rest) in self.arm.plays().iter().zip(&mut self.rests) {
            let b = play.slides.map(|slide| self.tau[slide]);
            *rest = settle(&play.clearance, b, self.v[play.turn], rest, self.period);
        }
    }

    /// The displacements of all journals, m: two for each joint with play.
    pub fn displacements(&self) -> impl Iterator<Item = f64> {
        self.rests.iter().flat_map(|rest| rest.displacement)
    }

    /// The deviation of the tool, base frame, m, with the joints at `q` and the journals at [`Self::rests`].
    pub fn deviation(&mut self, q: &[f64]) -> Vector3<f64> {
        self.evaluate_jacobian(q);
        move_tool(&self.arm, &self.jacobian, self.displacements())
    }

    /// The deviation of the tool, base frame, m, with the joints at `q` and the journals at `displacements`, m.
    pub fn deviation_with(&mut self, q: &[f64], displacements: &[f64]) -> Vector3<f64> {
        self.evaluate_jacobian(q);
        move_tool(&self.arm, &self.jacobian, displacements.iter().copied())
    }

    /// Moments of the contact friction on the joints with play in [`Self::rests`], N·m.
    pub fn moments(&self) -> impl Iterator<Item = f64> {
        self.rests.iter().map(|rest| rest.moment)
    }

    /// Torques of the drives, N·m (N), that move the arm along `motion` while the journals move along `journals` (displacements, m,
    /// with derivatives), against the `moments` of the contact friction (N·m, one for each joint with play). The torques exclude the
    /// friction of the drives. The function writes the torques of journals and moments on the joints of an arm without play into
    /// `external`, N·m (N).
    pub fn feed_forward(
        &mut self,
        motion: Motion<'_>,
        journals: Motion<'_>,
        moments: &[f64],
        torque: &mut [f64],
        external: &mut [f64],
    ) {
        self.spread(motion);
        rnea(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        self.arm.gather(&self.tau, external);
        for (index, slide) in self.arm.plays().iter().flat_map(|play| play.slides).enumerate() {
            self.q[slide] = journals.q[index];
            self.v[slide] = journals.v[index];
            self.a[slide] = journals.a[index];
        }
        rnea(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        self.arm.gather(&self.tau, torque);
        for (external, torque) in external.iter_mut().zip(torque.iter()) {
            *external -= torque;
        }
        for (play, moment) in self.arm.plays().iter().zip(moments) {
            torque[play.joint] -= moment;
            external[play.joint] += moment;
        }
    }

    fn evaluate_jacobian(&mut self, q: &[f64]) {
        self.q.fill(0.0);
        self.arm.spread(q, &mut self.q);
        jacobian(self.arm.arm(), &mut self.workspace, &self.q, &mut self.jacobian);
    }

    /// Writes a nominal motion into the coordinates of the arm with play, with the slides at rest in the centre.
    fn spread(&mut self, motion: Motion<'_>) {
        for slide in self.arm.plays().iter().flat_map(|play| play.slides) {
            (self.q[slide], self.v[slide], self.a[slide]) = (0.0, 0.0, 0.0);
        }
        self.arm.spread(motion.q, &mut self.q);
        self.arm.spread(motion.v, &mut self.v);
        self.arm.spread(motion.a, &mut self.a);
    }
}

/// Displacement of the tool by `displacements` of the journals: Σ J_slides d.
fn move_tool(
    arm: &ArmWithPlay,
    jacobian: &DMatrix<f64>,
    displacements: impl Iterator<Item = f64>,
) -> Vector3<f64> {
    let slides = arm.plays().iter().flat_map(|play| play.slides);
    slides.zip(displacements).map(|(slide, d)| jacobian.fixed_view::<3, 1>(0, slide) * d).sum()
}
