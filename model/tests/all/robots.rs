//! Robots from the field: the chain that is the arm, the treatment of the other links, and the notes on implausible numbers.

use std::fmt::Write as _;

use freeplay_arm::{Purpose, Workspace, forward_kinematics};
use freeplay_model::{ArmFile, ModelError, Selection, load, parse_toml, parse_urdf, parse_urdf_selected};

/// A URDF, built link by link.
#[derive(Clone, Default)]
struct Robot(String);

/// A mass like that of a rod of 0.3 m.
const ROD: &str = r#"<inertial><origin xyz="0 0 0.15"/><mass value="2"/><inertia ixx="0.015" iyy="0.015" izz="0.002"/></inertial>"#;
/// A mass like that of a finger.
const TIP: &str = r#"<inertial><origin xyz="0 0 0.02"/><mass value="0.1"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5"/></inertial>"#;

impl Robot {
    fn new(root: &str) -> Self {
        Self(format!("<link name=\"{root}\"/>\n"))
    }

    /// Adds a joint with its child, which has the mass `inertial`; `more` is the content of the joint's element.
    fn joint(mut self, parent: &str, [name, kind, child]: [&str; 3], inertial: &str, more: &str) -> Self {
        let _ = writeln!(
            self.0,
            "<link name=\"{child}\">{inertial}</link>\n<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/>\
             <child link=\"{child}\"/>{more}</joint>"
        );
        self
    }

    /// Adds a chain of `count` revolute joints `PREFIX1`… with links `PREFIXlink1`…, alternating axes, links of `length`.
    fn chain(mut self, parent: &str, prefix: &str, count: usize, length: f64) -> Self {
        let mut before = parent.to_owned();
        for number in 1..=count {
            let [name, child] = [format!("{prefix}{number}"), format!("{prefix}link{number}")];
            let axis = if number % 2 == 1 { "0 0 1" } else { "0 1 0" };
            let more = format!(
                "<origin xyz=\"0 0 {length}\"/><axis xyz=\"{axis}\"/><limit lower=\"-2\" upper=\"2\" effort=\"300\" velocity=\"3\"/>"
            );
            self = self.joint(&before, [&name, "revolute", &child], ROD, &more);
            before = child;
        }
        self
    }

    fn hand(self, parent: &str, name: &str) -> Self {
        self.joint(parent, [&format!("{name}_mount"), "fixed", name], TIP, "<origin xyz=\"0 0 0.1\"/>")
    }

    /// Adds a finger of `count` joints on `hand`; they follow `leader`, if there is one.
    fn finger(mut self, hand: &str, prefix: &str, count: usize, leader: Option<&str>) -> Self {
        let mimic = leader
            .map_or_else(String::new, |leader| format!("<mimic joint=\"{leader}\" multiplier=\"-1\"/>"));
        let mut before = hand.to_owned();
        for number in 1..=count {
            let [name, child] = [format!("{prefix}{number}"), format!("{prefix}link{number}")];
            let more = format!(
                "<origin xyz=\"0 0.01 0.03\"/><axis xyz=\"1 0 0\"/><limit lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/>{mimic}"
            );
            self = self.joint(&before, [&name, "revolute", &child], TIP, &more);
            before = child;
        }
        self
    }

    fn text(&self) -> String {
        format!("<robot name=\"made\">\n{}</robot>", self.0)
    }

    #[track_caller]
    fn load(&self) -> ArmFile {
        self.choose(&Selection::default()).unwrap()
    }

    fn choose(&self, selection: &Selection) -> Result<ArmFile, ModelError> {
        parse_urdf_selected(&self.text(), "made.urdf", selection)
    }
}

fn names(file: &ArmFile) -> Vec<&str> {
    file.arm.joints().iter().map(|joint| joint.name.as_str()).collect()
}

fn numbered(prefix: &str, count: usize) -> Vec<String> {
    (1..=count).map(|number| format!("{prefix}{number}")).collect()
}

#[track_caller]
fn noted(file: &ArmFile, words: &str) {
    assert!(file.ignored.iter().any(|note| note.contains(words)), "{words}: {:#?}", file.ignored);
}

