//! The journals, simulated beside the run: where they are now and where they will be a few ticks ahead.
//!
//! With the joints' motion measured, only the slides of the journals are unknown. Over one tick their accelerations are
//! `s̈ = s̈₀ + A f`, with s̈₀ those without contact, f the forces and moments of the bearings, and A the response of the slides to
//! them: with M the mass matrix of the arm with play, h its bias and τ the torques in force,
//!
//! - torque mode: `s̈₀ = [M⁻¹(τ − h)]_s`, A = rows s of M⁻¹ (the joints give way);
//! - driven mode: `s̈₀ = −M_ss⁻¹ b`, A = M_ss⁻¹, b the slide rows of the inverse dynamics (the joints do not).
//!
//! s̈₀ and A are held for the tick, the contacts integrated in [`SUBSTEPS`] steps by leapfrog with the laws that the plant has too.
//! For the ticks ahead s̈₀ follows from the loads b on the reference, plus what s̈₀ is beyond that now (the correction's own
//! acceleration, the feedback), held.
//!
//! A tracked tool corrects the twin: offsets entirely, velocities by a share of what the offsets were wrong over the tick (an
//! observer of Luenberger's kind, 1964). A tool measured beyond the believed bearing does not push the journal into it.

use freeplay_arm::{Workspace, bias, crba, forward_kinematics, jacobian, rnea};
use freeplay_laws::{ArmWithPlay, DriveFriction, Journal, bearing_contact};
use freeplay_shm::State;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix3, Vector3};

use crate::task::TaskMode;

/// Steps of a tick.
pub const SUBSTEPS: usize = 50;
/// Share of a wrong offset that goes into the velocity, in flight and in contact.
const VELOCITY_GAIN: [f64; 2] = [0.7, 0.2];
/// Force with which a measured journal may press on the believed bearing, N.
const PRESS: f64 = 100.0;
/// Makes the attribution of a tool's shift to journals unique where several can explain it.
const ATTRIBUTION: f64 = 1e-6;

/// The journals at one instant: along the two slides of each play.
#[derive(Clone, Debug)]
pub struct Journals {
    /// Offsets, m.
    pub offset: Vec<f64>,
    /// Velocities, m/s.
    pub velocity: Vec<f64>,
    acceleration: Vec<f64>,
    /// Approach speed latched at first contact of each play, m/s; none in free flight.
    impact: Vec<Option<f64>>,
}

impl Journals {
    fn new(plays: usize) -> Journals {
        let zeros = vec![0.0; 2 * plays];
        Journals {
            offset: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros,
            impact: vec![None; plays],
        }
    }

    /// Whether the journal of the play `play` is in touch with its bearing.
    pub fn touches(&self, play: usize) -> bool {
        self.impact[play].is_some()
    }

    fn copy(&mut self, other: &Journals) {
        self.offset.copy_from_slice(&other.offset);
        self.velocity.copy_from_slice(&other.velocity);
        self.acceleration.copy_from_slice(&other.acceleration);
        self.impact.copy_from_slice(&other.impact);
    }

    fn rest(&mut self, offset: &[f64]) {
        self.offset.copy_from_slice(offset);
        self.velocity.fill(0.0);
        self.acceleration.fill(0.0);
        self.impact.fill(None);
    }

    fn is_finite(&self) -> bool {
        self.offset.iter().chain(&self.velocity).all(|value| value.is_finite())
    }
}

/// How the slides answer to forces during one tick.
struct Response {
    /// Accelerations without contact, m/s².
    free: Vec<f64>,
    /// Accelerations by the bearings' forces along the slides, one row for each slide, and by their moments: 1/kg, 1/(kg m).
    force: DMatrix<f64>,
    moment: DMatrix<f64>,
    /// Turning of the joints with play, rad/s.
    turning: Vec<f64>,
}

