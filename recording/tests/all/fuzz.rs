//! For any bytes, a reader returns a valid recording or an error of one line. 24 000 inputs per run; `PROPTEST_CASES` sets another number per test,
//! `PROPTEST_RNG_SEED` other inputs.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;
use std::sync::LazyLock;

use freeplay_recording::{Layout, McapWriter, Recording, read_from};
use mcap::records::MessageHeader;
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop, prop_oneof};
use proptest::sample::Index;
use proptest::test_runner::{RngSeed, TestRunner};

const CASES: u32 = 6_000;

/// A change of a file.
#[derive(Debug, Clone)]
enum Edit {
    Set(Index, u8),
    Insert(Index, u8),
    Remove(Index, usize),
    Repeat(Index, usize),
    Cut(Index),
    Number(Index, u64),
}

fn byte() -> impl Strategy<Value = u8> {
    prop_oneof![any::<u8>(), prop::sample::select(b"0123456789.,;-+eEnaif\"\n\r\t \0tqx_\xff".to_vec())]
}

fn edits() -> impl Strategy<Value = Vec<Edit>> {
    let at = any::<Index>;
    let size = prop_oneof![Just(0), Just(1), Just(u64::MAX), Just(1 << 40), Just(1 << 26), 0..2000u64];
    let edit = prop_oneof![
        4 => (at(), byte()).prop_map(|(i, b)| Edit::Set(i, b)),
        3 => (at(), byte()).prop_map(|(i, b)| Edit::Insert(i, b)),
        2 => (at(), 1..30usize).prop_map(|(i, n)| Edit::Remove(i, n)),
        2 => (at(), 1..60usize).prop_map(|(i, n)| Edit::Repeat(i, n)),
        1 => at().prop_map(Edit::Cut),
        2 => (at(), size).prop_map(|(i, n)| Edit::Number(i, n)),
    ];
    prop::collection::vec(edit, 1..6)
}

fn apply(original: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for edit in edits {
        if bytes.is_empty() {
            break;
        }
        let at = |index: &Index| index.index(bytes.len());
        match edit {
            Edit::Set(i, byte) => {
                let at = at(i);
                bytes[at] = *byte;
            }
            Edit::Insert(i, byte) => bytes.insert(at(i), *byte),
            Edit::Remove(i, count) => drop(bytes.drain(at(i)..bytes.len().min(at(i) + count))),
            Edit::Repeat(i, count) => {
                let part = bytes[at(i)..bytes.len().min(at(i) + count)].to_vec();
                bytes.splice(at(i)..at(i), part);
            }
            Edit::Cut(i) => bytes.truncate(at(i)),
            Edit::Number(i, number) => {
                let (start, end) = (at(i), bytes.len().min(at(i) + 8));
                bytes[start..end].copy_from_slice(&number.to_le_bytes()[..end - start]);
            }
        }
    }
    bytes
}

/// Reads the bytes under both names and checks the answers; returns whether they are a recording.
fn check(bytes: &[u8], name: &str) -> bool {
    match read_from(bytes, Path::new(name), None) {
        Ok(recording) => {
            check_rules(&recording);
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with(name) && !text.contains(char::is_control), "{text:?}");
            assert!(text.len() < 2_000, "{} bytes of message", text.len());
            false
        }
    }
}

fn check_rules(recording: &Recording) {
    assert!(recording.t.windows(2).all(|w| w[0] < w[1]), "time increases");
    assert!(!recording.is_empty() && recording.joints() > 0 && recording.q_link.len() == recording.joints());
    for name in recording.columns() {
        let values = recording.column(&name).expect("listed");
        assert_eq!(values.len(), recording.len(), "{name}");
        let outside = recording.others.iter().any(|(other, _)| *other == name);
        let is_needed = name == "t" || (name.starts_with('q') && name[1..].parse::<u64>().is_ok());
        assert!(outside || values.iter().all(|v| v.is_finite() || (!is_needed && v.is_nan())), "{name}");
    }
}

const CSV: &[u8] =
    b"t,q1,q2,tau1,tau2,u\n0,1.5,-2e-3,10,\"20\",7\n0.001,1.6,-1e-3,11,21,8\n0.0021,1.7, 0,12,22,9\n";

