//! Reading NumPy's `.npz` and `.npy`.
//!
//! Source: NumPy Enhancement Proposal 1, "A Simple File Format for NumPy Arrays", with versions 1 to 3 of the format.

use std::io::Read;

use rawzip::{CompressionMethod, ZipArchive};

use crate::arrays::{Array, MemoryBudget, NO_SAMPLES, Number, OverBudget, columns, numbers};
use crate::error::ReadError;
use crate::foreign::Foreign;
use crate::input::Source;
use crate::names::{list, shorten};

/// Content of an array file.
enum Held {
    Numbers(Array),
    Texts(Vec<String>),
    /// Something else: the type.
    Other(String),
}

/// Longest permitted header and longest list of names, bytes.
const MAX_TEXT: usize = 1 << 20;

/// The arrays of the `.npz` in `bytes`. The reader reads the headers before it inflates anything else.
///
/// # Errors
/// [`ReadError::Unusable`] for an archive without arrays, or one that is damaged.
pub(crate) fn read(bytes: &[u8], source: &Source) -> Result<Foreign, ReadError> {
    let unusable = |what: String| ReadError::Unusable { file: source.file.to_path_buf(), what };
    let damaged = |error: &dyn std::fmt::Display| {
        unusable(format!("this archive can't be read: {error}; write it again"))
    };
    let archive = ZipArchive::from_slice(bytes).map_err(|error| damaged(&error))?;
    let (mut arrays, mut texts, mut aside, mut entries) =
        (Vec::new(), Vec::new(), Vec::new(), archive.entries());
    let mut budget = MemoryBudget::of(source, bytes.len());
    while let Some(entry) = entries.next_entry().map_err(|error| damaged(&error))? {
        let path = entry.file_path();
        let path = String::from_utf8_lossy(path.as_ref()).into_owned();
        let Some(name) = path.strip_suffix(".npy") else { continue };
        let held = archive.get_entry(entry.wayfinder()).map_err(|error| damaged(&error))?;
        let (mut stored, mut deflated);
        let data: &mut dyn Read = match entry.compression_method() {
            CompressionMethod::STORE => {
                stored = held.data();
                &mut stored
            }
            CompressionMethod::DEFLATE => {
                deflated = flate2::read::DeflateDecoder::new(held.data());
                &mut deflated
            }
            other => {
                return Err(unusable(format!(
                    "{path} is compressed by {other:?}; write it with numpy.savez_compressed"
                )));
            }
        };
        match array(name, data, &mut budget).map_err(|what| unusable(format!("{path}: {what}")))? {
            Held::Numbers(array) => arrays.push(array),
            Held::Texts(text) => texts.push(text),
            Held::Other(kind) => aside.push(format!("{name} ({kind})")),
        }
    }
    if arrays.is_empty() && budget.too_long.is_empty() {
        let what = "a ZIP archive or a spreadsheet, without arrays of numbers: export it as CSV, or write it with numpy.savez";
        return Err(unusable(what.to_owned()));
    }
    let mut foreign = columns(arrays, texts, budget).ok_or_else(|| unusable(NO_SAMPLES.to_owned()))?;
    if !aside.is_empty() {
        foreign.notes.push(format!("arrays that hold no numbers are left out: {}", list(&aside)));
    }
    Ok(foreign)
}

/// The single array of the `.npy` in `bytes`; numbers name its columns.
///
/// # Errors
/// [`ReadError::Unusable`].
pub(crate) fn read_single(bytes: &[u8], source: &Source) -> Result<Foreign, ReadError> {
    let unusable = |what: String| ReadError::Unusable { file: source.file.to_path_buf(), what };
    let mut budget = MemoryBudget::of(source, bytes.len());
    match array("column", &mut { bytes }, &mut budget).map_err(unusable)? {
        Held::Numbers(array) if array.shape.len() == 2 => {
            let mut foreign = columns(vec![array], Vec::new(), budget)
                .ok_or_else(|| unusable(NO_SAMPLES.to_owned()))?;
            foreign.names = (1..=foreign.names.len()).map(|number| number.to_string()).collect();
            foreign.numbered = true;
            Ok(foreign)
        }
        Held::Numbers(_) | Held::Texts(_) | Held::Other(_) => Err(unusable(
            "a NumPy array that is no table of numbers; write all of them with numpy.savez('run.npz', t=t, q=q, tau=tau)".to_owned(),
        )),
    }
}

