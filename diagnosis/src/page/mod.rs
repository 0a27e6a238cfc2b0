//! `report.html` of a diagnosis: first the verdict, then the missing effects, their locations, the improvement, the alternatives and the next steps.
//!
//! Files in the order of the page: `findings` (each effect with its pictures, made by `picture` from `points`), `errors` (held-out errors with intervals),
//! `over_time`, `rest` (alternatives, untestable effects, the model, the evidence). `commands` composes the commands that page and terminal print.

mod commands;
mod errors;
mod findings;
mod over_time;
mod picture;
mod points;
mod rest;

use std::path::{Path, PathBuf};

use freeplay_model::ArmFile;
use freeplay_report::units::{display_unit, written};
use freeplay_report::{Block, Cell, Column, Document, Figure, Section, Table, Verdict};

use crate::{Certainty, Diagnosis, Fit, Verdict as Outcome, sentences};

pub use commands::{commands, diagnose_command};
pub use errors::{MODELS, meanings};
pub use findings::{kind_title, title};
pub use picture::{of as pictures, strongest_map};
pub use rest::{in_words, reasons};

/// The content of a report.
pub struct Subject<'a> {
    /// The name of the model, as given.
    pub model: &'a str,
    /// The model's file.
    pub file: &'a ArmFile,
    /// The recordings.
    pub recordings: &'a [PathBuf],
    /// The command that makes this diagnosis.
    pub command: String,
    /// Commands that use the model of the diagnosis: see [`commands`].
    pub commands: [String; 2],
    /// The diagnosis.
    pub diagnosis: &'a Diagnosis,
    /// The folder of results.
    pub out: &'a Path,
}

/// The page.
pub fn document(subject: &Subject) -> Document {
    let Subject { model, recordings, command, diagnosis, .. } = subject;
    let names: Vec<String> = recordings.iter().map(|path| path.display().to_string()).collect();
    let mut document =
        Document::new("Freeplay diagnosis").subtitle(format!("{model} against {}", names.join(", ")));
    for block in overview(diagnosis) {
        document = document.overview(block);
    }
    let sections = [
        findings::section(subject),
        whereabouts(diagnosis),
        errors::section(diagnosis),
        over_time::section(diagnosis),
        rest::alternatives(diagnosis),
        rest::untestable(diagnosis),
        rest::model(subject),
        rest::next(diagnosis),
        rest::judged(diagnosis),
    ];
    sections
        .into_iter()
        .flatten()
        .fold(document, Document::section)
        .footer(format!("seed {}; `{command}`", diagnosis.seed))
}

/// Word and tone of a verdict.
pub fn outcome(verdict: Outcome) -> (Verdict, &'static str) {
    match verdict {
        Outcome::NothingMissing => (Verdict::Ok, "nothing missing"),
        Outcome::Named => (Verdict::Info, "named"),
        Outcome::OneOf => (Verdict::Warn, "one of several"),
        Outcome::Unknown => (Verdict::Warn, "unknown"),
        Outcome::InsufficientData => (Verdict::Warn, "insufficient data"),
        Outcome::Setup => (Verdict::Warn, "set-up"),
    }
}

fn overview(diagnosis: &Diagnosis) -> Vec<Block> {
    let (verdict, word) = outcome(diagnosis.verdict);
    let text = diagnosis.statement.clone();
    let mut blocks = vec![Block::Judged { verdict, word: word.to_owned(), text }];
    let setup: Vec<String> = sentences(&diagnosis.setup)
        .into_iter()
        .map(|(certainty, statement, remedy)| match certainty {
            Certainty::Sure => format!("{statement} {remedy}"),
            Certainty::Likely => {
                format!("Likely, although much of the recording stays unexplained: {statement} {remedy}")
            }
        })
        .collect();
    if !setup.is_empty() {
        blocks.push(Block::Text("Check the conventions of the recording:".to_owned()));
        blocks.push(Block::List(setup));
    }
    let tiles = tiles(diagnosis);
    if !tiles.is_empty() {
        blocks.push(Block::Figures(tiles));
    }
    if !diagnosis.next.is_empty() {
        blocks.push(Block::Text("Next:".to_owned()));
        blocks.push(Block::List(diagnosis.next.clone()));
    }
    blocks
}

/// The channels of the findings: those in which effects show, otherwise those of the locations.
pub fn channels(diagnosis: &Diagnosis) -> Vec<&str> {
    let mut names: Vec<&str> =
        diagnosis.effects.iter().flat_map(|e| &e.evidence.channels).map(String::as_str).collect();
    if names.is_empty() {
        names = diagnosis.location.iter().flat_map(|place| &place.channels).map(String::as_str).collect();
    }
    names.sort_unstable();
    names.dedup();
    names.retain(|name| diagnosis.fit.as_ref().is_some_and(|fit| fit.units.contains_key(*name)));
    names
}

