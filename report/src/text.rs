//! Formatting of numbers.
//!
//! Tables, tiles and the terminal use the same functions, so that a number looks the same everywhere. The minus sign is the ASCII one, so that numbers can be
//! pasted from a report into a spreadsheet.

/// Text for a missing number.
pub const MISSING_NUMBER: &str = "–";

/// Number of digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Digits {
    /// That many decimals.
    Fixed(usize),
    /// That many significant digits (at least one); integer digits are never dropped.
    Significant(usize),
}

/// Writes a number; NaN becomes [`MISSING_NUMBER`], infinity `∞`.
///
/// Powers of ten appear in `Significant` below 1e-4 and from 1e7 on, and in `Fixed` from 1e15 on.
///
/// ```
/// use freeplay_report::text::{Digits, number};
/// assert_eq!(number(0.59912, Digits::Fixed(3)), "0.599");
/// assert_eq!(number(0.00123456, Digits::Significant(3)), "0.00123");
/// assert_eq!(number(1267.8, Digits::Significant(3)), "1268");
/// ```
#[must_use]
pub fn number(value: f64, digits: Digits) -> String {
    if value.is_nan() {
        return MISSING_NUMBER.to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞".to_owned() } else { "-∞".to_owned() };
    }
    let written = match digits {
        Digits::Fixed(decimals) if value.abs() < 1e15 => format!("{value:.decimals$}"),
        Digits::Fixed(decimals) => format!("{value:.decimals$e}"),
        Digits::Significant(count) => significant(value, count.max(1)),
    };
    without_negative_zero(written)
}

/// Writes a number with the half width of its interval: `9.1 ± 0.3`.
///
/// The half width keeps one significant digit, two where it begins with a 1; the number ends at the same decimal. A
/// half width that is not a positive number is left out, and the number keeps three significant digits.
///
/// ```
/// use freeplay_report::text::uncertain;
/// assert_eq!(uncertain(9.08, 0.31), "9.1 ± 0.3");
/// assert_eq!(uncertain(1.6012, 0.124), "1.60 ± 0.12");
/// ```
#[must_use]
pub fn uncertain(value: f64, half_width: f64) -> String {
    if !(half_width.is_finite() && half_width > 0.0 && value.is_finite()) {
        return number(value, Digits::Significant(3));
    }
    let exponent = half_width.log10().floor();
    let kept = if half_width / 10f64.powf(exponent) < 1.95 { 1.0 } else { 0.0 };
    let decimals = (kept - exponent).clamp(0.0, 12.0) as usize;
    let written = |x| number(x, Digits::Fixed(decimals));
    format!("{} ± {}", written(value), written(half_width))
}

/// `value` with `count` significant digits; plain between 1e-4 and 1e7, with a power of ten outside.
fn significant(value: f64, count: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    // The exponent after rounding: 9.996 with three digits is 10.0.
    let rounded = format!("{value:.*e}", count - 1);
    let exponent: i32 = rounded.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0);
    if (-4..7).contains(&exponent) {
        let decimals = (count as i32 - 1 - exponent).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        rounded
    }
}

/// Removes the sign of `-0.00`, which carries no information.
fn without_negative_zero(written: String) -> String {
    let zero = written.starts_with('-') && !written.contains(|c: char| ('1'..='9').contains(&c));
    if zero { written[1..].to_owned() } else { written }
}

#[cfg(test)]
mod tests {
    use super::{Digits, number, uncertain};

    #[test]
    fn numbers_keep_the_digits_asked_for() {
        let cases = [
            (0.0, Digits::Significant(3), "0"),
            (9.996, Digits::Significant(3), "10.0"),
            (0.000_123_4, Digits::Significant(3), "0.000123"),
            (0.000_012_34, Digits::Significant(3), "1.23e-5"),
            (12_345_678.0, Digits::Significant(3), "1.23e7"),
            (-0.000_4, Digits::Fixed(3), "0.000"),
            (-0.6, Digits::Fixed(0), "-1"),
            (1e300, Digits::Fixed(2), "1.00e300"),
            (1.5, Digits::Significant(0), "2"),
            (f64::NAN, Digits::Fixed(1), "–"),
            (f64::INFINITY, Digits::Fixed(1), "∞"),
            (f64::NEG_INFINITY, Digits::Significant(2), "-∞"),
        ];
        for (value, digits, expected) in cases {
            assert_eq!(number(value, digits), expected, "{value} with {digits:?}");
        }
    }

    #[test]
    fn uncertainty_sets_the_decimals() {
        let cases = [
            (9.08, 0.31, "9.1 ± 0.3"),
            (1.6, 0.4, "1.6 ± 0.4"),
            (0.01234, 0.000_12, "0.01234 ± 0.00012"),
            (1234.5, 67.0, "1234 ± 67"),
            (2.0, 0.0, "2.00"),
            (2.0, f64::NAN, "2.00"),
            (f64::NAN, 1.0, "–"),
        ];
        for (value, half_width, expected) in cases {
            assert_eq!(uncertain(value, half_width), expected, "{value} ± {half_width}");
        }
    }
}
