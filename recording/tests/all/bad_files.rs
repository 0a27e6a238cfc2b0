//! Every fault of a CSV gives one clear line: the place, the column, the value and the remedy.

use std::fs;
use std::path::Path;

use freeplay_recording::{ReadError, Recording, read, read_from};

fn csv(text: &[u8]) -> Result<Recording, ReadError> {
    read_from(text, Path::new("run.csv"), None)
}

fn with_joints(text: &str, joints: usize) -> Result<Recording, ReadError> {
    read_from(text.as_bytes(), Path::new("run.csv"), Some(joints))
}

const COLUMNS: [(&str, &str); 6] = [
    ("\nq1,q2\n0,0", "run.csv:2: column t is missing (add the time of each row, s); found: q1, q2"),
    ("u,v\n0,0", "run.csv:1: column t is missing (add the time of each row, s); found: u, v"),
    (
        "t,x,y,z\n0,0,0,0",
        "run.csv:1: column q1 is missing (add the position of joint 1, rad); found: t, x, y, z",
    ),
    (
        "t,q1,q3\n0,0,0",
        "run.csv:1: column q2 is missing (add the position of joint 2, rad); found: t, q1, q3",
    ),
    ("t,q0,q1\n0,0,0", "run.csv:1: column q0: joints are counted from 1; rename q0, q1… to q1, q2…"),
    ("t,q1,u,q1\n0,0,0,0", "run.csv:1: column q1 occurs twice; rename or remove one of them"),
];

const NOTHING_LEFT: &str =
    "no row is left; record it, or name another column for it in a mapping file: freeplay record import";

const CELLS: [(&str, &str); 12] = [
    (
        "t,q1\n0,0\n\n\r\n1,oops\n",
        "run.csv:5: column q1: \"oops\" is not a number; correct the cell, empty it or remove the row",
    ),
    (
        "t,q1\r\n0,0\r\n1,0x1F\r\n",
        "run.csv:3: column q1: \"0x1F\" is not a number; correct the cell, empty it or remove the row",
    ),
    (
        "t,q1\n0,\"0,5\"\n",
        "run.csv:2: column q1: \"0,5\" is not a number; write decimals with a point instead of a comma",
    ),
    (
        "t,q1\n0,1.5.2\n",
        "run.csv:2: column q1: \"1.5.2\" is not a number; correct the cell, empty it or remove the row",
    ),
    (
        "t,q1\n0,0,5\n0,1,5\n",
        "run.csv:2: expected 2 cells as in the header, found 3; complete or remove the row (decimals are written with a point, not a comma)",
    ),
    (
        "t,q1\n0,0\n0,0\n0,1\n",
        "run.csv:3: column t: 0.0 does not come after 0.0 in the row before: the clock stands still, jumps back or begins again here; cut the file into one recording each, or correct the times from here on",
    ),
    ("t,q1\n", "run.csv: no samples; record some motion"),
    ("", "run.csv: the file is empty; a CSV begins with a header such as t,q1,q2"),
    ("\n\n", "run.csv: the file is empty; a CSV begins with a header such as t,q1,q2"),
    (
        "0.0,1.5\n0.1,1.6\n",
        "run.csv:1: no header: the first line begins with \"0.0\"; put the column names first, e.g. t,q1,q2, or name the columns by number in a mapping file (columns = \"1\") for freeplay record import",
    ),
    (
        "# made by hand\n0.0,1.5\n0.1,1.6\n",
        "run.csv:1: no header: the first line begins with \"0.0\"; put the column names first, e.g. t,q1,q2, or name the columns by number in a mapping file (columns = \"1\") for freeplay record import",
    ),
    (
        "t,q1\n0,0\n0.01,0.1\n0.02,0.2\n0,5\n0.01,5.1\n0.02,5.2\n",
        "run.csv:5: column t: 0.0 does not come after 0.02 in the row before: the clock stands still, jumps back or begins again here; cut the file into one recording each, or correct the times from here on",
    ),
];

/// Files without a complete row, and the missing value of their first row.
const LACKING: [(&str, &str); 4] = [
    ("t,q1\n0,1e999\n", "run.csv:2: column q1 holds no number, and all 1 rows lack such a value: "),
    ("t,q1\nNaN,0\n", "run.csv:2: column t holds no number, and all 1 rows lack such a value: "),
    ("t,q1\n0,\n", "run.csv:2: column q1 holds no number, and all 1 rows lack such a value: "),
    (
        "t,q1,q2\n0,nan,1\n1,0,null\n2,0,\n",
        "run.csv:3: column q2 holds no number, and all 3 rows lack such a value: ",
    ),
];

