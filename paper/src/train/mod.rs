//! `freeplay train`: the network of `narx-qp` from simulated runs, and how much better it predicts than what needs no network.

pub mod collect;
mod proof;
pub mod scenarios;
pub mod score;
pub mod series;
mod table;

use std::ops::ControlFlow;
use std::path::PathBuf;

use clap::Args;
use freeplay_arm::Selection;
use freeplay_harness::setup::load_selected;
use freeplay_predictor::activation::Activation;
use freeplay_predictor::levenberg_marquardt::Settings;
use freeplay_predictor::training::{Recipe, train as fit};
use freeplay_predictor::window::{Window, windows};
use freeplay_predictor::{Arx, Narx, Provenance, Series, Split};
use freeplay_terminal::arguments::{Format, at_least_one};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::check_target;
use freeplay_terminal::output::say;
use freeplay_terminal::{messages, progress};
use indicatif::ProgressBar;

use crate::train::collect::{Collected, Observer, collect};
use crate::train::scenarios::{RunSpec, Subject};
use crate::train::series::View;
use crate::train::table::Figures;

/// Steady contact is the same over and over: every so many windows of it train.
const STEADY_SHARE: usize = 6;
/// Most windows that train, and that train the paper's network, which has five times the weights.
const MOST_WINDOWS: usize = 20_000;
const MOST_OF_THE_PAPER: usize = 6_000;
/// The paper's hidden layers.
const PAPER_HIDDEN: [usize; 4] = [10; 4];

