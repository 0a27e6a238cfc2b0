//! Reading the rows of a path file.
//!
//! CSV with a header; names and values may have blanks around them, lines beginning with `#` are comments.
//! - `t,q1,…,qn`: joint path (rad, m). The reader ignores other columns, so that a recording can be run again.
//! - `t,x,y,z[,qx,qy,qz,qw]`: path of the tool in the base frame (m), with or without its orientation.
//!
//! Times in s, increasing, not necessarily equidistant; the motion begins at the first row, whatever its time.

use std::path::{Path, PathBuf};

use csv::StringRecord;

use crate::planning::file_error::{FEWEST_ROWS, FileError, Place};

/// Most numbers of one path in memory (256 MiB).
pub(crate) const MOST_VALUES: usize = 1 << 25;
/// Tolerance of a quaternion's norm in a file against 1.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// The content of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    /// Columns q1…qn.
    Joints,
    /// Columns x, y, z.
    Positions,
    /// Columns x, y, z, qx, qy, qz, qw.
    Poses,
}

/// The rows of a file, its times shifted to begin at 0.
#[derive(Debug)]
pub(crate) struct Rows {
    pub file: PathBuf,
    pub content: Content,
    pub names: Vec<String>,
    /// Positions of the columns in the file, from 0; the first is that of the time.
    fields: Vec<usize>,
    pub times: Vec<f64>,
    /// Row-major, one value for each of `names`.
    pub values: Vec<f64>,
    lines: Vec<u64>,
}

impl Rows {
    /// Reads `file` for an arm of `dof` joints and a motion of `laps` laps.
    pub fn read(file: &Path, dof: usize, laps: u32) -> Result<Rows, FileError> {
        let bytes = freeplay_storage::read_bytes(file, freeplay_storage::DOCUMENT_LIMIT)?;
        let failed = |source| FileError::Read { file: file.to_path_buf(), source };
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(bytes.as_slice());
        let header = reader.headers().map_err(failed)?.clone();
        let mut rows = Rows::of_header(file, &header, dof)?;
        let most = MOST_VALUES / (3 * rows.names.len() + 1) / laps.max(1) as usize;
        let mut record = StringRecord::new();
        while reader.read_record(&mut record).map_err(failed)? {
            let line = record.position().map_or(0, csv::Position::line);
            if rows.times.len() >= most {
                return Err(FileError::TooManyRows { place: rows.at_line(line, 0), most });
            }
            rows.push(line, &record, header.len())?;
        }
        rows.finish()
    }

    /// Repeats the rows for `laps` laps.
    pub fn repeat(&mut self, laps: u32) -> Result<(), FileError> {
        if laps == 1 {
            return Ok(());
        }
        self.check_closed()?;
        let (width, rows, lap) = (self.names.len(), self.times.len(), self.span());
        for k in 1..laps {
            for row in 1..rows {
                self.times.push(f64::from(k) * lap + self.times[row]);
                self.lines.push(self.lines[row]);
            }
            self.values.extend_from_within(width..width * rows);
        }
        Ok(())
    }

    /// Time from the first row to the last, s.
    pub fn span(&self) -> f64 {
        self.times.last().copied().unwrap_or_default()
    }

    /// The row at or before time `t`, and the field of `column` in it (0 is the time).
    pub fn place(&self, t: f64, column: usize) -> Place {
        let row = self.times.partition_point(|&time| time <= t).max(1) - 1;
        self.at_line(self.lines[row], column)
    }

