//! The result for servos next to that from torques: findings, position errors, and the model that contains them.

use std::collections::BTreeMap;

use freeplay_arm::JointKind;
use freeplay_model::{ArmFile, EffectTable};
use freeplay_recording::{Group, Recording};
use freeplay_servo::{ServoArm, Sight, Track, servos};
use toml::{Table, Value};

use super::beside_torque::Laws;
use super::compare::unit;
use super::conclude::{share_out, summary};
use super::diagnose::deviations_of;
use super::findings::{CERTAIN, around, distance, known, named_from};
use super::parts::{Parts, rounding};
use super::scores::{Deviations, errors, gain, rms};
use super::torque_law::TorqueLaw;
use crate::data::tolerance::Tolerances;
use crate::report::diagnosis::{Diagnosis, Effect, Evidence, Fit, Parameter, Passage, Rmse, Trace, Verdict};
use crate::report::settings::DiagnoseSettings;
use crate::report::words::{odds, phrase, statement};

/// An effect that the laws describe.
pub struct Finding {
    kind: &'static str,
    joint: usize,
    parameters: BTreeMap<String, Parameter>,
    table: EffectTable,
    remark: String,
    /// Standard deviations from the known value.
    distance: f64,
    /// True if the distance suffices for a name; otherwise the effect only sets a parameter of the model.
    is_named: bool,
}

/// The findings on the servos from `laws`; an effect that `file` lacks within its `tolerances` is named.
pub fn findings(file: &ArmFile, laws: &Laws, tolerances: &Tolerances) -> Vec<Finding> {
    let least = (2.0 * named_from(laws.of_joint.len())).sqrt();
    let both = |(joint, law): (usize, &Option<TorqueLaw>)| {
        let of_joint = law.as_ref().map(|law| {
            let late = laws.growth[joint] * laws.deviation;
            [servo(file, joint, law, tolerances), delay(file, joint, law, late, tolerances)]
        });
        of_joint.into_iter().flatten().collect::<Vec<Finding>>()
    };
    let all = laws.of_joint.iter().enumerate().flat_map(both);
    all.map(|finding| Finding { is_named: finding.distance > least, ..finding }).collect()
}

fn servo(file: &ArmFile, joint: usize, law: &TorqueLaw, tolerances: &Tolerances) -> Finding {
    let (k, c) = (law.stiffness, law.damping);
    let given = |name: &str| number(table_of(file, "servo", joint)?, name);
    let distance_from = |old: f64| {
        let damping = given("damping").unwrap_or(0.0);
        let of_stiffness = (k.0 / old).ln().abs() / (k.1 / k.0).hypot(tolerances.friction);
        let of_damping = (c.0 - damping).abs() / c.1.hypot(tolerances.friction * damping);
        of_stiffness.max(of_damping)
    };
    let kind = file.arm.joints()[joint].kind;
    let unit = if kind == JointKind::Revolute { "N·m" } else { "N" };
    let droop = distance(kind, 1.0 / k.0, None);
    let numbers = [("stiffness", k.0, around(k.0, k.1)), ("damping", c.0.max(0.0), around(c.0, c.1))];
    Finding {
        remark: format!("A load of 1 {unit} makes it droop by {droop}."),
        distance: given("stiffness").map_or(CERTAIN, distance_from),
        ..finding(file, "servo", joint, &numbers)
    }
}

/// The delay of commands; the delay of the encoders makes it uncertain by `late` s.
fn delay(file: &ArmFile, joint: usize, law: &TorqueLaw, late: f64, tolerances: &Tolerances) -> Finding {
    let (delay, deviation) = (law.delay.0, law.delay.1.hypot(late));
    let given = delay_of(file, joint);
    // An effect can't precede its cause: a negative delay only reflects the order of rows and stamps.
    let off = (delay.max(0.0) - given).abs();
    let numbers = [("delay", delay.max(0.0), around(delay, deviation))];
    Finding {
        distance: off / deviation.hypot(tolerances.delay),
        ..finding(file, "command_delay", joint, &numbers)
    }
}

/// Delay of commands in `file` at `joint`, s.
pub fn delay_of(file: &ArmFile, joint: usize) -> f64 {
    let table = table_of(file, "command_delay", joint);
    table.and_then(|table| number(table, "delay")).unwrap_or(0.0)
}

