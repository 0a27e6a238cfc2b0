//! Tests of passages through corners: the law of contact, the limits, and the gain in accuracy.

use crate::simulation::{model_file, run};
use freeplay_arm::{Workspace, rnea};
use freeplay_controller::displacement_preview::DisplacementPreview;
use freeplay_controller::{CornerSearch, Passage, PassageOptions, Passages, Step, Task, Weights, built_in};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathKind};
use freeplay_shm::CommandStatus;

const PERIOD: f64 = 1e-3;

fn with_play(plays: &[(usize, f64)]) -> ArmWithPlay {
    let clearances: Vec<_> =
        plays.iter().map(|&(joint, c)| (joint, Clearance::new(&ClearanceTable::new(c)).unwrap())).collect();
    ArmWithPlay::new(&paper_arm().arm, &clearances).unwrap()
}

fn path(kind: PathKind, period: f64) -> JointPath {
    let mut task = Task::default();
    (task.path.kind, task.path.period) = (kind, period);
    JointPath::plan(&paper_arm().arm, &task.path, 1000.0).unwrap()
}

fn passages(kind: PathKind, period: f64, plays: &[(usize, f64)], from: u64, to: u64) -> Passages {
    passages_on(path(kind, period), plays, from, to)
}

fn passages_on(path: JointPath, plays: &[(usize, f64)], from: u64, to: u64) -> Passages {
    let (arm, play) = (paper_arm().arm, with_play(plays));
    let mut outlook = DisplacementPreview::new(path, &play, PERIOD, 10);
    let search = CornerSearch {
        arm: &arm,
        with_play: &play,
        period: PERIOD,
        weights: Weights::default(),
        options: PassageOptions::default(),
    };
    search.passages(&mut outlook, from, to)
}

/// Positions, velocities and accelerations of the arm with play at the tick `tick` of `passage` along `path`, by finite
/// differences.
fn motion(play: &ArmWithPlay, path: &JointPath, passage: &Passage, tick: u64) -> [Vec<f64>; 3] {
    let m = play.arm().dof();
    let slides: Vec<usize> = play.plays().iter().flat_map(|play| play.slides).collect();
    let at = |tick: u64| {
        let (mut q, mut v, mut a) = (vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]);
        path.at(tick as f64 * PERIOD, &mut q, &mut v, &mut a);
        let Step { corrections, journals, .. } = passage.at(tick).unwrap();
        q.iter_mut().zip(corrections).for_each(|(q, correction)| *q += correction);
        let mut extended = vec![0.0; m];
        play.spread(&q, &mut extended);
        slides.iter().zip(journals).for_each(|(&slide, &journal)| extended[slide] = journal);
        extended
    };
    let [before, now, after] = [at(tick - 1), at(tick), at(tick + 1)];
    let v = before.iter().zip(&after).map(|(before, after)| (after - before) / (2.0 * PERIOD)).collect();
    let a = (0..m).map(|i| (after[i] - 2.0 * now[i] + before[i]) / (PERIOD * PERIOD)).collect();
    [now, v, a]
}

#[test]
fn on_a_passage_the_bearing_only_pushes_along_its_normal_and_the_limits_hold() {
    let play = with_play(&[(4, 6e-4)]);
    let path = path(PathKind::SquareSharp, 6.0);
    let passages = passages(PathKind::SquareSharp, 6.0, &[(4, 6e-4)], 1300, 1700);
    let [passage] = passages.planned() else { panic!("one corner: {passages:?}") };
    let mut workspace = Workspace::new(play.arm());
    let mut force = vec![0.0; 8];
    let (mut sideways, mut least, mut turned, mut turn_before) = (0.0_f64, f64::INFINITY, 0.0_f64, None);
    let (mut used, mut rubbed) = ([0.0_f64; 3], [0.0_f64; 2]);
    for tick in passage.first() + 1..passage.first() + passage.ticks() as u64 - 1 {
        let [q, v, a] = motion(&play, &path, passage, tick);
        rnea(play.arm(), &mut workspace, &q, &v, &a, &mut force);
        let slides = play.plays()[0].slides;
        let radius = q[slides[0]].hypot(q[slides[1]]);
        let n = slides.map(|slide| q[slide] / radius);
        let b = slides.map(|slide| force[slide]);
        let push = -(n[0] * b[0] + n[1] * b[1]);
        least = least.min(push);
        sideways = sideways.max((n[1] * b[0] - n[0] * b[1]).abs() / push);
        // Friction of mu = 0.01 at a journal of 9.4 mm.
        let rubbing = passage.at(tick).unwrap().moments[0] / (0.01 * 0.0094 * push);
        assert!(rubbing.abs() < 1.0 + 1e-3, "the bearing rubs with {rubbing} of what it can");
        rubbed = [rubbed[0].min(rubbing), rubbed[1].max(rubbing)];
        let angle = n[1].atan2(n[0]);
        turned = turned.max(angle - *turn_before.get_or_insert(angle));
        for (joint, of) in paper_arm().arm.joints().iter().enumerate() {
            let at = play.joint(joint);
            used[0] = used[0].max(v[at].abs() / of.limits.velocity);
            used[1] = used[1].max(a[at].abs() / of.limits.acceleration);
            used[2] = used[2].max(force[at].abs() / of.limits.effort);
        }
    }
    println!(
        "push {least:.2} N and more (limit 4.5), sideways {sideways:.4} of it (limit mu = 0.01 + 0.005), turned by {turned:.2} rad; \
         of the limits used: speed {:.2}, acceleration {:.3}, torque {:.2}",
        used[0], used[1], used[2]
    );
    assert!(
        rubbed[0] < -0.99 && rubbed[1] > 0.99,
        "a journal that rolls to and fro rubs both ways: {rubbed:?}"
    );
    assert!(turned > 0.3, "a journal that stays where it is tests nothing");
    assert!(least > 4.5 && sideways < 0.015);
    assert!(used.iter().all(|share| *share < 1.0 + 1e-4) && used[1] > 0.5);
}

