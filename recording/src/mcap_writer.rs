//! Writing a recording as MCAP (<https://mcap.dev/spec>): zstd chunks, indexed.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};
use std::mem::take;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, McapError, McapResult, WriteOptions};

use crate::error::WriteError;
use crate::layout::{Layout, Pace, Summary};
use crate::mcap_checksum;
use crate::output::Output;
use crate::recording::Event;
use crate::tick::{
    self, COLUMNS_KEY, EVENT_SCHEMA, EVENT_TOPIC, EVENT_TYPE, METADATA_NAME, TICK_TOPIC, TICK_TYPE,
};

/// Records that are complete only together (a chunk and its index), before they go to the file.
struct Gathering {
    bytes: Vec<u8>,
    output: Output,
}

impl Write for Gathering {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let written = self.output.block(&self.bytes);
        self.bytes.clear();
        written
    }
}

/// Writes a recording as MCAP: one topic `/freeplay/tick` with a `float64` field per column, `log_time` = `t` (0 for negative times); events on
/// `/freeplay/event`; a metadata record `freeplay`. A file without its end is readable up to the last complete chunk. See [`crate::RowWriter`] for further
/// properties.
pub struct McapWriter {
    file: PathBuf,
    /// `None` after an error.
    inner: Option<Box<mcap::Writer<NoSeek<Gathering>>>>,
    channel: u16,
    event_channel: u16,
    message: Vec<u8>,
    pace: Pace,
    width: usize,
    time: usize,
    rows: u64,
    events: u64,
    kept: u64,
}

impl fmt::Debug for McapWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("McapWriter")
            .field("file", &self.file)
            .field("rows", &self.rows)
            .finish_non_exhaustive()
    }
}

impl McapWriter {
    /// Begins an MCAP file. Of metadata with the same key, the last is kept.
    ///
    /// # Errors
    /// [`WriteError::Create`], [`WriteError::Stopped`].
    pub fn create(path: &Path, layout: &Layout, metadata: &[(String, String)]) -> Result<Self, WriteError> {
        McapWriter::of(path, Output::live(path), layout, metadata)
    }

    /// Begins an MCAP file that appears under its name only when it is complete.
    pub(crate) fn replace(
        path: &Path,
        layout: &Layout,
        metadata: &[(String, String)],
    ) -> Result<Self, WriteError> {
        McapWriter::of(path, Output::atomic(path), layout, metadata)
    }

    fn of(
        path: &Path,
        output: io::Result<Output>,
        layout: &Layout,
        metadata: &[(String, String)],
    ) -> Result<Self, WriteError> {
        let output = output.map_err(|source| WriteError::Create { file: path.to_path_buf(), source })?;
        McapWriter::over(path, output, layout, metadata)
    }

    pub(crate) fn over(
        path: &Path,
        output: Output,
        layout: &Layout,
        metadata: &[(String, String)],
    ) -> Result<Self, WriteError> {
        let mut writer = McapWriter {
            file: path.to_path_buf(),
            inner: None,
            channel: 0,
            event_channel: 0,
            message: Vec::new(),
            pace: Pace::default(),
            width: layout.columns().len(),
            time: layout.time(),
            rows: 0,
            events: 0,
            kept: 0,
        };
        writer.begin(output, layout, metadata).map_err(|error| writer.stopped(error))?;
        Ok(writer)
    }