fn finding(
    file: &ArmFile,
    name: &'static str,
    joint: usize,
    numbers: &[(&'static str, f64, [f64; 2])],
) -> Finding {
    let (kind, at) = (known(name), &file.arm.joints()[joint]);
    let parameter = |&(name, value, ci95): &(&'static str, f64, [f64; 2])| {
        let unit = kind.unit(name, Some(at)).to_owned();
        (name.to_owned(), Parameter { value: Value::Float(value), unit, ci95: Some(ci95) })
    };
    // A given servo keeps its parameters that the law does not have: limits, dead band, resolution.
    let mut table = table_of(file, name, joint).cloned().unwrap_or_else(|| empty(file, name, joint));
    table
        .parameters
        .extend(numbers.iter().map(|(name, value, _)| ((*name).to_owned(), Value::Float(*value))));
    Finding {
        kind: name,
        joint,
        parameters: numbers.iter().map(parameter).collect(),
        table,
        remark: String::new(),
        distance: 0.0,
        is_named: false,
    }
}

fn empty(file: &ArmFile, kind: &str, joint: usize) -> EffectTable {
    let name = file.arm.joints()[joint].name.clone();
    EffectTable { kind: kind.to_owned(), joint: Some(name), parameters: Table::new(), line: 0 }
}

/// The number `name` of `table`, which a file may write as an integer.
pub fn number(table: &EffectTable, name: &str) -> Option<f64> {
    let value = table.parameters.get(name)?;
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// The table of `file` of the effect `kind` at `joint`.
fn table_of<'f>(file: &'f ArmFile, kind: &str, joint: usize) -> Option<&'f EffectTable> {
    let name = &file.arm.joints()[joint].name;
    file.effects.iter().find(|table| table.kind == kind && table.joint.as_ref() == Some(name))
}

/// `model` with the named `findings`, each replacing the model's effect of the same kind. Joints at rest get default servos, by `sights`, so that the arm can
/// be simulated.
pub fn with_servos(model: &ArmFile, findings: &[Finding], laws: &Laws, sights: &[Sight]) -> ArmFile {
    let mut model = model.clone();
    for finding in findings {
        let is_delay = finding.kind == "command_delay";
        if !finding.is_named && (is_delay || table_of(&model, finding.kind, finding.joint).is_some()) {
            continue;
        }
        model.effects.retain(|table| table.kind != finding.kind || table.joint != finding.table.joint);
        model.effects.push(finding.table.clone());
    }
    // If the data don't separate delay and lag, each gets one half.
    let any = servos(&model.arm, sights, &vec![0.5; sights.len()]);
    for (joint, servo) in any.iter().enumerate() {
        if laws.of_joint[joint].is_none() && table_of(&model, "servo", joint).is_none() {
            let mut table = empty(&model, "servo", joint);
            let numbers = [("stiffness", servo.stiffness), ("damping", servo.damping)];
            table.parameters.extend(numbers.map(|(name, x)| (name.to_owned(), Value::Float(x))));
            model.effects.push(table);
        }
    }
    model
}

/// The servos and their position residuals: measured minus the model as given, a plain lag, nameless filters, the identified servos.
pub struct Simulated<'a> {
    pub file: &'a ArmFile,
    pub recordings: &'a [Recording],
    pub tracks: &'a [Track],
    pub parts: &'a Parts,
    pub sights: &'a [Sight],
    pub settings: &'a DiagnoseSettings,
    /// Joints whose command moves.
    pub joints: Vec<usize>,
    pub servos: ServoArm,
    pub before: Deviations,
    pub lagged: Deviations,
    pub filtered: Deviations,
    pub after: Deviations,
}

