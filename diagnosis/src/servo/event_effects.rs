//! Stops and contacts in words: kind, time, place and joints.

use std::collections::{BTreeMap, BTreeSet};

use freeplay_model::EffectTable;
use freeplay_recording::Group;
use toml::{Table, Value};

use super::compare::unit;
use super::conclude::Conclusion;
use super::events::{Event, What};
use super::findings::known;
use super::scores::gain;
use crate::report::diagnosis::{Effect, Evidence, Parameter};
use crate::report::words::{odds, phrase};
use crate::statistics::STRONG as NAMED_FROM;

impl Conclusion<'_> {
    /// Stops and contacts as effects, and tables of the stops. Several contacts with the same stop count as one.
    pub(super) fn event_effects(&self) -> (Vec<Effect>, Vec<EffectTable>) {
        let (mut effects, mut tables) = (Vec::new(), Vec::<EffectTable>::new());
        let mut met: BTreeSet<(usize, bool)> = BTreeSet::new();
        for event in &self.events {
            let (name, joint, parameters, joints) = match &event.what {
                What::Stop { joint, position, is_above } => {
                    if !met.insert((*joint, *is_above)) {
                        continue;
                    }
                    let side = if *is_above { "upper" } else { "lower" };
                    let tick = self.sights[*joint].tick;
                    let at = &self.numbers.file.arm.joints()[*joint];
                    let parameter = Parameter {
                        value: Value::Float(*position),
                        unit: unit(at.kind).to_owned(),
                        ci95: Some([position - tick, position + tick]),
                    };
                    let table = Table::from_iter([(side.to_owned(), Value::Float(*position))]);
                    let same = tables.iter_mut().find(|table| table.joint.as_ref() == Some(&at.name));
                    match same {
                        Some(other) => other.parameters.extend(table),
                        None => tables.push(EffectTable {
                            kind: "hard_stop".to_owned(),
                            joint: Some(at.name.clone()),
                            parameters: table,
                            line: 0,
                        }),
                    }
                    (
                        "hard_stop",
                        Some(at.name.clone()),
                        BTreeMap::from([(side.to_owned(), parameter)]),
                        vec![*joint],
                    )
                }
                What::Contact { joints, point, force } => {
                    ("contact", None, contact_parameters(event, *point, *force), joints.clone())
                }
            };
            effects.push(self.happening(event, name, joint, parameters, &joints));
        }
        (effects, tables)
    }

    fn happening(
        &self,
        event: &Event,
        name: &'static str,
        joint: Option<String>,
        parameters: BTreeMap<String, Parameter>,
        joints: &[usize],
    ) -> Effect {
        let kind = known(name);
        let phrase = phrase(kind, &parameters);
        let names: Vec<&str> =
            joints.iter().map(|joint| self.numbers.file.arm.joints()[*joint].name.as_str()).collect();
        let [start, end] = event.time;
        let recording = self.name_of(event.recording);
        let what = match &event.what {
            What::Stop { .. } => format!("{} rests at a hard stop", names.join(", ")),
            What::Contact { point: [x, y, z], .. } => format!(
                "the arm touches an obstacle near the tool position ({x:.3}, {y:.3}, {z:.3}) m: it displaces {}",
                names.join(", ")
            ),
        };
        let rows = [(event.recording, event.rows.clone())];
        let of_event = gain([&self.before, &self.after], &rows, joints, self.tracks, self.settings.seed);
        Effect {
            kind: kind.name,
            joint,
            parameters,
            equation: kind.equation,
            source: kind.source,
            evidence: Evidence {
                log_odds: NAMED_FROM,
                odds: odds(NAMED_FROM),
                share: 0.0,
                held_out_gain: of_event,
                held_out: self.parts.test.iter().any(|(index, _)| *index == event.recording),
                channels: joints.iter().map(|joint| Group::Position.column(*joint)).collect(),
            },
            phrase,
            statement: format!("From {start:.1} to {end:.1} s of {recording}, {what}."),
        }
    }
}

fn contact_parameters(
    event: &Event,
    point: [f64; 3],
    force: Option<[f64; 3]>,
) -> BTreeMap<String, Parameter> {
    let parameter = |value: Value, unit: &str| Parameter { value, unit: unit.to_owned(), ci95: None };
    let vector = |of: [f64; 3]| Value::Array(of.map(Value::Float).to_vec());
    let mut parameters = BTreeMap::from([
        ("start".to_owned(), parameter(Value::Float(event.time[0]), "s")),
        ("end".to_owned(), parameter(Value::Float(event.time[1]), "s")),
        ("point".to_owned(), parameter(vector(point), "m")),
    ]);
    if let Some(force) = force {
        parameters.insert("force".to_owned(), parameter(vector(force), "N"));
    }
    parameters
}
