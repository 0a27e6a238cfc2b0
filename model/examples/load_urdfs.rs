//! Prints a table of all URDFs below a folder: the result of loading, the arm and its purposes, or the error.
//!
//! `cargo run -p freeplay-arm --example load_urdfs -- FOLDER`; with `--notes` it prints the notes on the files, too.

use std::path::{Path, PathBuf};

use freeplay_arm::Purpose;
use freeplay_model::load;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let notes = arguments.iter().any(|argument| argument == "--notes");
    let Some(folder) = arguments.iter().find(|argument| !argument.starts_with("--")) else {
        eprintln!("name a folder with URDFs");
        std::process::exit(2);
    };
    let mut files = Vec::new();
    collect(Path::new(folder), &mut files);
    files.sort();
    let mut counts = [0_usize; 4];
    for path in &files {
        let name = path.strip_prefix(folder).unwrap_or(path).display();
        let file = match load(path) {
            Ok(file) => file,
            Err(error) => {
                counts[3] += 1;
                println!("refused     {name}: {error}");
                continue;
            }
        };
        let fit = |purpose| file.arm.require(purpose).is_ok();
        let (place, words) = match (fit(Purpose::Torque), fit(Purpose::Simulation)) {
            (_, true) => (0, "simulation"),
            (true, false) => (1, "torque"),
            (false, false) => (2, "tool pose"),
        };
        counts[place] += 1;
        println!("{words:11} {name}");
        for note in file.ignored.iter().take(if notes { usize::MAX } else { 1 }) {
            println!("            {note}");
        }
    }
    let [simulation, torque, tool, refused] = counts;
    println!(
        "{} files: {simulation} for simulation, {torque} for torques, {tool} for tool poses, {refused} refused",
        files.len()
    );
}

/// The URDFs below `folder`.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for path in entries.map(|entry| entry.path()) {
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "urdf") {
            files.push(path);
        }
    }
}
