//! Effects in the plant, against closed forms and conservation.

use crate::common::{chain, close, near, rod};
use freeplay_arm::{Arm, Joint};
use freeplay_laws::{Injection, ToolForce, Transmission};
use freeplay_plant::{Input, Motion, ROTOR_SHARE, System, SystemError};
use nalgebra::Vector3;

/// The same motion for every joint.
struct Moved<F: Fn(f64) -> [f64; 3]>(F);

impl<F: Fn(f64) -> [f64; 3]> Motion for Moved<F> {
    fn at(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        let [at, speed, acceleration] = (self.0)(t);
        q.fill(at);
        v.fill(speed);
        a.fill(acceleration);
    }
}

/// A rod of 1 kg and 1 m on a joint about a horizontal axis: 1/3 kg·m².
fn one_rod(rotor_inertia: f64, gravity: f64) -> Arm {
    chain(vec![Joint { rotor_inertia, ..rod("elbow", 1.0, 1.0, 0.0) }], gravity)
}

const INERTIA: f64 = 1.0 / 3.0;

fn parted(arm: &Arm, law: Transmission, substeps: u32) -> System {
    let injection = Injection { transmissions: vec![(0, law)], ..Injection::default() };
    System::with_effects(arm, injection, &[vec![0.0; arm.dof()]], 1e-3, substeps).expect("fine steps")
}

/// Steps ticks under the motor torque `torque`, or along `motion` if given; calls `look` after each.
fn play(
    system: &mut System,
    torque: f64,
    motion: Option<&dyn Motion>,
    ticks: u32,
    mut look: impl FnMut(&System),
) {
    let joints = system.play().nominal_dof();
    let still = Moved(|_| [0.0; 3]);
    let (torque, driven) = (vec![torque; joints], vec![motion.is_some(); joints]);
    for _ in 0..ticks {
        let input = Input { torque: &torque, driven: &driven, motion: motion.unwrap_or(&still) };
        system.tick(&input).expect("finite");
        look(system);
    }
}

/// Mean angular frequency of samples around their mean, from the upward zero crossings, rad/s.
fn frequency(samples: &[f64], period: f64) -> f64 {
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let crossings: Vec<f64> = samples
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| pair[0] < mean && pair[1] >= mean)
        .map(|(k, pair)| (k as f64 + (mean - pair[0]) / (pair[1] - pair[0])) * period)
        .collect();
    assert!(crossings.len() > 5, "it swings: {} crossings", crossings.len());
    std::f64::consts::TAU * (crossings.len() - 1) as f64 / (crossings[crossings.len() - 1] - crossings[0])
}

#[test]
fn an_elastic_joint_swings_at_its_resonance_and_at_its_antiresonance() {
    let (rotor, stiffness) = (0.05, 1e4);
    let spring = Transmission { stiffness, damping: 0.0, gap: 0.0 };
    let arm = one_rod(rotor, 0.0);
    let mut system = parted(&arm, spring, 50);
    system.start(&[0.0], &[0.0]);
    play(&mut system, 20.0, None, 1, |_| ());
    let mut twist = Vec::new();
    play(&mut system, 0.0, None, 1000, |system| twist.push(system.joint(0)[0] - system.q()[0]));
    let resonance = (stiffness * (1.0 / rotor + 1.0 / INERTIA)).sqrt();
    near("resonance, free motor", frequency(&twist, 1e-3), resonance, 2e-3);
    let mut system = parted(&arm, spring, 50);
    system.start(&[0.0], &[0.0]);
    let mut link = Vec::new();
    play(&mut system, 0.0, Some(&Moved(|_| [1e-3, 0.0, 0.0])), 1000, |system| link.push(system.q()[0]));
    near("antiresonance, held motor", frequency(&link, 1e-3), (stiffness / INERTIA).sqrt(), 2e-3);
}

#[test]
fn a_link_hangs_from_its_spring_and_the_motor_carries_its_weight() {
    let stiffness = 2e3;
    let arm = one_rod(0.0, 9.81);
    let mut system = parted(&arm, Transmission { stiffness, damping: 30.0, gap: 0.0 }, 50);
    system.start(&[0.0], &[0.0]);
    let held = Moved(|_| [0.0; 3]);
    play(&mut system, 0.0, Some(&held), 2000, |_| ());
    // The rod's weight pulls at 0.5 m; the axis y turns +x to -z, so gravity turns the link forwards.
    let sag = system.q()[0];
    close("sag", sag, 9.81 * 0.5 * sag.cos() / stiffness, 1e-9);
    close("motor torque", system.motor_torque()[0], -9.81 * 0.5 * sag.cos(), 1e-6);
    assert!(sag > 1e-3, "there is a sag: {sag}");
}

