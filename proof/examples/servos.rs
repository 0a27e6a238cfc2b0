//! Diagnoses recordings of commanded and measured positions and prints the findings.
//!
//! `cargo run --release -p freeplay-proof --example servos -- ARM RECORDING...`
#![allow(clippy::unwrap_used, reason = "an example ends at the first surprise")]

use std::path::{Path, PathBuf};
use std::time::Instant;

use freeplay_diagnosis::page::{Subject, commands, diagnose_command, document};
use freeplay_diagnosis::{DiagnoseSettings, compare_commands, diagnose};
use freeplay_model::to_toml;
use freeplay_recording::read;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let file = freeplay_model::load(Path::new(&arguments[0])).unwrap();
    let paths: Vec<PathBuf> = arguments[1..].iter().map(PathBuf::from).collect();
    let recordings: Vec<_> = paths.iter().map(|path| read(path, None).unwrap()).collect();
    let began = Instant::now();
    let mut say = |what: &str| eprintln!("{:6.1} s {what}", began.elapsed().as_secs_f64());
    let diagnosis = diagnose(&file, &recordings, &DiagnoseSettings::default(), &mut say).unwrap();
    println!("{:?}: {}", diagnosis.verdict, diagnosis.statement);
    for location in &diagnosis.location {
        println!("{:?} {:.2} {}", location.joint, location.share, location.when);
    }
    for effect in &diagnosis.effects {
        println!("- {}", effect.statement);
    }
    println!("{:#?}", diagnosis.fit);
    let subject = Subject {
        model: &arguments[0],
        file: &file,
        recordings: &paths,
        command: diagnose_command(&arguments[0], None, &paths, None, None),
        commands: commands(Path::new("model.toml"), &paths[0], None, None),
        diagnosis: &diagnosis,
        out: Path::new("."),
    };
    println!("page of {} bytes", document(&subject).to_html().len());
    let again = freeplay_model::parse_toml(&to_toml(&diagnosis.model), "found.toml".as_ref()).unwrap();
    for recording in &recordings {
        let (comparison, _) = compare_commands(&again, recording).unwrap();
        let errors: Vec<String> =
            comparison.channels.iter().map(|channel| format!("{:.2}", channel.rmse * 1e3)).collect();
        println!("{}: {} mrad", recording.origin.display(), errors.join(" "));
    }
}
