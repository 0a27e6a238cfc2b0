//! Dry friction of the plant's joints, against closed forms: sliding joints stop as Coulomb's law predicts, and sticking joints do not
//! move.

use freeplay_arm::{Arm, Joint, JointFriction};
use freeplay_laws::{Injection, Placed};
use freeplay_model::EffectTable;
use freeplay_plant::{Braking, Input, System};

use crate::common::{chain, close, near, rod};

/// A rod of 1 kg and 1 m: 1/3 kg·m² about its joint.
const INERTIA: f64 = 1.0 / 3.0;

fn with_coulomb(joint: Joint, coulomb: f64) -> Joint {
    Joint { friction: JointFriction { viscous: 0.0, coulomb }, ..joint }
}

fn system(arm: &Arm, injection: Injection, posture: &[f64]) -> System {
    System::with_effects(arm, injection, &[posture.to_vec()], 1e-3, 50).expect("fine steps")
}

/// Steps ticks under the motor torques `torque`; calls `look` after each.
fn push(system: &mut System, torque: &[f64], ticks: u32, mut look: impl FnMut(&System)) {
    let driven = vec![false; torque.len()];
    let motion = Braking::new(vec![1.0; torque.len()]);
    for _ in 0..ticks {
        system.tick(&Input { torque, driven: &driven, motion: &motion }).expect("finite");
        look(system);
    }
}

/// The joint stops after the time I v₀/F and the distance I v₀²/(2F); both to a sub-step of 20 µs.
#[test]
fn a_sliding_joint_stops_where_coulomb_has_it() {
    let arm = chain(vec![with_coulomb(rod("elbow", 1.0, 1.0, 0.0), 2.0)], 0.0);
    let mut system = system(&arm, Injection::default(), &[0.0]);
    system.start(&[0.0], &[1.5]);
    let mut at_120_ms = 0.0;
    push(&mut system, &[0.0], 120, |system| at_120_ms = system.joint(0)[1]);
    near("speed after 0.12 s", at_120_ms, 1.5 - 0.12 * 2.0 / INERTIA, 1e-3);
    push(&mut system, &[0.0], 880, |_| ());
    near("way until it stands", system.joint(0)[0], INERTIA * 1.5 * 1.5 / (2.0 * 2.0), 1e-4);
    close("speed after 1 s", system.joint(0)[1], 0.0, 1e-12);
}

/// A joint of 10⁻⁴ kg·m² with 10 N·m of friction, which stops 2 rad/s within a sub-step, and a heavy one: under gravity and a motor torque
/// that rises to just below its friction neither moves, for any time.
#[test]
fn a_joint_that_sticks_does_not_creep() {
    let light = with_coulomb(Joint { rotor_inertia: 1e-4, ..rod("light", 1e-3, 0.01, 1.0) }, 10.0);
    let heavy = with_coulomb(rod("heavy", 10.0, 1.0, 0.0), 60.0);
    let arm = chain(vec![heavy, light], 9.81);
    let mut system = system(&arm, Injection::default(), &[0.0, 0.0]);
    system.start(&[0.0, 0.0], &[0.0, 0.0]);
    (1..=99).for_each(|tenth| push(&mut system, &[0.0, 0.1 * f64::from(tenth)], 1, |_| ()));
    let settled = [0, 1].map(|joint| system.joint(joint)[0]);
    let mut fastest = 0.0_f64;
    push(&mut system, &[0.0, 9.9], 5000, |system| {
        fastest = (0..2).fold(fastest, |fastest, joint| fastest.max(system.joint(joint)[1].abs()));
    });
    for (joint, settled) in settled.into_iter().enumerate() {
        close("turned before it stands", settled, 0.0, 1e-4);
        close("turned in 5 s", system.joint(joint)[0], settled, 1e-9);
    }
    close("fastest", fastest, 0.0, 1e-9);
    push(&mut system, &[0.0, 10.5], 100, |_| ());
    println!("with more than its friction the light joint turns {:.1} rad", system.joint(1)[0]);
    assert!(system.joint(1)[0] > 1.0, "what is beyond friction moves it");
}

/// Three rods in one chain, all sticking: their inertias are coupled, and none sets another in motion.
#[test]
fn joints_that_stick_together_come_to_rest() {
    let rods = [(3.0, 0.0), (2.0, 1.0), (1.0, 1.0)];
    let joints =
        rods.iter().map(|&(mass, at)| with_coulomb(rod(&format!("rod {mass}"), mass, 1.0, at), 120.0));
    let arm = chain(joints.collect(), 9.81);
    let mut system = system(&arm, Injection::default(), &[0.3, -0.2, 0.1]);
    system.start(&[0.3, -0.2, 0.1], &[1.0, -3.0, 5.0]);
    push(&mut system, &[0.0; 3], 500, |_| ());
    for joint in 0..3 {
        close("speed", system.joint(joint)[1], 0.0, 1e-9);
    }
}

/// The shaft of two joints with dry friction turns when both turn the same way, and brakes them; when they turn against each other it
/// stands still.
#[test]
fn a_coupling_that_sticks_holds_both_joints() {
    let arm = chain(vec![rod("one", 1.0, 1.0, 0.0), rod("two", 1.0, 1.0, 1.0)], 0.0);
    let parameters = toml::from_str("with = \"one\"\ncoulomb = 4.0\nform = \"shaft\"").expect("TOML");
    let table = EffectTable { kind: "joint_coupling".into(), joint: Some("two".into()), parameters, line: 1 };
    let mut injection = Injection::default();
    Placed::new(&table, &arm).expect("a coupling").effect.inject(&mut injection);
    let mut system = system(&arm, injection, &[0.0, 0.0]);
    system.start(&[0.0, 0.0], &[0.0, 0.0]);
    push(&mut system, &[3.5, 3.5], 200, |_| ());
    let shaft = system.joint(0)[1] + system.joint(1)[1];
    close("speed of the shaft under 3.5 of 4 N·m", shaft, 0.0, 1e-9);
}