    fn of_header(file: &Path, header: &StringRecord, dof: usize) -> Result<Rows, FileError> {
        let place = |field: usize| Place { file: file.to_path_buf(), line: 1, column: field + 1 };
        let joints = (1..).take_while(|k| header.iter().any(|name| name == format!("q{k}"))).count();
        let tool = ["x", "y", "z", "qx", "qy", "qz", "qw"];
        let (content, names) = if joints > 0 {
            (Content::Joints, (1..=joints).map(|k| format!("q{k}")).collect())
        } else if header.iter().any(|name| tool[3..].contains(&name)) {
            (Content::Poses, tool.map(String::from).to_vec())
        } else if header.iter().any(|name| tool[..3].contains(&name)) {
            (Content::Positions, tool[..3].iter().map(|name| (*name).to_owned()).collect())
        } else {
            (Content::Joints, vec!["q1".to_owned()])
        };
        let mut fields = Vec::with_capacity(names.len() + 1);
        for name in std::iter::once("t").chain(names.iter().map(String::as_str)) {
            let mut found =
                header.iter().enumerate().filter(|(_, text)| *text == name).map(|(field, _)| field);
            let Some(field) = found.next() else {
                return Err(FileError::MissingColumn { place: place(0), name: name.to_owned() });
            };
            if let Some(second) = found.next() {
                return Err(FileError::DuplicateColumn { place: place(second), name: name.to_owned() });
            }
            fields.push(field);
        }
        if content == Content::Joints
            && joints < dof
            && header.iter().any(|name| is_joint_beyond(name, joints))
        {
            return Err(FileError::MissingColumn { place: place(0), name: format!("q{}", joints + 1) });
        }
        if content == Content::Joints && joints != dof {
            return Err(FileError::JointCount { place: place(fields[joints]), found: joints, expected: dof });
        }
        let (times, values, lines) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Rows { file: file.to_path_buf(), content, names, fields, times, values, lines })
    }

    fn push(&mut self, line: u64, record: &StringRecord, expected: usize) -> Result<(), FileError> {
        if record.len() != expected {
            let place = Place { file: self.file.clone(), line, column: record.len().min(expected) };
            return Err(FileError::Ragged { place, found: record.len(), expected });
        }
        let time = self.number(line, record, 0)?;
        if let Some(&previous) = self.times.last()
            && time <= previous
        {
            return Err(FileError::TimeNotIncreasing { place: self.at_line(line, 0), time, previous });
        }
        for column in 1..self.fields.len() {
            let value = self.number(line, record, column)?;
            self.values.push(value);
        }
        self.times.push(time);
        self.lines.push(line);
        if self.content == Content::Poses { self.straighten_quaternion(line) } else { Ok(()) }
    }

    /// Parses the value of `column`, where 0 is the time.
    fn number(&self, line: u64, record: &StringRecord, column: usize) -> Result<f64, FileError> {
        let text = &record[self.fields[column]];
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(FileError::NotANumber {
                place: self.at_line(line, column),
                name: if column == 0 { "t".to_owned() } else { self.names[column - 1].clone() },
                text: text.chars().take(40).collect(),
            }),
        }
    }

    /// Normalises the last row's quaternion and chooses the sign nearer to the row before: Q and −Q are the same orientation, but a curve
    /// between them is not constant.
    fn straighten_quaternion(&mut self, line: u64) -> Result<(), FileError> {
        let last_row = self.values.len() - self.names.len();
        let (before, last) = self.values.split_at_mut(last_row);
        let norm = last[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > QUATERNION_TOLERANCE {
            return Err(FileError::Quaternion { place: self.at_line(line, 4), norm });
        }
        let previous = before.len().checked_sub(4).map(|from| &before[from..]);
        let dot: f64 = previous.map_or(1.0, |old| old.iter().zip(&last[3..]).map(|(a, b)| a * b).sum());
        let scale = 1.0_f64.copysign(dot) / norm;
        last[3..].iter_mut().for_each(|x| *x *= scale);
        Ok(())
    }

    fn finish(mut self) -> Result<Rows, FileError> {
        if self.times.len() < FEWEST_ROWS {
            return Err(FileError::TooFewRows { file: self.file, found: self.times.len() });
        }
        let first = self.times[0];
        self.times.iter_mut().for_each(|t| *t -= first);
        Ok(self)
    }

    fn check_closed(&self) -> Result<(), FileError> {
        let width = self.names.len();
        let last_row = &self.values[self.values.len() - width..];
        for (column, (&first, &last)) in self.values.iter().zip(last_row).enumerate() {
            if (first - last).abs() > 1e-6 {
                let place = self.place(f64::INFINITY, column + 1);
                let name = self.names[column].clone();
                return Err(FileError::NotClosed { place, name, first, last });
            }
        }
        Ok(())
    }

    /// The place of `column` (0 is the time) in a line.
    fn at_line(&self, line: u64, column: usize) -> Place {
        Place { file: self.file.clone(), line, column: self.fields[column] + 1 }
    }
}

/// True if `name` is q⟨k⟩ with k > `joints`.
fn is_joint_beyond(name: &str, joints: usize) -> bool {
    name.strip_prefix('q').and_then(|k| k.parse::<usize>().ok()).is_some_and(|k| k > joints)
}
