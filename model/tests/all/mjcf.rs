//! MJCF as found in the field: classes, degrees, frames, anchors, shapes, and refused files.

use crate::common::{Random, distance};
use freeplay_arm::{Arm, JointKind, Workspace, forward_kinematics, rnea};
use freeplay_model::{ArmFile, Selection, parse_urdf, parse_urdf_selected};

fn read(text: &str) -> ArmFile {
    parse_urdf(text, "arm.xml").unwrap_or_else(|error| panic!("{error}"))
}

/// The same arm in plain form and with the alternative forms that MJCF permits.
const PLAIN: &str = r#"<mujoco model="two"><compiler angle="radian"/><option gravity="0 1 -9"/><worldbody>
<body name="upper" pos="0.1 0 0.5" quat="0.7071067811865476 0 0.7071067811865476 0">
  <joint name="shoulder" axis="0 1 0" range="-1.5707963267948966 1.0471975511965976" armature="0.2" damping="3" frictionloss="1"/>
  <inertial pos="0.2 0 0" mass="4" diaginertia="0.02 0.2 0.2"/>
  <body name="lower" pos="0.4 0 0">
    <joint name="elbow" type="slide" axis="1 0 0" range="0 0.3" armature="0.2" damping="3"/>
    <inertial pos="0 0 0.1" mass="2" fullinertia="0.01 0.02 0.015 0.001 0.002 -0.003"/>
    <site name="tool0" pos="0.25 0 0.1"/>
  </body>
</body></worldbody>
<actuator><motor joint="shoulder" forcerange="-50 60"/></actuator></mujoco>"#;

const DRESSED: &str = r#"<mujoco model="two"><compiler autolimits="true" eulerseq="XYZ"/>
<option gravity="0 1 -9"/>
<default><joint armature="0.2"/><motor ctrlrange="-1 1.2" gear="50"/>
  <default class="arm"><joint damping="3" axis="0 1 0"/>
    <default class="sliding"><joint type="slide" axis="1 0 0"/></default></default></default>
<worldbody><light pos="0 0 3"/><geom type="plane" size="1 1 1"/>
<frame pos="0.1 0 0.2"><body name="upper" pos="0 0 0.3" euler="0 90 0" childclass="arm">
  <joint name="shoulder" range="-90 60" frictionloss="1"/>
  <inertial pos="0.2 0 0" mass="4" fullinertia="0.02 0.2 0.2 0 0 0"/>
  <frame pos="0.4 0 0"><body name="lower">
    <joint class="sliding" name="elbow" range="0 0.3"/>
    <inertial mass="2" pos="0 0 0.1" fullinertia="0.01 0.02 0.015 0.001 0.002 -0.003"/>
    <geom type="mesh" mesh="m"/><site name="tool0" pos="0.25 0 0.1" axisangle="0 0 1 0"/>
  </body></frame>
</body></frame></worldbody>
<actuator><motor joint="shoulder"/></actuator></mujoco>"#;

fn torques(arm: &Arm, [q, v, a]: [&[f64]; 3]) -> Vec<f64> {
    let mut tau = vec![0.0; arm.dof()];
    rnea(arm, &mut Workspace::new(arm), q, v, a, &mut tau);
    tau
}