    /// Writes the header and the metadata; channels go to the first chunk.
    fn begin(&mut self, output: Output, layout: &Layout, metadata: &[(String, String)]) -> McapResult<()> {
        let gathering = Gathering { bytes: Vec::new(), output };
        let mut inner = WriteOptions::new()
            .library(concat!("freeplay-recording/", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            // The low bytes of angles are noise: level 9 takes five times as long for 0.4 % less.
            .compression_level(1)
            .compression_threads(0)
            .chunk_size(None)
            .disable_seeking(true)
            .create(NoSeek::new(gathering))?;
        let metadata = mcap_checksum::signed(metadata.iter().cloned().collect());
        inner.write_metadata(&Metadata { name: METADATA_NAME.into(), metadata })?;
        inner.flush()?;
        let schema = inner.add_schema(TICK_TYPE, "ros2msg", tick::definition(layout.columns()).as_bytes())?;
        let names = serde_json::to_string(layout.columns()).map_err(io::Error::from)?;
        let exact = BTreeMap::from([(COLUMNS_KEY.to_string(), names)]);
        self.channel = inner.add_channel(schema, TICK_TOPIC, "cdr", &exact)?;
        let schema = inner.add_schema(EVENT_TYPE, "jsonschema", EVENT_SCHEMA.as_bytes())?;
        self.event_channel = inner.add_channel(schema, EVENT_TOPIC, "json", &BTreeMap::new())?;
        // The description of all messages is in a chunk of its own: damage to the first samples leaves the later ones readable.
        inner.flush()?;
        self.inner = Some(Box::new(inner));
        Ok(())
    }

    /// Writes one row: a value per column of the layout.
    ///
    /// # Errors
    /// As [`crate::RowWriter::write`].
    pub fn write(&mut self, row: &[f64]) -> Result<(), WriteError> {
        if row.len() != self.width {
            let (row, expected, found) = (self.rows + 1, self.width, row.len());
            return Err(WriteError::Width { file: self.file.clone(), row, expected, found });
        }
        let mut message = take(&mut self.message);
        tick::encode(row, &mut message);
        self.rows += 1;
        let sent = self.send(self.channel, self.rows, row[self.time], &message);
        self.message = message;
        sent
    }

    /// Writes an event.
    ///
    /// # Errors
    /// As [`crate::RowWriter::event`].
    pub fn event(&mut self, event: &Event) -> Result<(), WriteError> {
        if !event.t.is_finite() {
            let (kind, t) = (event.kind.clone(), event.t);
            return Err(WriteError::EventTime { file: self.file.clone(), kind, t });
        }
        let text = serde_json::to_vec(event).map_err(|error| self.stopped(io::Error::from(error).into()))?;
        self.events += 1;
        self.send(self.event_channel, self.events, event.t, &text)
    }

    /// Writes the remaining rows, then the index, and closes the file.
    ///
    /// # Errors
    /// As [`crate::RowWriter::finish`].
    pub fn finish(mut self) -> Result<Summary, WriteError> {
        let Some(mut inner) = self.inner.take() else {
            return Err(WriteError::Closed { file: self.file.clone() });
        };
        let written = inner.flush();
        if written.is_ok() {
            self.kept = self.rows;
        }
        written.and_then(|()| inner.finish()).map_err(|error| self.stopped(error))?;
        let output = (*inner).into_inner().into_inner().output;
        let bytes = output.finish().map_err(|error| self.stopped(error.into()))?;
        Ok(Summary { file: self.file.clone(), rows: self.rows, events: self.events, bytes })
    }

    /// Writes a message, and the chunk if it is due.
    fn send(&mut self, channel_id: u16, number: u64, t: f64, data: &[u8]) -> Result<(), WriteError> {
        let Some(inner) = &mut self.inner else {
            return Err(WriteError::Closed { file: self.file.clone() });
        };
        let log_time = nanoseconds(t);
        let sequence = (number - 1) as u32;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        let due = self.pace.due(t, data.len());
        let mut written = inner.write_to_known_channel(&header, data);
        if due {
            written = written.and_then(|()| inner.flush());
        }
        match written {
            Ok(()) => {
                self.kept = if due { self.rows } else { self.kept };
                Ok(())
            }
            Err(error) => {
                self.inner = None;
                Err(self.stopped(error))
            }
        }
    }

    fn stopped(&self, error: McapError) -> WriteError {
        let source = match error {
            McapError::Io(source) => source,
            error => io::Error::other(error),
        };
        WriteError::Stopped { file: self.file.clone(), rows: self.rows, kept: self.kept, source }
    }
}

/// Seconds in nanoseconds of an MCAP file, which has no time before 0.
fn nanoseconds(t: f64) -> u64 {
    (t * 1e9).round() as u64
}
