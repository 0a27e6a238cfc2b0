//! Speed of lockstep relative to real time: simulated seconds of motion per second of wall time, with both processes. Goal: at
//! least 8.

use std::process::Command;
use std::time::Instant;

fn main() {
    let folder = std::env::temp_dir().join(format!("freeplay-bench-{}", std::process::id()));
    for controller in ["computed-torque", "quasi-static"] {
        let mut factors: Vec<f64> = (0..5)
            .map(|_| {
                let start = Instant::now();
                let status = Command::new(env!("CARGO_BIN_EXE_freeplay"))
                    .args([
                        "run",
                        "--pace",
                        "lockstep",
                        "--set",
                        "path.period=12",
                        "--quiet",
                        "--controller",
                        controller,
                    ])
                    .arg("--out")
                    .arg(&folder)
                    .stdout(std::process::Stdio::null())
                    .status()
                    .expect("freeplay runs");
                assert!(status.success());
                12.0 / start.elapsed().as_secs_f64()
            })
            .collect();
        factors.sort_by(f64::total_cmp);
        println!(
            "{controller:<20} {:.1} x real time (median of 5; {:.1} to {:.1}), start-up and report included",
            factors[2], factors[0], factors[4]
        );
        let text = std::fs::read_to_string(folder.join("summary.json")).expect("a summary");
        let summary: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        for stage in ["plant_step", "round_trip", "compute", "qp"] {
            println!("    {stage:<12} {}", summary["runs"][0]["latency_us"][stage]);
        }
    }
    // A folder that cannot be removed is left to the operating system.
    let _ = std::fs::remove_dir_all(&folder);
}
