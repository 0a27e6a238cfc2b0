//! SQLite files that are not bags of stored messages, or claim more messages than their pages contain: the reader refuses them in little time and memory.
//!
//! In a process of its own, since the kernel counts the peak memory of a process.

use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::time::Duration;

use freeplay_recording::{ReadError, Recording, read};
use rusqlite::Connection;

/// Memory limit for all these files together, KiB: twice the largest message.
const MOST_KIB: u64 = 160 << 10;

/// A file that takes longer counts as endless.
const LONGEST: Duration = Duration::from_secs(120);

/// Bytes of a page.
const PAGE: usize = 512;

const TOPICS: &str = "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT);
    INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState');";
const MESSAGES: &str =
    "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);";
/// Rows without end.
const ENDLESS: &str = "AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)";

/// Peak memory of this process, KiB.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("a process");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("the peak");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number")
}

/// Reads `path` in a thread, so that an endless read fails the test.
fn read_in_time(path: &Path) -> Result<Recording, ReadError> {
    let (told, tells) = channel();
    let path = path.to_owned();
    std::thread::spawn(move || drop(told.send(Box::new(read(&path, None)))));
    *tells.recv_timeout(LONGEST).expect("an answer in time")
}

/// A database made by `statements`, with small pages.
fn database(folder: &Path, statements: &[&str]) -> PathBuf {
    let path = folder.join("bag.db3");
    let _ = std::fs::remove_file(&path);
    let database = Connection::open(&path).expect("a database");
    database
        .execute_batch(&format!("PRAGMA page_size = {PAGE}; {}", statements.concat()))
        .expect("statements");
    path
}

/// A joint state of one joint at `time`, s, as CDR.
fn joint_state(time: u32) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    let word = |data: &mut Vec<u8>, word: u32| data.extend(word.to_le_bytes());
    word(&mut data, time);
    // Nanoseconds; an empty frame id, its terminator and padding; one name.
    [0, 1, 0, 1, 2].iter().for_each(|it| word(&mut data, *it));
    data.extend(b"a\0\0\0");
    word(&mut data, 1);
    // Eight-byte numbers are aligned to multiples of eight behind the first four bytes.
    data.resize(4 + (data.len() - 4).next_multiple_of(8), 0);
    data.extend(f64::from(time).sin().to_le_bytes());
    [0, 0].iter().for_each(|it| word(&mut data, *it));
    data
}

/// A bag with `count` joint states, and the further objects of `more`.
fn bag(folder: &Path, count: u32, more: &str) -> PathBuf {
    let path = database(folder, &[TOPICS, MESSAGES, more]);
    let database = Connection::open(&path).expect("a database");
    for row in 0..count {
        // The order of storage differs from that of the times.
        let time = (row * 7) % count;
        let values = (row + 1, i64::from(time) * 1_000_000_000, joint_state(time));
        database.execute("INSERT INTO messages VALUES (?1, 1, ?2, ?3)", values).expect("inserted");
    }
    path
}

/// Databases that compute their content: their statements, and the expected message.
fn computed() -> Vec<(Vec<String>, &'static str)> {
    let view = |name: &str, columns: &str| format!("CREATE VIEW {name} {ENDLESS} SELECT {columns} FROM n;");
    let messages = "i AS id, 1 AS topic_id, i AS timestamp, zeroblob(100) AS data";
    let generated =
        |name: &str, columns: &str| format!("CREATE TABLE {name} (id INTEGER PRIMARY KEY, {columns});");
    let large = "topic_id INTEGER, timestamp INTEGER, data BLOB GENERATED ALWAYS AS (zeroblob(900000000))";
    let (topics, stored) = (TOPICS.to_owned(), MESSAGES.to_owned());
    vec![
        (vec![topics.clone(), view("messages", messages)], "messages is no table of stored rows"),
        (vec![topics.clone(), view("MESSAGES", messages)], "messages is no table of stored rows"),
        (
            vec![
                topics.clone(),
                view("messages", "i AS id, 1 AS topic_id, i AS timestamp, zeroblob(900000000) AS data"),
            ],
            "messages is no table of stored rows",
        ),
        (
            vec![
                stored.clone(),
                view("topics", "i AS id, '/j' || i AS name, 'sensor_msgs/msg/JointState' AS type"),
            ],
            "topics is no table of stored rows",
        ),
        (
            vec![topics.clone(), "CREATE VIEW messages AS SELECT 1 AS id;".to_owned()],
            "messages is no table of stored rows",
        ),
        (
            vec![
                topics.clone(),
                "CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data);".to_owned(),
            ],
            "messages is no table of stored rows",
        ),
        (
            vec![
                topics.clone(),
                generated("messages", large),
                "INSERT INTO messages (topic_id, timestamp) VALUES (1, 0), (1, 1), (1, 2);".to_owned(),
            ],
            "messages is no table of stored rows",
        ),
        (
            vec![
                topics.clone(),
                generated("messages", &large.replace("))", ")) STORED").replace("900000000", "9")),
            ],
            "messages is no table of stored rows",
        ),
        (vec![topics], "it has no table messages"),
        (vec![stored], "it has no table topics"),
    ]
}

