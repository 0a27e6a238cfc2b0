//! Confused kinds, their places, and the known reasons.

use std::collections::BTreeMap;

use serde::Serialize;

use super::answer::{Answer, Hypothesis};
use super::confidence_intervals::Median;
use super::controls::oracle;
use super::judged::Judged;
use super::score::Outcome;
use super::truth::at;

/// Counts of stated kinds, by concealed kind.
pub type Confusion = BTreeMap<String, BTreeMap<String, usize>>;

/// One confusion of a concealed effect with another answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mistake {
    /// The concealed kind.
    pub concealed: String,
    /// The answer instead: kinds, `one of` some, `unknown`, `nothing`.
    pub said: String,
    /// Number of cases.
    pub times: usize,
    /// Number of cases by severity: slight, clear, strong.
    pub severities: [usize; 3],
    /// Median of the signal-to-floor ratios.
    pub signal_to_floor: f64,
    /// Number of cases in which the concealed kind at its joint exceeds the required score.
    pub counts: usize,
    /// Number of cases in which it has the highest score of all kinds at all places.
    pub leads: usize,
    /// Number of cases whose answer contains its name but also others, or an open choice.
    pub held: usize,
    /// The commonest other kind with the highest score.
    pub leading: Option<String>,
    /// Machines and joints with their number of cases, the commonest first.
    pub places: Vec<(String, usize)>,
}

/// The matrix of `singles`, cases with one effect each.
pub fn matrix(singles: &[&Judged]) -> Confusion {
    let mut table = Confusion::new();
    for case in singles {
        let row = table.entry(case.truth.effects[0].kind.clone()).or_default();
        *row.entry(column(case)).or_default() += 1;
    }
    table
}

/// The column of the matrix: the named kind, with further or alternative answers in brackets.
fn column(case: &Judged) -> String {
    let concealed = &case.truth.effects[0];
    let other = case.answer.effects.iter().find(|effect| effect.kind != concealed.kind);
    match (case.outcome, case.answer.verdict.as_str(), other) {
        (Outcome::Right, ..) => concealed.kind.clone(),
        (Outcome::Missed, ..) => "(nothing)".to_owned(),
        (Outcome::Failed, ..) => "(failed)".to_owned(),
        (Outcome::Extra, ..) => "(and more)".to_owned(),
        (_, "unknown", _) => "(unknown)".to_owned(),
        (_, "one_of", _) if concealed.is_among(&case.answer) => "(one of, with it)".to_owned(),
        (_, "one_of", _) => "(one of others)".to_owned(),
        (_, _, Some(other)) => other.kind.clone(),
        (_, _, None) => "(other joint)".to_owned(),
    }
}

/// The confusions by kind, the commonest first.
pub fn mistakes(singles: &[&Judged]) -> Vec<Mistake> {
    let mut groups: BTreeMap<(&str, String), Vec<&Judged>> = BTreeMap::new();
    for case in singles.iter().copied().filter(|case| case.outcome != Outcome::Right) {
        groups.entry((&case.truth.effects[0].kind, said(case))).or_default().push(case);
    }
    let mut all: Vec<Mistake> =
        groups.into_iter().map(|((kind, said), cases)| Mistake::of(kind, said, &cases)).collect();
    all.sort_by(|a, b| a.concealed.cmp(&b.concealed).then(b.times.cmp(&a.times)));
    all
}

/// The answer, as kinds alone.
fn said(case: &Judged) -> String {
    let concealed = &case.truth.effects[0];
    let named = |answer: &Answer| answer.effects.iter().map(|e| e.kind.clone()).collect::<Vec<_>>();
    match (case.outcome, case.answer.verdict.as_str()) {
        (Outcome::Missed, _) => "nothing".to_owned(),
        (Outcome::Failed, _) => "no answer".to_owned(),
        (_, "unknown") => "unknown".to_owned(),
        (_, "one_of") => {
            let rivals = case.answer.rivals.iter().filter(|rival| rival.indistinguishable);
            let mut class = named(&case.answer);
            class.extend(rivals.map(|rival| rival.kind.clone()));
            class.sort_unstable();
            class.dedup();
            // Alternatives of one kind differ only in the joint.
            let joints = if class.len() == 1 { ", of several joints" } else { "" };
            let without = if concealed.is_among(&case.answer) { "" } else { ", all of them wrong" };
            format!("one of {}{joints}{without}", class.join(", "))
        }
        _ if case.answer.effects.iter().all(|effect| effect.kind == concealed.kind) => {
            "another joint".to_owned()
        }
        _ => named(&case.answer).join(" + "),
    }
}

