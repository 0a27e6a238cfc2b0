//! Findings in plain words, with units.

use std::collections::BTreeMap;

use freeplay_arm::Arm;
use freeplay_laws::{Kind as EffectKind, kind};
use freeplay_model::EffectTable;
use toml::Value;

use crate::report::diagnosis::{Alternative, Diagnosis, Effect, Map, Parameter, Verdict};
use crate::search::tried::LISTED;
use crate::statistics::STRONG;

/// First words of a sentence on the measurement that would separate two effects.
pub const TO_TELL: &str = "to distinguish";

/// The odds of a finding in words, from their natural logarithm (Kass & Raftery 1995, J. Am. Stat. Assoc. 90:773).
pub(crate) fn odds(log_odds: f64) -> &'static str {
    match log_odds {
        x if x < STRONG => "possible",
        // "Very strong" (Kass & Raftery).
        x if x < 150.0_f64.ln() => "probable",
        _ => "almost certain",
    }
}

/// Reason why an alternative is not named, from the natural logarithm of the odds against it.
pub(crate) fn odds_against(log_odds: f64) -> String {
    /// Largest odds in digits: readers take a number with five digits for certainty.
    const MANY: f64 = 1e4;
    if log_odds < 0.0 {
        return "it explains this motion as well".to_owned();
    }
    match log_odds.exp() {
        odds if odds > MANY => "fitted in this place, it leaves far more of the error".to_owned(),
        odds => format!("fitted in this place, it has odds of {odds:.0} to 1 against it"),
    }
}

