//! The result for servos: verdict, findings, errors, events, and the model that contains them.

use std::collections::BTreeMap;

use freeplay_model::{ArmFile, EffectTable};
use freeplay_recording::{Group, Recording};
use freeplay_servo::{JointServo, ModelParameter, Problem, ServoArm, Sight, Track, Unknown};
use toml::Value;

use super::burdens::{Burdened, Rival, present};
use super::changes::Change;
use super::compare::{simulated, unit};
use super::events::{Event, What};
use super::findings::{CERTAIN, Finding, Numbers, around, known, named_from};
use super::limits::lost;
use super::parts::{Parts, Rows, rounding};
use super::scores::{Deviations, deviations, errors, gain, rms};
use crate::report::diagnosis::{
    Alternative, Diagnosis, Effect, Evidence, Fit, Location, Parameter, Rmse, Verdict, insufficient,
};
use crate::report::settings::DiagnoseSettings;
use crate::report::words::{odds, phrase, site, statement};
use crate::sorting::sort_falling;

/// Kinds of joint effects in the file that the findings replace.
const REPLACED: [&str; 6] =
    ["servo", "command_delay", "coulomb_friction", "viscous_friction", "stribeck_friction", "rotor_inertia"];

/// Recommended motion to separate causes that only the weight of the links distinguishes.
const TO_SEPARATE: &str =
    "record poses in which gravity loads the joints before and after it in the other direction, or weigh it";

/// The inputs of a conclusion.
pub struct Conclusion<'a> {
    pub settings: &'a DiagnoseSettings,
    pub recordings: &'a [Recording],
    pub tracks: &'a [Track],
    pub parts: &'a Parts,
    /// The choice part without the rows of events.
    pub choice: &'a Problem<'a>,
    pub sights: &'a [Sight],
    pub numbers: Numbers<'a>,
    /// Burdens of the arm that its model lacks: payload, lean and similar.
    pub burdened: &'a [Burdened],
    /// The changes of the given model; `None` if no servos were given.
    pub changes: Option<&'a [Change]>,
    /// Joints whose commands move.
    pub moves: &'a [bool],
    /// The model that was given, if it has servos.
    pub given: Option<&'a ServoArm>,
    /// Residuals of the model as given, of a plain lag, of nameless filters and of the fitted servos.
    pub before: Deviations,
    pub lagged: Deviations,
    pub filtered: Deviations,
    pub after: Deviations,
    pub events: Vec<Event>,
}

