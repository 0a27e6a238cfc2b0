//! Reading a recording from MCAP.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufReader, Read};

use freeplay_storage::plain_words;
use mcap::records::{Channel, Record, SchemaHeader};

use crate::error::ReadError;
use crate::input::Source;
use crate::mcap_checksum;
use crate::mcap_losses::Losses;
use crate::mcap_records::{Item, Records, damaged};
use crate::names::list;
use crate::place::Row;
use crate::recording::{Event, Recording};
use crate::table::Table;
use crate::tick::{self, COLUMNS_KEY, EVENT_TOPIC, METADATA_NAME, TICK_TOPIC};

/// Largest number of events; the rest is dropped, with a note.
const MAX_EVENTS: usize = 1_000_000;

/// The content read so far.
struct Reading<'a> {
    source: &'a Source<'a>,
    /// Encoding and definition of the schemas.
    schemas: BTreeMap<u16, (String, String)>,
    topics: BTreeMap<u16, String>,
    /// Channels of Freeplay's two topics.
    ticks: BTreeSet<u16>,
    marks: BTreeSet<u16>,
    table: Option<Table>,
    row: Vec<f64>,
    metadata: BTreeMap<String, String>,
    events: Vec<Event>,
    events_left_out: u64,
    /// Index of the time in a row.
    time: usize,
    losses: Losses,
    /// Messages whose channel was described in a lost chunk; the summary describes it again.
    waiting: Vec<Waiting>,
    waiting_bytes: u64,
    /// Number of samples of Freeplay's topic according to the summary.
    written: Option<u64>,
    notes: Vec<String>,
}

/// A message whose channel is not known yet.
struct Waiting {
    offset: u64,
    channel: u16,
    sequence: u32,
    data: Vec<u8>,
}

/// Reads an MCAP file behind its first magic bytes.
pub(crate) fn read(input: impl Read, source: &Source) -> Result<Recording, ReadError> {
    let mut reading = Reading {
        source,
        schemas: BTreeMap::new(),
        topics: BTreeMap::new(),
        ticks: BTreeSet::new(),
        marks: BTreeSet::new(),
        table: None,
        row: Vec::new(),
        metadata: BTreeMap::new(),
        events: Vec::new(),
        events_left_out: 0,
        time: 0,
        losses: Losses::default(),
        waiting: Vec::new(),
        waiting_bytes: 0,
        written: None,
        notes: Vec::new(),
    };
    let mut records = Records::new(BufReader::with_capacity(1 << 16, input), source);
    records.for_each(&mut |offset, item| match item {
        Item::Record(record) => reading.take(offset, record),
        Item::Summary(record) => reading.take_summary(offset, record),
        Item::Damage(what) => {
            reading.losses.damage(offset, what);
            Ok(())
        }
    })?;
    if records.is_summary_damaged {
        reading.notes.push(
            "the summary at the end of the file is damaged; it only repeats data that were read".to_owned(),
        );
    }
    reading.take_waiting()?;
    if let (Some(compression), None) = (records.compression, &reading.table) {
        return Err(ReadError::Compression { file: source.file.to_path_buf(), compression });
    }
    reading.finish(records.truncated)
}