/// Trains the network of narx-qp.
#[derive(Args, Debug)]
pub struct TrainArgs {
    /// Where the weights go.
    #[arg(long, default_value = "narx.json")]
    out: PathBuf,
    /// The arm: "paper" or an arm file.
    #[arg(long, default_value = freeplay_controller::task::PAPER_MODEL)]
    model: String,
    /// The link of the arm file at the end of the arm; without it: tool0, else the longest chain without its fingers.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// The joint that has play.
    #[arg(long, default_value = "joint_5")]
    joint: String,
    /// Ticks to look ahead.
    #[arg(long, default_value_t = 3)]
    horizon: usize,
    /// Units of each hidden layer.
    #[arg(long, value_delimiter = ',', default_values_t = [10, 10], value_parser = at_least_one)]
    hidden: Vec<usize>,
    /// Most epochs.
    #[arg(long, default_value_t = 40, value_parser = at_least_one)]
    epochs: usize,
    /// Seed of the start weights.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Test these weights; only what they are compared with is trained.
    #[arg(long, value_name = "WEIGHTS")]
    evaluate: Option<PathBuf>,
    /// Test on one short run only, beside what needs no training.
    #[arg(long)]
    quick: bool,
    /// How results are printed.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Trains, tests and writes the weights.
///
/// # Errors
/// An arm, a joint or weights that can't be used; runs that fail; a file that can't be written.
pub fn train(args: &TrainArgs) -> Result<Exit, Failure> {
    let subject = subject(args)?;
    // Before what takes minutes.
    check_target(&args.out)?;
    let fitted = match &args.evaluate {
        Some(file) => {
            let narx = Narx::load(file).map_err(Failure::input)?;
            freeplay_controller::learned::check(&narx, &subject.arm, Some(&args.joint))
                .map_err(|error| Failure::input(format!("{}: {error}", file.display())))?;
            let others =
                if args.quick { None } else { Some(others(args, &subject, &training(args, &subject)?)?) };
            Fitted { twin: narx, others }
        }
        None => {
            let fitted = learn(args, &subject)?;
            fitted.twin.save(&args.out).map_err(Failure::input)?;
            messages::note(format_args!("weights  {}", args.out.display()));
            fitted
        }
    };
    let figures = test(&subject, &fitted, args.quick)?;
    match args.format {
        Format::Json => {
            say(&format!("{}\n", serde_json::to_string_pretty(&figures).map_err(Failure::internal)?))?;
        }
        Format::Text => say(&Figures::in_words(&figures))?,
    }
    Ok(Exit::Done)
}

/// The table of `fitted` on the runs to be tested on: one step with a tracked tool, and the whole run without one.
fn test(subject: &Subject, fitted: &Fitted, quick: bool) -> Result<Vec<Figures>, Failure> {
    let folder = tempfile::tempdir().map_err(Failure::internal)?;
    let (specs, horizon) = (scenarios::tests(quick, folder.path())?, fitted.twin.layout().horizon);
    let seeing = Observer { horizon, tracked: true, network: Some(&fitted.twin) };
    let mut figures = table::score(fitted, &gather(subject, &specs, seeing)?)?;
    let blind = Observer { horizon, tracked: false, network: Some(&fitted.twin) };
    figures.extend(table::free_run(&gather(subject, &specs, blind)?, horizon));
    Ok(figures)
}

fn subject(args: &TrainArgs) -> Result<Subject, Failure> {
    let selection = Selection { tip: args.tip.clone(), joints: Vec::new() };
    let arm = load_selected(&args.model, &selection)?.arm;
    let joint = arm.joint_index(&args.joint).ok_or_else(|| {
        let names: Vec<&str> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
        Failure::input(format!(
            "--joint {}: the arm has no such joint; choose among {}",
            args.joint,
            names.join(", ")
        ))
    })?;
    Ok(Subject { arm, joint })
}

/// What has been learned.
pub struct Fitted {
    /// The network that ships.
    pub twin: Narx,
    /// What it is compared with, unless the test is a quick one.
    pub others: Option<Others>,
}

/// What is trained for comparison only.
pub struct Others {
    /// The plain NARX.
    pub plain: Narx,
    /// The ridge ARX on its regressors.
    pub arx: Arx,
    /// The paper's NARX.
    pub paper: Narx,
}

/// Runs that train, then those that stop the training, and the names of the former.
struct Training {
    runs: Vec<Collected>,
    names: Vec<String>,
}

fn gather(subject: &Subject, specs: &[RunSpec], observer: Observer<'_>) -> Result<Vec<Collected>, Failure> {
    let bar = bar(specs.len() as u64, "runs");
    let runs = collect(subject, specs, observer, &bar)?;
    bar.finish_and_clear();
    Ok(runs)
}

fn bar(length: u64, what: &str) -> ProgressBar {
    progress::bar(length, &format!("{what} {{bar:30}} {{pos}}/{{len}} {{elapsed}} {{msg}}"))
}

fn training(args: &TrainArgs, subject: &Subject) -> Result<Training, Failure> {
    let mut specs = scenarios::training();
    let names = specs.iter().map(|spec| spec.name.clone()).collect();
    specs.extend(scenarios::validation());
    let observer = Observer { horizon: args.horizon, tracked: true, network: None };
    Ok(Training { runs: gather(subject, &specs, observer)?, names })
}

fn learn(args: &TrainArgs, subject: &Subject) -> Result<Fitted, Failure> {
    let training = training(args, subject)?;
    let twin = fit_view(View::Twin, &training, args, subject)?;
    let twin = proof::tried(
        twin,
        &gather(
            subject,
            &scenarios::proof(),
            Observer { horizon: args.horizon, tracked: true, network: None },
        )?,
    )?;
    Ok(Fitted { twin, others: Some(others(args, subject, &training)?) })
}

fn others(args: &TrainArgs, subject: &Subject, training: &Training) -> Result<Others, Failure> {
    let series = View::Plain.series(&training.runs, args.horizon)?;
    let layout = View::Plain.layout(args.horizon);
    let split = split(training, &series, layout.memory(), args.horizon, MOST_WINDOWS)?;
    Ok(Others {
        arx: Arx::fit(&series, &split, &layout).map_err(Failure::input)?,
        plain: fit_view(View::Plain, training, args, subject)?,
        paper: fit_view(View::Paper, training, args, subject)?,
    })
}

fn command(args: &TrainArgs, hidden: &[usize]) -> String {
    let hidden: Vec<String> = hidden.iter().map(usize::to_string).collect();
    format!(
        "freeplay train --model {} --joint {} --horizon {} --hidden {} --epochs {} --seed {}",
        args.model,
        args.joint,
        args.horizon,
        hidden.join(","),
        args.epochs,
        args.seed
    )
}

fn fit_view(view: View, training: &Training, args: &TrainArgs, subject: &Subject) -> Result<Narx, Failure> {
    let series = view.series(&training.runs, args.horizon)?;
    let layout = view.layout(args.horizon);
    let (hidden, most) = match view {
        View::Twin | View::Plain => (args.hidden.clone(), MOST_WINDOWS),
        View::Paper => (PAPER_HIDDEN.to_vec(), MOST_OF_THE_PAPER),
    };
    let split = split(training, &series, layout.memory(), args.horizon, most)?;
    let provenance = Provenance {
        arm: subject.arm.name().to_owned(),
        arm_hash: freeplay_controller::identity::identity(&subject.arm),
        joint: subject.arm.joints()[subject.joint].name.clone(),
        command: command(args, &hidden),
        scenarios: training.names.clone(),
        seed: args.seed,
        proved: false,
    };
    let recipe = Recipe {
        layout,
        hidden,
        activation: Activation::Tanh,
        seed: args.seed,
        settings: Settings { epochs: args.epochs, ..Settings::default() },
    };
    let bar = bar(args.epochs as u64, &format!("{view:?}: {} windows, epochs", split.train.len()));
    let trained = fit(&series, &split, &recipe, provenance, |epoch| {
        bar.set_position(epoch.epoch as u64);
        bar.set_message(format!(
            "error {:.4}, validation {:.4}",
            epoch.mse,
            epoch.validation_mse.unwrap_or(f64::NAN)
        ));
        ControlFlow::Continue(())
    })
    .map_err(Failure::input)?;
    bar.finish_and_clear();
    let last = &trained.outcome.history[trained.outcome.best_epoch];
    messages::note(format_args!(
        "{view:?}: {} windows, best epoch {} ({:?}), error {:.5}, validation {:.5}",
        split.train.len(),
        trained.outcome.best_epoch,
        trained.outcome.stop,
        last.mse,
        last.validation_mse.unwrap_or(f64::NAN)
    ));
    Ok(trained.narx)
}

/// The windows that train and those that stop the training: all around detachments and in the first half second, a share of the rest.
fn split(
    training: &Training,
    series: &Series,
    memory: usize,
    horizon: usize,
    most: usize,
) -> Result<Split, Failure> {
    let near: Vec<Vec<bool>> = training.runs.iter().map(|run| score::around(&run.rows)).collect();
    let wanted = |window: &Window| {
        let early = window.present < 500;
        early || near[window.run][window.target] || window.present.is_multiple_of(STEADY_SHARE)
    };
    // The first forecasts have not come due.
    let all = windows(series, memory.max(horizon), horizon).map_err(Failure::input)?;
    let (train, validation): (Vec<_>, Vec<_>) =
        all.into_iter().filter(wanted).partition(|window| window.run < training.names.len());
    let keep = train.len().div_ceil(most).max(1);
    let train = train.into_iter().step_by(keep).collect();
    Ok(Split { train, validation, test: Vec::new() })
}
