//! Time of one tick of the plant in contact, of the monitoring and the checks of its command, and of the recording in the loop. Goal: 60 us a
//! tick of 50 sub-steps, 1 us to record.

mod common;

use std::sync::Arc;

use crossbeam::queue::ArrayQueue;
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{
    Applied, Braking, Gate, GateLimits, Input, MAX_PLAYS, NO_DIFFERENCES, PlayRecord, ReflexLimits,
    ReflexSpec, Reflexes, System, TickRecord,
};
use freeplay_shm::{Command, Mode, State};

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
    safety();
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

/// Time of the gate and the reflexes in a tick, and of the monitoring of the drives in its 50 sub-steps.
fn safety() {
    let arm = paper_arm().arm;
    let limits = ReflexLimits::of(&arm, &ReflexSpec::default(), 50.0, 1e-3, &[vec![0.0; 6]]);
    let of = GateLimits::of(&arm, Mode::Torque, 1e-3, 20, &limits.torque_rate);
    let (mut gate, mut tick) = (Gate::new(of, 1, 0, 6), 0);
    common::measure("the gate, one command", "", 20_000, 100, || {
        let state = State { tick, ..State::new(1, 6) };
        assert_eq!(gate.pass(Some(&Command::answer_to(&state, 0)), tick).1, None);
        tick += 1;
    });
    let mut reflexes = Reflexes::new(limits.clone(), 1e-3);
    let joints = [[0.1, 0.2, 0.3]; 6];
    common::measure("the reflexes, one tick", "", 20_000, 100, || {
        assert_eq!(reflexes.watch(&joints, &[0.1; 6]), None);
    });
    let mut brakes = Braking::new(vec![10.0; 6]);
    let still = freeplay_plant::Hermite::new(6);
    for is_watched in [false, true] {
        let play = ArmWithPlay::new(&arm, &[]).expect("an arm");
        let mut system = System::new(play, &arm, 1e-3, 50).expect("a step");
        system.start(&[0.0, 0.3, 0.3, 0.0, 0.3, 0.0], &[0.0; 6]);
        let mut torque = [0.0; 6];
        freeplay_arm::rnea(
            &arm,
            &mut freeplay_arm::Workspace::new(&arm),
            &[0.0, 0.3, 0.3, 0.0, 0.3, 0.0],
            &[0.0; 6],
            &[0.0; 6],
            &mut torque,
        );
        let input = Input { torque: &torque, driven: &[false; 6], motion: &still };
        let name = if is_watched { "watched" } else { "not watched" };
        common::measure(&format!("tick, 50 sub-steps, no play, {name}"), "", 1000, 1, || {
            if is_watched {
                assert_eq!(system.watched_tick(&input, &limits, &mut brakes).expect("finite"), None);
            } else {
                system.tick(&input).expect("finite");
            }
        });
    }
}