impl Reading<'_> {
    fn take(&mut self, offset: u64, record: Record) -> Result<(), ReadError> {
        match record {
            Record::Schema { header, data } => self.schema(header, &data),
            Record::Channel(channel) => return self.channel(offset, &channel),
            Record::Message { header, data } => {
                return self.message(offset, header.channel_id, header.sequence, &data);
            }
            Record::Metadata(record) if record.name == METADATA_NAME => {
                match mcap_checksum::verified(record.metadata) {
                    Some(metadata) => self.metadata.extend(metadata),
                    None => self.losses.damage(offset, "the metadata, which are left out".to_owned()),
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Reads a record of the summary.
    fn take_summary(&mut self, offset: u64, record: Record) -> Result<(), ReadError> {
        match record {
            Record::Schema { header, data } if !self.waiting.is_empty() => self.schema(header, &data),
            Record::Channel(channel) if !self.waiting.is_empty() => return self.channel(offset, &channel),
            Record::Statistics(statistics) => {
                let ticks =
                    statistics.channel_message_counts.iter().filter(|(id, _)| self.ticks.contains(id));
                self.written = Some(ticks.map(|(_, count)| count).sum());
            }
            _ => {}
        }
        Ok(())
    }

    /// Adds the messages whose channel the summary has described.
    fn take_waiting(&mut self) -> Result<(), ReadError> {
        for message in std::mem::take(&mut self.waiting) {
            if self.topics.contains_key(&message.channel) {
                self.message(message.offset, message.channel, message.sequence, &message.data)?;
            }
        }
        Ok(())
    }

    fn schema(&mut self, header: SchemaHeader, data: &[u8]) {
        // Definitions of other tools are not needed.
        let data =
            if header.encoding == "ros2msg" { String::from_utf8_lossy(data) } else { Cow::Borrowed("") };
        self.schemas.insert(header.id, (header.encoding, data.into_owned()));
    }

    fn channel(&mut self, offset: u64, channel: &Channel) -> Result<(), ReadError> {
        let known = self.topics.insert(channel.id, channel.topic.clone());
        if known.is_some_and(|topic| topic != channel.topic) {
            return Err(damaged(self.source, offset, "a channel changes its topic"));
        }
        match channel.topic.as_str() {
            TICK_TOPIC => {
                let names = self.columns(channel)?;
                match &self.table {
                    Some(table) if table.names() == names => {}
                    Some(_) => {
                        return Err(self.form(Row::Whole, "two channels with different columns".into()));
                    }
                    None => {
                        self.row = vec![0.0; names.len()];
                        self.time = names.iter().position(|name| name == "t").unwrap_or_default();
                        let Source { joints, limit, overview, .. } = *self.source;
                        let table = Table::new(self.source.place(Row::Whole), names, joints, limit)?;
                        self.table = Some(table.with_overview(overview));
                    }
                }
                self.ticks.insert(channel.id);
            }
            EVENT_TOPIC if channel.message_encoding == "json" => {
                self.marks.insert(channel.id);
            }
            _ => {}
        }
        Ok(())
    }

    /// The column names of a channel: the exact ones in its metadata, else its fields.
    fn columns(&self, channel: &Channel) -> Result<Vec<String>, ReadError> {
        let none = (String::new(), String::new());
        let (encoding, definition) = self.schemas.get(&channel.schema_id).unwrap_or(&none);
        if channel.message_encoding != "cdr" || encoding != "ros2msg" {
            let what = format!("schema {encoding:?}, messages {:?}", channel.message_encoding);
            return Err(self.form(Row::Whole, what));
        }
        let fields = tick::fields(definition)
            .map_err(|line| self.form(Row::Whole, format!("field {:?}", crate::names::shorten(&line))))?;
        let Some(exact) = channel.metadata.get(COLUMNS_KEY) else { return Ok(fields) };
        match serde_json::from_str::<Vec<String>>(exact) {
            Ok(names) if names.len() == fields.len() => Ok(names),
            _ => Err(self.form(Row::Whole, "the channel's list of columns does not match its fields".into())),
        }
    }

    fn message(&mut self, offset: u64, channel: u16, sequence: u32, data: &[u8]) -> Result<(), ReadError> {
        if self.ticks.contains(&channel) {
            let Some(table) = &mut self.table else { return Ok(()) };
            let number = table.rows() + 1;
            if let Err(what) = tick::decode(data, &mut self.row) {
                return Err(self.form(Row::Message(number), what));
            }
            self.losses.sample(sequence, self.row[self.time]);
            return table.push(&self.row, Row::Message(number));
        }
        if self.marks.contains(&channel) {
            return self.event(offset, data);
        }
        if self.topics.contains_key(&channel) {
            return Ok(());
        }
        self.waiting_bytes += data.len() as u64;
        if self.losses.first().is_some() && self.waiting_bytes / 8 <= self.source.limit {
            self.waiting.push(Waiting { offset, channel, sequence, data: data.to_vec() });
            return Ok(());
        }
        Err(damaged(self.source, offset, "a message of a channel that is not described"))
    }

    fn event(&mut self, offset: u64, data: &[u8]) -> Result<(), ReadError> {
        let event = serde_json::from_slice(data).map_err(|error| {
            damaged(
                self.source,
                offset,
                &format!("an event cannot be read: {}", plain_words(&error.to_string())),
            )
        })?;
        if self.events.len() < MAX_EVENTS {
            self.events.push(event);
        } else {
            self.events_left_out += 1;
        }
        Ok(())
    }

    fn form(&self, at: Row, what: String) -> ReadError {
        ReadError::Form { place: self.source.place(at), topic: TICK_TOPIC, what }
    }

    fn finish(self, truncated: bool) -> Result<Recording, ReadError> {
        let file = self.source.file.to_path_buf();
        if let (Some((offset, what)), true) =
            (self.losses.first(), self.table.as_ref().is_none_or(|table| table.rows() == 0))
        {
            return Err(damaged(self.source, offset, what));
        }
        let Some(mut table) = self.table else {
            if truncated && self.topics.is_empty() {
                return Err(ReadError::NoSamples { file, why: crate::table::ENDS_EARLY });
            }
            let topics = list(&self.topics.into_values().collect::<Vec<_>>());
            return Err(ReadError::NoTopic { file, expected: TICK_TOPIC, topics });
        };
        table.metadata = self.metadata.into_iter().collect();
        table.events = self.events;
        table.truncated = truncated;
        table.notes.extend(self.notes);
        table.notes.extend(self.losses.describe(self.written));
        if truncated {
            let rows = table.rows();
            table.notes.push(format!(
                "the file is incomplete (recorder killed or disk full): {rows} rows up to its last complete chunk are read"
            ));
        }
        if self.events_left_out > 0 {
            table.notes.push(format!("{} events above {MAX_EVENTS} are left out", self.events_left_out));
        }
        table.into_recording()
    }
}