#[test]
fn a_link_does_not_feel_its_motor_within_the_gap() {
    let gap = 4e-3;
    let arm = one_rod(0.05, 0.0);
    let mut system = parted(&arm, Transmission { stiffness: 1e4, damping: 5.0, gap }, 50);
    system.start(&[0.0], &[0.0]);
    // The link rests in the centre of the gap; at 0.01 rad/s the motor takes gap/2/0.01 = 0.2 s to its flank.
    let slow = Moved(|t| [0.01 * t, 0.01, 0.0]);
    let mut moved = None;
    play(&mut system, 0.0, Some(&slow), 400, |system| {
        if moved.is_none() && system.q()[0] != 0.0 {
            moved = Some(system.time());
        }
    });
    close("first motion of the link", moved.expect("the flank is met"), 0.2, 1.5e-3);
    let behind = system.joint(0)[0] - system.q()[0];
    println!("motor ahead of the link by {:.4} mrad of half a gap of 2 mrad", behind * 1e3);
    assert!(behind < 0.5 * gap + 1e-4, "the link follows its flank");
}

#[test]
fn a_stiff_transmission_gives_back_the_rigid_arm() {
    // Two rods without a rotor inertia in the model, so that each motor takes its share from its link.
    let arm = chain(vec![rod("one", 1.0, 1.0, 0.0), rod("two", 1.0, 1.0, 1.0)], 9.81);
    let fall = |stiffness: Option<f64>| {
        let law = |stiffness| Transmission { stiffness, damping: 1e-3 * stiffness, gap: 0.0 };
        let transmissions = stiffness.map_or(Vec::new(), |k| vec![(0, law(k)), (1, law(k))]);
        let injection = Injection { transmissions, ..Injection::default() };
        let postures: Vec<Vec<f64>> = (0..10).map(|i| vec![0.3, 0.4 + 0.3 * f64::from(i)]).collect();
        let mut system = System::with_effects(&arm, injection, &postures, 1e-3, 100).expect("fine steps");
        system.start(&[0.3, 0.4], &[0.0, 0.0]);
        play(&mut system, 0.0, None, 300, |_| ());
        [system.joint(0)[0], system.joint(1)[0]]
    };
    let rigid = fall(None);
    let off = |stiffness| {
        let elastic = fall(Some(stiffness));
        (elastic[0] - rigid[0]).abs().max((elastic[1] - rigid[1]).abs())
    };
    let (soft, stiff) = (off(2e3), off(2e4));
    println!("off the rigid fall by {soft:.2e} at 2e3 N·m/rad, {stiff:.2e} at 2e4");
    assert!((rigid[0] - 0.3).abs() > 0.1, "it falls: {rigid:?}");
    assert!(stiff < 0.2 * soft && stiff < 1e-3, "the difference goes with 1/k");
}

#[test]
fn the_rotor_takes_its_share_from_the_link() {
    let soft = Transmission { stiffness: 1e3, damping: 1.0, gap: 0.0 };
    let unnamed = parted(&one_rod(0.0, 0.0), soft, 50);
    near("default rotor", unnamed.rotor_inertia(0).expect("a motor"), ROTOR_SHARE * INERTIA, 1e-5);
    let named = parted(&one_rod(0.07, 0.0), soft, 50);
    assert_eq!(named.rotor_inertia(0), Some(0.07));
    // A rotor inertia of the model adds to the link; without one it comes out of the link. In both cases all parts turn as one.
    for (mut system, whole) in [(unnamed, INERTIA), (named, INERTIA + 0.07)] {
        system.start(&[0.0], &[0.0]);
        play(&mut system, 1.0, None, 500, |_| ());
        near("speed after 0.5 s at 1 N·m", system.joint(0)[1], 0.5 / whole, 0.02);
    }
}