/// The frame between the jaws, or the name of the jaw, identifies a gripper with one jaw that moves against the last link; a wrist has
/// neither.
#[test]
fn the_one_jaw_of_a_gripper_is_no_joint_of_the_arm() {
    let jaw = |robot: Robot, name: &str| {
        let more = "<origin xyz=\"0.02 0 0.03\"/><axis xyz=\"0 1 0\"/><limit lower=\"0\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/>";
        robot.joint("jlink5", [name, "revolute", "last"], TIP, more)
    };
    let frame = |robot: Robot, parent: &str, name: &str, far: f64| {
        let more = format!("<origin xyz=\"0 0 {far}\"/>");
        robot.joint(parent, [&format!("{name}_joint"), "fixed", name], "", &more)
    };
    let arm = || Robot::new("base").chain("base", "j", 5, 0.1);
    let grasped = frame(jaw(arm(), "six"), "jlink5", "grasp", 0.1);
    let cases = [
        ("a frame between the jaws", grasped.clone(), 5),
        ("called a jaw", jaw(arm(), "Moving_Jaw"), 5),
        ("called a gripper", jaw(arm(), "left_gripper_joint"), 5),
        ("a wrist", jaw(arm(), "six"), 6),
        ("the roll of a gripper", jaw(arm(), "gripper_roll"), 6),
        ("where a gripper is mounted", jaw(arm(), "wrist_to_gripper"), 6),
        ("a camera behind the last joint", frame(jaw(arm(), "six"), "jlink5", "camera", 0.01), 6),
        ("a wrist with a flange", frame(grasped, "last", "flange", 0.05), 6),
    ];
    for (what, robot, joints) in cases {
        assert_eq!(names(&robot.load()).len(), joints, "{what}");
    }
}

/// Fingers and all other links on the hand are a load, whatever their names and drives.
#[test]
fn grippers_are_loads_at_rest() {
    for joints in 2..=7 {
        let arm = Robot::new("base").chain("base", "j", joints, 0.3).hand(&format!("jlink{joints}"), "hand");
        let grippers = [
            (
                "driven and following",
                arm.clone().finger("hand", "a", 1, None).finger("hand", "b", 1, Some("a1")),
                2,
            ),
            ("both driven", arm.clone().finger("hand", "a", 1, None).finger("hand", "b", 1, None), 2),
            ("following alone", arm.clone().finger("hand", "b", 1, Some("elsewhere")), 1),
            (
                "knuckles",
                ["b", "c", "d"].iter().fold(arm.clone().finger("hand", "a", 1, None), |arm, prefix| {
                    arm.finger("hand", prefix, 2, Some("a1"))
                }),
                7,
            ),
            (
                "hand of three fingers",
                arm.clone()
                    .finger("hand", "a", 2, None)
                    .finger("hand", "b", 1, None)
                    .finger("hand", "c", 1, None),
                4,
            ),
        ];
        for (what, robot, held) in grippers {
            let file = robot.load();
            assert_eq!(names(&file), numbered("j", joints), "{what}");
            noted(&file, &format!("arm: base → hand, {joints} joints; the gripper's {held} joint"));
            let last = &file.arm.joints()[joints - 1].inertia;
            assert!((last.mass - 2.1 - 0.1 * held as f64).abs() < 1e-12, "{what}: {}", last.mass);
            assert!((file.arm.tool().translation.z - 0.1).abs() < 1e-15, "{what}: the tool is the hand");
            assert!(file.arm.require(Purpose::Simulation).is_ok());
        }
    }
}

/// A gripper rests at an admissible position: at zero, else in the middle of its range; followers rest where their leaders put them.
#[test]
fn held_joints_stand_where_they_can() {
    let slide = |limits: &str, mimic: &str| format!("<axis xyz=\"0 1 0\"/>{limits}{mimic}");
    let with = |limits: &str| {
        Robot::new("base")
            .chain("base", "j", 3, 0.3)
            .joint("jlink3", ["a", "prismatic", "finger_a"], TIP, &slide(limits, ""))
            .joint(
                "jlink3",
                ["b", "prismatic", "finger_b"],
                TIP,
                &slide("", "<mimic joint=\"a\" multiplier=\"3\" offset=\"0.1\"/>"),
            )
            .load()
    };
    for (limits, a) in
        [("<limit lower=\"0\" upper=\"0.04\"/>", 0.0), ("<limit lower=\"0.02\" upper=\"0.06\"/>", 0.04)]
    {
        let file = with(limits);
        assert_eq!(file.arm.dof(), 3);
        let inertia = file.arm.joints()[2].inertia;
        let y = 0.1 * (a + 3.0 * a + 0.1) / 2.2;
        assert!((inertia.com.y - y).abs() < 1e-12, "{limits}: {} for {y}", inertia.com.y);
    }
}

