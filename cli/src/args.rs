//! What was typed.

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use freeplay_report::one_line;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::messages::{Common, color_among};

use crate::help::grouped;
use crate::manual::EXIT_CODES;

/// Controller-in-the-loop harness for robot arms whose joints have play.
#[derive(Parser, Debug)]
#[command(name = "freeplay", version = env!("FREEPLAY_VERSION"), after_help = EXIT_CODES, max_term_width = 0)]
pub struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Run a scenario: an arm with play in one process, a controller in another, side by side for each controller.
    Run(freeplay_harness::run::RunArgs),
    /// How far a model is from a recording, channel by channel.
    Compare(crate::compare::CompareArgs),
    /// Swap controllers at random ticks, all pairs of them, and measure gap, jump and deviation of each swap.
    Swap(freeplay_exam::swap_command::SwapArgs),
    /// The exam of a controller: faults injected on purpose, and what comes of each.
    Faults(freeplay_exam::faults::FaultsArgs),
    /// Time every stage of the loop beside a bare clock loop and bare iceoryx2, alternately, with a cause for every missed deadline.
    Bench(freeplay_exam::bench::BenchArgs),
    /// Compare runs in one HTML file: verdicts, deviations, contact and latencies over each other, and what was set differently.
    Report(freeplay_harness::report_command::ReportArgs),
    /// Is this machine fit for runs, for medians and for tails of latencies, and what to change.
    Doctor(freeplay_doctor::DoctorArgs),
    /// Where a model and recordings differ, what is missing from the model, and how much better it gets with it.
    Diagnose(crate::diagnose::DiagnoseArgs),
    /// The loop closed: machines with concealed physics played, diagnosed, and controlled with what was found.
    Demo(freeplay_proof::demo::DemoArgs),
    /// The next motion where two causes are possible: safe, and telling them apart.
    Excite(crate::excite::ExciteArgs),
    /// The proof on concealed effects: seal, diagnose once, open, score.
    Blind(Box<freeplay_proof::blind::BlindArgs>),
    /// The recorded states of a run to a new controller process, its commands beside the recorded ones.
    Replay(freeplay_harness::replay::ReplayArgs),
    /// What is in a recording; to CSV and Parquet; from ROS 2 bags, other CSVs and libfranka logs.
    Record(crate::record::RecordArgs),
    /// Whether a scenario can be run, what it comes to and where each value is from, its schema for editors.
    Scenario(crate::scenario_command::ScenarioArgs),
    /// What a model file holds: which chain is the arm, its joints, limits and effects.
    Arm(crate::arm_command::ArmArgs),
    /// A model in the format of another tool, such as the model of a diagnosis, and a list of what that format has no words for.
    Export(crate::export_command::ExportArgs),
    /// Many shards of a command or of a sweep, spread over cores and machines; needs the Python package.
    Campaign(crate::campaign_command::CampaignArgs),
    /// Simulate the 40 reference runs of the paper's arm and show them beside an independent reference.
    ReferenceRuns(freeplay_paper::reference_runs::ReferenceArgs),
    /// The paper (Erkaya 2018) reproduced: its scenarios, figures and claims, each with a verdict.
    Reproduce(freeplay_paper::reproduce::ReproduceArgs),
    /// How far the deviation at sharp corners can be taken down at all: an offline optimum with all knowledge of the arm.
    Bound(freeplay_paper::bound_table::BoundArgs),
    /// The table of compensation: paths, times, clearances, wrong models and two joints with play, under every built-in controller.
    Cells(freeplay_paper::cells::CellsArgs),
    /// Learn from recordings what a model leaves of a tracked tool's deviation, and prove in simulated runs that taking it out helps.
    Train(freeplay_training::TrainArgs),
    /// Completions for a shell, to standard output.
    Completions(crate::manual::CompletionsArgs),
    /// The manual page, to standard output; all pages with --out.
    Man(crate::manual::ManArgs),
    /// What the exit codes mean.
    #[command(after_help = EXIT_CODES)]
    ExitCodes,
    /// The process that makes sealed recordings; `freeplay blind` starts it.
    #[command(hide = true)]
    BlindGenerate(freeplay_proof::blind::GenerateArgs),
    /// The process that answers for a sealed recording; `freeplay blind` starts it.
    #[command(hide = true)]
    BlindAnalyst(freeplay_proof::blind::AnalystArgs),
    /// The process that plays the machine; `freeplay run` starts it.
    #[command(hide = true)]
    Plant(freeplay_harness::plant_command::PlantArgs),
    /// The process of a built-in controller; `freeplay run` starts it.
    #[command(hide = true)]
    Controller(freeplay_harness::controller_command::ControllerArgs),
    /// The process that ends a controller with its run; `freeplay run` starts it.
    #[command(hide = true)]
    Guard,
    /// A yardstick of `freeplay bench`, which starts it.
    #[command(hide = true)]
    Yardstick(freeplay_exam::bench::YardstickArgs),
}

