//! Cost of recording: time per row of `write`, bytes per row, and the speed of reading.
//!
//! `cargo run --release -p freeplay-recording --example cost`

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use freeplay_recording::{Group, Layout, RowWriter, read};

const ROWS: usize = 100_000;
const JOINTS: usize = 6;

/// 100 columns: a six-axis arm and its latencies.
fn layout() -> Layout {
    let others: Vec<String> = (0..62).map(|k| format!("other{k}")).collect();
    let others: Vec<&str> = others.iter().map(String::as_str).collect();
    Layout::of(JOINTS, &Group::ALL, true, &others).expect("a layout")
}

/// A row like that of a run: angles that move with a little noise, and columns that hardly change.
fn fill(row: &mut [f64], tick: usize, seed: &mut u64) {
    row[0] = tick as f64 * 0.001;
    for (column, value) in row.iter_mut().enumerate().skip(1) {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let noise = (*seed >> 40) as f64 * 1e-12;
        let slow = (tick as f64 * 0.001 + column as f64).sin();
        *value = if column < 60 { slow + noise } else { (tick / 1000 * column) as f64 };
    }
}

fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["run.mcap", "run.csv"] {
        let path = folder.path().join(name);
        write_rows(&path);
        read_rows(&path);
    }
}

fn write_rows(path: &Path) {
    let layout = layout();
    let mut row = vec![0.0; layout.columns().len()];
    let mut seed = 1;
    let mut times: Vec<Duration> = Vec::with_capacity(ROWS);
    let mut writer = RowWriter::create(path, &layout, &[]).expect("created");
    for tick in 0..ROWS {
        fill(&mut row, tick, &mut seed);
        let begin = Instant::now();
        writer.write(&row).expect("written");
        times.push(begin.elapsed());
    }
    let summary = writer.finish().expect("finished");
    times.sort_unstable();
    let at = |share: f64| times[((ROWS - 1) as f64 * share) as usize].as_nanos();
    let mean = times.iter().sum::<Duration>().as_nanos() / ROWS as u128;
    println!(
        "{}: {} columns; write() in ns: mean {mean}, p50 {}, p99 {}, p99.9 {}, max {}; {} bytes per row",
        path.extension().unwrap_or_default().display(),
        row.len(),
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0),
        summary.bytes / summary.rows
    );
}

fn read_rows(path: &Path) {
    let megabytes = fs::metadata(path).expect("there").len() as f64 / 1e6;
    let begin = Instant::now();
    let recording = read(path, Some(JOINTS)).expect("read");
    let seconds = begin.elapsed().as_secs_f64();
    println!(
        "  read {} rows, {megabytes:.1} MB in {seconds:.3} s: {:.0} MB/s, {:.1} million numbers/s",
        recording.len(),
        megabytes / seconds,
        (recording.len() * recording.columns().len()) as f64 / seconds / 1e6
    );
}
