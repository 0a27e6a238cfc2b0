//! Tests of the quasi-static predictor against statics by hand, and against the laws and the dynamics that it solves.

use freeplay_arm::{Drive, Workspace, hybrid_aba, jacobian};
use freeplay_controller::compensation::Motion;
use freeplay_controller::deviation::QuasiStatic;
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable, Journal, bearing_contact};
use freeplay_model::paper_arm;
use nalgebra::{DMatrix, Vector3};

const PERIOD: f64 = 1e-3;

fn arm_with_play(joints: &[usize], table: ClearanceTable) -> ArmWithPlay {
    let clearance = Clearance::new(&table).unwrap();
    let clearances: Vec<_> = joints.iter().map(|&joint| (joint, clearance)).collect();
    ArmWithPlay::new(&paper_arm().arm, &clearances).unwrap()
}

#[test]
fn at_rest_the_journal_hangs_below_by_clearance_and_penetration() {
    let mut predictor = QuasiStatic::new(&arm_with_play(&[4], ClearanceTable::new(6e-4)), PERIOD);
    let rest = [0.0; 6];
    predictor.advance(Motion { q: &rest, v: &rest, a: &rest });
    let deviation = predictor.deviation(&rest);
    // Mass after the joint 2.22 kg; the penetration is that of the table of static penetrations, 1.0171 µm.
    let expected = Vector3::new(0.0, 0.0, -(6e-4 + 1.0171e-6));
    let error = (deviation - expected).norm();
    println!("deviation {deviation:?}, error {error:.1e} m (limit 1e-10: the table's last digit)");
    assert!(error < 1e-10);
    assert!((predictor.rests()[0].force - 2.22 * 9.81).abs() < 1e-9);
    assert_eq!(predictor.rests()[0].moment, 0.0, "no turning, no friction");
}

/// A motion on which all joints move, at the time t: positions, velocities, accelerations.
fn motion(t: f64) -> [[f64; 6]; 3] {
    let amplitude = 0.3;
    let omega = |joint: usize| 2.0 + 0.3 * joint as f64;
    [
        std::array::from_fn(|i| 0.4 + amplitude * (omega(i) * t).sin()),
        std::array::from_fn(|i| amplitude * omega(i) * (omega(i) * t).cos()),
        std::array::from_fn(|i| -amplitude * omega(i).powi(2) * (omega(i) * t).sin()),
    ]
}

