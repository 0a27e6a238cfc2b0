//! A MCAP of ours in the hands of the reference packages: `pip install mcap mcap-ros2-support`, and `PYTHON`
//! names the interpreter that has them.

use std::fs;
use std::path::Path;
use std::process::Command;

use freeplay_recording::{Event, Layout, RowWriter};

const ROWS: u32 = 1_000;

fn python() -> Command {
    Command::new(std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into()))
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

/// The number a line holds behind `name=`, as Python's `float.hex` writes it.
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
        println!("skipped: no Python with mcap and mcap-ros2-support; PYTHON names one");
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
    assert_eq!(found[0], "/freeplay/tick:1000 /freeplay/event:1 4");
    assert_eq!(found[1], "freeplay:{'scenario': 'paper'}");
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
