//! What a person sees of a diagnosis in the terminal: the verdict, where, what, how much better, what else, and what to do next.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use clap::builder::styling::Style;
use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use freeplay_diagnosis::page::{channels, in_words, kind_title, reasons, title};
use freeplay_diagnosis::{Diagnosis, Fit, TO_TELL, Verdict};
use freeplay_recording::Recording;
use freeplay_report::text::{Digits, number};
use freeplay_report::units::{people, written};
use freeplay_terminal::messages::{GOOD, UNDECIDED, styled, width};

use crate::diagnose::{View, file_name};
use freeplay_report::paste::pasted;
use freeplay_terminal::outside::on_one_line;

/// Width of what stands before a line, characters.
pub const MARGIN: usize = 9;
/// Width of the longest bar, characters.
const BAR: f64 = 24.0;
/// Up to how many channels have a bar for every model.
const FEW: usize = 2;
/// Most lines of what the recording can't show, and of what else it could be.
const UNTESTABLE: usize = 3;
const RULED_OUT: usize = 4;
/// Most lines of what would tell one effect from another.
const SEPARATIONS: usize = 4;

/// The screen.
pub fn text(view: &View) -> String {
    let diagnosis = view.diagnosis;
    let mut text = String::new();
    for recording in view.recordings {
        let _ = writeln!(text, "{}", heading(recording));
    }
    for note in diagnosis.quality.iter().map(|note| format!("note: {note}")).chain(untestable(diagnosis)) {
        text.push_str(&wrapped("  ", 4, &note));
    }
    text.push_str(&crate::check::block(&diagnosis.setup, view.setup_file().as_deref()));
    let verdict = format!("\n{:MARGIN$}{}\n", "VERDICT", painted_verdict(diagnosis.verdict));
    text.push_str(&verdict);
    text.push_str(&wrapped("", MARGIN, &diagnosis.statement));
    text.push_str(&whereabouts(diagnosis));
    text.push_str(&findings(diagnosis));
    text.push_str(&alternatives(diagnosis));
    if let Some(fit) = &diagnosis.fit {
        text.push_str(&errors(fit, diagnosis));
    }
    text.push_str(&next(view));
    text
}

fn next(view: &View) -> String {
    let mut text = String::from("\n");
    let (pairs, motions): (Vec<&String>, Vec<&String>) =
        view.diagnosis.next.iter().partition(|next| next.starts_with(TO_TELL));
    let more = pairs.len().saturating_sub(SEPARATIONS);
    let more = (more > 0).then(|| format!("{more} more pairs of this kind are in the report"));
    let lines = pairs.into_iter().take(SEPARATIONS).chain(&more).chain(motions);
    for (index, next) in lines.enumerate() {
        text.push_str(&wrapped(if index == 0 { "NEXT" } else { "" }, MARGIN, next));
    }
    match view.out() {
        Some(out) => {
            if !view.diagnosis.ends_at_setup() {
                let (model, recording) = (pasted(&out.join("model.toml")), pasted(view.last_recording()));
                let _ = writeln!(text, "{:MARGIN$}{model}", "MODEL");
                let _ =
                    writeln!(text, "{:MARGIN$}freeplay compare --model {model} --recording {recording}", "");
                let _ = writeln!(text, "{:MARGIN$}freeplay run --model {model}", "");
            }
            let _ = writeln!(text, "{:MARGIN$}{}", "REPORT", pasted(&out.join("report.html")));
        }
        None if view.file().is_some() => {
            let _ = writeln!(text, "{:MARGIN$}{}", "FILE", view.file().map_or_else(String::new, pasted));
        }
        None => {
            let model = if view.diagnosis.ends_at_setup() { "" } else { ", the model with these effects" };
            let words = format!("add --out DIR for the report{model} and diagnosis.json");
            text.push_str(&wrapped("REPORT", MARGIN, &words));
        }
    }
    text
}

