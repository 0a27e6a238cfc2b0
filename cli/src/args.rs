//! The typed command line.

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use freeplay_report::one_line;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::flags::{Common, color_among};

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
    /// Run a scenario: one process simulates an arm with play, and another process runs the controller. Several controllers run
    /// one after another.
    Run(freeplay_harness::run::RunArgs),
    /// Measure the residuals between a model and a recording, channel by channel.
    Compare(crate::compare::CompareArgs),
    /// Swap every pair of controllers at random ticks, and measure the gap, jump and deviation of each swap.
    Swap(freeplay_exam::swap_command::SwapArgs),
    /// Inject faults into a controller, and judge how the run handles each fault.
    Faults(freeplay_exam::faults::FaultsArgs),
    /// Measure the time of every stage of the loop, and name the cause of every missed deadline. Measurements of a bare clock
    /// loop and of bare iceoryx2 alternate with those of the loop.
    Bench(freeplay_exam::bench::BenchArgs),
    /// Compare runs in one HTML file: verdicts, deviations, contact, latencies, and the settings that differ.
    Report(freeplay_harness::report_command::ReportArgs),
    /// Check whether this machine is fit for runs, for measuring median latencies and for measuring tail latencies, and recommend
    /// changes.
    Doctor(freeplay_doctor::DoctorArgs),
    /// Find where a model and recordings differ, name the missing physics, and write a better model.
    Diagnose(crate::diagnose_args::DiagnoseArgs),
    /// Demonstrate the whole process: simulate machines with concealed physics, diagnose them, and control them with the
    /// identified models.
    Demo(freeplay_proof::demo::DemoArgs),
    /// Design a safe motion that distinguishes between two possible causes.
    Excite(crate::excite::ExciteArgs),
    /// Test the diagnosis on concealed effects: seal recordings, diagnose each one once, reveal the true effects, and score the
    /// answers.
    Blind(Box<freeplay_proof::blind::BlindArgs>),
    /// Send the recorded states of a run to a new controller process and compare its commands with the recorded ones.
    Replay(freeplay_harness::replay::ReplayArgs),
    /// Show the contents of a recording, export it to CSV or Parquet, or import ROS bags, other CSV files and libfranka logs.
    Record(crate::record::RecordArgs),
    /// Check a scenario, show each of its values with its origin, or print the schema for editors.
    Scenario(crate::scenario_command::ScenarioArgs),
    /// Show the contents of a model file: the kinematic chain of the arm, its joints, limits and effects.
    Arm(crate::arm_command::ArmArgs),
    /// Write a model in the format of another tool (URDF, MJCF, FMU), and list what that format cannot express.
    Export(crate::export_command::ExportArgs),
    /// Distribute a command or a parameter sweep over cores and machines. This needs the Python package.
    Campaign(crate::campaign_command::CampaignArgs),
    /// Simulate the 40 reference runs of the paper's arm, and compare them with an independent reference.
    ReferenceRuns(freeplay_paper::reference_runs::ReferenceArgs),
    /// Reproduce the paper (Erkaya 2018): its scenarios, figures and claims, each with a verdict.
    Reproduce(freeplay_paper::reproduce::ReproduceArgs),
    /// Compute the smallest possible deviation at sharp corners by offline optimisation with full knowledge of the arm.
    Bound(freeplay_paper::bound_table::BoundArgs),
    /// Print the table of compensation results under every built-in controller: paths, periods, clearances, wrong models, and two
    /// joints with play.
    Cells(freeplay_paper::cells::CellsArgs),
    /// Train a network on the tool deviation that a model leaves unexplained in recordings, and test in simulated runs whether
    /// compensating it helps.
    Train(freeplay_training::TrainArgs),
    /// Print the completion script for a shell.
    Completions(crate::manual::CompletionsArgs),
    /// Print the manual page, or write the manual pages of all commands with --out.
    Man(crate::manual::ManArgs),
    /// Explain the exit codes.
    #[command(after_help = EXIT_CODES)]
    ExitCodes,
    /// Generate sealed recordings. `freeplay blind` starts this process.
    #[command(hide = true)]
    BlindGenerate(freeplay_proof::blind::GenerateArgs),
    /// Diagnose a sealed recording. `freeplay blind` starts this process.
    #[command(hide = true)]
    BlindAnalyst(freeplay_proof::blind::AnalystArgs),
    /// Simulate the machine. `freeplay run` starts this process.
    #[command(hide = true)]
    Plant(freeplay_harness::plant_command::PlantArgs),
    /// Run a built-in controller. `freeplay run` starts this process.
    #[command(hide = true)]
    Controller(freeplay_harness::controller_command::ControllerArgs),
    /// End a controller when its run ends. `freeplay run` starts this process.
    #[command(hide = true)]
    Guard,
    /// Run a reference measurement of `freeplay bench`, which starts this process.
    #[command(hide = true)]
    Yardstick(freeplay_exam::bench::YardstickArgs),
}

