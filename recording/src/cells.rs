//! Content of a cell of a text file: a number, a time stamp, a list, nothing, or text.

/// Spellings of a missing number, in lower case.
const NOTHING: [&str; 13] =
    ["", "nan", "+nan", "-nan", "na", "n/a", "<na>", "#n/a", "null", "none", "nat", "1.#qnan", "-1.#ind"];

/// Content of a cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cell {
    /// A number; NaN for a missing one.
    Number(f64),
    /// A time stamp, ns: since 1970, or since midnight if the cell has no date.
    TimeStamp(i128),
    /// Numbers in brackets.
    List(Vec<f64>),
    /// Words in brackets.
    Words(Vec<String>),
    /// Anything else.
    Text,
}

/// The content of `cell`, with the decimal sign `decimal`.
pub(crate) fn cell(cell: &[u8], decimal: u8) -> Cell {
    if let Some(value) = number(cell, decimal) {
        return Cell::Number(value);
    }
    let Ok(text) = std::str::from_utf8(cell) else { return Cell::Text };
    let text = unquote(text);
    if is_nothing(text) {
        return Cell::Number(f64::NAN);
    }
    if let Some(ns) = time_stamp(text) {
        return Cell::TimeStamp(ns);
    }
    list(text).unwrap_or(Cell::Text)
}

/// True for a spelling of a missing value.
pub(crate) fn is_nothing(text: &str) -> bool {
    let text = text.trim();
    text.len() <= 8 && NOTHING.contains(&text.to_ascii_lowercase().as_str())
}

/// The number in a cell, which may have spaces around it and quotes around that.
pub(crate) fn number(cell: &[u8], decimal: u8) -> Option<f64> {
    let text = std::str::from_utf8(cell.trim_ascii()).ok()?;
    let parse = |text: &str| -> Option<f64> {
        if decimal == b'.' {
            return text.parse().ok();
        }
        text.replace(char::from(decimal), ".").parse().ok()
    };
    parse(text).or_else(|| parse(unquote(text)))
}

/// A cell without the spaces around it, nor quotes that the CSV parser left because of them.
pub(crate) fn unquote(cell: &str) -> &str {
    let cell = cell.trim_start_matches('\u{feff}').trim();
    let quoted = |mark: char| cell.strip_prefix(mark).and_then(|c| c.strip_suffix(mark));
    quoted('"').or_else(|| quoted('\'')).unwrap_or(cell).trim()
}

/// The list in brackets, `[0.1, 0.2]`, `(1 2 3)` or `['a', 'b']`.
fn list(text: &str) -> Option<Cell> {
    let inner = text.strip_prefix("array(").and_then(|inner| inner.strip_suffix(')')).unwrap_or(text);
    let brackets = [('[', ']'), ('(', ')'), ('{', '}')];
    let inner = brackets.iter().find_map(|(open, close)| inner.strip_prefix(*open)?.strip_suffix(*close))?;
    let parts = inner.split(|c: char| matches!(c, ',' | ';') || c.is_whitespace());
    let parts: Vec<&str> = parts.map(|part| unquote(plain(part))).filter(|part| !part.is_empty()).collect();
    let numbers: Option<Vec<f64>> =
        parts.iter().map(|part| part.parse().ok().or_else(|| is_nothing(part).then_some(f64::NAN))).collect();
    Some(numbers.map_or_else(|| Cell::Words(parts.iter().map(ToString::to_string).collect()), Cell::List))
}

/// A number without its wrapping, as NumPy 2 writes it in a list: `np.float64(0.5)`.
fn plain(part: &str) -> &str {
    let inner = part.strip_prefix("np.").and_then(|rest| rest.split_once('(')).map(|(_, inner)| inner);
    inner.and_then(|inner| inner.strip_suffix(')')).unwrap_or(part)
}

