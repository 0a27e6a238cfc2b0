//! Set-up findings for a model and recordings: `… --example setup_field -- ARM RECORDING…`.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use freeplay_diagnosis::examine;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, arm, recordings @ ..] = arguments.as_slice() else {
        return Err("give an arm and recordings".into());
    };
    let arm = freeplay_model::load(Path::new(arm))?.arm;
    for file in recordings {
        let recording = freeplay_recording::read(Path::new(file), Some(arm.dof()))?;
        let start = Instant::now();
        let setup = examine(&arm, &recording);
        println!("{file}: {:.2} s, stop {:?}", start.elapsed().as_secs_f64(), setup.stop);
        for finding in &setup.findings {
            println!(
                "    {:?} {} {:?} {:.5} {}\n      {}\n      {}",
                finding.certainty,
                finding.kind,
                finding.joint,
                finding.value,
                finding.unit,
                finding.statement,
                finding.remedy
            );
        }
    }
    Ok(())
}
