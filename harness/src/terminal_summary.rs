//! The summary of a run in the terminal.

use std::fmt::Write as _;
use std::path::Path;

use comfy_table::{CellAlignment, ColumnConstraint, Table};
use serde_json::Value;

use crate::plant_command::pace_name;
use crate::scenario::{Pacing, Scenario};
use crate::setup::Setup;
use crate::summary::RunSummary;
use crate::verdict::{failure_words, limit_words};
use freeplay_report::paste::shell_word;
use freeplay_terminal::flags::is_quiet;
use freeplay_terminal::layout::text_table;

/// Name of the rejection of a missing answer.
const MISSING: &str = "missing";
/// Largest number of fail-overs listed one by one.
const LISTED_FAIL_OVERS: usize = 10;

/// The result of `freeplay run` as text with one table.
pub fn table(scenario: &Scenario, setup: &Setup, runs: &[RunSummary], out: &Path, report: &Path) -> String {
    let mut text = heading(scenario, setup) + "\n";
    for note in &setup.truth.ignored {
        let _ = writeln!(text, "{note}");
    }
    for line in machine_lines(runs) {
        let _ = writeln!(text, "{line}");
    }
    let _ = writeln!(text, "\n{}", results(setup, runs));
    let _ = writeln!(
        text,
        "deviation: true tool minus the tool of a perfect arm at the desired joints; rms, max and z after the first 0.5 s"
    );
    if !setup.plant.effects.clearances.is_empty() {
        let _ = writeln!(text, "(no controller can compensate the drop of a centred journal)");
    }
    text.push('\n');
    for run in runs.iter().filter(|run| run.deviation_mm["rms_after_start"].is_number()) {
        let _ = writeln!(text, "{}", drives(run));
    }
    for run in runs {
        for note in remarks(run).into_iter().chain(bounces(scenario, run)) {
            let _ = writeln!(text, "{}: {note}", run.controller);
        }
    }
    let _ = writeln!(text, "report      {}", shell_word(report));
    let _ = writeln!(text, "summary     {}", shell_word(&out.join("summary.json")));
    if let Some(run) = runs.last() {
        if let Some(recording) = &run.recording {
            let others = if runs.len() > 1 { "   (each controller has its own)" } else { "" };
            let _ = writeln!(text, "recording   {}{others}", shell_word(&out.join(recording)));
        }
        let _ = writeln!(text, "latencies   {}/*.hlog, *.hgrm", shell_word(out));
    }
    if is_quiet() { text } else { text + &next(scenario, runs, out) }
}

/// Suggested next commands, with the same arm, path and settings.
fn next(scenario: &Scenario, runs: &[RunSummary], out: &Path) -> String {
    let file = shell_word(&out.join("scenario.toml"));
    let pace = match scenario.pace {
        Pacing::Lockstep => "realtime",
        Pacing::Realtime => "lockstep",
    };
    let mut lines = vec![format!("freeplay run {file} --pace {pace}")];
    if let Some(run) = runs.last() {
        let controller = shell_word(Path::new(&run.controller));
        lines.push(format!("freeplay faults {controller} --scenario {file}"));
    }
    lines.push("freeplay doctor".to_owned());
    let label = |(number, line): (usize, &String)| {
        let label = if number == 0 { "next" } else { "" };
        format!("{label:12}{line}\n")
    };
    lines.iter().enumerate().map(label).collect()
}

/// Arm, play, path and pace in one line.
pub fn heading(scenario: &Scenario, setup: &Setup) -> String {
    let plays: Vec<String> = setup
        .plays()
        .iter()
        .map(|(joint, clearance)| format!("{joint} c = {:.2} mm", clearance * 1e3))
        .collect();
    let plays = if plays.is_empty() { "no play".to_owned() } else { plays.join(", ") };
    let seconds = setup.plant.ticks as f64 * setup.plant.period_ns as f64 / 1e9;
    let path =
        toml::Value::try_from(scenario.path.kind).map_or_else(|_| String::new(), |kind| kind.to_string());
    format!(
        "Freeplay {} · {} · {plays} · path {}, {seconds} s · {} Hz, {}",
        env!("CARGO_PKG_VERSION"),
        setup.arm().name(),
        path.trim_matches('"'),
        scenario.rate,
        pace_name(scenario.pace),
    )
}

/// The machine, and the requests that it refused, once.
fn machine_lines(runs: &[RunSummary]) -> Vec<String> {
    let Some(run) = runs.first() else { return Vec::new() };
    let machine = &run.realtime["machine"];
    let text = |value: &Value| value.as_str().unwrap_or("?").to_owned();
    let mut lines = vec![format!(
        "machine: {} cores, {}, {}, wait: {}",
        machine["cores"],
        text(&machine["kernel"]).split(" #").next().unwrap_or_default(),
        text(&machine["scheduler"]),
        text(&machine["wait_policy"]),
    )];
    for item in ["priority", "cpu", "lock_memory"] {
        if let Some(reason) = run.realtime[item]["refused"].as_str() {
            lines.push(format!("refused: {}: {reason}", item.replace('_', " ")));
        }
    }
    lines
}

