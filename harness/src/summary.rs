//! `summary.json` of a run: schema `freeplay.summary/1`.

use std::collections::BTreeMap;

use freeplay_plant::{ControllerManager, Deadlines, Deviation, Ending, Plant, Rejection, Stage, Stages};
use freeplay_shm::realtime::RtReport;
use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::verdict;

/// The schema of `summary.json`.
pub const SCHEMA: &str = "freeplay.summary/1";

/// Results of one run of one controller; the plant's process writes them, `freeplay run` reads them.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RunSummary {
    /// Requested name of the controller.
    pub controller: String,
    /// Name of the run's files.
    pub files: String,
    /// "lockstep" or "realtime".
    pub pace: String,
    /// Number of simulated ticks.
    pub ticks: u64,
    /// End of the run.
    pub ending: Value,
    /// "passed", "failed" or "interrupted".
    #[serde(default)]
    pub verdict: String,
    /// The violated rules.
    #[serde(default)]
    pub failures: Vec<Value>,
    /// Cause of a stop of the arm: reason, quantity, joint, value, limit, unit and tick; null without a stop.
    #[serde(default)]
    pub stopped: Value,
    /// SHA-256 of every State and Command.
    pub state_hash: String,
    /// The tool's deviation, mm.
    pub deviation_mm: Value,
    /// Contact in each joint with play.
    pub contact: Value,
    /// The force of the base on the first moving body, N.
    #[serde(rename = "base_force_N")]
    pub base_force: Value,
    /// Use of the drives, joint by joint: greatest speed, acceleration and torque, the limits and the shares of them.
    pub joint_use: Value,
    /// Energies, J.
    #[serde(rename = "energy_J")]
    pub energy: Value,
    /// Numbers of answers of the active controllers by status.
    pub answers: Value,
    /// Reach of the learned remainder along the path; null for a controller without one.
    #[serde(default)]
    pub learned: Value,
    /// Ticks without a command in time.
    pub deadlines: Value,
    /// Rejections: answers of the active controllers by the gate, and commands for any slot from a process without its seat.
    pub gate: Value,
    /// The controllers with the rejections of each gate, and every change of the active controller.
    pub line_up: Value,
    /// Latencies of each stage, µs.
    pub latency_us: BTreeMap<String, Value>,
    /// Results of the requests to the operating system.
    pub realtime: Value,
    /// File name of the recording, if there is one.
    pub recording: Option<String>,
    /// Texts on problems outside the run.
    pub notes: Vec<String>,
}

fn deviation(component: &Deviation) -> Value {
    json!({
        "rms": component.rms, "max": component.max, "mean": component.mean, "std": component.std,
        "rms_after_start": component.rms_after_start, "max_after_start": component.max_after_start,
    })
}

fn deviations(plant: &Plant) -> Value {
    let [norm, x, y, z] = plant.tool_deviation().components();
    let mut value = deviation(&norm);
    value["axes"] = json!({ "x": deviation(&x), "y": deviation(&y), "z": deviation(&z) });
    value
}

fn contacts(plant: &Plant, plays: &[String]) -> Value {
    let joints: serde_json::Map<String, Value> = plays
        .iter()
        .zip(plant.system().tallies())
        .map(|(joint, tally)| {
            let [free, impact, continuous] = tally.fractions();
            let value = json!({
                "free": free, "impact": impact, "continuous": continuous,
                "contacts": tally.contacts, "impacts": tally.impacts,
                "first_speed_m_s": tally.first_speed, "peak_speed_m_s": tally.peak_speed,
                "peak_normal_force_N": tally.peak_normal_force, "peak_penetration_um": tally.peak_penetration * 1e6,
            });
            (joint.clone(), value)
        })
        .collect();
    json!({ "joints": joints })
}

fn joint_use(plant: &Plant, joints: &[String]) -> Value {
    let used = joints.iter().zip(plant.joint_use().joints());
    let each: serde_json::Map<String, Value> =
        used.map(|(joint, used)| (joint.clone(), json!(used))).collect();
    json!(each)
}

fn deadlines(plant: &Plant) -> Value {
    let (counts, line_up): (Deadlines, &ControllerManager) = (plant.missed_deadlines(), plant.manager());
    let silent = counts.missed.saturating_sub(counts.late);
    let by_cause = json!({
        "late_answer": counts.late, "no_answer": silent, "plant_late": counts.plant_late,
        "rejected": Rejection::ALL.iter().skip(1).map(|&reason| line_up.rejected(reason)).sum::<u64>(),
    });
    let mut value = json!({ "missed": counts.missed, "late": counts.late, "plant_late": counts.plant_late,
            "unrecorded": counts.unrecorded, "by_cause": by_cause });
    if let Some(misses) = plant.misses() {
        let counts = misses.counts().filter(|(_, count)| *count > 0);
        let counts: serde_json::Map<String, Value> =
            counts.map(|(cause, count)| (cause.name().to_owned(), json!(count))).collect();
        (value["by_evidence"], value["first"]) = (json!(counts), json!(misses.listed()));
        value["stalls"] = json!(misses.stalls());
    }
    value
}

