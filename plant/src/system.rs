//! The arm with play, stepped in time.
//!
//! Each sub-step of length h: drift to the middle, q½ = q + h v/2; forces and accelerations there, with the
//! velocity extrapolated, v½ = v + h a₋/2; kick, v⁺ = v + h a; drift on, q⁺ = q½ + h v⁺/2. One evaluation of the
//! dynamics a sub-step, second order where the forces are smooth (leapfrog; Hairer, Lubich & Wanner 2006, §I.1.4).
//! Contacts need [`MAX_CONTACT_STEP`] or less: a Hertz impact of this arm lasts about 0.5 ms.

mod state;

use freeplay_arm::{
    Arm, Drive, Purpose, Workspace, bias, forward_kinematics, hybrid_aba, joint_reaction, kinetic_energy,
    potential_energy,
};
use freeplay_laws::{ArmParts, ArmWithPlay, BearingContact, Injection, Journal, ServoLaw};
use nalgebra::Isometry3;

use crate::drives::{Drives, Motor};
use crate::position_servo::PositionServo;
use crate::rotor::{check_step, share_out, with_rotors};
use crate::stiction::stopping_torques;
use crate::system_error::{MAX_CONTACT_STEP, SystemError};
use crate::tool_forces::ToolForces;
use crate::{Bearing, Braking, ContactTally, Ledger, LimitViolation, Motion, ReflexLimits};

/// Iterations for the twist of transmissions at rest.
const WINDING_ROUNDS: usize = 8;

/// Inputs of the joints during a tick.
pub struct Input<'a> {
    /// Torque of each nominal joint's motor, N·m (N); read where `driven` is false and no servo is closed.
    pub torque: &'a [f64],
    /// True for each nominal joint that follows `motion` instead.
    pub driven: &'a [bool],
    /// The motion of the prescribed joints.
    pub motion: &'a dyn Motion,
}

/// The greatest forces since the last call of [`System::take_peaks`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TickPeaks {
    /// Magnitude of the force that the base exerts on the first moving body, N.
    pub base_force: f64,
}

/// The arm with play and its state.
#[derive(Debug)]
pub struct System {
    play: ArmWithPlay,
    workspace: Workspace,
    drives: Drives,
    forces: ToolForces,
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
    /// Every joint is driven: by its brake. The list for [`Input::driven`].
    braked: Vec<bool>,
    prescribed: [Vec<f64>; 3],
    peaks: TickPeaks,
    ledger: Ledger,
    /// The servos of the effects, with the delays of their commands, s; they act once [`System::close_servos`] has closed them.
    named_servos: Vec<Option<(ServoLaw, f64)>>,
}

impl System {
    /// The arm `play` at rest at zero, stepped by ticks of `period` s in `substeps` sub-steps.
    ///
    /// # Errors
    /// [`SystemError::StepTooLong`] if the arm has play and the sub-step is over [`MAX_CONTACT_STEP`].
    pub fn new(play: ArmWithPlay, nominal: &Arm, period: f64, substeps: u32) -> Result<Self, SystemError> {
        let mut system = Self::unresolved(play, nominal, period, substeps)?;
        system.resolve_dry_friction(nominal, &[vec![0.0; nominal.dof()]]);
        Ok(system)
    }

