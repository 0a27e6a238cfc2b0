//! The score of a study: right, wrong and refused answers.

use std::collections::BTreeMap;

use freeplay_diagnosis::{Diagnosis, Effect, Verdict};
use serde::Deserialize;
use serde_json::Value;

/// A missing effect.
#[derive(Clone, Debug, Deserialize)]
pub struct Truth {
    pub kind: String,
    pub joint: Option<String>,
    pub parameters: Value,
    #[serde(default)]
    pub weak: Vec<String>,
    #[serde(default)]
    pub catalogued: bool,
}

/// The answer of the diagnosis.
pub struct Answer {
    pub diagnosis: Result<Diagnosis, String>,
    pub seconds: f64,
}

/// The sums of a study.
#[derive(Default)]
pub struct Score {
    by_kind: BTreeMap<String, BTreeMap<&'static str, usize>>,
    errors: Vec<f64>,
    covered: [usize; 2],
    closed: Vec<f64>,
    seconds: Vec<f64>,
}

impl Score {
    /// Counts one case and prints its line.
    pub fn add(&mut self, name: &str, truth: &[Truth], answer: &Answer) {
        self.seconds.push(answer.seconds);
        let label = match truth {
            [] => "(nothing)".to_owned(),
            [one] if !one.catalogued => format!("(outside) {}", one.kind),
            [one] => one.kind.clone(),
            many => format!("({} at once)", many.len()),
        };
        let (outcome, said) = match &answer.diagnosis {
            Err(error) => ("failed", error.clone()),
            Ok(diagnosis) => (judged(truth, diagnosis), described(diagnosis)),
        };
        if let (Ok(diagnosis), "right", [one]) = (&answer.diagnosis, outcome, truth) {
            self.measure(one, diagnosis);
        }
        let missing: Vec<String> = truth.iter().map(|t| named(&t.kind, t.joint.as_deref())).collect();
        let above = answer.diagnosis.as_ref().ok().and_then(above_the_floor).unwrap_or_default();
        println!(
            "{name:10} {outcome:8} {:5.1} s  {} -> {said}  {above}",
            answer.seconds,
            missing.join(" + ")
        );
        *self.by_kind.entry(label).or_default().entry(outcome).or_default() += 1;
    }

    /// Adds parameter errors, interval coverage and the removed share of the error.
    fn measure(&mut self, truth: &Truth, diagnosis: &Diagnosis) {
        let Some(effect) = diagnosis.effects.iter().find(|effect| same(truth, effect)) else { return };
        for (name, parameter) in &effect.parameters {
            let (Some(value), Some(exact)) = (parameter.value.as_float(), truth.parameters[name].as_f64())
            else {
                continue;
            };
            if truth.weak.contains(name) || exact == 0.0 || name == "phase" {
                continue;
            }
            self.errors.push(((value - exact) / exact).abs());
            if let Some([low, high]) = parameter.ci95 {
                let covers = low <= exact && exact <= high;
                self.covered[usize::from(covers)] += 1;
                if !covers {
                    println!(
                        "           {} {name} {value:.4} ({low:.4} to {high:.4}) is {exact:.4}",
                        truth.kind
                    );
                }
            }
        }
        if let Some(fit) = &diagnosis.fit {
            for channel in &effect.evidence.channels {
                let of = |table: &BTreeMap<String, freeplay_diagnosis::Rmse>| table[channel].rmse;
                let (before, after, floor) = (of(&fit.before), of(&fit.after), of(&fit.noise_floor));
                if before > 1.05 * floor {
                    self.closed.push((before - after) / (before - floor));
                }
            }
        }
    }

    /// Prints the matrix.
    pub fn print(mut self) {
        let outcomes = ["right", "wrong", "extra", "refused", "missed", "failed"];
        println!("\n{:32} {}", "", outcomes.map(|outcome| format!("{outcome:>8}")).join(""));
        let mut sums = BTreeMap::<&str, usize>::new();
        for (kind, counts) in &self.by_kind {
            let count = |outcome: &str| counts.get(outcome).copied().unwrap_or(0);
            println!("{kind:32} {}", outcomes.map(|outcome| format!("{:8}", count(outcome))).join(""));
            counts.iter().for_each(|(outcome, count)| *sums.entry(outcome).or_default() += count);
        }
        println!(
            "{:32} {}",
            "all",
            outcomes.map(|o| format!("{:8}", sums.get(o).copied().unwrap_or(0))).join("")
        );
        let coverage = 100.0 * self.covered[1] as f64 / (self.covered[0] + self.covered[1]).max(1) as f64;
        println!(
            "parameter error, median {:.2} %; intervals cover {coverage:.0} % of {}; held-out error closed, median {:.1} %; \
             time, median {:.1} s, longest {:.1} s",
            100.0 * median(&mut self.errors),
            self.covered[0] + self.covered[1],
            100.0 * median(&mut self.closed),
            median(&mut self.seconds),
            self.seconds.iter().copied().fold(0.0, f64::max),
        );
    }
}

