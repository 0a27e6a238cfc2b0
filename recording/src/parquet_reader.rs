//! Reading Parquet: our own export, what pandas and polars write, and data sets with lists in a cell.

use parquet::basic::{ConvertedType, LogicalType, TimeUnit};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use crate::error::ReadError;
use crate::foreign::Foreign;
use crate::names::list;
use crate::read::Source;

/// Records that are read at a time.
const BATCH: usize = 1 << 14;
/// Parts of a path that only say that there is a list.
const OF_LISTS: [&str; 6] = ["list", "element", "item", "array", "bag", "array_element"];
/// Who writes our own export.
pub(crate) const CREATED_BY: &str = "freeplay";

/// The columns of `file`.
///
/// # Errors
/// [`ReadError::Unusable`] for a file that is damaged, [`ReadError::TooLarge`].
pub(crate) fn read(file: impl ChunkReader + 'static, source: &Source) -> Result<Foreign, ReadError> {
    let damaged = |error: ParquetError| ReadError::Unusable {
        file: source.file.to_path_buf(),
        what: format!("this Parquet file can't be read: {error}; write it again"),
    };
    let reader = SerializedFileReader::new(file).map_err(damaged)?;
    let metadata = reader.metadata().file_metadata();
    let (rows, columns) = (metadata.num_rows().max(0) as u64, metadata.schema_descr().num_columns());
    if rows.saturating_mul(columns as u64) > source.limit {
        let (file, remedy) = (source.file.to_path_buf(), "write fewer rows or columns".to_owned());
        return Err(ReadError::TooLarge { file, columns, rows, limit: source.limit, remedy });
    }
    let mut foreign = Foreign::default();
    if metadata.created_by() == Some(CREATED_BY) {
        let pairs = metadata.key_value_metadata().into_iter().flatten();
        foreign.metadata = pairs.filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?))).collect();
    }
    let mut aside = Vec::new();
    for column in 0..columns {
        let leaf = Leaf::of(&reader, column).map_err(damaged)?;
        match leaf {
            Some(leaf) => leaf.add_to(&mut foreign, rows as usize),
            None => aside.push(name(&metadata.schema_descr().column(column))),
        }
    }
    if !aside.is_empty() {
        foreign.notes.push(format!("columns that hold no numbers are left out: {}", list(&aside)));
    }
    Ok(foreign)
}

/// The name of a column, without what only says that there is a list.
fn name(column: &ColumnDescriptor) -> String {
    let parts = column.path().parts();
    let named =
        parts.iter().enumerate().filter(|(place, part)| *place == 0 || !OF_LISTS.contains(&part.as_str()));
    named.map(|(_, part)| part.as_str()).collect::<Vec<_>>().join(".")
}

/// One column as it is stored: its values, and of which row each is.
struct Leaf {
    name: String,
    values: Vec<f64>,
    /// Numbers of each row; none where each row has one.
    widths: Option<Vec<usize>>,
    is_moment: bool,
}

