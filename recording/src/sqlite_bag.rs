//! Bags of ROS 2 in SQLite (`.db3`).
//!
//! Source: rosbag2 `rosbag2_storage_sqlite3`, tables `topics` (id, name, type, …) and `messages` (topic_id, timestamp, data).

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use rusqlite::{Connection, OpenFlags};

use crate::bag::{Bag, Encoding};
use crate::error::ReadError;
use crate::open::open;
use crate::read::Source;

/// What a message begins with that is compressed by itself.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// The largest message, bytes.
const MAX_MESSAGE: usize = 64 << 20;

/// Adds what the database at `path` holds to `bag`.
///
/// # Errors
/// [`ReadError::Unusable`] for a database that is no bag, or is damaged.
pub(crate) fn add(path: &Path, source: &Source, bag: &mut Bag) -> Result<(), ReadError> {
    let unusable = |error: rusqlite::Error| ReadError::Unusable {
        file: source.file.to_path_buf(),
        what: format!("this SQLite file can't be read as a ROS 2 bag: {error}"),
    };
    // SQLite opens by path; a pipe or a device would be waited for.
    drop(open(path)?);
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let database = Connection::open_with_flags(path, flags).map_err(unusable)?;
    let mut topics: BTreeMap<i64, (String, String)> = BTreeMap::new();
    let mut query = database.prepare("SELECT id, name, type FROM topics").map_err(unusable)?;
    let mut rows = query.query([]).map_err(unusable)?;
    while let Some(row) = rows.next().map_err(unusable)? {
        let (name, kind): (String, String) = (row.get(1).map_err(unusable)?, row.get(2).map_err(unusable)?);
        bag.topics.insert(name.clone(), kind.clone());
        topics.insert(row.get(0).map_err(unusable)?, (name, kind));
    }
    let messages = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id";
    let mut query = database.prepare(messages).map_err(unusable)?;
    let mut rows = query.query([]).map_err(unusable)?;
    loop {
        let row = match rows.next() {
            Ok(Some(row)) => row,
            Ok(None) => return Ok(()),
            // A recorder that was killed leaves whole messages before the damage.
            Err(_) if !bag.states.is_empty() => {
                bag.truncated = true;
                return Ok(());
            }
            Err(error) => return Err(unusable(error)),
        };
        let topic: i64 = row.get(0).map_err(unusable)?;
        let Some((name, kind)) = topics.get(&topic) else { continue };
        let (time, data) = (row.get::<_, i64>(1).map_err(unusable)?, row.get_ref(2).map_err(unusable)?);
        let Ok(data) = data.as_blob() else { continue };
        let data = if data.starts_with(&ZSTD) {
            zstd::bulk::decompress(data, MAX_MESSAGE).map_or(Cow::Borrowed(data), Cow::Owned)
        } else {
            Cow::Borrowed(data)
        };
        bag.take(name, kind, Encoding::Cdr, time.max(0) as u64, || data.into_owned());
    }
}