/// The controllers by slot, and the swaps; joint values without the unused entries.
fn line_up(plant: &Plant, names: &[String]) -> Value {
    let (line_up, joints) = (plant.manager(), plant.joints());
    let controllers: Vec<Value> = names
        .iter()
        .enumerate()
        .map(|(slot, name)| {
            let refused = Rejection::ALL.iter().map(|&reason| (reason, line_up.gate(slot).rejected(reason)));
            let refused: serde_json::Map<String, Value> = refused
                .filter(|(_, count)| *count > 0)
                .map(|(reason, count)| (reason.name().to_owned(), json!(count)))
                .collect();
            json!({ "name": name, "ticks_in_charge": line_up.active_ticks(slot), "rejected": refused })
        })
        .collect();
    let name = |slot: usize| names.get(slot).map_or("?", String::as_str);
    let swaps: Vec<Value> = line_up
        .swaps()
        .iter()
        .map(|swap| {
            json!({
                "tick": swap.tick, "from": name(swap.from), "to": name(swap.to), "cause": swap.cause,
                "gap_ticks": swap.gap, "held_ticks": swap.held,
                "jump": swap.jump[..joints], "greatest_change": swap.greatest_change[..joints],
            })
        })
        .collect();
    json!({
        "controllers": controllers, "steady_change": line_up.steady_change()[..joints],
        "greatest_difference": line_up.greatest_difference()[..joints],
        "swaps": swaps, "unlisted_swaps": line_up.unlisted(),
    })
}

/// Quantiles, maximum and count of a histogram of ns, in µs.
pub fn percentiles(histogram: &Histogram<u64>) -> Value {
    let us = |ns: u64| ns as f64 * 1e-3;
    json!({
        "p50": us(histogram.value_at_quantile(0.5)), "p90": us(histogram.value_at_quantile(0.9)),
        "p99": us(histogram.value_at_quantile(0.99)), "p99.9": us(histogram.value_at_quantile(0.999)),
        "max": us(histogram.max()), "count": histogram.len(),
    })
}

fn latencies(stages: &Stages) -> BTreeMap<String, Value> {
    Stage::ALL
        .iter()
        .map(|&stage| (stage, stages.histogram(stage)))
        .filter(|(_, histogram)| !histogram.is_empty())
        .map(|(stage, histogram)| (stage.name().to_owned(), percentiles(histogram)))
        .collect()
}

/// Data of a run that the plant itself does not have.
pub struct RunFacts {
    /// Requested name of the controller.
    pub controller: String,
    /// Names of the controllers by slot.
    pub controllers: Vec<String>,
    /// "lockstep" or "realtime".
    pub pace: String,
    /// Number of simulated ticks.
    pub ticks: u64,
    /// End of the run.
    pub ending: Ending,
    /// Hash of all States and Commands.
    pub state_hash: String,
    /// All joints.
    pub joints: Vec<String>,
    /// Joints with play.
    pub plays: Vec<String>,
    /// Results of the requests to the operating system.
    pub realtime: RtReport,
    /// File name of the recording.
    pub recording: Option<String>,
    /// Texts on problems outside the run.
    pub notes: Vec<String>,
}

impl RunSummary {
    /// The summary of the run of `plant`.
    pub fn new(plant: &Plant, facts: RunFacts) -> Self {
        let mut gate: serde_json::Map<String, Value> = Rejection::ALL
            .iter()
            .map(|&reason| (reason.name().to_owned(), json!(plant.manager().rejected(reason))))
            .collect();
        let foreign: u64 = (0..plant.manager().len()).map(|slot| plant.foreign(slot).commands).sum();
        gate.insert("foreign".to_owned(), json!(foreign));
        let ledger = plant.system().ledger();
        let joints = plant.arm().joints();
        let first =
            plant.manager().first_refusal().map(|first| verdict::refused(first, joints, &facts.controllers));
        let torque_rate = &plant.reflex_limits().torque_rate[..joints.len()];
        let (verdict, failures) = verdict::verdict(plant, facts.ending);
        Self {
            files: facts.controller.clone(),
            controller: facts.controller,
            pace: facts.pace,
            ticks: facts.ticks,
            ending: json!(facts.ending),
            verdict: verdict.to_owned(),
            failures,
            stopped: json!(plant.stopped().map(|stop| verdict::stopped(stop, joints))),
            state_hash: facts.state_hash,
            deviation_mm: deviations(plant),
            contact: contacts(plant, &facts.plays),
            base_force: json!({ "peak": plant.peak_base_force() }),
            joint_use: joint_use(plant, &facts.joints),
            answers: json!(plant.answers()),
            learned: Value::Null,
            energy: json!({ "ledger": ledger, "residual": ledger.residual() }),
            deadlines: deadlines(plant),
            gate: json!({ "rejected": gate, "first": first, "torque_rate": torque_rate }),
            line_up: line_up(plant, &facts.controllers),
            latency_us: latencies(plant.stages()),
            realtime: json!(facts.realtime),
            recording: facts.recording,
            notes: facts.notes,
        }
    }
}
