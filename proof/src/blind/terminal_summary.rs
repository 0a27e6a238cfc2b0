//! The terminal output of a blind proof.

use std::fmt::Write as _;
use std::path::Path;

use freeplay_report::text::{Digits, number};

use super::confusion::Mistake;
use super::judged::Judged;
use super::leak::Leak;
use super::receipt::{Part, Receipt};
use super::score::Outcome;
use super::tally::{Bin, Goal, Score};
use super::truth::{Sort, at};
use freeplay_report::paste::shell_word;

/// Most failures listed in the terminal.
const FAILURES: usize = 12;
/// Most confusions listed in the terminal.
const CONFUSIONS: usize = 8;

/// The score.
pub fn summary(parts: &[Part], judged: &[Judged], score: &Score, path: &Path, report: &Path) -> String {
    let mut text = format!("\n{:24}", "");
    for outcome in Outcome::ALL {
        let _ = write!(text, "{:>9}", outcome.name());
    }
    text.push_str("       of\n");
    for sort in Sort::ALL {
        let counts = score.outcomes.get(sort.name());
        let of = |name: &str| counts.and_then(|counts| counts.get(name)).copied().unwrap_or(0);
        let _ = write!(text, "{:24}", sort.name());
        Outcome::ALL.iter().for_each(|outcome| {
            let _ = write!(text, "{:>9}", of(outcome.name()));
        });
        let _ = writeln!(text, "{:>9}", counts.map_or(0, |counts| counts.values().sum::<usize>()));
    }
    let _ = writeln!(text, "\n{:46} {:>8}  {:>8}  {:>17}  {:>5}", "", "goal", "reached", "95 %", "of");
    for goal in &score.goals {
        let _ = writeln!(text, "{}", line(goal));
    }
    let controls = &score.controls;
    let _ = writeln!(
        text,
        "\none effect right {:.0} %; answers of other cases {:.1} %, of their kind alone {:.1} %; an oracle that knows the concealed kind {:.0} %",
        100.0 * controls.right.value(),
        100.0 * controls.permuted,
        100.0 * controls.permuted_kind,
        100.0 * controls.oracle.value(),
    );
    for part in parts {
        if let Some(leak) = Leak::of(part, judged) {
            let _ = writeln!(
                text,
                "names, sizes and order of the files tell {:.0} % of the cases, chance {:.0} % (p = {:.2}){}",
                100.0 * leak.right,
                100.0 * leak.chance,
                leak.p,
                if leak.is_tight() { "" } else { ": A LEAK" }
            );
        }
        part.not_made.iter().take(FAILURES).for_each(|what| {
            let _ = writeln!(text, "not made: {what}");
        });
        if part.not_made.len() > FAILURES {
            let _ = writeln!(text, "not made: {} cases, see the report", part.not_made.len());
        }
    }
    let failures: Vec<&Judged> = judged.iter().filter(|case| is_failure(case)).collect();
    if failures.len() > FAILURES {
        text += &digest(score);
    }
    for case in failures.iter().take(FAILURES) {
        let _ = writeln!(text, "{} {}: {}", case.outcome.name(), case.name, story(case));
    }
    if failures.len() > FAILURES {
        let _ = writeln!(text, "and {} more, see the report", failures.len() - FAILURES);
    }
    let _ = writeln!(text, "report  {}", report.display());
    let _ = writeln!(text, "receipt {0}    verify: freeplay blind --verify {0}", shell_word(path));
    text
}

/// A digest of many failures: the commonest confusions, and success machine by machine.
fn digest(score: &Score) -> String {
    let mut mistakes: Vec<_> = score.mistakes.iter().collect();
    mistakes.sort_by_key(|mistake| std::cmp::Reverse(mistake.times));
    let words = |mistake: &&Mistake| format!("{} {} → {}", mistake.times, mistake.concealed, mistake.said);
    let commonest: Vec<String> = mistakes.iter().take(CONFUSIONS).map(words).collect();
    let mut text = format!("one effect, confused with another: {}\n", commonest.join("; "));
    for (machine, joints) in &score.by_joint {
        let sum = |of: fn(&Bin) -> usize| joints.values().map(of).sum::<usize>();
        let (right, detected, all) = (sum(|b| b.right.count), sum(|b| b.detected.count), sum(|b| b.right.of));
        let share = 100.0 * right as f64 / detected.max(1) as f64;
        let _ = writeln!(text, "{machine:24} {right} right of {detected} detected ({share:.0} %) of {all}");
    }
    text
}

fn line(goal: &Goal) -> String {
    if goal.met.is_none() {
        return format!("{:46} {:>8}  {:>8}", goal.quantity, goal.goal, "–");
    }
    let shown = |x: f64| number(x, Digits::Fixed(1));
    let [low, high] = goal.ci95.map(shown);
    let sign = if goal.met == Some(true) { "" } else { "  missed" };
    format!(
        "{:46} {:>8}  {:>6} {}  {:>17}  {:>5}{sign}",
        goal.quantity,
        goal.goal,
        shown(goal.reached),
        goal.unit,
        format!("{low} to {high}"),
        goal.of
    )
}

/// True if the terminal lists the case on its own.
pub fn is_failure(case: &Judged) -> bool {
    !matches!(case.outcome, Outcome::Right)
}

/// The concealed effects, the answer, and the hypotheses that misled the diagnosis.
pub fn story(case: &Judged) -> String {
    let strengths: Vec<String> = case
        .truth
        .effects
        .iter()
        .map(|e| format!("{:.1}× the floor in {}", e.signal_to_floor, e.channel))
        .collect();
    let strengths = if strengths.is_empty() { String::new() } else { format!(" ({})", strengths.join("; ")) };
    format!("{}{strengths}; answered: {}", case.truth.words(), said(case))
}

/// The answer, in a few words.
pub fn said(case: &Judged) -> String {
    let answer = &case.answer;
    let effects: Vec<String> = answer.effects.iter().map(|e| at(&e.kind, e.joint.as_deref())).collect();
    let rivals: Vec<String> = answer
        .rivals
        .iter()
        .filter(|rival| rival.indistinguishable)
        .map(|rival| at(&rival.kind, rival.joint.as_deref()))
        .collect();
    let named = if effects.is_empty() { String::new() } else { format!(" {}", effects.join(" + ")) };
    let rivals = if rivals.is_empty() { String::new() } else { format!(", or {}", rivals.join(", ")) };
    match answer.verdict.as_str() {
        "failed" => format!("nothing: {}", answer.statement),
        verdict => format!("{verdict}{named}{rivals}"),
    }
}

/// The answers for a folder with a truth that is unknown here.
pub fn answers(receipt: &Receipt, path: &Path) -> String {
    let mut text = String::new();
    for (name, record) in &receipt.cases {
        let effects: Vec<String> =
            record.answer.effects.iter().map(|e| at(&e.kind, e.joint.as_deref())).collect();
        let _ = writeln!(text, "{name:16} {:18} {}", record.answer.verdict, effects.join(" + "));
    }
    let _ = writeln!(text, "receipt {}    score: freeplay blind --score DIR TRUTH", path.display());
    text
}
