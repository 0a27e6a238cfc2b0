//! Real machines: the effects found in some recordings, replayed in MuJoCo on a held-out recording.

use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use super::replay::{Errors, compared, replayed};
use super::tools::has;
use crate::common::{Call, fresh_folder};

/// A machine: its folder and model, the recordings to diagnose, and those held out.
struct Set {
    folder: &'static str,
    model: &'static str,
    fitted: &'static [&'static str],
    held: &'static [&'static str],
}

const EMPS: Set =
    Set { folder: "emps", model: "emps.urdf", fitted: &["train.csv"], held: &["test_pulses.csv"] };

const LWR4: Set = Set {
    folder: "kuka_lwr4",
    model: "kuka_lwr4.urdf",
    fitted: &["train_1.csv", "repeat_2.csv"],
    held: &["test_3_fast.csv"],
};

const KR300: Set = Set {
    folder: "kuka_kr300",
    model: "kr300_r2500_payload150.urdf",
    fitted: &["train_A.csv"],
    held: &["test_B.csv"],
};

const PENDULUM: Set = Set {
    folder: "dfki_double_pendulum",
    model: "double_pendulum_C1.urdf",
    fitted: &["train_1.csv", "train_2.csv", "train_3.csv", "train_4.csv"],
    held: &["test_1.csv", "test_2.csv", "test_3_swing.csv"],
};

/// The recorded earthquakes begin within the gap, where only the recorded force determines the position: a file of MuJoCo has no recording to start from.
const DAMPER: Set = Set {
    folder: "brfd_backlash",
    model: "damper.urdf",
    fitted: &["train_36lb_0.5Hz_1in.csv", "train_36lb_1Hz_1in.csv", "train_36lb_0.5Hz_1.5in.csv"],
    held: &["train_36lb_1Hz_1.5in.csv"],
};

const SERVOS: Set = Set {
    folder: "so101_command",
    model: "so101.urdf",
    fitted: &["train_multisine.csv", "train_chirp_sweep.csv", "train_step_response.csv"],
    held: &["test_frequency_sweep.csv", "test_large_amplitude.csv", "test_coupled_joints.csv"],
};

/// The folder of the recordings; reports a skipped test if they or MuJoCo are missing.
fn recordings() -> Option<PathBuf> {
    let folder = freeplay_skip::recordings()?;
    has("mujoco, numpy, scipy").then_some(folder)
}

/// Diagnoses `set` and exports both models: `sheet.xml` and `full.xml`; `said.toml` has those effects of the found model that the file expresses.
fn exported(set: &Set, recordings: &Path) -> TempDir {
    let file = |name: &str| recordings.join(set.folder).join(name).display().to_string();
    let sheet = file(set.model);
    let mut asked = vec!["diagnose", "--seed", "1", "--model", &sheet, "--out", "found"];
    let fitted: Vec<String> = set.fitted.iter().map(|name| file(name)).collect();
    asked.extend(fitted.iter().flat_map(|name| ["--recording", name.as_str()]));
    let mut folder = Call::new(fresh_folder(), &asked).run().expect(0).folder;
    for (model, to) in [(sheet.as_str(), "sheet.xml"), ("found/model.toml", "full.xml")] {
        let asked = ["export", model, "--to", "mjcf", "--out", to, "--format", "json"];
        let ran = Call::new(folder, &asked).run().expect(0);
        let json: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
        if to == "full.xml" {
            let not_expressed = json["unsaid"].as_array().expect("a list").clone();
            not_expressed.iter().for_each(|line| println!("  not said: {line}"));
            let text = std::fs::read_to_string(ran.folder.path().join(model)).expect("the model");
            std::fs::write(ran.folder.path().join("said.toml"), without(&text, &not_expressed))
                .expect("written");
        }
        folder = ran.folder;
    }
    folder
}

/// The arm file `text` without the effects that the list `not_expressed` names completely, and without the parts of shafts that it names.
fn without(text: &str, not_expressed: &[Value]) -> String {
    let mut table: toml::Table = toml::from_str(text).expect("TOML");
    if let Some(effects) = table.get_mut("effect").and_then(toml::Value::as_array_mut) {
        for effect in effects.iter_mut().filter_map(toml::Value::as_table_mut) {
            // A shaft that is only partly expressed.
            let Some(joint) = effect.get("joint").and_then(toml::Value::as_str).map(str::to_owned) else {
                continue;
            };
            for (part, words) in [("inertia", "inertia"), ("viscous", "viscous friction")] {
                let line = format!("joint_coupling at {joint}: its {words} across the joints");
                let is_lost = not_expressed.iter().any(|not_expressed| {
                    not_expressed.as_str().is_some_and(|not_expressed| not_expressed.starts_with(&line))
                });
                if is_lost && effect["kind"].as_str() == Some("joint_coupling") {
                    effect.insert(part.to_owned(), 0.0.into());
                }
            }
        }
        effects.retain(|effect| {
            let kind = effect["kind"].as_str().unwrap_or_default();
            let equation = freeplay_laws::kind(kind).expect("a kind").equation;
            let joint = effect.get("joint").and_then(toml::Value::as_str);
            let line = match joint {
                Some(joint) => format!("{kind} at {joint}: {equation}"),
                None => format!("{kind}: {equation}"),
            };
            !not_expressed.iter().any(|not_expressed| {
                not_expressed.as_str().is_some_and(|not_expressed| not_expressed.starts_with(&line))
            })
        });
    }
    toml::to_string(&table).expect("TOML")
}

