//! Reading a recording of either format.

use std::io::{Cursor, ErrorKind, Read};
use std::path::Path;

use freeplay_storage::{InputFile, Refusal};

use crate::error::{Place, ReadError, Row};
use crate::mapping::Mapping;
use crate::mcap_records::is_magic;
use crate::recording::Recording;
use crate::table::MAX_NUMBERS;
use crate::{csv_reader, mcap_reader};

/// What a reader is told about its input.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    /// Its name, for messages.
    pub file: &'a Path,
    /// Its length, bytes, where it has one.
    pub size: Option<u64>,
    /// The joints of the arm, where they are known.
    pub joints: Option<usize>,
    /// The most numbers to read.
    pub limit: u64,
    /// Rows of the overview, where no more is wanted.
    pub overview: Option<usize>,
}

impl Source<'_> {
    /// A place in this input.
    pub fn place(&self, row: Row) -> Place {
        Place { file: self.file.to_path_buf(), row }
    }
}

/// Reads a recording, CSV or MCAP by its first bytes; `joints` is the number of joints it must have, where
/// the arm is known.
///
/// Required are `t` and `q1`…`qn`. `qd`, `tau` and `q_ref` come for all joints or for none, `x, y, z` and
/// `qx, qy, qz, qw` all together. All their values are finite and `t` increases, by steps of any size. Columns
/// outside the contract are kept in [`Recording::others`]; text in them becomes NaN and a note.
/// CSV: comma-separated, a header, decimal points; a byte order mark, CRLF, quotes, blank lines and spaces
/// around cells are fine. MCAP: see [`crate::McapWriter`]; a file without its end is read up to there.
///
/// At most [`MAX_NUMBERS`] numbers are read: 2 GiB of memory, for a moment up to twice that; a line of a CSV may
/// have 1 MiB, a chunk of a MCAP 64 MiB.
///
/// # Errors
/// See [`ReadError`]; each names the place, the value and the remedy.
pub fn read(path: &Path, joints: Option<usize>) -> Result<Recording, ReadError> {
    open(path, joints, None)
}

/// Reads a recording of any length in at most about `rows` rows: where it has more, of each stretch of time the least and the greatest
/// value of every column, in two rows. What is drawn against time loses no peak; rows are no samples any more. See [`read`].
///
/// # Errors
/// See [`ReadError`].
pub fn read_overview(path: &Path, joints: Option<usize>, rows: usize) -> Result<Recording, ReadError> {
    open(path, joints, Some(rows))
}

fn open(path: &Path, joints: Option<usize>, overview: Option<usize>) -> Result<Recording, ReadError> {
    let file = open_file(path)?;
    let size = Some(file.length());
    dispatch(file, &Source { file: path, size, joints, limit: MAX_NUMBERS, overview })
}

/// Reads a CSV with other columns, named and scaled by `mapping`. See [`read`].
///
/// # Errors
/// See [`ReadError`]; each names the place, the value and the remedy.
pub fn import_csv(path: &Path, mapping: &Mapping) -> Result<Recording, ReadError> {
    let file = open_file(path)?;
    let source =
        Source { file: path, size: Some(file.length()), joints: None, limit: MAX_NUMBERS, overview: None };
    let mut recording = csv_reader::read_mapped(file, &source, Some(mapping))?;
    mapping
        .finish(&mut recording)
        .map_err(|error| ReadError::Mapping { place: source.place(Row::Whole), source: error })?;
    Ok(recording)
}

/// Opens a recording, which must be a regular file.
pub(crate) fn open_file(path: &Path) -> Result<InputFile, ReadError> {
    InputFile::open(path).map_err(|error| match error.refusal() {
        _ if error.source.kind() == ErrorKind::IsADirectory => ReadError::Folder { file: path.to_path_buf() },
        Some(Refusal::NotRegular(_)) => ReadError::NotAFile(error),
        _ => ReadError::Io { file: path.to_path_buf(), source: error.into() },
    })
}

/// Reads a recording from any stream of bytes; `origin` stands for the file in messages. See [`read`].
///
/// # Errors
/// See [`ReadError`].
pub fn read_from(input: impl Read, origin: &Path, joints: Option<usize>) -> Result<Recording, ReadError> {
    dispatch(input, &Source { file: origin, size: None, joints, limit: MAX_NUMBERS, overview: None })
}

/// Chooses the reader by the first bytes.
pub(crate) fn dispatch(mut input: impl Read, source: &Source) -> Result<Recording, ReadError> {
    let file = || source.file.to_path_buf();
    let mut head = Vec::new();
    let taken = (&mut input).take(mcap::MAGIC.len() as u64).read_to_end(&mut head);
    taken.map_err(|source| ReadError::Io { file: file(), source })?;
    if head.is_empty() {
        return Err(ReadError::Empty { file: file() });
    }
    if is_magic(&head) {
        return mcap_reader::read(input, source);
    }
    if source.file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mcap")) {
        return Err(ReadError::NotMcap { file: file() });
    }
    if let Some(what) = known_format(&head) {
        return Err(ReadError::NotText { file: file(), what });
    }
    csv_reader::read(Cursor::new(head).chain(input), source)
}