/// Largest held-out error of the tuned model over all channels, relative to the noise floor, without and with the named effects.
fn above_the_floor(diagnosis: &Diagnosis) -> Option<String> {
    let fit = diagnosis.fit.as_ref()?;
    let worst = |table: &BTreeMap<String, freeplay_diagnosis::Rmse>| {
        let ratios =
            table.iter().map(|(channel, left)| (left.rmse / fit.noise_floor[channel].rmse, channel.clone()));
        ratios.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, String::new()))
    };
    let (before, after) = (worst(&fit.retuned), worst(&fit.after));
    Some(format!("[{:.2} {} to {:.2} {} floors]", before.0, before.1, after.0, after.1))
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns true if the effect is the truth. The score ignores equivalences, such as that of `torque_offset` and the offset in `asymmetric_friction` while moving.
fn same(truth: &Truth, effect: &Effect) -> bool {
    truth.kind == effect.kind && (truth.joint == effect.joint || is_partner(truth, effect))
}

/// Returns true for a shaft between two joints, named at its other joint.
fn is_partner(truth: &Truth, effect: &Effect) -> bool {
    let with = effect.parameters.get("with").and_then(|with| with.value.as_str());
    with.is_some()
        && with == truth.joint.as_deref()
        && truth.parameters["with"].as_str() == effect.joint.as_deref()
}

/// Verdict on a case. right: all missing effects and no others; extra: all of them, and more; refused: a verdict without a name, or one of several effects with
/// the truth among them; missed: no finding; wrong: the rest.
fn judged(truth: &[Truth], diagnosis: &Diagnosis) -> &'static str {
    let unnamed = truth.iter().any(|truth| !truth.catalogued);
    match diagnosis.verdict {
        Verdict::NothingMissing if truth.is_empty() => "right",
        Verdict::NothingMissing | Verdict::InsufficientData => "missed",
        Verdict::Unknown if truth.is_empty() => "wrong",
        Verdict::Unknown if unnamed => "right",
        Verdict::Unknown => "refused",
        // None of these recordings has a set-up fault.
        Verdict::Setup => "wrong",
        Verdict::Named | Verdict::OneOf => {
            let found = truth.iter().filter(|truth| diagnosis.effects.iter().any(|e| same(truth, e))).count();
            let among = truth.iter().all(|truth| {
                diagnosis.effects.iter().any(|e| same(truth, e))
                    || diagnosis
                        .alternatives
                        .iter()
                        .any(|a| a.indistinguishable && a.kind == truth.kind && a.joint == truth.joint)
            });
            match (found == truth.len() && found > 0, diagnosis.effects.len() == truth.len()) {
                (true, true) if diagnosis.verdict == Verdict::Named => "right",
                (true, true) => "refused",
                (true, false) => "extra",
                (false, _) if among && diagnosis.verdict == Verdict::OneOf && !truth.is_empty() => "refused",
                (false, _) => "wrong",
            }
        }
    }
}

fn named(kind: &str, joint: Option<&str>) -> String {
    joint.map_or_else(|| kind.to_owned(), |joint| format!("{kind}@{joint}"))
}

fn described(diagnosis: &Diagnosis) -> String {
    let effects: Vec<String> = diagnosis
        .effects
        .iter()
        .map(|e| {
            let gain = e.evidence.held_out_gain.value;
            format!(
                "{} ({:.0}, {:.0} %)",
                named(e.kind, e.joint.as_deref()),
                e.evidence.log_odds,
                100.0 * gain
            )
        })
        .collect();
    let rivals: Vec<String> = diagnosis
        .alternatives
        .iter()
        .filter(|a| a.indistinguishable)
        .map(|a| named(a.kind, a.joint.as_deref()))
        .collect();
    format!(
        "{:?} {}{}",
        diagnosis.verdict,
        effects.join(" + "),
        if rivals.is_empty() { String::new() } else { format!(" | {}", rivals.join(", ")) }
    )
}
