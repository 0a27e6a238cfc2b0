//! Simulates an arm on servos along generated commands, to measure the processor time of a rollout: `rollout_speed.py` beside it measures
//! the time, and that of MuJoCo's steps of the same arm.
//!
//! `rollout_speed ARM COMMANDS COUNT STEP`: `COMMANDS` is a CSV of stamps and one command per joint. The example simulates the motion along
//! them `COUNT` times in steps of at most `STEP` s, and prints its positions, one line per stamp.
#![allow(clippy::unwrap_used, reason = "an example ends at the first surprise")]

use freeplay_servo::{Commands, Course, Rollout, ServoArm, State};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let model = ServoArm::of(&freeplay_model::load(arguments[0].as_ref()).unwrap()).unwrap().unwrap();
    let text = std::fs::read_to_string(&arguments[1]).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    let column = |index: usize| rows.iter().map(|row| row[index]).collect::<Vec<f64>>();
    let (stamps, joints) = (column(0), model.joints.len());
    let commanded: Vec<Vec<f64>> = (1..=joints).map(column).collect();
    let commands: Vec<Commands> = commanded.iter().map(|column| Commands::new(&stamps, column)).collect();
    let start = State { q: commanded.iter().map(|column| column[0]).collect(), v: vec![0.0; joints] };
    let (count, step): (usize, f64) = (arguments[2].parse().unwrap(), arguments[3].parse().unwrap());
    let mut rollout = Rollout::new(&model, step);
    let mut out = vec![0.0; stamps.len() * joints];
    let course = Course { commands: &commands, stamps: &stamps, loads: &[] };
    for _ in 0..count {
        rollout.run(&model, course, &start, &mut out);
    }
    for row in out.chunks(joints) {
        println!("{}", row.iter().map(f64::to_string).collect::<Vec<String>>().join(","));
    }
}
