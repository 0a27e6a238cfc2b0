//! Reading Parquet: our own export, what pandas and polars write, and data sets with lists in a cell.

use freeplay_storage::InputFile;
use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::{ChunkReader, FileReader, Length, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use crate::error::ReadError;
use crate::foreign::Foreign;
use crate::input::Source;
use crate::names::list;
use crate::parquet_claims::{Claims, Refused, check_depth, check_rows};

/// Records per read.
const BATCH: usize = 1 << 14;
/// Parts of a path that only mark a list.
const OF_LISTS: [&str; 6] = ["list", "element", "item", "array", "bag", "array_element"];
/// Writer of Freeplay's own export.
pub(crate) const CREATED_BY: &str = "freeplay";

/// The columns of `file`.
///
/// # Errors
/// [`ReadError::Unusable`] for a file that is damaged, or claims more than it can contain; [`ReadError::TooLarge`].
pub(crate) fn read(file: InputFile, source: &Source) -> Result<Foreign, ReadError> {
    let damaged = |Refused(what): Refused| ReadError::Unusable {
        file: source.file.to_path_buf(),
        what: format!("this Parquet file can't be read: {what}; write it again"),
    };
    let file = file.into_file();
    check_depth(&file).map_err(damaged)?;
    let pages = file.try_clone().map_err(|error| damaged(ParquetError::from(error).into()))?;
    let mut claims = Claims::new(Length::len(&file), source.limit);
    let reader = SerializedFileReader::new(file).map_err(|error| damaged(error.into()))?;
    let rows = check_rows(reader.metadata()).map_err(damaged)?;
    let metadata = reader.metadata().file_metadata();
    let columns = metadata.schema_descr().num_columns();
    source.check_size(columns, rows, "write fewer rows or columns")?;
    let mut foreign = Foreign::default();
    if metadata.created_by() == Some(CREATED_BY) {
        let pairs = metadata.key_value_metadata().into_iter().flatten();
        foreign.metadata = pairs.filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?))).collect();
    }
    let mut aside = Vec::new();
    for column in 0..columns {
        let leaf = Leaf::of(&reader, &pages, column, &mut claims).map_err(damaged)?;
        match leaf {
            Some(leaf) => leaf.add_to(&mut foreign, rows as usize, &mut claims).map_err(damaged)?,
            None => aside.push(name(&metadata.schema_descr().column(column))),
        }
    }
    if !aside.is_empty() {
        foreign.notes.push(format!("columns that hold no numbers are left out: {}", list(&aside)));
    }
    Ok(foreign)
}

/// The name of a column, without parts that only mark a list.
fn name(column: &ColumnDescriptor) -> String {
    let parts = column.path().parts();
    let named =
        parts.iter().enumerate().filter(|(place, part)| *place == 0 || !OF_LISTS.contains(&part.as_str()));
    named.map(|(_, part)| part.as_str()).collect::<Vec<_>>().join(".")
}

/// One stored column: its values, and the row of each.
struct Leaf {
    name: String,
    values: Vec<f64>,
    /// Count of numbers of each row; `None` if each row has one.
    widths: Option<Vec<usize>>,
    is_time_stamp: bool,
}

