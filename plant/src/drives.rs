//! The drives of all joints: their losses, their saturation, and the motors that a transmission decouples from their links.
//!
//! A motor of inertia J obeys J θ̈ = τ_m + τ_l − τ with the motor's torque τ_m, the (negative) losses τ_l and the torque τ that the
//! transmission carries to the link. It is stepped like the arm: drift, kick, drift.

use freeplay_arm::Joint;
use freeplay_laws::{Archive, DriveFriction, DriveLaw, DriveState, Transmission};

use crate::position_servo::PositionServo;

/// A motor behind a transmission.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    /// The transmission between the motor and the link.
    pub law: Transmission,
    /// Inertia J of the rotor on the joint side, kg·m² (kg).
    pub inertia: f64,
    /// Position θ, velocity and acceleration.
    pub state: [f64; 3],
    /// Mean velocity of the last sub-step.
    pub mean: f64,
    /// Torque τ that the transmission carried in the last sub-step, N·m (N).
    pub carried: f64,
    /// Part of that torque from the damping of the transmission.
    pub damped: f64,
}

impl Motor {
    pub fn new(law: Transmission, inertia: f64) -> Self {
        Self { law, inertia, state: [0.0; 3], mean: 0.0, carried: 0.0, damped: 0.0 }
    }

    /// Position and velocity in the middle of a sub-step; `half` is half its length, s.
    #[inline]
    fn middle(&self, half: f64) -> [f64; 2] {
        let [q, v, a] = self.state;
        [q + half * v, v + half * a]
    }

    /// Computes the torque that the transmission carries from the motor at `motor` to the link at `link`, each position and velocity.
    #[inline]
    pub fn carry(&mut self, motor: [f64; 2], link: [f64; 2]) -> f64 {
        let (twist, rate) = (motor[0] - link[0], motor[1] - link[1]);
        self.carried = self.law.torque(twist, rate);
        self.damped = self.carried - self.law.stiffness * self.law.spring_twist(twist);
        self.carried
    }

    /// Kicks the motor from `middle` by the acceleration `a` for a sub-step of `step` s.
    #[inline]
    pub fn kick(&mut self, middle: f64, a: f64, step: f64) {
        let before = self.state[1];
        let after = before + step * a;
        self.state = [middle + 0.5 * step * after, after, a];
        self.mean = 0.5 * (before + after);
    }
}

/// The drives of all nominal joints; every list has one entry per joint.
#[derive(Debug)]
pub(crate) struct Drives {
    friction: Vec<DriveFriction>,
    laws: Vec<Box<dyn DriveLaw>>,
    limit: Vec<f64>,
    /// True if the drives have nothing but nominal friction: no laws of effects, torque limits, transmissions or servos.
    plain: bool,
    /// The motors that are decoupled from their links.
    pub motors: Vec<Option<Motor>>,
    /// Motor-side positions in the middle of the sub-step.
    pub q: Vec<f64>,
    /// Velocities there.
    pub v: Vec<f64>,
    /// The share of its dry friction that acts on each drive, −1 to 1: the sign of the velocity where the drive slides.
    sign: Vec<f64>,
    /// Each of these torques stops a unit of velocity within a sub-step, N·m·s/rad (N·s/m): see the `stiction` file.
    stopping: Vec<f64>,
    /// The share of dry friction changes by this much for a unit of velocity, s/rad (s/m): `stopping` over the greatest dry friction.
    turning: Vec<f64>,
    /// Accelerations of the previous sub-step; for prescribed joints, those of the present one.
    pub a: Vec<f64>,
    /// Torques of friction and of the laws of effects on the drives, N·m (N); negative where they oppose a positive motion.
    pub loss: Vec<f64>,
    /// The position servos of all joints; empty if controllers command torques.
    pub servos: Vec<PositionServo>,
    /// Delivered torque of each drive in the previous sub-step minus its losses, N·m (N).
    pub load: Vec<f64>,
}

impl Drives {
    /// Drives with the nominal friction of `joints` alone.
    pub fn new(joints: &[Joint]) -> Self {
        let blank = vec![0.0; joints.len()];
        Self {
            friction: joints.iter().map(|joint| DriveFriction::nominal(joint.friction)).collect(),
            laws: Vec::new(),
            limit: vec![f64::INFINITY; joints.len()],
            plain: true,
            motors: vec![None; joints.len()],
            q: blank.clone(),
            v: blank.clone(),
            sign: blank.clone(),
            stopping: vec![f64::MAX; joints.len()],
            turning: vec![f64::MAX; joints.len()],
            a: blank.clone(),
            loss: blank.clone(),
            servos: Vec::new(),
            load: blank,
        }
    }

    /// Adds the laws of effects; the smallest of several limits of a joint applies.
    pub fn add(&mut self, laws: Vec<Box<dyn DriveLaw>>, saturations: &[(usize, f64)]) {
        self.laws.extend(laws);
        for &(joint, limit) in saturations {
            self.limit[joint] = self.limit[joint].min(limit);
        }
        self.plain &= self.laws.is_empty() && saturations.is_empty();
    }

    /// Decouples `motor` from the link of `joint`: a law of the transmission drives the link.
    pub fn decouple_motor(&mut self, joint: usize, motor: Motor) {
        self.motors[joint] = Some(motor);
        self.plain = false;
    }

    /// Lets `servos`, one per joint, command the torques of the drives.
    pub fn serve(&mut self, servos: Vec<PositionServo>) {
        self.servos = servos;
        self.plain &= self.servos.is_empty();
    }

