//! The drives of all joints: what they lose, where they saturate, and the motors that a transmission parts from their links.
//!
//! A motor of inertia J obeys J θ̈ = τ_m + τ_l − τ with the motor's torque τ_m, the (negative) losses τ_l and the torque τ that the
//! transmission carries to the link. It is stepped like the arm: drift, kick, drift.

use freeplay_arm::Joint;
use freeplay_laws::{Archive, DriveFriction, DriveLaw, DriveState, Transmission};

use crate::position_servo::PositionServo;

/// How far a joint on a position servo gives before it slides, rad (m): below what any encoder of a servo reads. A servo holds a pose for minutes, in which
/// friction with a smoothed sign would creep by more than it lags. The sign is that of an elastic joint that slides at its limit
/// (Prandtl 1928, Z. angew. Math. Mech. 8:85).
const PRESLIDING: f64 = 1e-5;

/// A motor behind a transmission.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    /// What stands between it and the link.
    pub law: Transmission,
    /// Inertia J of the rotor as the joint feels it, kg·m² (kg).
    pub inertia: f64,
    /// Position θ, velocity and acceleration.
    pub state: [f64; 3],
    /// Mean velocity of the last sub-step.
    pub mean: f64,
    /// Torque τ that the transmission carried in the last sub-step, N·m (N).
    pub carried: f64,
    /// Part of it that its damping made.
    pub damped: f64,
}

impl Motor {
    pub fn new(law: Transmission, inertia: f64) -> Self {
        Self { law, inertia, state: [0.0; 3], mean: 0.0, carried: 0.0, damped: 0.0 }
    }

    /// Position and velocity in the middle of a sub-step of twice `half` s.
    #[inline]
    fn middle(&self, half: f64) -> [f64; 2] {
        let [q, v, a] = self.state;
        [q + half * v, v + half * a]
    }

    /// Works out what the transmission carries from the motor at `motor` to the link at `link`, both position and velocity.
    #[inline]
    pub fn carry(&mut self, motor: [f64; 2], link: [f64; 2]) -> f64 {
        let (twist, rate) = (motor[0] - link[0], motor[1] - link[1]);
        self.carried = self.law.torque(twist, rate);
        self.damped = self.carried - self.law.stiffness * self.law.wound(twist);
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

/// The drives of all nominal joints; every list has one entry a joint.
#[derive(Debug)]
pub(crate) struct Drives {
    friction: Vec<DriveFriction>,
    laws: Vec<Box<dyn DriveLaw>>,
    limit: Vec<f64>,
    /// Whether there is nothing but nominal friction.
    plain: bool,
    /// The motors that are parted from their links.
    pub motors: Vec<Option<Motor>>,
    /// Motor-side positions in the middle of the sub-step.
    pub q: Vec<f64>,
    /// Velocities there.
    pub v: Vec<f64>,
    /// Signs of these velocities, as dry friction has them.
    sign: Vec<f64>,
    /// Accelerations of the sub-step before; of prescribed joints, those of this one.
    pub a: Vec<f64>,
    /// What friction and the laws of effects put on the drives, N·m (N); negative where it opposes a positive motion.
    pub loss: Vec<f64>,
    /// The position servos of all joints, or none: then torques are asked of the drives.
    pub servos: Vec<PositionServo>,
    /// What each drive delivered in the sub-step before, beyond what it lost, N·m (N).
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
            a: blank.clone(),
            loss: blank.clone(),
            servos: Vec::new(),
            load: blank,
        }
    }

    /// Adds the laws of effects; of several limits of a joint the least holds.
    pub fn add(&mut self, laws: Vec<Box<dyn DriveLaw>>, saturations: &[(usize, f64)]) {
        self.laws.extend(laws);
        for &(joint, limit) in saturations {
            self.limit[joint] = self.limit[joint].min(limit);
        }
        self.plain &= self.laws.is_empty() && saturations.is_empty();
    }

    /// Parts the motor of `joint` from its link.
    pub fn part(&mut self, joint: usize, motor: Motor) {
        self.motors[joint] = Some(motor);
        self.plain = false;
    }