/// A number with three significant digits.
fn brief(value: f64) -> String {
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

/// Factor and name of the usual unit for a `value` in `unit`: mm, mrad, ms.
fn unit_for(value: f64, unit: &str) -> (f64, String) {
    match unit {
        "m" if value.abs() < 0.1 => (1e3, " mm".to_owned()),
        "rad" if value.abs() < 0.1 => (1e3, " mrad".to_owned()),
        "s" if value.abs() < 0.1 => (1e3, " ms".to_owned()),
        "1" | "" => (1.0, String::new()),
        "1/rev" => (1.0, " times a turn".to_owned()),
        "1/m" => (1.0, " times a metre".to_owned()),
        other => (1.0, format!(" {}", other.replace('*', "·").replace("^2", "²"))),
    }
}

/// `value ± half`: the half-width with two significant digits, the value to the same decimal.
fn uncertain(value: f64, half: f64) -> String {
    if !(half > 0.0 && half.is_finite()) {
        return brief(value);
    }
    if !(1e-4..1e6).contains(&half) {
        return format!("{value:.2e} ± {half:.1e}");
    }
    let place = half.log10().floor() as i32 - 1;
    let (step, decimals) = (10f64.powi(place.max(0)), (-place).max(0) as usize);
    let written = |x: f64| {
        if place > 0 { format!("{:.0}", (x / step).round() * step) } else { format!("{x:.decimals$}") }
    };
    format!("{} ± {}", written(value), written(half))
}

/// The value of a parameter as people write it: `9.1 ± 0.3 N·m`.
fn value(parameter: &Parameter) -> String {
    if let Some(vector) = parameter.value.as_array() {
        let numbers: Vec<f64> = vector.iter().filter_map(toml::Value::as_float).collect();
        let most = numbers.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let (scale, unit) = unit_for(most, &parameter.unit);
        let numbers: Vec<String> = numbers.into_iter().map(|x| brief(x * scale)).collect();
        return format!("({}){unit}", numbers.join(", "));
    }
    let Some(value) = parameter.value.as_float() else {
        return parameter.value.to_string().trim_matches('"').to_owned();
    };
    let (scale, unit) = unit_for(value, &parameter.unit);
    match parameter.ci95 {
        Some(_) if parameter.is_least() => format!("at least {}{unit}", brief(value * scale)),
        Some([low, high]) => format!("{}{unit}", uncertain(value * scale, 0.5 * (high - low) * scale)),
        None => format!("{}{unit}", brief(value * scale)),
    }
}

/// The missing effect with its parameters: `Coulomb friction of 9.1 ± 0.3 N·m`. Identified parameters that the kind's own text lacks follow.
pub(crate) fn phrase(kind: &EffectKind, parameters: &BTreeMap<String, Parameter>) -> String {
    let (mut words, mut further) = (without_optional(kind.words, parameters), Vec::new());
    for (name, parameter) in parameters {
        let place = format!("{{{name}}}");
        if words.contains(&place) {
            words = words.replace(&place, &value(parameter));
        } else if parameter.ci95.is_some() {
            further.push(format!("{} {}", name.replace('_', " "), value(parameter)));
        }
    }
    if !further.is_empty() {
        words = format!("{words} ({})", further.join(", "));
    }
    if is_less(kind, parameters) {
        format!("{words} (negative: the machine has less than the model)")
    } else {
        words
    }
}

/// `words` with the bracketed parts whose parameter is in `parameters`.
fn without_optional(words: &str, parameters: &BTreeMap<String, Parameter>) -> String {
    let Some((before, (optional, after))) =
        words.split_once('[').and_then(|(before, rest)| Some((before, rest.split_once(']')?)))
    else {
        return words.to_owned();
    };
    let is_known = parameters.keys().any(|name| optional.contains(&format!("{{{name}}}")));
    format!("{before}{}{after}", if is_known { optional } else { "" })
}

/// Returns true if the effect reduces the model's own: all its additional parameters are negative.
fn is_less(kind: &EffectKind, parameters: &BTreeMap<String, Parameter>) -> bool {
    let is_extra =
        |name: &String| kind.parameter(name).is_some_and(|parameter| parameter.meaning.contains("extra to"));
    let mut extra = parameters.iter().filter(|(name, _)| is_extra(name)).peekable();
    extra.peek().is_some() && extra.all(|(_, parameter)| parameter.value.as_float().is_some_and(|x| x < 0.0))
}

/// The location of an effect: `joint_1`, `joint elbow`. A name that starts with "joint" does not get the word twice.
fn called(joint: &str) -> String {
    if joint.to_lowercase().contains("joint") { joint.to_owned() } else { format!("joint {joint}") }
}

/// The location after a kind.
pub(crate) fn site(joint: Option<&str>) -> String {
    joint.map_or_else(|| "of the whole arm".to_owned(), |joint| format!("of {}", called(joint)))
}

/// The location after a missing effect; empty for the whole arm.
fn on(joint: Option<&str>) -> String {
    joint.map_or_else(String::new, |joint| format!(" on {}", called(joint)))
}

/// `words` as a list: `a, b and c`.
fn listed(words: &[String]) -> String {
    match words {
        [all @ .., last] if !all.is_empty() => format!("{} and {last}", all.join(", ")),
        _ => words.join(""),
    }
}

/// One sentence on the effect in `phrase`.
pub(crate) fn statement(phrase: &str, joint: Option<&str>) -> String {
    format!("The model leaves out {phrase}{}.", on(joint))
}

/// One sentence: the model has the effect as `given`, and the sum of that and the finding on `arm`.
pub(crate) fn with_given(given: &EffectTable, both: &EffectTable, arm: &Arm) -> String {
    let in_words = |table: &EffectTable| {
        let kind = kind(&table.kind)?;
        let joint = table.joint.as_ref().and_then(|name| arm.joint_index(name)).map(|at| &arm.joints()[at]);
        let parameter = |(name, value): (&String, &Value)| {
            let unit = kind.unit(name, joint).to_owned();
            (name.clone(), Parameter { value: value.clone(), unit, ci95: None })
        };
        Some(phrase(kind, &table.parameters.iter().map(parameter).collect()))
    };
    match (in_words(given), in_words(both)) {
        (Some(given), Some(both)) => format!(" The model already has {given}; the sum is {both}."),
        _ => String::new(),
    }
}

/// One sentence on all effects: with their parameters if they are few, otherwise by kind and location.
pub(crate) fn left_out(effects: &[&Effect]) -> String {
    let known = |effect: &Effect| kind(effect.kind).map_or(effect.kind, |kind| kind.title).to_owned();
    if effects.len() <= LISTED {
        let with_numbers = |effect: &Effect| format!("{}{}", effect.phrase, on(effect.joint.as_deref()));
        let all: Vec<String> = effects.iter().copied().map(with_numbers).collect();
        return format!("The model leaves out {}.", listed(&all));
    }
    let mut kinds: Vec<(String, Vec<String>)> = Vec::new();
    for effect in effects {
        let (title, joint) = (known(effect), effect.joint.as_deref().map(called));
        match kinds.iter_mut().find(|(known, _)| *known == title) {
            Some((_, joints)) => joints.extend(joint),
            None => kinds.push((title, joint.into_iter().collect())),
        }
    }
    let words = |(title, joints): (String, Vec<String>)| {
        if joints.is_empty() { title } else { format!("{title} on {}", listed(&joints)) }
    };
    let all: Vec<String> = kinds.into_iter().map(words).collect();
    format!("The model leaves out {} effects: {}.", effects.len(), all.join("; "))
}

/// Kind and location of the effect that `other` could replace, and those of `other`, with the location if it differs.
fn pair(other: &Alternative) -> [String; 2] {
    let titled = |name: &str| kind(name).map_or(name, |kind| kind.title).to_owned();
    let (instead, place) = other.instead_of.split_once(' ').unwrap_or((&other.instead_of, ""));
    let here = site(other.joint.as_deref());
    let other = titled(other.kind);
    // Many kinds contain an "of": "coupling of two joints at joint_3".
    let at = |place: &str| match place.strip_prefix("of ") {
        Some(joint) if joint != "the whole arm" => format!(" at {joint}"),
        _ => format!(" {place}"),
    };
    let there = if place == here { String::new() } else { at(&here) };
    [titled(instead) + &at(place), other + &there]
}

/// The alternatives that this motion does not separate, in one sentence; empty if there are none.
pub(crate) fn open(alternatives: &[Alternative]) -> String {
    let open = alternatives.iter().filter(|other| other.indistinguishable).map(pair);
    let pairs: Vec<String> = open.map(|[named, other]| format!("{named} from {other}")).collect();
    match pairs.len() {
        0 => String::new(),
        1..LISTED => format!(" This motion cannot distinguish {}.", pairs.join(", or ")),
        many => format!(" Other laws explain {many} of these as well on this motion."),
    }
}

/// The measurement that would separate `other` from the effect that it could replace.
pub(crate) fn to_tell(other: &Alternative) -> String {
    let [named, rival] = pair(other);
    format!("{TO_TELL} {named} from {rival}: {}", other.what_would_separate)
}

/// The part of the motion with the residual, from its strongest map.
pub(crate) fn when(map: Option<&Map>) -> String {
    let Some(map) = map else { return "equally in all parts of the motion".to_owned() };
    let percent = 100.0 * map.explained;
    if map.variable == "time" {
        let strongest =
            (0..map.mean.len()).max_by(|&a, &b| map.mean[a].abs().total_cmp(&map.mean[b].abs())).unwrap_or(0);
        return format!(
            "the residual changes with time (explains {percent:.0} %), strongest near t = {} s",
            brief(map.at[strongest])
        );
    }
    format!("the residual follows the {} (explains {percent:.0} %)", map.variable)
}

/// Puts the verdict into words.
pub(crate) fn put_into_words(diagnosis: &mut Diagnosis) {
    let left_out = left_out(&diagnosis.along_the_arm());
    diagnosis.statement = match diagnosis.verdict {
        Verdict::NothingMissing => {
            "The recording agrees with the model within its tolerances. The model lacks no effect that this motion could show.".to_owned()
        }
        Verdict::Named => left_out,
        Verdict::OneOf => left_out + &open(&diagnosis.alternatives),
        Verdict::Unknown => unknown(&diagnosis.along_the_arm()),
        Verdict::InsufficientData | Verdict::Setup => diagnosis.statement.clone(),
    };
    if diagnosis.verdict == Verdict::OneOf {
        let undecided = diagnosis.alternatives.iter().filter(|a| a.indistinguishable);
        diagnosis.next = undecided.map(to_tell).collect();
        diagnosis.next.dedup();
    }
}

/// The statement for an unnamed effect: the fact, its appearance, and the named effects.
fn unknown(effects: &[&Effect]) -> String {
    let (named, nameless): (Vec<&Effect>, Vec<&Effect>) =
        effects.iter().copied().partition(|effect| is_catalogued(effect));
    let mut words =
        "The model lacks an effect that no law of the catalogue describes well enough.".to_owned();
    for like in nameless {
        words.push_str(&format!(" The closest description: {}", like.statement));
    }
    if !named.is_empty() {
        words.push_str(&format!(" The catalogue describes a part of it. {}", left_out(&named)));
    }
    words
}

/// Returns true if the catalogue has the kind of `effect`.
fn is_catalogued(effect: &Effect) -> bool {
    kind(effect.kind).is_some_and(EffectKind::is_catalogued)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::{on, phrase, uncertain};
    use crate::report::diagnosis::Parameter;

    fn parameters(all: &[(&str, f64, &str, f64)]) -> BTreeMap<String, Parameter> {
        let of = |&(name, value, unit, half): &(&str, f64, &str, f64)| {
            let ci95 = Some([value - half, value + half]);
            (name.to_owned(), Parameter { value: value.into(), unit: unit.to_owned(), ci95 })
        };
        all.iter().map(of).collect()
    }

    #[test]
    fn a_number_ends_where_its_half_width_does() {
        let cases = [
            (376.2, 75.9, "376 ± 76"),
            (1941.3, 315.0, "1940 ± 320"),
            (3.052, 0.62, "3.05 ± 0.62"),
            (0.0042, 0.0001, "0.00420 ± 0.00010"),
            (5.6e8, 2.0e7, "5.60e8 ± 2.0e7"),
            (-12.0, 0.0, "-12.0"),
        ];
        for (value, half, words) in cases {
            assert_eq!(uncertain(value, half), words);
        }
    }

    #[test]
    fn findings_read_as_sentences() {
        let kind = |name: &str| freeplay_laws::kind(name).expect("a kind");
        let gap = [("gap", 0.00418, "m", 9e-5), ("friction", 13_230.0, "N", 170.0)];
        assert_eq!(
            phrase(kind("backlash"), &parameters(&gap)),
            "a gap of 4.180 ± 0.090 mm in the gear (friction 13230 ± 170 N)"
        );
        let mut heavier = parameters(&[("scale", 0.8, "1", 0.02)]);
        assert_eq!(phrase(kind("link_mass"), &heavier), "a link 0.800 ± 0.020 times as heavy");
        let shift = Parameter { value: vec![0.04, -0.06, 0.05].into(), unit: "m".into(), ci95: None };
        heavier.insert("com_shift".to_owned(), shift);
        assert_eq!(
            phrase(kind("link_mass"), &heavier),
            "a link 0.800 ± 0.020 times as heavy, its centre of mass off by (40.0, -60.0, 50.0) mm"
        );
        assert_eq!(
            phrase(kind("viscous_friction"), &parameters(&[("viscous", -0.88, "N*m*s/rad", 0.08)])),
            "viscous friction of -0.880 ± 0.080 N·m·s/rad (negative: the machine has less than the model)"
        );
        assert_eq!(
            (on(Some("elbow")), on(Some("joint_1"))),
            (" on joint elbow".into(), " on joint_1".into())
        );
    }
}
