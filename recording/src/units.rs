//! Units in their usual spellings.

/// The unit of a column, by its quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unit {
    /// A time, in the spelling of a mapping.
    Time(&'static str),
    /// An angle or a length.
    Position(&'static str),
    /// A speed.
    Velocity(&'static str),
    /// A torque or a force.
    Torque(&'static str),
    /// A current, with its factor to amperes.
    Current(&'static str),
    /// A unit of no quantity of a recording.
    Other,
}

impl Unit {
    /// The unit with the spelling `text`.
    pub fn of(text: &str) -> Option<Self> {
        let text = text
            .trim()
            .replace(['µ', 'μ'], "u")
            .replace('°', "deg")
            .replace(['·', '⋅', '*', '.', ' ', '_'], "");
        Some(match text.as_str() {
            "s" | "sec" | "secs" | "second" | "seconds" => Self::Time("s"),
            "ms" | "msec" | "millisecond" | "milliseconds" => Self::Time("ms"),
            "us" | "usec" | "microsecond" | "microseconds" => Self::Time("us"),
            "ns" | "nsec" | "nanosec" | "nanosecond" | "nanoseconds" => Self::Time("ns"),
            "rad" | "rads" | "radian" | "radians" | "Rad" => Self::Position("rad"),
            "deg" | "degs" | "degree" | "degrees" | "Deg" | "Grad" => Self::Position("deg"),
            "m" | "meter" | "meters" | "metre" | "metres" => Self::Position("m"),
            "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Self::Position("mm"),
            "rad/s" | "rads-1" | "rads^-1" | "rad/sec" | "radps" => Self::Velocity("rad/s"),
            "deg/s" | "degs-1" | "degs^-1" | "deg/sec" | "degps" | "dps" | "degree/s" | "degrees/s" => {
                Self::Velocity("deg/s")
            }
            "rpm" | "RPM" | "1/min" | "U/min" | "min-1" | "r/min" | "rev/min" => Self::Velocity("rpm"),
            "m/s" | "ms-1" => Self::Velocity("m/s"),
            "mm/s" => Self::Velocity("mm/s"),
            "Nm" | "nm" | "N-m" | "NM" => Self::Torque("N*m"),
            "Nmm" | "N-mm" | "mNm" => Self::Torque("N*mm"),
            "N" => Self::Torque("N"),
            "A" | "amp" | "amps" | "ampere" | "amperes" | "Arms" => Self::Current("A"),
            "mA" => Self::Current("mA"),
            "V" | "mV" | "W" | "%" | "C" | "degC" | "K" | "m/s2" | "m/s^2" | "rad/s2" | "rad/s^2"
            | "deg/s2" | "deg/s^2" | "Hz" | "bool" | "1" => Self::Other,
            _ => return None,
        })
    }
}

/// A column's name without the unit in brackets at its end, and the text of that unit: `q1 [deg]`, `tau_1 (Nm)`.
pub(crate) fn without_unit(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        if let Some((stem, unit)) = name.strip_suffix(close).and_then(|rest| rest.rsplit_once(open))
            && !stem.trim().is_empty()
            && !unit.trim().is_empty()
            && unit.parse::<u64>().is_err()
        {
            return (stem.trim_end(), Some(unit));
        }
    }
    (name, None)
}
