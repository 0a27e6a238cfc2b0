//! Reading a recording of any kind; the content determines the kind.

use std::io::{Cursor, Read};
use std::path::Path;

use crate::error::ReadError;
use crate::foreign::Foreign;
use crate::input::Source;
use crate::joint_states::{BagOptions, from_bag};
use crate::mapping::Mapping;
use crate::open::{self, Kind, open};
use crate::recording::Recording;
use crate::{bag_folder, csv_reader, lerobot, mat_reader, mcap_reader, npz_reader, parquet_reader};

/// Options that complete the content of a foreign recording.
#[derive(Debug, Clone, Default)]
pub struct ImportOptions {
    /// Meaning of the columns, unless their names suffice.
    pub mapping: Option<Mapping>,
    /// Selection from a bag.
    pub bag: BagOptions,
}

/// Reads a recording. Its content, not its name, determines the kind of file. `joints` is the required number of joints, if the arm is known.
///
/// A time and the position of every joint are required. Any other quantity may be missing, for a while or throughout, and is NaN there. The reader drops rows
/// without time or positions and repeated rows, and sorts late ones; it notes each of these. Columns outside the contract go to [`Recording::others`]; text in
/// them becomes NaN and a note.
///
/// - CSV and its relatives: any separator, decimal points or commas, comments, units below the names, lists in cells, ISO times. The reader guesses the meaning
///   of columns with other names than the contract's; the guess is in [`Recording::guessed`] and a note.
/// - MCAP: see [`crate::McapWriter`]; a file without its end is read up to that point.
/// - ROS bags: MCAP, SQLite and ROS 1, files and folders: see [`BagOptions`].
/// - Parquet, LeRobot data sets, `.npz`, `.mat` of version 5.
///
/// The reader accepts at most [`crate::MAX_NUMBERS`] numbers: 2 GiB of memory, for a moment up to twice that; a line of a CSV may have 1 MiB, a chunk of an
/// MCAP 64 MiB. A Parquet file may have one number for each of its bits, and in any case 64 MiB of them. A bag's joint states and poses may have 2 GiB. The
/// reader compares sizes claimed in a file with the file before it allocates memory.
///
/// # Errors
/// See [`ReadError`]; each names the place, the value and the remedy.
pub fn read(path: &Path, joints: Option<usize>) -> Result<Recording, ReadError> {
    read_as(&Source { joints, ..Source::of(path) }, &ImportOptions::default())
}

/// Reads a recording of any length in at most about `rows` rows. A longer recording is divided into stretches of time; two rows keep the least and the greatest
/// value of every column in each stretch. A plot against time keeps every peak; the rows are no longer samples. See [`read`].
///
/// # Errors
/// See [`ReadError`].
pub fn read_overview(path: &Path, joints: Option<usize>, rows: usize) -> Result<Recording, ReadError> {
    read_as(&Source { joints, overview: Some(rows), ..Source::of(path) }, &ImportOptions::default())
}

/// Reads a foreign recording with `options`. See [`read`].
///
/// # Errors
/// See [`ReadError`]; each names the place, the value and the remedy.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Recording, ReadError> {
    read_as(&Source::of(path), options)
}

/// Reads a CSV with other columns, named and scaled by `mapping`. See [`read`].
///
/// # Errors
/// See [`ReadError`]; each names the place, the value and the remedy.
pub fn import_csv(path: &Path, mapping: &Mapping) -> Result<Recording, ReadError> {
    import(path, &ImportOptions { mapping: Some(mapping.clone()), bag: BagOptions::default() })
}

/// Reads a recording from any stream of bytes, MCAP or text; `origin` names the file in messages. See [`read`].
///
/// # Errors
/// See [`ReadError`].
pub fn read_from(input: impl Read, origin: &Path, joints: Option<usize>) -> Result<Recording, ReadError> {
    dispatch(input, &Source { joints, ..Source::of(origin) })
}

/// Selects the reader for `source`, a file or a folder.
fn read_as(source: &Source, options: &ImportOptions) -> Result<Recording, ReadError> {
    let mut recording = read_named(source, options)?;
    if let Some(mapping) = &options.mapping {
        mapping.finish(&mut recording)?;
    }
    Ok(recording)
}

