//! A controller that tries to break the arm: computed torque at first, then a strategy with random values from a seed.

use freeplay_arm::Limits;
use freeplay_model::paper_arm;
use freeplay_shm::{Command, MAX_JOINTS, Mode, State};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Length of a tick for the steps, s.
const PERIOD: f64 = 1e-3;
/// Joints of the paper's arm.
const JOINTS: usize = 6;

/// The strategies.
pub const STRATEGIES: [&str; 7] = ["ride", "push", "shake", "leap", "replay", "future", "lies"];

/// One hostile controller.
pub struct Hostile {
    strategy: String,
    random: ChaCha8Rng,
    limits: Vec<Limits>,
    /// Share of a limit used in a tick, by joint.
    share: [f64; JOINTS],
    /// Direction of motion of each joint.
    direction: [f64; JOINTS],
    /// Ticks after which directions change.
    turn: u64,
    sent: Vec<Command>,
}

impl Hostile {
    /// A controller with `strategy`, drawn from `seed`; `None` if there is no such strategy.
    pub fn new(strategy: &str, seed: u64) -> Option<Self> {
        let strategy = STRATEGIES.iter().find(|known| **known == strategy)?;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // From steps that pass any gate to the whole limit at once.
        let share = std::array::from_fn(|_| 10.0_f64.powf(random.random_range(-4.0..0.0)));
        let direction = std::array::from_fn(|_| if random.random_bool(0.5) { 1.0 } else { -1.0 });
        Some(Self {
            strategy: (*strategy).to_owned(),
            limits: paper_arm().arm.joints().iter().map(|joint| joint.limits).collect(),
            share,
            direction,
            turn: random.random_range(5..400),
            sent: Vec::new(),
            random,
        })
    }

    /// Replaces the sound answer `command` to `state` by a hostile one; returns a message to be sent before it, if any.
    pub fn spoil(&mut self, state: &State, command: &mut Command) -> Option<Command> {
        let sound = *command;
        if state.tick.is_multiple_of(self.turn) {
            self.direction.iter_mut().for_each(|direction| *direction = -*direction);
        }
        let is_driven = state.mode == Mode::Driven.code();
        match self.strategy.as_str() {
            "replay" => self.replay(command),
            "future" => command.tick += self.random.random_range(1..1000),
            "lies" => self.lie(command),
            _ if is_driven => self.drive(state, command),
            _ => self.push(state, command),
        }
        let is_replay = self.strategy == "replay" && !self.sent.is_empty() && self.random.random_bool(0.5);
        let old = is_replay.then(|| self.sent[self.random.random_range(0..self.sent.len())]);
        self.sent.push(if self.strategy == "replay" { sound } else { *command });
        old
    }

    /// Torques: `ride` goes to the limits step by step, `push` always acts with the motion, `shake` jumps from limit to limit, `leap` goes to a limit at once.
    fn push(&mut self, state: &State, command: &mut Command) {
        let before = self.sent.last().map_or(command.value, |last| last.value);
        for (joint, before) in before.into_iter().enumerate().take(JOINTS) {
            let effort = self.limits[joint].effort;
            let target = effort
                * match self.strategy.as_str() {
                    "push" => 1.0_f64.copysign(state.qd[joint]),
                    "shake" if state.tick.is_multiple_of(2) => -self.direction[joint],
                    _ => self.direction[joint],
                };
            let step = if self.strategy == "leap" { 2.0 } else { self.share[joint] } * effort;
            command.value[joint] = target.clamp(before - step, before + step);
        }
    }

    /// Positions: `ride` moves at the speed limit, `push` too but claims zero velocity, `shake` reverses each tick, `leap` jumps at once.
    fn drive(&mut self, state: &State, command: &mut Command) {
        for joint in 0..JOINTS {
            let limits = &self.limits[joint];
            let from = self.sent.last().map_or(state.q[joint], |last| last.value[joint]);
            let speed = self.sent.last().map_or(state.qd[joint], |last| last.velocity[joint]);
            let turn = if self.strategy == "shake" && state.tick.is_multiple_of(2) { -1.0 } else { 1.0 };
            let towards = turn * self.direction[joint];
            // No faster than the acceleration limit allows, so that the gate may pass it.
            let change = limits.acceleration * PERIOD * self.share[joint].sqrt();
            let speed = (speed + towards * change).clamp(-limits.velocity, limits.velocity);
            let step = match self.strategy.as_str() {
                "leap" => towards * self.share[joint],
                "push" => towards * limits.velocity * PERIOD,
                _ => speed * PERIOD,
            };
            command.value[joint] = from + step;
            command.velocity[joint] = if self.strategy == "push" { 0.0 } else { speed };
            command.acceleration[joint] = 0.0;
        }
    }

    /// Sends an old command as a new one.
    fn replay(&mut self, command: &mut Command) {
        if !self.sent.is_empty() && self.random.random_bool(0.9) {
            let old = self.sent[self.random.random_range(0..self.sent.len())];
            *command = Command { tick: command.tick, ..old };
        }
    }

    /// Fills one or several fields with random bits, or with extreme values.
    fn lie(&mut self, command: &mut Command) {
        let random = &mut self.random;
        for _ in 0..random.random_range(1..3) {
            let joint = random.random_range(0..MAX_JOINTS);
            let wild = match random.random_range(0..4) {
                0 => f64::from_bits(random.random()),
                1 => f64::NAN,
                2 => f64::INFINITY,
                _ => random.random_range(-1e6..1e6),
            };
            let word: u64 = if random.random_bool(0.3) { u64::MAX } else { random.random() };
            match random.random_range(0..18) {
                0 => command.magic = word,
                1 => command.layout = word as u32,
                2 => command.joints = word as u32 % 20,
                3 => command.run = word,
                4 => command.tick = word,
                5 => command.slot = word as u32,
                6 => command.status = word as u32,
                7 => command.received_ns = word,
                8 => command.predict_ns = word,
                9 => command.qp_ns = word,
                10 => command.sent_ns = word,
                11 => command.qp_iterations = word as u32,
                12 => command.kind = word as u32,
                13 => command.velocity[joint] = wild,
                14 => command.acceleration[joint] = wild,
                15 => command.deviation[joint % 3] = wild,
                _ => command.value[joint] = wild,
            }
        }
    }
}
