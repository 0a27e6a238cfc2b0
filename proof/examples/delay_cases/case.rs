//! Machines on servos with delayed commands or encoders, and their recordings of commands, positions and torques.

use std::path::Path;

use freeplay_model::ArmFile;
use freeplay_recording::Recording;
use freeplay_servo::{Commands, Course, Rollout, ServoArm, State};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::drawn::{JOINTS, link, servo};

/// Range of random delays, s: the catalogue permits encoder delays up to 15 ms.
const DELAYS: [f64; 2] = [0.004, 0.014];
/// Steps of the machine and of the recording, s.
const STEP: f64 = 0.001;
const ROW: usize = 5;
/// Rows of a recording.
const ROWS: usize = 5000;

/// The delayed part of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Late {
    /// The commands reach the servos late.
    Commands,
    /// The recording delays the encoders; the servos use them without delay.
    Encoders,
    /// No part.
    Nothing,
}

/// A machine and its recordings.
pub struct Case {
    pub arm: String,
    pub effects: String,
    pub late: Late,
    pub delay: f64,
    tick: f64,
    hold: usize,
    rng: ChaCha8Rng,
}

impl Case {
    pub fn drawn(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let late = [Late::Commands, Late::Encoders, Late::Commands, Late::Encoders, Late::Nothing]
            [rng.random_range(0..5)];
        let delay = if late == Late::Nothing { 0.0 } else { rng.random_range(DELAYS[0]..DELAYS[1]) };
        let mut arm = String::from("name = \"three links\"\n");
        let mut effects = String::new();
        for (joint, name) in JOINTS.iter().enumerate() {
            arm += &link(&mut rng, joint);
            let (table, stiffness) = servo(&mut rng, name);
            effects += &table;
            if late == Late::Commands {
                effects +=
                    &format!("[[effect]]\nkind = \"command_delay\"\njoint = \"{name}\"\ndelay = {delay}\n");
            }
            if rng.random_bool(0.7) {
                let coulomb = stiffness * rng.random_range(5e-3..4e-2);
                effects += &format!(
                    "[[effect]]\nkind = \"coulomb_friction\"\njoint = \"{name}\"\ncoulomb = {coulomb}\n"
                );
            }
        }
        let hold = [ROW, 4 * ROW][rng.random_range(0..2)];
        Self { arm, effects, late, delay, tick: 10.0_f64.powf(rng.random_range(-4.3..-3.0)), hold, rng }
    }

    /// The recording number `number`: 25 s at 200 Hz.
    pub fn recorded(&mut self, machine: &ArmFile, number: usize) -> Recording {
        let truth = ServoArm::of(machine).unwrap().unwrap();
        let fine: Vec<f64> = (0..ROWS * ROW).map(|step| step as f64 * STEP).collect();
        let wave = |t: f64, joint: usize| {
            let (phase, joint) = ([0.0, 1.3, 2.9][number] + joint as f64, joint as f64);
            0.3 * ((0.9 + 0.17 * joint) * t + phase).sin()
                + 0.2 * ((2.3 - 0.31 * joint) * t + 2.0 * phase).sin()
                + 0.06 * ((6.1 + 0.7 * joint) * t + 3.0 * phase).sin()
        };
        let held = |step: usize, joint: usize| wave((step / self.hold * self.hold) as f64 * STEP, joint);
        let commanded: Vec<Vec<f64>> =
            (0..3).map(|joint| (0..fine.len()).map(|step| held(step, joint)).collect()).collect();
        let commands: Vec<Commands> = commanded.iter().map(|column| Commands::new(&fine, column)).collect();
        let state = State { q: commanded.iter().map(|column| column[0]).collect(), v: vec![0.0; 3] };
        let mut out = vec![0.0; 3 * fine.len()];
        let course = Course { commands: &commands, stamps: &fine, loads: &[] };
        Rollout::new(&truth, STEP).run(&truth, course, &state, &mut out);
        let position = |step: usize, joint: usize| out[3 * step + joint];
        let late = if self.late == Late::Encoders { self.delay / STEP } else { 0.0 };
        let at = |step: usize, joint: usize| {
            let place = (step as f64 - late).max(0.0);
            let (before, share) = (place.floor() as usize, place.fract());
            position(before, joint) * (1.0 - share)
                + position((before + 1).min(fine.len() - 1), joint) * share
        };
        let torque = |step: usize, joint: usize| {
            let (before, after) = (step.saturating_sub(1), (step + 1).min(fine.len() - 1));
            let v = (position(after, joint) - position(before, joint)) / ((after - before) as f64 * STEP);
            let servo = &truth.joints[joint];
            let (from, to) = (fine[step] - 0.5 * STEP, fine[step] + 0.5 * STEP);
            let command =
                commands[joint].mean(&mut commands[joint].cursor(from - servo.delay), servo, from, to);
            servo.torque(command - position(step, joint), v)
        };
        let steps: Vec<usize> = (0..ROWS).map(|row| row * ROW).collect();
        let mut all = vec![("t".to_owned(), steps.iter().map(|step| fine[*step]).collect::<Vec<f64>>())];
        for (joint, commanded) in commanded.iter().enumerate() {
            let read = |step: &usize| (at(*step, joint) / self.tick).round() * self.tick;
            all.push((format!("q{}", joint + 1), steps.iter().map(read).collect()));
            all.push((format!("q_ref{}", joint + 1), steps.iter().map(|step| commanded[*step]).collect()));
            // A drive measures the mean current about the time of a row.
            let mean = |step: &usize| {
                let about = step.saturating_sub(ROW / 2)..(step + ROW / 2 + 1).min(fine.len());
                let count = about.len() as f64;
                about.map(|step| torque(step, joint)).sum::<f64>() / count
            };
            let torques: Vec<f64> = steps.iter().map(mean).collect();
            let size = (torques.iter().map(|x| x * x).sum::<f64>() / torques.len() as f64).sqrt();
            // Twelve uniform numbers minus six: close enough to a normal distribution here.
            let mut noise = || (0..12).map(|_| self.rng.random_range(0.0..1.0)).sum::<f64>() - 6.0;
            all.push((
                format!("tau{}", joint + 1),
                torques.iter().map(|x| x + 0.01 * size * noise()).collect(),
            ));
        }
        Recording::new(Path::new(&format!("{number}.csv")), all).unwrap()
    }
}
