//! The arm with play, stepped in time.
//!
//! Each sub-step of length h: drift to the middle, q½ = q + h v/2; forces and accelerations there, with the
//! velocity extrapolated, v½ = v + h a₋/2; kick, v⁺ = v + h a; drift on, q⁺ = q½ + h v⁺/2. One evaluation of the
//! dynamics a sub-step, second order where the forces are smooth (leapfrog; Hairer, Lubich & Wanner 2006, §I.1.4).
//! Contacts need [`MAX_CONTACT_STEP`] or less: a Hertz impact of this arm lasts about 0.5 ms.

use freeplay_arm::{
    Arm, Drive, Workspace, forward_kinematics, hybrid_aba, joint_reaction, kinetic_energy, potential_energy,
};
use freeplay_laws::{ArmWithPlay, BearingContact, DriveFriction, Journal};
use nalgebra::Isometry3;
use thiserror::Error;

use crate::{Bearing, ContactTally, Ledger, Motion};

/// The longest sub-step that is allowed where a contact can happen, s.
pub const MAX_CONTACT_STEP: f64 = 1e-4;

/// Why a system can't be built or went wrong.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SystemError {
    /// The sub-step is too long for contacts.
    #[error(
        "a sub-step of {step:e} s can't resolve a contact (it lasts about 5e-4 s); take {MAX_CONTACT_STEP:e} s or less: more sub-steps a tick"
    )]
    StepTooLong {
        /// The step asked for, s.
        step: f64,
    },
    /// There must be at least one sub-step, of a positive length.
    #[error("a tick of {period} s in {substeps} sub-steps is not possible; both must be above zero")]
    NoStep {
        /// The tick's length, s.
        period: f64,
        /// Its sub-steps.
        substeps: u32,
    },
    /// A coordinate is no longer finite.
    #[error(
        "coordinate {coordinate} is not finite at t = {time} s; the sub-steps are too long for this contact or the command is too wild"
    )]
    NotFinite {
        /// Name of the coordinate.
        coordinate: String,
        /// Simulated time, s.
        time: f64,
    },
}

/// What acts on the joints during a tick.
pub struct Input<'a> {
    /// Torque of each nominal joint's motor, N·m (N); read where `driven` is false.
    pub torque: &'a [f64],
    /// Whether each nominal joint follows `motion` instead.
    pub driven: &'a [bool],
    /// The motion of the prescribed joints.
    pub motion: &'a dyn Motion,
}

/// The greatest forces since they were last taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TickPeaks {
    /// Magnitude of the force that the base exerts on the first moving body, N.
    pub base_force: f64,
}

/// The arm with play and all that changes in it.
#[derive(Clone, Debug)]
pub struct System {
    play: ArmWithPlay,
    workspace: Workspace,
    friction: Vec<DriveFriction>,
    bearings: Vec<Bearing>,
    contacts: Vec<BearingContact>,
    period: f64,
    substeps: u32,
    ticks: u64,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    middle_q: Vec<f64>,
    middle_v: Vec<f64>,
    drive: Vec<Drive>,
    total: Vec<f64>,
    motor: Vec<f64>,
    prescribed: [Vec<f64>; 3],
    peaks: TickPeaks,
    ledger: Ledger,
}