#[test]
fn classes_degrees_and_frames_mean_what_plain_words_mean() {
    let (plain, dressed) = (read(PLAIN).arm, read(DRESSED).arm);
    assert_eq!(plain.dof(), 2);
    let mut random = Random(1);
    for _ in 0..10 {
        let [q, v, a] = [1.0, 2.0, 3.0].map(|scale| random.values(2, scale));
        let pair = [&plain, &dressed].map(|arm| torques(arm, [&q, &v, &a]));
        assert!(distance(&pair[0], &pair[1]) < 1e-12, "{pair:?}");
        let tools = [&plain, &dressed]
            .map(|arm| forward_kinematics(arm, &mut Workspace::new(arm), &q).translation.vector);
        assert!((tools[0] - tools[1]).norm() < 1e-14);
    }
    for arm in [&plain, &dressed] {
        let [shoulder, elbow] = arm.joints() else { panic!("two joints") };
        assert_eq!((elbow.kind, elbow.limits.upper), (JointKind::Prismatic, 0.3));
        assert!((shoulder.limits.lower + std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert_eq!(
            (shoulder.friction.coulomb, shoulder.friction.viscous, shoulder.rotor_inertia),
            (1.0, 3.0, 0.2)
        );
        assert_eq!(shoulder.limits.effort, 50.0);
        assert_eq!(elbow.limits.effort, f64::INFINITY);
    }
}

/// A pendulum whose joint is anchored off its body's frame, and reads 30° in the model's initial position.
#[test]
fn anchors_and_references_place_the_joint() {
    let text = r#"<mujoco><worldbody><body name="rod" pos="0 0 1">
        <joint name="pin" axis="0 1 0" pos="0 0 0.5" ref="30"/>
        <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.01"/></body></worldbody></mujoco>"#;
    let arm = read(text).arm;
    let tau = |q: f64| torques(&arm, [&[q], &[0.0], &[0.0]])[0];
    // The mass hangs 0.5 m below the pin, straight down at the joint's reading of 30°.
    let hanging = 30.0_f64.to_radians();
    assert!(tau(hanging).abs() < 1e-14);
    let turned = tau(hanging + 0.4);
    assert!((turned - 2.0 * 9.81 * 0.5 * 0.4_f64.sin()).abs() < 1e-12, "{turned}");
    let inertia = torques(&arm, [&[hanging], &[0.0], &[1.0]])[0];
    assert!((inertia - (0.1 + 2.0 * 0.25)).abs() < 1e-14, "{inertia}");
    // The body's frame is a tip of its own, independent of the joint's anchor.
    let tip = Selection { tip: Some("rod".to_owned()), joints: Vec::new() };
    let arm = parse_urdf_selected(text, "arm.xml", &tip).unwrap().arm;
    let tool = forward_kinematics(&arm, &mut Workspace::new(&arm), &[hanging]).translation.vector;
    assert!((tool - nalgebra::Vector3::new(0.0, 0.0, 1.0)).norm() < 1e-15, "{tool}");
}

/// A body without `<inertial>` has the mass of its shapes: moments by integration on a fine grid.
#[test]
fn shapes_weigh_by_their_density() {
    let shapes = [
        ("sphere", "0.1", 0.1, 0.1),
        ("box", "0.1 0.05 0.2", 0.1, 0.2),
        ("ellipsoid", "0.1 0.06 0.15", 0.1, 0.15),
        ("cylinder", "0.08 0.15", 0.08, 0.15),
        ("capsule", "0.05 0.12", 0.05, 0.17),
    ];
    for (kind, size, wide, high) in shapes {
        let sizes: Vec<f64> = size.split(' ').map(|word| word.parse().unwrap()).collect();
        let inside = |p: [f64; 3]| {
            let flat = p[0].hypot(p[1]);
            match kind {
                "sphere" => p.iter().map(|x| x * x).sum::<f64>() < sizes[0] * sizes[0],
                "box" => p.iter().zip(&sizes).all(|(x, half)| x.abs() < *half),
                "ellipsoid" => p.iter().zip(&sizes).map(|(x, half)| (x / half).powi(2)).sum::<f64>() < 1.0,
                "cylinder" => flat < sizes[0] && p[2].abs() < sizes[1],
                _ => flat.hypot((p[2].abs() - sizes[1]).max(0.0)) < sizes[0],
            }
        };
        let (mut mass, mut about_x, mut about_z) = (0.0, 0.0, 0.0);
        let cells = 80;
        let at = |i: i32, most: f64| (f64::from(i) + 0.5) / f64::from(cells) * 2.0 * most - most;
        for (i, j, k) in
            (0..cells).flat_map(|i| (0..cells).flat_map(move |j| (0..cells).map(move |k| (i, j, k))))
        {
            let p = [at(i, wide), at(j, wide), at(k, high)];
            if inside(p) {
                let cell = 500.0 * (2.0 * wide / f64::from(cells)).powi(2) * 2.0 * high / f64::from(cells);
                mass += cell;
                about_x += cell * (p[1] * p[1] + p[2] * p[2]);
                about_z += cell * (p[0] * p[0] + p[1] * p[1]);
            }
        }
        let text = format!(
            r#"<mujoco><default><geom density="500"/></default><worldbody><body><joint name="j" axis="1 0 0"/>
            <geom type="{kind}" size="{size}" pos="0 0 0.3"/></body></worldbody></mujoco>"#
        );
        let inertia = read(&text).arm.joints()[0].inertia;
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < 0.02;
        assert!(close(inertia.mass, mass), "{kind}: {} {mass}", inertia.mass);
        assert!(
            close(inertia.about_com.m11, about_x) && close(inertia.about_com.m33, about_z),
            "{kind}: {inertia:?} {about_x} {about_z}"
        );
        assert!((inertia.com.z - 0.3).abs() < 1e-15);
    }
}

#[test]
fn a_rod_between_two_ends_is_the_rod_at_its_middle() {
    let body = |geom: &str| {
        let text = format!(
            r#"<mujoco><worldbody><body><joint name="j" axis="1 0 0"/><geom type="capsule" {geom}/></body></worldbody></mujoco>"#
        );
        read(&text).arm.joints()[0].inertia
    };
    let (ends, middle) = (
        body(r#"fromto="0 0 0 0.4 0 0" size="0.05""#),
        body(r#"pos="0.2 0 0" zaxis="1 0 0" size="0.05 0.2""#),
    );
    assert!((ends.com - middle.com).norm() < 1e-15 && (ends.about_com - middle.about_com).amax() < 1e-15);
}

#[test]
fn a_gripper_and_things_on_the_table_are_no_part_of_the_arm() {
    let finger = |name: &str| {
        format!(
            r#"<body name="{name}"><joint name="{name}_joint" type="slide" axis="0 1 0" range="0 0.04"/>
        <inertial pos="0 0 0.02" mass="0.05" diaginertia="1e-5 1e-5 1e-5"/></body>"#
        )
    };
    let mut chain = format!(
        r#"<body name="hand" pos="0 0 0.1"><inertial pos="0 0 0" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/>{}{}</body>"#,
        finger("left"),
        finger("right")
    );
    for number in (1..=4).rev() {
        let axis = if number % 2 == 1 { "0 0 1" } else { "0 1 0" };
        chain = format!(
            r#"<body name="link{number}" pos="0 0 0.3"><joint name="j{number}" axis="{axis}" range="-2 2"/>
            <inertial pos="0 0 0.15" mass="2" diaginertia="0.02 0.02 0.002"/>{chain}</body>"#
        );
    }
    let text = format!(
        r#"<mujoco><compiler angle="radian"/><worldbody><body name="cup"><freejoint/><geom size="0.03"/></body>{chain}</worldbody>
        <equality><joint joint1="left_joint" joint2="right_joint"/></equality><tendon><fixed><joint joint="j1" coef="1"/></fixed></tendon></mujoco>"#
    );
    let file = read(&text);
    let names: Vec<&str> = file.arm.joints().iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["j1", "j2", "j3", "j4"], "{:?}", file.ignored);
    let last = file.arm.joints()[3].inertia.mass;
    assert!((last - 2.6).abs() < 1e-12, "the hand with its fingers is a load: {last}");
    assert!(file.ignored.iter().any(|note| note.contains("<tendon> is not used")), "{:?}", file.ignored);
    let tip = Selection { tip: Some("link2".to_owned()), joints: Vec::new() };
    assert_eq!(parse_urdf_selected(&text, "arm.xml", &tip).unwrap().arm.dof(), 2);
}

#[test]
fn a_spring_and_a_damping_beyond_the_linear_are_noted() {
    let text = r#"<mujoco><worldbody><body><joint name="j" stiffness="30" springref="10" damping="1 0.5"/>
        <geom size="0.1" pos="0.2 0 0"/></body></worldbody></mujoco>"#;
    let notes = read(text).ignored;
    assert!(notes.iter().any(|note| note.contains("joint `j`: its spring (stiffness 30)")), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("nonlinear part of its damping")), "{notes:?}");
}

#[test]
fn what_can_not_be_is_refused_with_its_place() {
    let body = |inside: &str| {
        format!("<mujoco>\n<worldbody><body>{inside}<geom size=\"0.1\"/></body></worldbody></mujoco>")
    };
    let cases = [
        (
            "<mujoco>\n<include file=\"panda.xml\"/></mujoco>".to_owned(),
            "arm.xml:2:1: <include> is `panda.xml`",
        ),
        (body("<joint axis=\"0 0 0\"/>"), "an axis needs a direction"),
        (body("<joint type=\"screw\"/>"), "arm.xml:2:31: joint `joint_1`: type is `screw`"),
        (body("<joint range=\"2 1\"/>"), "the first must not be above the second"),
        (body("<joint damping=\"-1\"/>"), "it must not be negative"),
        (body("<joint name=\"a\"/><joint name=\"a\"/>"), "a second joint called `a`"),
        (body("<joint armature=\"1,5\"/>"), "with a decimal point, not a comma"),
        (body("<joint/><inertial pos=\"0 0 0\" diaginertia=\"1 1 1\"/>"), "<inertial mass> is missing"),
        (
            body("<joint/><inertial pos=\"0 0 0\" mass=\"nan\" diaginertia=\"1 1 1\"/>"),
            "write a finite number",
        ),
        ("<mujoco><compiler eulerseq=\"xyq\"/></mujoco>".to_owned(), "write three of x, y, z, X, Y, Z"),
        ("<mujoco><compiler coordinate=\"global\"/></mujoco>".to_owned(), "coordinate=\"local\""),
        ("<mujoco><worldbody/></mujoco>".to_owned(), "no moving joint"),
    ];
    for (text, expected) in cases {
        let error = parse_urdf(&text, "arm.xml").expect_err(&text).to_string();
        assert!(error.contains(expected), "{error}\n{text}");
    }
}

/// A nesting that would overflow the stack of a recursive reader.
#[test]
fn a_file_of_many_bodies_in_each_other_is_read_or_refused() {
    let deep = 3000;
    let text = format!(
        "<mujoco><worldbody>{}{}</worldbody></mujoco>",
        "<body><joint/>".repeat(deep),
        "</body>".repeat(deep)
    );
    assert!(parse_urdf(&text, "deep.xml").is_err());
}
