//! Files of other packages are read with the right joints: rosbags, pandas, NumPy, SciPy, data sets like LeRobot's.
//!
//! `FREEPLAY_PYTHON` names an interpreter that has them; else the test tries `python3`. Without it this test prints a message and passes.

use std::path::Path;
use std::process::Command;

use freeplay_recording::{Recording, read};

fn python() -> Command {
    Command::new(std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned()))
}

fn available() -> bool {
    let script = "import numpy, pandas, pyarrow, rosbags.rosbag2, scipy.io";
    let found = python().args(["-c", script]).output().is_ok_and(|output| output.status.success());
    if !found {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            "no Python with numpy, pandas, pyarrow, rosbags and scipy; FREEPLAY_PYTHON names one",
        );
    }
    found
}

/// Fails unless `recording`, paired with an arm by name, contains sin(k t) and k cos(k t) for joints k = 1, 2, 3.
fn check(name: &str, recording: Recording) {
    let arm = ["shoulder_pan_joint", "elbow_joint", "wrist_1_joint"].map(str::to_owned);
    let named = recording.joint_names.clone();
    assert_eq!(named.len(), 3, "{name}: {:?}", recording.columns());
    let recording = recording.for_joints(&arm).expect("all joints have their like");
    assert!(recording.notes.iter().all(|note| !note.contains("by number")), "{name}: {:?}", recording.notes);
    assert_eq!((recording.joints(), recording.len()), (3, 400), "{name}");
    let mut worst = 0.0_f64;
    for joint in 0..3 {
        let k = (joint + 1) as f64;
        for row in 0..400 {
            let t = row as f64 * 0.01;
            worst = worst.max((recording.q[joint][row] - (k * t).sin()).abs());
            let tau = recording.tau.as_ref().unwrap_or_else(|| panic!("{name} has torques"));
            worst = worst.max((tau[joint][row] - k * (k * t).cos()).abs());
        }
    }
    let steps = recording.t.windows(2).map(|pair| pair[1] - pair[0]);
    let step = steps.fold(0.0_f64, |most, step| most.max((step - 0.01).abs()));
    println!("{name}: joints {named:?}, off by {worst:.1e}, steps by {step:.1e} s");
    assert!(worst < 1e-6, "{name}");
    assert!(step < 1e-6 || name.starts_with("lerobot"), "{name}");
}

#[test]
fn every_form_has_the_right_joints() {
    if !available() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/other_packages.py");
    let output = python().arg(script).arg(folder.path()).output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let files = [
        "plain.npz",
        "deflated.npz",
        "plain.mat",
        "struct.mat",
        "dated.csv",
        "german.csv",
        "counted.csv",
        "dated.parquet",
        "snappy.parquet",
        "zstd.parquet",
        "gzip.parquet",
        "lz4.parquet",
        "None.parquet",
        "lerobot",
        "bag_sqlite3",
        "bag_sqlite3/bag_sqlite3.db3",
        "bag_mcap",
        "bag_mcap/bag_mcap.mcap",
        "ros1_none.bag",
        "ros1_lz4.bag",
        "ros1_bz2.bag",
    ];
    for name in files {
        let recording =
            read(&folder.path().join(name), None).unwrap_or_else(|error| panic!("{name}: {error}"));
        check(name, recording);
    }
    // With a name that suggests another kind.
    let renamed = folder.path().join("log.txt");
    std::fs::rename(folder.path().join("ros1_lz4.bag"), &renamed).expect("renamed");
    check("log.txt", read(&renamed, None).expect("by its content"));
}