/// Formats that are handed over by mistake.
fn known_format(head: &[u8]) -> Option<&'static str> {
    match head {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Some("UTF-16 text"),
        [b'P', b'K', 3, 4, ..] => Some("a ZIP archive or a spreadsheet: export it as CSV"),
        [0x1f, 0x8b, ..] => Some("compressed by gzip: gunzip it first"),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => Some("compressed by zstd: unzstd it first"),
        [b'#', b'R', b'O', b'S', b'B', b'A', b'G', ..] => Some("a ROS 1 bag: `mcap convert` it"),
        [b'<', b'?' | b'!' | b'a'..=b'z', ..] => Some("XML, such as the model of a robot"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Source, dispatch};
    use crate::error::ReadError;
    use crate::output::Output;
    use crate::output::tests::Disk;
    use crate::write::Layout;
    use crate::{McapWriter, WriteError};

    fn csv(rows: usize) -> String {
        let rows = (0..rows).map(|k| format!("{k},1.5,2.5,3.5\n"));
        std::iter::once("t,q1,q2,q3\n".to_string()).chain(rows).collect()
    }

    fn source(limit: u64, size: Option<u64>) -> Source<'static> {
        Source { file: Path::new("run.csv"), size, joints: None, limit, overview: None }
    }

    #[test]
    fn the_limit_counts_numbers_and_the_error_says_how_to_thin() {
        let text = csv(500);
        assert_eq!(dispatch(text.as_bytes(), &source(2000, None)).expect("exactly at the limit").len(), 500);
        let error = dispatch(text.as_bytes(), &source(1999, None)).expect_err("one number above");
        assert!(matches!(error, ReadError::TooLarge { columns: 4, rows: 500, limit: 1999, .. }), "{error}");
        let text = error.to_string();
        assert!(text.contains("awk 'NR == 1 || NR % 2 == 0' run.csv > thin.csv"), "{text}");
    }

    #[test]
    fn a_file_far_above_the_limit_is_refused_after_a_thousand_rows() {
        let text = csv(100_000);
        let error =
            dispatch(text.as_bytes(), &source(40_000, Some(text.len() as u64))).expect_err("too large");
        let ReadError::TooLarge { rows, .. } = error else { panic!("{error}") };
        println!("estimated {rows} rows of 100000");
        assert!(rows > 50_000, "the estimate, not the row where the limit was met");
    }

    #[test]
    fn an_estimate_somewhat_above_the_limit_refuses_nothing() {
        // The first rows are shorter than the others: the estimate is too high.
        let text =
            csv(1000) + &(1000..2000).map(|k| format!("{k},1.5000,2.5000,3.5000\n")).collect::<String>();
        let recording = dispatch(text.as_bytes(), &source(8000, Some(text.len() as u64)));
        assert_eq!(recording.expect("it fits").len(), 2000);
    }

    /// However small the disk: the error says how many rows are kept, and exactly these are there.
    #[test]
    fn a_mcap_on_a_full_disk_is_read_up_to_its_last_chunk() {
        let layout = Layout::new(["t", "q1"]).expect("a layout");
        let mut stopped = [0, 0];
        for room in (0..40_000).step_by(311) {
            let disk = Disk::with_room(room);
            let output = Output::over(Box::new(disk.clone()));
            let Ok(mut writer) = McapWriter::over(Path::new("run.mcap"), output, &layout, &[]) else {
                assert!(room < 1000, "{room} bytes are enough for a header and the columns");
                continue;
            };
            let written =
                (0..2000).try_for_each(|k| writer.write(&[f64::from(k) * 0.001, 1.0 / f64::from(k + 1)]));
            let finished = written.and_then(|()| writer.finish());
            let Err(WriteError::Stopped { kept, .. }) = finished else {
                assert!(room > 20_000, "{room} bytes are too few");
                continue;
            };
            let read = dispatch(disk.content().as_slice(), &source(u64::MAX, None));
            match read {
                Ok(recording) => {
                    assert!(recording.truncated && recording.len() as u64 == kept, "room {room}")
                }
                Err(ReadError::NoSamples { .. }) => assert_eq!(kept, 0, "room {room}"),
                Err(error) => panic!("room {room}: {error}"),
            }
            stopped[usize::from(kept > 0)] += 1;
        }
        println!("stopped before the first chunk on {} disks, later on {}", stopped[0], stopped[1]);
        assert!(stopped.into_iter().all(|count| count > 3));
    }
}
