//! A small simulation of the model: it computes the motion of the journals while the joints are driven.
//!
//! The simulation steps the arm with play of the model file as the plant does, with fewer sub-steps: it drifts to the middle,
//! evaluates the forces there (contacts by the laws of the model: Lankarani & Nikravesh 1990, friction), kicks, and drifts on
//! (leapfrog; Hairer, Lubich & Wanner 2006, §I.1.4). The simulation assumes nothing about contact: a journal detaches, flies and
//! lands by itself. A Hertz impact of this arm lasts 0.5 ms; sub-steps of 50 µs resolve its peak to 1 % and its time to a sub-step.

use freeplay_arm::{Drive, Workspace, hybrid_aba};
use freeplay_laws::{ArmWithPlay, Journal, bearing_contact};

use crate::compensation::Motion;

/// Longest sub-step that resolves a contact, s.
pub const LONGEST_SUBSTEP: f64 = 5e-5;

/// Input that moves the joints during a tick.
#[derive(Clone, Copy, Debug)]
pub enum Driven<'a> {
    /// Torques of the motors without drive friction, N·m (N), held for the tick.
    Torque(&'a [f64]),
    /// Accelerations, rad/s² (m/s²), held for the tick.
    Acceleration(&'a [f64]),
}

/// Contact record of one journal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Touch {
    /// True if the journal touches its bearing.
    pub touching: bool,
    /// Approach speed at the last landing, m/s.
    pub impact_speed: f64,
    /// Number of landings since the start.
    pub landings: u32,
    /// Time in flight since the start, s.
    pub flight: f64,
    /// Normal force of the last sub-step, N.
    pub normal_force: f64,
}

/// The simulation of one arm with play.
#[derive(Clone, Debug)]
pub struct Rollout {
    arm: ArmWithPlay,
    workspace: Workspace,
    period: f64,
    substeps: u32,
    touches: Vec<Touch>,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    middle_q: Vec<f64>,
    middle_v: Vec<f64>,
    drives: Vec<Drive>,
    spent: Vec<f64>,
}

impl Rollout {
    /// Creates a simulation of the arm with play `arm`, in ticks of `period` seconds.
    pub fn new(arm: &ArmWithPlay, period: f64) -> Rollout {
        let m = arm.arm().dof();
        let zeros = vec![0.0; m];
        Rollout {
            workspace: Workspace::new(arm.arm()),
            period,
            substeps: (period / LONGEST_SUBSTEP).ceil().max(1.0) as u32,
            touches: vec![Touch::default(); arm.plays().len()],
            q: zeros.clone(),
            v: zeros.clone(),
            a: zeros.clone(),
            middle_q: zeros.clone(),
            middle_v: zeros.clone(),
            drives: vec![Drive::Torque(0.0); m],
            spent: zeros,
            arm: arm.clone(),
        }
    }

    /// Sets the positions, velocities and accelerations of the joints to `joints` and those of the journals to `journals` (two
    /// displacements for each joint with play, m). A journal in contact counts as settled in its bearing.
    pub fn start(&mut self, joints: Motion<'_>, journals: Motion<'_>) {
        let parts = [
            (&mut self.q, joints.q, journals.q),
            (&mut self.v, joints.v, journals.v),
            (&mut self.a, joints.a, journals.a),
        ];
        for (extended, joints, journals) in parts {
            self.arm.spread(joints, extended);
            for (slide, &value) in self.arm.plays().iter().flat_map(|play| play.slides).zip(journals) {
                extended[slide] = value;
            }
        }
        self.touches.fill(Touch::default());
        for index in 0..self.touches.len() {
            let play = &self.arm.plays()[index];
            let journal = journal(&self.q, &self.v, play);
            self.touches[index].touching = journal.approach(&play.clearance).penetration > 0.0;
        }
    }

    /// Advances by one tick.
    pub fn tick(&mut self, driven: Driven<'_>) {
        let step = self.period / f64::from(self.substeps);
        for _ in 0..self.substeps {
            self.substep(step, driven);
        }
    }

    fn substep(&mut self, step: f64, driven: Driven<'_>) {
        let half = 0.5 * step;
        for i in 0..self.q.len() {
            self.middle_q[i] = self.q[i] + half * self.v[i];
            self.middle_v[i] = self.v[i] + half * self.a[i];
        }
        for joint in 0..self.arm.nominal_dof() {
            self.drives[self.arm.joint(joint)] = match driven {
                Driven::Torque(torque) => Drive::Torque(torque[joint]),
                Driven::Acceleration(acceleration) => Drive::Acceleration(acceleration[joint]),
            };
        }
        self.touch(step);
        hybrid_aba(
            self.arm.arm(),
            &mut self.workspace,
            &self.middle_q,
            &self.middle_v,
            &self.drives,
            &mut self.a,
            &mut self.spent,
        );
        for i in 0..self.q.len() {
            self.v[i] += step * self.a[i];
            self.q[i] = self.middle_q[i] + half * self.v[i];
        }
    }

    /// Applies the contact forces of the bearings.
    fn touch(&mut self, step: f64) {
        for (play, touch) in self.arm.plays().iter().zip(&mut self.touches) {
            let approach = journal(&self.middle_q, &self.middle_v, play).approach(&play.clearance);
            let touches = approach.penetration > 0.0;
            if touches && !touch.touching {
                touch.impact_speed = approach.rate;
                touch.landings += 1;
            }
            touch.touching = touches;
            touch.flight += if touches { 0.0 } else { step };
            let contact = bearing_contact(&play.clearance, &approach, touch.impact_speed);
            touch.normal_force = contact.normal;
            for (slide, force) in play.slides.into_iter().zip(contact.force) {
                self.drives[slide] = Drive::Torque(force);
            }
            if let Drive::Torque(torque) = &mut self.drives[play.turn] {
                *torque += contact.moment;
            }
        }
    }

    /// The contacts, in the order of the joints with play.
    pub fn touches(&self) -> &[Touch] {
        &self.touches
    }

    /// Coordinates of the arm with play, rad or m.
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    /// Velocities of the arm with play, rad/s or m/s.
    pub fn v(&self) -> &[f64] {
        &self.v
    }
}

/// The journal of `play` in the coordinates `q`, `v` of the arm with play.
fn journal(q: &[f64], v: &[f64], play: &freeplay_laws::Play) -> Journal {
    let [first, second] = play.slides;
    Journal { offset: [q[first], q[second]], velocity: [v[first], v[second]], turning: v[play.turn] }
}
