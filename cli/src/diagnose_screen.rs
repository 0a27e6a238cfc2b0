//! The terminal output of a diagnosis: the verdict, the places, the missing physics, the improvement, the alternatives, and the next step.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use clap::builder::styling::Style;
use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use freeplay_diagnosis::page::{MODELS, channels, in_words, kind_title, meanings, reasons, title};
use freeplay_diagnosis::{Diagnosis, Fit, TO_TELL, Verdict};
use freeplay_recording::Recording;
use freeplay_report::text::{Digits, number};
use freeplay_report::units::{display_unit, written};
use freeplay_terminal::flags::is_quiet;
use freeplay_terminal::messages::width;
use freeplay_terminal::styles::{GOOD, UNDECIDED, styled};

use crate::diagnose_view::{View, file_name};
use crate::margin::{MARGIN, wrapped};
use freeplay_report::paste::shell_word;

/// Width of the longest bar, characters.
const BAR: f64 = 24.0;
/// Largest number of channels for which every model has a bar.
const FEW: usize = 2;
/// Most lines on undetectable effects.
const UNTESTABLE: usize = 3;
/// Most lines on distinguishing one effect from another.
const SEPARATIONS: usize = 4;

/// The text of the screen.
pub fn text(view: &View) -> String {
    let diagnosis = view.diagnosis;
    let mut text = String::new();
    for recording in view.recordings {
        let _ = writeln!(text, "{}", heading(recording));
    }
    for note in diagnosis.quality.iter().map(|note| format!("note: {note}")).chain(untestable(diagnosis)) {
        text.push_str(&wrapped("  ", 4, &note));
    }
    text.push_str(&crate::check::block(&diagnosis.setup, &view.again()));
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
            if view.diagnosis.changes_model() {
                let model = out.join("model.toml");
                let _ = writeln!(text, "{:MARGIN$}{}", "MODEL", shell_word(&model));
                let commands = view.commands(&model).into_iter().filter(|_| !is_quiet());
                commands.for_each(|command| text.push_str(&format!("{:MARGIN$}{command}\n", "")));
            }
            let _ = writeln!(text, "{:MARGIN$}{}", "REPORT", shell_word(&out.join("report.html")));
        }
        None if view.file().is_some() => {
            let file = view.file().filter(|file| file.is_file());
            let words =
                file.map_or_else(|| "no file is written, since there is no model".to_owned(), shell_word);
            let _ = writeln!(text, "{:MARGIN$}{words}", "FILE");
        }
        None if is_quiet() => {}
        None => {
            let model = if view.diagnosis.changes_model() { ", the model with these effects" } else { "" };
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

/// The undetectable effects; kinds with the same reason share a line.
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
    under("WHERE", "share of the tuned model's error, and its dependence on the motion", table)
}

/// The missing physics, joint by joint in the order of the arm, and the law of each kind once.
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
    let what = "effects missing from the model, ± at 95 %, and the share of the test error that each removes, by channel";
    let mut text = under("WHAT", what, table);
    if diagnosis.effects.iter().any(|effect| !effect.evidence.held_out) {
        text.push_str(&wrapped(
            "",
            MARGIN,
            "* share of the error in the data of the fit: the effect acts too little in the test part",
        ));
    }
    for (index, (kind, law)) in laws.into_iter().enumerate() {
        text.push_str(if index == 0 { "\n" } else { "" });
        text.push_str(&wrapped(if index == 0 { "LAWS" } else { "" }, MARGIN, &format!("{kind}: {law}")));
    }
    text
}

