//! Model files: URDF as found in the field, arm files, and round trips through both.

use crate::common::{Random, close, distance, size};
use freeplay_arm::{Arm, JointKind, Workspace, aba, forward_kinematics, gravity_torque, rnea};
use freeplay_model::{ArmFile, load, paper_arm, parse_toml, parse_urdf, to_toml};
use nalgebra::{Matrix3, Vector3};

/// Bits of the inverse dynamics and of the tool pose in a few states.
fn fingerprint(arm: &Arm) -> Vec<u64> {
    let mut random = Random(5);
    let mut ws = Workspace::new(arm);
    let n = arm.dof();
    let mut bits = Vec::new();
    for _ in 0..5 {
        let (q, v, a) = (random.values(n, 3.0), random.values(n, 2.0), random.values(n, 5.0));
        let mut tau = vec![0.0; n];
        rnea(arm, &mut ws, &q, &v, &a, &mut tau);
        let tool = forward_kinematics(arm, &mut ws, &q);
        let pose =
            tool.translation.vector.iter().chain(tool.rotation.coords.iter()).copied().collect::<Vec<_>>();
        bits.extend(tau.iter().chain(&pose).map(|x| x.to_bits()));
    }
    bits
}

fn read_back(file: &ArmFile) -> ArmFile {
    let text = to_toml(file);
    parse_toml(&text, "written.toml".as_ref()).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The contents that must survive a round trip, besides the bits of the dynamics.
fn assert_same(a: &ArmFile, b: &ArmFile) {
    assert_eq!(fingerprint(&a.arm), fingerprint(&b.arm));
    assert_eq!(a.arm.name(), b.arm.name());
    assert_eq!(a.arm.joints(), b.arm.joints());
    assert_eq!(a.arm.tool(), b.arm.tool());
    let effects = |file: &ArmFile| -> Vec<_> {
        file.effects.iter().map(|e| (e.kind.clone(), e.joint.clone(), e.parameters.clone())).collect()
    };
    assert_eq!(effects(a), effects(b));
}

#[test]
fn arms_of_real_recordings_load_and_survive_writing() {
    let Some(folder) = freeplay_skip::recordings() else { return };
    let expected = [
        ("brfd_backlash/damper.urdf", 1, "damper"),
        ("dfki_double_pendulum/double_pendulum_C1.urdf", 2, "joint_1"),
        ("emps/emps.urdf", 1, "carriage"),
        ("kuka_kr300/kr300_r2500_payload150.urdf", 6, "joint_1"),
        ("kuka_lwr4/kuka_lwr4.urdf", 7, "lwr_0_joint"),
    ];
    for (path, dof, first) in expected {
        let file = load(&folder.join(path)).unwrap();
        println!("{path}: {:?}", file.ignored);
        assert_eq!((file.arm.dof(), file.arm.joints()[0].name.as_str()), (dof, first), "{path}");
        assert_same(&file, &read_back(&file));
        let lost = round_trip_loss(&file.arm);
        println!("  aba(rnea(a)) - a: {lost:.1e} of the largest");
        // The last link of the KR 300 has 168 kg and 1e-9 kg·m² about its axis: 17 kg·m² cancel down to this.
        assert!(lost < if path.contains("kr300") { 1e-4 } else { 1e-12 });
    }
}

/// Largest error of the accelerations from forward dynamics in a round trip, over the largest acceleration.
fn round_trip_loss(arm: &Arm) -> f64 {
    let mut random = Random(9);
    let mut ws = Workspace::new(arm);
    let n = arm.dof();
    let (q, v, a) = (random.values(n, 2.0), random.values(n, 1.0), random.values(n, 3.0));
    let (mut tau, mut back) = (vec![0.0; n], vec![0.0; n]);
    rnea(arm, &mut ws, &q, &v, &a, &mut tau);
    aba(arm, &mut ws, &q, &v, &tau, &mut back);
    distance(&back, &a) / size(&a)
}

/// The KUKA LWR 4+: its base stands on a box, by a joint with two origins; the first one counts.
#[test]
fn fixed_joints_below_the_first_moving_one_fold_into_the_base() {
    let Some(folder) = freeplay_skip::recordings() else { return };
    let file = load(&folder.join("kuka_lwr4/kuka_lwr4.urdf")).unwrap();
    let arm = &file.arm;
    let mut ws = Workspace::new(arm);
    let tool = forward_kinematics(arm, &mut ws, &[0.0; 7]);
    let height = 1.0 + 0.11 + 0.2005 + 0.2 + 0.2 + 0.2 + 0.19 + 0.078;
    close("tool at zero", (tool.translation.vector - Vector3::new(-0.25, 0.0, height)).norm(), 1e-14);
    assert_eq!(arm.joints()[1].axis.into_inner(), Vector3::new(0.0, -1.0, 0.0));
    assert_eq!(arm.joints()[0].friction.viscous, 1.0);
    assert_eq!(arm.joints()[0].friction.coulomb, 0.5);
    assert_eq!(arm.joints()[6].limits.effort, 38.0);
    assert!(file.ignored.iter().any(|note| note.contains("2 <origin>")), "{:?}", file.ignored);
    // A vertical axis carries no weight.
    let mut tau = vec![0.0; 7];
    gravity_torque(arm, &mut ws, &[0.5; 7], &mut tau);
    assert!(size(&tau) > 0.1);
    close("torque about the vertical", tau[0].abs(), 1e-12);
}

/// A robot with all variants found in the field: any order, fixed links before, between and behind, a gripper, a mimic joint, comments.
const FIELD: &str = r#"<?xml version="1.0"?>
<!-- made by hand -->
<robot name="field" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <joint name="finger" type="prismatic"><parent link="hand"/><child link="finger_left"/><origin xyz="0 0.02 0.1"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="20" velocity="0.1"/></joint>
  <joint name="finger_mirror" type="prismatic"><parent link="hand"/><child link="finger_right"/><origin xyz="0 -0.02 0.1"/>
    <axis xyz="0 -1 0"/><mimic joint="finger"/></joint>
  <joint name="turn" type="continuous"><parent link="pedestal"/><child link="arm_link"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 0 2"/><limit effort="10" velocity="3" lower="-1" upper="1"/><dynamics damping="0.1" friction="0.2"/>
    <safety_controller k_velocity="1"/></joint>
  <joint name="lift" type="revolute"><parent link="bracket"/><child link="hand"/><origin xyz="0 0 0.1" rpy="0 0.5 0"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2"/></joint>
  <joint name="on_floor" type="fixed"><parent link="floor"/><child link="pedestal"/><origin xyz="1 2 0.1"/></joint>
  <joint name="bolted" type="fixed"><parent link="arm_link"/><child link="bracket"/><origin xyz="0.3 0 0" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="to_tool" type="fixed"><parent link="hand"/><child link="tool0"/><origin xyz="0 0 0.15"/></joint>
  <link name="tool0"/>
  <link name="finger_left"><inertial><mass value="0.1"/><inertia ixx="0" iyy="0" izz="0"/></inertial></link>
  <link name="finger_right"><inertial><mass value="0.1"/><inertia ixx="0" iyy="0" izz="0"/></inertial></link>
  <link name="floor"/>
  <link name="pedestal"><inertial><mass value="50"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <link name="arm_link"><visual><geometry><mesh filename="package://x/y.stl"/></geometry></visual>
    <inertial><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.025"/></inertial></link>
  <link name="bracket"><inertial><mass value="1"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.0025"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0 0 0.05"/><mass value="0.8"/><inertia ixx="0.001" iyy="0.001" izz="0.001"/></inertial></link>
  <transmission name="t"><joint name="turn"/></transmission>
</robot>"#;

#[test]
fn the_chain_to_tool0_carries_everything_fixed_to_it() {
    let file = parse_urdf(FIELD, "field.urdf").unwrap();
    let arm = &file.arm;
    for note in &file.ignored {
        println!("{note}");
    }
    let [turn, lift] = arm.joints() else { panic!("two joints move the tool") };
    assert_eq!((turn.name.as_str(), lift.name.as_str()), ("turn", "lift"));
    assert_eq!((turn.kind, lift.kind), (JointKind::Revolute, JointKind::Revolute));
    assert_eq!(turn.axis.into_inner(), Vector3::z());
    assert_eq!(turn.placement.translation.vector, Vector3::new(1.0, 2.0, 0.5));
    assert_eq!((turn.limits.lower, turn.limits.upper), (f64::NEG_INFINITY, f64::INFINITY));
    assert_eq!((lift.limits.effort, lift.limits.velocity), (f64::INFINITY, f64::INFINITY));
    assert_eq!(arm.tool().translation.vector, Vector3::new(0.0, 0.0, 0.15));

    // The first link: 2 kg at (0.1, 0, 0) rotated by 90°, and the bracket's 1 kg at (0.3, 0, 0), also rotated.
    close("mass", (turn.inertia.mass - 3.0).abs(), 1e-15);
    close("centre of mass", (turn.inertia.com - Vector3::new(0.5 / 3.0, 0.0, 0.0)).norm(), 1e-15);
    let apart = 2.0 * 1.0 / 3.0 * 0.2 * 0.2;
    let expected = Matrix3::from_diagonal(&Vector3::new(0.02 + 0.002, 0.01 + 0.001 + apart, 0.0275 + apart));
    close("inertia", (turn.inertia.about_com - expected).norm(), 1e-15);
    // The hand and both fingers.
    close("mass of the hand", (lift.inertia.mass - 1.0).abs(), 1e-15);
    close("its centre", (lift.inertia.com - Vector3::new(0.0, 0.0, (0.04 + 0.02) / 1.0)).norm(), 1e-15);

    let noted = |words: &str| file.ignored.iter().any(|note| note.contains(words));
    assert!(noted(
        "arm: floor → tool0, 2 joints; the gripper's 2 joints held still (`finger`, `finger_mirror`)"
    ));
    assert!(!noted("`tool0`") && noted("<transmission>"), "a frame needs no mass");
    assert_same(&file, &read_back(&file));
}

#[test]
fn without_tool0_the_longest_chain_is_taken() {
    let link = |name: &str| {
        format!(
            r#"<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>"#
        )
    };
    let joint = |name: &str, parent: &str, child: &str, kind: &str| {
        format!(
            r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 1"/></joint>"#
        )
    };
    let text = format!(
        "<robot name=\"r\">{}{}{}{}{}</robot>",
        ["base", "head", "arm", "hand", "camera"].map(link).concat(),
        joint("neck", "base", "head", "revolute"),
        joint("shoulder", "base", "arm", "revolute"),
        joint("wrist", "arm", "hand", "revolute"),
        joint("mount", "hand", "camera", "fixed"),
    );
    let file = parse_urdf(&text, "r.urdf").unwrap();
    let names: Vec<_> = file.arm.joints().iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["shoulder", "wrist"]);
    assert_eq!(file.arm.joints()[1].inertia.mass, 2.0);
    assert_eq!(file.arm.tool().translation.vector, Vector3::zeros(), "the frame of the last moving link");
    assert!(file.ignored.iter().any(|note| note.contains("`neck`")));
}

