//! The quasi-static predictor: where the journal of each joint with play rests, and so where the tool is.
//!
//! A journal that stays in touch with its bearing lies against it where the contact force carries the outer links. With b the two
//! slide rows of the inverse dynamics of the arm with play (slides at rest in the middle), the contact force is b; without friction
//! its normal n points along u = −b/|b|. Friction with the signed coefficient m = μ(v_T) turns the normal by atan m,
//!
//! `n = (u + m u⊥)/√(1 + m²),  u⊥ = (−u₂, u₁),  F_N = |b|/√(1 + m²)`,
//!
//! and loads the drive with the moment −m F_N R_j. The sliding speed is v_T = R_j q̇ + (c + δ) ṅ·t with q̇ the turning of the joint
//! and t = axis × n. The journal is displaced by d = (c + δ) n, δ = (F_N/K)^(2/3), and the tool by Σ J_slides d.
//!
//! Source: the contact laws of Erkaya (2018), Eqs. 3–7, solved for rest. It fails where the journal detaches (|b| → 0).

use freeplay_arm::{Workspace, jacobian, rnea};
use freeplay_laws::{ArmWithPlay, Play};
use nalgebra::{DMatrix, Vector3};

use crate::compensation::Motion;

/// Below this force, N, a journal has no side to lie on; the prediction keeps the last one.
const LEAST_FORCE: f64 = 1e-9;

/// How the journal of one joint with play rests in its bearing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rest {
    /// Force of the bearing on the journal, |b|, N.
    pub force: f64,
    /// Displacement d of the journal's centre along the two slides, m.
    pub displacement: [f64; 2],
    /// Moment of the contact friction on the joint, N·m.
    pub moment: f64,
    /// Direction u of the load, for the turning rate at the next tick.
    load: Option<[f64; 2]>,
}

/// The predictor of one arm with play; follows one motion tick by tick.
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
    /// For the arm with play `arm` and ticks of `period` seconds.
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

    /// How the journals rest, in the order of the joints with play.
    pub fn rests(&self) -> &[Rest] {
        &self.rests
    }

    /// Forgets the motion so far, for a motion that does not continue it.
    pub fn restart(&mut self) {
        self.rests.fill(Rest::default());
    }

    /// How the journals rest during the nominal motion `motion`, one tick after the motion of the last call. Returns the deviation
    /// of the tool, base frame, m.
    pub fn advance(&mut self, motion: Motion<'_>) -> Vector3<f64> {
        self.spread(motion);
        rnea(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        for (play, rest) in self.arm.plays().iter().zip(&mut self.rests) {
            let b = play.slides.map(|slide| self.tau[slide]);
            *rest = settle(play, b, self.v[play.turn], rest, self.period);
        }
        self.tool_deviation()
    }

    /// Torques of the drives, N·m (N), that move the arm along `motion` with the journals where [`Self::rests`] says, against the
    /// friction of the contacts but without that of the drives.
    pub fn feed_forward(&mut self, motion: Motion<'_>, torque: &mut [f64]) {
        self.spread(motion);
        for (play, rest) in self.arm.plays().iter().zip(&self.rests) {
            for (slide, displacement) in play.slides.into_iter().zip(rest.displacement) {
                self.q[slide] = displacement;
            }
        }
        rnea(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        self.arm.gather(&self.tau, torque);
        for (play, rest) in self.arm.plays().iter().zip(&self.rests) {
            torque[play.joint] -= rest.moment;
        }
    }

    /// Adds the moments of the contact friction on the joints to `torque` (one entry per nominal joint), N·m.
    pub fn add_contact_moments(&self, torque: &mut [f64]) {
        for (play, rest) in self.arm.plays().iter().zip(&self.rests) {
            torque[play.joint] += rest.moment;
        }
    }

    /// Writes a nominal motion into the coordinates of the arm with play, the slides in the middle.
    fn spread(&mut self, motion: Motion<'_>) {
        for play in self.arm.plays() {
            for slide in play.slides {
                self.q[slide] = 0.0;
            }
        }
        self.arm.spread(motion.q, &mut self.q);
        self.arm.spread(motion.v, &mut self.v);
        self.arm.spread(motion.a, &mut self.a);
    }

    fn tool_deviation(&mut self) -> Vector3<f64> {
        jacobian(self.arm.arm(), &mut self.workspace, &self.q, &mut self.jacobian);
        let mut deviation = Vector3::zeros();
        for (play, rest) in self.arm.plays().iter().zip(&self.rests) {
            for (slide, displacement) in play.slides.into_iter().zip(rest.displacement) {
                deviation += self.jacobian.fixed_view::<3, 1>(0, slide) * displacement;
            }
        }
        deviation
    }
}

/// How a journal rests under the force `b` of its bearing while its joint turns at `turning`, rad/s; `last` is one tick of `period`
/// seconds before.
fn settle(play: &Play, b: [f64; 2], turning: f64, last: &Rest, period: f64) -> Rest {
    let force = b[0].hypot(b[1]);
    if !(force > LEAST_FORCE) {
        return Rest { force, moment: 0.0, ..*last };
    }
    let clearance = &play.clearance;
    let u = [-b[0] / force, -b[1] / force];
    let reach = clearance.clearance + clearance.normal.static_penetration(force);
    // ṅ·t with t = (u₂, −u₁), as the load turns; friction turns the normal much less than that.
    let load_turning = last
        .load
        .map_or(0.0, |before| ((u[0] - before[0]) * u[1] - (u[1] - before[1]) * u[0]) / period);
    let sliding = clearance.journal_radius() * turning + reach * load_turning;
    let m = clearance.friction.coefficient(sliding);
    let root = (1.0 + m * m).sqrt();
    let normal_force = force / root;
    let reach = clearance.clearance + clearance.normal.static_penetration(normal_force);
    Rest {
        force,
        displacement: [reach * (u[0] - m * u[1]) / root, reach * (u[1] + m * u[0]) / root],
        moment: -m * normal_force * clearance.journal_radius(),
        load: Some(u),
    }
}