/// The block ALTERNATIVES: explanations that this motion cannot distinguish from a finding, and the number of those that it excludes.
fn alternatives(diagnosis: &Diagnosis) -> String {
    let (open, ruled_out): (Vec<_>, Vec<_>) =
        diagnosis.alternatives.iter().partition(|other| other.indistinguishable);
    let mut table = plain_table();
    let is_open = !open.is_empty();
    for other in open {
        table.add_row(vec![
            in_words(&other.instead_of),
            title(other.kind, other.joint.as_deref()),
            other.why_not.clone(),
        ]);
    }
    let text = under("ALTERNATIVES ", "that this motion cannot distinguish from the findings", table);
    let tried = ruled_out.len();
    let ruled_out = match (is_open, tried) {
        (_, 0) => return text,
        (true, 1) => "1 other effect was fitted instead of a finding and is excluded".to_owned(),
        (true, _) => format!("{tried} other effects were fitted instead of a finding and are excluded"),
        (false, 1) => "none: the effect that was fitted instead of a finding is excluded".to_owned(),
        (false, _) => {
            format!("none: all {tried} effects that were fitted instead of a finding are excluded")
        }
    };
    let word = if is_open { "" } else { "ALTERNATIVES " };
    let before = if is_open { "" } else { "\n" };
    text + before + &wrapped(word, MARGIN, &format!("{ruled_out}; the report lists them with their odds"))
}

/// The held-out errors for the channels with findings.
fn errors(fit: &Fit, diagnosis: &Diagnosis) -> String {
    let channels = channels(diagnosis);
    if channels.is_empty() {
        return String::new();
    }
    let mut text = format!("\n{:MARGIN$}root mean square error, test part: {}\n", "FIT", fit.test);
    text.push_str(&if channels.len() > FEW { one_line_each(fit, &channels) } else { bars(fit, &channels) });
    let bar = if channels.len() > FEW {
        "the error with the findings relative to the greatest of its line"
    } else {
        "an error relative to the greatest of its channel"
    };
    let meanings = meanings(channels.iter().copied());
    text.push_str(&wrapped("", MARGIN, &format!("{meanings}. A bar shows {bar}.")));
    if let Some(gain) = fit.gain {
        let [low, high] = gain.ci95.map(|share| 100.0 * share);
        let words = format!(
            "the findings remove {} (95 %: {low:.0} to {high:.0} %) of the re-tuned model's error",
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
            (MODELS[0].0, UNDECIDED, &fit.before),
            (MODELS[1].0, Style::new(), &fit.retuned),
            (MODELS[2].0, Style::new(), &fit.black_box),
            (MODELS[3].0, GOOD, &fit.after),
        ];
        let longest = rows.iter().map(|(_, _, table)| table[channel].rmse).fold(f64::MIN_POSITIVE, f64::max);
        let (scale, unit) = display_unit(fit.units.get(channel).copied().unwrap_or(""), longest);
        let floor = written(fit.noise_floor[channel].rmse * scale);
        let _ = writeln!(text, "{:MARGIN$}{channel}, {unit}, noise floor {floor}", "");
        for (name, style, table) in rows {
            let rmse = table[channel].rmse;
            let bar = styled(style, "█".repeat((BAR * rmse / longest).round() as usize));
            let _ = writeln!(text, "{:MARGIN$}  {name:16}{:>9}  {bar}", "", written(rmse * scale));
        }
    }
    text
}

/// One line a channel.
fn one_line_each(fit: &Fit, channels: &[&str]) -> String {
    let mut table = plain_table();
    let [given, retuned, black_box, found, floor] = MODELS.map(|(name, _)| name);
    table.set_header(["", given, retuned, black_box, found, floor, ""]);
    for &channel in channels {
        let all = [&fit.before, &fit.retuned, &fit.black_box, &fit.after, &fit.noise_floor];
        let all = all.map(|table| table[channel].rmse);
        let longest = all.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let (scale, unit) = display_unit(fit.units.get(channel).copied().unwrap_or(""), longest);
        let mut row = vec![format!("{channel}, {unit}")];
        row.extend(all.map(|rmse| number(rmse * scale, Digits::Significant(3))));
        row.push("█".repeat((BAR * all[3] / longest).round() as usize));
        table.add_row(row);
    }
    indented(table, &[1, 2, 3, 4, 5])
}

/// A table without rules.
fn plain_table() -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width((width() - MARGIN) as u16);
    table
}

/// `table` under a heading; empty text for one without rows.
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
