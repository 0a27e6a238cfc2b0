//! Right or wrong: one answer against its truth.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::answer::{Answer, Estimate, Named, Rival};
use super::truth::{Concealed, Sort, Truth};

/// Result of comparing an answer with the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// All concealed effects and no others, or one of a set of equivalents; for physics outside the catalogue: unknown, or its own name.
    Right,
    /// At least one of several effects, and no false one.
    Partly,
    /// All concealed effects, and a false one.
    Extra,
    /// A false effect.
    Wrong,
    /// Something is missing, but without a name: unknown, or one of several with the truth among them.
    Refused,
    /// Nothing is missing, or the recordings can't tell.
    Missed,
    /// No answer: a crash, or too late.
    Failed,
}

impl Outcome {
    /// Every outcome.
    pub const ALL: [Outcome; 7] = [
        Outcome::Right,
        Outcome::Partly,
        Outcome::Extra,
        Outcome::Wrong,
        Outcome::Refused,
        Outcome::Missed,
        Outcome::Failed,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        ["right", "partly", "extra", "wrong", "refused", "missed", "failed"][self as usize]
    }
}

/// Compares `answer` with `truth`.
pub fn outcome(truth: &Truth, answer: &Answer) -> Outcome {
    let sort = truth.sort();
    match (answer.verdict.as_str(), sort) {
        ("nothing_missing", Sort::Negative) => Outcome::Right,
        ("insufficient_data", Sort::Negative) => Outcome::Refused,
        ("nothing_missing" | "insufficient_data", _) => Outcome::Missed,
        ("unknown" | "one_of" | "named", Sort::Negative) => Outcome::Wrong,
        ("unknown", Sort::Outside) => Outcome::Right,
        ("unknown", _) => Outcome::Refused,
        // Laws beyond the catalogue have names, too: only such a law can be the effect itself.
        ("named", Sort::Outside) if named(truth, answer) == Outcome::Right => Outcome::Right,
        ("one_of" | "named", Sort::Outside) => Outcome::Wrong,
        ("one_of", _) => one_of(truth, answer),
        ("named", _) => named(truth, answer),
        _ => Outcome::Failed,
    }
}

/// Number of concealed effects that the answer states, and number of named effects that state none of them.
fn said(truth: &Truth, effects: &[Named]) -> (usize, usize) {
    let by: Vec<Vec<usize>> = truth.effects.iter().map(|concealed| concealed.stated_by(effects)).collect();
    let found = by.iter().filter(|by| !by.is_empty()).count();
    let unmatched = (0..effects.len()).filter(|index| by.iter().all(|by| !by.contains(index))).count();
    (found, unmatched)
}

fn named(truth: &Truth, answer: &Answer) -> Outcome {
    let (found, unmatched) = said(truth, &answer.effects);
    match (found == truth.effects.len(), unmatched) {
        (true, 0) => Outcome::Right,
        (true, _) => Outcome::Extra,
        (false, 0) if found > 0 => Outcome::Partly,
        _ => Outcome::Wrong,
    }
}

/// Scores an answer "one of several": right if each alternative is the truth by another name, refused if the truth is among them, partly right if that holds
/// for a part of it.
fn one_of(truth: &Truth, answer: &Answer) -> Outcome {
    let is_true = |rival: &Rival| {
        let named = Named { kind: rival.kind.clone(), joint: rival.joint.clone(), ..Named::default() };
        said(truth, &[named]).1 == 0
    };
    let mut class = answer.rivals.iter().filter(|rival| rival.indistinguishable).peekable();
    if class.peek().is_some() && class.all(is_true) && named(truth, answer) == Outcome::Right {
        return Outcome::Right;
    }
    let among = truth.effects.iter().filter(|concealed| concealed.is_among(answer)).count();
    let (found, unmatched) = said(truth, &answer.effects);
    match (among == truth.effects.len(), answer.effects.len() <= truth.effects.len()) {
        (true, true) => Outcome::Refused,
        (false, true) if found > 0 && unmatched == 0 => Outcome::Partly,
        (false, true) if among > 0 && among >= answer.effects.len() => Outcome::Refused,
        _ => Outcome::Wrong,
    }
}

/// The error of one estimated parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterScore {
    /// `kind.parameter`.
    pub name: String,
    /// The truth: a number, or the length of a vector.
    pub truth: f64,
    /// Relative error; of angles that may be zero, the error in rad.
    pub error: f64,
    /// True if the 95 % interval contains the truth; `None` without an interval.
    pub covered: Option<bool>,
}