#[test]
fn each_bad_text_has_its_message() {
    for (text, lacking) in LACKING {
        let error = csv(text.as_bytes()).expect_err(text);
        assert_eq!(error.to_string(), format!("{lacking}{NOTHING_LEFT}"), "{text:?}");
    }
    let all = COLUMNS.iter().chain(&CELLS);
    for (text, expected) in all.clone() {
        let error = csv(text.as_bytes()).expect_err(text);
        assert_eq!(error.to_string(), *expected, "{text:?}");
    }
    println!("{} bad texts", all.count());
}

#[test]
fn another_number_of_joints_is_an_error() {
    let text = "t,q1,q2,q3\n0,0,0,0\n";
    assert_eq!(with_joints(text, 3).expect("three joints").joints(), 3);
    let error = with_joints(text, 6).expect_err("three joints are not six");
    assert_eq!(
        error.to_string(),
        "run.csv:1: expected 6 joint(s) (q1…q6), found 3 (q1…q3): is this a recording of this arm?"
    );
}

#[test]
fn bytes_that_are_no_text_are_told_apart() {
    let utf16: Vec<u8> = "\u{feff}t,q1\n0,0\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let cases: [(&[u8], &str); 9] = [
        (&utf16, "UTF-16 text: save it as UTF-8"),
        (b"PK\x03\x04\x14\0\0\0", "it can't be read from a stream"),
        (b"\x1f\x8b\x08\0", "compressed by gzip: gunzip it first"),
        (b"\x28\xb5\x2f\xfd", "compressed by zstd"),
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64", "a MATLAB v7.3 file: save it with -v7"),
        (b"\x89HDF\r\n\x1a\n", "a HDF5 file: write it as .npz or CSV"),
        (b"<?xml version=\"1.0\"?>\n<robot>\n", "XML, such as the model of a robot"),
        (b"{\"t\": [0, 1]}", "JSON: write it as CSV"),
        (b"\x7fELF\x02\x01\x01\0\0\0\n\0\0", "it holds zero bytes"),
    ];
    for (bytes, what) in cases {
        let error = csv(bytes).expect_err(what);
        assert!(matches!(error, ReadError::NotText { .. }), "{error}");
        let error = error.to_string();
        assert!(
            error.starts_with(&format!("run.csv: {what}"))
                && error.contains("the readable formats are CSV, MCAP"),
            "{error}"
        );
    }
    let error = csv(b"t,q1\n0,\xff\xfe\n").expect_err("garbage below the header");
    assert!(error.to_string().starts_with("run.csv:2: column q1: \"ÿþ\" is not a number"), "{error}");
}

#[test]
fn a_line_without_end_is_refused_in_bounded_memory() {
    let endless = std::io::Read::chain(&b"t,q1\n0,0\n1,"[..], std::io::repeat(b'7'));
    let error = read_from(endless, Path::new("run.csv"), None).expect_err("an endless line");
    assert!(matches!(error, ReadError::LongLine { .. }), "{error}");
    assert!(error.to_string().starts_with("run.csv:3: the line is longer than 1048576 bytes"), "{error}");

    let text = format!("t,q1\n0,0\n1,\"0\n{}", "2,0\n".repeat(500_000));
    let error = csv(text.as_bytes()).expect_err("a quote that is never closed");
    assert!(error.to_string().starts_with("run.csv:3: the line is longer"), "{error}");

    let zeros = read_from(std::io::repeat(0), Path::new("/dev/zero"), None).expect_err("endless zeros");
    assert!(matches!(zeros, ReadError::NotText { .. }), "{zeros}");
}