fn heading(recording: &Recording) -> String {
    let name = file_name(recording);
    let joints = recording.joints();
    let mut what = vec!["joint angles"];
    what.extend(recording.tau.is_some().then_some("torque"));
    what.extend(recording.tool.is_some().then_some("tool tracked"));
    what.extend(recording.q_link.iter().any(Option::is_some).then_some("link encoders"));
    format!(
        "Recording {name}: {joints} joint{}, {:.0} Hz, {:.1} s: {}.",
        if joints == 1 { "" } else { "s" },
        recording.rate_hz(),
        recording.duration(),
        what.join(", ")
    )
}

fn painted_verdict(verdict: Verdict) -> String {
    let (style, words) = match verdict {
        Verdict::NothingMissing => (GOOD, "nothing missing"),
        Verdict::Named => (GOOD, "named"),
        Verdict::OneOf => (UNDECIDED, "one of several"),
        Verdict::Unknown => (UNDECIDED, "unknown"),
        Verdict::InsufficientData => (UNDECIDED, "insufficient data"),
        Verdict::Setup => (UNDECIDED, "set-up"),
    };
    styled(style, words)
}

/// What can't be told, reasons shared by several kinds said once.
fn untestable(diagnosis: &Diagnosis) -> Vec<String> {
    let mut reasons = reasons(diagnosis);
    reasons.sort_by_key(|(_, titles)| std::cmp::Reverse(titles.len()));
    let more = reasons.len().saturating_sub(UNTESTABLE);
    let mut lines: Vec<String> = reasons
        .into_iter()
        .take(UNTESTABLE)
        .map(|(because, titles)| format!("not testable here: {} ({because})", titles.join(", ")))
        .collect();
    if more > 0 {
        lines.push(format!("and {more} more reasons in diagnosis.json"));
    }
    lines
}

fn whereabouts(diagnosis: &Diagnosis) -> String {
    let mut table = plain_table();
    for place in &diagnosis.location {
        let p = if place.p < 1e-3 { "p < 0.001".to_owned() } else { format!("p = {:.3}", place.p) };
        table.add_row(vec![
            place.joint.clone().unwrap_or_else(|| "whole arm".to_owned()),
            place.channels.join(", "),
            percent(place.share),
            format!("{} ({p})", place.when),
        ]);
    }
    under(
        "WHERE",
        "share of the error that the tuned model leaves, and the part of the motion where it occurs",
        table,
    )
}

/// What is missing, joint by joint in the order of the arm, and the law of each kind once.
fn findings(diagnosis: &Diagnosis) -> String {
    let mut table = plain_table();
    let (mut last, mut laws) = (None, BTreeMap::new());
    for effect in diagnosis.along_the_arm() {
        let joint = effect.joint.as_deref().unwrap_or("whole arm");
        let evidence = &effect.evidence;
        let [low, high] = evidence.held_out_gain.ci95.map(|share| 100.0 * share);
        table.add_row(vec![
            if last == Some(joint) { String::new() } else { joint.to_owned() },
            effect.phrase.clone(),
            format!("{} ({low:.0} to {high:.0})", percent(evidence.held_out_gain.value)),
            format!("{}{}", evidence.channels.join(", "), if evidence.held_out { "" } else { " *" }),
        ]);
        last = Some(joint);
        let law = format!("{} ({})", effect.equation, effect.source);
        laws.insert(kind_title(effect.kind), law);
    }
    let what =
        "missing from the model, ± at 95 %, and the share of the test error that it removes, by channel";
    let mut text = under("WHAT", what, table);
    if diagnosis.effects.iter().any(|effect| !effect.evidence.held_out) {
        text.push_str(&wrapped(
            "",
            MARGIN,
            "* share of the error in the fitted data: it acts too little in the test part to be tested",
        ));
    }
    for (index, (kind, law)) in laws.into_iter().enumerate() {
        text.push_str(if index == 0 { "\n" } else { "" });
        text.push_str(&wrapped(if index == 0 { "LAWS" } else { "" }, MARGIN, &format!("{kind}: {law}")));
    }
    text
}

/// What else it could be: what this motion leaves open, then the closest of what it rules out.
fn alternatives(diagnosis: &Diagnosis) -> String {
    let (open, ruled_out): (Vec<_>, Vec<_>) =
        diagnosis.alternatives.iter().partition(|other| other.indistinguishable);
    let mut table = plain_table();
    for other in open.into_iter().chain(ruled_out.into_iter().take(RULED_OUT)) {
        table.add_row(vec![
            in_words(&other.instead_of),
            title(other.kind, other.joint.as_deref()),
            other.why_not.clone(),
        ]);
    }
    under("OR ELSE", "other explanations of the same data", table)
}

