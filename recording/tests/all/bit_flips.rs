//! One flipped bit in an MCAP file costs the chunk that contains it, and never changes other values.
//!
//! `FREEPLAY_BIT_FLIPS` sets the number of random bits in addition to those at the beginning and the end of the file.

use std::ops::Range;
use std::path::Path;

use freeplay_recording::{Event, Layout, McapWriter, ReadError, Recording, read_from};

const ROWS: usize = 2500;

/// Samples of one chunk: 0.25 s of data, and the one that ends it.
const CHUNK: usize = 252;

/// A pseudo-random number from `state` (Knuth, MMIX).
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *state >> 16
}

fn value(row: usize, column: usize) -> f64 {
    (row as f64 * 0.013 + column as f64).sin()
}

/// A recording like that of a run.
fn original() -> Vec<u8> {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    let path = folder.path().join("run.mcap");
    let layout = Layout::new(["t", "q1", "q2", "tau1", "tau2"]).expect("a layout");
    let metadata = [("scenario".to_owned(), "period = 6.0".to_owned())];
    let mut writer = McapWriter::create(&path, &layout, &metadata).expect("created");
    for row in 0..ROWS {
        let t = row as f64 * 1e-3;
        writer.write(&[t, value(row, 1), value(row, 2), value(row, 3), value(row, 4)]).expect("written");
        if row % 700 == 50 {
            writer.event(&Event { t, kind: "swap".into(), text: "a".into() }).expect("written");
        }
    }
    writer.finish().expect("finished");
    std::fs::read(&path).expect("there")
}

fn read(bytes: &[u8]) -> Result<Recording, ReadError> {
    read_from(bytes, Path::new("run.mcap"), None)
}

/// Number of missing samples among the first `rows`; checks that all others are right.
fn missing(recording: &Recording, rows: usize, at: &str) -> usize {
    for (sample, t) in recording.t.iter().enumerate() {
        let row = (t * 1e3).round() as usize;
        assert_eq!(t.to_bits(), (row as f64 * 1e-3).to_bits(), "{at}: time");
        let (tau, q) = (recording.tau.as_ref().expect("torques"), &recording.q);
        for (column, found) in
            [(1, q[0][sample]), (2, q[1][sample]), (3, tau[0][sample]), (4, tau[1][sample])]
        {
            assert_eq!(found.to_bits(), value(row, column).to_bits(), "{at}: row {row}, column {column}");
        }
    }
    assert!(recording.t.windows(2).all(|pair| pair[0] < pair[1]), "{at}: no sample twice");
    for event in &recording.events {
        assert_eq!((event.kind.as_str(), event.text.as_str()), ("swap", "a"), "{at}");
    }
    for (key, value) in &recording.metadata {
        assert_eq!((key.as_str(), value.as_str()), ("scenario", "period = 6.0"), "{at}");
    }
    rows - recording.len()
}

/// Flips each of `bits` of `bytes`, which contain `rows` samples; `essential` is the chunk that describes all others.
fn flip_each(
    bytes: &[u8],
    rows: usize,
    bits: impl Iterator<Item = usize>,
    essential: &Range<usize>,
) -> [usize; 4] {
    let [mut tried, mut harmless, mut most, mut refused] = [0; 4];
    let mut flipped = bytes.to_vec();
    for bit in bits {
        flipped[bit / 8] ^= 1 << (bit % 8);
        let at = format!("bit {} of byte {}", bit % 8, bit / 8);
        match read(&flipped) {
            Ok(recording) => {
                let lost = missing(&recording, rows, &at);
                assert!(lost <= CHUNK, "{at}: {lost} samples lost, {:?}", recording.notes);
                let is_told =
                    recording.notes.iter().any(|note| note.contains("damaged") && note.contains("lost"));
                assert!(lost == 0 || is_told, "{at}: {lost} samples lost, {:?}", recording.notes);
                harmless += usize::from(lost == 0);
                most = most.max(lost);
            }
            Err(error) => {
                assert!(essential.contains(&(bit / 8)), "{at}: {error}");
                assert!(matches!(error, ReadError::Damaged { .. }), "{at}: {error}");
                refused += 1;
            }
        }
        flipped[bit / 8] ^= 1 << (bit % 8);
        tried += 1;
    }
    [tried, harmless, most, refused]
}

