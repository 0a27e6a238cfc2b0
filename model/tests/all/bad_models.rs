//! Errors of model files contain place, value and remedy.

use freeplay_arm::{Arm, ArmError, Inertia, Joint, JointFriction, JointKind, Limits, Purpose};
use freeplay_model::{ModelError, load, parse_toml, parse_urdf};
use nalgebra::{Isometry3, Matrix3, Unit, UnitQuaternion, Vector3};

const BODY: &str = r#"<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>"#;

/// A robot of one joint: the content of the joint, and that of the moved link.
fn robot(joint: &str, link: &str) -> String {
    format!(
        "<robot name=\"r\">\n<link name=\"base\"/>\n<link name=\"arm\">{link}</link>\n\
         <joint name=\"j\" type=\"revolute\"><parent link=\"base\"/><child link=\"arm\"/>\n{joint}</joint>\n</robot>"
    )
}

/// A robot of two joints, the second one with `parent` and `child`, and one additional element.
fn tree(parent: &str, child: &str, more: &str) -> String {
    format!(
        "<robot>\n<link name=\"a\"/><link name=\"b\">{BODY}</link><link name=\"c\">{BODY}</link>\n\
         <joint name=\"j\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/></joint>\n\
         <joint name=\"k\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint>\n{more}\n</robot>"
    )
}

#[track_caller]
fn refused(text: &str, words: &[&str]) {
    let error = parse_urdf(text, "x.urdf").map(|file| file.arm).expect_err(text).to_string();
    println!("{error}");
    assert!(error.len() < 2000, "an error is short: {} bytes", error.len());
    for word in words {
        assert!(error.contains(word), "`{word}` is not in: {error}\n{text}");
    }
}

#[test]
fn robots_that_work_are_the_base_of_the_bad_ones() {
    assert_eq!(parse_urdf(&robot("", BODY), "x").unwrap().arm.dof(), 1);
    assert_eq!(parse_urdf(&tree("b", "c", ""), "x").unwrap().arm.dof(), 2);
}

#[test]
fn bad_numbers_in_urdf() {
    let body = |mass: &str, ixx: &str| {
        format!("<inertial>\n<mass value=\"{mass}\"/><inertia ixx=\"{ixx}\" iyy=\"1\" izz=\"1\"/></inertial>")
    };
    refused(
        &robot("", &body("1,0", "1")),
        &["x.urdf:4:14:", "<mass value>", "`1,0`", "decimal point", "link `arm`"],
    );
    refused(&robot("", &body("-1", "1")), &["x.urdf:4:14:", "`-1`", "must not be negative"]);
    refused(&robot("", &body("nan", "1")), &["x.urdf:4:14:", "`nan`", "finite"]);
    refused(&robot("", &body("1e999", "1")), &["x.urdf:4:14:", "`1e999`", "finite"]);
    refused(&robot("", &body("", "1")), &["x.urdf:4:14:", "one number"]);
    refused(&robot("", &body("1 2", "1")), &["x.urdf:4:14:", "`1 2`", "one number"]);
    refused(&robot("", &body("1", "heavy")), &["x.urdf:4:32:", "<inertia ixx>", "`heavy`"]);
    refused(&robot("<axis xyz=\"0 0 0\"/>", BODY), &["x.urdf:5:12:", "joint `j`", "`0 0 0`", "direction"]);
    refused(&robot("<axis xyz=\"0 0\"/>", BODY), &["x.urdf:5:12:", "3 numbers"]);
    refused(&robot("<axis xyz=\"0 0 1 0\"/>", BODY), &["x.urdf:5:12:", "3 numbers"]);
    refused(&robot("<origin rpy=\"0 0 pi\"/>", BODY), &["x.urdf:5:14:", "<origin rpy>", "`0 0 pi`"]);
    refused(&robot("<limit lower=\"2\" upper=\"1\"/>", BODY), &["x.urdf:5:15:", "`2`", "above upper", "`1`"]);
}