/// Wheels, legs, heads and second arms stay at rest; the selection distinguishes arms from the fingers that they carry.
#[test]
fn arms_of_bodies() {
    let two = Robot::new("base")
        .joint("base", ["wheel_l", "continuous", "wheel_left"], ROD, "")
        .joint("base", ["wheel_r", "continuous", "wheel_right"], ROD, "")
        .joint(
            "base",
            ["lift", "prismatic", "torso"],
            ROD,
            "<axis xyz=\"0 0 1\"/><limit lower=\"0\" upper=\"0.35\"/>",
        )
        .chain("torso", "head", 2, 0.1)
        .chain("torso", "left_", 7, 0.2)
        .chain("torso", "right_", 7, 0.2)
        .hand("left_link7", "left_hand")
        .hand("right_link7", "right_hand")
        .finger("left_hand", "lf", 1, None)
        .finger("left_hand", "lg", 1, Some("lf1"))
        .finger("right_hand", "rf", 1, None)
        .finger("right_hand", "rg", 1, Some("rf1"));
    let file = two.load();
    let mut left = vec!["lift".to_owned()];
    left.extend(numbered("left_", 7));
    assert_eq!(names(&file), left);
    noted(
        &file,
        "arm: base → left_hand, 8 joints; the gripper's 2 joints held still (`lf1`, `lg1`); 13 other joints held still",
    );
    noted(&file, "the chains to `right_hand` are equally long");

    let file = two.choose(&Selection { tip: Some("right_hand".to_owned()), joints: Vec::new() }).unwrap();
    assert_eq!(names(&file)[1], "right_1");
    let recorded: Vec<String> = ["robot/head1", "robot/right_7", "rf1"].map(str::to_owned).to_vec();
    let recorded = [recorded, numbered("robot/right_", 6)].concat();
    let file = two.choose(&Selection { tip: None, joints: recorded }).unwrap();
    assert_eq!(names(&file), numbered("right_", 7), "the lift is not recorded and stands still");

    let legs = ["left", "right"].iter().fold(Robot::new("pelvis"), |robot, side| {
        robot.chain("pelvis", &format!("{side}_leg"), 6, 0.2).joint(
            "pelvis",
            [&format!("{side}_x"), "fixed", &format!("{side}_plate")],
            "",
            "",
        )
    });
    let humanoid = legs.chain("pelvis", "waist", 3, 0.1).chain("waistlink3", "a", 7, 0.2).chain(
        "waistlink3",
        "b",
        7,
        0.2,
    );
    let humanoid = ["t", "i", "m"].iter().fold(humanoid.hand("alink7", "palm"), |robot, finger| {
        robot.finger("palm", finger, if *finger == "t" { 3 } else { 2 }, None)
    });
    let file = humanoid.load();
    assert_eq!(file.arm.dof(), 10, "{:?}", names(&file));
    noted(&file, "arm: pelvis → palm, 10 joints; the gripper's 7 joints");
}

/// The rods of a parallelogram follow joints of the arm and are not fingers.
#[test]
fn rods_are_no_fingers() {
    let rod = |robot: Robot, on: &str, name: &str| {
        robot.joint(
            on,
            [name, "revolute", &format!("{name}_rod")],
            TIP,
            "<axis xyz=\"0 1 0\"/><mimic joint=\"j2\"/>",
        )
    };
    let arm = Robot::new("base").chain("base", "j", 6, 0.3);
    let file = rod(rod(arm, "jlink4", "one"), "jlink4", "two").load();
    assert_eq!(names(&file), numbered("j", 6));
}

#[test]
fn bases_that_float_and_links_that_stray() {
    for kind in ["floating", "planar"] {
        let robot =
            Robot::new("world").joint("world", ["drive", kind, "car"], ROD, "<origin xyz=\"0 0 1\"/>");
        let file = robot.chain("car", "j", 2, 0.3).load();
        assert_eq!(names(&file), ["j1", "j2"]);
        noted(&file, "floating or planar type stand still: `drive`");
        let mut ws = Workspace::new(&file.arm);
        assert!((forward_kinematics(&file.arm, &mut ws, &[0.0; 2]).translation.z - 1.6).abs() < 1e-15);
    }
    let mut stray = Robot::new("stray");
    stray.0 += &Robot::new("base").chain("base", "j", 2, 0.3).0;
    let file = stray.load();
    assert_eq!(names(&file), ["j1", "j2"]);
    noted(&file, "arm: base → jlink2");
    noted(&file, "2 links have no parent joint (`stray`, `base`)");
}