impl Leaf {
    /// The column number `column`; none if it holds no numbers, or lists of lists.
    fn of(reader: &impl FileReader, column: usize) -> Result<Option<Self>, ParquetError> {
        let descriptor = reader.metadata().file_metadata().schema_descr().column(column);
        let mut raw = Raw {
            is_list: descriptor.max_rep_level() == 1,
            descriptor,
            values: Vec::new(),
            widths: Vec::new(),
        };
        if raw.descriptor.max_rep_level() > 1 {
            return Ok(None);
        }
        let second = seconds(&raw.descriptor);
        let mut begin: Option<i64> = None;
        let mut moment = |value: i64, second: f64| (value - *begin.get_or_insert(value)) as f64 / second;
        for group in 0..reader.num_row_groups() {
            match reader.get_row_group(group)?.get_column_reader(column)? {
                ColumnReader::DoubleColumnReader(values) => raw.take(values, |value| *value)?,
                ColumnReader::FloatColumnReader(values) => raw.take(values, |value| f64::from(*value))?,
                ColumnReader::Int32ColumnReader(values) => raw.take(values, |value| f64::from(*value))?,
                ColumnReader::BoolColumnReader(values) => {
                    raw.take(values, |value| f64::from(u8::from(*value)))?
                }
                ColumnReader::Int64ColumnReader(values) => match second {
                    Some(second) => raw.take(values, |value| moment(*value, second))?,
                    None => raw.take(values, |value| *value as f64)?,
                },
                ColumnReader::Int96ColumnReader(values) => {
                    raw.take(values, |value| moment(value.to_nanos(), 1e9))?
                }
                ColumnReader::ByteArrayColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
                    return Ok(None);
                }
            }
        }
        let is_moment = second.is_some() || raw.descriptor.physical_type() == parquet::basic::Type::INT96;
        let widths = raw.is_list.then_some(raw.widths);
        Ok(Some(Self { name: name(&raw.descriptor), values: raw.values, widths, is_moment }))
    }

    /// Adds it to `foreign`: a list as one column for each of its places.
    fn add_to(self, foreign: &mut Foreign, rows: usize) {
        let Some(widths) = self.widths else {
            if self.is_moment {
                foreign.moments.insert(foreign.names.len());
            }
            let mut values = self.values;
            values.resize(rows, f64::NAN);
            return foreign.add(self.name, values);
        };
        let width = widths.iter().copied().max().unwrap_or(0);
        let mut columns = vec![Vec::with_capacity(rows); width];
        let mut begin = 0;
        for count in widths {
            for (place, column) in columns.iter_mut().enumerate() {
                column.push(if place < count { self.values[begin + place] } else { f64::NAN });
            }
            begin += count;
        }
        for (place, mut values) in columns.into_iter().enumerate() {
            values.resize(rows, f64::NAN);
            foreign.add(format!("{}[{place}]", self.name), values);
        }
    }
}

/// What is read of a column so far.
struct Raw {
    descriptor: std::sync::Arc<ColumnDescriptor>,
    is_list: bool,
    values: Vec<f64>,
    widths: Vec<usize>,
}

impl Raw {
    /// Takes all of one row group.
    ///
    /// Source: Dremel encoding, <https://parquet.apache.org/docs/file-format/nestedencoding/>.
    fn take<T: DataType>(
        &mut self,
        mut reader: ColumnReaderImpl<T>,
        mut number: impl FnMut(&T::T) -> f64,
    ) -> Result<(), ParquetError> {
        let most = self.descriptor.max_def_level();
        let is_null_element = |level: i16| level + 1 == most && self.descriptor.self_type().is_optional();
        let (mut values, mut defined, mut repeated) = (Vec::new(), Vec::new(), Vec::new());
        loop {
            values.clear();
            defined.clear();
            repeated.clear();
            let levels = (most > 0).then_some(&mut defined);
            let (records, _, count) =
                reader.read_records(BATCH, levels, self.is_list.then_some(&mut repeated), &mut values)?;
            if records == 0 && count == 0 {
                return Ok(());
            }
            let mut numbers = values.iter().map(&mut number);
            for level in 0..count {
                let is_there = most == 0 || defined[level] == most;
                if !self.is_list {
                    self.values.push(if is_there { numbers.next().unwrap_or(f64::NAN) } else { f64::NAN });
                    continue;
                }
                if repeated[level] == 0 {
                    self.widths.push(0);
                }
                if is_there || is_null_element(defined[level]) {
                    self.values.push(if is_there { numbers.next().unwrap_or(f64::NAN) } else { f64::NAN });
                    if let Some(width) = self.widths.last_mut() {
                        *width += 1;
                    }
                }
            }
        }
    }
}

/// How many of a column's units are a second, if it holds moments.
fn seconds(column: &ColumnDescriptor) -> Option<f64> {
    match (column.logical_type_ref(), column.converted_type()) {
        (Some(LogicalType::Timestamp(timestamp)), _) => Some(match timestamp.unit {
            TimeUnit::MILLIS => 1e3,
            TimeUnit::MICROS => 1e6,
            TimeUnit::NANOS => 1e9,
        }),
        (_, ConvertedType::TIMESTAMP_MILLIS) => Some(1e3),
        (_, ConvertedType::TIMESTAMP_MICROS) => Some(1e6),
        _ => None,
    }
}
