//! A written recording is read again, bit for bit, in either format and after conversion from one to the other.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use freeplay_recording::{
    Event, Group, Layout, McapWriter, ReadError, Recording, RowWriter, WriteError, export, read,
};
use proptest::prelude::{ProptestConfig, Strategy, any, prop, prop_assert, prop_assert_eq, proptest};
use proptest::test_runner::RngSeed;

/// Any finite number, from the smallest to the largest, with both zeros.
fn finite() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |v| v.is_finite())
}

/// A recording of 1–3 joints with any of the optional columns, of 1–40 samples.
fn recordings() -> impl Strategy<Value = Recording> {
    let shape = (1..4usize, 1..40usize, any::<[bool; 7]>(), finite());
    shape.prop_flat_map(|(joints, samples, has, start)| {
        let mut names = vec!["t".to_string()];
        for (group, has) in Group::ALL.into_iter().zip(has) {
            let link = group == Group::Link;
            let used = if link { joints.min(2) } else { joints };
            names.extend((0..used).filter(|_| has || group == Group::Position).map(|j| group.column(j)));
        }
        if has[5] {
            names.extend(["x", "y", "z", "qx", "qy", "qz", "qw"].map(String::from));
        }
        if has[6] {
            names.extend(["u [V]", "Größe, \"quoted\"", "u__v", "tau_cmd1"].map(String::from));
        }
        let columns = prop::collection::vec(prop::collection::vec(finite(), samples), names.len());
        columns.prop_map(move |mut columns| {
            let mut t = if start.abs() < 1e300 { start } else { 0.0 };
            for value in &mut columns[0] {
                t = t.next_up();
                *value = t;
            }
            let columns = names.iter().cloned().zip(columns).collect();
            Recording::new(Path::new("made"), columns).expect("made by the rules")
        })
    })
}

/// Every value of every column, as bits.
fn bits(recording: &Recording) -> Vec<(String, Vec<u64>)> {
    let names = recording.columns();
    let values = names.iter().map(|name| recording.column(name).expect("listed"));
    let bits: Vec<Vec<u64>> = values.map(|v| v.iter().map(|x| x.to_bits()).collect()).collect();
    names.into_iter().zip(bits).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn csv_to_mcap_to_csv_changes_no_bit(recording in recordings()) {
        let folder = tempfile::tempdir().expect("a folder");
        let [first, second, third] = ["a.csv", "b.mcap", "c.csv"].map(|name| folder.path().join(name));
        export(&recording, &first).expect("written");
        let from_csv = read(&first, Some(recording.joints())).expect("read");
        prop_assert_eq!(bits(&from_csv), bits(&recording));
        export(&from_csv, &second).expect("written");
        let from_mcap = read(&second, Some(recording.joints())).expect("read");
        prop_assert_eq!(bits(&from_mcap), bits(&recording));
        prop_assert!(!from_mcap.truncated && from_mcap.notes.is_empty());
        export(&from_mcap, &third).expect("written");
        prop_assert_eq!(fs::read(&first).expect("there"), fs::read(&third).expect("there"));
    }
}

fn wave(row: u32) -> [f64; 3] {
    let t = f64::from(row) * 0.001;
    [t, t.sin(), t.cos()]
}

fn layout() -> Layout {
    Layout::new(["t", "q1", "tau1"]).expect("a layout")
}

#[test]
fn metadata_and_events_come_back_from_a_mcap() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let metadata = [("config_hash", "ab12"), ("scenario", "paper"), ("version", "0.1.0")];
    let metadata: Vec<(String, String)> =
        metadata.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let mut writer = RowWriter::create(&path, &layout(), &metadata).expect("created");
    let events: Vec<Event> = (0..5)
        .map(|k| Event { t: f64::from(k) * 0.3, kind: "mark".into(), text: format!("lap {k}, \"°\"\n") })
        .collect();
    for k in 0..1500 {
        if k % 300 == 0 {
            writer.event(&events[k as usize / 300]).expect("written");
        }
        writer.write(&wave(k)).expect("written");
    }
    let summary = writer.finish().expect("finished");
    let size = fs::metadata(&path).expect("there").len();
    assert_eq!((summary.rows, summary.events, summary.bytes), (1500, 5, size));
    let recording = read(&path, Some(1)).expect("read");
    assert_eq!(recording.metadata, metadata);
    assert_eq!(recording.events, events);
    let copy = folder.path().join("copy.mcap");
    export(&recording, &copy).expect("written");
    let again = read(&copy, None).expect("read");
    assert_eq!((again.metadata, again.events), (metadata, events));
}

#[test]
fn a_file_belongs_to_its_owner_even_if_it_was_there_before() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["run.csv", "run.mcap"] {
        let path = folder.path().join(name);
        fs::write(&path, "something longer than what is written below, and readable by everybody")
            .expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).expect("set");
        RowWriter::create(&path, &layout(), &[]).and_then(RowWriter::finish).expect("written");
        let mode = fs::metadata(&path).expect("there").permissions().mode() & 0o777;
        assert_eq!(mode, 0o600, "{name}: {mode:o}");
        assert!(matches!(read(&path, None), Err(ReadError::NoSamples { .. })), "{name}");
    }
}