fn results(setup: &Setup, runs: &[RunSummary]) -> Table {
    let mut table = text_table();
    let joint =
        setup.plant.effects.clearances.first().map(|(joint, _)| setup.arm().joints()[*joint].name.clone());
    let contact = joint.as_ref().map_or_else(|| "contact".to_owned(), |joint| format!("contact in {joint}"));
    table.set_header(vec![
        "\ncontroller".to_owned(),
        "deviation [mm]\nrms".to_owned(),
        "\nmax".to_owned(),
        "\nz rms".to_owned(),
        format!("{contact}\nfree / impact / continuous"),
        "missed\nticks".to_owned(),
        "round trip [µs]\np50".to_owned(),
        "\np99".to_owned(),
        "\np99.9".to_owned(),
    ]);
    for run in runs {
        table.add_row(row(run, joint.as_deref()));
    }
    if let Some(names) = table.column_mut(0) {
        // A name is never broken, however narrow the terminal is.
        names.set_constraint(ColumnConstraint::ContentWidth);
    }
    for column in [1, 2, 3, 5, 6, 7, 8] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

fn row(run: &RunSummary, joint: Option<&str>) -> Vec<String> {
    let mm = |value: &Value| value.as_f64().map_or_else(|| "–".to_owned(), |mm| format!("{mm:.4}"));
    let us = |key: &str| {
        run.latency_us
            .get("round_trip")
            .and_then(|stage| stage[key].as_f64())
            .map_or("–".to_owned(), |us| format!("{us:.0}"))
    };
    let contact = joint.map_or_else(
        || "–".to_owned(),
        |joint| {
            let tally = &run.contact["joints"][joint];
            let percent = |key: &str| tally[key].as_f64().unwrap_or(f64::NAN) * 100.0;
            format!("{:5.2} / {:.2} / {:.2} %", percent("free"), percent("impact"), percent("continuous"))
        },
    );
    let deviation = &run.deviation_mm;
    vec![
        run.controller.clone(),
        mm(&deviation["rms_after_start"]),
        mm(&deviation["max_after_start"]),
        mm(&deviation["axes"]["z"]["rms_after_start"]),
        contact,
        run.deadlines["missed"].to_string(),
        us("p50"),
        us("p99"),
        us("p99.9"),
    ]
}

/// Share of a run in free flight above which a journal counts as not coming to rest.
pub const BOUNCING_SHARE: f64 = 0.25;

/// The joints whose journals do not come to rest, with suggestions: in light arms, feedback may throw the journals repeatedly.
fn bounces(scenario: &Scenario, run: &RunSummary) -> Vec<String> {
    if (run.ticks as f64) < scenario.rate {
        // Less than a second contains only the fall and the first bounces.
        return Vec::new();
    }
    let joints = run.contact["joints"].as_object().into_iter().flatten();
    let flies = joints.filter_map(|(name, tally)| Some((name, tally["free"].as_f64()?)));
    let hard = scenario.controller.gains.natural_frequency;
    flies
        .filter(|&(_, share)| share > BOUNCING_SHARE)
        .map(|(name, share)| {
            let share = 100.0 * share;
            format!(
                "the journal of {name} is in free flight for {share:.0} % of the run: the feedback may keep it bouncing; try another \
                 controller.gains.natural_frequency (now {hard}), or another posture (path.start)"
            )
        })
        .collect()
}

/// The greatest used share of the limits in a run, by quantity, with the joint.
fn drives(run: &RunSummary) -> String {
    let greatest = |quantity: &str| {
        let joints = run.joint_use.as_object().into_iter().flatten();
        let shares = joints.filter_map(|(name, used)| Some((used[quantity]["share"].as_f64()?, name)));
        let most = shares.max_by(|one, two| one.0.total_cmp(&two.0));
        most.map_or_else(
            || "unlimited".to_owned(),
            |(share, name)| format!("{:.0} % ({name})", 100.0 * share),
        )
    };
    let [speed, acceleration, torque] = ["speed", "acceleration", "torque"].map(greatest);
    let joints = run.joint_use.as_object().into_iter().flatten();
    let mut shares = joints.filter_map(|(_, used)| used["acceleration"]["share"].as_f64());
    let peaks = if shares.any(|share| share > 1.0) {
        "; impacts, such as that of a landing journal, exceed 100 % of the acceleration: only a lasting acceleration stops the arm"
    } else {
        ""
    };
    format!(
        "{}: share of the limits used after 0.5 s: speed {speed}, acceleration {acceleration}, torque {torque}{peaks}",
        run.controller
    )
}

/// Text for a run that did not end as planned.
pub fn ending(run: &RunSummary) -> Option<String> {
    let of = |how: &str| run.ending.get(how);
    if let Some(braked) = of("braked") {
        let reason = braked["reason"].as_str().unwrap_or("?").replace('_', " ");
        let limit = limit_words(&run.stopped);
        return Some(match limit {
            Some(limit) if run.stopped["reason"] == run.stopped["quantity"] => {
                format!("the arm was stopped at tick {}: {limit}", braked["tick"])
            }
            Some(limit) => {
                format!("the brakes closed at tick {}: last command {reason} ({limit})", braked["tick"])
            }
            None => format!("the brakes closed at tick {}: last command {reason}", braked["tick"]),
        });
    }
    of("interrupted").map(|interrupted| format!("interrupted after {} ticks", interrupted["tick"]))
}

/// Remarks on a run, one line each.
fn remarks(run: &RunSummary) -> Vec<String> {
    let mut remarks = run.notes.clone();
    remarks.extend(ending(run));
    remarks.extend(run.failures.iter().filter_map(failure_words).map(|words| format!("failed: {words}")));
    if let Some(rejected) = run.gate["rejected"].as_object() {
        let counted: Vec<String> = rejected
            .iter()
            .filter(|(reason, count)| *reason != MISSING && count.as_u64() != Some(0))
            .map(|(reason, count)| format!("{} {count}", reason.replace('_', " ")))
            .collect();
        let missing = rejected.get(MISSING).and_then(Value::as_u64).unwrap_or(0);
        if missing > 0 {
            remarks.push(format!("ticks without an answer in time: {missing}"));
        }
        if !counted.is_empty() {
            remarks.push(format!("commands that the gate refused, by reason: {}", counted.join(", ")));
        }
    }
    remarks.extend(first_refusal(&run.gate["first"]));
    for (key, said) in [("qp_failed", "had no solution"), ("qp_limit", "stopped at its limit of iterations")]
    {
        let count = run.answers[key].as_u64().unwrap_or(0);
        if count > 0 {
            remarks.push(format!("answers whose quadratic programme {said}: {count}"));
        }
    }
    let iterated = run.answers["iterated"].as_u64().unwrap_or(0);
    if iterated > 0 {
        remarks.push(format!(
            "limits were active in {iterated} of {} ticks: Clarabel solved those programmes; elsewhere the unconstrained minimum kept all limits",
            run.ticks
        ));
    }
    remarks.extend(crate::weights::words(&run.learned));
    let implausible = run.answers["implausible_times"].as_u64().unwrap_or(0);
    if implausible > 0 {
        remarks.push(format!("answers with impossible times, left out of the latencies: {implausible}"));
    }
    remarks.extend(swap_remarks(run));
    if run.deadlines["unrecorded"].as_u64().unwrap_or(0) > 0 {
        remarks.push(format!("ticks missing in the recording: {}", run.deadlines["unrecorded"]));
    }
    remarks
}

/// Text for the first command that was refused because of a limit.
fn first_refusal(first: &Value) -> Option<String> {
    let limit = limit_words(first)?;
    let (controller, tick) = (first["controller"].as_str()?, &first["tick"]);
    let reason = first["reason"].as_str()?.replace('_', " ");
    Some(if first["takes_over"] == true {
        format!("tick {tick}: the hand-over to {controller} was refused as {reason} ({limit})")
    } else {
        format!("tick {tick}: the gate first refused a command of {controller}: {reason} ({limit})")
    })
}

/// Text on takeovers and swaps.
fn swap_remarks(run: &RunSummary) -> Vec<String> {
    let Some(swaps) = run.line_up["swaps"].as_array() else { return Vec::new() };
    let (planned, failed): (Vec<&Value>, Vec<&Value>) =
        swaps.iter().partition(|swap| swap["cause"] == "planned");
    let word = |value: &Value| value.as_str().unwrap_or("?").replace('_', " ");
    let mut remarks: Vec<String> = failed
        .iter()
        .take(LISTED_FAIL_OVERS)
        .map(|swap| {
            format!(
                "tick {}: {} took over from {} ({}), {} ticks held",
                swap["tick"],
                swap["to"].as_str().unwrap_or("?"),
                swap["from"].as_str().unwrap_or("?"),
                word(&swap["cause"]["failed"]),
                swap["held_ticks"]
            )
        })
        .collect();
    if failed.len() > LISTED_FAIL_OVERS {
        remarks.push(format!(
            "and {} more fail-overs; all are in the summary",
            failed.len() - LISTED_FAIL_OVERS
        ));
    }
    if !planned.is_empty() {
        let held = |key: &str| planned.iter().filter_map(|swap| swap[key].as_u64()).max().unwrap_or(0);
        remarks.push(format!(
            "{} planned swaps; the greatest gap is {} ticks, the longest hold {} ticks",
            planned.len(),
            held("gap_ticks"),
            held("held_ticks")
        ));
    }
    remarks
}