/// The held-out errors for the channels in which something was found.
fn errors(fit: &Fit, diagnosis: &Diagnosis) -> String {
    let channels = channels(diagnosis);
    if channels.is_empty() {
        return String::new();
    }
    let mut text = format!("\n{:MARGIN$}root mean square error, test part: {}\n", "FIT", fit.test);
    text.push_str(&if channels.len() > FEW { one_line_each(fit, &channels) } else { bars(fit, &channels) });
    if let Some(gain) = fit.gain {
        let [low, high] = gain.ci95.map(|share| 100.0 * share);
        let words = format!(
            "{} (95 %: {low:.0} to {high:.0} %) of the error that the re-tuned model leaves is removed",
            percent(gain.value)
        );
        text.push_str(&wrapped("", MARGIN, &words));
    }
    text
}

/// Every model as a bar.
fn bars(fit: &Fit, channels: &[&str]) -> String {
    let mut text = String::new();
    for &channel in channels {
        let rows = [
            ("model as given", UNDECIDED, &fit.before),
            ("parameters re-tuned", Style::new(), &fit.retuned),
            ("with the effects found", GOOD, &fit.after),
            ("black box (splines)", Style::new(), &fit.black_box),
        ];
        let longest = rows.iter().map(|(_, _, table)| table[channel].rmse).fold(f64::MIN_POSITIVE, f64::max);
        let (scale, unit) = people(fit.units.get(channel).copied().unwrap_or(""), longest);
        let floor = written(fit.noise_floor[channel].rmse * scale);
        let _ = writeln!(text, "{:MARGIN$}{channel}, {unit}, noise floor {floor}", "");
        for (name, style, table) in rows {
            let rmse = table[channel].rmse;
            let bar = styled(style, "█".repeat((BAR * rmse / longest).round() as usize));
            let _ = writeln!(text, "{:MARGIN$}  {name:20}{:>9}  {bar}", "", written(rmse * scale));
        }
    }
    text
}

/// One line a channel.
fn one_line_each(fit: &Fit, channels: &[&str]) -> String {
    let mut table = plain_table();
    table.set_header(["", "as given", "re-tuned", "black box", "found", "floor", ""]);
    for &channel in channels {
        let all = [&fit.before, &fit.retuned, &fit.black_box, &fit.after, &fit.noise_floor];
        let all = all.map(|table| table[channel].rmse);
        let longest = all.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let (scale, unit) = people(fit.units.get(channel).copied().unwrap_or(""), longest);
        let mut row = vec![format!("{channel}, {unit}")];
        row.extend(all.map(|rmse| number(rmse * scale, Digits::Significant(3))));
        row.push("█".repeat((BAR * all[3] / longest).round() as usize));
        table.add_row(row);
    }
    indented(table, &[1, 2, 3, 4, 5])
}

/// A table without lines.
fn plain_table() -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width((width() - MARGIN) as u16);
    table
}

/// `table` under a heading; nothing for one without rows.
fn under(word: &str, heading: &str, table: Table) -> String {
    if table.is_empty() {
        String::new()
    } else {
        format!("\n{word:MARGIN$}{heading}\n{}", indented(table, &[2]))
    }
}

/// The lines of `table`, the columns `right` to the right.
fn indented(mut table: Table, right: &[usize]) -> String {
    for &column in right {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    textwrap::indent(&format!("{}\n", table.trim_fmt()), &" ".repeat(MARGIN))
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

/// `words` behind `word`, in lines of the screen's width, all but the first `margin` characters in.
pub fn wrapped(word: &str, margin: usize, words: &str) -> String {
    let (first, others) = (format!("{word:margin$}"), " ".repeat(margin));
    let options = textwrap::Options::new(width()).initial_indent(&first).subsequent_indent(&others);
    // Wrapping would take a name with a line break in it apart.
    textwrap::fill(&on_one_line(words), options) + "\n"
}
