//! The machine against closed forms, conservation and an independent integrator.

use std::path::Path;

use freeplay_arm::{Arm, Workspace, aba, kinetic_energy, potential_energy, rnea};
use freeplay_model::parse_toml;

use super::plan::Plan;
use super::step::Stepper;
use crate::arms::{Load, Machine};
use crate::calibrate::residual;
use crate::data_sheet_deviations::DataSheetDeviations;
use crate::motion::{Family, Motion};
use crate::physics::{Effect, Physics};
use crate::random::stream;
use crate::servo::Servo;

fn plan(arm: &Arm, effects: &[Effect], pose: &[f64]) -> Plan {
    let load = Load { mass: 0.0, place: arm.tool().translation.vector };
    Plan::new(arm, &load, &DataSheetDeviations::none(arm.dof()), effects, &[pose.to_vec()]).expect("a plan")
}

fn without_friction(arm: &Arm) -> Arm {
    let mut joints = arm.joints().to_vec();
    joints.iter_mut().for_each(|joint| joint.friction = freeplay_arm::JointFriction::default());
    Arm::new(arm.name(), joints, *arm.tool(), *arm.gravity()).expect("an arm")
}

/// One revolute joint with a bar of `inertia` about it, gravity off.
fn wheel(inertia: f64, damping: f64, friction: f64) -> Arm {
    let text = format!(
        "name = \"wheel\"\ngravity = [0.0, 0.0, 0.0]\n[[joint]]\nname = \"j\"\ntype = \"revolute\"\naxis = [0, 0, 1]\n\
         mass = 1.0\ncom = [0.0, 0.0, 0.0]\ndamping = {damping:?}\nfriction = {friction:?}\n\
         inertia = {{ ixx = {inertia}, iyy = {inertia}, izz = {inertia} }}\n[tool]\nxyz = [0.5, 0.0, 0.0]\n"
    );
    parse_toml(&text, Path::new("wheel.toml")).expect("an arm").arm
}

fn servo(arm: &Arm) -> Servo {
    Servo { bandwidth: 35.0, integral: 2.0, creep: 0.01, resolution: vec![1e-6; arm.dof()] }
}