#[test]
fn smooth_paths_have_no_corners() {
    let passages = passages(PathKind::Lissajous, 6.0, &[(4, 6e-4)], 300, 6000);
    assert!(passages.planned().is_empty() && passages.unplanned().is_empty(), "{passages:?}");
}

#[test]
fn a_corner_that_comes_again_is_planned_once() {
    let mut task = Task::default();
    (task.path.kind, task.path.period, task.path.laps) = (PathKind::Square, 2.4, 2);
    let path = JointPath::plan(&paper_arm().arm, &task.path, 1000.0).unwrap();
    let passages = passages_on(path, &[(4, 6e-4)], 1100, 3900);
    let corners: Vec<_> = passages.planned().iter().map(Passage::first).collect();
    println!("passages from the ticks {corners:?}; without: {:?}", passages.unplanned());
    let pairs = passages.planned().iter().flat_map(|one| {
        passages.planned().iter().filter(|two| two.first() == one.first() + 2400).map(move |two| (one, two))
    });
    let again: Vec<_> = pairs.collect();
    assert!(!again.is_empty(), "no corner comes again");
    for (one, two) in again {
        assert_eq!(one.starting_at(two.first()), *two);
    }
}

#[test]
fn a_corner_that_cannot_be_planned_from_the_first_start_is_planned_from_another() {
    let passages = passages(PathKind::SquareSharp, 6.0, &[(3, 3e-4), (4, 6e-4)], 5900, 6000);
    println!(
        "from {:?}; without: {:?}",
        passages.planned().first().map(Passage::first),
        passages.unplanned()
    );
    assert!(passages.planned().len() == 1 && passages.unplanned().is_empty());
    assert!(!passages.lacks_one_from(passages.planned()[0].first()));
}

#[test]
fn without_weight_there_is_no_side_and_the_fault_is_named() {
    let arm = paper_arm().arm.with_gravity(nalgebra::Vector3::zeros());
    let play = ArmWithPlay::new(&arm, &[(4, Clearance::new(&ClearanceTable::new(6e-4)).unwrap())]).unwrap();
    let mut outlook = DisplacementPreview::new(path(PathKind::SquareSharp, 6.0), &play, PERIOD, 10);
    let search = CornerSearch {
        arm: &arm,
        with_play: &play,
        period: PERIOD,
        weights: Weights::default(),
        options: PassageOptions::default(),
    };
    let passages = search.passages(&mut outlook, 1300, 1700);
    println!("{:?}", passages.unplanned());
    assert!(passages.planned().is_empty() && !passages.unplanned().is_empty());
    let first = passages.unplanned()[0].first;
    assert!(passages.fault(first).is_some() && passages.fault(0).is_none());
    assert!(passages.lacks_one_from(first) && !passages.lacks_one_from(first + 1), "it is counted once");
}

#[test]
fn through_a_sharp_corner_the_tool_deviates_less_than_with_no_or_quasi_static_compensation() {
    let folder = tempfile::tempdir().unwrap();
    let truth = [(4, 6e-4)];
    let mut task = Task { model: model_file(folder.path(), &truth).display().to_string(), ..Task::default() };
    (task.path.kind, task.path.period) = (PathKind::SquareSharp, 6.0);
    let mut measured = ["computed-torque", "quasi-static"].map(|name| {
        let outcome = run(built_in(name).unwrap().as_mut(), &task, &truth, 1700);
        (name, outcome)
    });
    let planned = run(built_in("narx-qp").unwrap().as_mut(), &task, &truth, 1700);
    assert!(planned.answers.iter().all(|answer| answer.status == CommandStatus::Ok));
    for (name, outcome) in &mut measured {
        println!(
            "{name}: {:.4} mm RMS, {:.3} max; with passages {:.4}, {:.3}",
            outcome.rms(),
            outcome.max(),
            planned.rms(),
            planned.max()
        );
        assert!(planned.rms() < 0.5 * outcome.rms() && planned.max() < 0.5 * outcome.max(), "{name}");
    }
}
