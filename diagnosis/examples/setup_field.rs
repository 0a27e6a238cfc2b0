//! tmp
use std::path::Path;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let arm = freeplay_arm::load(Path::new(&args[1])).expect("arm").arm;
    for file in &args[2..] {
        let recording = freeplay_recording::read(Path::new(file), None).expect("recording");
        let start = std::time::Instant::now();
        let s = freeplay_diagnosis::explore(&arm, &recording);
        println!("== {file} {:.2} s\n{s}", start.elapsed().as_secs_f64());
    }
}
