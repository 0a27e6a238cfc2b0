//! Arms survive a round trip through URDF and MJCF.

use crate::common::{Random, distance};
use freeplay_arm::{Arm, Joint, Limits, Workspace, forward_kinematics, rnea};
use freeplay_model::export::{Channel, Element, Exported, Mechanism, Named, to_mjcf, to_urdf};
use freeplay_model::parse_urdf;
use nalgebra::{Isometry3, Vector3};

fn plain(arm: Arm) -> Mechanism {
    Mechanism { arm, elements: Vec::new(), not_expressed: Vec::new() }
}

fn with(arm: Arm, elements: &[Element]) -> Mechanism {
    let named = elements.iter().map(|&element| Named { name: format!("{element:?}"), element });
    Mechanism { elements: named.collect(), ..plain(arm) }
}

/// Random arms of one to eight revolute and prismatic joints, under gravity of 9.81 m/s² from any direction.
fn arms() -> impl Iterator<Item = Arm> {
    let mut random = Random(41);
    (0..60).map(move |number| {
        let arm = random.arm(1 + number % 8);
        let gravity = if number % 5 == 0 { -Vector3::z() } else { random.vector().normalize() };
        arm.with_gravity(gravity * 9.81)
    })
}

/// Largest difference of the inverse dynamics of two arms, over the largest torque.
fn difference(a: &Arm, b: &Arm, random: &mut Random) -> f64 {
    let dof = a.dof();
    let (mut first, mut second) = (Workspace::new(a), Workspace::new(b));
    let (mut tau_a, mut tau_b) = (vec![0.0; dof], vec![0.0; dof]);
    let mut worst = 0.0_f64;
    for _ in 0..20 {
        let (q, v, acc) = (random.values(dof, 3.0), random.values(dof, 2.0), random.values(dof, 5.0));
        rnea(a, &mut first, &q, &v, &acc, &mut tau_a);
        rnea(b, &mut second, &q, &v, &acc, &mut tau_b);
        let most = tau_a.iter().fold(1.0_f64, |most, tau| most.max(tau.abs()));
        worst = worst.max(distance(&tau_a, &tau_b) / most);
    }
    worst
}

/// `arm` without its rotors: URDF has none.
fn without_rotors(arm: &Arm) -> Arm {
    let joints = arm.joints().iter().map(|joint| Joint { rotor_inertia: 0.0, ..joint.clone() }).collect();
    Arm::new(arm.name(), joints, *arm.tool(), *arm.gravity()).unwrap()
}