impl Simulated<'_> {
    /// Adds `findings` and the position errors to `diagnosis`.
    pub fn add_to(&self, diagnosis: &mut Diagnosis, findings: &[Finding]) {
        let fit = self.fit();
        let mut effects: Vec<Effect> =
            findings.iter().filter(|finding| finding.is_named).map(|finding| self.effect(finding)).collect();
        share_out(&mut effects, &fit);
        diagnosis.statement = self.statement(diagnosis, &effects);
        if diagnosis.verdict == Verdict::NothingMissing && !effects.is_empty() {
            diagnosis.verdict = Verdict::Named;
        }
        diagnosis.effects.extend(effects);
        if let Some(of_torque) = &mut diagnosis.fit {
            of_torque.noise_floor.extend(fit.noise_floor);
            of_torque.before.extend(fit.before);
            of_torque.after.extend(fit.after);
            of_torque.retuned.extend(fit.retuned);
            of_torque.after_as_given.extend(fit.after_as_given);
            of_torque.black_box.extend(fit.black_box);
            of_torque.units.extend(fit.units);
        }
        diagnosis.passages.iter_mut().for_each(|passage| self.draw(passage));
        diagnosis.quality.push(
            "the servos found simulate the positions from the commanded ones; in the rows of positions, \"re-tuned\" is the delayed command and \"black box\" a linear filter of the commands"
                .to_owned(),
        );
    }

    fn effect(&self, finding: &Finding) -> Effect {
        let (joints, test) = ([finding.joint], &self.parts.test);
        let without = (finding.kind == "command_delay").then(|| {
            let mut servos = self.servos.clone();
            let delay = number(&finding.table, "delay").unwrap_or(0.0);
            servos.joints[finding.joint].delay -= delay;
            deviations_of(&servos, self.tracks)
        });
        let without = without.as_ref().unwrap_or(&self.before);
        let square = |of: &Deviations| rms(of, test, &joints).powi(2);
        let kind = known(finding.kind);
        let joint = Some(self.file.arm.joints()[finding.joint].name.clone());
        let phrase = phrase(kind, &finding.parameters);
        let log_odds = 0.5 * finding.distance.min(CERTAIN).powi(2);
        let evidence = Evidence {
            log_odds,
            odds: odds(log_odds),
            share: (square(without) - square(&self.after)).max(0.0),
            held_out_gain: gain([without, &self.after], test, &joints, self.tracks, self.settings.seed),
            held_out: true,
            channels: vec![Group::Position.column(finding.joint)],
        };
        Effect {
            kind: kind.name,
            parameters: finding.parameters.clone(),
            equation: kind.equation,
            source: kind.source,
            evidence,
            statement: format!("{} {}", statement(&phrase, joint.as_deref()), finding.remark)
                .trim_end()
                .to_owned(),
            phrase,
            joint,
        }
    }

    fn statement(&self, diagnosis: &Diagnosis, effects: &[Effect]) -> String {
        let of = |deviations: &Deviations| 1e3 * rms(deviations, &self.parts.test, &self.joints);
        let torque = match diagnosis.verdict {
            Verdict::NothingMissing if !effects.is_empty() => {
                "The torques agree with the model within its tolerances."
            }
            _ => &diagnosis.statement,
        };
        let unit =
            if self.joints.iter().all(|joint| self.file.arm.joints()[*joint].kind == JointKind::Prismatic) {
                "mm"
            } else {
                "mrad"
            };
        let named = if effects.is_empty() {
            "The servos of the model produce these torques from the commands.".to_owned()
        } else {
            format!("Servos produce these torques from the commands: {}.", summary(effects))
        };
        let numbers = format!(
            "On {}, the measured positions deviate by {:.3} {unit} RMS from those simulated from the commands and by {:.3} from the delayed command.",
            self.parts.words,
            of(&self.after),
            of(&self.lagged)
        );
        format!("{torque} {named} {numbers}")
    }

    /// Position errors of the joints whose command moves.
    fn fit(&self) -> Fit {
        let test = &self.parts.test;
        let of_moving = |deviations: &Deviations| -> BTreeMap<String, Rmse> {
            let mut all = errors(deviations, test);
            all.retain(|channel, _| {
                self.joints.iter().any(|joint| Group::Position.column(*joint) == *channel)
            });
            all
        };
        let floor = |joint: &usize| {
            (Group::Position.column(*joint), Rmse { rmse: rounding(self.sights[*joint].tick) })
        };
        let units =
            |joint: &usize| (Group::Position.column(*joint), unit(self.file.arm.joints()[*joint].kind));
        Fit {
            noise_floor: self.joints.iter().map(floor).collect(),
            before: of_moving(&self.before),
            after: of_moving(&self.after),
            retuned: of_moving(&self.lagged),
            after_as_given: of_moving(&self.after),
            black_box: of_moving(&self.filtered),
            held_out: true,
            test: self.parts.words.clone(),
            gain: None,
            black_box_gain: None,
            units: self.joints.iter().map(units).collect(),
        }
    }

    /// Adds the positions to the traces of `passage`.
    fn draw(&self, passage: &mut Passage) {
        let is_of = |recording: &Recording| {
            recording.origin.file_name().is_some_and(|name| name.to_string_lossy() == passage.recording)
        };
        let Some(index) = self.recordings.iter().position(is_of) else { return };
        let track = &self.tracks[index];
        let t = &passage.motion.t;
        let between =
            |column: &Vec<f64>| -> Vec<f64> { t.iter().map(|t| at(&track.stamps, column, *t)).collect() };
        let trace = |joint: &usize| {
            let of = |deviations: &Deviations| between(&deviations[index][*joint]);
            Trace {
                channel: Group::Position.column(*joint),
                unit: unit(self.file.arm.joints()[*joint].kind),
                measured: between(&track.measured[*joint]),
                before: of(&self.before),
                retuned: of(&self.lagged),
                after: of(&self.after),
                unnamed: of(&self.filtered),
                laws: Vec::new(),
            }
        };
        let traces: Vec<Trace> = self.joints.iter().map(trace).collect();
        passage.traces.extend(traces);
    }
}

/// `column` at the time `t` by linear interpolation between `stamps`.
fn at(stamps: &[f64], column: &[f64], t: f64) -> f64 {
    let after = stamps.partition_point(|stamp| *stamp < t).clamp(1, stamps.len() - 1);
    let share = ((t - stamps[after - 1]) / (stamps[after] - stamps[after - 1])).clamp(0.0, 1.0);
    column[after - 1] + share * (column[after] - column[after - 1])
}