/// A missing number is an error only in a use that needs it, with link and line; other uses continue.
#[test]
fn masses_are_asked_for_where_they_are_used() {
    let inertial = |ixx: &str| {
        format!("<inertial>\n<mass value=\"1\"/><inertia ixx=\"{ixx}\" iyy=\"1\" izz=\"1\"/></inertial>")
    };
    let cases: [(String, Purpose, &[&str]); 4] = [
        (robot("", ""), Purpose::Torque, &["x.urdf:1:1:", "no moving link of this file has a mass"]),
        (
            robot("", &inertial("-1")),
            Purpose::Torque,
            &["x.urdf:4:18:", "ixx=-1", "semi-definite", "link `arm`"],
        ),
        (
            robot("", "<inertial><mass value=\"1\"/></inertial>"),
            Purpose::Simulation,
            &["x.urdf:4:1:", "link `arm`", "joint `j` moves no inertia", "rotor_inertia"],
        ),
        (robot("", &inertial("1")), Purpose::Simulation, &[]),
    ];
    for (text, fails, words) in cases {
        let file = parse_urdf(&text, "x.urdf").unwrap();
        for purpose in [Purpose::ToolPose, Purpose::Torque, Purpose::Simulation] {
            let found = file.arm.require(purpose);
            assert_eq!(found.is_err(), purpose >= fails && !words.is_empty(), "{text}: {found:?}");
            let Err(shortfall) = found else { continue };
            for word in words {
                assert!(shortfall.to_string().contains(word), "{word}: {shortfall}");
            }
            let said = file.ignored.iter().filter(|note| **note == shortfall.to_string()).count();
            assert_eq!(said, 1, "{:?}", file.ignored);
        }
    }
    let massless = parse_toml(&arm_file("", "").replace("mass = 1", "mass = 0"), "x.toml".as_ref()).unwrap();
    let said = massless.arm.require(Purpose::Simulation).unwrap_err().to_string();
    assert!(said.contains("x.toml:1:1:") && said.contains("has a mass"), "{said}");
}