/// Parses the command line and runs the command.
///
/// # Errors
/// The failure of the command, with its exit code.
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

/// The parser for the command line.
fn understood() -> clap::Command {
    with_negative_numbers(grouped(Cli::command())).color(color_among(std::env::args_os()))
}

/// Prints help, the version or the error in the command line, and ends the program.
fn quit(error: clap::Error) -> ! {
    let words: Vec<String> =
        std::env::args_os().map(|word| one_line(&word.to_string_lossy()).into_owned()).collect();
    // Escaping the control characters keeps the argument wrong and makes it printable.
    let shown = understood().try_get_matches_from(words).err().unwrap_or(error);
    freeplay_terminal::command_line::print(&shown);
    std::process::exit(shown.exit_code())
}

/// Accepts `-1` as the value of every option, so that the error names the range and not an unknown option `-1`.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    command
        .mut_args(|arg| match arg.get_action().takes_values() {
            true => arg.allow_negative_numbers(true),
            false => arg,
        })
        .mut_subcommands(with_negative_numbers)
}

#[cfg(test)]
#[path = "../../tests/common/jargon.rs"]
mod jargon;

#[cfg(test)]
mod tests {
    use clap::Command;
    use freeplay_terminal::command_line::in_plain_words;

    use super::jargon::JARGON;
    use super::understood;

    /// Every option of `command` and of its subcommands: the words before it, and its name.
    fn options(command: &Command, before: &[String]) -> Vec<(Vec<String>, String)> {
        let long =
            |arg: &clap::Arg| arg.get_long().filter(|_| arg.get_action().takes_values()).map(str::to_owned);
        let mut all: Vec<(Vec<String>, String)> =
            command.get_arguments().filter_map(long).map(|name| (before.to_vec(), name)).collect();
        for sub in command.get_subcommands() {
            let words = [before, &[sub.get_name().to_owned()]].concat();
            all.extend(options(sub, &words));
        }
        all
    }

    #[test]
    fn a_refused_value_is_said_in_plain_words_whatever_the_option() {
        let (mut refused, mut reworded) = (0, 0);
        for (words, name) in options(&understood(), &["freeplay".to_owned()]) {
            for value in ["x", "-1", "3.5", "1e999", "99999999999999999999999999", ""] {
                let line = [words.as_slice(), &[format!("--{name}={value}")]].concat();
                let Err(error) = understood().try_get_matches_from(&line) else { continue };
                if error.kind() != clap::error::ErrorKind::ValueValidation {
                    continue;
                }
                let plain = in_plain_words(&error);
                reworded += usize::from(plain.is_some());
                let said = plain.unwrap_or_else(|| error.to_string());
                let first = said.lines().next().unwrap_or_default();
                // A Rust range is jargon for the user, too; in messages about files the dots stand for omitted text.
                let is_plain = !first.contains("..") && !JARGON.iter().any(|word| first.contains(word));
                assert!(is_plain, "{line:?}: {first}");
                refused += 1;
            }
        }
        println!("{refused} values refused, {reworded} reworded");
        assert!(refused > 100 && reworded > 40);
    }
}
