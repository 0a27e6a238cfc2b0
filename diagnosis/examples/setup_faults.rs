//! tmp eval
use std::path::Path;
use freeplay_concealed::*;
use freeplay_recording::Recording;

fn recording(samples: &Samples) -> Recording {
    let mut columns = vec![("t".to_owned(), samples.t.clone())];
    columns.extend(samples.names.iter().cloned().zip(samples.columns.iter().cloned()));
    Recording::new(Path::new("made.csv"), columns).expect("recording")
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let mode = args[1].as_str();
    let rounds: u64 = args[2].parse().expect("rounds");
    let seed0: u64 = args[3].parse().expect("seed");
    let only: Option<&str> = args.get(4).map(String::as_str);
    let machines = [Machine::SixBench, Machine::SixCell, Machine::Seven, Machine::Three, Machine::Paper, Machine::Two, Machine::Slide];
    let beside = ["", "coulomb_friction", "payload", "joint_coupling"];
    for round in 0..rounds {
        for machine in machines {
            let kinds: Vec<String> = if mode == "clean" {
                let all: Vec<&str> = std::iter::once("").chain(CATALOGUE).collect();
                vec![all[((seed0 + round) as usize * 7 + machine as usize) % all.len()].to_owned()]
            } else {
                vec![beside[(round as usize + machine as usize) % 4].to_owned()]
            };
            for kind in kinds {
                let seed = seed0 * 1000 + round * 50 + machine as u64;
                let effects = if kind.is_empty() { vec![] } else { vec![Demand { kind: kind.clone(), joint: None, severity: if round % 2 == 0 { Severity::Strong } else { Severity::Clear } }] };
                let case = Case { machine, effects, family: None, noise: Noise::ALL[(round % 3) as usize], hollow: false, seed };
                let Ok(made) = generate(&case) else { println!("- not made {machine:?} {kind}"); continue };
                let n = made.truth.joints;
                let faults: Vec<Vec<&'static str>> = match mode {
                    "clean" => vec![vec![]],
                    "two" => SETUP.iter().filter(|k| only.is_none_or(|o| o == **k)).map(|k| vec![*k, SETUP[(seed as usize * 3 + k.len()) % 14]]).filter(|v| v[0] != v[1]).collect(),
                    _ => SETUP.iter().filter(|k| only.is_none_or(|o| o == **k)).map(|k| vec![*k]).collect(),
                };
                for (f, faults) in faults.into_iter().enumerate() {
                    let pick = (seed + f as u64) % 4;
                    let kept = Kept { torque: pick != 3, tool: pick == 0 || pick == 3, friction: (seed + f as u64) % 3 != 0 };
                    let Ok(Some((made, truth))) = with_setup_faults(&made, &faults, kept, seed * 31 + f as u64) else { continue };
                    let file = freeplay_arm::parse_toml(&made.model, Path::new("model.toml")).expect("model");
                    let recording = recording(&made.recording);
                    let start = std::time::Instant::now();
                    let out = freeplay_diagnosis::explore(&file.arm, &recording);
                    let truth: Vec<String> = truth.iter().map(|t| format!("{} {:?} {:.3?} {}", t.kind, t.joints, t.values, t.detail)).collect();
                    println!("== {machine:?} n={n} beside={kind} {} {}{} {:.0}s | {:.2}s | TRUTH {truth:?}\n{out}", made.truth.families[0], if kept.torque {"T"} else {""}, if kept.tool {"P"} else {""}, made.truth.duration, start.elapsed().as_secs_f64());
                }
            }
        }
    }
}
