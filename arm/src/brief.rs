//! Numbers in sentences, for readers, not for programs.

/// `value` with at most four significant digits, without zeros at its end.
pub fn brief(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if rounded == 0.0 {
        // A zero has no sign in a sentence.
        "0".to_owned()
    } else if rounded.is_finite() && !(1e-4..1e7).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::brief;

    #[test]
    fn sentences_have_short_numbers() {
        let cases = [
            (0.1 + 0.2, "0.3"),
            (1.0 / 3.0, "0.3333"),
            (-std::f64::consts::FRAC_PI_2, "-1.571"),
            (123_456.0, "123500"),
            (2.5e-7, "2.5e-7"),
            (-0.0, "0"),
            (f64::INFINITY, "inf"),
        ];
        for (value, written) in cases {
            assert_eq!(brief(value), written);
        }
    }
}
