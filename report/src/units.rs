//! Numbers in units for people: mm, mrad and ms instead of small SI numbers.

use crate::text::{Digits, number};

/// Factor and unit for displaying a value of about `size` in `unit`.
pub fn display_unit(unit: &str, size: f64) -> (f64, String) {
    let small = size.abs() < 0.1;
    match unit {
        "m" if size.abs() < 1e-4 => (1e6, "µm".to_owned()),
        "m" if small => (1e3, "mm".to_owned()),
        "rad" if small => (1e3, "mrad".to_owned()),
        "s" if small => (1e3, "ms".to_owned()),
        "1" => (1.0, String::new()),
        other => (1.0, other.replace("^2", "²").replace('*', "·")),
    }
}

/// A number with three significant digits.
pub fn written(value: f64) -> String {
    number(value, Digits::Significant(3))
}

/// Odds by their natural logarithm: `8`, `150`, `10¹³`.
pub fn power_of_ten(natural_log: f64) -> String {
    let exponent = natural_log / std::f64::consts::LN_10;
    if exponent < 4.0 {
        return format!("{:.0}", natural_log.exp());
    }
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let written = format!("{exponent:.0}");
    let digits = written.chars().filter_map(|digit| DIGITS.get(digit.to_digit(10)? as usize));
    format!("10{}", digits.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::{display_unit, power_of_ten};

    #[test]
    fn odds_are_short() {
        assert_eq!(power_of_ten(150_f64.ln()), "150");
        assert_eq!(power_of_ten(13.0 * std::f64::consts::LN_10), "10¹³");
    }

    #[test]
    fn small_numbers_are_read_in_small_units() {
        assert_eq!(display_unit("m", 0.0006), (1e3, "mm".to_owned()));
        assert_eq!(display_unit("m", 0.5), (1.0, "m".to_owned()));
        assert_eq!(display_unit("N*m*s/rad", 2.0), (1.0, "N·m·s/rad".to_owned()));
    }
}