#[test]
fn what_is_not_wrong_is_read() {
    let expected = csv(b"t,q1\n0,1.5\n1,-2\n").expect("plain");
    let texts: [&[u8]; 10] = [
        b"\xef\xbb\xbft,q1\n0,1.5\n1,-2\n",
        b"\xef\xbb\xbf\"t\",\"q1\"\r\n\"0\",\"1.5\"\r\n1,-2\r\n",
        b"t,q1\r\n0,1.5\r\n1,-2\r\n",
        b"t,q1\r0,1.5\r1,-2\r",
        b"t,q1\n0,1.5\n1,-2",
        b"t , q1\n0 , 1.5\n 1,\t-2 \n",
        b"t, \"q1\"\n0, \"1.5\"\n1, \"-2\"\n",
        b"\nt,q1\n\n0,1.5\n\n1,-2\n\n",
        b"t,q1\n0.0,15e-1\n1.,-2.000\n",
        b"t,q1\n+0,+1.5\n1E0,-2\n",
    ];
    for text in texts {
        let recording =
            csv(text).unwrap_or_else(|error| panic!("{}: {error}", String::from_utf8_lossy(text)));
        assert_eq!(recording, expected, "{}", String::from_utf8_lossy(text));
    }
    let reordered = csv(b"q1,t\n1.5,0\n-2,1\n").expect("columns in another order");
    assert_eq!(reordered, expected);
}

#[test]
fn columns_outside_the_contract_are_kept_and_odd_cells_noted() {
    let text = b"t,mode,q1,u,qd_ref1\n0,idle,0,,NaN\n0.1,\"a, b\",0,3,1\n0.3,2,0,4,2\n";
    let recording = csv(text).expect("text outside the contract does no harm");
    let names: Vec<&str> = recording.others.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["mode", "u", "qd_ref1"]);
    assert_eq!(recording.columns(), ["t", "q1", "mode", "u", "qd_ref1"]);
    let mode = recording.column("mode").expect("kept");
    assert!(mode[0].is_nan() && mode[1].is_nan() && mode[2] == 2.0);
    assert_eq!(
        recording.notes,
        ["column mode is not used: 2 of its 3 cells are no numbers (first run.csv:2: \"idle\"), kept as NaN",]
    );
    assert_eq!(recording.column("q2"), None);
}

#[test]
fn what_is_no_file_is_said_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = read(folder.path(), None).expect_err("a folder");
    assert!(
        matches!(error, ReadError::Folder { .. }) && error.to_string().contains("is a folder"),
        "{error}"
    );

    let error = read(&folder.path().join("none.csv"), None).expect_err("no file");
    assert!(matches!(error, ReadError::Io { .. }) && error.to_string().contains("No such file"), "{error}");

    let path = folder.path().join("run.mcap");
    fs::write(&path, "t,q1\n0,0\n").expect("written");
    assert_eq!(read(&path, None).expect("a CSV under a wrong name").len(), 1);

    let link = folder.path().join("loop.csv");
    std::os::unix::fs::symlink(&link, &link).expect("a link to itself");
    let error = read(&link, None).expect_err("a loop");
    assert!(matches!(error, ReadError::Io { .. }), "{error}");
}

#[test]
fn recordings_made_in_memory_obey_the_same_rules() {
    let made =
        |t: Vec<f64>, q: Vec<f64>| Recording::new(Path::new("made"), vec![("t".into(), t), ("q1".into(), q)]);
    let recording = made(vec![0.0, 0.5, 1.5], vec![1.0, 2.0, 3.0]).expect("a recording");
    assert_eq!((recording.len(), recording.joints(), recording.duration()), (3, 1, 1.5));
    let error = made(vec![0.0], vec![f64::INFINITY]).expect_err("infinite");
    assert!(error.to_string().starts_with("made, sample 1: column q1 holds no number"), "{error}");
    let error = made(vec![0.0, 0.5], vec![1.0]).expect_err("unequal");
    assert!(error.to_string().starts_with("made: column q1 has 1 values, t has 2"), "{error}");
    assert!(matches!(made(vec![], vec![]), Err(ReadError::NoSamples { .. })));
    let absent = recording.torques().expect_err("no torques");
    assert_eq!(absent.to_string(), "made: no column tau1…tau1; record the measured joint torques, N·m");
}

#[test]
fn the_rate_is_the_median_steps() {
    let steps = [0.004, 0.004, 0.0041, 0.0039, 1.0];
    let mut t = vec![10.0];
    for step in steps {
        t.push(t[t.len() - 1] + step);
    }
    let q = vec![0.0; t.len()];
    let recording = Recording::new(Path::new("made"), vec![("t".into(), t), ("q1".into(), q)]).expect("made");
    let error = (recording.rate_hz() - 250.0).abs();
    println!("rate {} Hz, off by {error:.1e}", recording.rate_hz());
    assert!(error < 1e-6, "a pause does not count");
}