/// A killed process runs no destructor: neither does a forgotten writer.
#[test]
fn a_killed_recorder_loses_a_quarter_of_a_second() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["run.csv", "run.mcap"] {
        let path = folder.path().join(name);
        let mut writer = RowWriter::create(&path, &layout(), &[]).expect("created");
        for k in 0..10_000 {
            writer.write(&wave(k)).expect("written");
        }
        std::mem::forget(writer);
        let recording = read(&path, None).expect("readable");
        println!("{name}: {} of 10000 rows", recording.len());
        assert!(recording.len() > 9_740 && recording.len() < 10_000);
        assert_eq!(recording.truncated, name.ends_with("mcap"), "a CSV has no end to miss");
        assert_eq!(recording.row(9_000), wave(9_000));
    }
}

#[test]
fn a_dropped_writer_finishes_its_file() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["run.csv", "run.mcap"] {
        let path = folder.path().join(name);
        let mut writer = RowWriter::create(&path, &layout(), &[]).expect("created");
        for k in 0..1_100 {
            writer.write(&wave(k)).expect("written");
        }
        drop(writer);
        let recording = read(&path, None).expect("readable");
        assert_eq!((recording.len(), recording.truncated), (1_100, false), "{name}");
    }
}

/// An MCAP file cut at any place is read up to its last complete chunk, with a note.
#[test]
fn a_mcap_cut_anywhere_is_read_up_to_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let mut writer = McapWriter::create(&path, &layout(), &[]).expect("created");
    for k in 0..2_000 {
        writer.write(&wave(k)).expect("written");
    }
    writer.finish().expect("finished");
    let whole = fs::read(&path).expect("there");
    let mut lengths = Vec::new();
    for cut in (9..whole.len()).step_by(101) {
        let cut_off = freeplay_recording::read_from(&whole[..cut], Path::new("cut.mcap"), None);
        match cut_off {
            Ok(recording) => {
                assert!(recording.truncated && recording.notes.len() == 1, "{cut} bytes");
                lengths.push(recording.len());
            }
            Err(error) => {
                assert!(lengths.is_empty(), "{cut} bytes: {error}");
                let expected =
                    "cut.mcap: no samples: it ends before its first complete chunk; record some motion";
                assert_eq!(error.to_string(), expected);
            }
        }
    }
    assert!(lengths.is_sorted() && lengths[0] < 300 && lengths.last() == Some(&2_000));
    lengths.dedup();
    println!("chunks end after {lengths:?} rows");
}

#[test]
fn a_device_is_no_file_to_write_to() {
    let full = Path::new("/dev/full");
    if !full.exists() {
        freeplay_skip::skip(freeplay_skip::Need::Device, "no /dev/full here");
        return;
    }
    let error = freeplay_recording::CsvWriter::create(full, &layout()).expect_err("a device");
    assert!(matches!(error, WriteError::Create { .. }), "{error}");
    println!("{error}");
    let error = McapWriter::create(full, &layout(), &[]).expect_err("a device");
    assert!(matches!(error, WriteError::Create { .. }) && error.to_string().contains("a device"), "{error}");
}

#[test]
fn wrong_use_of_a_writer_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = RowWriter::create(&folder.path().join("run.txt"), &layout(), &[]).expect_err("no format");
    assert!(matches!(error, WriteError::Ending { .. }), "{error}");
    let error = RowWriter::create(&folder.path().join("no/run.csv"), &layout(), &[]).expect_err("no folder");
    assert!(matches!(error, WriteError::Create { .. }), "{error}");
    assert!(Layout::new(["t", "q2", "tau2"]).is_err());
    assert!(Layout::of(0, &[], false, &[]).is_err());
    let full = Layout::of(2, &[Group::Torque, Group::Link], true, &["gap_mm"]).expect("a layout");
    assert_eq!(full.columns().join(","), "t,q1,q2,tau1,tau2,q_link1,q_link2,x,y,z,qx,qy,qz,qw,gap_mm");
    for name in ["run.csv", "run.mcap"] {
        let path = folder.path().join(name);
        let mut writer = RowWriter::create(&path, &layout(), &[]).expect("created");
        let error = writer.write(&[0.0, 1.0]).expect_err("two values for three columns");
        assert!(matches!(error, WriteError::Width { row: 1, expected: 3, found: 2, .. }), "{error}");
        writer.write(&[0.0, 1.0, f64::NAN]).expect("a recorder hides nothing");
        let event = Event { t: f64::NAN, kind: "fault".into(), text: String::new() };
        assert_eq!(writer.event(&event).is_err(), name.ends_with("mcap"));
        assert_eq!(writer.finish().expect("it goes on").rows, 1);
        let read = read(&path, None).expect("and for a reader it is missing");
        assert!(
            read.tau.is_none() && read.notes.iter().any(|note| note.contains("tau1 throughout")),
            "{:?}",
            read.notes
        );
    }
}
