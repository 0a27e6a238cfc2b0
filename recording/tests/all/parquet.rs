//! A recording as Parquet keeps every bit, also when other packages read it.

use std::fs::File;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use freeplay_recording::{Recording, export};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;

const ROWS: usize = 1_000;

fn recording() -> Recording {
    let column = |value: fn(f64) -> f64| (0..ROWS).map(|k| value(k as f64)).collect::<Vec<f64>>();
    let columns = vec![
        ("t".to_owned(), column(|k| k * 0.001)),
        ("q1".to_owned(), column(f64::sin)),
        ("u [V]".to_owned(), column(|k| if k == 7.0 { f64::NAN } else { 1.0 / (k + 3.0) })),
    ];
    let mut recording = Recording::new(Path::new("memory"), columns).expect("a recording");
    recording.metadata = vec![("scenario".to_owned(), "paper".to_owned())];
    recording
}

#[test]
fn every_bit_comes_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.parquet");
    let recording = recording();
    let summary = export(&recording, &path).expect("written");
    let metadata = std::fs::metadata(&path).expect("there");
    assert_eq!((summary.rows, summary.bytes), (ROWS as u64, metadata.len()));
    assert_eq!(metadata.permissions().mode() & 0o777, 0o600);
    let reader = SerializedFileReader::new(File::open(&path).expect("there")).expect("Parquet");
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let names: Vec<&str> = schema.columns().iter().map(|column| column.name()).collect();
    assert_eq!(names, ["t", "q1", "u [V]"]);
    for (k, row) in reader.get_row_iter(None).expect("rows").enumerate() {
        let row = row.expect("a row");
        for (i, expected) in recording.row(k).iter().enumerate() {
            assert_eq!(row.get_double(i).expect("a double").to_bits(), expected.to_bits(), "row {k}");
        }
    }
}

#[test]
fn pandas_reads_the_same_numbers() {
    let python = std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let available = Command::new(&python).args(["-c", "import pandas, pyarrow"]).output();
    if !available.is_ok_and(|output| output.status.success()) {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            "no Python with pandas and pyarrow; FREEPLAY_PYTHON names one",
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.parquet");
    export(&recording(), &path).expect("written");
    let script = "import pandas, sys\nframe = pandas.read_parquet(sys.argv[1])\n\
                  print(*frame.columns, sep='|')\nprint(len(frame), frame['q1'].sum().hex(), frame['u [V]'].isna().sum())";
    let output = Command::new(python).args(["-c", script]).arg(&path).output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    println!("{text}");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("t|q1|u [V]"));
    assert!(lines.next().is_some_and(|line| line.starts_with("1000 ") && line.ends_with(" 1")), "{text}");
}
