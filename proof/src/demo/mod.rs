//! `freeplay demo`: the closed loop. A plant with concealed physics stands for the real machine; the diagnosis finds the physics in the recording alone; the
//! controller gets the diagnosed model; the tool's deviation falls.

mod cases;
mod nameless;
mod page;
mod play;

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::Builder;

use clap::Args;
use freeplay_diagnosis::page::{outcome as in_words, title};
use freeplay_diagnosis::{Effect, Verdict};
use freeplay_report::units::{display_unit, written};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{check_target, claim};
use freeplay_terminal::layout::text_table;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::parallel::on_cores;
use freeplay_terminal::progress;
use serde_json::Value;

use cases::Case;
use play::{CONTROLLER, Outcome, outcome};

/// Number of cases that run at the same time: a lockstep run is two processes that wait for each other.
const AT_ONCE: usize = 2;

/// Demonstrates the whole process: it simulates a machine with concealed physics, diagnoses the machine from its recording alone,
/// and controls it with the identified model.
///
/// There are seven machines. Five are the paper's arm with play, friction, backlash, a payload or late encoders. One equals its
/// model. One has a damaged gear tooth, which the catalogue lacks. The controller is always quasi-static, first with the nominal
/// model, then with the diagnosed one. Sensors have noise: 0.1 µrad, 0.05 N·m, 10 µm. Exit code 1: a diagnosis is wrong.
#[derive(Args, Debug)]
pub struct DemoArgs {
    /// Use only these machines: clearance, friction, backlash, payload, delay, nothing, notch. Machines with physics that has no
    /// name: play, play-detent, play-cable, play-warped, play-drift, play-all, detent, cable, warped, cable-drift,
    /// friction-warped, nothing-nameless.
    #[arg(long = "case", value_name = "NAME")]
    cases: Vec<String>,
    /// Use the twelve machines with physics that has no name. The command records them with a tracker, diagnoses them, trains a
    /// network on the unexplained deviation, and judges the result without a tracker.
    #[arg(long, conflicts_with = "cases")]
    nameless: bool,
    /// Time of one of the two laps of the path, s. For machines with physics that has no name, it is the time of the first path,
    /// and the times of the other paths are in proportion.
    #[arg(long, default_value_t = 6.0, value_name = "S")]
    period: f64,
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write report.html and the results of each machine to this folder. Default: a folder in out/ named after the time.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Also write the picture of the first finding to this SVG file.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Reuse the machines that an earlier call has finished in the folder, and continue with the others. Only for machines with
    /// physics that has no name.
    #[arg(long, conflicts_with = "force", requires = "out")]
    resume: bool,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Plays the demonstration.
///
/// # Errors
/// Bad usage, a process that fails, a file that can't be written.
pub fn demo(args: &DemoArgs) -> Result<Exit, Failure> {
    if !(args.period >= 1.0 && args.period <= 120.0) {
        return Err(Failure::usage(format!("--period {}: between 1 and 120 s", args.period)));
    }
    let machines = nameless::all();
    let is_nameless = |name: &String| machines.iter().any(|machine| machine.name == name);
    if args.nameless || args.cases.iter().any(is_nameless) {
        if let Some(other) = args.cases.iter().find(|name| !is_nameless(name)) {
            let names: Vec<&str> = machines.iter().map(|machine| machine.name).collect();
            return Err(Failure::usage(format!(
                "--case {other}: with --nameless, choose among {}",
                names.join(", ")
            )));
        }
        let chosen = |machine: &nameless::Machine| {
            args.cases.is_empty() || args.cases.iter().any(|name| name == machine.name)
        };
        return commissioned(args, machines.into_iter().filter(chosen).collect());
    }
    let cases = chosen(&args.cases)?;
    if args.resume {
        return Err(Failure::usage(
            "--resume: only --nameless can continue an earlier call; remove --resume, or add --nameless",
        ));
    }
    args.picture.as_deref().map_or(Ok(()), check_target)?;
    // A machine without a diagnosis has no result.
    let results: Vec<String> = cases.iter().map(|case| format!("{}/report.html", case.name)).collect();
    let names: Vec<&str> = results.iter().map(String::as_str).chain(["report.html"]).collect();
    let folder = claim(args.out.as_deref(), &names, args.force)?;
    let out = folder.path();
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    let outcomes = all(&cases, args, out, &stop)?;
    if stop.load(Ordering::Relaxed) {
        return Ok(Exit::Interrupted);
    }
    let page = out.join("report.html");
    freeplay_terminal::files::write(&page, &page::document(&outcomes, args.period)?.to_html())?;
    if let Some(picture) = &args.picture {
        let drawn = outcomes.iter().find_map(page::picture).and_then(|drawing| drawing.to_svg());
        let drawn = drawn.ok_or_else(|| Failure::input("no finding can be drawn"))?;
        freeplay_terminal::files::write(picture, &drawn)?;
    }
    match args.format {
        Format::Json => say(&format!("{:#}\n", json(&outcomes)))?,
        Format::Text => {
            show(&text(&outcomes))?;
            show(&format!("\nreport  {}\n", page.display()))?;
        }
    }
    Ok(if outcomes.iter().all(Outcome::is_right) { Exit::Done } else { Exit::Verdict })
}

/// Runs the machines with nameless physics.
fn commissioned(args: &DemoArgs, machines: Vec<nameless::Machine>) -> Result<Exit, Failure> {
    let names: Vec<&str> =
        machines.iter().map(|machine| machine.name).chain(["nameless.json", "report.html"]).collect();
    let folder = claim(args.out.as_deref(), &names, args.force || args.resume)?;
    let out = folder.path();
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    let bar =
        progress::bar(machines.len() as u64, "commissioning and learning {wide_bar} {pos}/{len}  {msg}");
    let settings = nameless::Settings { period: args.period, seed: args.seed };
    let outcomes = on_cores(AT_ONCE, machines.len(), |number| {
        let machine = &machines[number];
        let folder = out.join(machine.name);
        let kept = args.resume.then(|| nameless::kept(machine, settings, &folder)).flatten();
        let came = match kept {
            Some(kept) => Ok(kept),
            None if stop.load(Ordering::Relaxed) => Err(Failure::input("interrupted")),
            None => nameless::outcome(machine, settings, &folder),
        };
        bar.inc(1);
        bar.set_message(machine.name);
        came
    });
    bar.finish_and_clear();
    if stop.load(Ordering::Relaxed) {
        return Ok(Exit::Interrupted);
    }
    let outcomes = outcomes?;
    let json = serde_json::json!({ "schema": "freeplay.demo-nameless/1", "ways": nameless::METHODS, "machines": outcomes,
        "checks": outcomes.iter().map(nameless::Outcome::checks).collect::<Vec<_>>() });
    freeplay_terminal::files::write(&out.join("nameless.json"), &format!("{json:#}\n"))?;
    let page = out.join("report.html");
    freeplay_terminal::files::write(&page, &nameless::document(&outcomes).to_html())?;
    match args.format {
        Format::Json => say(&format!("{json:#}\n"))?,
        Format::Text => {
            show(&nameless::text(&outcomes))?;
            show(&format!("\nreport  {}\n", page.display()))?;
        }
    }
    let holds = outcomes.iter().flat_map(nameless::Outcome::checks).all(|check| check.holds);
    Ok(if holds { Exit::Done } else { Exit::Verdict })
}

/// The cases with these names; without names, all of them.
fn chosen(names: &[String]) -> Result<Vec<Case>, Failure> {
    let all = cases::all();
    if let Some(unknown) = names.iter().find(|name| all.iter().all(|case| case.name != name.as_str())) {
        let machines = nameless::all();
        let known = all.iter().map(|case| case.name).chain(machines.iter().map(|machine| machine.name));
        let known: Vec<&str> = known.collect();
        return Err(Failure::usage(format!("--case {unknown}: choose among {}", known.join(", "))));
    }
    Ok(all
        .into_iter()
        .filter(|case| names.is_empty() || names.iter().any(|name| name == case.name))
        .collect())
}

/// All outcomes in the order of `cases`; several cases run at the same time.
fn all(
    cases: &[Case],
    args: &DemoArgs,
    out: &std::path::Path,
    stop: &AtomicBool,
) -> Result<Vec<Outcome>, Failure> {
    let bar = progress::bar(cases.len() as u64, "playing and diagnosing {wide_bar} {pos}/{len}  {msg}");
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<Outcome, Failure>)>> = Mutex::new(Vec::new());
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(case) = cases.get(number).filter(|_| !stop.load(Ordering::Relaxed)) else { return };
            let came = outcome(case, args.period, args.seed, &out.join(case.name), stop);
            bar.inc(1);
            bar.set_message(case.name);
            // A poisoned lock means that the other worker panicked; its missing outcome is reported below.
            if let Ok(mut done) = done.lock() {
                done.push((number, came));
            }
        }
    };
    std::thread::scope(|scope| {
        // If no further thread starts, this one does all the work.
        (1..AT_ONCE).for_each(|_| drop(Builder::new().spawn_scoped(scope, work)));
        work();
    });
    bar.finish_and_clear();
    let mut done = done.into_inner().map_err(Failure::internal)?;
    done.sort_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, came)| came).collect()
}

