//! Path files: the plan reproduces the rows, and an error names every defect with its place.

use crate::common;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use freeplay_arm::Arm;
use freeplay_path::{JointPath, PathError, PathKind, PathSpec, ToolPath};
use tempfile::TempDir;

const RATE: f64 = 1000.0;

fn write(folder: &TempDir, text: &str) -> PathBuf {
    let file = folder.path().join("path.csv");
    std::fs::write(&file, text).expect("the folder is ours");
    file
}

fn spec(file: &Path) -> PathSpec {
    PathSpec { kind: PathKind::File, file: Some(file.to_path_buf()), ..PathSpec::default() }
}

fn plan(arm: &Arm, text: &str) -> Result<JointPath, PathError> {
    let folder = tempfile::tempdir().expect("a folder");
    JointPath::plan(arm, &spec(&write(&folder, text)), RATE)
}

fn joints(path: &JointPath, t: f64) -> [Vec<f64>; 3] {
    let [mut q, mut v, mut a] = [0, 1, 2].map(|_| vec![0.0; path.dof()]);
    path.at(t, &mut q, &mut v, &mut a);
    [q, v, a]
}

/// Largest differences of q, v and a between two paths.
fn differences(one: &JointPath, other: &JointPath) -> [f64; 3] {
    let mut worst = [0.0_f64; 3];
    for k in 0..700 {
        let t = (f64::from(k) + 0.3) / 700.0 * one.duration();
        for (worst, (x, y)) in worst.iter_mut().zip(joints(one, t).iter().zip(joints(other, t))) {
            *worst = x.iter().zip(y).fold(*worst, |w, (x, y)| w.max((x - y).abs()));
        }
    }
    worst
}

/// The smooth path, sampled every 4 ms: its rows of joints, of positions, and of poses with an extra column.
fn sampled(path: &JointPath, tool: &ToolPath) -> [String; 3] {
    let mut texts =
        ["t,q1,q2,q3,q4,q5,q6", "t,x,y,z", "note, z,y,x, qw,qx,qy,qz ,t"].map(|head| format!("{head}\n"));
    for k in 0..=1500 {
        let t = 0.004 * f64::from(k);
        let q = joints(path, t)[0].iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let pose = tool.at(t).pose;
        let (p, r) = (pose.translation, pose.rotation);
        // Times from 5 s on, and a quaternion with alternating sign: both describe the same motion.
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let (i, j, k, w) = (sign * r.i, sign * r.j, sign * r.k, sign * r.w);
        writeln!(texts[0], "{t},{q}").expect("a string takes it");
        writeln!(texts[1], "{t},{},{},{}", p.x, p.y, p.z).expect("a string takes it");
        writeln!(texts[2], "hm,{},{},{},{w},{i},{j},{k},{}", p.z, p.y, p.x, t + 5.0)
            .expect("a string takes it");
    }
    texts
}

#[test]
fn a_path_written_to_a_file_is_the_same_path() {
    let arm = common::paper_arm();
    let built_in = PathSpec::default();
    let path = JointPath::plan(&arm, &built_in, RATE).expect("the path is reachable");
    let tool = ToolPath::of(&built_in).expect("a Cartesian kind");
    for (name, text) in ["joints", "positions", "poses"].iter().zip(sampled(&path, &tool)) {
        let again = plan(&arm, &text).expect("the file is good");
        assert!((again.duration() - 6.0).abs() < 1e-12);
        let worst = differences(&path, &again);
        println!(
            "{name}: q {:.1e} (allowed 1e-9), v {:.1e} (1e-6), a {:.1e} (1e-3)",
            worst[0], worst[1], worst[2]
        );
        assert!(worst[0] > 0.0, "the spline is not the curve");
        assert!(worst[0] < 1e-9 && worst[1] < 1e-6 && worst[2] < 1e-3);
    }
}

