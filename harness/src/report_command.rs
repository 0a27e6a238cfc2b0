//! `freeplay report`: comparison of several runs in one HTML file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::Args;
use freeplay_report::{Block, Cell, Column, Document, Section, Table};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{read_json, write};
use freeplay_terminal::output::say;
use serde::Deserialize;
use serde_json::Value;

use crate::run_report::{Played, contact, deviation, latencies, overview};
use crate::summary::{RunSummary, SCHEMA};

/// Compares runs in one HTML file.
#[derive(Args, Debug)]
pub struct ReportArgs {
    /// Folders of the runs, as `freeplay run --out` wrote them.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// Write the report to this file.
    #[arg(long, default_value = "comparison.html")]
    out: PathBuf,
}

/// Results of a run in its folder.
struct RunResults {
    folder: PathBuf,
    /// Name of the run in the comparison.
    name: String,
    summary: Summary,
}

/// The compared parts of `summary.json`.
#[derive(Deserialize)]
struct Summary {
    schema: String,
    scenario: Value,
    machine: Value,
    runs: Vec<RunSummary>,
}

/// Writes the comparison requested by `args`.
///
/// # Errors
/// A folder without a summary, unreadable recordings or histograms; an unwritable file.
pub fn report(args: &ReportArgs) -> Result<Exit, Failure> {
    let names = names(&args.runs);
    let left: Vec<RunResults> = args
        .runs
        .iter()
        .zip(names)
        .map(|(folder, name)| RunResults::read(folder, name))
        .collect::<Result<_, _>>()?;
    write(&args.out, &document(&left)?.to_html())?;
    say(&format!("report  {}\n", args.out.display()))?;
    Ok(Exit::Done)
}

/// The last parts of the paths, or the whole paths if two of these are equal.
fn names(folders: &[PathBuf]) -> Vec<String> {
    let last = |path: &PathBuf| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let short: BTreeSet<String> = folders.iter().map(last).collect();
    let is_enough = short.len() == folders.len();
    folders.iter().map(|path| if is_enough { last(path) } else { path.display().to_string() }).collect()
}

impl RunResults {
    fn read(folder: &Path, name: String) -> Result<Self, Failure> {
        let file = folder.join("summary.json");
        if !file.is_file() {
            return Err(Failure::input(format!(
                "{}: there is no such file; give the folders that freeplay run --out left",
                file.display()
            )));
        }
        let summary: Summary = read_json(&file, "a folder that freeplay run --out left")?;
        if summary.schema != SCHEMA {
            return Err(Failure::input(format!(
                "{}: its schema is {}, this version reads {SCHEMA}",
                file.display(),
                summary.schema
            )));
        }
        Ok(Self { folder: folder.to_owned(), name, summary })
    }

    fn played(&self, several: bool) -> Result<Vec<Played<'_>>, Failure> {
        let called = |run: &RunSummary| match several {
            true => format!("{}: {}", self.name, run.controller),
            false => run.controller.clone(),
        };
        self.summary.runs.iter().map(|run| Played::read(run, &self.folder, called(run))).collect()
    }
}

fn document(left: &[RunResults]) -> Result<Document, Failure> {
    let mut played = Vec::new();
    for left_one in left {
        played.extend(left_one.played(left.len() > 1)?);
    }
    let folders = left.iter().map(|left| left.folder.display().to_string()).collect::<Vec<_>>();
    let mut document = Document::new("Freeplay runs compared").subtitle(folders.join(" · "));
    for block in overview(&played) {
        document = document.overview(block);
    }
    for block in identical(&played) {
        document = document.overview(block);
    }
    let plays: BTreeSet<&String> = played
        .iter()
        .filter_map(|run| run.summary().contact["joints"].as_object())
        .flat_map(serde_json::Map::keys)
        .collect();
    document = document.section(deviation(&played));
    for play in plays {
        document = document.section(contact(&played, play));
    }
    document = document
        .section(Section::new("Deadlines and gate").with(deadlines(&played)))
        .section(latencies(&played))
        .section(differences(left));
    Ok(document.footer(format!("freeplay {}", env!("CARGO_PKG_VERSION"))))
}

