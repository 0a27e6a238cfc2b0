//! Success rate of a diagnosis: the confusion matrix over simulated or concealed cases.
//!
//! ```text
//! study perfect COUNT [FIRST_SEED]     recordings in which nothing is missing, made here
//! study missing COUNT [FIRST_SEED]     recordings in which one effect is missing, made here by the catalogue's own laws
//! study folder DIR...                  cases written by the crate `concealed`: NNNN/model.toml, recording.csv, second.csv, truth/NNNN.json
//! study one MODEL RECORDING...         one diagnosis, in full
//! ```

mod made;
mod score;

use std::path::Path;
use std::time::Instant;

use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, diagnose};
use freeplay_model::ArmFile;
use freeplay_recording::Recording;

use score::{Answer, Score, Truth};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    let number =
        |word: Option<&&str>, default: u64| word.and_then(|word| word.parse().ok()).unwrap_or(default);
    match words.as_slice() {
        ["perfect", rest @ ..] => make_many(number(rest.first(), 20), number(rest.get(1), 1), false),
        ["missing", rest @ ..] => make_many(number(rest.first(), 20), number(rest.get(1), 1), true),
        ["folder", folders @ ..] => {
            let mut score = Score::default();
            for folder in folders {
                over_folder(Path::new(folder), &mut score);
            }
            score.print();
        }
        ["one", model, recordings @ ..] => one(Path::new(model), recordings),
        _ => println!("study perfect COUNT | missing COUNT | folder DIR... | one MODEL RECORDING..."),
    }
}

fn make_many(count: u64, first: u64, concealed: bool) {
    let mut score = Score::default();
    for seed in first..first + count {
        let made = made::make(seed, concealed);
        let truth = made.truth.as_ref().map(|table| Truth {
            kind: table.kind.clone(),
            joint: table.joint.clone(),
            parameters: serde_json::to_value(&table.parameters).unwrap_or_default(),
            weak: Vec::new(),
            catalogued: true,
        });
        let answer = run(&made.model, &[made.recording]);
        score.add(&format!("seed {seed}"), &truth.into_iter().collect::<Vec<_>>(), &answer);
    }
    score.print();
}

fn over_folder(folder: &Path, score: &mut Score) {
    let mut cases: Vec<_> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("model.toml").is_file())
        .collect();
    cases.sort();
    for case in cases {
        let name = case.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let truth = std::fs::read_to_string(folder.join("truth").join(format!("{name}.json")));
        let truth: serde_json::Value =
            truth.ok().and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
        let effects: Vec<Truth> = serde_json::from_value(truth["effects"].clone()).unwrap_or_default();
        let Ok(model) = freeplay_model::load(&case.join("model.toml")) else { continue };
        let dof = model.arm.dof();
        let read = |file: &str| freeplay_recording::read(&case.join(file), Some(dof));
        let (Ok(first), Ok(second)) = (read("recording.csv"), read("second.csv")) else { continue };
        score.add(&name, &effects, &run(&model, &[first, second]));
    }
}

fn run(model: &ArmFile, recordings: &[Recording]) -> Answer {
    let start = Instant::now();
    let diagnosis = diagnose(model, recordings, &DiagnoseSettings::default(), &mut |_| {});
    Answer { diagnosis: diagnosis.map_err(|error| error.to_string()), seconds: start.elapsed().as_secs_f64() }
}

fn one(model: &Path, recordings: &[&str]) {
    let model = freeplay_model::load(model).expect("a model");
    let dof = model.arm.dof();
    let recordings: Vec<Recording> = recordings
        .iter()
        .map(|path| freeplay_recording::read(Path::new(path), Some(dof)).expect("a recording"))
        .collect();
    let start = Instant::now();
    let mut last = start;
    let diagnosis = diagnose(&model, &recordings, &DiagnoseSettings::default(), &mut |what| {
        eprintln!("{:6.2} s  {what}", last.elapsed().as_secs_f64());
        last = Instant::now();
    });
    eprintln!("{:6.2} s in all", start.elapsed().as_secs_f64());
    match diagnosis {
        Ok(diagnosis) => print(&diagnosis),
        Err(error) => println!("{error}"),
    }
}

fn print(diagnosis: &Diagnosis) {
    let mut short = diagnosis.clone();
    short.maps.truncate(8);
    short.evidence.truncate(14);
    short.untestable.clear();
    println!("{}", serde_json::to_string_pretty(&short).unwrap_or_default());
}