#[test]
fn what_computes_its_rows_is_no_bag() {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    for (statements, what) in computed() {
        let statements: Vec<&str> = statements.iter().map(String::as_str).collect();
        let path = database(folder.path(), &statements);
        let said = read_in_time(&path).expect_err(statements[0]).to_string();
        println!("the most memory so far {} KiB: {said}", peak_kib());
        assert!(said.contains(what), "{statements:?}: {said}, not {what}");
        assert!(peak_kib() < MOST_KIB, "{} KiB: {said}", peak_kib());
    }
}

#[test]
fn messages_are_in_the_order_of_their_times_and_views_beside_them_are_no_matter() {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    let path = bag(folder.path(), 20, &format!("CREATE VIEW other {ENDLESS} SELECT i FROM n;"));
    let recording = read_in_time(&path).expect("a recording");
    let times: Vec<f64> = (0..20).map(f64::from).collect();
    assert_eq!(recording.t.iter().map(|time| time.round()).collect::<Vec<_>>(), times);
    assert_eq!(recording.q[0], times.iter().map(|time| time.sin()).collect::<Vec<_>>());
}

/// A page of a table with as many references to `child` as fit.
fn interior(child: u32) -> Vec<u8> {
    let cells = (PAGE - 12) / 8;
    let mut page = vec![5, 0, 0];
    page.extend((cells as u16).to_be_bytes());
    page.extend(((PAGE - 5 * cells) as u16).to_be_bytes());
    page.push(0);
    page.extend(child.to_be_bytes());
    for cell in 0..cells {
        page.extend(((PAGE - 5 * (cell + 1)) as u16).to_be_bytes());
    }
    page.resize(PAGE - 5 * cells, 0);
    for _ in 0..cells {
        page.extend(child.to_be_bytes());
        page.push(1);
    }
    page
}

#[test]
fn pages_that_are_named_again_and_again_are_no_endless_table() {
    const LEVELS: usize = 12;
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    for table in ["messages", "topics"] {
        let path = bag(
            folder.path(),
            3,
            &format!(
                "CREATE TABLE room (data BLOB); INSERT INTO room VALUES (zeroblob({}));",
                PAGE * (LEVELS + 2)
            ),
        );
        let root: u32 = Connection::open(&path)
            .and_then(|it| {
                it.query_row("SELECT rootpage FROM sqlite_schema WHERE name = ?1", [table], |row| row.get(0))
            })
            .expect("a root");
        let mut bytes = std::fs::read(&path).expect("a file");
        let pages = bytes.len() / PAGE;
        let leaf = bytes[(root as usize - 1) * PAGE..root as usize * PAGE].to_vec();
        // From the root through the last pages to the leaf, each page many times.
        let way: Vec<usize> = std::iter::once(root as usize).chain(pages - LEVELS..=pages).collect();
        for pair in way.windows(2) {
            bytes[(pair[0] - 1) * PAGE..pair[0] * PAGE].copy_from_slice(&interior(pair[1] as u32));
        }
        bytes[(pages - 1) * PAGE..].copy_from_slice(&leaf);
        std::fs::write(&path, &bytes).expect("written");
        let said = read_in_time(&path).expect_err("no table").to_string();
        println!("{} bytes, the most memory so far {} KiB: {said}", bytes.len(), peak_kib());
        assert!(said.contains("claims more rows or bytes than"), "{said}");
        assert!(peak_kib() < MOST_KIB, "{} KiB", peak_kib());
    }
}

#[test]
fn a_message_above_the_largest_is_refused_and_one_of_another_topic_is_not_read() {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    let large = "INSERT INTO topics VALUES (2, '/cloud', 'sensor_msgs/msg/PointCloud2');
        INSERT INTO messages VALUES (1000, 2, 0, zeroblob(70000000));";
    let path = bag(folder.path(), 3, large);
    assert_eq!(read_in_time(&path).expect("a recording").len(), 3);
    let path = bag(
        folder.path(),
        0,
        &large.replace("'sensor_msgs/msg/PointCloud2'", "'sensor_msgs/msg/JointState'"),
    );
    let said = read_in_time(&path).expect_err("too large").to_string();
    println!("the most memory so far {} KiB: {said}", peak_kib());
    assert!(said.contains("too big"), "{said}");
    assert!(peak_kib() < MOST_KIB, "{} KiB", peak_kib());
}

#[test]
fn damaged_databases_are_refused_or_read_in_little_memory() {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    let path = bag(folder.path(), 9, "");
    let sound = std::fs::read(&path).expect("a file");
    let (mut tried, mut readable) = (0, 0);
    for place in 0..sound.len() {
        for damage in [1_u8, 0x80, 0xff] {
            let mut bytes = sound.clone();
            bytes[place] ^= damage;
            std::fs::write(&path, &bytes).expect("written");
            tried += 1;
            readable += u32::from(read(&path, None).is_ok());
        }
    }
    println!("{tried} damaged files, {readable} of them readable; at most {} KiB of memory", peak_kib());
    assert!(tried > 3000 && readable > 0 && peak_kib() < MOST_KIB);
}
