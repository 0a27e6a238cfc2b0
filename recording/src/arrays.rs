//! Converts named arrays, as in files of NumPy and MATLAB, to columns.

use std::collections::BTreeMap;
use std::io::Read;

use crate::foreign::Foreign;
use crate::input::Source;
use crate::names::list;

/// Numbers per conversion step.
const BLOCK: usize = 1 << 12;

/// Largest number of columns of a file: a line of text with all their names would be no longer than the longest line of a CSV.
const MAX_COLUMNS: usize = crate::line_guard::MAX_LINE / 2;

/// Decoder of a number from eight little-endian bytes.
pub(crate) type Number = fn([u8; 8]) -> f64;

/// An array of numbers, the last index varying fastest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Array {
    pub name: String,
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// Memory budget for the arrays of one file, checked before inflation.
#[derive(Debug)]
pub(crate) struct MemoryBudget {
    /// Remaining numbers.
    numbers: u64,
    /// Largest possible number of samples: the times of a recording differ, so that each takes at least one bit of a compressed file.
    samples: u64,
    /// Arrays with more samples than this.
    pub too_long: Vec<String>,
}

/// An array exceeds the remaining budget.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct OverBudget;

impl MemoryBudget {
    /// The budget for a file of `length` bytes.
    pub fn of(source: &Source, length: usize) -> Self {
        Self { numbers: source.limit, samples: (length as u64).saturating_mul(8), too_long: Vec::new() }
    }

    /// Takes the numbers of the array `name` of this `shape` from the budget and returns their count; 0 for an array to be skipped.
    pub fn take(&mut self, name: &str, shape: &[usize]) -> Result<usize, OverBudget> {
        if shape.contains(&0) {
            return Ok(0);
        }
        if shape.iter().any(|&size| size as u64 > self.samples) {
            self.too_long.push(name.to_owned());
            return Ok(0);
        }
        let count =
            shape.iter().try_fold(1_usize, |count, size| count.checked_mul(*size)).ok_or(OverBudget)?;
        self.numbers = self.numbers.checked_sub(count as u64).ok_or(OverBudget)?;
        Ok(count)
    }
}

/// Reads `count` numbers of `size` bytes each from `input`; `number` decodes eight little-endian bytes.
///
/// # Errors
/// An error of `input`, or its early end.
pub(crate) fn numbers(
    input: &mut dyn Read,
    count: usize,
    size: usize,
    is_big: bool,
    number: Number,
) -> std::io::Result<Vec<f64>> {
    let mut values = Vec::new();
    let mut block = vec![0; size * count.min(BLOCK)];
    while values.len() < count {
        let block = &mut block[..size * (count - values.len()).min(BLOCK)];
        input.read_exact(block)?;
        values.extend(block.chunks_exact(size).map(|cell| {
            let mut bytes = [0; 8];
            bytes[..size].copy_from_slice(cell);
            if is_big {
                bytes[..size].reverse();
            }
            number(bytes)
        }));
    }
    Ok(values)
}

/// The message for arrays that are all empty, or too long for their file.
pub(crate) const NO_SAMPLES: &str = "its arrays are empty, or claim more samples than so short a file can contain; write it again, with the time of each sample";

/// The columns in `arrays`, with the names of the joints from `texts`; `None` without samples. Samples run along the length that most arrays share. The arrays
/// were read within `budget`.
pub(crate) fn columns(arrays: Vec<Array>, texts: Vec<Vec<String>>, budget: MemoryBudget) -> Option<Foreign> {
    let mut foreign = Foreign::default();
    let squeezed: Vec<Array> = arrays
        .into_iter()
        .map(|array| Array {
            shape: array.shape.iter().copied().filter(|&size| size != 1).collect(),
            ..array
        })
        .filter(|array| !array.values.is_empty())
        .collect();
    let mut lengths: BTreeMap<usize, usize> = BTreeMap::new();
    for size in squeezed.iter().flat_map(|array| &array.shape) {
        *lengths.entry(*size).or_default() += 1;
    }
    let (&samples, _) = lengths.iter().max_by_key(|(size, count)| (**count, **size))?;
    let mut aside = budget.too_long;
    for array in squeezed {
        let columns = array.values.len() / samples;
        if foreign.names.len() + columns > MAX_COLUMNS {
            aside.push(array.name);
            continue;
        }
        match array.shape.as_slice() {
            [all] if *all == samples => foreign.add(array.name, array.values),
            [rows, columns] if *rows == samples => {
                for column in 0..*columns {
                    let values = (0..samples).map(|row| array.values[row * columns + column]).collect();
                    foreign.add(format!("{}[{column}]", array.name), values);
                }
            }
            [rows, columns] if *columns == samples => {
                for row in 0..*rows {
                    let values = array.values[row * samples..(row + 1) * samples].to_vec();
                    foreign.add(format!("{}[{row}]", array.name), values);
                }
            }
            _ => aside.push(array.name),
        }
    }
    if !aside.is_empty() {
        let what = format!("arrays without {samples} samples, or with too many columns, are left out");
        foreign.notes.push(format!("{what}: {}", list(&aside)));
    }
    foreign.joints = texts.into_iter().find(|texts| texts.len() > 1).unwrap_or_default();
    Some(foreign)
}