#[test]
fn a_urdf_of_any_arm_reads_back_to_the_same_dynamics() {
    let mut random = Random(7);
    let mut worst = 0.0_f64;
    for arm in arms().map(|arm| without_rotors(&arm)) {
        let Exported { text, not_expressed } = to_urdf(&plain(arm.clone()));
        assert!(not_expressed.is_empty(), "{not_expressed:?}");
        let back = parse_urdf(&text, "arm.urdf").unwrap_or_else(|error| panic!("{error}\n{text}")).arm;
        worst = worst.max(difference(&arm, &back, &mut random));
    }
    println!("worst difference {worst:e}");
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn an_mjcf_of_any_arm_reads_back_to_the_same_dynamics_and_tool() {
    let mut random = Random(8);
    let (mut worst, mut tool) = (0.0_f64, 0.0_f64);
    for arm in arms() {
        let Exported { text, not_expressed } = to_mjcf(&plain(arm.clone()));
        assert!(not_expressed.is_empty(), "{not_expressed:?}");
        let back = parse_urdf(&text, "arm.xml").unwrap_or_else(|error| panic!("{error}\n{text}")).arm;
        worst = worst.max(difference(&arm, &back, &mut random));
        let q = random.values(arm.dof(), 3.0);
        let pose = |arm: &Arm| forward_kinematics(arm, &mut Workspace::new(arm), &q);
        let apart: Isometry3<f64> = pose(&arm).inverse() * pose(&back);
        tool = tool.max(apart.translation.vector.norm()).max(apart.rotation.angle());
        assert_eq!(back.gravity(), arm.gravity());
    }
    println!("worst difference {worst:e}, tool {tool:e}");
    assert!(worst < 1e-12 && tool < 1e-12, "{worst:e} {tool:e}");
}

#[test]
fn names_of_the_model_stand_and_those_of_the_file_give_way() {
    let mut random = Random(3);
    let names = ["base", "tool0_fixed", "world", "a<b & \"c\"", "base_link"];
    let joints = names.map(|name| Joint { name: name.to_owned(), rotor_inertia: 0.0, ..random.joint(1) });
    let arm = Arm::new("odd", joints.into(), Isometry3::identity(), Vector3::new(9.81, 0.0, 0.0)).unwrap();
    for exported in [to_urdf(&plain(arm.clone())), to_mjcf(&plain(arm.clone()))] {
        let back = parse_urdf(&exported.text, "odd")
            .unwrap_or_else(|error| panic!("{error}\n{}", exported.text))
            .arm;
        let read: Vec<&str> = back.joints().iter().map(|joint| joint.name.as_str()).collect();
        assert_eq!(read, names);
        assert!(difference(&arm, &back, &mut random) < 1e-12);
    }
}

#[test]
fn friction_limits_and_zeros_are_in_both_formats() {
    let mut random = Random(5);
    let limits = Limits { lower: -2.0, upper: 1.5, velocity: 3.0, acceleration: f64::INFINITY, effort: 90.0 };
    let joints = (1..=3).map(|number| Joint { limits, rotor_inertia: 0.0, ..random.joint(number) }).collect();
    let arm = Arm::new("three", joints, Isometry3::identity(), Vector3::new(0.0, 0.0, -9.81)).unwrap();
    let elements = [
        Element::DryFriction { joint: 0, level: 4.0 },
        Element::Damping { joint: 1, linear: 0.7, quadratic: 0.0 },
        Element::TorqueLimit { joint: 2, limit: 55.0 },
        Element::EncoderZero { joint: 1, offset: 0.25 },
    ];
    let mechanism = with(arm.clone(), &elements);
    for exported in [to_urdf(&mechanism), to_mjcf(&mechanism)] {
        assert!(exported.not_expressed.is_empty(), "{:?}", exported.not_expressed);
        let back = parse_urdf(&exported.text, "three").unwrap().arm;
        let joints = back.joints();
        assert_eq!([joints[0].friction.coulomb, joints[1].friction.viscous], [4.0, 0.7]);
        assert_eq!([joints[0].limits.effort, joints[2].limits.effort], [90.0, 55.0]);
        assert_eq!([joints[1].limits.lower, joints[1].limits.upper], [-2.0, 1.5]);
        // At the encoder's reading of 0.25, the joint is at its zero.
        let at = |arm: &Arm, q: f64| forward_kinematics(arm, &mut Workspace::new(arm), &[0.3, q, 0.1]);
        let apart = at(&arm, 0.0).inverse() * at(&back, 0.25);
        assert!(apart.translation.vector.norm() < 1e-14 && apart.rotation.angle() < 1e-7, "{apart}");
    }
}

#[test]
fn a_servo_is_an_actuator_whose_control_is_the_position() {
    let mut random = Random(9);
    let joints = (1..=2).map(|number| Joint { rotor_inertia: 0.0, ..random.joint(number) }).collect();
    let arm = Arm::new("two", joints, Isometry3::identity(), Vector3::new(0.0, 0.0, -9.81)).unwrap();
    let elements = [
        Element::Servo { joint: 1, stiffness: 40.0, damping: 1.5, offset: 0.01, limit: 3.0 },
        Element::CommandDelay { joint: 1, delay: 0.0125 },
    ];
    let mechanism = with(arm, &elements);
    let exported = to_mjcf(&mechanism);
    assert!(exported.not_expressed.is_empty(), "{:?}", exported.not_expressed);
    let document = roxmltree::Document::parse(&exported.text).unwrap();
    let servo = document.descendants().find(|node| node.has_tag_name("general")).expect("an actuator");
    let said =
        ["joint", "gainprm", "biasprm", "forcerange", "delay", "nsample"].map(|name| servo.attribute(name));
    assert_eq!(said, ["joint_2", "40", "0.4 -40 -1.5", "-3 3", "0.0125", "15"].map(Some));
    assert_eq!(to_urdf(&mechanism).not_expressed.len(), 2);
}

#[test]
fn what_a_format_has_no_words_for_is_listed_in_the_file() {
    let mut random = Random(6);
    let arm = random.arm(3).with_gravity(Vector3::new(0.0, 0.0, -1.62));
    let elements = [
        Element::Spring { joint: 0, stiffness: 5.0, rest: 0.1 },
        Element::Gear { joint: 1, stiffness: Some(1e4), damping: 1.0, gap: 0.001, friction: 0.0 },
        Element::Delay { channel: Channel::Torque, delay: 0.002 },
        Element::TorqueGain { joint: 2, gain: 0.9 },
    ];
    let mechanism = Mechanism { not_expressed: vec!["stick--slip".to_owned()], ..with(arm, &elements) };
    let urdf = to_urdf(&mechanism);
    for word in ["stick--slip", "Spring", "Gear", "Delay", "TorqueGain", "gravity of 1.62", "rotor inertia"] {
        assert!(
            urdf.not_expressed.iter().any(|line| line.contains(word)),
            "{word}: {:?}",
            urdf.not_expressed
        );
    }
    let mjcf = to_mjcf(&mechanism);
    assert!(
        mjcf.not_expressed.iter().any(|line| line.contains("needs one, and the file has"))
            == (mechanism.arm.joints()[1].rotor_inertia == 0.0)
    );
    for exported in [urdf, mjcf] {
        let comment = roxmltree::Document::parse(&exported.text).unwrap();
        let comment =
            comment.root().children().find(|node| node.is_comment()).and_then(|node| node.text()).unwrap();
        for line in &exported.not_expressed {
            assert!(comment.contains(&line.replace("--", "- -")), "{line}");
        }
    }
}
