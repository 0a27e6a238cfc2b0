//! The controller's rollout beside the plant: two simulations written apart, of one arm under one set of laws.

use freeplay_arm::paper_arm;
use freeplay_controller::{Driven, Motion, Rollout};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_path::JointPath;
use freeplay_plant::{Input, System};

const PERIOD: f64 = 1e-3;
const POSTURE: [f64; 6] = [0.1, 0.4, 0.3, 0.2, 0.9, -0.3];
const STILL: [f64; 6] = [0.0; 6];

fn with_play() -> ArmWithPlay {
    let clearance = Clearance::new(&ClearanceTable::new(6e-4)).expect("a clearance");
    ArmWithPlay::new(&paper_arm().arm, &[(4, clearance)]).expect("an arm with play")
}

/// A rollout and a plant with the joints at rest in the posture and the journal in the middle.
fn both(substeps: u32) -> (Rollout, System) {
    let (arm, play) = (paper_arm().arm, with_play());
    let mut rollout = Rollout::new(&play, PERIOD);
    let journal = Motion { q: &[0.0; 2], v: &[0.0; 2], a: &[0.0; 2] };
    rollout.start(Motion { q: &POSTURE, v: &STILL, a: &STILL }, journal);
    let mut system = System::new(play, &arm, PERIOD, substeps).expect("a system");
    system.start(&POSTURE, &STILL);
    (rollout, system)
}

/// Torques that hold the arm, and from tick 400 to 406 throw the wrist: the journal detaches, flies and lands.
fn torque(system: &System, tick: u64) -> [f64; 6] {
    let mut torque = [0.0; 6];
    let extended = system.play().arm();
    let mut workspace = freeplay_arm::Workspace::new(extended);
    let (mut q, mut all) = (vec![0.0; extended.dof()], vec![0.0; extended.dof()]);
    system.play().spread(&POSTURE, &mut q);
    freeplay_arm::gravity_torque(extended, &mut workspace, &q, &mut all);
    system.play().gather(&all, &mut torque);
    if (400..406).contains(&tick) {
        torque[1] += 1500.0;
        torque[2] += 500.0;
    } else if (406..412).contains(&tick) {
        torque[1] -= 1500.0;
        torque[2] -= 500.0;
    }
    torque
}

#[test]
fn the_journal_lands_and_bounces_as_in_the_plant() {
    let (mut rollout, mut system) = both(100);
    let path = JointPath::plan(&paper_arm().arm, &Default::default(), 1000.0).expect("a path");
    let slides = system.play().plays()[0].slides;
    let (mut apart, mut widest, mut landings) = (0.0_f64, 0.0_f64, Vec::new());
    for tick in 0..60_u64 {
        let torque = torque(&system, tick);
        let before =
            [rollout.touches()[0].landings, system.tallies().next().expect("a bearing").contacts as u32];
        rollout.tick(Driven::Torque(&torque));
        system.tick(&Input { torque: &torque, driven: &[false; 6], motion: &path }).expect("a finite motion");
        let after =
            [rollout.touches()[0].landings, system.tallies().next().expect("a bearing").contacts as u32];
        if before != after {
            landings.push((tick, after[0] - before[0], after[1] - before[1]));
        }
        for slide in slides {
            apart = apart.max((rollout.q()[slide] - system.q()[slide]).abs());
            widest = widest.max(system.q()[slide].abs());
        }
    }
    println!(
        "landings (tick, rollout, plant): {landings:?}; journal up to {widest:.2e} m, apart {apart:.1e} m (limit 3e-5)"
    );
    assert!(landings.len() >= 3 && widest > 5e-4, "a journal that never lands tests nothing");
    assert!(landings.iter().all(|(_, rollout, plant)| rollout == plant) && apart < 3e-5);
}

#[test]
fn it_predicts_that_a_journal_detaches_and_when_it_lands() {
    let (mut rollout, mut system) = both(100);
    let path = JointPath::plan(&paper_arm().arm, &Default::default(), 1000.0).expect("a path");
    let play = system.play().clone();
    for tick in 0..400 {
        system
            .tick(&Input { torque: &torque(&system, tick), driven: &[false; 6], motion: &path })
            .expect("finite");
    }
    let (mut q, mut v) = (vec![0.0; 6], vec![0.0; 6]);
    play.gather(system.q(), &mut q);
    play.gather(system.v(), &mut v);
    let slides = play.plays()[0].slides;
    let [offset, speed] = [system.q(), system.v()].map(|of| slides.map(|slide| of[slide]));
    rollout.start(Motion { q: &q, v: &v, a: &STILL }, Motion { q: &offset, v: &speed, a: &[0.0; 2] });
    let mut flights = [Vec::new(), Vec::new()];
    let (mut apart, mut moved) = (0.0_f64, 0.0_f64);
    for tick in 400..440 {
        let torque = torque(&system, tick);
        rollout.tick(Driven::Torque(&torque));
        system.tick(&Input { torque: &torque, driven: &[false; 6], motion: &path }).expect("finite");
        let flying = [!rollout.touches()[0].touching, !system.bearings()[0].touching()];
        flights.iter_mut().zip(flying).for_each(|(flights, flies)| flights.extend(flies.then_some(tick)));
        for (slide, before) in slides.into_iter().zip(offset) {
            apart = apart.max((rollout.q()[slide] - system.q()[slide]).abs());
            moved = moved.max((system.q()[slide] - before).abs());
        }
    }
    println!(
        "in flight at the ticks {:?} (rollout), {:?} (plant); moved {moved:.1e} m, apart {apart:.1e} m",
        flights[0], flights[1]
    );
    assert!(!flights[1].is_empty() && moved > 1e-4, "a journal that stays tests nothing");
    assert_eq!(flights[0].first(), flights[1].first(), "detachment");
    assert!(flights[0].len().abs_diff(flights[1].len()) <= 2, "flight");
}
