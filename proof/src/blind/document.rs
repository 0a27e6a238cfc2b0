//! The report of a blind proof.

use freeplay_report::text::{Digits, number};
use freeplay_report::{Axis, Block, Cell, Chart, Column, Document, Figure, Section, Series, Table, Verdict};

use super::confidence_intervals::Share;
use super::judged::{Judged, of_sort};
use super::leak::Leak;
use super::matrix::{self, count};
use super::receipt::Part;
use super::score::Outcome;
use super::tally::{Bin, Goal, Score};
use super::terminal_summary::{is_failure, said};
use super::truth::Sort;
use super::verify::start;

/// Hypotheses that the report lists for a failure.
const LEADING: usize = 4;
/// Cases that a list of the report shows one by one. A browser takes half a minute to open a page with ten times as many.
const SHOWN: usize = 2000;

/// The whole report.
pub fn document(parts: &[Part], judged: &[Judged], score: &Score) -> Document {
    let cases = judged.len();
    let mut document = Document::new("Blind proof of the diagnosis")
        .subtitle(format!("{cases} sealed cases, each analysed once before its truth was revealed"))
        .overview(figures(score))
        .overview(goals(&score.goals))
        .section(outcomes(score))
        .section(matrix::confusion(score))
        .section(matrix::places(parts, judged, score))
        .section(success(score))
        .section(calibration(score))
        .section(controls(score))
        .section(improvement(judged))
        .section(failures(judged))
        .section(protocol(parts, judged));
    for part in parts {
        document = document.footer(format!("program {} · chain {}", part.program.sha256, last(part)));
    }
    document
}

fn last(part: &Part) -> &str {
    part.stages.last().map_or("", |stage| stage.chain.as_str())
}

fn percent(share: &Share) -> String {
    number(100.0 * share.value(), Digits::Fixed(1))
}

fn figures(score: &Score) -> Block {
    let tiles = score.goals.iter().filter(|goal| goal.met.is_some()).take(6).map(|goal| {
        let figure = Figure::new(goal.quantity, number(goal.reached, Digits::Fixed(1)), goal.unit);
        let verdict = if goal.met == Some(true) { Verdict::Ok } else { Verdict::Warn };
        figure.note(format!("goal {}, of {}", goal.goal, goal.of)).verdict(verdict)
    });
    Block::Figures(tiles.collect())
}

fn goals(goals: &[Goal]) -> Table {
    let table = Table::new("Goals and results")
        .column(Column::text("quantity").wrapping())
        .column(Column::text("goal"))
        .column(Column::number("reached", "").fixed(2))
        .column(Column::text("unit"))
        .column(Column::number("from", "").fixed(2).group("95 % interval"))
        .column(Column::number("to", "").fixed(2).group("95 % interval"))
        .column(Column::number("of", "").fixed(0))
        .column(Column::text(""));
    let table = goals.iter().fold(table, |table, goal| {
        let verdict = match goal.met {
            Some(true) => Cell::verdict_in_words(Verdict::Ok, "met"),
            Some(false) => Cell::verdict_in_words(Verdict::Warn, "missed"),
            None => Cell::from("–"),
        };
        let of = |x: f64| if goal.met.is_some() { Cell::from(x) } else { Cell::from("–") };
        table.row([
            goal.quantity.into(),
            goal.goal.into(),
            of(goal.reached),
            goal.unit.into(),
            of(goal.ci95[0]),
            of(goal.ci95[1]),
            count(goal.of),
            verdict,
        ])
    });
    table.note(
        "Intervals: Wilson for shares, exact where all or none are; order statistics for medians. Parameters of rightly named effects, without those \
         that leave next to no trace; gains and scales by their distance from one, angles that may be zero in rad. Processor time for a six-axis arm, \
         scaled from the two recordings of a case to 16 s of recording.",
    )
}

fn outcomes(score: &Score) -> Section {
    let mut table = Table::new("Outcomes").column(Column::text("concealed"));
    for outcome in Outcome::ALL {
        table = table.column(Column::number(outcome.name(), "").fixed(0));
    }
    for sort in Sort::ALL {
        let counts = score.outcomes.get(sort.name());
        let of = |outcome: &Outcome| count(counts.and_then(|c| c.get(outcome.name())).copied().unwrap_or(0));
        table = table.row(std::iter::once(Cell::from(sort.name())).chain(Outcome::ALL.iter().map(of)));
    }
    Section::new("Outcomes").with(table).with(Block::List(vec![
        "right: every concealed effect and no other one; \"nothing missing\" where nothing was concealed; \"unknown\" where the catalogue lacks the effect".into(),
        "partly: one of two effects and no invented one; extra: every concealed effect and an invented one".into(),
        "wrong: an invented effect; on a negative control: any finding".into(),
        "refused: \"something is missing\" without a name, or one of several with the truth among them".into(),
        "missed: \"nothing is missing\", or \"the recordings cannot tell\"; failed: a crash, or no answer in time".into(),
    ]))
}