#[test]
fn a_file_can_be_run_several_times_if_it_ends_where_it_begins() {
    let arm = common::pendulum();
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = String::from("t,q1\n");
    for k in 0..=100 {
        let s = f64::from(k) / 100.0;
        let q = 0.1 * (std::f64::consts::TAU * s).sin();
        writeln!(text, "{},{q}", 3.0 * s).expect("a string takes it");
    }
    let laps = PathSpec { laps: 3, ..spec(&write(&folder, &text)) };
    let path = JointPath::plan(&arm, &laps, RATE).expect("the file is closed");
    assert!((path.duration() - 9.0).abs() < 1e-12);
    for t in [0.0, 1.1, 4.1, 5.999_999, 6.0, 7.1] {
        let exact = 0.1 * (std::f64::consts::TAU * t / 3.0).sin();
        assert!((joints(&path, t)[0][0] - exact).abs() < 1e-6, "smooth across the seam at {t}");
    }
    let open = PathSpec { laps: 2, ..spec(&write(&folder, "t,q1\n0,0\n1,0.1\n2,0.2\n3,0.1\n")) };
    let error = JointPath::plan(&arm, &open, RATE).expect_err("it does not close").to_string();
    assert!(error.contains("path.csv:5:2: q1 ends at 0.1 but begins at 0"), "{error}");
}

#[test]
fn files_with_errors_are_refused_with_the_place() {
    let good = "0,0\n1,0.1\n2,0.2\n";
    for (text, part) in [
        (String::new(), "path.csv:1:1: column t is missing"),
        ("q1\n0\n1\n2\n3\n".to_owned(), "path.csv:1:1: column t is missing"),
        ("t,a\n0,0\n".to_owned(), "path.csv:1:1: column q1 is missing"),
        ("t,q1,q1\n0,0,0\n".to_owned(), "path.csv:1:3: column q1 appears twice"),
        ("t,x,y\n0,0,0\n".to_owned(), "path.csv:1:1: column z is missing"),
        ("t,x,y,z,qx,qy,qz\n".to_owned(), "path.csv:1:1: column qw is missing"),
        ("t,q1,q2\n0,0,0\n".to_owned(), "path.csv:1:3: the file has 2 joint column(s), the arm 1 joint(s)"),
        (format!("t,q1\n{good}"), "path.csv: 3 rows; at least 4 are needed"),
        (format!("t,q1\n{good}3,abc\n"), "path.csv:5:2: q1 = \"abc\" is not a finite number"),
        (format!("t,q1\n{good}3,\n"), "path.csv:5:2: q1 = \"\" is not a finite number"),
        (format!("t,q1\n{good}3,NaN\n"), "path.csv:5:2: q1 = \"NaN\" is not a finite number"),
        (format!("t,q1\n{good}inf,0\n"), "path.csv:5:1: t = \"inf\" is not a finite number"),
        (format!("t,q1\n{good}2,0\n"), "path.csv:5:1: t = 2 s does not come after 2 s"),
        (format!("# a comment\nt,q1\n{good}1.5,0\n"), "path.csv:6:1: t = 1.5 s does not come after 2 s"),
        (format!("t,q1\n{good}3\n"), "path.csv:5:1: the row has 1 fields, the header 2"),
        (format!("t,q1\n{good}3,0,7\n"), "path.csv:5:2: the row has 3 fields, the header 2"),
        (format!("t,q1\n{good}20,2.5\n"), "path.csv:4:2: at t = 1"),
        (format!("t,q1\n{good}2.1,0.5\n"), "joint pivot moves at "),
        (format!("t,q1\n{good}90000,0\n"), "last 90000 s; at most 86400 s"),
        ("t,q1\n-1e308,0\n0,0\n1,0\n1e308,0\n".to_owned(), "inf s"),
        ("t,q1\n0,0\n1,1e308\n2,-1e308\n3,0\n".to_owned(), "pivot"),
    ] {
        let error = plan(&common::pendulum(), &text).expect_err(&text).to_string();
        assert!(error.contains(part), "{text:?}: {error}");
    }
    let missing = JointPath::plan(&common::pendulum(), &spec(Path::new("/nowhere/a.csv")), RATE);
    assert!(missing.expect_err("no such file").to_string().contains("/nowhere/a.csv: "));
    let gap = plan(&common::planar(), "t,q1,q3\n0,0,0\n").expect_err("a gap").to_string();
    assert!(gap.contains("path.csv:1:1: column q2 is missing"), "{gap}");
}