#[test]
fn a_transmission_too_stiff_for_the_step_is_refused_with_the_remedy() {
    let arm = one_rod(0.01, 0.0);
    let law = Transmission { stiffness: 1e7, damping: 0.0, gap: 0.0 };
    let attempt = |substeps| {
        let injection = Injection { transmissions: vec![(0, law)], ..Injection::default() };
        System::with_effects(&arm, injection, &[vec![0.0]], 1e-3, substeps)
    };
    let refused = attempt(10).expect_err("32 krad/s in steps of 100 us");
    println!("{refused}");
    let SystemError::TransmissionTooStiff { joint, frequency, needed, .. } = &refused else {
        panic!("{refused}");
    };
    assert_eq!(joint, "elbow");
    near("frequency", *frequency, (1e7_f64 * (100.0 + 3.0)).sqrt() / std::f64::consts::TAU, 1e-4);
    assert!(attempt(*needed as u32).is_ok() && attempt(*needed as u32 - 1).is_err());
}

#[test]
fn a_saturated_motor_gives_its_limit_and_no_more() {
    let injection = Injection { saturations: vec![(0, 4.0)], ..Injection::default() };
    let arm = one_rod(0.0, 0.0);
    let mut system = System::with_effects(&arm, injection, &[vec![0.0]], 1e-3, 20).expect("a system");
    system.start(&[0.0], &[0.0]);
    play(&mut system, 10.0, None, 500, |_| ());
    near("turned in 0.5 s", system.q()[0], 0.5 * 4.0 / INERTIA * 0.25, 1e-5);
    assert_eq!(system.motor_torque(), [4.0]);
}

#[test]
fn a_force_on_the_tool_shows_in_its_window_alone() {
    let arm = Arm::new(
        "chain",
        vec![rod("elbow", 1.0, 1.0, 0.0)],
        nalgebra::Isometry3::translation(1.0, 0.0, 0.0),
        Vector3::zeros(),
    )
    .expect("an arm");
    let force = ToolForce { force: Vector3::new(0.0, 3.0, -20.0), start: 0.1, end: 0.2 };
    let injection = Injection { forces: vec![force], ..Injection::default() };
    let mut system = System::with_effects(&arm, injection, &[vec![0.0]], 1e-3, 20).expect("a system");
    system.start(&[0.0], &[0.0]);
    let mut torques = Vec::new();
    play(&mut system, 0.0, Some(&Moved(|_| [0.0; 3])), 300, |system| torques.push(system.motor_torque()[0]));
    // A force downwards at 1 m along x turns the link forwards about y; the motor holds against it.
    for (tick, torque) in torques.iter().enumerate() {
        let expected = if (100..200).contains(&tick) { -20.0 } else { 0.0 };
        assert!((torque - expected).abs() < 1e-9, "tick {tick}: {torque} instead of {expected}");
    }
    let peak = system.take_peaks().base_force;
    close("base force", peak, force.force.norm(), 1e-9);
}

#[test]
fn the_ledger_closes_with_gears_drive_losses_and_a_force_on_the_tool() {
    let arm = chain(vec![rod("one", 1.0, 1.0, 0.0), rod("two", 1.0, 1.0, 1.0)], 9.81);
    let residual = |substeps: u32| {
        let gear = Transmission { stiffness: 3e3, damping: 4.0, gap: 2e-3 };
        let force = ToolForce { force: Vector3::new(5.0, 0.0, 3.0), start: 0.1, end: 0.5 };
        let injection =
            Injection { transmissions: vec![(0, gear)], forces: vec![force], ..Injection::default() };
        let rubbing = arm.joints().iter().map(|joint| Joint {
            friction: freeplay_arm::JointFriction { viscous: 0.3, coulomb: 0.0 },
            ..joint.clone()
        });
        let arm = chain(rubbing.collect(), 9.81);
        let postures = [vec![0.3, 0.4], vec![0.5, 1.0]];
        let mut system =
            System::with_effects(&arm, injection, &postures, 1e-3, substeps).expect("fine steps");
        system.start(&[0.3, 0.4], &[0.0, 0.0]);
        play(&mut system, 0.5, None, 600, |_| ());
        let ledger = *system.ledger();
        println!("{substeps} sub-steps: residual {:.2e} J; {ledger:?}", ledger.residual());
        for (what, energy) in [
            ("transmission", ledger.transmission),
            ("drives", ledger.drive_friction),
            ("tool", ledger.tool_force.abs()),
        ] {
            assert!(energy > 1e-3, "{what} takes part: {energy:e} J");
        }
        ledger.residual().abs()
    };
    let (coarse, fine) = (residual(25), residual(100));
    assert!(fine < 0.25 * coarse && fine < 1e-4, "{coarse:e} J, {fine:e} J");
}