/// The file of a recorder: compressed, with checksums.
static MCAP: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let layout = Layout::new(["t", "q1", "u 1"]).expect("a layout");
    let mut writer = McapWriter::create(&path, &layout, &[("a".into(), "b".into())]).expect("created");
    for k in 0..12 {
        writer.write(&[f64::from(k) * 0.1, 1.0, 2.0]).expect("written");
    }
    writer.finish().expect("finished");
    std::fs::read(&path).expect("there")
});

/// The same without compression and checksums, so that changes reach the records inside.
static PLAIN_MCAP: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let options =
        mcap::WriteOptions::new().compression(None).calculate_chunk_crcs(false).chunk_size(Some(200));
    let mut writer = options.create(Cursor::new(Vec::new())).expect("in memory");
    let schema =
        writer.add_schema("freeplay_msgs/msg/Tick", "ros2msg", b"float64 t\nfloat64 q1\n").expect("added");
    let tick = writer.add_channel(schema, "/freeplay/tick", "cdr", &BTreeMap::new()).expect("added");
    let event = writer.add_channel(0, "/freeplay/event", "json", &BTreeMap::new()).expect("added");
    for k in 0..12_u32 {
        let mut data = vec![0, 1, 0, 0];
        data.extend([f64::from(k), 0.5].iter().flat_map(|v| v.to_le_bytes()));
        let mut header = MessageHeader { channel_id: tick, sequence: k, log_time: k.into(), publish_time: 0 };
        writer.write_to_known_channel(&header, &data).expect("written");
        header.channel_id = event;
        writer.write_to_known_channel(&header, br#"{"t":1.5,"kind":"mark","text":"a"}"#).expect("written");
    }
    writer.finish().expect("finished");
    writer.into_inner().into_inner()
});

/// Checks many inputs; both answers must occur, else the inputs reach too little.
fn fuzz<S: Strategy>(strategy: &S, input: impl Fn(S::Value) -> (Vec<u8>, &'static str)) {
    let (cases, recordings) = run(strategy, input);
    assert!(recordings > 0 && recordings < cases);
}

/// Checks many inputs; returns their number, and the number of valid recordings.
fn run<S: Strategy>(strategy: &S, input: impl Fn(S::Value) -> (Vec<u8>, &'static str)) -> (u32, u32) {
    let default = ProptestConfig::default();
    let cases = if std::env::var_os("PROPTEST_CASES").is_some() { default.cases } else { CASES };
    let seed = if default.rng_seed == RngSeed::Random { RngSeed::Fixed(1) } else { default.rng_seed };
    let config = ProptestConfig { cases, rng_seed: seed, failure_persistence: None, ..default };
    let recordings = Cell::new(0);
    let outcome = TestRunner::new(config).run(strategy, |value| {
        let (bytes, name) = input(value);
        recordings.set(recordings.get() + u32::from(check(&bytes, name)));
        Ok(())
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
    println!("{cases} inputs, {} of them recordings", recordings.get());
    (cases, recordings.get())
}

#[test]
fn any_bytes() {
    let strategy = (prop::collection::vec(byte(), 0..400), 0..3usize);
    let prefixes: [(&[u8], _); 3] = [(b"", "run.csv"), (b"t,q1,u\n", "run.csv"), (mcap::MAGIC, "run.mcap")];
    for (bytes, name) in [(CSV, "run.csv"), (&*MCAP, "run.mcap"), (&*PLAIN_MCAP, "run.mcap")] {
        assert!(check(bytes, name), "{name}: what is mutated is a recording");
    }
    run(&strategy, |(bytes, kind)| {
        let (prefix, name) = prefixes[kind];
        ([prefix, &bytes].concat(), name)
    });
}

#[test]
fn mutated_csv() {
    fuzz(&edits(), |edits| (apply(CSV, &edits), "run.csv"));
}

#[test]
fn mutated_mcap() {
    fuzz(&edits(), |edits| (apply(&MCAP, &edits), "run.mcap"));
}

#[test]
fn mutated_mcap_without_checksums() {
    fuzz(&edits(), |edits| (apply(&PLAIN_MCAP, &edits), "run.mcap"));
}