/// The twin of one arm's journals; see the module.
pub struct JournalTwin {
    arm: ArmWithPlay,
    workspace: Workspace,
    friction: Vec<DriveFriction>,
    mode: TaskMode,
    period: f64,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
    mass: DMatrix<f64>,
    right: DVector<f64>,
    jacobian: DMatrix<f64>,
    loads: Vec<f64>,
    response: Response,
    excess: Vec<f64>,
    now: Journals,
    next: Journals,
    ahead: Journals,
    innovation: Vec<f64>,
    started: bool,
}

impl JournalTwin {
    /// For the arm with play `arm`, whose drives rub as `friction` says, in `mode`, ticks of `period` s.
    pub fn new(arm: &ArmWithPlay, friction: Vec<DriveFriction>, mode: TaskMode, period: f64) -> JournalTwin {
        let (n, plays) = (arm.arm().dof(), arm.plays().len());
        let zeros = vec![0.0; n];
        JournalTwin {
            workspace: Workspace::new(arm.arm()),
            arm: arm.clone(),
            friction,
            mode,
            period,
            q: zeros.clone(),
            v: zeros.clone(),
            a: zeros.clone(),
            tau: zeros,
            mass: DMatrix::zeros(n, n),
            right: DVector::zeros(n),
            jacobian: DMatrix::zeros(6, n),
            loads: vec![0.0; 3 * plays],
            response: Response {
                free: vec![0.0; 2 * plays],
                force: DMatrix::zeros(2 * plays, 2 * plays),
                moment: DMatrix::zeros(2 * plays, plays),
                turning: vec![0.0; plays],
            },
            excess: vec![0.0; 2 * plays],
            now: Journals::new(plays),
            next: Journals::new(plays),
            ahead: Journals::new(plays),
            innovation: vec![0.0; 2 * plays],
            started: false,
        }
    }

    /// Forgets the run so far.
    pub fn restart(&mut self) {
        self.started = false;
    }

    /// The journals at the last state.
    pub fn now(&self) -> &Journals {
        &self.now
    }

    /// The journals at the end of the last forecast.
    pub fn ahead(&self) -> &Journals {
        &self.ahead
    }

    /// What the tracked tool moved the offsets by at the last state, m; zero without one.
    pub fn innovation(&self) -> &[f64] {
        &self.innovation
    }

    /// Accelerations of the slides without contact at the last state beyond those by the loads on the reference, m/s².
    pub fn excess(&self) -> &[f64] {
        &self.excess
    }