fn success(score: &Score) -> Section {
    let table =
        score.by_severity.iter().fold(bins_table("Success by severity", "severity"), |table, (name, bin)| {
            table.row(bin_row(Cell::from(name.as_str()), bin))
        });
    let ratio = Axis::log("signal to floor", "");
    let chart = bins_chart("Success against the ratio of signal to floor", ratio, &score.by_strength);
    Section::new("Success against signal strength")
        .with("Signal to floor: root mean square of the trace of the effect, over that of noise and tolerances together, in the channel where this is largest.")
        .with(table)
        .with(chart)
}

fn bins_table(title: &str, first: &str) -> Table {
    Table::new(title)
        .column(Column::text(first))
        .column(Column::number("of", "").fixed(0))
        .column(Column::number("right", "%").fixed(1))
        .column(Column::number("from", "%").fixed(1).group("95 % interval"))
        .column(Column::number("to", "%").fixed(1).group("95 % interval"))
        .column(Column::number("detected", "%").fixed(1))
}

fn bin_row(first: Cell, bin: &Bin) -> [Cell; 6] {
    let [low, high] = bin.right.ci95.map(|x| 100.0 * x);
    let right = 100.0 * bin.right.value();
    [first, count(bin.right.of), right.into(), low.into(), high.into(), (100.0 * bin.detected.value()).into()]
}

fn bins_chart(title: &str, x: Axis, bins: &[Bin]) -> Chart {
    let at: Vec<f64> = bins.iter().map(|bin| bin.at).collect();
    let of = |value: &dyn Fn(&Bin) -> f64| bins.iter().map(|bin| 100.0 * value(bin)).collect::<Vec<f64>>();
    Chart::trace(title, x, Axis::new("share of cases", "%"))
        .series(Series::line("right", &at, &of(&|bin| bin.right.value())))
        .series(Series::line("95 %, lower", &at, &of(&|bin| bin.right.ci95[0])).like("right").dashed())
        .series(Series::line("95 %, upper", &at, &of(&|bin| bin.right.ci95[1])).like("right").dashed())
        .series(Series::line("detected", &at, &of(&|bin| bin.detected.value())))
        .in_view(0.0)
        .in_view(100.0)
}

fn calibration(score: &Score) -> Section {
    let table = score
        .calibration
        .iter()
        .fold(bins_table("Confidence and success", "mean confidence"), |table, bin| {
            table.row(bin_row(Cell::from(number(bin.at, Digits::Fixed(4))), bin))
        });
    let covered = score.goals.iter().find(|goal| goal.quantity.contains("intervals"));
    let words = covered.filter(|goal| goal.met.is_some()).map_or(String::new(), |goal| {
        let [low, high] = goal.ci95;
        format!(
            "Of {} intervals {:.1} % contain the truth (95 %: {low:.1} to {high:.1} %).",
            goal.of, goal.reached
        )
    });
    Section::new("Calibration")
        .with("Confidence: one over the sum of the odds of all alternatives to the one named effect, itself included. A calibrated confidence equals the share of right answers.")
        .with(table)
        .with(words)
}

fn controls(score: &Score) -> Section {
    let controls = &score.controls;
    let closed = |median: &Option<super::confidence_intervals::Median>| {
        median.map_or("–".to_owned(), |m| {
            format!("{:.0} % (95 %: {:.0} to {:.0} %)", m.value, m.ci95[0], m.ci95[1])
        })
    };
    let [low, high] = controls.oracle.ci95.map(|x| 100.0 * x);
    Section::new("Controls").with(Block::List(vec![
        format!("One effect, right: {} % of {}.", percent(&controls.right), controls.right.of),
        format!(
            "With permuted labels (every case with the answer of each other one), right: {:.2} % (kind and joint), {:.2} % (kind alone).",
            100.0 * controls.permuted,
            100.0 * controls.permuted_kind
        ),
        format!(
            "An oracle that knows the concealed kind and its joint finds it in {} % (95 %: {low:.1} to {high:.1} %): its evidence exceeds the threshold for a name.",
            percent(&controls.oracle)
        ),
        format!("Held-out error closed, median, by the name: {}.", closed(&controls.closed_by_name)),
        format!("By tuning within the tolerances, without a name: {}.", closed(&controls.closed_by_tuning)),
        format!("By an unnamed correction: {}.", closed(&controls.closed_by_black_box)),
    ]))
}

fn improvement(judged: &[Judged]) -> Section {
    let mut table = Table::new("Share of the held-out error that is removed, case by case")
        .column(Column::text("case"))
        .column(Column::text("concealed").wrapping())
        .column(Column::text("outcome"))
        .column(Column::number("by the name", "%").fixed(1))
        .column(Column::number("name and tuning", "%").fixed(1))
        .column(Column::number("tuning alone", "%").fixed(1))
        .column(Column::number("unnamed", "%").fixed(1));
    let named = || judged.iter().filter(|case| !case.answer.effects.is_empty());
    for case in named().take(SHOWN) {
        let of = |error: fn(&super::answer::Errors) -> f64| {
            Cell::from(case.closed(error).map_or(f64::NAN, |closed| 100.0 * closed))
        };
        table = table.row([
            case.name.as_str().into(),
            case.truth.words().into(),
            case.outcome.name().into(),
            of(|e| e.after),
            of(|e| e.after_tuned),
            of(|e| e.tuned),
            of(|e| e.black_box),
        ]);
    }
    let blocks = vec![rest(table, named().count()).into()];
    Section::new("Improvement, case by case")
        .with("(before − after) / (before − floor) on data that were not in the fit, mean over the channels in which the named effects show.")
        .with(Block::Details { summary: "All cases in which an effect was named".to_owned(), blocks })
}

