//! Dry friction of a joint that stands for half of the time, in a closed loop with noisy encoders, is the only finding.

use std::fmt::Write as _;
use std::path::Path;

use crate::common::{freeplay_in, fresh_folder};

const DURATION: f64 = 16.0;
const COULOMB: f64 = 7.5;

/// A smooth step from 0 to 1 with continuous speed.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Six swinging joints; the third stands from 4 to 11 s.
fn path() -> String {
    const STEP: f64 = 0.01;
    const HOME: [f64; 6] = [0.0, 0.3, 0.4, 0.2, 0.6, 0.1];
    let mut text = "t,q1,q2,q3,q4,q5,q6\n".to_owned();
    let mut moved = 0.0;
    for row in 0..=(DURATION / STEP).round() as usize {
        let t = row as f64 * STEP;
        moved += STEP * (1.0 - smooth((t - 4.0) / 0.5) + smooth((t - 11.0) / 0.5));
        let envelope = smooth(t / 1.5) * smooth((DURATION - t) / 1.5);
        write!(text, "{t}").expect("written");
        for (joint, home) in HOME.into_iter().enumerate() {
            let (k, x) = (joint as f64, if joint == 2 { moved } else { t });
            let swing =
                0.35 * ((1.0 + 0.13 * k) * x + k).sin() + 0.2 * ((2.1 + 0.17 * k) * x + 2.0 * k).sin();
            write!(text, ",{}", home + envelope * swing).expect("written");
        }
        text.push('\n');
    }
    text
}

#[test]
fn dry_friction_of_a_joint_that_often_stands_is_the_only_finding() {
    let arm = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/arm.urdf");
    let arm = arm.to_str().expect("a path in UTF-8");
    let folder = fresh_folder();
    let machine = format!(
        "urdf = \"{arm}\"\n\n[[effect]]\nkind = \"coulomb_friction\"\njoint = \"joint_3\"\ncoulomb = {COULOMB}\n"
    );
    std::fs::write(folder.path().join("machine.toml"), machine).expect("written");
    std::fs::write(folder.path().join("path.csv"), path()).expect("written");
    let sets = [
        format!("controller.model={arm}"),
        format!("duration={DURATION}"),
        "path.kind=file".to_owned(),
        "path.file=path.csv".to_owned(),
        "controller.gains.natural_frequency=13".to_owned(),
        "sensors.position.noise=5e-6".to_owned(),
        "sensors.velocity.noise=5e-4".to_owned(),
        "sensors.torque.noise=0.04".to_owned(),
        "sensors.track_tool=false".to_owned(),
    ];
    let mut arguments =
        vec!["run", "--quiet", "--model", "machine.toml", "--controller", "computed-torque", "--out", "out"];
    arguments.extend(sets.iter().flat_map(|set| ["--set", set]));
    let ran = freeplay_in(folder, &arguments).expect(0);
    let asked = [
        "diagnose",
        "--quiet",
        "--model",
        arm,
        "--recording",
        "out/computed-torque.mcap",
        "--format",
        "json",
    ];
    let found = freeplay_in(ran.folder, &asked).expect(0);
    let found: serde_json::Value = serde_json::from_str(&found.stdout()).expect("a diagnosis");
    println!("{}", found["statement"]);
    let [effect] = found["effects"].as_array().expect("effects").as_slice() else { panic!("{found}") };
    assert_eq!(effect["kind"], "coulomb_friction");
    assert_eq!(effect["joint"], "joint_3");
    let coulomb = &effect["parameters"]["coulomb"];
    let [least, most] = [0, 1].map(|side| coulomb["ci95"][side].as_f64().expect("a number"));
    println!("{least:.4} to {most:.4} N*m for {COULOMB}");
    assert!(least <= COULOMB && COULOMB <= most);
}
