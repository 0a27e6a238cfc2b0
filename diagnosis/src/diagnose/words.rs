//! Findings in plain words, with units.

use freeplay_laws::Kind as EffectKind;

use super::locate::Map;
use super::report::Parameter;

/// A number with three figures.
pub(crate) fn brief(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let size = value.abs();
    if !(1e-3..1e5).contains(&size) {
        return format!("{value:.2e}");
    }
    let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
    format!("{value:.decimals$}")
}

/// `value` in a unit for people: mm, mrad, ms.
pub(crate) fn with_unit(value: f64, unit: &str) -> String {
    let (scale, unit) = match unit {
        "m" if value.abs() < 0.1 => (1e3, "mm"),
        "rad" if value.abs() < 0.1 => (1e3, "mrad"),
        "s" if value.abs() < 0.1 => (1e3, "ms"),
        "1" => (1.0, ""),
        other => (1.0, other),
    };
    format!("{} {}", brief(value * scale), unit.replace('*', "·")).trim_end().to_owned()
}

/// A parameter with its interval, as people write it: `9.1 N·m (8.7 to 9.4)`.
pub(crate) fn parameter(name: &str, parameter: &Parameter) -> String {
    if let Some(vector) = parameter.value.as_array() {
        let numbers: Vec<String> = vector.iter().filter_map(|x| x.as_float()).map(brief).collect();
        return format!("{name} ({}) {}", numbers.join(", "), parameter.unit);
    }
    let Some(value) = parameter.value.as_float() else {
        return format!("{name} {}", parameter.value.to_string().trim_matches('"'));
    };
    match parameter.ci95 {
        Some([low, high]) => {
            let half = 0.5 * (high - low);
            format!("{name} {} ± {}", with_unit(value, &parameter.unit), with_unit(half, &parameter.unit))
        }
        None => format!("{name} {}", with_unit(value, &parameter.unit)),
    }
}

/// Where an effect sits. A name that says that it is a joint is not called one twice.
pub(crate) fn site(joint: Option<&str>) -> String {
    match joint {
        None => "of the whole arm".to_owned(),
        Some(joint) if joint.to_lowercase().contains("joint") => format!("of {joint}"),
        Some(joint) => format!("of joint {joint}"),
    }
}

/// One sentence on an effect.
pub(crate) fn statement<'p>(
    kind: &EffectKind,
    joint: Option<&str>,
    parameters: impl Iterator<Item = (&'p String, &'p Parameter)>,
) -> String {
    let values: Vec<String> = parameters.map(|(name, value)| parameter(name, value)).collect();
    format!(
        "{} {}, missing from the model: {}; {}",
        kind.title,
        site(joint),
        kind.equation,
        values.join(", ")
    )
}

/// Where in the motion a residual is, by its strongest map.
pub(crate) fn when(map: Option<&Map>) -> String {
    let Some(map) = map else { return "in no part of the motion more than in another".to_owned() };
    let percent = 100.0 * map.explained;
    if map.variable == "time" {
        let strongest =
            (0..map.mean.len()).max_by(|&a, &b| map.mean[a].abs().total_cmp(&map.mean[b].abs())).unwrap_or(0);
        return format!(
            "it changes with time (explains {percent:.0} %), strongest near t = {} s",
            brief(map.at[strongest])
        );
    }
    format!("it follows the {} (explains {percent:.0} %)", map.variable)
}