impl Mistake {
    fn of(kind: &str, said: String, cases: &[&Judged]) -> Self {
        let truth = |case: &&&Judged| case.truth.effects[0].clone();
        let at_severity =
            |severity| cases.iter().filter(|case| case.truth.effects[0].severity == severity).count();
        let ratios = cases.iter().map(|case| case.truth.effects[0].signal_to_floor).collect();
        let leads = |case: &&&Judged| first(case).is_some_and(|row| truth(case).names(row));
        let others = cases.iter().filter(|case| !leads(case)).filter_map(|case| first(case));
        let leading = counted(others.map(|row| row.kind.clone())).into_iter().next();
        Self {
            concealed: kind.to_owned(),
            said,
            times: cases.len(),
            severities: ["slight", "clear", "strong"].map(at_severity),
            signal_to_floor: Median::new(ratios).map_or(f64::NAN, |median| median.value),
            counts: cases.iter().filter(|case| oracle(case)).count(),
            leads: cases.iter().filter(leads).count(),
            held: cases.iter().filter(|case| truth(case).is_among(&case.answer)).count(),
            leading: leading.map(|(kind, _)| kind),
            places: counted(cases.iter().map(|case| {
                let joint = truth(&case).joint;
                joint
                    .map_or_else(|| case.truth.machine.clone(), |joint| at(&joint, Some(&case.truth.machine)))
            })),
        }
    }

    /// The known reasons, in words: first from the recordings, then from the catalogue's entries of the two kinds.
    pub fn why(&self) -> String {
        let times = self.times;
        let mut words = format!("the concealed effect exceeds the threshold in {} of {times}", self.counts);
        words += &match &self.leading {
            None => ", and is the strongest of all kinds".to_owned(),
            Some(leading) => {
                format!(", and is the strongest in {}; in the others it is mostly {leading}", self.leads)
            }
        };
        if self.said == "unknown" && self.held > 0 {
            words += &format!(", is among the guesses in {}, but the residual exceeds the noise", self.held);
        }
        // The kind that it was confused with, or, for an answer without a name, the kind with the higher score.
        let by_name =
            self.said.split([' ', ',']).find_map(|word| Some((word, separates(&self.concealed, word)?)));
        let by_lead =
            || self.leading.as_deref().and_then(|kind| Some((kind, separates(&self.concealed, kind)?)));
        if let Some((_, how)) = by_name.or_else(by_lead) {
            words += &format!("; {how}");
        }
        words
    }
}

/// The catalogue's remark on distinguishing two similar kinds.
fn separates(a: &str, b: &str) -> Option<String> {
    let of = |a: &str, b: &str| {
        let like = freeplay_laws::kind(a)?.confounders.iter().find(|(kind, _)| *kind == b)?;
        Some(format!("{} {}", like.0, like.1))
    };
    of(a, b).or_else(|| of(b, a))
}

/// The hypothesis with the highest score on its own.
fn first(case: &Judged) -> Option<&Hypothesis> {
    case.answer.hypotheses.iter().max_by(|a, b| a.alone.total_cmp(&b.alone))
}