    /// Goes on to `state`, then looks as many ticks ahead as `loads` has rows but one: the loads on the reference at the state's tick
    /// and the ticks after it, N, two for each play. A twin that starts is at `rest`, m, unless the tool says otherwise. `None` if
    /// there is no finite answer; the twin then starts anew.
    pub fn advance<'a>(
        &mut self,
        state: &State,
        rest: &[f64],
        loads: impl Iterator<Item = &'a [f64]>,
    ) -> Option<&Journals> {
        if self.started {
            self.now.copy(&self.next);
        } else {
            self.now.rest(rest);
        }
        self.observe(state);
        self.respond(state)?;
        self.next.copy(&self.now);
        for (step, load) in loads.enumerate() {
            if step == 0 {
                self.exceed(load);
                integrate(&self.arm, &self.response, &mut self.loads, &mut self.next, self.period);
                self.ahead.copy(&self.next);
            } else {
                self.expect(load);
                integrate(&self.arm, &self.response, &mut self.loads, &mut self.ahead, self.period);
            }
        }
        self.started = self.next.is_finite() && self.ahead.is_finite();
        self.started.then_some(&self.ahead)
    }

    /// Lets the measured tool of `state` correct the journals.
    fn observe(&mut self, state: &State) {
        self.place(state);
        self.innovation.fill(0.0);
        if !state.has(State::FLAG_TOOL_TRACKED) {
            return;
        }
        let believed = forward_kinematics(self.arm.arm(), &mut self.workspace, &self.q).translation.vector;
        let shift = Vector3::new(state.tool[0], state.tool[1], state.tool[2]) - believed;
        jacobian(self.arm.arm(), &mut self.workspace, &self.q, &mut self.jacobian);
        let slides = || self.arm.plays().iter().flat_map(|play| play.slides);
        let columns = || slides().map(|slide| self.jacobian.fixed_view::<3, 1>(0, slide));
        let spread: Matrix3<f64> = columns().map(|column| column * column.transpose()).sum();
        let Some(inverse) = (spread + Matrix3::identity() * ATTRIBUTION).try_inverse() else { return };
        let cause = inverse * shift;
        if !cause.iter().all(|value| value.is_finite()) {
            return;
        }
        for (innovation, column) in self.innovation.iter_mut().zip(columns()) {
            *innovation = column.dot(&cause);
        }
        self.correct();
    }

    /// Moves the journals by the innovation, but not deeper into a bearing than they are or its surface.
    fn correct(&mut self) {
        for (index, play) in self.arm.plays().iter().enumerate() {
            let at = 2 * index..2 * index + 2;
            let eccentricity = |offset: &[f64]| offset[0].hypot(offset[1]);
            let surface = play.clearance.clearance + play.clearance.normal.static_penetration(PRESS);
            let most = eccentricity(&self.now.offset[at.clone()]).max(surface);
            let gain = VELOCITY_GAIN[usize::from(self.now.touches(index))];
            let share = if self.started { gain / self.period } else { 0.0 };
            let before = [self.now.offset[at.start], self.now.offset[at.start + 1]];
            for i in at.clone() {
                self.now.offset[i] += self.innovation[i];
            }
            let reached = eccentricity(&self.now.offset[at.clone()]);
            let shrink = if reached > most { most / reached } else { 1.0 };
            for (i, before) in at.zip(before) {
                self.now.offset[i] *= shrink;
                self.now.velocity[i] += share * (self.now.offset[i] - before);
            }
        }
    }

    /// Writes the measured joints and the journals into the coordinates of the arm with play.
    fn place(&mut self, state: &State) {
        let n = self.arm.nominal_dof();
        self.arm.spread(&state.q[..n], &mut self.q);
        self.arm.spread(&state.qd[..n], &mut self.v);
        for (i, slide) in self.arm.plays().iter().flat_map(|play| play.slides).enumerate() {
            (self.q[slide], self.v[slide]) = (self.now.offset[i], self.now.velocity[i]);
        }
    }

    /// Evaluates how the slides answer during the tick that begins with `state`.
    fn respond(&mut self, state: &State) -> Option<()> {
        self.place(state);
        for (turning, play) in self.response.turning.iter_mut().zip(self.arm.plays()) {
            *turning = self.v[play.turn];
        }
        crba(self.arm.arm(), &mut self.workspace, &self.q, &mut self.mass);
        // At tick 0 the joints are guided, whatever the mode.
        if self.mode != TaskMode::Torque || state.tick == 0 {
            self.stiff(state)
        } else {
            self.yielding(state)
        }
    }

    /// Torque mode: rows of M⁻¹, one solve for each slide.
    fn yielding(&mut self, state: &State) -> Option<()> {
        bias(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &mut self.tau);
        self.tau.iter_mut().for_each(|tau| *tau = -*tau);
        for (joint, friction) in self.friction.iter().enumerate() {
            let at = self.arm.joint(joint);
            self.tau[at] += state.applied[joint] + friction.torque(self.v[at]);
        }
        let n = self.arm.arm().dof();
        let factor = Cholesky::new(std::mem::replace(&mut self.mass, DMatrix::zeros(0, 0)));
        let Some(factor) = factor else {
            self.mass = DMatrix::zeros(n, n);
            self.started = false;
            return None;
        };
        let plays = self.arm.plays();
        for (row, slide) in plays.iter().flat_map(|play| play.slides).enumerate() {
            self.right.fill(0.0);
            self.right[slide] = 1.0;
            factor.solve_mut(&mut self.right);
            self.response.free[row] = self.right.iter().zip(&self.tau).map(|(m, tau)| m * tau).sum();
            for (column, play) in plays.iter().enumerate() {
                self.response.force[(row, 2 * column)] = self.right[play.slides[0]];
                self.response.force[(row, 2 * column + 1)] = self.right[play.slides[1]];
                self.response.moment[(row, column)] = self.right[play.turn];
            }
        }
        self.mass = factor.unpack_dirty();
        Some(())
    }

    /// Driven mode: the inverse of M_ss, whose slides see nothing of the joints but their motion.
    fn stiff(&mut self, state: &State) -> Option<()> {
        let n = self.arm.nominal_dof();
        self.a.fill(0.0);
        self.arm.spread(&state.reference.qdd[..n], &mut self.a);
        rnea(self.arm.arm(), &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        let slides = || self.arm.plays().iter().flat_map(|play| play.slides);
        for (row, slide) in slides().enumerate() {
            for (column, other) in slides().enumerate() {
                self.response.force[(row, column)] = self.mass[(slide, other)];
            }
        }
        self.response.moment.fill(0.0);
        if !self.response.force.try_inverse_mut() {
            self.started = false;
            return None;
        }
        for row in 0..self.response.free.len() {
            let pull = slides().enumerate().map(|(i, slide)| self.response.force[(row, i)] * self.tau[slide]);
            self.response.free[row] = -pull.sum::<f64>();
        }
        Some(())
    }

    /// Notes what the slides accelerate by beyond `load` on the reference.
    fn exceed(&mut self, load: &[f64]) {
        for (row, excess) in self.excess.iter_mut().enumerate() {
            let pull: f64 = load.iter().enumerate().map(|(i, b)| self.response.force[(row, i)] * b).sum();
            *excess = self.response.free[row] + pull;
        }
    }

    /// Expects the slides to be free as `load` on a later tick of the reference says, plus the excess of now.
    fn expect(&mut self, load: &[f64]) {
        for (row, free) in self.response.free.iter_mut().enumerate() {
            let pull: f64 = load.iter().enumerate().map(|(i, b)| self.response.force[(row, i)] * b).sum();
            *free = self.excess[row] - pull;
        }
    }
}