impl System {
    /// The arm `play` at rest at zero, stepped by ticks of `period` s in `substeps` sub-steps.
    ///
    /// # Errors
    /// [`SystemError::StepTooLong`] if the arm has play and the sub-step is over [`MAX_CONTACT_STEP`].
    pub fn new(play: ArmWithPlay, nominal: &Arm, period: f64, substeps: u32) -> Result<Self, SystemError> {
        let step = period / f64::from(substeps);
        if !(period > 0.0 && substeps > 0 && step.is_finite()) {
            return Err(SystemError::NoStep { period, substeps });
        }
        if !play.plays().is_empty() && step > MAX_CONTACT_STEP * (1.0 + 1e-9) {
            return Err(SystemError::StepTooLong { step });
        }
        let (dof, joints) = (play.arm().dof(), nominal.dof());
        Ok(Self {
            workspace: Workspace::new(play.arm()),
            friction: nominal.joints().iter().map(|joint| DriveFriction::nominal(joint.friction)).collect(),
            bearings: play.plays().iter().map(|at| Bearing::new(at.clearance)).collect(),
            contacts: vec![BearingContact::default(); play.plays().len()],
            period,
            substeps,
            ticks: 0,
            q: vec![0.0; dof],
            v: vec![0.0; dof],
            a: vec![0.0; dof],
            middle_q: vec![0.0; dof],
            middle_v: vec![0.0; dof],
            drive: vec![Drive::Torque(0.0); dof],
            total: vec![0.0; dof],
            motor: vec![0.0; joints],
            prescribed: [vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]],
            peaks: TickPeaks::default(),
            ledger: Ledger::default(),
            play,
        })
    }

    /// Puts the joints at `q`, `v` (nominal), the journals in the middle of their bearings at rest, and the time to zero.
    pub fn start(&mut self, q: &[f64], v: &[f64]) {
        self.q.fill(0.0);
        self.v.fill(0.0);
        self.a.fill(0.0);
        self.play.spread(q, &mut self.q);
        self.play.spread(v, &mut self.v);
        self.ticks = 0;
        for bearing in &mut self.bearings {
            *bearing = Bearing::new(*bearing.clearance());
        }
        self.ledger = Ledger::default();
        self.balance();
        self.ledger.initial = self.ledger.total();
    }

    /// Puts the journal of the play `play` at `offset` (m) and `velocity` (m/s) in its bearing's plane.
    pub fn place_journal(&mut self, play: usize, offset: [f64; 2], velocity: [f64; 2]) {
        for (axis, slide) in self.play.plays()[play].slides.into_iter().enumerate() {
            (self.q[slide], self.v[slide]) = (offset[axis], velocity[axis]);
        }
        self.balance();
        self.ledger.initial = self.ledger.total();
    }

    /// Steps one tick.
    ///
    /// # Errors
    /// [`SystemError::NotFinite`] names the first coordinate that is no longer a number.
    pub fn tick(&mut self, input: &Input) -> Result<(), SystemError> {
        let step = self.period / f64::from(self.substeps);
        let start = self.time();
        for substep in 0..self.substeps {
            self.substep(start + (f64::from(substep) + 0.5) * step, step, input);
        }
        self.ticks += 1;
        self.place_driven(self.time(), input);
        self.check()?;
        self.balance();
        Ok(())
    }

    fn substep(&mut self, middle: f64, step: f64, input: &Input) {
        let half = 0.5 * step;
        for i in 0..self.q.len() {
            self.middle_q[i] = self.q[i] + half * self.v[i];
            self.middle_v[i] = self.v[i] + half * self.a[i];
        }
        self.actuate(middle, input);
        self.touch(step);
        hybrid_aba(
            self.play.arm(),
            &mut self.workspace,
            &self.middle_q,
            &self.middle_v,
            &self.drive,
            &mut self.a,
            &mut self.total,
        );
        self.peaks.base_force = self.peaks.base_force.max(joint_reaction(&self.workspace, 0).0.norm());
        for i in 0..self.q.len() {
            let before = self.v[i];
            self.v[i] += step * self.a[i];
            self.q[i] = self.middle_q[i] + half * self.v[i];
            self.middle_v[i] = 0.5 * (before + self.v[i]);
        }
        self.book(step, input);
    }

    /// Sets the drives of all joints: motor and drive friction, or the prescribed motion; slides are free.
    fn actuate(&mut self, time: f64, input: &Input) {
        let [q, v, a] = &mut self.prescribed;
        if input.driven.contains(&true) {
            input.motion.at(time, q, v, a);
        }
        self.drive.fill(Drive::Torque(0.0));
        for (joint, friction) in self.friction.iter().enumerate() {
            let at = self.play.joint(joint);
            self.drive[at] = if input.driven[joint] {
                (self.middle_q[at], self.middle_v[at]) = (q[joint], v[joint]);
                Drive::Acceleration(a[joint])
            } else {
                Drive::Torque(input.torque[joint] + friction.torque(self.middle_v[at]))
            };
        }
    }

    /// Adds the forces of the bearings.
    fn touch(&mut self, step: f64) {
        for ((at, bearing), contact) in
            self.play.plays().iter().zip(&mut self.bearings).zip(&mut self.contacts)
        {
            let approach = journal(&self.middle_q, &self.middle_v, at).approach(&at.clearance);
            *contact = bearing.contact(&approach, step);
            for (slide, force) in at.slides.into_iter().zip(contact.force) {
                self.drive[slide] = Drive::Torque(force);
            }
            if let Drive::Torque(torque) = &mut self.drive[at.turn] {
                *torque += contact.moment;
            }
        }
    }

    /// Books the work of the sub-step, at the mean of the velocities before and after it.
    fn book(&mut self, step: f64, input: &Input) {
        let [_, prescribed, _] = &self.prescribed;
        for (joint, friction) in self.friction.iter().enumerate() {
            let at = self.play.joint(joint);
            let driven = input.driven[joint];
            let v = if driven { prescribed[joint] } else { self.middle_v[at] };
            let lost = friction.torque(v);
            self.motor[joint] = if driven { self.total[at] - lost } else { input.torque[joint] };
            self.ledger.drives += step * self.motor[joint] * v;
            self.ledger.drive_friction -= step * lost * v;
        }
        for (at, contact) in self.play.plays().iter().zip(&self.contacts) {
            // The mean velocity belongs to the middle of the sub-step, where the contact was evaluated.
            let mut journal = journal(&self.middle_q, &self.middle_v, at);
            if input.driven[at.joint] {
                journal.turning = prescribed[at.joint];
                self.motor[at.joint] -= contact.moment;
                self.ledger.drives -= step * contact.moment * prescribed[at.joint];
            }
            let approach = journal.approach(&at.clearance);
            if approach.penetration <= 0.0 {
                continue;
            }
            let elastic = at.clearance.normal.elastic_force(approach.penetration);
            self.ledger.damping += step * (contact.normal - elastic) * approach.rate;
            self.ledger.contact_friction -= step * contact.tangential * approach.sliding;
        }
    }

    /// Puts prescribed joints where their motion has them at `time`.
    fn place_driven(&mut self, time: f64, input: &Input) {
        let [q, v, a] = &mut self.prescribed;
        if !input.driven.contains(&true) {
            return;
        }
        input.motion.at(time, q, v, a);
        for joint in (0..q.len()).filter(|&joint| input.driven[joint]) {
            let at = self.play.joint(joint);
            (self.q[at], self.v[at], self.a[at]) = (q[joint], v[joint], a[joint]);
        }
    }

    fn check(&self) -> Result<(), SystemError> {
        match (0..self.q.len()).find(|&i| !(self.q[i].is_finite() && self.v[i].is_finite())) {
            None => Ok(()),
            Some(i) => Err(SystemError::NotFinite {
                coordinate: self.play.arm().joints()[i].name.clone(),
                time: self.time(),
            }),
        }
    }

    /// Brings the ledger's energies up to date.
    fn balance(&mut self) {
        let arm = self.play.arm();
        self.ledger.kinetic = kinetic_energy(arm, &mut self.workspace, &self.q, &self.v);
        self.ledger.potential = potential_energy(arm, &mut self.workspace, &self.q);
        self.ledger.elastic = self
            .play
            .plays()
            .iter()
            .map(|at| {
                let penetration = journal(&self.q, &self.v, at).approach(&at.clearance).penetration;
                at.clearance.normal.elastic_energy(penetration.max(0.0))
            })
            .sum();
    }

    /// Simulated time, s.
    pub fn time(&self) -> f64 {
        self.ticks as f64 * self.period
    }

    /// Coordinates of the arm with play: rad or m.
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    /// Velocities of the arm with play.
    pub fn v(&self) -> &[f64] {
        &self.v
    }

    /// Position, velocity and acceleration of the coordinate `index` of the arm with play.
    pub fn coordinate(&self, index: usize) -> [f64; 3] {
        [self.q[index], self.v[index], self.a[index]]
    }

    /// Torques of the nominal joints' motors in the last sub-step, N·m (N); for prescribed joints, what they needed.
    pub fn motor_torque(&self) -> &[f64] {
        &self.motor
    }

    /// The arm with play.
    pub fn play(&self) -> &ArmWithPlay {
        &self.play
    }

    /// The bearings, in the order of [`ArmWithPlay::plays`].
    pub fn bearings(&self) -> &[Bearing] {
        &self.bearings
    }

    /// The bearing of the play `play`, to take its peak.
    pub fn bearing_mut(&mut self, play: usize) -> &mut Bearing {
        &mut self.bearings[play]
    }

    /// The contacts of the last sub-step.
    pub fn contacts(&self) -> &[BearingContact] {
        &self.contacts
    }

    /// How each journal spent its time so far.
    pub fn tallies(&self) -> impl Iterator<Item = ContactTally> + '_ {
        self.bearings.iter().map(Bearing::settled)
    }

    /// The energy ledger at the last tick.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The greatest forces since the last call.
    pub fn take_peaks(&mut self) -> TickPeaks {
        std::mem::take(&mut self.peaks)
    }

    /// True pose of the tool in the base frame.
    pub fn tool(&mut self) -> Isometry3<f64> {
        forward_kinematics(self.play.arm(), &mut self.workspace, &self.q)
    }
}

/// The journal of the play `at` in the coordinates `q`, `v` of the arm with play.
fn journal(q: &[f64], v: &[f64], at: &freeplay_laws::Play) -> Journal {
    let [first, second] = at.slides;
    Journal { offset: [q[first], q[second]], velocity: [v[first], v[second]], turning: v[at.turn] }
}