/// Prints the channels of `set`, and fails if MuJoCo reduces the error by less than nine tenths of the reduction by the model itself. A channel with a
/// reduction of less than a fifth does not count.
fn round_trip(set: &Set, recordings: &Path) {
    println!("{}", set.folder);
    let mut folder = exported(set, recordings);
    let sheet = recordings.join(set.folder).join(set.model).display().to_string();
    let (mut tested, mut short) = (0, Vec::new());
    for held in set.held {
        let held = recordings.join(set.folder).join(held).display().to_string();
        let (before, kept) = compared(folder, &sheet, &held);
        let (after, kept) = compared(kept, "said.toml", &held);
        let [mut there_before, there_after] = replayed(kept.path(), &held);
        if there_after.keys().all(|name| name.starts_with('q')) {
            // Without servos MuJoCo knows no more than the commands.
            there_before = before.clone();
        }
        folder = kept;
        for (name, [own, theirs]) in taken([&before, &after], [&there_before, &there_after]) {
            let counts = own > 0.2 * before[name];
            println!(
                "  {held} {name}: {:.4} -> {:.4} here, {:.4} -> {:.4} in MuJoCo: {}",
                before[name],
                after[name],
                there_before[name],
                there_after[name],
                if counts { format!("{:.3}", theirs / own) } else { "nothing to take away".to_owned() }
            );
            tested += usize::from(counts);
            if counts && theirs < 0.9 * own {
                short.push(format!("{held} {name}"));
            }
        }
    }
    assert!(tested > 0, "{}: it tests something", set.folder);
    assert!(short.is_empty(), "{short:?}");
}

/// Reduction of the error by channel, by the model itself and in MuJoCo.
fn taken<'a>(own: [&'a Errors; 2], theirs: [&Errors; 2]) -> Vec<(&'a str, [f64; 2])> {
    let channels = own[0].keys().filter(|name| theirs[1].contains_key(*name));
    channels
        .map(|name| (name.as_str(), [own, theirs].map(|[before, after]| before[name] - after[name])))
        .collect()
}

#[test]
fn mujoco_takes_away_of_a_real_axis_what_the_model_itself_takes_away() {
    let Some(recordings) = recordings() else { return };
    round_trip(&EMPS, &recordings);
}

#[test]
#[ignore = "minutes: cargo test --release -p freeplay --test command export:: -- --ignored --nocapture"]
fn mujoco_takes_away_of_an_arm_with_torque_sensors_what_the_model_itself_takes_away() {
    let Some(recordings) = recordings() else { return };
    round_trip(&LWR4, &recordings);
}

#[test]
#[ignore = "minutes: cargo test --release -p freeplay --test command export:: -- --ignored --nocapture"]
fn mujoco_takes_away_of_a_heavy_arm_what_the_model_itself_takes_away() {
    let Some(recordings) = recordings() else { return };
    round_trip(&KR300, &recordings);
}

#[test]
#[ignore = "minutes: cargo test --release -p freeplay --test command export:: -- --ignored --nocapture"]
fn mujoco_takes_away_of_a_double_pendulum_what_the_model_itself_takes_away() {
    let Some(recordings) = recordings() else { return };
    round_trip(&PENDULUM, &recordings);
}

#[test]
#[ignore = "minutes: cargo test --release -p freeplay --test command export:: -- --ignored --nocapture"]
fn mujoco_takes_away_of_a_gap_what_the_model_itself_takes_away() {
    let Some(recordings) = recordings() else { return };
    round_trip(&DAMPER, &recordings);
}

#[test]
#[ignore = "minutes: cargo test --release -p freeplay --test command export:: -- --ignored --nocapture"]
fn mujoco_takes_away_of_servos_what_the_model_itself_takes_away() {
    let Some(recordings) = recordings() else { return };
    round_trip(&SERVOS, &recordings);
}
