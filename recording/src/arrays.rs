//! Arrays with names, as NumPy and MATLAB keep them, as columns.

use std::collections::BTreeMap;

use crate::foreign::Foreign;
use crate::names::list;

/// An array of numbers, the last index running fastest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Array {
    pub name: String,
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// The columns that `arrays` hold, and what `texts` say of the joints. Samples run along the length that most arrays share.
pub(crate) fn columns(arrays: Vec<Array>, texts: Vec<Vec<String>>) -> Foreign {
    let mut foreign = Foreign::default();
    let squeezed: Vec<Array> = arrays
        .into_iter()
        .map(|array| Array {
            shape: array.shape.iter().copied().filter(|&size| size != 1).collect(),
            ..array
        })
        .collect();
    let mut lengths: BTreeMap<usize, usize> = BTreeMap::new();
    for size in squeezed.iter().flat_map(|array| &array.shape) {
        *lengths.entry(*size).or_default() += 1;
    }
    let Some((&samples, _)) = lengths.iter().max_by_key(|(size, count)| (**count, **size)) else {
        return foreign;
    };
    let mut aside = Vec::new();
    for array in squeezed {
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
        foreign.notes.push(format!("arrays that have not {samples} samples are left out: {}", list(&aside)));
    }
    foreign.joints = texts.into_iter().find(|texts| texts.len() > 1).unwrap_or_default();
    foreign
}
