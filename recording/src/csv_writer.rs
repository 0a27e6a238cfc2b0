//! Writing a recording as CSV.

use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::error::WriteError;
use crate::layout::{Layout, Pace, Summary};
use crate::output::Output;

/// Writes a recording as CSV: a header, then one line per row, each number in the shortest form that reads back to the same bits. See [`crate::RowWriter`] for
/// its guarantees.
pub struct CsvWriter {
    file: PathBuf,
    /// `None` after an error.
    output: Option<Output>,
    text: Vec<u8>,
    pace: Pace,
    width: usize,
    time: usize,
    rows: u64,
    kept: u64,
}

impl fmt::Debug for CsvWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CsvWriter")
            .field("file", &self.file)
            .field("rows", &self.rows)
            .finish_non_exhaustive()
    }
}

impl CsvWriter {
    /// Begins a CSV.
    ///
    /// # Errors
    /// [`WriteError::Create`], [`WriteError::Stopped`].
    pub fn create(path: &Path, layout: &Layout) -> Result<Self, WriteError> {
        CsvWriter::begin(path, Output::live(path), layout)
    }

    /// Begins a CSV that appears under its name only when it is complete.
    pub(crate) fn replace(path: &Path, layout: &Layout) -> Result<Self, WriteError> {
        CsvWriter::begin(path, Output::atomic(path), layout)
    }

    fn begin(path: &Path, output: io::Result<Output>, layout: &Layout) -> Result<Self, WriteError> {
        let output = output.map_err(|source| WriteError::Create { file: path.to_path_buf(), source })?;
        CsvWriter::over(path, output, layout)
    }

    pub(crate) fn over(path: &Path, output: Output, layout: &Layout) -> Result<Self, WriteError> {
        let mut writer = CsvWriter {
            file: path.to_path_buf(),
            output: Some(output),
            text: Vec::new(),
            pace: Pace::default(),
            width: layout.columns().len(),
            time: layout.time(),
            rows: 0,
            kept: 0,
        };
        writer.text = header(layout).map_err(|source| writer.stopped(source))?;
        writer.hand_over()?;
        Ok(writer)
    }

    /// Writes one row: a value per column of the layout.
    ///
    /// # Errors
    /// As [`crate::RowWriter::write`].
    pub fn write(&mut self, row: &[f64]) -> Result<(), WriteError> {
        if self.output.is_none() {
            return Err(WriteError::Closed { file: self.file.clone() });
        }
        if row.len() != self.width {
            let (row, expected, found) = (self.rows + 1, self.width, row.len());
            return Err(WriteError::Width { file: self.file.clone(), row, expected, found });
        }
        let before = self.text.len();
        for (i, value) in row.iter().enumerate() {
            if i > 0 {
                self.text.push(b',');
            }
            push_number(&mut self.text, *value);
        }
        self.text.push(b'\n');
        self.rows += 1;
        if self.pace.due(row[self.time], self.text.len() - before) { self.hand_over() } else { Ok(()) }
    }

    /// Writes the remaining rows and closes the file.
    ///
    /// # Errors
    /// As [`crate::RowWriter::finish`].
    pub fn finish(mut self) -> Result<Summary, WriteError> {
        self.hand_over()?;
        let Some(output) = self.output.take() else {
            return Err(WriteError::Closed { file: self.file.clone() });
        };
        let bytes = output.finish().map_err(|source| self.stopped(source))?;
        Ok(Summary { file: self.file.clone(), rows: self.rows, events: 0, bytes })
    }

    fn hand_over(&mut self) -> Result<(), WriteError> {
        let Some(output) = &mut self.output else {
            return Err(WriteError::Closed { file: self.file.clone() });
        };
        match output.block(&self.text) {
            Ok(()) => {
                self.text.clear();
                self.kept = self.rows;
                Ok(())
            }
            Err(source) => {
                self.output = None;
                Err(self.stopped(source))
            }
        }
    }

    fn stopped(&self, source: io::Error) -> WriteError {
        WriteError::Stopped { file: self.file.clone(), rows: self.rows, kept: self.kept, source }
    }
}

impl Drop for CsvWriter {
    fn drop(&mut self) {
        if self.output.is_some() && !self.text.is_empty() {
            let _ = self.hand_over();
        }
    }
}

/// The header line; names with commas or quotes in them are quoted.
fn header(layout: &Layout) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(layout.columns()).map_err(io::Error::other)?;
    writer.into_inner().map_err(|error| io::Error::other(error.to_string()))
}

/// Appends the shortest text that reads back to the same bits: plain from 1e-5 up to 1e16, else with
/// an exponent.
fn push_number(text: &mut Vec<u8>, value: f64) {
    let size = value.abs();
    let plain = size == 0.0 || (1e-5..1e16).contains(&size) || !size.is_finite();
    let written = if plain { write!(text, "{value}") } else { write!(text, "{value:e}") };
    written.expect("writing to memory succeeds");
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::{ProptestConfig, any, prop_assert_eq, proptest};
    use proptest::test_runner::RngSeed;

    use super::{CsvWriter, push_number};
    use crate::error::WriteError;
    use crate::layout::Layout;
    use crate::output::Output;
    use crate::output::tests::Disk;

    fn text(value: f64) -> String {
        let mut text = Vec::new();
        push_number(&mut text, value);
        String::from_utf8(text).expect("ASCII")
    }

    #[test]
    fn numbers_are_short() {
        let cases =
            [(0.0, "0"), (-0.0, "-0"), (1.0, "1"), (0.1, "0.1"), (5e-324, "5e-324"), (1e300, "1e300")];
        for (value, expected) in cases {
            assert_eq!(text(value), expected);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

        #[test]
        fn numbers_read_back_to_the_same_bits(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            let back: f64 = text(value).parse().expect("Rust reads what Rust writes");
            prop_assert_eq!(back.is_nan(), value.is_nan());
            if !value.is_nan() {
                prop_assert_eq!(back.to_bits(), bits);
            }
        }
    }

    /// At any disk size the error states the number of kept rows, and the file has exactly these.
    #[test]
    fn a_full_disk_leaves_whole_rows() {
        let layout = Layout::new(["t", "q1"]).expect("a layout");
        let mut stopped = 0;
        for room in (0..4000).step_by(37) {
            let disk = Disk::with_room(room);
            let made = CsvWriter::over(Path::new("run.csv"), Output::over(Box::new(disk.clone())), &layout);
            let Ok(mut writer) = made else {
                assert!(room < "t,q1\n".len() && disk.content().is_empty());
                continue;
            };
            let error = (0..1000).find_map(|k| writer.write(&[f64::from(k) * 0.01, 1.0 / 3.0]).err());
            let Some(WriteError::Stopped { kept, .. }) = error else { panic!("room {room}: {error:?}") };
            assert!(matches!(writer.write(&[0.0, 0.0]), Err(WriteError::Closed { .. })));
            drop(writer);
            let content = String::from_utf8(disk.content()).expect("ASCII");
            assert!(content.ends_with('\n'), "room {room}: ends within a row");
            assert_eq!(content.lines().count() as u64, kept + 1, "room {room}");
            stopped += 1;
        }
        println!("{stopped} sizes of disk");
        assert!(stopped > 100);
    }
}