/// The key numbers: parameters, and the held-out error before and after.
fn tiles(diagnosis: &Diagnosis) -> Vec<Figure> {
    let mut tiles = Vec::new();
    for effect in &diagnosis.effects {
        let on = effect.joint.as_deref().unwrap_or("the whole arm");
        for (name, parameter) in &effect.parameters {
            let Some(value) = parameter.value.as_float() else { continue };
            let (scale, unit) = display_unit(&parameter.unit, value);
            let Some(interval) = findings::interval(parameter, scale) else { continue };
            let tile =
                Figure::new(format!("{} of {on}", name.replace('_', " ")), written(value * scale), unit);
            tiles.push(tile.note(format!("95 %: {interval}")));
        }
    }
    tiles.truncate(4);
    let Some(fit) = &diagnosis.fit else { return tiles };
    let (Some(gain), Some(first)) = (fit.gain, plainest(diagnosis, fit)) else { return tiles };
    let (before, after) = (fit.before[first].rmse, fit.after[first].rmse);
    let (scale, unit) = display_unit(fit.units[first], before);
    tiles.push(
        Figure::new(format!("error of {first}, held out"), written(after * scale), unit)
            .note(format!("{} before", written(before * scale))),
    );
    let percent = |x: f64| format!("{:.0}", 100.0 * x);
    tiles.push(Figure::new("error removed", percent(gain.value), "%").note(format!(
        "95 %: {} to {} %, on held-out data, relative to the re-tuned model",
        percent(gain.ci95[0]),
        percent(gain.ci95[1])
    )));
    tiles
}

/// The channel in which the findings reduce the error of the given model most, in squares of the channel's noise.
fn plainest<'a>(diagnosis: &'a Diagnosis, fit: &Fit) -> Option<&'a str> {
    let taken = |channel: &str| {
        let [before, after, floor] =
            [&fit.before, &fit.after, &fit.noise_floor].map(|errors| errors[channel].rmse.powi(2));
        (before - after) / floor.max(f64::MIN_POSITIVE)
    };
    channels(diagnosis).into_iter().max_by(|a, b| taken(a).total_cmp(&taken(b)))
}

/// The locations where model and machine differ.
fn whereabouts(diagnosis: &Diagnosis) -> Option<Section> {
    let fit = diagnosis.fit.as_ref()?;
    let mut section = Section::new("Location");
    if diagnosis.location.is_empty() {
        section = section.with("No residual exceeds 1.4 times the noise floor of its channel.");
    } else {
        let mut table = Table::new("Residual of the tuned model")
            .column(Column::text("joint"))
            .column(Column::text("channels"))
            .column(Column::number("share", "%").fixed(0).bars())
            .column(Column::text("dependence on the motion").wrapping())
            .column(Column::number("p", "").significant(2))
            .note("p: probability of such a pattern in a residual that does not depend on the motion, corrected for the number of tests.");
        for place in &diagnosis.location {
            table = table.row([
                place.joint.clone().unwrap_or_else(|| "whole arm".to_owned()).into(),
                place.channels.join(", ").into(),
                (100.0 * place.share).into(),
                place.when.clone().into(),
                place.p.into(),
            ]);
        }
        section = section.with(table);
    }
    let mut table = Table::new("Error and noise floor of every channel, on held-out data")
        .column(Column::text("channel"))
        .column(Column::text("unit"))
        .column(Column::number(MODELS[1].0, "").significant(3))
        .column(Column::number(MODELS[4].0, "").significant(3))
        .column(Column::number("ratio to the floor", "").significant(3).bars())
        .note("Noise floor: simulated error of a machine that equals its model, with the same motion and the same measurement noise.");
    for (channel, unit) in &fit.units {
        let (left, floor) = (fit.retuned[channel].rmse, fit.noise_floor[channel].rmse);
        let (scale, unit) = display_unit(unit, left);
        let times = if floor > 0.0 { left / floor } else { f64::NAN };
        table = table.row([
            channel.as_str().into(),
            unit.into(),
            (left * scale).into(),
            (floor * scale).into(),
            Cell::from(times),
        ]);
    }
    section = section.with(table);
    Some(match picture::strongest_map(diagnosis) {
        Some(drawing) => section.with(drawing),
        None => section,
    })
}
