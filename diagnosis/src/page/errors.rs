//! Improvement of the model: held-out errors by channel, side by side, with intervals.

use freeplay_report::units::display_unit;
use freeplay_report::{Block, Cell, Column, Section, Table};

use super::channels;
use crate::statistics::{BLOCK_S, blocks as blocks_of, bootstrap};
use crate::{Diagnosis, Passage, Trace};

type Pick = fn(&Trace) -> &[f64];

/// The compared models, from the plainest to the one with the findings, then the noise floor. Each has the name of its error, which the terminal, the report
/// and Python share, and a meaning.
pub const MODELS: [(&str, &str); 5] = [
    ("as given", "the given model without changes"),
    ("re-tuned", "its masses, lengths, frictions, zeros and delays tuned within their tolerances"),
    ("black box", "re-tuned, with splines instead of the findings"),
    ("with findings", "re-tuned, with the findings (the written model)"),
    ("noise floor", "the error of the instruments alone"),
];
/// The meanings for positions that are simulated from the commands.
const OF_POSITIONS: [&str; 5] = [
    "the servos of the model, or the command itself without servos",
    "the delayed command",
    "a linear filter of the commands",
    "the servos that were found",
    "rounding",
];

/// The meanings of the [`MODELS`] in one line. Simulated positions among the `channels` have meanings of their own.
pub fn meanings<'a>(mut channels: impl Iterator<Item = &'a str>) -> String {
    let are_positions = channels.all(|channel| channel.starts_with('q') && !channel.starts_with("q_link"));
    let of = |(index, (name, meaning)): (usize, &(&str, &str))| {
        let meaning = if are_positions { OF_POSITIONS[index] } else { meaning };
        format!("{name}: {meaning}")
    };
    MODELS.iter().enumerate().map(of).collect::<Vec<_>>().join("; ")
}

/// Accessors of the errors of all models but the last in a trace.
const PICKS: [Pick; 4] =
    [|trace| &trace.before, |trace| &trace.retuned, |trace| &trace.unnamed, |trace| &trace.after];

/// The section.
pub fn section(diagnosis: &Diagnosis) -> Option<Section> {
    let fit = diagnosis.fit.as_ref()?;
    let mut section = Section::new("Errors before and after").with(format!(
        "RMS errors on {}, with 95 % intervals by a bootstrap of blocks of {BLOCK_S} s. {}.",
        fit.test,
        meanings(fit.units.keys().map(String::as_str))
    ));
    let shown = channels(diagnosis);
    for channel in &shown {
        section = section.with(bars(diagnosis, channel));
    }
    let others: Vec<Block> = fit
        .units
        .keys()
        .filter(|channel| !shown.contains(&channel.as_str()))
        .map(|channel| bars(diagnosis, channel).into())
        .collect();
    if others.is_empty() {
        return Some(section);
    }
    Some(section.with(Block::Details { summary: "Other channels".to_owned(), blocks: others }))
}

fn bars(diagnosis: &Diagnosis, channel: &str) -> Table {
    let held: Vec<(&Passage, &Trace)> =
        super::points::traces(diagnosis, channel).filter(|(passage, _)| passage.held_out).collect();
    let errors: Vec<(&str, Estimate)> =
        MODELS.iter().zip(PICKS).map(|((name, _), pick)| (*name, rms(&held, pick, diagnosis.seed))).collect();
    let largest = errors.iter().map(|(_, e)| e.value).fold(0.0, f64::max);
    let unit = held.first().map_or("", |(_, trace)| trace.unit);
    let (scale, unit) = display_unit(unit, largest);
    let mut table = Table::new(format!("Held-out error of {channel}"))
        .column(Column::text("model"))
        .column(Column::number("error", unit.clone()).bars())
        .column(Column::number("95 % from", unit.clone()))
        .column(Column::number("to", unit));
    for (name, e) in errors {
        table = table.row([
            name.into(),
            (e.value * scale).into(),
            (e.low * scale).into(),
            (e.high * scale).into(),
        ]);
    }
    let floor = diagnosis.fit.as_ref().and_then(|fit| fit.noise_floor.get(channel));
    let floor = floor.map_or(f64::NAN, |floor| floor.rmse);
    table.row([Cell::from(MODELS[4].0), (floor * scale).into()])
}

/// A number with its 95 % interval.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    value: f64,
    low: f64,
    high: f64,
}

/// Root mean square over all `held` passages, with the interval of a [`bootstrap`] of blocks.
fn rms(held: &[(&Passage, &Trace)], pick: Pick, seed: u64) -> Estimate {
    let mut blocks: Vec<[f64; 2]> = Vec::new();
    for (passage, trace) in held {
        for stretch in &passage.motion.stretches {
            for rows in blocks_of(stretch.clone(), passage.motion.step(stretch)) {
                let finite = pick(trace)[rows].iter().filter(|x| x.is_finite());
                blocks.push(finite.fold([0.0, 0.0], |[sum, count], x| [sum + x * x, count + 1.0]));
            }
        }
    }
    let root = |picked: &mut dyn Iterator<Item = usize>| {
        let [sum, count] =
            picked.fold([0.0, 0.0], |[sum, count], k| [sum + blocks[k][0], count + blocks[k][1]]);
        (sum / count).sqrt()
    };
    let value = root(&mut (0..blocks.len()));
    if blocks.len() < 2 {
        return Estimate { value, low: f64::NAN, high: f64::NAN };
    }
    let [low, high] = bootstrap(blocks.len(), seed, root);
    Estimate { value, low, high }
}
