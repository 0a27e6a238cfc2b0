//! Compressed files that would inflate to far more data than they can validly contain: the reader refuses them, or skips the excess, in little memory.
//!
//! In a process of its own, since the kernel counts the peak memory of a process.

use std::fs::File;
use std::io::{Cursor, Read, Write, copy, repeat};
use std::path::Path;

use flate2::Compression;
use flate2::write::{DeflateEncoder, ZlibEncoder};
use freeplay_recording::read;

/// Number of elements of an array of zeros: 256 MiB as bytes, 2 GiB in memory.
const ZEROS: u64 = 1 << 28;

/// Memory limit for all these files together, KiB.
const MOST_KIB: u64 = 64 << 10;

/// Peak memory of this process, KiB.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("a process");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("the peak");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number")
}

/// The file of a NumPy array of the type `kind` and this `shape`, with `body`.
fn npy(kind: &str, shape: &str, body: impl Read) -> impl Read {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}\n");
    let mut start = b"\x93NUMPY\x01\x00".to_vec();
    start.extend((header.len() as u16).to_le_bytes());
    start.extend(header.as_bytes());
    Cursor::new(start).chain(body)
}

fn numbers(values: &[f64]) -> Cursor<Vec<u8>> {
    Cursor::new(values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// A file in an archive: its name and its content.
type Member = (&'static str, Box<dyn Read>);

/// Writes an archive of `members`, each deflated.
fn zip(path: &Path, members: Vec<Member>) {
    let (mut file, mut directory, mut count) = (Vec::new(), Vec::new(), 0_u16);
    for (name, mut data) in members {
        let offset = file.len() as u32;
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        let size = copy(&mut data, &mut encoder).expect("deflated") as u32;
        let deflated = encoder.finish().expect("deflated");
        // Version, flags, method, time, date, checksum, sizes, length of the name, of the extra field.
        let mut common = Vec::new();
        [20_u16, 0, 8, 0, 0].iter().for_each(|word| common.extend(word.to_le_bytes()));
        [0, deflated.len() as u32, size].iter().for_each(|word| common.extend(word.to_le_bytes()));
        [name.len() as u16, 0].iter().for_each(|word| common.extend(word.to_le_bytes()));
        file.extend(b"PK\x03\x04");
        file.extend(&common);
        file.extend(name.as_bytes());
        file.extend(&deflated);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
        count += 1;
    }
    let start = file.len() as u32;
    file.extend(&directory);
    file.extend(b"PK\x05\x06\0\0\0\0");
    [count, count].iter().for_each(|word| file.extend(word.to_le_bytes()));
    [directory.len() as u32, start].iter().for_each(|word| file.extend(word.to_le_bytes()));
    file.extend([0; 2]);
    std::fs::write(path, file).expect("a file");
}

/// An element of a MAT-file: a type and its data, padded to a multiple of eight bytes.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut element = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    element.extend(data);
    element.resize(element.len().next_multiple_of(8), 0);
    element
}

/// Writes a MAT-file with one compressed array, of the class `class` and with these `sizes`, whose data are `zeros` bytes of zeros.
fn mat(path: &Path, class: u8, sizes: &[u8], zeros: u32) {
    let mut start = [element(6, &[class, 0, 0, 0, 0, 0, 0, 0]), element(5, sizes), element(1, b"q")].concat();
    start.extend([1_u32.to_le_bytes(), zeros.to_le_bytes()].concat());
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&14_u32.to_le_bytes()).expect("deflated");
    encoder.write_all(&(start.len() as u32 + zeros).to_le_bytes()).expect("deflated");
    copy(&mut Cursor::new(start).chain(repeat(0).take(u64::from(zeros))), &mut encoder).expect("deflated");
    let compressed = encoder.finish().expect("deflated");
    let mut file = File::create(path).expect("a file");
    let mut header = [b' '; 128];
    header[..10].copy_from_slice(b"MATLAB 5.0");
    header[124..].copy_from_slice(b"\x00\x01IM");
    file.write_all(&header).expect("written");
    file.write_all(&[15_u32.to_le_bytes(), (compressed.len() as u32).to_le_bytes()].concat())
        .expect("written");
    file.write_all(&compressed).expect("written");
}

fn sizes(sizes: &[u32]) -> Vec<u8> {
    sizes.iter().flat_map(|size| size.to_le_bytes()).collect()
}

/// Arrays, and the expected message for a file with them.
fn archives() -> Vec<(Vec<Member>, &'static str)> {
    let zeros = || repeat(0).take(ZEROS);
    let none = || std::io::empty();
    let many = Box::new(npy("|i1", "268435456,", zeros())) as Box<dyn Read>;
    vec![
        (vec![("t.npy", many)], "claim more samples than so short a file can contain"),
        (vec![("t.npy", Box::new(npy("|i1", "16384, 16385", zeros())))], "write fewer rows"),
        (
            vec![
                ("t.npy", Box::new(npy("<f8", "0,", none()))),
                ("q.npy", Box::new(npy("<f8", "0, 1152921504606846976", none()))),
            ],
            "its arrays are empty",
        ),
        (vec![("t.npy", Box::new(npy("<f8", "36893488147419103232,", none())))], "its shape is too large"),
        (vec![("t.npy", Box::new(npy("<f8", "9,", numbers(&[0.0; 3]))))], "it ends before its last number"),
        (vec![("names.npy", Box::new(npy("<U1048576", "64,", zeros())))], "without arrays of numbers"),
    ]
}

#[test]
fn what_a_file_may_inflate_to_is_bounded_before_it_is_inflated() {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    let path = folder.path().join("run");
    let refused = |what: &str| {
        let length = std::fs::metadata(&path).expect("a file").len();
        let said = read(&path, None).expect_err("refused").to_string();
        println!("{length} bytes, the most memory so far {} KiB: {said}", peak_kib());
        assert!(said.contains(what), "{said}, not {what}");
        assert!(peak_kib() < MOST_KIB, "{} KiB for {length} bytes: {said}", peak_kib());
    };
    for (members, what) in archives() {
        zip(&path, members);
        refused(what);
    }
    mat(&path, 6, &sizes(&[1 << 28, 1]), 1 << 28);
    refused("claim more samples than so short a file can contain");
    mat(&path, 6, &sizes(&[1 << 15, 1 << 15]), 1 << 28);
    refused("more numbers than the limit");
    mat(&path, 6, &vec![1; 1 << 20], 8);
    refused("cut or damaged");
    mat(&path, 1, &sizes(&[1, 1]), 1 << 28);
    refused("no arrays of numbers");
    mat(&path, 4, &sizes(&[1, 1 << 28]), 1 << 28);
    refused("no arrays of numbers");

    // The reader skips an excessive array beside a sound recording.
    zip(
        &path,
        vec![
            ("t.npy", Box::new(npy("<f8", "3,", numbers(&[0.0, 0.1, 0.2])))),
            ("q.npy", Box::new(npy("<f8", "3, 1", numbers(&[0.0, 0.5, 0.1])))),
            ("mask.npy", Box::new(npy("|i1", "268435456,", repeat(0).take(ZEROS)))),
            ("wide.npy", Box::new(npy("|i1", "3, 600000", repeat(0).take(1_800_000)))),
        ],
    );
    let sound = read(&path, None).expect("a recording");
    println!("{:?}", sound.notes);
    assert_eq!((sound.len(), sound.joints()), (3, 1));
    assert!(sound.notes.iter().any(|note| note.contains("left out: mask, wide")), "{:?}", sound.notes);
    assert!(peak_kib() < MOST_KIB, "{} KiB", peak_kib());
}

#[test]
fn damaged_arrays_are_refused_or_read_in_little_memory() {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    let path = folder.path().join("run");
    let three = || numbers(&[0.0, 0.1, 0.2]);
    let names: Vec<u8> = "ab".chars().flat_map(|letter| u32::from(letter).to_le_bytes()).collect();
    let members: Vec<Member> = vec![
        ("t.npy", Box::new(npy("<f8", "3,", three()))),
        ("q.npy", Box::new(npy("<f8", "3, 1", three()))),
        ("names.npy", Box::new(npy("<U1", "2,", Cursor::new(names)))),
    ];
    zip(&path, members);
    let archive = std::fs::read(&path).expect("a file");
    mat(&path, 6, &sizes(&[40, 2]), 80);
    let matlab = std::fs::read(&path).expect("a file");
    let (mut tried, mut readable) = (0, 0);
    for sound in [archive, matlab] {
        for place in 0..sound.len() {
            for damage in [1_u8, 0x10, 0x80, 0xff] {
                let mut bytes = sound.clone();
                bytes[place] ^= damage;
                std::fs::write(&path, &bytes).expect("a file");
                tried += 1;
                readable += u32::from(read(&path, None).is_ok());
            }
            std::fs::write(&path, &sound[..place]).expect("a file");
            tried += 1;
            readable += u32::from(read(&path, None).is_ok());
        }
    }
    println!("{tried} damaged files, {readable} of them readable; at most {} KiB of memory", peak_kib());
    assert!(tried > 2000 && readable > 0 && peak_kib() < MOST_KIB);
}