#[test]
fn missing_things_in_urdf() {
    refused(
        &robot("", "<inertial><inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/></inertial>"),
        &["x.urdf:3:18:", "<mass value>"],
    );
    refused(
        &robot("", "<inertial><mass value=\"1\"/><inertia ixx=\"1\"/></inertial>"),
        &["<inertia iyy>", "missing"],
    );
    refused("<robot/>", &["x.urdf:1:1:", "<link>", "missing"]);
    refused("<robot><link name=\"a\"/></robot>", &["no moving joint"]);
    refused("<robot><link/></robot>", &["x.urdf:1:8:", "attribute `name`"]);
    let joint = |inner: &str| {
        format!("<robot><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" {inner}</joint></robot>")
    };
    refused(&joint("type=\"fixed\"><child link=\"b\"/>"), &["<parent>", "joint `j`", "missing"]);
    refused(&joint("type=\"fixed\"><parent link=\"a\"/>"), &["<child>", "missing"]);
    refused(&joint("type=\"fixed\"><parent/><child link=\"b\"/>"), &["attribute `link`"]);
    refused(&joint("><parent link=\"a\"/><child link=\"b\"/>"), &["attribute `type`"]);
}

#[test]
fn robots_that_are_no_tree() {
    refused(
        &tree("zz", "c", ""),
        &["x.urdf:4:47:", "joint `k`: parent link", "`zz`", "no link of that name"],
    );
    refused(&tree("b", "zz", ""), &["child link", "`zz`"]);
    refused(&tree("a", "b", ""), &["x.urdf:4:1:", "link `b`", "joint `j`", "joint `k`"]);
    refused(&tree("b", "a", ""), &["closed loop"]);
    refused(&tree("c", "c", ""), &["x.urdf:4:1:", "joint `k`", "closed loop"]);
    refused(&tree("b", "c", "<link name=\"b\"/>"), &["x.urdf:5:1:", "second link called `b`"]);
    let twin =
        "<link name=\"d\"/><joint name=\"j\" type=\"fixed\"><parent link=\"c\"/><child link=\"d\"/></joint>";
    refused(&tree("b", "c", twin), &["x.urdf:5:17:", "second joint called `j`"]);
    let text = tree("b", "c", "").replacen("revolute", "spherical", 1);
    refused(&text, &["x.urdf:3:23:", "joint `j`: type", "spherical"]);
}

#[test]
fn too_many_joints() {
    let chain = |joints: usize| {
        let mut text = "<robot><link name=\"l0\"/>".to_owned();
        for i in 1..=joints {
            text += &format!(
                "<link name=\"l{i}\">{BODY}</link><joint name=\"j{i}\" type=\"prismatic\"><parent link=\"l{}\"/><child link=\"l{i}\"/></joint>",
                i - 1
            );
        }
        text + "</robot>"
    };
    assert_eq!(parse_urdf(&chain(64), "x").unwrap().arm.dof(), 64);
    refused(&chain(65), &["65 moving joints", "64 allowed"]);
    refused(&chain(5000), &["5000 moving joints"]);
}

#[test]
fn texts_that_are_no_urdf() {
    refused("", &["x.urdf", "empty"]);
    refused(" \n\t", &["empty"]);
    refused("hello", &["x.urdf:1:1:", "XML"]);
    refused("<robot>\n<link name=\"a\">\n</robot>", &["x.urdf:3:1:", "XML"]);
    refused("<sdf><model/></sdf>", &["x.urdf:1:1:", "`sdf`", "<robot>"]);
    refused("<robot>\n<xacro:macro name=\"m\"/></robot>", &["xacro first"]);
    refused(
        "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n<xacro:arm/></robot>",
        &["x.urdf:2:1:", "<xacro:arm>", "xacro first"],
    );
    refused(&robot("<origin xyz=\"0 0 ${length}\"/>", BODY), &["x.urdf:5:1:", "${length}", "xacro first"]);
    let deep = format!("{}{}", "<a>".repeat(200_000), "</a>".repeat(200_000));
    refused(&deep, &["x.urdf:1:1:"]);
    let bomb = "<!DOCTYPE r [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><robot name=\"&b;\"/>";
    refused(bomb, &["x.urdf:1:", "XML"]);
    refused(&" ".repeat((4 << 20) + 1), &["4 MiB"]);
    // The parser's time grows with the square of the attributes of one element: minutes for these.
    let many: String = (0..300_000).map(|k| format!(" a{k}=''")).collect();
    let comment = "<!-- it's only a line: =".to_owned() + &"=".repeat(2000) + " -->";
    refused(
        &format!("<robot name='r'>\n{comment}<link{many}/></robot>"),
        &["x.urdf:2:", "more than 1000 attributes"],
    );
}

#[test]
fn files_that_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let check = |path: &std::path::Path, words: &str| {
        let error = load(path).map(|file| file.arm).expect_err(words).to_string();
        println!("{error}");
        assert!(error.contains(words), "{error}");
    };
    check(&folder.path().join("none.urdf"), "check the path");
    check(folder.path(), "must end in .urdf, .xml, .mjcf or .toml");
    check(&write("arm.sdf", b"x"), "must end in .urdf, .xml, .mjcf or .toml");
    check(&write("arm.urdf.xacro", b"x"), "run xacro first");
    check(&write("latin.urdf", b"<robot name=\"\xE4\"/>"), "not UTF-8 text from byte 13");
    check(&write("empty.toml", b""), "empty");
    check(&write("huge.xml", &vec![b' '; (4 << 20) + 2]), "4 MiB");
    check(&write("a.toml", b"urdf = \"nowhere.urdf\""), "a.toml:1:8: urdf is `nowhere.urdf`");
    check(&write("b.toml", b"urdf = \"b.toml\""), "name a .urdf, .xml or .mjcf file");
    write("bad.urdf", b"<robot/>");
    check(&write("c.toml", b"urdf = \"bad.urdf\""), "bad.urdf:1:1:");
}

/// An arm file of one joint, with `joint` replacing or adding lines and `more` after it.
fn arm_file(joint: &str, more: &str) -> String {
    format!(
        "[[joint]]\nname = \"j\"\ntype = \"revolute\"\naxis = [0, 0, 1]\nmass = 1\ncom = [1, 0, 0]\n{joint}\n{more}\n"
    )
}

#[track_caller]
fn refused_toml(text: &str, words: &[&str]) {
    let error = parse_toml(text, "x.toml".as_ref()).map(|file| file.arm).expect_err(text).to_string();
    println!("{error}");
    assert!(error.len() < 2000, "an error is short: {} bytes", error.len());
    for word in words {
        assert!(error.contains(word), "`{word}` is not in: {error}\n{text}");
    }
}

