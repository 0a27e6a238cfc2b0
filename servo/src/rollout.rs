//! The motion of an arm on position servos, integrated from its commands.

use freeplay_arm::{Workspace, mass_and_bias};
use nalgebra::DMatrix;

use crate::command::Commands;
use crate::joint::Linearization;
use crate::joint_load::Load;
use crate::servo_arm::ServoArm;
use crate::solve::Sliding;

/// Longest step of the servos, s: the usual step of a controller.
const SERVO_STEP: f64 = 0.001;

/// The inputs of a rollout.
#[derive(Clone, Copy, Debug)]
pub struct Course<'a> {
    /// Commands, one per joint.
    pub commands: &'a [Commands],
    /// Output times of the position, s, increasing.
    pub stamps: &'a [f64],
    /// The load of the only joint at each stamp; empty if the arm computes the loads.
    pub loads: &'a [Load],
}

/// Position and velocity of all joints.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// rad (m).
    pub q: Vec<f64>,
    /// rad/s (m/s).
    pub v: Vec<f64>,
}

/// The workspace of a rollout, allocated once for an arm.
#[derive(Clone, Debug)]
pub struct Rollout {
    workspace: Workspace,
    mass: DMatrix<f64>,
    state: State,
    middle: Vec<f64>,
    bias: Vec<f64>,
    sliding: Sliding,
    pieces: Vec<Linearization>,
    right: Vec<f64>,
    friction: Vec<f64>,
    bounds: Vec<[f64; 2]>,
    speed: Vec<f64>,
    set_point: Vec<f64>,
    cursors: Vec<usize>,
    longest_step: f64,
}

impl Rollout {
    /// A rollout of models with as many joints as `model`, in steps of at most `longest_step` s.
    pub fn new(model: &ServoArm, longest_step: f64) -> Rollout {
        let n = model.joints.len();
        Rollout {
            workspace: Workspace::new(&model.arm),
            mass: DMatrix::zeros(n, n),
            state: State { q: vec![0.0; n], v: vec![0.0; n] },
            middle: vec![0.0; n],
            bias: vec![0.0; n],
            sliding: Sliding::new(n),
            pieces: vec![Linearization::UNSET; n],
            right: vec![0.0; n],
            friction: vec![0.0; n],
            bounds: vec![[0.0; 2]; n],
            speed: vec![0.0; n],
            set_point: vec![0.0; n],
            cursors: vec![0; n],
            longest_step,
        }
    }

    /// Integrates `model` from `start` along `course` and writes the position at each of its stamps into `out`, `[stamp][joint]`; the first
    /// row is the start.
    ///
    /// # Panics
    /// If the sizes do not fit the model.
    pub fn run(&mut self, model: &ServoArm, course: Course, start: &State, out: &mut [f64]) {
        // The compiler specialises the loops over joints for each of the usual numbers of joints.
        match model.joints.len() {
            1 => self.integrate(1, model, course, start, out),
            2 => self.integrate(2, model, course, start, out),
            3 => self.integrate(3, model, course, start, out),
            4 => self.integrate(4, model, course, start, out),
            5 => self.integrate(5, model, course, start, out),
            6 => self.integrate(6, model, course, start, out),
            7 => self.integrate(7, model, course, start, out),
            n => self.integrate(n, model, course, start, out),
        }
    }

    /// [`Rollout::run`] for `n` joints.
    #[inline(always)]
    fn integrate(&mut self, n: usize, model: &ServoArm, course: Course, start: &State, out: &mut [f64]) {
        let Course { commands, stamps, loads } = course;
        self.state.q.copy_from_slice(&start.q);
        self.state.v.copy_from_slice(&start.v);
        self.speed.copy_from_slice(&start.v);
        self.bias.fill(0.0);
        for (i, (commands, joint)) in commands.iter().zip(&model.joints).enumerate() {
            self.cursors[i] = commands.cursor(stamps[0] - joint.delay);
            self.set_point[i] = commands.at(joint, stamps[0]);
        }
        out[..n].copy_from_slice(&self.state.q);
        for (row, pair) in stamps.windows(2).enumerate() {
            let steps = ((pair[1] - pair[0]) / self.longest_step - 1e-6).ceil().max(1.0);
            let h = (pair[1] - pair[0]) / steps;
            for step in 0..steps as usize {
                let t = pair[0] + step as f64 * h;
                match loads.get(row..row + 2) {
                    Some(loads) => self.take(loads[0].between(loads[1], (step as f64 + 0.5) / steps)),
                    None => self.take_arm(n, model, h),
                }
                self.step(n, model, commands, t, h);
            }
            out[(row + 1) * n..(row + 2) * n].copy_from_slice(&self.state.q);
        }
    }