#[test]
fn the_bearing_forces_of_the_predicted_rest_carry_the_outer_links() {
    // Without any feedback, the test puts the journals at the predicted positions, and applies the contact laws to them and the
    // predicted torques to the joints. Then the joints must accelerate as desired and the slides hardly.
    for (joints, friction) in [(&[4][..], 0.01), (&[4], 0.2), (&[2, 4], 0.1)] {
        let table = ClearanceTable { friction, ..ClearanceTable::new(4e-4) };
        let play = arm_with_play(joints, table);
        let (m, mut worst, mut slid) = (play.arm().dof(), 0.0_f64, 0.0_f64);
        let mut predictor = QuasiStatic::new(&play, PERIOD);
        let mut workspace = Workspace::new(play.arm());
        let mut moments = 0.0_f64;
        for tick in 0..600 {
            let [q, v, a] = motion(f64::from(tick) * PERIOD);
            let desired = Motion { q: &q, v: &v, a: &a };
            let before: Vec<_> = predictor.rests().iter().map(|rest| rest.displacement).collect();
            predictor.advance(desired);
            let mut torque = [0.0; 6];
            let displacements: Vec<f64> = predictor.displacements().collect();
            let still = vec![0.0; displacements.len()];
            let journals = Motion { q: &displacements, v: &still, a: &still };
            let rubbing: Vec<f64> = predictor.moments().collect();
            let mut external = [0.0; 6];
            predictor.feed_forward(desired, journals, &rubbing, &mut torque, &mut external);
            if tick == 0 {
                continue;
            }
            let (mut qe, mut ve) = (vec![0.0; m], vec![0.0; m]);
            play.spread(&q, &mut qe);
            play.spread(&v, &mut ve);
            let mut drives = vec![Drive::Torque(0.0); m];
            for (joint, &torque) in torque.iter().enumerate() {
                drives[play.joint(joint)] = Drive::Torque(torque);
            }
            for ((at, rest), before) in play.plays().iter().zip(predictor.rests()).zip(before) {
                let journal = Journal {
                    offset: rest.displacement,
                    velocity: [0, 1].map(|i| (rest.displacement[i] - before[i]) / PERIOD),
                    turning: v[at.joint],
                };
                let mut approach = journal.approach(&at.clearance);
                approach.rate = 0.0;
                let contact = bearing_contact(&at.clearance, &approach, 1.0);
                for (slide, force) in at.slides.into_iter().zip(contact.force) {
                    drives[slide] = Drive::Torque(force);
                    qe[slide] = journal.offset[usize::from(slide != at.slides[0])];
                }
                if let Drive::Torque(torque) = &mut drives[at.turn] {
                    *torque += contact.moment;
                }
                moments = moments.max(contact.moment.abs());
            }
            let (mut acceleration, mut unused) = (vec![0.0; m], vec![0.0; m]);
            hybrid_aba(play.arm(), &mut workspace, &qe, &ve, &drives, &mut acceleration, &mut unused);
            for (joint, wanted) in a.iter().enumerate() {
                worst = worst.max((acceleration[play.joint(joint)] - wanted).abs());
            }
            for at in play.plays() {
                slid = at.slides.iter().map(|&slide| acceleration[slide].abs()).fold(slid, f64::max);
            }
        }
        println!(
            "joints {joints:?}, friction {friction}: joints off by {worst:.1e} rad/s² (limit 0.2), slides {slid:.1e} m/s² (limit 0.2), \
             friction moments up to {moments:.1e} N·m"
        );
        assert!(moments > 1e-4, "friction must matter");
        assert!(worst < 0.2 && slid < 0.2);
    }
}

#[test]
fn the_tool_moves_as_the_slides_say() {
    let play = arm_with_play(&[2, 4], ClearanceTable::new(6e-4));
    let mut predictor = QuasiStatic::new(&play, PERIOD);
    let [q, v, a] = motion(0.2);
    predictor.advance(Motion { q: &q, v: &v, a: &a });
    let deviation = predictor.deviation(&q);
    let mut extended = vec![0.0; play.arm().dof()];
    play.spread(&q, &mut extended);
    let mut workspace = Workspace::new(play.arm());
    let mut j = DMatrix::zeros(6, play.arm().dof());
    jacobian(play.arm(), &mut workspace, &extended, &mut j);
    let here = freeplay_arm::forward_kinematics(play.arm(), &mut workspace, &extended);
    for (at, rest) in play.plays().iter().zip(predictor.rests()) {
        for (slide, displacement) in at.slides.into_iter().zip(rest.displacement) {
            extended[slide] = displacement;
        }
    }
    let there = freeplay_arm::forward_kinematics(play.arm(), &mut workspace, &extended);
    let error = (there.translation.vector - here.translation.vector - deviation).norm();
    println!("deviation {:.3e} m, error {error:.1e} m (limit 1e-12)", deviation.norm());
    assert!(deviation.norm() > 6e-4 && error < 1e-12);
}

#[test]
fn weightless_and_at_rest_there_is_no_side_to_lie_on() {
    let clearance = Clearance::new(&ClearanceTable::new(6e-4)).unwrap();
    let arm = paper_arm().arm.with_gravity(Vector3::zeros());
    let play = ArmWithPlay::new(&arm, &[(4, clearance)]).unwrap();
    let mut predictor = QuasiStatic::new(&play, PERIOD);
    let rest = [0.0; 6];
    predictor.advance(Motion { q: &rest, v: &rest, a: &rest });
    assert_eq!(predictor.deviation(&rest), Vector3::zeros());
}