/// The state after `time` s by classical Runge–Kutta of fourth order on the articulated-body algorithm.
fn runge_kutta(arm: &Arm, q: &[f64], time: f64, steps: u32) -> Vec<f64> {
    let n = arm.dof();
    let mut ws = Workspace::new(arm);
    let mut derivative = |s: &[f64]| {
        let mut d = vec![0.0; 2 * n];
        d[..n].copy_from_slice(&s[n..]);
        aba(arm, &mut ws, &s[..n], &s[n..], &vec![0.0; n], &mut d[n..]);
        d
    };
    let h = time / f64::from(steps);
    let mut s: Vec<f64> = q.iter().copied().chain(std::iter::repeat_n(0.0, n)).collect();
    let add = |s: &[f64], d: &[f64], h: f64| s.iter().zip(d).map(|(s, d)| s + h * d).collect::<Vec<_>>();
    for _ in 0..steps {
        let k1 = derivative(&s);
        let k2 = derivative(&add(&s, &k1, 0.5 * h));
        let k3 = derivative(&add(&s, &k2, 0.5 * h));
        let k4 = derivative(&add(&s, &k3, h));
        for i in 0..2 * n {
            s[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    s
}

/// In free fall the time stepping converges to another integrator with another algorithm, with second order.
#[test]
fn free_fall_converges_to_runge_kutta() {
    let arm = without_friction(&Machine::Three.data_sheet().expect("a data sheet"));
    let q = [0.2, 0.4, -0.7];
    let exact = runge_kutta(&arm, &q, 0.4, 4000);
    assert!(exact[4].abs() > 1.0, "it falls: {exact:?}");
    let machine = plan(&arm, &[], &q);
    let error = |h: f64| {
        let mut fall = Stepper::new(&machine, 0.0, &q);
        for _ in 0..(0.4 / h).round() as u32 {
            fall.long_step(&[0.0; 3], h).expect("a step");
        }
        fall.x.iter().chain(&fall.u).zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let errors = [1e-3, 0.5e-3, 0.25e-3].map(error);
    let orders = [(errors[0] / errors[1]).log2(), (errors[1] / errors[2]).log2()];
    println!("errors {errors:?}, orders {orders:?}");
    assert!(errors[2] < 2e-5 && orders.iter().all(|order| *order > 1.7));
}

/// In free fall seven joints conserve their energy.
#[test]
fn free_fall_keeps_its_energy() {
    let arm = without_friction(&Machine::Seven.data_sheet().expect("a data sheet"));
    let q = Machine::Seven.home();
    let machine = plan(&arm, &[], q);
    let mut ws = Workspace::new(&arm);
    let mut energy = |q: &[f64], v: &[f64]| {
        let kinetic = kinetic_energy(&arm, &mut ws, q, v);
        (kinetic + potential_energy(&arm, &mut ws, q), kinetic)
    };
    let mut fall = Stepper::new(&machine, 0.0, q);
    let (start, _) = energy(&fall.x, &fall.u);
    for _ in 0..1600 {
        fall.long_step(&[0.0; 7], 0.25e-3).expect("a step");
    }
    let (end, kinetic) = energy(&fall.x, &fall.u);
    println!("energy {start:.6} J, {end:.6} J, of it {kinetic:.3} J kinetic");
    assert!(kinetic > 10.0 && (end - start).abs() < 1e-4 * kinetic);
}

/// A wheel with dry friction stops at the time of the closed form, and then stands still to the last bit.
#[test]
fn dry_friction_stops_and_holds() {
    let arm = wheel(0.5, 0.0, 2.0);
    let machine = plan(&arm, &[], &[0.0]);
    let mut run = Stepper::new(&machine, 0.0, &[0.0]);
    run.u[0] = 1.0;
    let mut stopped = None;
    for k in 0..2000 {
        run.long_step(&[0.0], 0.25e-3).expect("a step");
        if run.u[0].abs() < 1e-12 && stopped.is_none() {
            stopped = Some(f64::from(k + 1) * 0.25e-3);
        }
    }
    let stopped = stopped.expect("it stops");
    println!("stops at {stopped} s, closed form 0.25 s; has turned {} rad, closed form 0.125", run.x[0]);
    assert!((stopped - 0.25).abs() < 3e-4 && (run.x[0] - 0.125).abs() < 1e-6 && run.u[0].abs() < 1e-12);
    // A torque below the friction does not move it; a larger one accelerates it with the difference.
    let before = run.x[0];
    (0..400).for_each(|_| run.long_step(&[1.9], 0.25e-3).expect("a step"));
    assert!((run.x[0] - before).abs() < 1e-12);
    (0..400).for_each(|_| run.long_step(&[3.0], 0.25e-3).expect("a step"));
    println!("speed {} after 0.1 s, closed form 0.2", run.u[0]);
    assert!((run.u[0] - 0.2).abs() < 1e-9);
}

/// Load-dependent friction is a share of the torque on the link, not of that on its rotor: T − μ I a = (I + J) a.
#[test]
fn a_rotor_is_no_load_of_its_transmission() {
    let (inertia, rotor, coefficient, torque) = (0.5, 0.3, 0.4, 2.0);
    let wheel = wheel(inertia, 0.0, 0.0);
    let mut joints = wheel.joints().to_vec();
    joints[0].rotor_inertia = rotor;
    let arm = Arm::new(wheel.name(), joints, *wheel.tool(), *wheel.gravity()).expect("an arm");
    let effect = Effect { joint: Some(0), physics: Physics::LoadDependentFriction { coefficient } };
    let machine = plan(&arm, &[effect], &[0.0]);
    let mut run = Stepper::new(&machine, 0.0, &[0.0]);
    (0..400).for_each(|_| run.long_step(&[torque], 0.25e-3).expect("a step"));
    let before = run.u[0];
    (0..400).for_each(|_| run.long_step(&[torque], 0.25e-3).expect("a step"));
    let exact = torque / (inertia + rotor + coefficient * inertia);
    println!("{:.6} rad/s², closed form {exact:.6}", 10.0 * (run.u[0] - before));
    assert!((10.0 * (run.u[0] - before) / exact - 1.0).abs() < 1e-6);
}

/// Motor and link swing against each other at the frequency of the closed form.
#[test]
fn an_elastic_joint_resonates_where_it_should() {
    let (inertia, stiffness) = (0.5, 2000.0);
    let arm = wheel(inertia, 0.0, 0.0);
    let effect = Effect { joint: Some(0), physics: Physics::JointElasticity { stiffness, damping: 0.0 } };
    let machine = plan(&arm, &[effect], &[0.0]);
    let rotor = machine.transmissions[0].rotor;
    assert!(rotor > 0.1 * inertia && rotor < 0.9 * inertia);
    let omega = (stiffness * (1.0 / rotor + 1.0 / (inertia - rotor))).sqrt();
    let mut run = Stepper::new(&machine, 0.0, &[0.0]);
    run.x[1] = 1e-3;
    let twist = |run: &Stepper<'_>| run.x[1] - run.x[0];
    let (mut crossings, mut before) = (Vec::new(), twist(&run));
    while crossings.len() < 41 {
        run.long_step(&[0.0], 0.25e-3).expect("a step");
        let now = twist(&run);
        if before > 0.0 && now <= 0.0 {
            crossings.push(run.t - 0.25e-3 * now / (now - before));
        }
        before = now;
    }
    let period = (crossings[40] - crossings[0]) / 40.0;
    let measured = std::f64::consts::TAU / period;
    println!("{measured:.3} rad/s, closed form {omega:.3}");
    assert!((measured / omega - 1.0).abs() < 4e-3);
}

/// The torque of the servo equals inverse dynamics plus friction, sample by sample, and the arm follows.
#[test]
fn without_effects_the_recording_is_the_data_sheet() {
    for machine in [Machine::Slide, Machine::SixCell] {
        let (arm, load) = machine.loaded(1.0).expect("a data sheet");
        let motion = Motion::draw(machine, &arm, Family::Fourier, 4.0, &mut stream(3, "motion"));
        let ideal = DataSheetDeviations::none(arm.dof());
        let machine_plan = Plan::new(&arm, &load, &ideal, &[], &[machine.home().to_vec()]).expect("a plan");
        let trace = machine_plan.run(&arm, &servo(&arm), &motion, 4.0).expect("a run");
        let residual = residual(&arm, &machine_plan, &trace, &ideal, 4.0);
        let (torque, tool) = residual.sizes();
        for (joint, (size, limits)) in torque.iter().zip(arm.joints().iter().map(|j| j.limits)).enumerate() {
            println!("{machine:?} joint {joint}: torque off by {size:.2e} of at most {}", limits.effort);
            assert!(*size > 0.0 && *size < 5e-4 * limits.effort);
        }
        println!("{machine:?}: tool off by {tool:.1e} m");
        assert!(tool < 1e-9);
        let mut worst = 0.0_f64;
        let n = arm.dof();
        for row in (100..trace.len()).step_by(50) {
            let t = trace.start + row as f64 * trace.step;
            let mut s = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
            let [q, v, a] = &mut s;
            motion.at(t, q, v, a);
            worst = q.iter().zip(trace.motor(row)).fold(worst, |w, (q, x)| w.max((q - x).abs()));
        }
        println!("{machine:?}: follows within {worst:.1e} rad or m");
        assert!(worst < 2e-2);
    }
}

/// A longer last link moves the tool outwards, and the tracker measures it.
#[test]
fn a_longer_last_link_moves_the_tool() {
    let arm = Machine::Three.data_sheet().expect("a data sheet");
    let effect = Effect { joint: Some(2), physics: Physics::LinkLength { offset: 0.01 } };
    let longer = plan(&arm, &[effect], Machine::Three.home());
    let grown = longer.tool.translation.vector.norm() - arm.tool().translation.vector.norm();
    println!("{grown} m longer, asked for 0.01 m");
    assert!((grown - 0.01).abs() < 1e-12);
}

/// Under a steady load the journal rests at the clearance in the direction of the load, and the tool moves by it.
#[test]
fn a_journal_rests_at_the_clearance() {
    let arm = Machine::Two.data_sheet().expect("a data sheet");
    let clearance = 5e-4;
    let physics = Physics::JointClearance { clearance, stiffness: 2e9, restitution: 0.7, friction: 0.05 };
    let pose = Machine::Two.home();
    let machine = plan(&arm, &[Effect { joint: Some(1), physics }], pose);
    let mut tau = vec![0.0; 2];
    let mut ws = Workspace::new(&arm);
    rnea(&arm, &mut ws, pose, &[0.0; 2], &[0.0; 2], &mut tau);
    let mut run = Stepper::new(&machine, 0.0, pose);
    // Springs hold the joints, strong enough to keep the posture.
    for _ in 0..6000 {
        let hold: Vec<f64> = (0..2)
            .map(|i| {
                let at = machine.link[i];
                tau[i] + 2e4 * (pose[i] - run.x[at]) - 300.0 * run.u[at]
            })
            .collect();
        run.long_step(&hold, 0.25e-3).expect("a step");
    }
    let slides = machine.bearings[0].slides;
    let offset = run.x[slides].hypot(run.x[slides + 1]);
    println!("offset {:.2} µm, clearance 500 µm", offset * 1e6);
    assert!(offset > clearance && offset < 1.05 * clearance);
}

/// With a gap, link and motor are half a gap apart on the side of the load.
#[test]
fn a_gap_is_taken_up_by_the_load() {
    let arm = Machine::Two.data_sheet().expect("a data sheet");
    let (gap, stiffness) = (4e-3, 5e4);
    let pose = Machine::Two.home();
    let effect = Effect { joint: Some(1), physics: Physics::Backlash { gap, stiffness } };
    let (machine, ideal) = (plan(&arm, &[effect], pose), DataSheetDeviations::none(2));
    let motion = Motion::draw(Machine::Two, &arm, Family::Sweep, 0.1, &mut stream(1, "m"));
    let trace = machine.run(&arm, &servo(&arm), &motion, 0.1).expect("a run");
    let row = 40;
    let lead = trace.motor(row)[1] - trace.link(row)[1];
    let load = trace.torque(row)[1];
    println!("motor leads by {lead:.6} rad under {load:.2} N·m ({ideal:?})");
    assert!(lead.abs() > 0.5 * gap && lead.abs() < 0.5 * gap + 40.0 / stiffness);
}

/// A bending link can be simulated in a reasonable time, wherever its centre of mass is.
#[test]
fn no_bending_link_is_too_stiff_to_simulate() {
    let mut links = 0;
    for machine in Machine::ALL {
        let (arm, load) = machine.loaded(1.0).expect("an arm");
        let deviations = DataSheetDeviations::none(arm.dof());
        for joint in 0..arm.dof() {
            let effect = Effect { joint: Some(joint), physics: Physics::LinkFlexure { stiffness: 4e4 } };
            // A link without length does not bend.
            let Ok(plan) = Plan::new(&arm, &load, &deviations, &[effect], &[machine.home().to_vec()]) else {
                continue;
            };
            println!("{machine:?} joint {joint}: {} short steps in a long one", plan.substeps);
            assert!(plan.substeps < 100);
            links += 1;
        }
    }
    assert!(links > 20);
}