    /// The state at the end of `course`, from `start` at its beginning; see [`Rollout::run`].
    ///
    /// # Panics
    /// If the sizes do not fit the model.
    pub fn after(&mut self, model: &ServoArm, course: Course, start: &State) -> State {
        let mut out = vec![0.0; course.stamps.len() * model.joints.len()];
        self.run(model, course, start, &mut out);
        self.state.clone()
    }

    /// Sets `load` for a step of the only joint.
    #[inline(always)]
    fn take(&mut self, load: Load) {
        self.mass[(0, 0)] = load.inertia;
        self.bias[0] = load.torque;
    }

    /// Sets the arm's terms for a step of `h`, s, at the predicted middle of the step. Each link lies on the flank of its gear to which its
    /// load pressed it in the previous step.
    #[inline(always)]
    fn take_arm(&mut self, n: usize, model: &ServoArm, h: f64) {
        for i in 0..n {
            let play = 0.5 * model.gaps[i] * self.bias[i].signum();
            self.middle[i] = self.state.q[i] + 0.5 * h * self.state.v[i] - play;
        }
        mass_and_bias(
            &model.arm,
            &mut self.workspace,
            &self.middle,
            &self.state.v,
            &mut self.mass,
            &mut self.bias,
        );
    }

    /// One step of `h` from `t`, s: the arm's terms stay constant, and the servos take smaller steps of their own.
    #[inline(always)]
    fn step(&mut self, n: usize, model: &ServoArm, commands: &[Commands], t: f64, h: f64) {
        let steps = (h / SERVO_STEP - 1e-6).ceil().max(1.0);
        let own = h / steps;
        for (i, joint) in model.joints.iter().enumerate() {
            self.mass[(i, i)] += joint.rotor_inertia;
        }
        self.mass *= 2.0 / own;
        self.pieces.fill(Linearization::UNSET);
        for step in 0..steps as usize {
            self.servo_step(n, model, commands, t + step as f64 * own, own);
        }
    }

    /// One step of `h` from `t`, s, of the servos alone: implicit midpoint rule for their law and friction. `mass` has the unit of a
    /// damping: inertia over half of the step.
    #[inline(always)]
    fn servo_step(&mut self, n: usize, model: &ServoArm, commands: &[Commands], t: f64, h: f64) {
        let (joints, commands, cursors) = (&model.joints[..n], &commands[..n], &mut self.cursors[..n]);
        let (q, v, speed) = (&mut self.state.q[..n], &mut self.state.v[..n], &mut self.speed[..n]);
        let (set_point, pieces, mass) =
            (&mut self.set_point[..n], &mut self.pieces[..n], &self.mass.as_slice()[..n * n]);
        let (right, friction, bounds, bias) =
            (&mut self.right[..n], &mut self.friction[..n], &mut self.bounds[..n], &self.bias[..n]);
        let mut is_same = true;
        for i in 0..n {
            let joint = &joints[i];
            let wished = commands[i].mean(&mut cursors[i], joint, t, t + h);
            let most = joint.speed_limit * h;
            set_point[i] += (wished - set_point[i]).clamp(-most, most);
            let error = set_point[i] - q[i];
            let piece = joint.linearized(error - 0.5 * h * v[i], v[i]);
            is_same &= piece.damping == pieces[i].damping && piece.stiffness == pieces[i].stiffness;
            pieces[i] = piece;
            // Columns equal rows, since the matrix is symmetric.
            let row = &mass[i * n..(i + 1) * n];
            let momentum: f64 = row.iter().zip(&*v).map(|(m, v)| m * v).sum();
            right[i] = momentum + piece.stiffness * error + piece.constant - bias[i];
            friction[i] = joint.dry_friction(speed[i]);
            let bound = |stop: f64| if stop.is_finite() { (stop - q[i]) / h } else { stop };
            bounds[i] = joint.stops.map(bound);
        }
        if !is_same {
            let matrix = &mut self.sliding.matrix_mut()[..n * n];
            matrix.copy_from_slice(mass);
            for (i, piece) in pieces.iter().enumerate() {
                matrix[i * n + i] += piece.damping + piece.stiffness * 0.5 * h;
            }
        }
        self.sliding.solve(right, friction, bounds, speed);
        for i in 0..n {
            q[i] += h * speed[i];
            // A joint at rest at the middle of the step is at rest at its end.
            v[i] = if speed[i] == 0.0 { 0.0 } else { 2.0 * speed[i] - v[i] };
        }
    }
}