/// The effects that the diagnosis found, each with its first uncertain parameter.
fn found(outcome: &Outcome) -> Vec<String> {
    let of = |effect: &Effect| {
        let name = title(effect.kind, effect.joint.as_deref());
        let size = effect.parameters.iter().find_map(|(name, parameter)| {
            let (value, [low, high]) = (parameter.value.as_float()?, parameter.ci95?);
            let (scale, unit) = display_unit(&parameter.unit, value);
            let size = freeplay_report::text::uncertain(value * scale, 0.5 * (high - low) * scale);
            Some(format!("{name} {size} {unit}"))
        });
        format!("{name}: {}", size.unwrap_or_default())
    };
    outcome.diagnosis.effects.iter().map(of).collect()
}

/// Held-out error before and after, in the channel that shows the first finding best: channel, unit, before, after.
fn errors(outcome: &Outcome) -> Option<(String, String, f64, f64)> {
    let fit = outcome.diagnosis.fit.as_ref()?;
    let channels = outcome.diagnosis.effects.first()?.evidence.channels.iter();
    // The channel in which the model as given exceeds the floor most.
    let far =
        |channel: &&String| fit.before[*channel].rmse / fit.noise_floor[*channel].rmse.max(f64::MIN_POSITIVE);
    let channel = channels.max_by(|a, b| far(a).total_cmp(&far(b)))?;
    let (before, after) = (fit.before[channel].rmse, fit.after[channel].rmse);
    let (scale, unit) = display_unit(fit.units[channel], before);
    Some((channel.clone(), unit, before * scale, after * scale))
}

