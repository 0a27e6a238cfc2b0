//! The quasi-static predictor: where the journal of each joint with play rests, and so where the tool is.
//!
//! A journal that stays in touch with its bearing lies against it where the contact force carries the outer links. With b the two
//! slide rows of the inverse dynamics of the arm with play (slides at rest in the middle), the contact force is b; without friction
//! its normal n points along u = −b/|b|. Friction with the signed coefficient m = μ(v_T) turns the normal by atan m,
//!
//! `n = (u + m u⊥)/√(1 + m²),  u⊥ = (−u₂, u₁),  F_N = |b|/√(1 + m²)`,
//!
//! and loads the drive with the moment −m F_N R_j. The sliding speed is v_T = R_j q̇ + (c + δ) ṅ·t with q̇ the turning of the joint
//! and t = axis × n; since ṅ holds the change of atan m, m is the root of m = μ(v_T(m)), taken over the last tick. The journal is displaced by d = (c + δ) n, δ = (F_N/K)^(2/3), and the tool by Σ J_slides d.
//!
//! Source: the contact laws of Erkaya (2018), Eqs. 3–7, solved for rest. It fails where the journal detaches (|b| → 0).

use freeplay_arm::{Workspace, jacobian, rnea};
use freeplay_laws::{ArmWithPlay, Clearance, Play};
use nalgebra::{DMatrix, Vector3};

use crate::compensation::Motion;

/// Below this force, N, a journal has no side to lie on; the prediction keeps the last one.
const LEAST_FORCE: f64 = 1e-9;
/// Halvings of the interval of friction coefficients: to 1e-9 of it.
const BISECTIONS: usize = 30;

/// How the journal of one joint with play rests in its bearing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rest {
    /// Force of the bearing on the journal, |b|, N.
    pub force: f64,
    /// Displacement d of the journal's centre along the two slides, m.
    pub displacement: [f64; 2],
    /// Moment of the contact friction on the joint, N·m.
    pub moment: f64,
    /// Direction u of the load, if there was one.
    load: Option<[f64; 2]>,
    /// Angle atan m by which friction turns the normal away from it, rad.
    tilt: f64,
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

    /// How the journals rest during the nominal motion `motion`, one tick after the motion of the last call: [`Self::rests`].
    pub fn advance(&mut self, motion: Motion<'_>) {
        self.spread(motion);
        rnea(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        for (play, rest) in self.arm.plays().iter().zip(&mut self.rests) {
            let b = play.slides.map(|slide| self.tau[slide]);
            *rest = settle(play, b, self.v[play.turn], rest, self.period);
        }
    }

    /// The displacements of all journals, m: two for each joint with play.
    pub fn displacements(&self) -> impl Iterator<Item = f64> {
        self.rests.iter().flat_map(|rest| rest.displacement)
    }

    /// The deviation of the tool, base frame, m, when the joints are at `q` and the journals rest as [`Self::rests`] says.
    pub fn deviation(&mut self, q: &[f64]) -> Vector3<f64> {
        self.evaluate_jacobian(q);
        move_tool(&self.arm, &self.jacobian, self.displacements())
    }

    /// The deviation of the tool, base frame, m, when the joints are at `q` and the journals displaced by `displacements`, m.
    pub fn deviation_with(&mut self, q: &[f64], displacements: &[f64]) -> Vector3<f64> {
        self.evaluate_jacobian(q);
        move_tool(&self.arm, &self.jacobian, displacements.iter().copied())
    }

    /// Torques of the drives, N·m (N), that move the arm along `motion` while the journals move as `journals` says (displacements, m,
    /// with derivatives), against the friction of the contacts in [`Self::rests`] but without that of the drives.
    pub fn feed_forward(&mut self, motion: Motion<'_>, journals: Motion<'_>, torque: &mut [f64]) {
        self.spread(motion);
        for (index, slide) in self.arm.plays().iter().flat_map(|play| play.slides).enumerate() {
            self.q[slide] = journals.q[index];
            self.v[slide] = journals.v[index];
            self.a[slide] = journals.a[index];
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

    fn evaluate_jacobian(&mut self, q: &[f64]) {
        self.q.fill(0.0);
        self.arm.spread(q, &mut self.q);
        jacobian(self.arm.arm(), &mut self.workspace, &self.q, &mut self.jacobian);
    }

    /// Writes a nominal motion into the coordinates of the arm with play, the slides at rest in the middle.
    fn spread(&mut self, motion: Motion<'_>) {
        for slide in self.arm.plays().iter().flat_map(|play| play.slides) {
            (self.q[slide], self.v[slide], self.a[slide]) = (0.0, 0.0, 0.0);
        }
        self.arm.spread(motion.q, &mut self.q);
        self.arm.spread(motion.v, &mut self.v);
        self.arm.spread(motion.a, &mut self.a);
    }
}

/// What `displacements` of the journals move the tool by: Σ J_slides d.
fn move_tool(
    arm: &ArmWithPlay,
    jacobian: &DMatrix<f64>,
    displacements: impl Iterator<Item = f64>,
) -> Vector3<f64> {
    let slides = arm.plays().iter().flat_map(|play| play.slides);
    slides.zip(displacements).map(|(slide, d)| jacobian.fixed_view::<3, 1>(0, slide) * d).sum()
}

/// How a journal rests under the force `b` of its bearing while its joint turns at `turning`, rad/s; `last` is one tick of `period`
/// seconds before.
fn settle(play: &Play, b: [f64; 2], turning: f64, last: &Rest, period: f64) -> Rest {
    let force = b[0].hypot(b[1]);
    if force.is_nan() || force <= LEAST_FORCE {
        return Rest { force, moment: 0.0, ..*last };
    }
    let clearance = &play.clearance;
    let u = [-b[0] / force, -b[1] / force];
    let surface_speed = clearance.journal_radius() * turning;
    let m = match last.load {
        None => clearance.friction.coefficient(surface_speed),
        Some(before) => {
            // (c + δ) times the turning of u towards t = (u₂, −u₁) is the speed of a journal that does not tilt.
            let turned = (u[0] - before[0]) * u[1] - (u[1] - before[1]) * u[0];
            let reach = clearance.clearance + clearance.normal.static_penetration(force);
            tilt(clearance, surface_speed + reach * turned / period, reach / period, last.tilt)
        }
    };
    let root = (1.0 + m * m).sqrt();
    let normal_force = force / root;
    let reach = clearance.clearance + clearance.normal.static_penetration(normal_force);
    Rest {
        force,
        displacement: [reach * (u[0] - m * u[1]) / root, reach * (u[1] + m * u[0]) / root],
        moment: -m * normal_force * clearance.journal_radius(),
        load: Some(u),
        tilt: m.atan(),
    }
}

/// The signed friction coefficient m of a journal that, tilting by atan m, slides at `speed − lever (atan m − before)`, m/s: the root
/// of `m = μ(v_T)` by bisection. Tilting back takes time: without this the journal would jump where the sliding changes its sign.
fn tilt(clearance: &Clearance, speed: f64, lever: f64, before: f64) -> f64 {
    let friction = &clearance.friction;
    let largest = friction.static_coefficient.max(friction.dynamic_coefficient);
    let (mut low, mut high) = (-largest, largest);
    for _ in 0..BISECTIONS {
        let m = 0.5 * (low + high);
        if m > friction.coefficient(speed - lever * (m.atan() - before)) {
            high = m;
        } else {
            low = m;
        }
    }
    0.5 * (low + high)
}