#[test]
fn bad_arm_files() {
    assert_eq!(parse_toml(&arm_file("", ""), "x".as_ref()).unwrap().arm.dof(), 1);
    let swap = |old: &str, new: &str| arm_file("", "").replace(old, new);
    refused_toml(" ", &["x.toml", "empty"]);
    refused_toml("name = ", &["x.toml:1:", "^"]);
    refused_toml("name = \"no joints\"", &["x.toml:1:1:", "no moving joint"]);
    refused_toml(&arm_file("colour = 1", ""), &["x.toml:7:1:", "unknown field `colour`", "^"]);
    refused_toml(&arm_file("limits = { lowr = 1 }", ""), &["x.toml:7:12:", "unknown field `lowr`"]);
    refused_toml(&swap("revolute", "floating"), &["x.toml:3:8:", "`floating`", "revolute"]);
    refused_toml(&swap("[0, 0, 1]", "[0, 0, 0]"), &["x.toml:4:8:", "joint `j`: axis", "direction"]);
    refused_toml(&swap("[0, 0, 1]", "[0, 0]"), &["x.toml:4:8:", "^"]);
    refused_toml(&swap("mass = 1", "mass = -1"), &["x.toml:5:8:", "joint `j`: mass", "`-1`", "negative"]);
    refused_toml(&swap("mass = 1", "mass = nan"), &["x.toml:5:8:", "`NaN`", "finite"]);
    refused_toml(&swap("mass = 1", "mass = \"1\""), &["x.toml:5:8:", "^"]);
    refused_toml(&swap("[1, 0, 0]", "[inf, 0, 0]"), &["x.toml:6:7:", "com", "`inf`"]);
    refused_toml(
        &arm_file("inertia = { ixx = -1, iyy = 1, izz = 1 }", ""),
        &["x.toml:7:11:", "positive semi-definite"],
    );
    refused_toml(&arm_file("inertia = { ixx = 1 }", ""), &["x.toml:7:11:", "missing field `iyy`"]);
    refused_toml(&arm_file("limits = { lower = 2, upper = 1 }", ""), &["x.toml:7:20:", "lower ≤ upper"]);
    refused_toml(&arm_file("limits = { effort = 0 }", ""), &["x.toml:7:21:", "effort", "positive"]);
    refused_toml(&arm_file("friction = -2", ""), &["x.toml:7:12:", "friction", "`-2`"]);
    refused_toml(&arm_file("rotor_inertia = -2", ""), &["x.toml:7:17:", "rotor_inertia", "`-2`"]);
    refused_toml(&arm_file("origin = { rpy = [0, 0, nan] }", ""), &["x.toml:7:10:", "origin", "finite"]);
    refused_toml(&arm_file("origin = { quaternion = [0, 0, 0, 2] }", ""), &["x.toml:7:10:", "length 2"]);
    let both = "origin = { quaternion = [0, 0, 0, 1], rpy = [0, 0, 0] }";
    refused_toml(&arm_file(both, ""), &["x.toml:7:10:", "one of the two"]);
    refused_toml(&arm_file("", "[[effect]]\njoint = \"j\""), &["x.toml:8:1:", "effect: kind", "missing"]);
    refused_toml(&arm_file("", "[[effect]]\nkind = 3"), &["x.toml:8:1:", "effect: kind", "`3`"]);
    refused_toml(
        &arm_file("", "[[effect]]\nkind = \"k\"\njoint = \"elbow\""),
        &["x.toml:8:", "`elbow`", "the arm has j"],
    );
    refused_toml(&arm_file("", arm_file("", "").as_str()), &["x.toml:", "two joints are called `j`"]);
    refused_toml(
        &format!("urdf = \"a.urdf\"\n{}", arm_file("", "")),
        &["x.toml:2:1:", "either `urdf` or [[joint]]"],
    );
    refused_toml(&format!("gravity = [0, 0, nan]\n{}", arm_file("", "")), &["x.toml:1:11:", "gravity"]);
    refused_toml(&format!("urdf = {:?}", "x".repeat(100_000)), &["x.toml:1:8:"]);
    refused_toml(&format!("a = {}{}", "[".repeat(100_000), "]".repeat(100_000)), &["x.toml:1:"]);
}