#[test]
fn prefixes_without_declaration_are_passed_over_and_places_stay_right() {
    let text = Robot::new("base").chain("base", "j", 2, 0.3).text();
    let text = text.replace("</robot>", "<sensor:camera gz:rate=\"3\"/></robot>");
    let file = parse_urdf(&text, "made.urdf").unwrap();
    assert_eq!(file.arm.dof(), 2);
    noted(&file, "the XML prefix `sensor` is not declared");
    let bad = text.replacen("\"0 0 1\"", "\"0 0 0\"", 1);
    let line = bad.lines().position(|line| line.contains("0 0 0\"")).unwrap() + 1;
    let column = bad.lines().nth(line - 1).unwrap().find("0 0 0\"").unwrap() + 1;
    let error = parse_urdf(&bad, "made.urdf").unwrap_err().to_string();
    assert!(error.starts_with(&format!("made.urdf:{line}:{column}:")), "{error}");
    let one_line = bad.replace('\n', " ");
    let column = one_line.find("0 0 0\"").unwrap() + 1;
    let error = parse_urdf(&one_line, "made.urdf").unwrap_err().to_string();
    assert!(error.starts_with(&format!("made.urdf:1:{column}:")), "{error}");
}

#[test]
fn what_exporters_write_for_nothing_is_noted() {
    let limits = "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" velocity=\"-1\" effort=\"-1\"/><dynamics friction=\"-1e-9\" damping=\"-0.4\"/>";
    let file = Robot::new("base").joint("base", ["j", "revolute", "link"], ROD, limits).load();
    let joint = &file.arm.joints()[0];
    assert_eq!((joint.limits.velocity, joint.limits.effort), (f64::INFINITY, f64::INFINITY));
    assert_eq!((joint.friction.viscous, joint.friction.coulomb), (0.0, 0.0));
    for words in
        ["velocity limit -1", "effort limit -1", "damping -0.4 is below zero", "friction -0.000000001"]
    {
        noted(&file, words);
    }
    // The reader ignores defects of a joint that does not belong to the arm.
    let crooked = "<axis xyz=\"0 0 0\"/><limit lower=\"2\" upper=\"1\"/>";
    let two =
        Robot::new("base").chain("base", "j", 3, 0.3).joint("base", ["odd", "revolute", "lid"], "", crooked);
    assert_eq!(names(&two.load()), ["j1", "j2", "j3"]);
}

#[test]
fn inertias_that_cannot_be_matter_where_they_move() {
    let odd = "<inertial><mass value=\"0.002\"/><inertia ixx=\"2e-8\" iyy=\"3e-8\" izz=\"4e-8\" ixy=\"6e-8\"/></inertial>";
    let arm = Robot::new("base").chain("base", "j", 2, 0.3);
    let file = arm.clone().joint("base", ["aerial_mount", "fixed", "aerial"], odd, "").load();
    assert!(file.arm.require(Purpose::Simulation).is_ok());
    noted(&file, "impossible inertias that the arm does not move are not used: `aerial`");
    let file = arm.joint("jlink2", ["aerial_mount", "fixed", "aerial"], odd, "").load();
    assert!(file.arm.require(Purpose::ToolPose).is_ok());
    let said = file.arm.require(Purpose::Torque).unwrap_err().to_string();
    assert!(
        said.contains("made.urdf:") && said.contains("`aerial`") && said.contains("ixy=0.00000006"),
        "{said}"
    );
    let rounding =
        odd.replace("6e-8", "2.4e-35").replace("2e-8", "0").replace("3e-8", "0").replace("4e-8", "0");
    let file = Robot::new("base").chain("base", "j", 2, 0.3).joint(
        "jlink2",
        ["m", "fixed", "aerial"],
        &rounding,
        "",
    );
    assert!(file.load().arm.require(Purpose::Simulation).is_ok());
}