    /// True if the drives have nothing but nominal friction: no laws of effects, torque limits, transmissions or servos.
    #[inline]
    pub fn has_only_nominal_friction(&self) -> bool {
        self.plain
    }

    /// Nominal friction puts this torque on `joint`, N·m (N). The joint has the velocity `v` in the middle of the sub-step, and would have `end` at its end if friction stayed as it was.
    #[inline]
    pub fn rub(&mut self, joint: usize, v: f64, end: f64) -> f64 {
        let sign = (self.sign[joint] + self.turning[joint] * end).clamp(-1.0, 1.0);
        self.sign[joint] = sign;
        self.loss[joint] = -self.friction[joint].resisting_towards(sign, v);
        self.loss[joint]
    }

    /// Has dry friction stop each drive with `stopping`, N·m·s/rad (N·s/m), and turn within its greatest dry friction `dry`, N·m (N).
    pub fn stop_with(&mut self, stopping: Vec<f64>, dry: &[f64]) {
        let share = |(stopping, dry): (&f64, &f64)| if *dry > 0.0 { stopping / dry } else { f64::MAX };
        self.turning = stopping.iter().zip(dry).map(share).collect();
        self.stopping = stopping;
    }

    /// The greatest dry friction of each drive at rest at `q` under the loads `load`, N·m (N): half of the change of its loss from one sign to the other. The
    /// caller restarts the laws afterwards, since some keep a state.
    pub fn dry_friction(&mut self, q: &[f64], load: &[f64]) -> Vec<f64> {
        let rest = vec![0.0; q.len()];
        let [forwards, backwards] = [1.0, -1.0].map(|direction| {
            let sign = vec![direction; q.len()];
            let now =
                DriveState { t: 0.0, step: 0.0, q, v: &rest, sign: &sign, stopping: &rest, a: &rest, load };
            let mut loss: Vec<f64> =
                self.friction.iter().map(|of| -of.resisting_towards(direction, 0.0)).collect();
            self.laws.iter_mut().for_each(|law| law.act(&now, &mut loss));
            loss
        });
        forwards.iter().zip(backwards).map(|(forwards, backwards)| 0.5 * (backwards - forwards)).collect()
    }

    /// Resets all state variables.
    pub fn restart(&mut self) {
        self.laws.iter_mut().for_each(|law| law.restart());
        self.load.fill(0.0);
        self.sign.fill(0.0);
        self.a.fill(0.0);
    }

    /// Saves all state variables of the drives to `archive`, or restores them from it.
    pub fn transfer_state(&mut self, archive: &mut Archive) {
        let Drives {
            friction: _,
            laws,
            limit: _,
            plain: _,
            motors,
            q: _,
            v: _,
            sign,
            stopping: _,
            turning: _,
            a,
            loss: _,
            servos,
            load,
        } = self;
        laws.iter_mut().for_each(|law| law.transfer_state(archive));
        for Motor { law: _, inertia: _, state, mean: _, carried: _, damped: _ } in motors.iter_mut().flatten()
        {
            archive.reals(state);
        }
        [sign, a, load].into_iter().for_each(|of_joints| archive.reals(of_joints));
        servos.iter_mut().for_each(|servo| servo.transfer_state(archive));
    }

    /// True if a transmission decouples any motor from its link.
    pub fn has_motors(&self) -> bool {
        self.motors.iter().any(Option::is_some)
    }

    /// Steps the servo of `joint` for a sub-step of `step` s around `t`, s, with the motor-side state of the joint.
    #[inline]
    pub fn act(&mut self, joint: usize, t: f64, step: f64) {
        if let Some(servo) = self.servos.get_mut(joint) {
            servo.act(t, step, [self.q[joint], self.v[joint]]);
        }
    }

    /// Torque of the motor of `joint`, N·m (N): that of its servo, or `torque` without one, clamped to its limit.
    #[inline]
    pub fn motor_torque(&self, joint: usize, torque: f64) -> f64 {
        self.saturated(joint, self.servos.get(joint).map_or(torque, PositionServo::torque))
    }

    /// Torque of a motor with the commanded `torque`, N·m (N).
    #[inline]
    pub fn saturated(&self, joint: usize, torque: f64) -> f64 {
        torque.clamp(-self.limit[joint], self.limit[joint])
    }

    /// Sets the state of the drive of `joint`: to the `prescribed` state, to that of its motor, or to `link`, the position and velocity of
    /// the joint itself in the middle of the sub-step.
    #[inline]
    pub fn place(&mut self, joint: usize, prescribed: Option<[f64; 3]>, link: [f64; 2], half: f64) {
        if let Some(state) = prescribed {
            [self.q[joint], self.v[joint], self.a[joint]] = state;
        } else {
            let own = self.motors[joint].as_ref().map_or(link, |motor| motor.middle(half));
            [self.q[joint], self.v[joint]] = own;
        }
    }

    /// Computes the losses of all drives at the time `t`, s, of a sub-step of `step` s.
    #[inline]
    pub fn compute_losses(&mut self, t: f64, step: f64) {
        for joint in 0..self.v.len() {
            let v = self.v[joint];
            self.rub(joint, v, v + 0.5 * step * self.a[joint]);
        }
        if self.laws.is_empty() {
            return;
        }
        let (q, v, sign, a, load) = (&self.q, &self.v, &self.sign, &self.a, &self.load);
        let now = DriveState { t, step, q, v, sign, stopping: &self.stopping, a, load };
        for law in &mut self.laws {
            law.act(&now, &mut self.loss);
        }
    }
}