fn random_flips() -> usize {
    std::env::var("FREEPLAY_BIT_FLIPS").ok().and_then(|text| text.parse().ok()).unwrap_or(2000)
}

#[test]
fn a_flipped_bit_costs_its_chunk() {
    let bytes = original();
    assert_eq!(missing(&read(&bytes).expect("sound"), ROWS, "sound"), 0);
    let mut state = 1;
    let random = (0..random_flips()).map(|_| next(&mut state) as usize % (8 * bytes.len()));
    // Every seventh bit before and behind the samples, in the parts that describe the file: this reaches each position in a byte.
    let ends = (0..8 * 1200).chain(8 * (bytes.len() - 1500)..8 * bytes.len()).step_by(7);
    let none = 0..0;
    let [tried, harmless, most, refused] = flip_each(&bytes, ROWS, ends.chain(random), &none);
    println!(
        "{} bytes, {tried} bits flipped: {harmless} cost nothing, at most {most} samples lost, {refused} refused",
        bytes.len()
    );
    assert!(most > 100 && harmless > 100 && refused == 0);
}

#[test]
fn a_flipped_bit_in_a_file_without_its_end_costs_its_chunk() {
    let whole = original();
    let bytes = &whole[..whole.len() * 2 / 3];
    let sound = read(bytes).expect("readable without its end");
    assert!(sound.truncated);
    // Without the summary, which repeats the column names, only the first chunk contains them.
    let essential = columns_chunk(bytes);
    let mut state = 2;
    let random = (0..random_flips()).map(|_| next(&mut state) as usize % (8 * bytes.len()));
    let [tried, harmless, most, refused] = flip_each(bytes, sound.len(), random, &essential);
    println!(
        "{} bytes, {tried} bits flipped: {harmless} cost nothing, at most {most} samples lost, {refused} refused",
        bytes.len()
    );
    assert!(most > 100 && harmless > 10);
}

/// Offsets of the chunks.
fn chunks(bytes: &[u8]) -> Vec<usize> {
    let name = [4, 0, 0, 0, b'z', b's', b't', b'd'];
    let named = (37..bytes.len() - 8).filter(|&at| bytes[at..at + 8] == name).map(|at| at - 37);
    // The index of a chunk in the summary names its compression, too.
    named.filter(|&at| bytes[at] == 6).collect()
}

/// The bytes from the first chunk to the first samples.
fn columns_chunk(bytes: &[u8]) -> Range<usize> {
    let chunks = chunks(bytes);
    chunks[0]..chunks[1]
}

#[test]
fn a_long_stretch_of_damage_is_told_with_its_time() {
    let mut bytes = original();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 20_000].fill(0);
    let recording = read(&bytes).expect("the rest is sound");
    let lost = missing(&recording, ROWS, "zeros");
    let note = recording.notes.iter().find(|note| note.contains("damaged")).expect("a note");
    println!("{note}");
    assert!(
        lost > 250 && lost < 1500 && note.contains(&format!("{lost} samples between ")),
        "{lost}: {note}"
    );
}

#[test]
fn the_last_chunk_is_counted_too() {
    let mut bytes = original();
    let last = *chunks(&bytes).last().expect("a chunk");
    bytes[last + 200] ^= 16;
    let recording = read(&bytes).expect("the rest is sound");
    let lost = missing(&recording, ROWS, "the last chunk");
    let note = recording.notes.iter().find(|note| note.contains("damaged")).expect("a note");
    assert!(lost > 10 && note.contains(&format!("{lost} samples after ")), "{lost}: {note}");
}