#[test]
fn an_arm_file_names_a_tip_and_gives_rotors() {
    let folder = tempfile::tempdir().unwrap();
    let point = "<inertial><origin xyz=\"0 0 0.1\"/><mass value=\"1\"/></inertial>";
    let wrist = "<axis xyz=\"0 0 1\"/><limit lower=\"-3\" upper=\"3\" effort=\"9\" velocity=\"3\"/>";
    let robot = Robot::new("base").chain("base", "j", 2, 0.3).joint(
        "jlink2",
        ["roll", "revolute", "flange"],
        point,
        wrist,
    );
    std::fs::write(folder.path().join("made.urdf"), robot.text()).unwrap();
    let read = |text: &str| {
        std::fs::write(folder.path().join("arm.toml"), format!("urdf = \"made.urdf\"\n{text}")).unwrap();
        load(&folder.path().join("arm.toml"))
    };
    let plain = read("").unwrap();
    let said = plain.arm.require(Purpose::Simulation).unwrap_err().to_string();
    assert!(
        said.contains("made.urdf:") && said.contains("`flange`") && said.contains("rotor_inertia"),
        "{said}"
    );
    noted(&plain, "moves no inertia");

    let geared = read("[[joint]]\nname = \"roll\"\nrotor_inertia = 0.02\n").unwrap();
    assert_eq!(geared.arm.joints()[2].rotor_inertia, 0.02);
    assert!(geared.arm.require(Purpose::Simulation).is_ok());
    assert!(!geared.ignored.iter().any(|note| note.contains("moves no inertia")), "{:?}", geared.ignored);

    assert_eq!(names(&read("tip = \"jlink2\"\n").unwrap()), ["j1", "j2"]);
    let unknown = read("[[joint]]\nname = \"elbow\"\nmass = 1\n").unwrap_err().to_string();
    assert!(unknown.contains("arm.toml:2:1") && unknown.contains("the arm has j1, j2, roll"), "{unknown}");
    let error =
        parse_toml("tip = \"x\"\n[[joint]]\nname = \"j\"\n", "x.toml".as_ref()).unwrap_err().to_string();
    assert!(error.contains("x.toml:1:7: tip is `x`"), "{error}");
}

#[test]
fn a_tip_that_is_none_is_named_with_those_that_are() {
    let robot = Robot::new("base").chain("base", "a", 3, 0.3).chain("base", "b", 2, 0.3);
    for (tip, words) in [("nothing", "no link of this name"), ("base", "no joint moves")] {
        let said = robot
            .choose(&Selection { tip: Some(tip.to_owned()), joints: Vec::new() })
            .unwrap_err()
            .to_string();
        assert!(said.contains(tip) && said.contains(words) && said.contains("`blink2`, `alink3`"), "{said}");
    }
}

/// A note names the place of each implausible number; a plausible arm has no notes.
#[test]
fn numbers_that_cannot_be_meant() {
    let arm = Robot::new("base").chain("base", "j", 3, 0.3);
    assert_eq!(arm.load().ignored.len(), 1, "{:?}", arm.load().ignored);
    let change = |from: &str, to: &str| parse_urdf(&arm.text().replacen(from, to, 1), "made.urdf").unwrap();
    noted(&change("mass value=\"2\"", "mass value=\"8393\""), "link `jlink1` (line 3): 8393 kg");
    noted(&change("mass value=\"2\"", "mass value=\"8393\""), "densest metal");
    noted(
        &change("velocity=\"3\"", "velocity=\"1e6\""),
        "joint `j1` (line 4): at its velocity limit of 1000000 rad/s",
    );
    noted(&change("lower=\"-2\"", "lower=\"2\""), "joint `j1` (line 4): its range is 0");
    noted(&change("effort=\"300\"", "effort=\"300\"/><nothing "), "arm: base");
    let all = |from: &str, to: &str| parse_urdf(&arm.text().replace(from, to), "made.urdf").unwrap();
    noted(&all("0 0 0.3", "0 0 300"), "are lengths in m?");
    noted(
        &all("ixx=\"0.015\" iyy=\"0.015\" izz=\"0.002\"", "ixx=\"15000\" iyy=\"15000\" izz=\"2000\""),
        "are inertias in kg·m²?",
    );
    noted(
        &all("effort=\"300\"", "effort=\"0.3\""),
        "joint `j2` (line 6): the arm's own weight loads it with up to",
    );
    noted(&all("mass value=\"2\"", "mass value=\"2000\""), "densest metal");
}