/// The array in `input`, or its fault.
fn array(name: &str, input: &mut dyn Read, budget: &mut MemoryBudget) -> Result<Held, String> {
    let header = header(input).ok_or("no NumPy array, or its header is cut")?;
    let kind = value_of(&header, "descr").ok_or("its header has no descr")?.trim_matches(['\'', '"']);
    let is_fortran = value_of(&header, "fortran_order").is_some_and(|text| text.starts_with("True"));
    let shape = value_of(&header, "shape").ok_or("its header has no shape")?;
    let sizes = shape.trim_matches(['(', ')']).split(',').map(str::trim).filter(|size| !size.is_empty());
    let shape: Vec<usize> =
        sizes.map(str::parse).collect::<Result<_, _>>().map_err(|_| "its shape is too large")?;
    let (order, letter) = kind.split_at(usize::from(kind.starts_with(['<', '>', '|', '='])));
    let is_big = order == ">";
    let cut = |_| "it ends before its last number; write it again".to_owned();
    if let Some(length) = letter.strip_prefix('U').and_then(|length| length.parse::<usize>().ok()) {
        let bytes = shape.iter().try_fold(length.saturating_mul(4), |bytes, size| bytes.checked_mul(*size));
        let Some(bytes) = bytes.filter(|bytes| *bytes <= MAX_TEXT) else {
            return Ok(Held::Other(format!("{} with too many of them", shorten(kind))));
        };
        let mut body = vec![0; bytes];
        input.read_exact(&mut body).map_err(cut)?;
        return Ok(Held::Texts(texts(&body, length, is_big)));
    }
    let Some((size, number)) = number_of(letter) else { return Ok(Held::Other(shorten(kind))) };
    let count =
        budget.take(name, &shape).map_err(|OverBudget| "more numbers than the limit; write fewer rows")?;
    if count == 0 {
        return Ok(Held::Numbers(Array { name: name.to_owned(), shape: vec![0], values: Vec::new() }));
    }
    let values = numbers(input, count, size, is_big, number).map_err(cut)?;
    let (shape, values) = if is_fortran { turned(&shape, &values) } else { (shape, values) };
    Ok(Held::Numbers(Array { name: name.to_owned(), shape, values }))
}

/// The text of the header at the beginning of `input`.
fn header(input: &mut dyn Read) -> Option<String> {
    let mut start = [0; 8];
    input.read_exact(&mut start).ok()?;
    let [_, _, _, _, _, _, version, _] = start;
    let mut length = [0; 4];
    input.read_exact(if version == 1 { &mut length[..2] } else { &mut length }).ok()?;
    let length = u32::from_le_bytes(length) as usize;
    if !start.starts_with(b"\x93NUMPY") || length > MAX_TEXT {
        return None;
    }
    let mut header = vec![0; length];
    input.read_exact(&mut header).ok()?;
    String::from_utf8(header).ok()
}

/// The value of `key` in the literal of a Python dictionary of texts, booleans and tuples of numbers.
fn value_of<'h>(header: &'h str, key: &str) -> Option<&'h str> {
    let (_, behind) = header.split_once(&format!("'{key}':"))?;
    let behind = behind.trim_start();
    let end = match behind.as_bytes().first()? {
        b'(' => behind.find(')')? + 1,
        b'\'' => behind[1..].find('\'')? + 2,
        _ => behind.find([',', '}'])?,
    };
    Some(&behind[..end])
}

/// Bytes of a number of the type `letter`, and its decoder from eight little-endian bytes.
fn number_of(letter: &str) -> Option<(usize, Number)> {
    Some(match letter {
        "f8" => (8, f64::from_le_bytes),
        "f4" => (4, |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        "i8" | "m8[ns]" | "M8[ns]" | "M8[us]" | "M8[ms]" => (8, |b| i64::from_le_bytes(b) as f64),
        "u8" => (8, |b| u64::from_le_bytes(b) as f64),
        "i4" => (4, |b| f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        "u4" => (4, |b| f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        "i2" => (2, |b| f64::from(i16::from_le_bytes([b[0], b[1]]))),
        "u2" => (2, |b| f64::from(u16::from_le_bytes([b[0], b[1]]))),
        "i1" => (1, |b| f64::from(i8::from_le_bytes([b[0]]))),
        "u1" | "b1" => (1, |b| f64::from(b[0])),
        _ => return None,
    })
}

/// The texts of `length` UTF-32 characters each in `body`.
fn texts(body: &[u8], length: usize, is_big: bool) -> Vec<String> {
    let character = |cell: &[u8]| {
        let bytes = [cell[0], cell[1], cell[2], cell[3]];
        char::from_u32(if is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
            .filter(|c| *c != '\0')
    };
    let text = |cell: &[u8]| cell.chunks_exact(4).filter_map(character).collect();
    body.chunks_exact((4 * length).max(4)).map(text).collect()
}

/// Reorders an array whose first index varies fastest so that its last index does.
pub(crate) fn turned(shape: &[usize], values: &[f64]) -> (Vec<usize>, Vec<f64>) {
    let [rows, columns] = *shape else { return (shape.to_vec(), values.to_vec()) };
    let turned = (0..rows * columns).map(|k| values[(k % columns) * rows + k / columns]).collect();
    (shape.to_vec(), turned)
}