/// Understands the command line and does what it says.
///
/// # Errors
/// What the command could not do, with the exit code.
pub fn dispatch() -> Result<Exit, Failure> {
    freeplay_terminal::process::end_on_signals()?;
    let parsed = understood().try_get_matches().and_then(|matches| Cli::from_arg_matches(&matches));
    let cli = parsed.unwrap_or_else(|error| quit(error));
    cli.common.apply();
    match cli.command {
        Command::Run(args) => freeplay_harness::run::run(&args),
        Command::Compare(args) => crate::compare::compare(&args),
        Command::Swap(args) => freeplay_exam::swap_command::swap(&args),
        Command::Faults(args) => freeplay_exam::faults::faults(&args),
        Command::Bench(args) => freeplay_exam::bench::bench(&args),
        Command::Yardstick(args) => freeplay_exam::bench::yardstick(&args),
        Command::Report(args) => freeplay_harness::report_command::report(&args),
        Command::Doctor(args) => freeplay_doctor::doctor(&args),
        Command::Diagnose(args) => crate::diagnose::diagnose(&args),
        Command::Demo(args) => freeplay_proof::demo::demo(&args),
        Command::Excite(args) => crate::excite::excite(&args),
        Command::Blind(args) => freeplay_proof::blind::blind(&args),
        Command::BlindGenerate(args) => freeplay_proof::blind::generate(&args),
        Command::BlindAnalyst(args) => freeplay_proof::blind::analyst(&args),
        Command::Replay(args) => freeplay_harness::replay::replay(&args),
        Command::Record(args) => crate::record::record(&args),
        Command::Scenario(args) => crate::scenario_command::scenario(&args),
        Command::Arm(args) => crate::arm_command::arm(&args),
        Command::Export(args) => crate::export_command::export(&args),
        Command::Campaign(args) => crate::campaign_command::campaign(&args),
        Command::ReferenceRuns(args) => freeplay_paper::reference_runs::reference_runs(&args),
        Command::Reproduce(args) => freeplay_paper::reproduce::reproduce(&args),
        Command::Bound(args) => freeplay_paper::bound_table::bound(&args),
        Command::Cells(args) => freeplay_paper::cells::cells(&args),
        Command::Train(args) => freeplay_training::train_command(&args),
        Command::Completions(args) => crate::manual::completions(&args, Cli::command()),
        Command::Man(args) => crate::manual::man(&args, Cli::command()),
        Command::ExitCodes => crate::manual::exit_codes(),
        Command::Guard => freeplay_terminal::guard::guard(),
        Command::Plant(args) => freeplay_harness::plant_command::plant(&args),
        Command::Controller(args) => crate::controller::controller(&args),
    }
}

/// The command line that is understood.
fn understood() -> clap::Command {
    with_negative_numbers(grouped(Cli::command())).color(color_among(std::env::args_os()))
}

/// Shows help, the version or what is wrong with the command line, and ends the program.
fn quit(error: clap::Error) -> ! {
    let words: Vec<String> =
        std::env::args_os().map(|word| one_line(&word.to_string_lossy()).into_owned()).collect();
    // An argument that speaks to the terminal is as wrong when it is escaped, and then it can be shown.
    let shown = understood().try_get_matches_from(words).err().unwrap_or(error);
    // Where neither output can be written there is nobody to tell.
    let _ = shown.print();
    std::process::exit(shown.exit_code())
}

/// Lets `-1` be a value of every option, so that what is said of it is its range and not that there is no option `-1`.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    command
        .mut_args(|arg| match arg.get_action().takes_values() {
            true => arg.allow_negative_numbers(true),
            false => arg,
        })
        .mut_subcommands(with_negative_numbers)
}