fn text(outcomes: &[Outcome]) -> String {
    let mut table = text_table();
    table.set_header(["hidden", "verdict", "found", "held-out error", "tool deviation, RMS [mm]", ""]);
    for outcome in outcomes {
        let error = errors(outcome).map_or_else(String::new, |(channel, unit, before, after)| {
            format!("{channel} {} → {} {unit}", written(before), written(after))
        });
        let deviation = outcome.after.as_ref().map_or_else(
            || format!("{:.3}", outcome.before.deviation),
            |after| format!("{:.3} → {:.3}", outcome.before.deviation, after.deviation),
        );
        table.add_row([
            outcome.case.hidden.to_owned(),
            verdict(outcome).to_owned(),
            found(outcome).join("; "),
            error,
            deviation,
            judged(outcome).1.to_owned(),
        ]);
    }
    let mut text = format!("{table}\n");
    let _ = write!(
        text,
        "\nhidden: in the plant, known to nobody else; found: from joints, torques and tracked tool alone; held-out error: model as given →\nwith the findings; tool deviation: {CONTROLLER} with the nominal model → with the diagnosed one, after the first 0.5 s\n"
    );
    text
}

/// Verdict on a diagnosis, with its words.
fn judged(outcome: &Outcome) -> (freeplay_report::Verdict, &'static str) {
    if outcome.is_right() {
        (freeplay_report::Verdict::Ok, "right")
    } else if outcome.is_found_with_others() {
        (freeplay_report::Verdict::Warn, "found, with others")
    } else {
        (freeplay_report::Verdict::Fail, "WRONG")
    }
}

fn verdict(outcome: &Outcome) -> &'static str {
    in_words(outcome.diagnosis.verdict).1
}

fn json(outcomes: &[Outcome]) -> Value {
    let cases = outcomes.iter().map(|outcome| {
        let held_out = errors(outcome).map(|(channel, unit, before, after)| {
            serde_json::json!({ "channel": channel, "unit": unit, "before": before, "after": after })
        });
        serde_json::json!({
            "name": outcome.case.name,
            "hidden": outcome.case.hidden,
            "verdict": outcome.diagnosis.verdict,
            "effects": outcome.diagnosis.effects,
            "right": outcome.is_right(),
            "held_out": held_out,
            "deviation_mm": { "before": outcome.before.deviation,
                              "after": outcome.after.as_ref().map(|after| after.deviation) },
        })
    });
    serde_json::json!({ "schema": "freeplay.demo/1", "cases": cases.collect::<Vec<_>>() })
}

/// True if the diagnosis named an effect.
fn named(outcome: &Outcome) -> bool {
    outcome.diagnosis.verdict == Verdict::Named
}