#[test]
fn placeholders_of_exporters_are_read_as_none() {
    let text = r#"<robot><link name="a"/><link name="b"><inertial><mass value="1"/>
        <inertia ixx="1" iyy="1" izz="9"/></inertial></link>
        <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
        <limit lower="0" upper="0" effort="0" velocity="0"/></joint></robot>"#;
    let file = parse_urdf(text, "cad.urdf").unwrap();
    assert_eq!(file.arm.joints()[0].limits, freeplay_arm::Limits::NONE);
    assert_eq!(file.ignored.len(), 5, "{:?}", file.ignored);
    assert!(file.ignored.iter().any(|note| note.contains("triangle inequality")));
}

#[test]
fn the_arm_of_the_paper_is_complete() {
    let file = paper_arm();
    assert_eq!(file.arm.dof(), 6);
    let mass: f64 = file.arm.joints().iter().map(|joint| joint.inertia.mass).sum();
    close("total mass", (mass - 127.68).abs(), 1e-12);
    for joint in file.arm.joints() {
        let l = joint.limits;
        assert!([l.lower, l.upper, l.velocity, l.acceleration, l.effort].iter().all(|x| x.is_finite()));
        assert!(joint.inertia.triangle_excess() <= 0.0, "{} can exist", joint.name);
    }
    assert!(file.effects.is_empty() && file.ignored.is_empty());
    assert_same(&file, &read_back(&file));
}

