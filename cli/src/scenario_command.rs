//! `freeplay scenario`: checks a scenario, shows each of its values with its origin, and prints the schema for editors.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::run::load;
use freeplay_harness::scenario::Scenario;
use freeplay_harness::scenario_place::{located, place_of};
use freeplay_harness::setup::Setup;
use freeplay_harness::swaps;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::read_text;
use freeplay_terminal::output::say;
use toml::{Table, Value};

/// Shows and checks scenarios without running them.
#[derive(Args, Debug)]
pub struct ScenarioArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand, Debug)]
enum Action {
    /// Check that a scenario can run: keys, values, arm files, path, controllers. Errors are reported with line and column.
    Check(CheckArgs),
    /// Show the effective value of every key and its origin: the default, the file or --set.
    Show(ShowArgs),
    /// Print the JSON schema of scenarios, for editors.
    Schema,
}

#[derive(Args, Debug)]
struct CheckArgs {
    /// Scenario files to check.
    #[arg(required = true)]
    scenario: Vec<PathBuf>,
}

#[derive(Args, Debug)]
struct ShowArgs {
    /// Scenario file. Default: the default scenario.
    scenario: Option<PathBuf>,
    /// Change a key of the scenario, as in --set path.period=12.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Carries out the command in `args`.
///
/// # Errors
/// A scenario that can't be used.
pub fn scenario(args: &ScenarioArgs) -> Result<Exit, Failure> {
    match &args.action {
        Action::Check(args) => args.scenario.iter().try_for_each(|file| check(file))?,
        Action::Show(args) => show(args)?,
        Action::Schema => say(&schema()?)?,
    }
    Ok(Exit::Done)
}

/// Prints the run that the scenario of `file` describes.
fn check(file: &Path) -> Result<(), Failure> {
    let scenario = load(Some(file), &[])?;
    let at = |failure: Failure| Failure { message: located(Some(file), failure.message), ..failure };
    let setup = Setup::new(&scenario).map_err(at)?;
    let period = setup.plant.period_ns as f64 * 1e-9;
    for asked in &scenario.controllers {
        ControllerSelection::of(asked)?;
        swaps::controller_set(&scenario, &swaps::names(asked, &scenario.standby), setup.plant.ticks, period)
            .map_err(at)?;
    }
    for asked in &scenario.standby {
        ControllerSelection::of(asked)?;
    }
    let plays: Vec<&str> = scenario.clearance.keys().map(String::as_str).collect();
    let plays = if plays.is_empty() { String::new() } else { format!(", play in {}", plays.join(", ")) };
    let effects = setup.truth.effects.len() - scenario.clearance.len();
    let effects = match effects {
        0 => String::new(),
        1 => ", one effect of the arm file".to_owned(),
        several => format!(", {several} effects of the arm file"),
    };
    say(&format!(
        "{}: valid: {} with {} joints{plays}{effects}, {} ticks of {:.3} ms, controlled by {}\n",
        file.display(),
        setup.arm().name(),
        setup.arm().dof(),
        setup.plant.ticks,
        period * 1e3,
        scenario.controllers.join(", ")
    ))
}

/// Prints every key with its value, as TOML, followed by the origin of the value.
fn show(args: &ShowArgs) -> Result<(), Failure> {
    let scenario = load(args.scenario.as_deref(), &args.set)?;
    let text = match &args.scenario {
        Some(file) => read_text(file)?,
        None => String::new(),
    };
    let origin = Origin { file: args.scenario.as_deref(), text: &text, sets: &args.set };
    let table = Table::try_from(&scenario).map_err(Failure::internal)?;
    let mut lines = Vec::new();
    flatten("", &table, &mut lines);
    let width = lines.iter().map(|(_, line)| line.chars().count()).max().unwrap_or(0).min(60);
    let shown: Vec<String> =
        lines.iter().map(|(key, line)| format!("{line:width$}  # {}\n", origin.of(key))).collect();
    say(&shown.concat())
}

/// Every value of `table` with its dotted key and as a line of TOML.
fn flatten(prefix: &str, table: &Table, lines: &mut Vec<(String, String)>) {
    for (name, value) in table {
        let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        match value {
            Value::Table(inner) if !inner.is_empty() => flatten(&key, inner, lines),
            value => lines.push((key.clone(), format!("{key} = {value}"))),
        }
    }
}

/// Origin of the values.
struct Origin<'a> {
    file: Option<&'a Path>,
    text: &'a str,
    sets: &'a [String],
}

impl Origin<'_> {
    /// The origin of the value of `key`: the last --set of it or of a table that contains it, the file, or the default.
    fn of(&self, key: &str) -> String {
        let holds =
            |outer: &str| key == outer || key.strip_prefix(outer).is_some_and(|rest| rest.starts_with('.'));
        if self.sets.iter().any(|set| set.split('=').next().is_some_and(|name| holds(name.trim()))) {
            return "--set".to_owned();
        }
        match (self.file, place_of(self.text, key)) {
            (Some(file), Some(place)) => format!("{}:{}", file.display(), place.line),
            _ => "default".to_owned(),
        }
    }
}

/// Print the JSON schema of scenarios.
fn schema() -> Result<String, Failure> {
    let schema = schemars::schema_for!(Scenario);
    Ok(format!("{}\n", serde_json::to_string_pretty(&schema).map_err(Failure::internal)?))
}
