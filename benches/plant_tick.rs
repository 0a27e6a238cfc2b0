//! One tick of the plant in contact, and what recording it costs the loop. Goal: 60 us a tick of 50 sub-steps, 1 us to record.

mod common;

use std::sync::Arc;

use crossbeam::queue::ArrayQueue;
use freeplay_arm::paper_arm;
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{Applied, Input, MAX_PLAYS, NO_DIFFERENCES, PlayRecord, System, TickRecord};
use freeplay_shm::{Command, State};

fn main() {
    common::machine();
    let arm = paper_arm().arm;
    let path = JointPath::plan(&arm, &PathSpec { laps: 100, ..PathSpec::default() }, 1000.0)
        .expect("the smooth path");
    let clearance = Clearance::new(&ClearanceTable::new(0.6e-3)).expect("in range");
    for substeps in [50, 100] {
        for (name, driven) in [("driven", true), ("torque", false)] {
            let play = ArmWithPlay::new(&arm, &[(4, clearance)]).expect("an arm with play");
            let mut system = System::new(play, &arm, 1e-3, substeps).expect("a step that resolves contacts");
            let (mut q, mut v, mut a) = ([0.0; 6], [0.0; 6], [0.0; 6]);
            path.at(0.0, &mut q, &mut v, &mut a);
            system.start(&q, &v);
            let guided = Input { torque: &[0.0; 6], driven: &[true; 6], motion: &path };
            for _ in 0..1500 {
                system.tick(&guided).expect("finite");
            }
            assert!(system.bearings()[0].touching(), "the journal lies in its bearing");
            let torque: Vec<f64> = system.motor_torque().to_vec();
            let input = Input { torque: &torque, driven: &[driven; 6], motion: &path };
            let samples = if driven { 5000 } else { 500 };
            common::measure(
                &format!("tick, {substeps} sub-steps, {name}, in contact"),
                "(goal 60 at 50)",
                samples,
                1,
                || {
                    system.tick(&input).expect("finite");
                },
            );
        }
    }
    let state = State::new(1, 6);
    let record = TickRecord {
        state,
        command: Some(Command::answer_to(&state, 0)),
        applied: Applied::Command,
        rejection: None,
        deviation: [0.0; 3],
        tool: [0.0; 7],
        link: state.q,
        peak_base_force: 0.0,
        plays: [PlayRecord::default(); MAX_PLAYS],
        differences: NO_DIFFERENCES,
        marks: 0,
    };
    let queue = Arc::new(ArrayQueue::new(4096));
    println!("a record is {} bytes", std::mem::size_of::<TickRecord>());
    common::measure("recording one tick (push and pop)", "(goal 1)", 20_000, 20, || {
        queue.push(record).map_err(|_| "full").expect("room");
        queue.pop();
    });
}