/// The distinct `words` with their counts, the commonest first.
fn counted(words: impl Iterator<Item = String>) -> Vec<(String, usize)> {
    let mut counts = BTreeMap::new();
    words.for_each(|word| *counts.entry(word).or_insert(0) += 1);
    let mut counts: Vec<(String, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counts
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::answer::{Answer, Hypothesis, Named, Rival};
    use super::super::judged::Judged;
    use super::super::tally::Score;
    use super::{matrix, mistakes};

    /// A case with a backlash of the elbow of 3 floors, answered with `verdict` and those kinds and joints.
    fn case(verdict: &str, effects: &[(&str, &str)], rivals: &[&str]) -> Judged {
        let truth = json!({ "machine": "arm", "effects": [
            { "kind": "backlash", "joint": "elbow", "severity": "clear", "signal_to_floor": 3.0 }
        ] });
        let joint = |joint: &str| Some(joint.to_owned());
        let named = effects.iter().map(|(kind, at)| Named {
            kind: (*kind).to_owned(),
            joint: joint(at),
            ..Named::default()
        });
        let rivals = rivals.iter().map(|kind| Rival {
            kind: (*kind).to_owned(),
            joint: joint("elbow"),
            indistinguishable: true,
            log_odds_against: 1.0,
        });
        let row = |kind: &str, alone| Hypothesis {
            kind: kind.to_owned(),
            joint: joint("elbow"),
            alone,
            beside: 0.0,
            threshold: 10.0,
        };
        let answer = Answer {
            verdict: verdict.to_owned(),
            effects: named.collect(),
            rivals: rivals.collect(),
            hypotheses: vec![row("joint_elasticity", 30.0), row("backlash", 20.0)],
            ..Answer::default()
        };
        Judged::new("case", serde_json::from_value(truth).expect("a truth"), answer)
    }

    #[test]
    fn the_matrix_counts_what_was_said() {
        let (backlash, elasticity) = (("backlash", "elbow"), ("joint_elasticity", "elbow"));
        let cases = [
            case("named", &[backlash], &[]),
            case("named", &[elasticity], &[]),
            case("named", &[elasticity], &[]),
            case("named", &[("backlash", "wrist")], &[]),
            case("named", &[backlash, ("payload", "wrist")], &[]),
            case("one_of", &[elasticity], &["backlash"]),
            case("one_of", &[elasticity], &["payload"]),
            case("unknown", &[], &[]),
            case("nothing_missing", &[], &[]),
            case("insufficient_data", &[], &[]),
            case("failed", &[], &[]),
        ];
        let singles: Vec<&Judged> = cases.iter().collect();
        let expected = json!({ "backlash": {
            "backlash": 1, "joint_elasticity": 2, "(other joint)": 1, "(and more)": 1, "(one of, with it)": 1,
            "(one of others)": 1, "(unknown)": 1, "(nothing)": 2, "(failed)": 1
        } });
        assert_eq!(json!(matrix(&singles)), expected);
        let mistakes = mistakes(&singles);
        let said: Vec<(&str, usize)> = mistakes.iter().map(|m| (m.said.as_str(), m.times)).collect();
        println!("{said:?}");
        assert_eq!(said.iter().map(|(_, times)| times).sum::<usize>(), 10, "all but the right one");
        for wanted in [("joint_elasticity", 2), ("nothing", 2), ("one of backlash, joint_elasticity", 1)] {
            assert!(said.contains(&wanted), "{wanted:?}");
        }
        assert_eq!(mistakes[0].places, [("elbow of arm".to_owned(), 2)]);
        let taken = mistakes.iter().find(|m| m.said == "joint_elasticity").expect("a mistake");
        println!("{}", taken.why());
        assert_eq!((taken.severities, taken.counts, taken.leads), ([0, 2, 0], 2, 0));
        assert_eq!(taken.leading.as_deref(), Some("joint_elasticity"));
        assert!(taken.why().contains("2 of 2"));
    }

    /// Success by machine and joint counts the cases with that machine and joint.
    #[test]
    fn joints_are_counted_by_machine() {
        let cases = [case("named", &[("backlash", "elbow")], &[]), case("unknown", &[], &[])];
        let bin = &Score::of(&cases).by_joint["arm"]["elbow"];
        assert_eq!((bin.right.count, bin.right.of, bin.detected.count), (1, 2, 2));
    }
}