/// Scores the parameters of the effect that names `concealed` itself; parameters with hardly any trace are left out.
pub fn parameter_scores(concealed: &Concealed, answer: &Answer) -> Vec<ParameterScore> {
    let same = |effect: &&Named| concealed.is(&effect.kind, effect.joint.as_deref());
    let Some(effect) = answer.effects.iter().find(same) else { return Vec::new() };
    let strong = effect.parameters.iter().filter(|(name, _)| !concealed.weak.contains(name));
    strong
        .filter_map(|(name, estimate)| {
            let hit = parameter_score(name, &concealed.parameters[name], estimate)?;
            Some(ParameterScore { name: format!("{}.{name}", concealed.kind), ..hit })
        })
        .collect()
}

/// `None` if the truth does not have the parameter or it is a word.
fn parameter_score(name: &str, truth: &Value, estimate: &Estimate) -> Option<ParameterScore> {
    let vector =
        |value: &Value| value.as_array().map(|v| v.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
    if let (Some(truth), Some(found)) = (vector(truth), vector(&estimate.value)) {
        let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let apart: Vec<f64> = truth.iter().zip(&found).map(|(a, b)| a - b).collect();
        let size = length(&truth);
        let error = length(&apart) / size;
        return (size > 0.0).then(|| ParameterScore {
            name: String::new(),
            truth: size,
            error,
            covered: None,
        });
    }
    let (truth, found) = (truth.as_f64()?, estimate.value.as_f64()?);
    // A factor of one is no effect; its distance from one is the effect.
    let neutral = if matches!(name, "gain" | "scale") { 1.0 } else { 0.0 };
    let turn = std::f64::consts::TAU;
    let off = if name == "phase" {
        (found - truth + 0.5 * turn).rem_euclid(turn) - 0.5 * turn
    } else {
        found - truth
    };
    let size =
        if matches!(name, "phase" | "rest" | "roll" | "pitch") { 1.0 } else { (truth - neutral).abs() };
    // Uses `off`, so that a phase may differ by whole turns.
    let inside = |[low, high]: [f64; 2]| (low..=high).contains(&(found - off));
    (size > 0.0).then(|| ParameterScore {
        name: String::new(),
        truth,
        error: off.abs() / size,
        covered: estimate.ci95.map(inside),
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::answer::{Answer, Estimate, Named, Rival};
    use super::super::truth::Truth;
    use super::{Outcome, outcome, parameter_scores};

    fn truth(effects: serde_json::Value) -> Truth {
        serde_json::from_value(json!({ "effects": effects })).expect("a truth")
    }

    fn named(verdict: &str, effects: &[(&str, &str)]) -> Answer {
        let effects = effects
            .iter()
            .map(|(kind, joint)| Named {
                kind: (*kind).into(),
                joint: Some((*joint).into()),
                ..Named::default()
            })
            .collect();
        Answer { verdict: verdict.into(), effects, ..Answer::default() }
    }

    #[test]
    fn answers_are_judged_as_they_say() {
        let nothing = truth(json!([]));
        let one = truth(json!([{ "kind": "backlash", "joint": "elbow" }]));
        let outside = truth(json!([{ "kind": "sloshing_load", "joint": null, "catalogued": false }]));
        let dropped = truth(json!([{
            "kind": "load_drop", "joint": null, "catalogued": false,
            "equivalents": [{ "kinds": ["load_change"], "joint": null }]
        }]));
        let mut lost = named("named", &[]);
        lost.effects.push(Named { kind: "load_change".into(), ..Named::default() });
        let mut more = named("named", &[("joint_spring", "elbow")]);
        more.effects.extend(lost.effects.clone());
        let backlash = ("backlash", "elbow");
        let spring = ("joint_spring", "elbow");
        for (truth, answer, expected) in [
            (&nothing, named("nothing_missing", &[]), Outcome::Right),
            (&nothing, named("unknown", &[]), Outcome::Wrong),
            (&nothing, named("insufficient_data", &[]), Outcome::Refused),
            (&one, named("named", &[backlash]), Outcome::Right),
            (&one, named("named", &[("backlash", "wrist")]), Outcome::Wrong),
            (&one, named("named", &[backlash, spring]), Outcome::Extra),
            (&one, named("one_of", &[backlash]), Outcome::Refused),
            (&one, named("one_of", &[spring]), Outcome::Wrong),
            (&one, named("unknown", &[]), Outcome::Refused),
            (&one, named("nothing_missing", &[]), Outcome::Missed),
            (&one, Answer::failed("crash".into()), Outcome::Failed),
            (&outside, named("unknown", &[]), Outcome::Right),
            (&outside, named("named", &[spring]), Outcome::Wrong),
            (&outside, named("nothing_missing", &[]), Outcome::Missed),
            (&outside, lost.clone(), Outcome::Wrong),
            (&dropped, named("unknown", &[]), Outcome::Right),
            (&dropped, lost, Outcome::Right),
            (&dropped, more, Outcome::Wrong),
        ] {
            assert_eq!(outcome(truth, &answer), expected, "{truth:?} {answer:?}");
        }
    }

    #[test]
    fn two_effects_may_be_half_right() {
        let two = truth(json!([
            { "kind": "backlash", "joint": "elbow" }, { "kind": "payload", "joint": null }
        ]));
        assert_eq!(outcome(&two, &named("named", &[("backlash", "elbow")])), Outcome::Partly);
        assert_eq!(
            outcome(&two, &named("named", &[("backlash", "elbow"), ("joint_spring", "wrist")])),
            Outcome::Wrong
        );
        let mut both = named("named", &[("backlash", "elbow")]);
        both.effects.push(Named { kind: "payload".into(), ..Named::default() });
        assert_eq!(outcome(&two, &both), Outcome::Right);
    }

    /// An equivalent of two kinds counts if both are named; an indistinguishable rival is not a wrong name.
    #[test]
    fn equivalents_and_rivals_count() {
        let asymmetric = truth(json!([{
            "kind": "asymmetric_friction", "joint": "elbow",
            "equivalents": [{ "kinds": ["coulomb_friction", "torque_offset"], "joint": "elbow" }]
        }]));
        let (coulomb, offset) = (("coulomb_friction", "elbow"), ("torque_offset", "elbow"));
        assert_eq!(outcome(&asymmetric, &named("named", &[coulomb, offset])), Outcome::Right);
        assert_eq!(outcome(&asymmetric, &named("named", &[coulomb])), Outcome::Wrong);
        let mut unsure = named("one_of", &[coulomb]);
        let kind = "asymmetric_friction".to_owned();
        unsure.rivals =
            vec![Rival { kind, joint: Some("elbow".into()), indistinguishable: true, log_odds_against: 1.0 }];
        assert_eq!(outcome(&asymmetric, &unsure), Outcome::Refused);
        // If each of the alternatives is the truth by another name, leaving them undecided is right.
        let constant = truth(json!([{
            "kind": "torque_offset", "joint": "elbow",
            "equivalents": [{ "kinds": ["asymmetric_friction"], "joint": "elbow" }]
        }]));
        unsure.effects = named("one_of", &[offset]).effects;
        assert_eq!(outcome(&constant, &unsure), Outcome::Right);
        unsure.rivals[0].kind = "coulomb_friction".to_owned();
        assert_eq!(outcome(&constant, &unsure), Outcome::Refused);
    }

    /// A gain is scored by its distance from one, a phase modulo a turn, a word not at all.
    #[test]
    fn parameters_are_compared_in_their_own_measure() {
        let one = truth(json!([{
            "kind": "torque_ripple", "joint": "elbow",
            "parameters": { "phase": 0.1, "gain": 1.2, "amplitude": 2.0, "word": "tool" }
        }]));
        let mut answer = named("named", &[("torque_ripple", "elbow")]);
        let mut put = |name: &str, value, ci95| {
            answer.effects[0].parameters.insert(name.into(), Estimate { value, ci95 });
        };
        put("phase", json!(0.1 + std::f64::consts::TAU - 0.02), Some([6.3, 6.5]));
        put("gain", json!(1.1), Some([1.05, 1.15]));
        put("amplitude", json!(2.2), None);
        put("word", json!("tool"), None);
        let hits = parameter_scores(&one.effects[0], &answer);
        let of = |name: &str| hits.iter().find(|hit| hit.name.ends_with(name)).expect("a hit");
        println!("{hits:?}");
        assert_eq!(hits.len(), 3);
        assert!((of("phase").error - 0.02).abs() < 1e-9 && of("phase").covered == Some(true));
        assert!((of("gain").error - 0.5).abs() < 1e-9 && of("gain").covered == Some(false));
        assert!((of("amplitude").error - 0.1).abs() < 1e-9 && of("amplitude").covered.is_none());
    }
}