fn joint(name: &str) -> Joint {
    Joint {
        name: name.to_owned(),
        kind: JointKind::Revolute,
        axis: Vector3::z_axis(),
        placement: Isometry3::identity(),
        limits: Limits::NONE,
        friction: JointFriction::default(),
        rotor_inertia: 0.0,
        inertia: Inertia { mass: 1.0, com: Vector3::x(), about_com: Matrix3::identity() },
    }
}

fn new_arm(joints: Vec<Joint>) -> Result<Arm, ArmError> {
    Arm::new("a", joints, Isometry3::identity(), Vector3::new(0.0, 0.0, -9.81))
}

#[test]
fn arms_that_cannot_be() {
    assert!(new_arm(vec![joint("a"), joint("b")]).is_ok());
    assert_eq!(new_arm(vec![]).unwrap_err(), ArmError::NoJoints);
    assert_eq!(
        new_arm(vec![joint("a"), joint("a")]).unwrap_err(),
        ArmError::DuplicateName { name: "a".to_owned() }
    );
    assert_eq!(new_arm(vec![joint("")]).unwrap_err(), ArmError::EmptyName { number: 1 });
    let spoiled: [fn(&mut Joint); 9] = [
        |j| j.inertia.mass = -1.0,
        |j| j.inertia.mass = f64::NAN,
        |j| j.inertia.com.x = f64::INFINITY,
        |j| j.inertia.about_com.m11 = -1.0,
        |j| j.inertia.about_com.m12 = 0.5,
        |j| j.axis = Unit::new_unchecked(Vector3::new(0.0, 0.0, 2.0)),
        |j| {
            j.placement.rotation =
                UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(2.0, 0.0, 0.0, 0.0))
        },
        |j| j.limits.velocity = 0.0,
        |j| j.friction.viscous = -1.0,
    ];
    for spoil in spoiled {
        let mut bad = joint("bad");
        spoil(&mut bad);
        let error = new_arm(vec![joint("a"), bad]).unwrap_err();
        println!("{error}");
        assert!(matches!(&error, ArmError::Value { joint: Some(name), .. } if name == "bad"));
    }
    let gravity = Arm::new("a", vec![joint("a")], Isometry3::identity(), Vector3::new(0.0, 0.0, f64::NAN));
    assert!(matches!(gravity.unwrap_err(), ArmError::Value { joint: None, .. }));
    let error = new_arm(vec![joint("a")]).unwrap().with_joint_inserted_before(1, joint("b")).unwrap_err();
    assert_eq!(error, ArmError::NoSuchJoint { index: 1, dof: 1 });
}

/// The check refuses a joint only if nothing resists it: neither a massless link, nor inertia on the axis, nor a distal joint in line is
/// enough.
#[test]
fn joints_that_move_no_inertia_are_named() {
    let massless = |name: &str| Joint { inertia: Inertia::zero(), ..joint(name) };
    let named = |joints: Vec<Joint>| match new_arm(joints) {
        Err(ArmError::MovesNoInertia { name, .. }) => Some(name),
        Ok(_) => None,
        Err(other) => panic!("{other}"),
    };
    assert_eq!(named(vec![joint("a"), massless("b")]), Some("b".to_owned()));
    assert_eq!(
        named(vec![massless("a"), joint("b")]),
        Some("a".to_owned()),
        "b turns freely about the same axis"
    );
    let mut across = massless("a");
    across.axis = Vector3::x_axis();
    assert_eq!(named(vec![across, joint("b")]), None);
    let mut on_axis = joint("b");
    on_axis.inertia = Inertia { mass: 1.0, com: Vector3::new(0.0, 0.0, 0.7), about_com: Matrix3::zeros() };
    assert_eq!(named(vec![joint("a"), on_axis]), Some("b".to_owned()));
    let mut slide = massless("a");
    slide.kind = JointKind::Prismatic;
    assert_eq!(named(vec![slide, joint("b")]), None);
}

#[test]
fn errors_carry_their_place_as_data() {
    let error = parse_urdf(&robot("<axis xyz=\"0 0 0\"/>", BODY), "x.urdf").unwrap_err();
    let ModelError::Value { at, value, .. } = error else { panic!("{error}") };
    assert_eq!((at.line, at.column, value.as_str()), (5, 12, "0 0 0"));
}