/// `table` with a note on the number of cases, of `all`, that it omits.
fn rest(table: Table, all: usize) -> Table {
    match all.checked_sub(SHOWN) {
        None | Some(0) => table,
        Some(more) => table.note(format!("and {more} more: receipt.json holds them all.")),
    }
}

fn failures(judged: &[Judged]) -> Section {
    let mut section = Section::new("The failures, one by one");
    for sort in Sort::ALL {
        let some: Vec<&Judged> = of_sort(judged, sort).filter(|case| is_failure(case)).collect();
        if some.is_empty() {
            continue;
        }
        section = section.with(Block::Heading(format!("{}: {}", sort.name(), some.len())));
        for case in some.iter().take(SHOWN) {
            section = section.with(failure(case));
        }
        if some.len() > SHOWN {
            section = section.with(format!("and {} more: receipt.json holds them all.", some.len() - SHOWN));
        }
    }
    section
}

/// A failure with the hypotheses that misled the diagnosis: the ranks of the concealed effects among all hypotheses.
fn failure(case: &Judged) -> Block {
    let truth = &case.truth;
    let about = format!(
        "{}, {} joints, noise {}, {:.0} s, seed {}",
        truth.machine, truth.joints, truth.noise, truth.duration, truth.seed
    );
    let mut lines = vec![about];
    for concealed in &truth.effects {
        lines.push(format!(
            "{} {}: signal {:.2} × floor in {}; {}",
            concealed.kind,
            concealed.parameters,
            concealed.signal_to_floor,
            concealed.channel,
            rank(case, &concealed.kind, concealed.joint.as_deref())
        ));
    }
    let leading = case.answer.hypotheses.iter().take(LEADING).map(|row| {
        let place = row.joint.as_ref().map_or(String::new(), |joint| format!(" of {joint}"));
        format!("{}{place} {:.0} (named from {:.0})", row.kind, row.alone, row.threshold)
    });
    let leading: Vec<String> = leading.collect();
    if !leading.is_empty() {
        lines.push(format!("strongest on their own: {}", leading.join(", ")));
    }
    lines.push(format!("the answer in words: {}", case.answer.statement));
    let summary = format!("{} · {} · {} → {}", case.outcome.name(), case.name, truth.words(), said(case));
    Block::Details { summary, blocks: vec![Block::List(lines)] }
}

fn rank(case: &Judged, kind: &str, joint: Option<&str>) -> String {
    let rows = &case.answer.hypotheses;
    match rows.iter().position(|row| row.kind == kind && row.joint.as_deref() == joint) {
        Some(place) if rows[place].alone > rows[place].threshold => {
            format!("on its own it has rank {} with evidence {:.0}", place + 1, rows[place].alone)
        }
        Some(place) => format!("on its own it has evidence {:.0}, below the threshold", rows[place].alone),
        None => "the search did not consider it".to_owned(),
    }
}

fn protocol(parts: &[Part], judged: &[Judged]) -> Section {
    let mut section = Section::new("Protocol");
    for part in parts {
        let mut table = Table::new("Stages")
            .column(Column::text("stage"))
            .column(Column::text("completed"))
            .column(Column::text("SHA-256 of the stage"))
            .column(Column::text("chain"));
        for stage in &part.stages {
            table = table.row([
                stage.name.as_str().into(),
                stage.at.as_str().into(),
                start(&stage.brought).into(),
                start(&stage.chain).into(),
            ]);
        }
        let draw = part.draw.as_ref().map_or("sealed by someone else".to_owned(), |draw| {
            let [shard, shards] = draw.shard;
            format!("seed {} from {}, shard {shard} of {shards}", draw.seed, draw.seed_from)
        });
        let mut lines = vec![
            draw,
            format!("program {}, catalogue {}", part.program.sha256, part.program.catalogue),
            format!(
                "generated in {:.0} s, analysed in {:.0} s, on {}",
                part.seconds[0], part.seconds[1], part.machine
            ),
        ];
        lines.extend(part.isolation.iter().map(|(words, count)| format!("{count} analysts behind {words}")));
        lines.extend(part.not_made.iter().map(|what| format!("not made: {what}")));
        section = section.with(table).with(Block::List(lines));
        if let Some(leak) = Leak::of(part, judged) {
            let words = format!(
                "A classifier on names, sizes and order of the files finds the sort of {:.1} % of the cases; with shuffled sorts {:.1} %, and at least as many in {:.1} % of the shuffles.",
                100.0 * leak.right,
                100.0 * leak.chance,
                100.0 * leak.p
            );
            section =
                section.with(if leak.is_tight() { (Verdict::Ok, words) } else { (Verdict::Fail, words) });
        }
    }
    section
}