/// A time in ISO 8601 or a similar form: `2026-01-31T12:30:00.25+01:00`, `2026-01-31 12:30:00`, `12:30:00.25`; ns.
fn time_stamp(text: &str) -> Option<i128> {
    let (day, clock) = match text.split_once(['T', ' ']) {
        Some((day, clock)) => (days(day)?, clock),
        None => (0, text),
    };
    let zoned = clock.trim_end_matches('Z').trim_end_matches(" UTC");
    let (clock, offset_s) = match zoned.rfind(['+', '-']) {
        Some(at) => {
            (&zoned[..at], seconds(&zoned[at + 1..], 2)? * if zoned[at..].starts_with('-') { -1 } else { 1 })
        }
        None => (zoned, 0),
    };
    let (whole, fraction) = clock.split_once(['.', ',']).unwrap_or((clock, ""));
    if fraction.len() > 18 || !fraction.bytes().all(|digit| digit.is_ascii_digit()) {
        return None;
    }
    let nanos: i128 = format!("{fraction:0<9}")[..9].parse().ok()?;
    Some((i128::from(day) * 86_400 + i128::from(seconds(whole, 3)? - offset_s)) * 1_000_000_000 + nanos)
}

/// Seconds of `12:30:05` or, with fewer `parts`, of `12:30` and `1230`.
fn seconds(text: &str, parts: usize) -> Option<i64> {
    let joined = text.is_ascii() && text.len() == 4 && parts == 2 && !text.contains(':');
    let fields: Vec<&str> = if joined { vec![&text[..2], &text[2..]] } else { text.split(':').collect() };
    let digits = |field: &&str| (1..=2).contains(&field.len()) && field.bytes().all(|c| c.is_ascii_digit());
    if fields.len() > 3
        || fields.len() < parts.min(2)
        || (parts == 3 && fields.len() < 2)
        || !fields.iter().all(digits)
    {
        return None;
    }
    let mut factor = 3600;
    let mut sum = 0;
    for field in fields {
        sum += factor * field.parse::<i64>().ok()?;
        factor /= 60;
    }
    Some(sum)
}

/// Days since 1970 of `2026-01-31` or `2026/01/31`.
///
/// Source: Howard Hinnant, "chrono-Compatible Low-Level Date Algorithms", `days_from_civil`.
fn days(text: &str) -> Option<i64> {
    let mut fields = text.splitn(3, ['-', '/']).map(|field| field.parse::<i64>().ok());
    let (year, month, day) = (fields.next()??, fields.next()??, fields.next()??);
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) || !(0..=9999).contains(&year) {
        return None;
    }
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year - era * 400;
    let day_of_year = (153 * (month + if month > 2 { -3 } else { 9 }) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    Some(era * 146_097 + day_of_era - 719_468)
}

#[cfg(test)]
mod tests {
    use super::{Cell, cell, time_stamp};

    #[test]
    fn time_stamps_of_every_spelling_are_the_same() {
        let expected = time_stamp("2024-11-20T10:00:00.25Z").expect("a time stamp");
        assert_eq!(expected, 1_732_096_800_250_000_000, "date -d 2024-11-20T10:00Z +%s");
        for text in [
            "2024-11-20 10:00:00.250",
            "2024-11-20T11:00:00,25+01:00",
            "2024/11/20 05:00:00.25-0500",
            "2024-11-20 10:00:00.250000+00:00",
        ] {
            assert_eq!(time_stamp(text), Some(expected), "{text}");
        }
        assert_eq!(
            time_stamp("10:00:00.5").zip(time_stamp("10:00")),
            Some((36_000_500_000_000, 36_000_000_000_000))
        );
        for text in ["2024-13-20 10:00:00", "10", "10:00:00:00", "a:b", "2024-11-20", "1:2:3.x", "", "-1"] {
            assert_eq!(time_stamp(text), None, "{text}");
        }
    }

    #[test]
    fn cells_are_told_apart() {
        let of = |text: &str| cell(text.as_bytes(), b'.');
        assert_eq!(of("[0.1, -2 3e-1]"), Cell::List(vec![0.1, -2.0, 0.3]));
        assert_eq!(of("[np.float64(0.5), np.float64(-1.0)]"), Cell::List(vec![0.5, -1.0]));
        assert_eq!(of("['a_1', 'b']"), Cell::Words(vec!["a_1".into(), "b".into()]));
        assert!(
            ["", "NaN", " n/a ", "NULL", "\"\""]
                .iter()
                .all(|text| matches!(of(text), Cell::Number(x) if x.is_nan()))
        );
        assert_eq!((of("0,5"), cell(b"0,5", b',')), (Cell::Text, Cell::Number(0.5)));
        assert_eq!(of("oops"), Cell::Text);
    }
}