#[test]
fn limits_are_named_with_joint_time_value_and_limit() {
    let error = plan(&common::pendulum(), "t,q1\n0,1.9\n1,1.95\n2,2.0\n3,2.05\n4,2.1\n");
    let error = error.expect_err("the limit is 2").to_string();
    assert!(
        error.contains("path.csv:4:2: at t = 2.0002 s joint pivot is at 2.0000")
            && error.contains("its limit 2.000000"),
        "{error}"
    );
    let error =
        plan(&common::pendulum(), "t,q1\n0,0\n1,0.6\n2,1.2\n3,1.8\n").expect_err("0.6 rad/s").to_string();
    assert!(
        error.contains("path.csv:2:2: at t = 0.0000 s joint pivot moves at 0.6")
            && error.contains("its limit 0.500000"),
        "{error}"
    );
}

#[test]
fn tool_files_that_cannot_be_followed_name_the_row() {
    let arm = common::unlimited_paper_arm();
    let far =
        plan(&arm, "t,x,y,z\n0,0.95,0,0.95\n10,1.1,0,0.95\n20,1.25,0,0.95\n30,1.4,0,0.95\n40,1.8,0,0.95\n")
            .expect_err("too far")
            .to_string();
    assert!(
        far.contains("path.csv:5:2: at t = 3")
            && far.contains("s, tool at (1.55")
            && far.contains("path.centre"),
        "{far}"
    );
    let zero =
        plan(&arm, "t,x,y,z,qx,qy,qz,qw\n0,0.95,0,0.95,0,0,0,0\n").expect_err("no orientation").to_string();
    assert!(zero.contains("path.csv:2:5: qx,qy,qz,qw have norm 0"), "{zero}");
}

#[test]
fn built_in_paths_that_cannot_be_followed_say_where_and_what_to_change() {
    let arm = common::unlimited_paper_arm();
    let default = PathSpec::default();
    for (arm, spec, part) in [
        (
            &arm,
            PathSpec { centre: [3.0, 0.0, 0.95], ..default.clone() },
            "at t = 0.0000 s the tool cannot reach (3.1500",
        ),
        (
            &arm,
            PathSpec {
                centre: [1.38, 0.2, 0.95],
                kind: PathKind::Square,
                start: Some(vec![0.0; 6]),
                ..default.clone()
            },
            "m, the arm is stretched, folded",
        ),
        (
            &arm,
            PathSpec { start: Some(vec![0.0; 5]), ..default.clone() },
            "path.start has 5 values, the arm has 6 joints",
        ),
        (
            &common::paper_arm(),
            PathSpec { start: Some(vec![6.2, 0.0, 0.0, 0.0, 1.5, 0.0]), ..default.clone() },
            "at t = 0.0000 s joint joint_1 is at 6.283185, beyond its limit 3.220000",
        ),
        (
            &common::paper_arm(),
            PathSpec { period: 0.3, ..default.clone() },
            "faster than its limit 2.700000 (rad/s or m/s)",
        ),
        (&common::pendulum(), default.clone(), "the arm has 1 joint(s), too few"),
        (&common::planar(), default.clone(), "the tool cannot reach (1.1000, 0.0000, 0.9500)"),
    ] {
        let error = JointPath::plan(arm, &spec, RATE).expect_err(part).to_string();
        println!("{error}");
        assert!(error.contains(part), "{part}: {error}");
    }
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e6] {
        let error = JointPath::plan(&arm, &default, rate).expect_err("no rate").to_string();
        assert!(error.contains("rate = "), "{error}");
    }
    let bad = PathSpec { laps: 0, ..default };
    assert!(matches!(JointPath::plan(&arm, &bad, RATE), Err(PathError::Spec(_))));
}
