//! Bags of ROS 2 in SQLite (`.db3`).
//!
//! Source: rosbag2 `rosbag2_storage_sqlite3`, tables `topics` (id, name, type, …) and `messages` (topic_id, timestamp, data).
//!
//! A database may contain programs: a view, a virtual table or a generated column computes its rows, in any number and size. The reader uses only stored rows,
//! in the order of storage, and no more of them than the file has room for.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use rusqlite::config::DbConfig;
use rusqlite::limits::Limit;
use rusqlite::{Connection, OpenFlags, OptionalExtension, Row};

use crate::bag::{Bag, Encoding, is_read};
use crate::error::ReadError;
use crate::input::Source;
use crate::open::open;

/// Magic bytes of a message with its own compression.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// The largest message, bytes.
const MAX_MESSAGE: usize = 64 << 20;
/// Size of the database: pages times bytes per page.
const SIZE: &str = "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size";
/// The type of a named object, and whether it computes any of its columns.
const KIND: &str = "SELECT type, EXISTS (SELECT 1 FROM pragma_table_xinfo(?1) WHERE hidden <> 0) FROM pragma_table_list \
    WHERE schema = 'main' AND name = ?1 COLLATE NOCASE";

/// A stored message: log time, ns, its topic, its bytes.
type Stored = (i64, i64, Vec<u8>);

/// Adds the content of the database at `path` to `bag`.
///
/// # Errors
/// [`ReadError::Unusable`] for a database that is no bag, or is damaged.
pub(crate) fn add(path: &Path, source: &Source, bag: &mut Bag) -> Result<(), ReadError> {
    // SQLite opens by path and would wait for a pipe or a device.
    drop(open(path)?);
    let unusable = |fault: Fault| ReadError::Unusable {
        file: source.file.to_path_buf(),
        what: format!("this SQLite file can't be read as a ROS 2 bag: {fault}"),
    };
    let database = Database::open(path).map_err(unusable)?;
    let topics = database.topics().map_err(unusable)?;
    bag.topics.extend(topics.values().cloned());
    let wanted: Vec<i64> =
        topics.iter().filter(|(_, (_, kind))| is_read(kind)).map(|(topic, _)| *topic).collect();
    let (mut messages, fault) = database.messages(&wanted).map_err(unusable)?;
    match fault {
        // A killed recorder leaves complete messages before the damage.
        Some(_) if !messages.is_empty() => bag.truncated = true,
        Some(fault) => return Err(unusable(fault)),
        None => {}
    }
    // Messages with the same time keep the order of storage.
    messages.sort_by_key(|(time, _, _)| *time);
    for (time, topic, data) in messages {
        let Some((name, kind)) = topics.get(&topic) else { continue };
        let data = if data.starts_with(&ZSTD) {
            zstd::bulk::decompress(&data, MAX_MESSAGE).map_or(Cow::Borrowed(&data), Cow::Owned)
        } else {
            Cow::Borrowed(&data)
        };
        bag.take(name, kind, Encoding::Cdr, time.max(0) as u64, &data, source)?;
    }
    Ok(())
}

/// Reason why a database is no bag.
#[derive(Debug, thiserror::Error)]
enum Fault {
    #[error("{0}")]
    Sqlite(#[from] rusqlite::Error),
    #[error("it has no table {0}")]
    NoTable(&'static str),
    #[error("{0} is no table of stored rows: it is a view, or computes its columns; record the bag again")]
    Computed(&'static str),
    #[error("it is damaged: it claims more rows or bytes than {0} bytes can contain")]
    NoRoom(u64),
}

/// A database that is open for reading.
struct Database {
    connection: Connection,
    /// Its bytes, those of its write-ahead log included.
    size: u64,
}

impl Database {
    fn open(path: &Path) -> Result<Self, Fault> {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags)?;
        connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, MAX_MESSAGE as i32)?;
        connection.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
        connection.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
        connection.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false)?;
        let size: i64 = connection.query_row(SIZE, [], |row| row.get(0))?;
        let database = Self { connection, size: size.max(0) as u64 };
        for name in ["topics", "messages"] {
            database.check_table(name)?;
        }
        Ok(database)
    }

    /// Fails unless `name` is a table whose rows are stored.
    fn check_table(&self, name: &'static str) -> Result<(), Fault> {
        let kind = |row: &Row| Ok((row.get::<_, String>(0)?, row.get::<_, bool>(1)?));
        match self.connection.query_row(KIND, [name], kind).optional()? {
            None => Err(Fault::NoTable(name)),
            Some((kind, false)) if kind == "table" => Ok(()),
            Some(_) => Err(Fault::Computed(name)),
        }
    }

    /// Names and types of the topics.
    fn topics(&self) -> Result<BTreeMap<i64, (String, String)>, Fault> {
        let mut query = self.connection.prepare("SELECT id, name, type FROM topics NOT INDEXED")?;
        let (mut rows, mut topics, mut budget) = (query.query([])?, BTreeMap::new(), RowBudget(self.size));
        while let Some(row) = rows.next()? {
            let (name, kind): (String, String) = (row.get(1)?, row.get(2)?);
            budget.take(name.len() + kind.len()).ok_or(Fault::NoRoom(self.size))?;
            topics.insert(row.get(0)?, (name, kind));
        }
        Ok(topics)
    }

    /// The messages of the topics `wanted` in the order of storage, and the fault that ended them early.
    fn messages(&self, wanted: &[i64]) -> Result<(Vec<Stored>, Option<Fault>), Fault> {
        let wanted = wanted.iter().map(i64::to_string).collect::<Vec<_>>().join(",");
        // Rows of other topics count, but their data are not read. In the order of time, SQLite would first read an endless table to its end.
        let messages = format!(
            "SELECT timestamp, topic_id, CASE WHEN topic_id IN ({wanted}) THEN data END FROM messages NOT INDEXED"
        );
        let mut query = self.connection.prepare(&messages)?;
        let (mut rows, mut found, mut budget) = (query.query([])?, Vec::new(), RowBudget(self.size));
        loop {
            let row = match rows.next() {
                Ok(Some(row)) => row,
                Ok(None) => return Ok((found, None)),
                Err(error) => return Ok((found, Some(error.into()))),
            };
            let data = row.get_ref(2)?.as_blob().ok();
            if budget.take(data.map_or(0, <[u8]>::len)).is_none() {
                return Ok((Vec::new(), Some(Fault::NoRoom(self.size))));
            }
            if let Some(data) = data {
                found.push((row.get(0)?, row.get(1)?, data.to_vec()));
            }
        }
    }
}

/// Remaining bytes for rows. A page of a database that is referenced again and again gives rows without end.
struct RowBudget(u64);

impl RowBudget {
    /// Subtracts the room of a row with so many bytes of data, if it is available; a row has at least one more byte.
    fn take(&mut self, bytes: usize) -> Option<()> {
        self.0 = self.0.checked_sub(bytes as u64 + 1)?;
        Some(())
    }
}
