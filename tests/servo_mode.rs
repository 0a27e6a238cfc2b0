//! Mode servo: the arm file's position servos close the loop in the plant; the motion equals the simulation of `compare`, and a filter of the commands
//! compensates the servo errors.

use std::fmt::Write as _;
use std::path::Path;

use crate::common::{Ran, freeplay_in, fresh_folder};
use freeplay_recording::read;

/// Two links in the plane of gravity, on servos with lag, droop and friction.
const ARM: &str = r#"name = "two links"

[[joint]]
name = "shoulder"
type = "revolute"
axis = [0.0, -1.0, 0.0]
mass = 0.5
com = [0.1, 0.0, 0.0]
inertia = { ixx = 0.015, iyy = 0.015, izz = 0.015, ixy = 0.0, ixz = 0.0, iyz = 0.0 }
limits = { lower = -2.0, upper = 2.0, effort = 50.0, velocity = 10.0, acceleration = 500.0 }

[[joint]]
name = "elbow"
type = "revolute"
axis = [0.0, -1.0, 0.0]
origin = { xyz = [0.25, 0.0, 0.0], rpy = [0.0, 0.0, 0.0] }
mass = 0.4
com = [0.1, 0.0, 0.0]
inertia = { ixx = 0.01, iyy = 0.01, izz = 0.01, ixy = 0.0, ixz = 0.0, iyz = 0.0 }
limits = { lower = -2.0, upper = 2.0, effort = 50.0, velocity = 10.0, acceleration = 500.0 }
"#;

const SERVOS: &str = r#"
[[effect]]
kind = "servo"
joint = "shoulder"
stiffness = 30.0
damping = 1.8

[[effect]]
kind = "coulomb_friction"
joint = "shoulder"
coulomb = 0.3

[[effect]]
kind = "command_delay"
joint = "shoulder"
delay = 0.02

[[effect]]
kind = "servo"
joint = "elbow"
stiffness = 15.0
damping = 0.7

[[effect]]
kind = "coulomb_friction"
joint = "elbow"
coulomb = 0.2
"#;

const SCENARIO: &str = "model = \"arm.toml\"\nmode = \"servo\"\ncommand_rate = 50\nrecording = \"csv\"\ncontrollers = [\"computed-torque\"]\n\
                        duration = 4.0\nsubsteps = 20\n[clearance]\n[path]\nkind = \"joint_sine\"\nperiod = 4\n";

fn run(sets: &[&str]) -> Ran {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("arm.toml"), format!("{ARM}{SERVOS}")).expect("written");
    std::fs::write(folder.path().join("s.toml"), SCENARIO).expect("written");
    let arguments = ["run", "s.toml", "--quiet", "--out", "out"];
    freeplay_in(folder, &[arguments.as_slice(), sets].concat()).expect(0)
}

/// Root of the mean square of reference minus position after the first second, by joint, rad.
fn tracking(ran: &Ran) -> Vec<f64> {
    let recording = read(&ran.out().join("computed-torque.csv"), None).expect("a recording");
    let path = |joint: usize| recording.column(&format!("q_path_{}", joint + 1)).expect("the path");
    let rows: Vec<usize> = (0..recording.len()).filter(|row| recording.t[*row] > 1.0).collect();
    let of = |(joint, q): (usize, &Vec<f64>)| {
        let reference = path(joint);
        let square: f64 = rows.iter().map(|row| (reference[*row] - q[*row]).powi(2)).sum();
        (square / rows.len() as f64).sqrt()
    };
    recording.q.iter().enumerate().map(of).collect()
}

#[test]
fn servos_close_the_loop_and_a_filter_of_commands_makes_up_for_them() {
    let plain = tracking(&run(&[]));
    let filtered = tracking(&run(&["--set", "controller.options.command_filter=true"]));
    println!("reference minus position, rad: {plain:.4?}, with the filter {filtered:.4?}");
    for (plain, filtered) in plain.iter().zip(&filtered) {
        assert!(*plain > 0.02, "servos lag and droop: {plain}");
        assert!(*filtered < 0.25 * plain, "the filter makes up for it: {filtered} of {plain}");
    }
}

/// The recording of a run as the owner of such an arm has it: commanded positions and encoder readings, at 200 Hz.
fn commanded_and_measured(ran: &Ran, to: &Path) {
    let recording = read(&ran.out().join("computed-torque.csv"), None).expect("a recording");
    let references = recording.references().expect("commands");
    let mut text = String::from("t,q1,q2,q_ref1,q_ref2\n");
    for row in (0..recording.len()).step_by(5) {
        let [q, commands] = [&recording.q, references].map(|of| [of[0][row], of[1][row]]);
        let _ = writeln!(text, "{},{},{},{},{}", recording.t[row], q[0], q[1], commands[0], commands[1]);
    }
    std::fs::write(to, text).expect("written");
}

/// A machine with unknown servos: recorded, diagnosed from commanded and measured positions alone, and moved along another path with a filter of the diagnosed
/// model.
#[test]
fn what_a_diagnosis_finds_of_servos_takes_their_errors_out() {
    let folder = fresh_folder();
    let place = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(folder.path().join("plain.toml"), ARM).expect("written");
    let mut arguments = vec!["diagnose".to_owned(), "--model".to_owned(), place("plain.toml")];
    for period in ["3", "5", "8"] {
        let ran = run(&[
            "--set",
            &format!("path.period={period}"),
            "--set",
            "path.laps=10",
            "--set",
            "duration=24",
        ]);
        let to = place(&format!("{period}.csv"));
        commanded_and_measured(&ran, Path::new(&to));
        arguments.extend(["--recording".to_owned(), to]);
    }
    arguments.extend(["--out".to_owned(), place("found")]);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    freeplay_in(fresh_folder(), &arguments).expect(0);
    let other = ["--set", "path.period=4.4", "--set", "path.laps=10", "--set", "duration=20"];
    let model = format!("controller.model={}", place("found/model.toml"));
    let filter = ["--set", model.as_str(), "--set", "controller.options.command_filter=true"];
    let plain = tracking(&run(&other));
    let filtered = tracking(&run(&[other.as_slice(), filter.as_slice()].concat()));
    println!("reference minus position, rad: {plain:.4?}, by what was found {filtered:.5?}");
    for (plain, filtered) in plain.iter().zip(&filtered) {
        assert!(*filtered < 0.1 * plain, "{filtered} of {plain}");
    }
}

#[test]
fn a_joint_without_a_servo_is_refused() {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("arm.toml"), ARM).expect("written");
    std::fs::write(folder.path().join("s.toml"), SCENARIO).expect("written");
    let ran = freeplay_in(folder, &["run", "s.toml", "--quiet", "--out", "out"]).expect(3);
    assert!(ran.stderr().contains("shoulder") && ran.stderr().contains("position servo"), "{}", ran.dump());
}