impl Leaf {
    /// The column number `column`, whose pages are in `pages`; `None` for a column without numbers, or with lists of lists. Its numbers count against `claims`;
    /// those of a list do so when it is laid out.
    fn of(
        reader: &impl FileReader,
        pages: &impl ChunkReader,
        column: usize,
        claims: &mut Claims,
    ) -> Result<Option<Self>, Refused> {
        let descriptor = reader.metadata().file_metadata().schema_descr().column(column);
        let mut raw = Raw {
            is_list: descriptor.max_rep_level() == 1,
            descriptor,
            values: Vec::new(),
            widths: Vec::new(),
        };
        if raw.descriptor.max_rep_level() > 1 || !is_number(raw.descriptor.physical_type()) {
            return Ok(None);
        }
        raw.check(reader.metadata(), pages, column, claims)?;
        let second = seconds(&raw.descriptor);
        let mut begin: Option<i64> = None;
        let mut since_first = |value: i64, second: f64| (value - *begin.get_or_insert(value)) as f64 / second;
        for group in 0..reader.num_row_groups() {
            match reader.get_row_group(group)?.get_column_reader(column)? {
                ColumnReader::DoubleColumnReader(values) => raw.take(values, |value| *value)?,
                ColumnReader::FloatColumnReader(values) => raw.take(values, |value| f64::from(*value))?,
                ColumnReader::Int32ColumnReader(values) => raw.take(values, |value| f64::from(*value))?,
                ColumnReader::BoolColumnReader(values) => {
                    raw.take(values, |value| f64::from(u8::from(*value)))?
                }
                ColumnReader::Int64ColumnReader(values) => match second {
                    Some(second) => raw.take(values, |value| since_first(*value, second))?,
                    None => raw.take(values, |value| *value as f64)?,
                },
                ColumnReader::Int96ColumnReader(values) => {
                    raw.take(values, |value| since_first(value.to_nanos(), 1e9))?
                }
                ColumnReader::ByteArrayColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
                    return Ok(None);
                }
            }
        }
        let is_time_stamp = second.is_some() || raw.descriptor.physical_type() == Type::INT96;
        let widths = raw.is_list.then_some(raw.widths);
        Ok(Some(Self { name: name(&raw.descriptor), values: raw.values, widths, is_time_stamp }))
    }

    /// Adds the column to `foreign`; a list becomes one column for each of its positions.
    fn add_to(self, foreign: &mut Foreign, rows: usize, claims: &mut Claims) -> Result<(), Refused> {
        let found = self.widths.as_ref().map_or(self.values.len(), Vec::len);
        if found != rows {
            return Err(Refused(format!("column {} has {found} rows of {rows}", self.name)));
        }
        let Some(widths) = self.widths else {
            if self.is_time_stamp {
                foreign.time_stamps.insert(foreign.names.len());
            }
            foreign.add(self.name, self.values);
            return Ok(());
        };
        let width = widths.iter().copied().max().unwrap_or(0);
        claims.take((rows as u64).saturating_mul(width as u64))?;
        let mut columns = vec![Vec::with_capacity(rows); width];
        let mut begin = 0;
        for count in widths {
            for (place, column) in columns.iter_mut().enumerate() {
                column.push(if place < count { self.values[begin + place] } else { f64::NAN });
            }
            begin += count;
        }
        for (place, values) in columns.into_iter().enumerate() {
            foreign.add(format!("{}[{place}]", self.name), values);
        }
        Ok(())
    }
}

/// The values of a column read so far.
struct Raw {
    descriptor: std::sync::Arc<ColumnDescriptor>,
    is_list: bool,
    values: Vec<f64>,
    widths: Vec<usize>,
}

/// True if values of the type `kind` are read as numbers.
fn is_number(kind: Type) -> bool {
    !matches!(kind, Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY)
}

impl Raw {
    /// Checks the claims of `metadata` and of the pages on the column number `column` before decoding.
    fn check(
        &self,
        metadata: &ParquetMetaData,
        pages: &impl ChunkReader,
        column: usize,
        claims: &mut Claims,
    ) -> Result<(), Refused> {
        let mut all = 0;
        for group in metadata.row_groups() {
            let (chunk, rows) = (group.columns().get(column), group.num_rows());
            let chunk = chunk.ok_or_else(|| Refused("a row group lacks some columns".to_owned()))?;
            let values = claims.check_chunk(pages, chunk)?;
            if !self.is_list && i64::try_from(values) != Ok(rows) {
                let name = name(&self.descriptor);
                return Err(Refused(format!("column {name} has {values} numbers in {rows} rows")));
            }
            all += values;
        }
        // A list column gets the width of its longest row in every row.
        if self.is_list { claims.fits(all) } else { claims.take(all) }
    }

    /// Reads one row group.
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

/// Units per second of a column of times; `None` for other columns.
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