/// Integrates `journals` over one tick; `loads` is room for the forces and moments of the bearings.
fn integrate(
    arm: &ArmWithPlay,
    response: &Response,
    loads: &mut [f64],
    journals: &mut Journals,
    period: f64,
) {
    let step = period / SUBSTEPS as f64;
    let (forces, moments) = loads.split_at_mut(2 * arm.plays().len());
    for _ in 0..SUBSTEPS {
        for (offset, velocity) in journals.offset.iter_mut().zip(&journals.velocity) {
            *offset += 0.5 * step * velocity;
        }
        touch(arm, response, journals, step, forces, moments);
        for row in 0..journals.offset.len() {
            let by = |matrix: &DMatrix<f64>, load: &[f64]| -> f64 {
                load.iter().enumerate().map(|(i, load)| matrix[(row, i)] * load).sum()
            };
            let a = response.free[row] + by(&response.force, forces) + by(&response.moment, moments);
            journals.acceleration[row] = a;
            journals.velocity[row] += step * a;
            journals.offset[row] += 0.5 * step * journals.velocity[row];
        }
    }
}

/// Evaluates the bearings, the velocities taken forward to the middle of the step.
fn touch(
    arm: &ArmWithPlay,
    response: &Response,
    journals: &mut Journals,
    step: f64,
    forces: &mut [f64],
    moments: &mut [f64],
) {
    for (index, play) in arm.plays().iter().enumerate() {
        let middle = |i: usize| journals.velocity[i] + 0.5 * step * journals.acceleration[i];
        let journal = Journal {
            offset: [journals.offset[2 * index], journals.offset[2 * index + 1]],
            velocity: [middle(2 * index), middle(2 * index + 1)],
            turning: response.turning[index],
        };
        let approach = journal.approach(&play.clearance);
        let speed = if approach.penetration > 0.0 {
            *journals.impact[index].get_or_insert(approach.rate)
        } else {
            journals.impact[index] = None;
            0.0
        };
        let contact = bearing_contact(&play.clearance, &approach, speed);
        forces[2 * index..2 * index + 2].copy_from_slice(&contact.force);
        moments[index] = contact.moment;
    }
}
