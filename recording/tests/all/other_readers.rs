//! An MCAP file of ours read by the reference packages, and a bag of theirs read by ours: `pip install mcap mcap-ros2-support`; `FREEPLAY_PYTHON` names the
//! interpreter that has them.

use std::fs;
use std::path::Path;
use std::process::Command;

use freeplay_recording::{BagOptions, Event, Layout, RowWriter, import_bag};

const ROWS: u32 = 1_000;

fn python() -> Command {
    Command::new(std::env::var_os("FREEPLAY_PYTHON").unwrap_or_else(|| "python3".into()))
}

fn available() -> bool {
    python().args(["-c", "import mcap.reader, mcap_ros2.decoder"]).output().is_ok_and(|o| o.status.success())
}

fn lines(path: &Path, mode: &str) -> Vec<String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/other_readers.py");
    let output = python().arg(script).arg(path).arg(mode).output().expect("python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text").lines().map(String::from).collect()
}

fn row(k: u32) -> [f64; 4] {
    let t = f64::from(k) * 0.001;
    [t, t.sin(), f64::from_bits(0x3ff0_0000_0000_0000 + u64::from(k)), -0.0]
}

/// The number after `name=` in a line, in the format of Python's `float.hex`.
fn field(line: &str, name: &str) -> f64 {
    let text =
        line.split(' ').find_map(|part| part.strip_prefix(name)?.strip_prefix('=')).expect("the field");
    let (sign, digits) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let (mantissa, exponent) =
        digits.strip_prefix("0x").and_then(|d| d.split_once('p')).expect("hexadecimal");
    let fraction = mantissa.split_once('.').expect("a point").1;
    let whole = if mantissa.starts_with('1') { 1.0 } else { 0.0 };
    let fraction =
        u64::from_str_radix(fraction, 16).expect("digits") as f64 / 16f64.powi(fraction.len() as i32);
    sign * (whole + fraction) * 2f64.powi(exponent.parse().expect("an exponent"))
}

fn check_rows(rows: &[String]) {
    for (k, line) in rows.iter().enumerate() {
        let expected = row(k as u32);
        let found = ["t", "q1", "q_ref1", "u_v"].map(|name| field(line, name));
        assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits), "{line}");
        assert!(line.starts_with(&format!("{} ", k as u64 * 1_000_000)), "{line}");
    }
}

#[test]
fn the_reference_packages_read_the_same_bits() {
    if !available() {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            "no Python with mcap and mcap-ros2-support; FREEPLAY_PYTHON names one",
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let layout = Layout::new(["t", "q1", "q_ref1", "u [V]"]).expect("a layout");
    let metadata = [("scenario".to_string(), "paper".to_string())];
    let mut writer = RowWriter::create(&path, &layout, &metadata).expect("created");
    for k in 0..ROWS {
        writer.write(&row(k)).expect("written");
    }
    let event = Event { t: 0.5, kind: "fault".into(), text: "encoder".into() };
    writer.event(&event).expect("written");
    writer.finish().expect("finished");

    let found = lines(&path, "indexed");
    let (counts, chunks) = found[0].rsplit_once(' ').expect("the number of chunks at the end");
    assert_eq!(counts, "/freeplay/tick:1000 /freeplay/event:1");
    assert!(chunks.parse::<usize>().is_ok_and(|chunks| chunks > 1), "{chunks} chunks: a cut file loses all");
    assert!(found[1].starts_with("freeplay:{") && found[1].contains("'scenario': 'paper'"), "{}", found[1]);
    assert_eq!(found.len(), 2 + ROWS as usize);
    check_rows(&found[2..]);

    let whole = fs::read(&path).expect("there");
    let cut = folder.path().join("cut.mcap");
    fs::write(&cut, &whole[..whole.len() * 6 / 10]).expect("written");
    let found = lines(&cut, "stream");
    let (last, rows) = found.split_last().expect("some lines");
    println!("cut at 60 %: {} rows, then {last}", rows.len());
    assert!(last.starts_with("stopped:") && rows.len() > 400);
    check_rows(rows);
    let ours = freeplay_recording::read(&cut, None).expect("read").len();
    assert_eq!(ours, rows.len(), "both stop at the last complete chunk");
}

#[test]
fn a_bag_of_the_reference_packages_is_imported() {
    if !available() {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            "no Python with mcap and mcap-ros2-support; FREEPLAY_PYTHON names one",
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bag.mcap");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/other_writers.py");
    let output = python().arg(script).arg(&path).output().expect("python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let joints = ["shoulder", "elbow"].map(String::from).to_vec();
    let recording = import_bag(&path, &BagOptions { joints, ..BagOptions::default() }).expect("imported");
    assert_eq!((recording.len(), recording.joints()), (ROWS as usize, 2));
    let x = &recording.tool.as_ref().expect("a tool")[0];
    for (k, x) in x.iter().enumerate() {
        let angle = k as f64 * 0.01;
        // The poses are linear in time, so that the interpolated values are known.
        for (found, expected) in
            [(recording.q[0][k], angle.cos()), (recording.q[1][k], angle.sin()), (*x, k as f64 * 0.001)]
        {
            assert!((found - expected).abs() < 1e-15, "sample {k}: {found} {expected}");
        }
    }
    assert!(recording.tau.is_none() && recording.velocities().is_ok_and(|qd| qd[0][5] == -5.0));
}