impl Conclusion<'_> {
    /// The diagnosis of recordings that do not suffice, for the reason `why`.
    pub fn insufficient(file: &ArmFile, settings: &DiagnoseSettings, why: &str) -> Diagnosis {
        let advice = "record a motion in which every joint moves, slowly and quickly, in both directions";
        insufficient(file, settings, Vec::new(), format!("{why}; {advice}"))
    }

    /// Composes the diagnosis.
    pub fn diagnosis(&self) -> Diagnosis {
        let file = self.numbers.file;
        let found = self.numbers.findings(self.moves);
        let clean = self.clean_test();
        let mut effects: Vec<Effect> = found
            .iter()
            .filter(|finding| finding.is_named)
            .filter_map(|finding| Some(self.effect(finding, self.log_odds(finding)?, &clean)))
            .collect();
        let mut model = file.clone();
        let is_replaced = |table: &EffectTable| {
            REPLACED.contains(&table.kind.as_str())
                && table
                    .joint
                    .as_ref()
                    .and_then(|name| file.arm.joint_index(name))
                    .is_some_and(|at| self.moves[at])
        };
        model.effects.retain(|table| !is_replaced(table));
        model.effects.extend(found.iter().map(|finding| finding.table.clone()));
        let burdens: Vec<Effect> =
            self.burdened.iter().filter_map(|burdened| self.burden(burdened, &clean)).collect();
        let alternatives =
            self.burdened.iter().flat_map(|burdened| self.rivals(burdened)).collect::<Vec<_>>();
        let is_open = !burdens.is_empty() && !alternatives.is_empty();
        effects.extend(burdens);
        // Masses within their tolerances belong to the simulated model.
        if let Some(burden) = &self.numbers.fitted.model.burden {
            model.effects.extend(burden.tables());
        }
        let (happened, stops) = self.event_effects();
        effects.extend(happened);
        for stop in stops {
            let is_same = |table: &&mut EffectTable| table.kind == stop.kind && table.joint == stop.joint;
            match model.effects.iter_mut().find(is_same) {
                Some(known) => known.parameters.extend(stop.parameters),
                None => model.effects.push(stop),
            }
        }
        if !self.moves.iter().all(|moves| *moves) {
            // A rollout needs a servo at each joint.
            model.effects.extend(self.servos_of_joints_at_rest());
        }
        let base = Conclusion::insufficient(file, self.settings, "");
        let fit = self.fit(&clean);
        share_out(&mut effects, &fit);
        let verdict = match (effects.is_empty(), is_open) {
            (true, _) => Verdict::NothingMissing,
            (false, true) => Verdict::OneOf,
            (false, false) => Verdict::Named,
        };
        let is_named = |kind: &str| effects.iter().any(|effect| effect.kind == kind);
        let mut untestable = self.numbers.untestable(self.moves);
        untestable.retain(|one| one.joint.is_some() || !is_named(one.kind));
        Diagnosis {
            verdict,
            statement: self.statement(&effects, &clean),
            location: self.location(&clean),
            fit: Some(fit),
            next: self.next(),
            untestable,
            quality: self.quality(),
            passages: self.passages(),
            model,
            effects,
            alternatives: if is_open { alternatives } else { Vec::new() },
            ..base
        }
    }

    /// The parameters of `finding` with their reference values, those of the given model or those of an absent effect: index of the unknown, and value. A servo
    /// without a given one has no references.
    /// The fit holds friction and rotor inertia as ratios to the stiffness. If a load determines the stiffness, the function divides the given friction in N·m
    /// by the fitted stiffness: the ratio to the given stiffness would differ although the friction is the same.
    fn references(&self, finding: &Finding) -> Vec<(usize, f64)> {
        let joint = finding.joint;
        let given = self.given.map(|given| &given.joints[joint]);
        let stiffness = self.numbers.fitted.model.joints[joint].stiffness;
        let of_given = |given: &JointServo, parameter: ModelParameter| {
            let is_absolute = matches!(
                parameter,
                ModelParameter::Coulomb | ModelParameter::Stiction | ModelParameter::Rotor
            ) && self.numbers.is_known(joint);
            parameter.of(given) * if is_absolute { given.stiffness / stiffness } else { 1.0 }
        };
        let reference = |parameter: ModelParameter| {
            let index = self.numbers.index(joint, parameter)?;
            let absent = finding.absent.map(|(_, value)| value);
            Some((index, given.map(|given| of_given(given, parameter)).or(absent)?))
        };
        finding.model_parameters().filter_map(reference).collect()
    }

    /// Log-likelihood ratio of `finding` against the reference values, by its strongest parameter: half the squared distance of the parameter in the fit part,
    /// plus the loss of the choice part with the reference value and all other parameters refitted.
    fn evidence(&self, finding: &Finding) -> f64 {
        let fitted = self.numbers.fitted;
        let here = lost(self.choice, &fitted.model, &fitted.noise);
        let of = |(index, old): (usize, f64)| {
            let other = fitted.with(self.numbers.unknowns, index, old);
            let distance = self.numbers.distance(index, old, &self.settings.tolerances).min(CERTAIN);
            0.5 * distance.powi(2) + lost(self.choice, &other, &fitted.noise) - here
        };
        self.references(finding).into_iter().map(of).reduce(f64::max).unwrap_or(0.5 * CERTAIN.powi(2))
    }

    /// Log odds of `finding` if the data support it: if servos were given, those of the changes with its parameters, otherwise those of the parameters.
    fn log_odds(&self, finding: &Finding) -> Option<f64> {
        let Some(changes) = self.changes else {
            let evidence = self.evidence(finding);
            return (self.is_strong_evidence(finding) && evidence > named_from(self.moves.len()))
                .then_some(evidence);
        };
        let references = self.references(finding);
        let said = changes.iter().filter_map(|change| {
            let own = references.iter().filter(|(index, _)| change.has(&self.numbers.unknowns[*index]));
            let farthest = own.map(|(index, old)| self.odds_of_distance(*index, *old)).reduce(f64::max)?;
            Some(change.evidence.min(farthest))
        });
        said.reduce(f64::max).filter(|evidence| *evidence > named_from(self.moves.len()))
    }

    /// Upper bound of the log odds of parameter number `index` against its value `old`: ½ z² of its distance, in units of tolerance and posterior deviation. A
    /// search that continued without the rows of events may have moved a parameter after its change was found.
    fn odds_of_distance(&self, index: usize, old: f64) -> f64 {
        0.5 * self.numbers.distance(index, old, &self.settings.tolerances).powi(2)
    }

    /// Returns true if the data support `finding` against the reference values. One of its parameters must lie beyond the deviation of fit and tolerance. Put
    /// back, with all other parameters refitted, it must move the simulated position somewhere in the choice part by more than a step of the encoder. Smaller
    /// differences also show in thousands of rows, but only if the model is that exact.
    fn is_strong_evidence(&self, finding: &Finding) -> bool {
        let references = self.references(finding);
        let tells = |(index, old): &(usize, f64)| {
            let other = self.numbers.fitted.with(self.numbers.unknowns, *index, *old);
            let distance = self.numbers.distance(*index, *old, &self.settings.tolerances);
            distance > self.numbers.named_from()
                && self.trace(&other, finding.joint) > self.sights[finding.joint].tick
        };
        references.is_empty() || references.iter().any(tells)
    }

    /// Greatest change of the simulated position of `joint` in the choice part with the model `other`, rad (m).
    fn trace(&self, other: &ServoArm, joint: usize) -> f64 {
        let [one, other] = [&self.numbers.fitted.model, other].map(|model| self.choice.residuals(model));
        let rows = one.iter().flatten().zip(other.iter().flatten()).skip(joint).step_by(self.moves.len());
        rows.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// The judged rows without those of events.
    fn clean_test(&self) -> Vec<Rows> {
        let mut parts = self.parts.test.clone();
        for event in &self.events {
            parts = parts
                .into_iter()
                .flat_map(|(index, rows)| {
                    if index != event.recording {
                        return vec![(index, rows)];
                    }
                    let before = rows.start..rows.end.min(event.rows.start);
                    let after = rows.start.max(event.rows.end)..rows.end;
                    [before, after]
                        .into_iter()
                        .filter(|rows| !rows.is_empty())
                        .map(|rows| (index, rows))
                        .collect()
                })
                .collect();
        }
        if parts.is_empty() { self.parts.test.clone() } else { parts }
    }

    fn effect(&self, finding: &Finding, evidence: f64, clean: &[Rows]) -> Effect {
        let joint = Some(self.numbers.file.arm.joints()[finding.joint].name.clone());
        let phrase = phrase(finding.kind, &finding.parameters);
        let joints = [finding.joint];
        let without = self.model_without(finding).map(|model| self.left_by(&model, clean));
        let without = without.as_ref().unwrap_or(&self.before);
        let gain = gain([without, &self.after], clean, &joints, self.tracks, self.settings.seed);
        let square = |of: &Deviations| rms(of, clean, &joints).powi(2);
        let mut statement = statement(&phrase, joint.as_deref());
        if !finding.remark.is_empty() {
            statement = format!("{statement} {}", finding.remark);
        }
        Effect {
            kind: finding.kind.name,
            joint,
            parameters: finding.parameters.clone(),
            equation: finding.kind.equation,
            source: finding.kind.source,
            evidence: Evidence {
                log_odds: evidence,
                odds: odds(evidence),
                share: (square(without) - square(&self.after)).max(0.0),
                held_out_gain: gain,
                held_out: true,
                channels: vec![Group::Position.column(finding.joint)],
            },
            phrase,
            statement,
        }
    }

    /// The payload or lean of the arm as an effect, if the data support it.
    fn burden(&self, burdened: &Burdened, clean: &[Rows]) -> Option<Effect> {
        let (fitted, kind) = (self.numbers.fitted, known(burdened.kind));
        let index = |unknown: &Unknown| self.numbers.unknowns.iter().position(|one| one == unknown);
        let numbers: Vec<usize> = present(&burdened.unknowns).filter_map(index).collect();
        let (evidence, strongest) = self.told_burden(burdened, &numbers)?;
        let tables = fitted.model.burden.as_ref()?.tables();
        let joint = burdened.joint.map(|joint| self.numbers.file.arm.joints()[joint].name.clone());
        let table = tables.into_iter().find(|table| table.kind == kind.name && table.joint == joint)?;
        let interval = |name: &str| -> Option<[f64; 2]> {
            let parameter = match name {
                "mass" => ModelParameter::Payload,
                "scale" => ModelParameter::LinkMass,
                "offset" => ModelParameter::Zero,
                "gap" => ModelParameter::Gap,
                "roll" => ModelParameter::Roll,
                "pitch" => ModelParameter::Pitch,
                _ => return None,
            };
            let at = numbers.iter().find(|at| self.numbers.unknowns[**at].parameter == parameter)?;
            let (value, deviation) = fitted.values[*at];
            if parameter == ModelParameter::LinkMass {
                return Some(around(value, deviation).map(f64::exp));
            }
            let is_payload = parameter == ModelParameter::Payload;
            let hidden = if is_payload {
                self.numbers.payload_tolerance(value, &self.settings.tolerances)
            } else {
                0.0
            };
            Some(around(value, deviation.hypot(hidden)))
        };
        let parameter = |(name, value): (String, Value)| {
            let (unit, ci95) = (kind.unit(&name, None).to_owned(), interval(&name));
            (name, Parameter { value, unit, ci95 })
        };
        let parameters: BTreeMap<String, Parameter> = table.parameters.into_iter().map(parameter).collect();
        let without = self.left_by(&fitted.with(self.numbers.unknowns, strongest, 0.0), clean);
        let joints = self.joints();
        let square = |of: &Deviations| rms(of, clean, &joints).powi(2);
        let phrase = phrase(kind, &parameters);
        Some(Effect {
            kind: kind.name,
            equation: kind.equation,
            source: kind.source,
            evidence: Evidence {
                log_odds: evidence,
                odds: odds(evidence),
                share: (square(&without) - square(&self.after)).max(0.0),
                held_out_gain: gain([&without, &self.after], clean, &joints, self.tracks, self.settings.seed),
                held_out: true,
                channels: joints.iter().map(|joint| Group::Position.column(*joint)).collect(),
            },
            statement: format!(
                "{} The dependence of the joints' droop on the pose identifies it.",
                statement(&phrase, joint.as_deref())
            ),
            phrase,
            parameters,
            joint,
        })
    }

    /// Log odds of `burdened`, which has the unknowns `numbers`, if the data support it, and the strongest of these unknowns.
    fn told_burden(&self, burdened: &Burdened, numbers: &[usize]) -> Option<(f64, usize)> {
        let fitted = self.numbers.fitted;
        let distance = |index: usize| self.numbers.distance(index, 0.0, &self.settings.tolerances);
        if let Some(changes) = self.changes {
            let change = changes.iter().find(|change| burdened.unknowns.iter().any(|one| change.has(one)))?;
            let strongest = numbers.iter().copied().max_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
            let evidence = change.evidence.min(self.odds_of_distance(strongest, 0.0));
            return (evidence > named_from(self.moves.len())).then_some((evidence, strongest));
        }
        let here = lost(self.choice, &fitted.model, &fitted.noise);
        let evidence = |index: usize| {
            let without = fitted.with(self.numbers.unknowns, index, 0.0);
            0.5 * distance(index).min(CERTAIN).powi(2) + lost(self.choice, &without, &fitted.noise) - here
        };
        // As in any finding, the parameter must lie beyond the deviation of the fit.
        let told = numbers.iter().copied().filter(|index| distance(*index) > self.numbers.named_from());
        let best = told.map(|index| (evidence(index), index)).max_by(|a, b| a.0.total_cmp(&b.0));
        best.filter(|(evidence, _)| *evidence > named_from(self.moves.len()))
    }

    /// The causes that the recordings don't distinguish from `burdened`.
    fn rivals(&self, burdened: &Burdened) -> Vec<Alternative> {
        let name = |joint: usize| self.numbers.file.arm.joints()[joint].name.clone();
        let instead_of = format!("{} {}", burdened.kind, site(burdened.joint.map(name).as_deref()));
        let one = |rival: &Rival| Alternative {
            kind: rival.kind,
            joint: rival.joint.map(name),
            instead_of: instead_of.clone(),
            why_not: "it explains the recordings as well".to_owned(),
            indistinguishable: true,
            what_would_separate: TO_SEPARATE.to_owned(),
            log_odds_against: rival.against,
        };
        burdened.rivals.iter().map(one).collect()
    }

    /// The model without `finding`, all other parameters refitted; `None` for the servo itself.
    fn model_without(&self, finding: &Finding) -> Option<ServoArm> {
        let (parameter, value) = finding.absent?;
        let index = self.numbers.index(finding.joint, parameter)?;
        Some(self.numbers.fitted.with(self.numbers.unknowns, index, value))
    }

    /// Residuals of `model` in the recordings of `parts`.
    fn left_by(&self, model: &ServoArm, parts: &[Rows]) -> Deviations {
        let of_track = |(index, track): (usize, &Track)| {
            let judges = parts.iter().any(|(judging, _)| *judging == index);
            if judges { deviations(track, &simulated(model, track)) } else { Vec::new() }
        };
        self.tracks.iter().enumerate().map(of_track).collect()
    }

    pub(super) fn name_of(&self, recording: usize) -> String {
        let origin = &self.recordings[recording].origin;
        origin.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }

    pub(super) fn joints(&self) -> Vec<usize> {
        (0..self.moves.len()).collect()
    }

    fn statement(&self, effects: &[Effect], clean: &[Rows]) -> String {
        let joints = self.joints();
        let of = |deviations: &Deviations| 1e3 * rms(deviations, clean, &joints);
        let (before, lagged, after) = (of(&self.before), of(&self.lagged), of(&self.after));
        let given = if self.given.is_some() { "the model as given" } else { "the command itself" };
        let numbers = format!(
            "On {}, the measured positions deviate by {after:.1} mrad RMS from the simulated servos, by {lagged:.1} from the delayed command and by {before:.1} from {given}.",
            self.parts.words
        );
        let lags: Vec<String> = self
            .numbers
            .file
            .arm
            .joints()
            .iter()
            .zip(self.sights)
            .zip(self.moves)
            .filter(|(_, moves)| **moves)
            .map(|((joint, sight), _)| format!("{} {:.0} ms", joint.name, 1e3 * sight.lag))
            .collect();
        let lag = format!("Lag of the measured positions behind the commanded ones: {}.", lags.join(", "));
        if effects.is_empty() {
            return format!("The servos of the model explain the recordings. {lag} {numbers}");
        }
        format!("{lag} {numbers} Named: {}.", summary(effects))
    }

    fn location(&self, clean: &[Rows]) -> Vec<Location> {
        let all: f64 = self.joints().iter().map(|joint| rms(&self.before, clean, &[*joint]).powi(2)).sum();
        let of_joint = |joint: usize| {
            let square = rms(&self.before, clean, &[joint]).powi(2);
            let when = self.events.iter().filter(|event| concerns(event, joint)).map(|event| {
                format!("{:.1} to {:.1} s of {}", event.time[0], event.time[1], self.name_of(event.recording))
            });
            let when: Vec<String> = when.collect();
            let place = if when.is_empty() {
                format!("in all its motion: {:.0} ms late", 1e3 * self.sights[joint].lag)
            } else {
                format!("in all its motion; away from its servo's position from {}", when.join(", "))
            };
            Location {
                joint: Some(self.numbers.file.arm.joints()[joint].name.clone()),
                channels: vec![Group::Position.column(joint)],
                share: if all > 0.0 { square / all } else { 0.0 },
                when: place,
                p: 0.0,
            }
        };
        let mut locations: Vec<Location> =
            self.joints().into_iter().filter(|joint| self.moves[*joint]).map(of_joint).collect();
        sort_falling(&mut locations, |location| location.share);
        locations
    }

    fn fit(&self, clean: &[Rows]) -> Fit {
        let joints = self.joints();
        let floor =
            |joint: usize| (Group::Position.column(joint), Rmse { rmse: rounding(self.sights[joint].tick) });
        let gain_of =
            |model: &Deviations| gain([&self.before, model], clean, &joints, self.tracks, self.settings.seed);
        let without = if clean.len() > self.parts.test.len() { ", without contacts and stops" } else { "" };
        Fit {
            noise_floor: joints.iter().map(|joint| floor(*joint)).collect(),
            before: errors(&self.before, clean),
            after: errors(&self.after, clean),
            retuned: errors(&self.lagged, clean),
            after_as_given: errors(&self.after, clean),
            black_box: errors(&self.filtered, clean),
            held_out: true,
            test: format!("{}{without}", self.parts.words),
            gain: Some(gain_of(&self.after)),
            black_box_gain: Some(gain_of(&self.filtered)),
            units: joints
                .iter()
                .map(|joint| {
                    (Group::Position.column(*joint), unit(self.numbers.file.arm.joints()[*joint].kind))
                })
                .collect(),
        }
    }

    fn next(&self) -> Vec<String> {
        let names: Vec<&str> = self
            .joints()
            .into_iter()
            .filter(|joint| self.moves[*joint] && !self.numbers.is_known(*joint))
            .map(|joint| self.numbers.file.arm.joints()[joint].name.as_str())
            .collect();
        let mut next = Vec::new();
        if !names.is_empty() {
            next.push(format!(
                "to determine the stiffness of {} in N·m/rad, hang a known weight on a lever there, or lay the arm on its side",
                names.join(", ")
            ));
        }
        next
    }

    fn quality(&self) -> Vec<String> {
        let mut notes: Vec<String> = Vec::new();
        for note in self.recordings.iter().flat_map(|recording| &recording.notes) {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
        let fitted = self.numbers.fitted;
        notes.push(format!(
            "the fit of the servos to simulations from the commanded positions took {} steps; the test used {}",
            fitted.steps, self.parts.words
        ));
        notes
    }

    /// Servos of the joints that never move, with the initial values of the fit, so that the model can be simulated.
    fn servos_of_joints_at_rest(&self) -> Vec<EffectTable> {
        let file = self.numbers.file;
        let has = |name: &str| {
            file.effects.iter().any(|table| table.kind == "servo" && table.joint.as_deref() == Some(name))
        };
        let table = |joint: usize| {
            let servo = &self.numbers.fitted.model.joints[joint];
            let numbers = [("stiffness", servo.stiffness), ("damping", servo.damping)];
            EffectTable {
                kind: "servo".to_owned(),
                joint: Some(file.arm.joints()[joint].name.clone()),
                parameters: numbers.into_iter().map(|(name, x)| (name.to_owned(), Value::Float(x))).collect(),
                line: 0,
            }
        };
        let resting = self.joints().into_iter().filter(|joint| !self.moves[*joint]);
        resting.filter(|joint| !has(&file.arm.joints()[*joint].name)).map(table).collect()
    }
}

fn concerns(event: &Event, of: usize) -> bool {
    match &event.what {
        What::Stop { joint, .. } => *joint == of,
        What::Contact { joints, .. } => joints.contains(&of),
    }
}

/// The kinds of `effects` with their counts: `position servo at 5 joints, contact`.
pub fn summary(effects: &[Effect]) -> String {
    let mut counts: Vec<(&str, bool, usize)> = Vec::new();
    for effect in effects {
        match counts.iter_mut().find(|(kind, ..)| *kind == effect.kind) {
            Some((.., count)) => *count += 1,
            None => counts.push((effect.kind, effect.joint.is_some(), 1)),
        }
    }
    let words = counts.into_iter().map(|(name, of_joint, count)| match (known(name).title, count) {
        (title, 1) => title.to_owned(),
        (title, count) if of_joint => format!("{title} at {count} joints"),
        (title, count) => format!("{title} ({count} times)"),
    });
    words.collect::<Vec<_>>().join(", ")
}

/// Sets the share of each of `effects` in the removed squared error. Before the call, the share holds the effect's own squares; the effects of a channel divide
/// its reduction in proportion to them.
pub fn share_out(effects: &mut Vec<Effect>, fit: &Fit) {
    let gone = |channel: &String| -> f64 {
        let square =
            |table: &BTreeMap<String, Rmse>| table.get(channel).map_or(0.0, |error| error.rmse.powi(2));
        (square(&fit.before) - square(&fit.after)).max(0.0)
    };
    let all: f64 = fit.before.keys().map(gone).sum();
    let mut whole: BTreeMap<String, f64> = BTreeMap::new();
    for effect in &*effects {
        for channel in &effect.evidence.channels {
            *whole.entry(channel.clone()).or_default() += effect.evidence.share;
        }
    }
    for effect in &mut *effects {
        let own = effect.evidence.share;
        let of_channel = |channel: &String| {
            let whole = whole.get(channel).copied().unwrap_or_default();
            if whole > 0.0 && all > 0.0 { gone(channel) * own / whole / all } else { 0.0 }
        };
        effect.evidence.share = effect.evidence.channels.iter().map(of_channel).sum();
    }
    sort_falling(effects, |effect| effect.evidence.share);
}
