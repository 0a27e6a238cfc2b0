//! Measured and modelled values over time, with the held-out part shaded.

use freeplay_report::units::display_unit;
use freeplay_report::{Axis, Block, Chart, Mark, Section, Series};

use super::channels;
use super::errors::MODELS;
use super::points::traces;
use crate::search::tried::LISTED;
use crate::statistics::difference;
use crate::{Diagnosis, Passage, Trace};

/// The section.
pub fn section(diagnosis: &Diagnosis) -> Option<Section> {
    let first = diagnosis.passages.first()?;
    let shown: Vec<&str> = channels(diagnosis).into_iter().take(LISTED).collect();
    let names = first.traces.iter().map(|trace| trace.channel.as_str());
    let others: Vec<Block> = names
        .filter(|name| !shown.contains(name))
        .flat_map(|name| charts(diagnosis, name))
        .map(Block::from)
        .collect();
    let mut section = Section::new("Over time");
    for chart in shown.iter().flat_map(|channel| charts(diagnosis, channel)) {
        section = section.with(chart);
    }
    if !others.is_empty() {
        section = section.with(Block::Details { summary: "Other channels".to_owned(), blocks: others });
    }
    Some(section)
}

/// Values and errors of a channel: for one recording, the whole of it with its held-out end; for several, the first and the held-out one.
fn charts(diagnosis: &Diagnosis, channel: &str) -> Vec<Chart> {
    let all: Vec<(&Passage, &Trace)> = traces(diagnosis, channel).collect();
    let (Some(first), Some(held)) = (all.first(), all.iter().find(|(passage, _)| passage.held_out)) else {
        return Vec::new();
    };
    let parts = if first.0.recording == held.0.recording {
        vec![vec![*first, *held]]
    } else {
        vec![vec![*first], vec![*held]]
    };
    parts.iter().flat_map(|part| pair(channel, part)).collect()
}

fn pair(channel: &str, part: &[(&Passage, &Trace)]) -> [Chart; 2] {
    let recording = part.first().map_or("", |(passage, _)| passage.recording.as_str());
    let unit = part.first().map_or("", |(_, trace)| trace.unit);
    // Times continue across a gap, values break off.
    let t = joined(part, |last| last, |passage, _| passage.motion.t.clone());
    let values =
        |column: fn(&Trace) -> &Vec<f64>| joined(part, |_| f64::NAN, |_, trace| column(trace).clone());
    let measured = values(|trace| &trace.measured);
    let before = values(|trace| &trace.before);
    let retuned = values(|trace| &trace.retuned);
    let after = values(|trace| &trace.after);
    let (scale, unit_of_values) = display_unit(unit, largest(&measured));
    let shown = chart(part, format!("{channel} of {recording}"), Axis::new(channel, unit_of_values));
    let up = |column: &[f64], scale: f64| -> Vec<f64> { column.iter().map(|x| x * scale).collect() };
    let shown = shown
        .series(Series::line("measured", &t, &up(&measured, scale)))
        .series(Series::line(MODELS[0].0, &t, &up(&difference(&measured, &before), scale)))
        .series(Series::line(MODELS[3].0, &t, &up(&difference(&measured, &after), scale)).dashed());
    let (scale, unit) = display_unit(unit, largest(&before));
    let errors =
        chart(part, format!("error of {channel}"), Axis::new("measured minus model", unit)).in_view(0.0);
    let errors = errors
        .series(Series::line(MODELS[0].0, &t, &up(&before, scale)))
        .series(Series::line(MODELS[1].0, &t, &up(&retuned, scale)))
        .series(Series::line(MODELS[3].0, &t, &up(&after, scale)));
    [shown, errors]
}

fn chart(part: &[(&Passage, &Trace)], title: String, y: Axis) -> Chart {
    let recording = part.first().map_or("", |(passage, _)| passage.recording.as_str());
    let chart =
        Chart::trace(title, Axis::new("time", "s"), y).group(format!("time of {recording}")).height(210);
    let held = part.iter().filter(|(passage, _)| passage.held_out);
    held.fold(chart, |chart, (passage, _)| match (passage.motion.t.first(), passage.motion.t.last()) {
        (Some(from), Some(to)) => chart.mark(Mark::Span { from: *from, to: *to, label: "held out".into() }),
        _ => chart,
    })
}

/// A column of all passages; between them, and between their stretches, `gap` of the value before.
fn joined(
    part: &[(&Passage, &Trace)],
    gap: fn(f64) -> f64,
    column: impl Fn(&Passage, &Trace) -> Vec<f64>,
) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for (passage, trace) in part {
        let values = column(passage, trace);
        for stretch in &passage.motion.stretches {
            all.extend(all.last().copied().map(gap));
            all.extend_from_slice(&values[stretch.clone()]);
        }
    }
    all
}

fn largest(values: &[f64]) -> f64 {
    values.iter().filter(|x| x.is_finite()).fold(0.0, |most, x| most.max(x.abs()))
}