    /// The same system before the dry friction is resolved.
    fn unresolved(play: ArmWithPlay, nominal: &Arm, period: f64, substeps: u32) -> Result<Self, SystemError> {
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
            drives: Drives::new(nominal.joints()),
            forces: ToolForces::none(dof),
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
            braked: vec![true; joints],
            prescribed: [vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]],
            peaks: TickPeaks::default(),
            ledger: Ledger::default(),
            named_servos: vec![None; joints],
            play,
        })
    }

    /// Sets up the dry friction of the drives so that it stops the joints of `links`, the arm behind the transmissions, within the
    /// sub-steps of a motion through `postures`. Joints without any inertia can only follow a motion, and need no stopping torque.
    fn resolve_dry_friction(&mut self, links: &Arm, postures: &[Vec<f64>]) {
        let motors: Vec<Option<f64>> =
            self.drives.motors.iter().map(|motor| motor.as_ref().map(|motor| motor.inertia)).collect();
        let step = self.period / f64::from(self.substeps);
        let Ok(stopping) = stopping_torques(links, &motors, postures, step) else { return };
        let (mut ws, rest) = (Workspace::new(links), vec![0.0; links.dof()]);
        let (mut load, mut dry) = (rest.clone(), rest.clone());
        for posture in postures {
            bias(links, &mut ws, posture, &rest, &mut load);
            let here = self.drives.dry_friction(posture, &load);
            dry.iter_mut().zip(here).for_each(|(dry, here)| *dry = dry.max(here));
        }
        self.drives.stop_with(stopping, &dry);
        self.drives.restart();
    }

    /// The arm `arm`, changed by its effects, with their `injection`, for a motion through `postures`: see the `rotor` file for the inertia
    /// of motors behind transmissions.
    ///
    /// # Errors
    /// Those of [`System::new`]; [`SystemError::Unfit`] for an arm without masses, [`SystemError::Law`] for an impossible arm,
    /// [`SystemError::TransmissionTooStiff`].
    pub fn with_effects(
        arm: &Arm,
        injection: Injection,
        postures: &[Vec<f64>],
        period: f64,
        substeps: u32,
    ) -> Result<Self, SystemError> {
        let arm = &with_rotors(arm, &injection.rotors)?;
        arm.require(Purpose::Simulation)?;
        let parted: Vec<usize> = injection.transmissions.iter().map(|(joint, _)| *joint).collect();
        let (links, sides) =
            if parted.is_empty() { (arm.clone(), Vec::new()) } else { share_out(arm, &parted, postures)? };
        let mut clearances = injection.clearances;
        clearances.retain(|(_, clearance)| clearance.clearance > 0.0);
        clearances.sort_by_key(|(joint, _)| *joint);
        let mut system = Self::unresolved(ArmWithPlay::new(&links, &clearances)?, arm, period, substeps)?;
        for ((joint, law), sides) in injection.transmissions.iter().zip(&sides) {
            check_step(&arm.joints()[*joint].name, law, sides, period, substeps)?;
            system.drives.decouple_motor(*joint, Motor::new(*law, sides.motor));
        }
        for (joint, law) in injection.servos {
            let delays = injection.command_delays.iter().filter(|(at, _)| *at == joint);
            system.named_servos[joint] = Some((law, delays.map(|(_, delay)| delay).sum()));
        }
        system.drives.add(injection.drives, &injection.saturations);
        system.resolve_dry_friction(&links, postures);
        system.forces.add(injection.forces);
        Ok(system)
    }

    /// Closes the loops of the servos in the effects of `arm`, the arm with its effects. From now on the servos command the torques of the
    /// drives, and [`Input::torque`] has no effect. Returns the arm with the damping of its servos added to that of its joints.
    ///
    /// # Errors
    /// [`SystemError::NoServo`], [`SystemError::NegativeDelay`]; [`SystemError::Law`] for an impossible arm.
    pub fn close_servos(&mut self, arm: &Arm) -> Result<Arm, SystemError> {
        let mut parts = ArmParts::of(arm);
        let mut servos = Vec::with_capacity(self.named_servos.len());
        for (joint, named) in parts.joints.iter_mut().zip(&self.named_servos) {
            let Some((law, delay)) = *named else {
                return Err(SystemError::NoServo { joint: joint.name.clone() });
            };
            if delay < 0.0 {
                return Err(SystemError::NegativeDelay { joint: joint.name.clone(), delay });
            }
            let servo = PositionServo::new(law, delay, self.period);
            joint.friction.viscous += servo.damping();
            servos.push(servo);
        }
        self.drives.serve(servos);
        Ok(parts.into_arm(arm.name())?)
    }

    /// Sends the servos the commanded positions `q`, rad (m), now.
    pub fn command_servos(&mut self, q: &[f64]) {
        let now = self.time();
        self.drives.servos.iter_mut().zip(q).for_each(|(servo, q)| servo.command(now, *q));
    }

    /// Sets the joints to `q`, `v` (nominal), the journals to rest at the centres of their bearings, and the time to zero. Links behind
    /// transmissions start at the static deflection of their springs.
    pub fn start(&mut self, q: &[f64], v: &[f64]) {
        self.q.fill(0.0);
        self.v.fill(0.0);
        self.a.fill(0.0);
        self.play.spread(q, &mut self.q);
        self.play.spread(v, &mut self.v);
        self.ticks = 0;
        self.drives.restart();
        self.drives.servos.iter_mut().zip(q).for_each(|(servo, q)| servo.restart(*q));
        self.deflect_transmissions(q, v);
        for bearing in &mut self.bearings {
            *bearing = Bearing::new(*bearing.clearance());
        }
        self.ledger = Ledger::default();
        self.balance();
        self.ledger.initial = self.ledger.total();
    }

    /// Sets the motors behind transmissions to `q`, `v`, and their links to the static deflection of the springs.
    fn deflect_transmissions(&mut self, q: &[f64], v: &[f64]) {
        if !self.drives.has_motors() {
            return;
        }
        self.middle_v.fill(0.0);
        // The load depends little on the twist: each iteration reduces the error by the ratio of gravity's stiffness to the spring's.
        for _ in 0..WINDING_ROUNDS {
            bias(self.play.arm(), &mut self.workspace, &self.q, &self.middle_v, &mut self.total);
            for (joint, motor) in self.drives.motors.iter_mut().enumerate() {
                let Some(motor) = motor else { continue };
                let at = self.play.joint(joint);
                motor.state = [q[joint], v[joint], 0.0];
                self.q[at] = q[joint] - motor.law.twist(self.total[at]);
            }
        }
    }

    /// Sets the journal of the play `play` to `offset` (m) and `velocity` (m/s) in its bearing's plane.
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
    /// [`SystemError::NotFinite`] names the first coordinate that is not finite.
    pub fn tick(&mut self, input: &Input) -> Result<(), SystemError> {
        (0..self.substeps).for_each(|substep| self.numbered_substep(substep, input));
        self.end_tick(input)
    }

    /// Steps one tick during which the drives check the joints that follow torques. If one is beyond `limits` of speed and position, or
    /// would be by the next sub-step, `brakes` close on all joints at once. Returns the violated limit.
    ///
    /// # Errors
    /// [`SystemError::NotFinite`] names the first coordinate that is not finite.
    pub fn watched_tick(
        &mut self,
        input: &Input,
        limits: &ReflexLimits,
        brakes: &mut Braking,
    ) -> Result<Option<LimitViolation>, SystemError> {
        let step = self.period / f64::from(self.substeps);
        for substep in 0..self.substeps {
            self.numbered_substep(substep, input);
            let is_clear = |joint| limits.is_clear(joint, self.joint(joint), step);
            if (0..self.motor.len()).all(is_clear) {
                continue;
            }
            let free = (0..self.motor.len()).filter(|&joint| !input.driven[joint]);
            let found = free.filter_map(|joint| limits.excess(joint, self.joint(joint), step)).next();
            if found.is_none() {
                continue;
            }
            let now = self.time() + f64::from(substep + 1) * step;
            brakes.close(now, (0..self.motor.len()).map(|joint| self.joint(joint)).map(|[q, v, _]| [q, v]));
            let all = std::mem::take(&mut self.braked);
            let braking = Input { torque: input.torque, driven: &all, motion: brakes };
            (substep + 1..self.substeps).for_each(|rest| self.numbered_substep(rest, &braking));
            let ended = self.end_tick(&braking);
            self.braked = all;
            return ended.map(|()| found);
        }
        self.end_tick(input).map(|()| None)
    }

    /// Computes sub-step `number` of the present tick.
    fn numbered_substep(&mut self, number: u32, input: &Input) {
        let step = self.period / f64::from(self.substeps);
        self.substep(self.time() + (f64::from(number) + 0.5) * step, step, input);
    }

    fn end_tick(&mut self, input: &Input) -> Result<(), SystemError> {
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
        self.actuate(middle, step, input);
        self.touch(step);
        self.forces.push(middle, self.play.arm(), &mut self.workspace, &self.middle_q, &mut self.drive);
        hybrid_aba(
            self.play.arm(),
            &mut self.workspace,
            &self.middle_q,
            &self.middle_v,
            &self.drive,
            &mut self.a,
            &mut self.total,
        );
        let carried = joint_reaction(&self.workspace, 0).0;
        let base_force = self.forces.without(carried, &self.workspace);
        self.peaks.base_force = self.peaks.base_force.max(base_force.norm());
        for i in 0..self.q.len() {
            let before = self.v[i];
            self.v[i] += step * self.a[i];
            self.q[i] = self.middle_q[i] + half * self.v[i];
            self.middle_v[i] = 0.5 * (before + self.v[i]);
        }
        if self.drives.has_only_nominal_friction() {
            self.book_plain_drives(step, input);
        } else {
            self.turn_motors(step, input);
            self.book_drives(step, input);
        }
        self.book_contacts(step, input);
    }

    /// Sets the drives of all joints: motor and drive friction, or the prescribed motion; slides are free.
    fn actuate(&mut self, time: f64, step: f64, input: &Input) {
        let [q, v, a] = &mut self.prescribed;
        if input.driven.contains(&true) {
            input.motion.at(time, q, v, a);
        }
        self.drive.fill(Drive::Torque(0.0));
        if self.drives.has_only_nominal_friction() {
            self.actuate_plain(step, input);
        } else {
            self.actuate_all(time, step, input);
        }
    }

    /// Actuates drives with nominal friction only.
    fn actuate_plain(&mut self, step: f64, input: &Input) {
        let [q, v, a] = &self.prescribed;
        for joint in 0..self.motor.len() {
            let at = self.play.joint(joint);
            if input.driven[joint] {
                (self.middle_q[at], self.middle_v[at]) = (q[joint], v[joint]);
                self.drive[at] = Drive::Acceleration(a[joint]);
                self.drives.rub(joint, v[joint], v[joint] + 0.5 * step * a[joint]);
            } else {
                let (v, a) = (self.middle_v[at], self.a[at]);
                let loss = self.drives.rub(joint, v, v + 0.5 * step * a);
                self.drive[at] = Drive::Torque(input.torque[joint] + loss);
            }
        }
    }

    /// Actuates drives with effects.
    fn actuate_all(&mut self, time: f64, step: f64, input: &Input) {
        let [q, v, a] = &self.prescribed;
        for joint in 0..self.motor.len() {
            let at = self.play.joint(joint);
            let prescribed = input.driven[joint].then_some([q[joint], v[joint], a[joint]]);
            if let (Some([q, v, _]), None) = (prescribed, &self.drives.motors[joint]) {
                (self.middle_q[at], self.middle_v[at]) = (q, v);
            }
            let link = [self.middle_q[at], self.middle_v[at]];
            self.drives.place(joint, prescribed, link, 0.5 * step);
            self.drives.act(joint, time, step);
        }
        self.drives.compute_losses(time, step);
        for (joint, &acceleration) in a.iter().enumerate() {
            let at = self.play.joint(joint);
            let state = [self.drives.q[joint], self.drives.v[joint]];
            self.drive[at] = match &mut self.drives.motors[joint] {
                Some(motor) => Drive::Torque(motor.carry(state, [self.middle_q[at], self.middle_v[at]])),
                None if input.driven[joint] => Drive::Acceleration(acceleration),
                None => {
                    let torque = self.drives.motor_torque(joint, input.torque[joint]);
                    Drive::Torque(torque + self.drives.loss[joint])
                }
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

    /// Steps the motors behind transmissions, and stores the quantities that the laws of the drives need in the next sub-step.
    fn turn_motors(&mut self, step: f64, input: &Input) {
        for joint in 0..self.motor.len() {
            let at = self.play.joint(joint);
            let (driven, loss) = (input.driven[joint], self.drives.loss[joint]);
            let asked = self.drives.motor_torque(joint, input.torque[joint]);
            let prescribed = self.prescribed[2][joint];
            (self.motor[joint], self.drives.a[joint]) = match &mut self.drives.motors[joint] {
                None if driven => (self.total[at] - loss - self.forces.generalised_force(at), prescribed),
                None => (asked, self.a[at]),
                Some(motor) => {
                    let free = (asked + loss - motor.carried) / motor.inertia;
                    let a = if driven { prescribed } else { free };
                    motor.kick(self.drives.q[joint], a, step);
                    (if driven { motor.inertia * a + motor.carried - loss } else { asked }, a)
                }
            };
        }
    }

    /// Books the work of plain drives, at the mean of the velocities before and after the sub-step.
    fn book_plain_drives(&mut self, step: f64, input: &Input) {
        for joint in 0..self.motor.len() {
            let (at, loss) = (self.play.joint(joint), self.drives.loss[joint]);
            let driven = input.driven[joint];
            let v = if driven { self.prescribed[1][joint] } else { self.middle_v[at] };
            let needed = || self.total[at] - loss - self.forces.generalised_force(at);
            self.motor[joint] = if driven { needed() } else { input.torque[joint] };
            self.ledger.drives += step * self.motor[joint] * v;
            self.ledger.drive_friction -= step * loss * v;
        }
    }

    /// Books the work of drives with effects, and stores the load that their laws need in the next sub-step.
    fn book_drives(&mut self, step: f64, input: &Input) {
        for (joint, &speed) in self.prescribed[1].iter().enumerate() {
            let (at, loss) = (self.play.joint(joint), self.drives.loss[joint]);
            let (driven, motor) = (input.driven[joint], &self.drives.motors[joint]);
            if let Some(motor) = motor {
                self.ledger.transmission += step * motor.damped * (motor.mean - self.middle_v[at]);
            }
            let free = motor.as_ref().map_or(self.middle_v[at], |motor| motor.mean);
            let v = if driven { speed } else { free };
            self.ledger.drives += step * self.motor[joint] * v;
            self.ledger.drive_friction -= step * loss * v;
        }
    }

    /// Books the work of contacts and of forces on the tool.
    fn book_contacts(&mut self, step: f64, input: &Input) {
        let [_, prescribed, _] = &self.prescribed;
        self.ledger.tool_force += step * self.forces.power(&self.middle_v);
        for (at, contact) in self.play.plays().iter().zip(&self.contacts) {
            // The mean velocity belongs to the middle of the sub-step, where the contact was evaluated.
            let mut journal = journal(&self.middle_q, &self.middle_v, at);
            if input.driven[at.joint] && self.drives.motors[at.joint].is_none() {
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
        if !self.drives.has_only_nominal_friction() {
            for (load, (motor, loss)) in
                self.drives.load.iter_mut().zip(self.motor.iter().zip(&self.drives.loss))
            {
                *load = motor + loss;
            }
        }
    }

    /// Sets prescribed joints to their motion at `time`.
    fn place_driven(&mut self, time: f64, input: &Input) {
        let [q, v, a] = &mut self.prescribed;
        if !input.driven.contains(&true) {
            return;
        }
        input.motion.at(time, q, v, a);
        for joint in (0..q.len()).filter(|&joint| input.driven[joint]) {
            match &mut self.drives.motors[joint] {
                Some(motor) => motor.state = [q[joint], v[joint], a[joint]],
                None => {
                    let at = self.play.joint(joint);
                    (self.q[at], self.v[at], self.a[at]) = (q[joint], v[joint], a[joint]);
                }
            }
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

    /// Updates the energies of the ledger.
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
        for (joint, motor) in self.drives.motors.iter().enumerate() {
            let Some(motor) = motor else { continue };
            let [q, v, _] = motor.state;
            self.ledger.kinetic += 0.5 * motor.inertia * v * v;
            self.ledger.elastic += motor.law.energy(q - self.q[self.play.joint(joint)]);
        }
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

    /// Position, velocity and acceleration of the nominal joint `joint` on the motor's side.
    pub fn joint(&self, joint: usize) -> [f64; 3] {
        let at = self.play.joint(joint);
        let link = [self.q[at], self.v[at], self.a[at]];
        self.drives.motors[joint].as_ref().map_or(link, |motor| motor.state)
    }

    /// Writes position and velocity of the nominal joints on the motor's side, where the robot's own encoders sit.
    pub fn encoders(&self, q: &mut [f64], v: &mut [f64]) {
        for (joint, (q, v)) in q.iter_mut().zip(v).enumerate() {
            [*q, *v, _] = self.joint(joint);
        }
    }

    /// The nominal joints whose motor a transmission decouples from the link.
    pub fn decoupled_joints(&self) -> impl Iterator<Item = usize> + '_ {
        let motors = self.drives.motors.iter().enumerate();
        motors.filter_map(|(joint, motor)| motor.as_ref().map(|_| joint))
    }

    /// Inertia of the rotor of the nominal joint `joint` behind its transmission, kg·m² (kg); `None` without a transmission.
    pub fn rotor_inertia(&self, joint: usize) -> Option<f64> {
        self.drives.motors[joint].as_ref().map(|motor| motor.inertia)
    }

    /// Torques of the nominal joints' motors in the last sub-step, N·m (N); for prescribed joints, the torques that the motion required.
    pub fn motor_torque(&self) -> &[f64] {
        &self.motor
    }

    /// The drives' own values of those torques, N·m (N), clamped to the limits of the drives.
    pub fn drive_torque(&self, torque: &mut [f64]) {
        for (joint, torque) in torque.iter_mut().enumerate() {
            *torque = self.drives.saturated(joint, self.motor[joint]);
        }
    }

    /// The arm with play.
    pub fn play(&self) -> &ArmWithPlay {
        &self.play
    }

    /// The bearings, in the order of [`ArmWithPlay::plays`].
    pub fn bearings(&self) -> &[Bearing] {
        &self.bearings
    }

    /// The bearing of the play `play`, for taking its peak.
    pub fn bearing_mut(&mut self, play: usize) -> &mut Bearing {
        &mut self.bearings[play]
    }

    /// The contacts of the last sub-step.
    pub fn contacts(&self) -> &[BearingContact] {
        &self.contacts
    }

    /// The time that each journal has spent in each state so far.
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