/// Text on runs that are identical byte for byte.
fn identical(played: &[Played]) -> Vec<Block> {
    let mut same: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for run in played {
        same.entry(&run.summary().state_hash).or_default().push(run.name());
    }
    let groups = same.into_values().filter(|names| names.len() > 1);
    groups
        .map(|names| {
            Block::from(format!(
                "Runs with identical States and Commands, to the byte: {}.",
                names.join(", ")
            ))
        })
        .collect()
}

fn deadlines(played: &[Played]) -> Table {
    let mut table = Table::new("Deadlines, and rejections by the gate")
        .column(Column::text("run"))
        .column(Column::text("pace"))
        .column(Column::number("ticks", ""))
        .column(Column::number("missed", "").lowest())
        .column(Column::number("plant late", "").lowest())
        .column(Column::number("hand-overs", ""))
        .column(Column::text("refused"));
    for run in played {
        let summary = run.summary();
        let count = |key: &str| Cell::from(summary.deadlines[key].as_u64().unwrap_or(0));
        let refused = summary.gate["rejected"].as_object().into_iter().flatten();
        let refused = refused.filter(|(_, count)| count.as_u64() != Some(0));
        let refused: Vec<String> =
            refused.map(|(reason, count)| format!("{} {count}", reason.replace('_', " "))).collect();
        let refused = if refused.is_empty() { "–".to_owned() } else { refused.join(", ") };
        let swaps = summary.line_up["swaps"].as_array().map_or(0, Vec::len) as u64;
        table = table.row([
            Cell::series(run.name()),
            summary.pace.as_str().into(),
            summary.ticks.into(),
            count("missed"),
            count("plant_late"),
            swaps.into(),
            refused.into(),
        ]);
    }
    table
}

/// Settings that differ, and the machine.
fn differences(left: &[RunResults]) -> Section {
    let section = Section::new("Configuration");
    let of = |part: fn(&Summary) -> &Value, title: &str, same: &str| -> Block {
        let flat: Vec<BTreeMap<String, String>> =
            left.iter().map(|left| flattened(part(&left.summary))).collect();
        let keys: BTreeSet<&String> = flat.iter().flat_map(BTreeMap::keys).collect();
        let value = |map: &BTreeMap<String, String>, key: &str| {
            map.get(key).cloned().unwrap_or_else(|| "–".to_owned())
        };
        let mut table = Table::new(title).column(Column::text("key"));
        for left in left {
            table = table.column(Column::text(&left.name));
        }
        let mut differs = false;
        for key in keys {
            let values: Vec<String> = flat.iter().map(|map| value(map, key)).collect();
            if values.iter().any(|value| *value != values[0]) {
                differs = true;
                table = table.row(std::iter::once(key.clone()).chain(values).map(Cell::from));
            }
        }
        if differs { Block::from(table) } else { Block::from(same) }
    };
    section
        .with(of(|summary| &summary.scenario, "Settings that differ", "The scenarios are the same."))
        .with(of(|summary| &summary.machine, "Machines that differ", "The machines are the same."))
}

/// The leaves of `value` by their paths, as in `path.period`.
fn flattened(value: &Value) -> BTreeMap<String, String> {
    fn walk(value: &Value, at: &str, into: &mut BTreeMap<String, String>) {
        let join = |key: &str| if at.is_empty() { key.to_owned() } else { format!("{at}.{key}") };
        match value {
            Value::Object(map) => map.iter().for_each(|(key, value)| walk(value, &join(key), into)),
            Value::String(text) => drop(into.insert(at.to_owned(), text.clone())),
            other => drop(into.insert(at.to_owned(), other.to_string())),
        }
    }
    let mut leaves = BTreeMap::new();
    walk(value, "", &mut leaves);
    leaves
}

#[cfg(test)]
mod tests {
    use super::{flattened, names};
    use serde_json::json;

    #[test]
    fn leaves_have_the_names_that_set_takes() {
        let leaves = flattened(&json!({ "path": { "period": 6.0, "kind": "circle" }, "standby": ["a"] }));
        let expected = [("path.kind", "circle"), ("path.period", "6.0"), ("standby", "[\"a\"]")];
        assert!(leaves.iter().map(|(key, value)| (key.as_str(), value.as_str())).eq(expected), "{leaves:?}");
    }

    #[test]
    fn folders_of_one_name_are_told_apart_by_their_paths() {
        assert_eq!(names(&["a/one".into(), "a/two".into()]), ["one", "two"]);
        assert_eq!(names(&["a/one".into(), "b/one".into()]), ["a/one", "b/one"]);
    }
}