/// The recording with its columns named and scaled.
fn read_named(source: &Source, options: &ImportOptions) -> Result<Recording, ReadError> {
    let path = source.file;
    let mapping = options.mapping.as_ref();
    if path.is_dir() {
        if lerobot::is_dataset(path) {
            return lerobot::read_folder(path, source)?.into_recording(source, mapping);
        }
        if bag_folder::is_bag(path) {
            return named_again(source, options, |source| from_bag(&options.bag, source));
        }
    }
    let mut file = open(path)?;
    let source = &Source { size: Some(file.length()), ..*source };
    let head = open::head(&mut file, path)?;
    match Kind::of(&head) {
        Kind::Mcap => named_again(source, options, |source| {
            match dispatch(Cursor::new(head).chain(file), source) {
                Err(ReadError::NoTopic { .. }) => from_bag(&options.bag, source),
                // A damaged bag, too, loses only its damaged parts.
                Err(error @ ReadError::Damaged { .. }) => from_bag(&options.bag, source).map_err(|_| error),
                other => other,
            }
        }),
        Kind::Sqlite | Kind::Ros1 => named_again(source, options, |source| from_bag(&options.bag, source)),
        Kind::Foreign(what) if what.contains("zstd") && is_named_as_bag(path) => {
            named_again(source, options, |source| from_bag(&options.bag, source))
        }
        Kind::Parquet => {
            let mut foreign = parquet_reader::read(open(path)?, source)?;
            lerobot::name_episode(&mut foreign, path);
            foreign.into_recording(source, mapping)
        }
        Kind::Zip => npz_reader::read(&all_of(source)?, source)?.into_recording(source, mapping),
        Kind::Npy => npz_reader::read_single(&all_of(source)?, source)?.into_recording(source, mapping),
        Kind::Mat => mat_reader::read(&all_of(source)?, source)?.into_recording(source, mapping),
        Kind::Text | Kind::Foreign(_) => dispatch_mapped(Cursor::new(head).chain(file), source, mapping),
    }
}

/// Reads `source`, whose format names the columns, with `read`; a mapping names and scales these columns again.
fn named_again(
    source: &Source,
    options: &ImportOptions,
    read: impl FnOnce(&Source) -> Result<Recording, ReadError>,
) -> Result<Recording, ReadError> {
    let Some(mapping) = &options.mapping else { return read(source) };
    // The mapping determines the number of joints, and needs all rows.
    let recording = read(&Source { joints: None, overview: None, ..*source })?;
    Foreign::of(recording).into_recording(source, Some(mapping))
}

/// True if the name of a compressed file ends like that of a bag.
fn is_named_as_bag(path: &Path) -> bool {
    path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with(".mcap"))
}

/// All bytes of `source`.
fn all_of(source: &Source) -> Result<Vec<u8>, ReadError> {
    open::bytes(source.file, source.limit.saturating_mul(8))
}

/// Selects the reader of a stream by its first bytes.
pub(crate) fn dispatch(input: impl Read, source: &Source) -> Result<Recording, ReadError> {
    dispatch_mapped(input, source, None)
}

fn dispatch_mapped(
    mut input: impl Read,
    source: &Source,
    mapping: Option<&Mapping>,
) -> Result<Recording, ReadError> {
    let file = || source.file.to_path_buf();
    let head = open::head(&mut input, source.file)?;
    if head.is_empty() {
        return Err(ReadError::Empty { file: file() });
    }
    match Kind::of(&head) {
        Kind::Mcap => mcap_reader::read(Cursor::new(head[mcap::MAGIC.len()..].to_vec()).chain(input), source),
        Kind::Text => csv_reader::read(Cursor::new(head).chain(input), source, mapping),
        Kind::Foreign(what) => Err(ReadError::NotText { file: file(), what }),
        _ => Err(ReadError::NotText { file: file(), what: "it can't be read from a stream: give a file" }),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::dispatch;
    use crate::error::ReadError;
    use crate::input::Source;
    use crate::layout::Layout;
    use crate::output::Output;
    use crate::output::tests::Disk;
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
        // The first rows are shorter than the others, so that the estimate is too high.
        let text =
            csv(1000) + &(1000..2000).map(|k| format!("{k},1.5000,2.5000,3.5000\n")).collect::<String>();
        let recording = dispatch(text.as_bytes(), &source(8000, Some(text.len() as u64)));
        assert_eq!(recording.expect("it fits").len(), 2000);
    }

    /// At any disk size the error states the number of kept rows, and the file has exactly these.
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