    /// Has `servos`, one a joint, ask torques of the drives.
    pub fn serve(&mut self, servos: Vec<PositionServo>) {
        self.servos = servos;
        self.plain &= self.servos.is_empty();
    }

    /// Whether there is nothing but nominal friction.
    #[inline]
    pub fn plain(&self) -> bool {
        self.plain
    }

    /// The nominal friction of each drive, and where its loss is kept.
    #[inline]
    pub fn nominal(&mut self) -> impl Iterator<Item = (&DriveFriction, &mut f64)> {
        self.friction.iter().zip(&mut self.loss)
    }

    /// Forgets all that was.
    pub fn restart(&mut self) {
        self.laws.iter_mut().for_each(|law| law.restart());
        self.load.fill(0.0);
        self.sign.fill(0.0);
        self.a.fill(0.0);
    }

    /// Transfers all state variables of the drives.
    pub fn transfer(&mut self, archive: &mut Archive) {
        let Drives {
            friction: _,
            laws,
            limit: _,
            plain: _,
            motors,
            q: _,
            v: _,
            sign,
            a,
            loss: _,
            servos,
            load,
        } = self;
        laws.iter_mut().for_each(|law| law.transfer(archive));
        for Motor { law: _, inertia: _, state, mean: _, carried: _, damped: _ } in motors.iter_mut().flatten()
        {
            archive.reals(state);
        }
        [sign, a, load].into_iter().for_each(|of_joints| archive.reals(of_joints));
        servos.iter_mut().for_each(|servo| servo.transfer(archive));
    }

    /// Whether any motor is parted from its link.
    pub fn has_motors(&self) -> bool {
        self.motors.iter().any(Option::is_some)
    }

    /// Has the servo of `joint` act in a sub-step of `step` s around `t`, s, on the joint at its motor.
    #[inline]
    pub fn act(&mut self, joint: usize, t: f64, step: f64) {
        if let Some(servo) = self.servos.get_mut(joint) {
            servo.act(t, step, [self.q[joint], self.v[joint]]);
        }
    }

    /// What the motor of `joint` gives, N·m (N): what its servo asks for, or without one `torque`, within its limit.
    #[inline]
    pub fn given(&self, joint: usize, torque: f64) -> f64 {
        self.saturated(joint, self.servos.get(joint).map_or(torque, PositionServo::torque))
    }

    /// What a motor asked for `torque` gives, N·m (N).
    #[inline]
    pub fn saturated(&self, joint: usize, torque: f64) -> f64 {
        torque.clamp(-self.limit[joint], self.limit[joint])
    }

    /// Puts the drive of `joint` at what is prescribed to it, at its motor, or at the joint itself, whose position and velocity
    /// in the middle of the sub-step is `link`.
    #[inline]
    pub fn place(&mut self, joint: usize, prescribed: Option<[f64; 3]>, link: [f64; 2], half: f64) {
        if let Some(state) = prescribed {
            [self.q[joint], self.v[joint], self.a[joint]] = state;
        } else {
            let own = self.motors[joint].as_ref().map_or(link, |motor| motor.middle(half));
            [self.q[joint], self.v[joint]] = own;
        }
    }

    /// Works out the losses of all drives at the time `t`, s, of a sub-step of `step` s.
    #[inline]
    pub fn lose(&mut self, t: f64, step: f64) {
        let sticks = !self.servos.is_empty();
        for ((sign, friction), &v) in self.sign.iter_mut().zip(&self.friction).zip(&self.v) {
            if sticks {
                *sign = (*sign + v * step / PRESLIDING).clamp(-1.0, 1.0);
            } else if friction.coulomb != 0.0 || !self.laws.is_empty() {
                *sign = DriveFriction::sign(v);
            }
        }
        let drives = self.loss.iter_mut().zip(&self.friction).zip(self.v.iter().zip(&self.sign));
        for ((loss, friction), (v, sign)) in drives {
            *loss = -(friction.viscous * v + friction.coulomb * sign);
        }
        if self.laws.is_empty() {
            return;
        }
        let (q, v, sign, a, load) = (&self.q, &self.v, &self.sign, &self.a, &self.load);
        let now = DriveState { t, step, q, v, sign, a, load };
        for law in &mut self.laws {
            law.act(&now, &mut self.loss);
        }
    }
}
