//! The findings: each effect in words, with its picture, its parameters and its evidence.

use freeplay_report::units::{display_unit, written};
use freeplay_report::{Block, Cell, Column, Section, Table};

use super::{Subject, picture};
use crate::{Diagnosis, Effect, Parameter};

/// The section; `None` without a finding.
pub fn section(subject: &Subject) -> Option<Section> {
    let diagnosis = subject.diagnosis;
    if diagnosis.effects.is_empty() {
        return None;
    }
    let mut section = Section::new("Missing effects");
    if diagnosis.effects.len() > 1 {
        section = section.with(at_a_glance(diagnosis));
    }
    for (index, effect) in diagnosis.effects.iter().enumerate() {
        for block in finding(diagnosis, subject, index, effect) {
            section = section.with(block);
        }
    }
    Some(section)
}

/// The common name of a kind.
pub fn kind_title(kind: &str) -> &str {
    freeplay_laws::kind(kind).map_or(kind, |kind| kind.title)
}

/// Kind and place, for headings: `Coulomb friction at elbow`. Many kinds contain an "of": "coupling of two joints".
pub fn title(kind: &str, joint: Option<&str>) -> String {
    let name = kind_title(kind);
    match joint {
        Some(joint) => format!("{name} at {joint}"),
        None => format!("{name} of the whole arm"),
    }
}

/// All findings in one table.
fn at_a_glance(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new("All findings, intervals at 95 %")
        .column(Column::text("joint"))
        .column(Column::text("missing effect").wrapping())
        .column(Column::number("error removed", "%").fixed(0).bars())
        .column(Column::text("95 % interval"))
        .column(Column::text("in").wrapping())
        .note("Error removed: share of the error in these channels that the effect removes beside all other findings, on the test part. With a star: on the data of the fit, since the effect acts too little in the test part.");
    for effect in &diagnosis.effects {
        let gain = effect.evidence.held_out_gain;
        let [low, high] = gain.ci95.map(|share| 100.0 * share);
        let star = if effect.evidence.held_out { "" } else { " *" };
        table = table.row([
            effect.joint.clone().unwrap_or_else(|| "whole arm".to_owned()).into(),
            effect.phrase.clone().into(),
            (100.0 * gain.value).into(),
            format!("{low:.0} to {high:.0} %{star}").into(),
            effect.evidence.channels.join(", ").into(),
        ]);
    }
    table
}

fn finding(diagnosis: &Diagnosis, subject: &Subject, index: usize, effect: &Effect) -> Vec<Block> {
    let mut blocks = vec![Block::Heading(title(effect.kind, effect.joint.as_deref()))];
    let mut text = format!("Law: {}. Source: {}.", effect.equation, effect.source);
    if effect.is_bound() {
        text.push_str(&format!("\n\n{}", effect.statement));
    } else if let Some(kind) = freeplay_laws::kind(effect.kind) {
        text.push_str(&format!("\n\nSignature: {}.", kind.signature));
    }
    blocks.push(text.into());
    // There is no picture of a joint at rest: no row of its torque has weight.
    if !effect.is_bound() {
        blocks.extend(picture::of(diagnosis, &subject.file.arm, index).into_iter().map(Block::from));
    }
    blocks.push(parameters(effect).into());
    blocks.push(evidence(effect).into());
    blocks
}

fn parameters(effect: &Effect) -> Table {
    let mut table = Table::new("")
        .column(Column::text("parameter"))
        .column(Column::text("value"))
        .column(Column::text("unit"))
        .column(Column::text("95 % interval"))
        .column(Column::text("meaning").wrapping());
    let kind = freeplay_laws::kind(effect.kind);
    for (name, parameter) in &effect.parameters {
        let meaning = kind.and_then(|kind| kind.parameter(name)).map_or("", |parameter| parameter.meaning);
        let size = parameter.value.as_float().unwrap_or(f64::INFINITY);
        let (scale, unit) = display_unit(&parameter.unit, size);
        let value = match (&parameter.value, parameter.ci95) {
            (toml::Value::Float(value), Some(_)) if parameter.is_least() => {
                format!("at least {}", written(value * scale))
            }
            (toml::Value::Float(value), Some([low, high])) => {
                freeplay_report::text::uncertain(value * scale, 0.5 * (high - low) * scale)
            }
            (toml::Value::Float(value), None) => written(value * scale),
            (toml::Value::Array(values), _) => {
                let numbers: Vec<String> =
                    values.iter().filter_map(toml::Value::as_float).map(written).collect();
                numbers.join(", ")
            }
            (other, _) => other.to_string().trim_matches('"').to_owned(),
        };
        let interval = interval(parameter, scale).unwrap_or_else(|| "not identified".to_owned());
        table = table.row([
            Cell::from(name.as_str()),
            value.into(),
            unit.into(),
            interval.into(),
            meaning.into(),
        ]);
    }
    table
}

/// The 95 % interval of `parameter` in units of 1/`scale`, in words.
pub fn interval(parameter: &Parameter, scale: f64) -> Option<String> {
    let [low, high] = parameter.ci95?.map(|end| written(end * scale));
    Some(if parameter.is_least() { format!("{low} or more") } else { format!("{low} to {high}") })
}

fn evidence(effect: &Effect) -> String {
    let evidence = &effect.evidence;
    let on = if evidence.held_out {
        "the test part, to which no law was fitted"
    } else {
        "the data of the fit (the effect acts too little in the test part)"
    };
    let percent = |x: f64| format!("{:.0}", 100.0 * x);
    format!(
        "Evidence: beside the other findings, this effect is {}. On {on}, it removes {} % (95 %: {} to {} %) of the error in {}.",
        evidence.odds,
        percent(evidence.held_out_gain.value),
        percent(evidence.held_out_gain.ci95[0]),
        percent(evidence.held_out_gain.ci95[1]),
        evidence.channels.join(", "),
    )
}