#[test]
fn random_arms_read_back_bit_by_bit() {
    for dof in 1..=12 {
        let mut random = Random(300 + dof as u64);
        let mut file =
            ArmFile { arm: random.arm(dof), effects: Vec::new(), ignored: vec!["one\ntwo\u{7f}".to_owned()] };
        file.arm = file.arm.with_gravity(random.vector());
        let back = read_back(&file);
        assert_same(&file, &back);
        assert_eq!(file.arm.gravity(), back.arm.gravity());
    }
}

const EFFECTS: &str = r#"
name = "with \"effects\""
gravity = [0, 0.1, -9.8]

[[joint]]
name = "elbow"
type = "revolute"
axis = [0, 3, 4]
mass = 1
com = [1, 0, 0]

[[effect]]
kind = "coulomb_friction"
joint = "elbow"
coulomb = 9.1

[[effect]]
kind = "payload"
mass = 2
com = [0.0, 0.1, 0.2]
fit = { by = "hand", steps = [1, 2] }
"#;

#[test]
fn effects_are_kept_as_they_stand() {
    let file = parse_toml(EFFECTS, "effects.toml".as_ref()).unwrap();
    assert_eq!(file.arm.joints()[0].axis.into_inner(), Vector3::new(0.0, 0.6, 0.8));
    let [coulomb, payload] = file.effects.as_slice() else { panic!("two effects") };
    assert_eq!(
        (coulomb.kind.as_str(), coulomb.joint.as_deref(), coulomb.line),
        ("coulomb_friction", Some("elbow"), 12)
    );
    assert_eq!(coulomb.parameters["coulomb"].as_float(), Some(9.1));
    assert_eq!((payload.joint.as_deref(), payload.line), (None, 17));
    assert_eq!(payload.parameters["fit"]["by"].as_str(), Some("hand"));
    assert_same(&file, &read_back(&file));
}

#[test]
fn an_arm_file_may_stand_on_a_urdf_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("urdf")).unwrap();
    std::fs::write(folder.path().join("urdf/field.urdf"), FIELD).unwrap();
    let text = "urdf = \"urdf/field.urdf\"\ngravity = [0, 0, -1.62]\n[tool]\nxyz = [0, 0, 1]\n[[effect]]\nkind = \"x\"\n";
    let path = folder.path().join("arm.toml");
    std::fs::write(&path, text).unwrap();
    let file = load(&path).unwrap();
    assert_eq!((file.arm.name(), file.arm.dof(), file.effects.len()), ("field", 2, 1));
    assert_eq!(file.arm.gravity().z, -1.62);
    assert_eq!(file.arm.tool().translation.vector, Vector3::z());
    let plain = load(&folder.path().join("urdf/field.urdf")).unwrap();
    assert_eq!(plain.arm.joints(), file.arm.joints());
    assert_eq!(plain.ignored, file.ignored);
    assert!(distance(plain.arm.gravity().as_slice(), &[0.0, 0.0, -9.81]) == 0.0);
}
