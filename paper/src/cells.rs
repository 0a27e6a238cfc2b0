//! `freeplay cells`: the table of compensation, cell by cell: no compensation, `quasi-static`, `narx-qp`.
//!
//! Every cell is a lockstep run of the paper's arm in torque mode with ideal sensors, in this process. Five parts: the paper's clearances and times on smooth,
//! softly and sharply cornered paths; the same without a tracked tool; the controllers' clearance 10 % too small and too large; and two joints with play at
//! once. The verdict: `narx-qp` is at least as good as `quasi-static` and as no compensation in RMS and maximum, to `HARMLESS`, and its commands stay within
//! the limits of the joints.

use std::fmt::Write as _;

use clap::{Args, ValueEnum};
use comfy_table::CellAlignment;
use freeplay_controller::computed_torque::COMPUTED_TORQUE;
use freeplay_controller::narx_qp::NARX_QP;
use freeplay_controller::quasi_static::QUASI_STATIC;
use freeplay_model::paper_arm;
use freeplay_path::{PathKind, PathSpec};
use freeplay_plant::{DeviationStatistics, SensorsSpec, UsedByJoint};
use freeplay_storage::plain_words;
use freeplay_terminal::arguments::{Format, above_zero};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::layout::text_table;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::parallel::on_all_cores;
use freeplay_terminal::progress;
use serde::Serialize;

use freeplay_harness::closed_loop::{ClosedLoop, Plays, effects_with_plays, task};

/// A difference below the resolution of any tool tracker, mm.
const HARMLESS: f64 = 1e-4;
/// The only joint with play, by index.
const ALONE: usize = 4;

/// A part of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// The controllers have the true model and a tracked tool.
    Tracked,
    /// The controllers have the true model and no tracked tool.
    Untracked,
    /// The models of the controllers have 10 % less and 10 % more clearance than the plant. The tool is tracked.
    Wrong,
    /// The models are wrong in the same way. The tool is not tracked.
    WrongUntracked,
    /// Two joints have play. The tool is tracked.
    Two,
}

const PARTS: [Part; 5] = [Part::Tracked, Part::Untracked, Part::Wrong, Part::WrongUntracked, Part::Two];

/// Computes the table of compensation results.
#[derive(Args, Debug)]
pub struct CellsArgs {
    /// Parts of the table. Default: all parts.
    #[arg(long, value_delimiter = ',')]
    part: Vec<Part>,
    /// Paths to follow.
    #[arg(long, value_delimiter = ',', default_value = "lissajous,square,square_sharp")]
    path: Vec<String>,
    /// Lap times, s.
    #[arg(long, value_delimiter = ',', default_value = "6,12", value_parser = above_zero)]
    period: Vec<f64>,
    /// Clearances, mm.
    #[arg(long, value_delimiter = ',', default_value = "0.2,0.4,0.6", value_parser = above_zero)]
    clearance: Vec<f64>,
    /// Pairs of joints with play, counted from 1. The first joint has half of the largest clearance, and the second joint has all
    /// of it.
    #[arg(long, value_delimiter = ',', default_value = "2+3,2+5,3+5,4+5", value_parser = pair)]
    pair: Vec<(usize, usize)>,
    /// Time from which the deviation counts, s.
    #[arg(long, default_value_t = DeviationStatistics::START_DURATION)]
    after: f64,
    /// Option of narx-qp, as in --option passages=false.
    #[arg(long, value_name = "KEY=VALUE")]
    option: Vec<String>,
    /// Option of quasi-static, as in --quasi-static-option horizon=0.02.
    #[arg(long, value_name = "KEY=VALUE")]
    quasi_static_option: Vec<String>,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// One cell of the grid of paths, periods and clearances.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// The part of the grid to which the cell belongs.
    pub part: Part,
    /// The reference.
    #[serde(skip)]
    pub path: PathSpec,
    /// Joints with play, by index, and their clearances, m: the truth.
    pub plays: Plays,
    /// Joints with play and their clearances as the controllers believe them.
    pub believed: Plays,
    /// Time from which the deviation counts, s.
    pub after: f64,
}

/// Results of one controller in one cell, after the start of the run.
#[derive(Clone, Debug, Serialize)]
pub struct Reached {
    /// RMS of the tool's deviation, mm.
    pub rms: f64,
    /// Its maximum, mm.
    pub max: f64,
    /// Answers whose programme had no solution.
    pub failures: u64,
    /// Use of the motors, impacts in the bearings included.
    pub joint_use: Vec<UsedByJoint>,
    /// Use of the motors by the commands: corrected reference and torque.
    pub commanded: Vec<UsedByJoint>,
}

/// A cell and the results of the three controllers in it.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The cell.
    #[serde(flatten)]
    pub cell: Cell,
    /// Name of the path.
    pub path: &'static str,
    /// Time of a lap, s.
    pub period: f64,
    /// Without compensation.
    pub none: Reached,
    /// `quasi-static`.
    pub quasi_static: Reached,
    /// `narx-qp`.
    pub narx_qp: Reached,
}

impl Row {
    /// True if narx-qp is at least as good as quasi-static and as no compensation.
    pub fn is_good(&self) -> bool {
        let at_most = |ours: f64, theirs: f64| ours <= theirs + HARMLESS;
        let others = [&self.none, &self.quasi_static];
        others
            .into_iter()
            .all(|other| at_most(self.narx_qp.rms, other.rms) && at_most(self.narx_qp.max, other.max))
    }

    /// True if the commands of narx-qp stay within the limits.
    pub fn is_within_limits(&self) -> bool {
        let used = self.narx_qp.commanded.iter().flat_map(UsedByJoint::all);
        used.into_iter().all(|(_, used)| used.share.is_none_or(|share| share <= 1.0))
    }

    /// True if both conditions hold.
    pub fn holds(&self) -> bool {
        self.is_good() && self.is_within_limits()
    }
}

impl Cell {
    /// A cell with play in joint 5 alone and a correct model, clearance in mm.
    pub fn plain(part: Part, path: PathSpec, clearance: f64) -> Self {
        let plays = vec![(ALONE, clearance * 1e-3)];
        Self { part, path, believed: plays.clone(), plays, after: DeviationStatistics::START_DURATION }
    }

    /// Runs it under `controller` with `options`.
    ///
    /// # Errors
    /// A run that fails.
    pub fn reach(&self, controller: &str, options: toml::Table) -> Result<Reached, Failure> {
        let arm = paper_arm().arm;
        let folder = tempfile::tempdir().map_err(Failure::internal)?;
        let task = task(&arm, &self.believed, &self.path, options, folder.path())?;
        let tracked = !matches!(self.part, Part::Untracked | Part::WrongUntracked);
        let (effects, path, after) = (effects_with_plays(&arm, &self.plays)?, &self.path, self.after);
        let closed = ClosedLoop {
            arm: &arm,
            effects: &effects,
            path,
            controller,
            task: &task,
            tracked,
            after,
            sensors: (SensorsSpec::default(), 0),
            beyond: &[],
        };
        let outcome = closed.run(|_| {})?;
        let [norm, ..] = outcome.deviation.components();
        Ok(Reached {
            rms: norm.rms_after_start,
            max: norm.max_after_start,
            failures: outcome.failures,
            joint_use: outcome.joint_use.joints(),
            commanded: outcome.commanded.joints(),
        })
    }

    /// Runs it under all three controllers, `quasi-static` and `narx-qp` with their options.
    ///
    /// # Errors
    /// A run that fails.
    pub fn row(self, [quasi_static, narx_qp]: [toml::Table; 2]) -> Result<Row, Failure> {
        Ok(Row {
            none: self.reach(COMPUTED_TORQUE, toml::Table::new())?,
            quasi_static: self.reach(QUASI_STATIC, quasi_static)?,
            narx_qp: self.reach(NARX_QP, narx_qp)?,
            path: self.path.kind.name(),
            period: self.path.period,
            cell: self,
        })
    }
}

/// Makes the table; the verdict fails if narx-qp is worse than quasi-static.
///
/// # Errors
/// A path that does not exist; runs that fail.
pub fn cells(args: &CellsArgs) -> Result<Exit, Failure> {
    let all = listed(args)?;
    let options =
        [options("--quasi-static-option", &args.quasi_static_option)?, options("--option", &args.option)?];
    let shortest = args.period.iter().copied().fold(f64::INFINITY, f64::min);
    if !(args.after >= 0.0 && args.after < shortest) {
        let words = format!("--after {}: give 0 s to below the shortest --period, {shortest} s", args.after);
        return Err(Failure::usage(words));
    }
    let bar = progress::bar(all.len() as u64, "{msg} {wide_bar} {pos}/{len} {elapsed}").with_message("cells");
    let rows = on_all_cores(all.len(), |index| {
        let row = all[index].clone().row(options.clone());
        bar.inc(1);
        row
    })?;
    bar.finish_and_clear();
    match args.format {
        Format::Json => {
            say(&format!("{}\n", serde_json::to_string_pretty(&rows).map_err(Failure::internal)?))?;
        }
        Format::Text => show(&in_words(&rows))?,
    }
    Ok(if rows.iter().all(Row::holds) { Exit::Done } else { Exit::Verdict })
}

/// The requested cells, part by part. The parts with wrong clearances and with two joints take the largest clearance.
fn listed(args: &CellsArgs) -> Result<Vec<Cell>, Failure> {
    let parts = if args.part.is_empty() { PARTS.to_vec() } else { args.part.clone() };
    let kinds: Vec<PathKind> = args.path.iter().map(|name| kind(name)).collect::<Result<_, _>>()?;
    let largest = args.clearance.iter().copied().fold(f64::NAN, f64::max);
    let mut cells = Vec::new();
    for part in parts {
        for &kind in &kinds {
            for &period in &args.period {
                let path = PathSpec { kind, period, ..PathSpec::default() };
                let plain =
                    |clearance: f64| Cell { after: args.after, ..Cell::plain(part, path.clone(), clearance) };
                match part {
                    Part::Tracked | Part::Untracked => {
                        cells.extend(args.clearance.iter().map(|&clearance| plain(clearance)));
                    }
                    Part::Wrong | Part::WrongUntracked => cells.extend([0.9, 1.1].map(|share| Cell {
                        believed: vec![(ALONE, share * largest * 1e-3)],
                        ..plain(largest)
                    })),
                    Part::Two => cells.extend(args.pair.iter().map(|&(first, second)| {
                        let plays = vec![(first, 0.5 * largest * 1e-3), (second, largest * 1e-3)];
                        Cell { believed: plays.clone(), plays, ..plain(largest) }
                    })),
                }
            }
        }
    }
    Ok(cells)
}

/// Two joints, counted from 1, as indices.
fn pair(text: &str) -> Result<(usize, usize), String> {
    let joint = |text: &str| text.parse().ok().and_then(|joint: usize| joint.checked_sub(1));
    let pair = text.split_once('+').and_then(|(first, second)| joint(first).zip(joint(second)));
    let known = |&(first, second): &(usize, usize)| first < second && second < paper_arm().arm.dof();
    pair.filter(known)
        .ok_or_else(|| "give two joints of the arm, the lower one first, such as 3+5".to_owned())
}

/// Lines of TOML, one for each KEY=VALUE of `flag`, as a table.
fn options(flag: &str, lines: &[String]) -> Result<toml::Table, Failure> {
    let table: Result<toml::Table, toml::de::Error> = lines.join("\n").parse();
    table.map_err(|error| Failure::usage(format!("{flag}: {}", plain_words(&error.to_string()))))
}

fn kind(name: &str) -> Result<PathKind, Failure> {
    let all = [PathKind::Lissajous, PathKind::Circle, PathKind::Square, PathKind::SquareSharp];
    all.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|kind| kind.name()).collect();
        Failure::usage(format!("--path {name}: give one of {}", names.join(", ")))
    })
}

fn in_words(rows: &[Row]) -> String {
    let mut table = text_table();
    table.set_header([
        "\npart",
        "\npath",
        "\nT [s]",
        "\njoints",
        "clearance [mm]\ntrue",
        "\nbelieved",
        "none [mm]\nRMS",
        "\nmax",
        "quasi-static\nRMS",
        "\nmax",
        "narx-qp\nRMS",
        "\nmax",
        "programme\nfailed",
        "commanded: share\nof a limit",
        "measured\nnone",
        "\nquasi-static",
        "\nnarx-qp",
        "",
    ]);
    for row in rows {
        table.add_row(cells_of(row));
    }
    for column in 2..17 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let good = rows.iter().filter(|row| row.is_good()).count();
    let within = rows.iter().filter(|row| row.is_within_limits()).count();
    let mut text = format!("{table}\n");
    let _ = writeln!(
        text,
        "\nThe tool's deviation in mm after the start of the run. narx-qp is at least as good as quasi-static and as no compensation, in RMS and \
         maximum and to {HARMLESS} mm, in {good} of {} cells.\nCommanded: the reference with its correction, and the torque; it stays within the \
         limits in {within}. Measured: the values of the encoders, including the impacts of landing journals on the light joints.",
        rows.len()
    );
    text
}

fn cells_of(row: &Row) -> Vec<String> {
    let plays = |plays: &Plays| {
        let each = plays.iter().map(|(_, clearance)| format!("{:.2}", clearance * 1e3));
        each.collect::<Vec<_>>().join(" + ")
    };
    let joints: Vec<_> = row.cell.plays.iter().map(|(joint, _)| (joint + 1).to_string()).collect();
    let part = row.cell.part.to_possible_value().map_or_else(String::new, |part| part.get_name().to_owned());
    let mut cells = vec![part, row.path.to_owned(), format!("{}", row.period)];
    cells.extend([joints.join(" + "), plays(&row.cell.plays), plays(&row.cell.believed)]);
    for reached in [&row.none, &row.quasi_static, &row.narx_qp] {
        cells.extend([format!("{:.4}", reached.rms), format!("{:.4}", reached.max)]);
    }
    cells.push(row.narx_qp.failures.to_string());
    cells.push(greatest(&row.narx_qp.commanded));
    cells.extend([&row.none, &row.quasi_static, &row.narx_qp].map(|reached| greatest(&reached.joint_use)));
    let faults = [(row.is_good(), "worse"), (row.is_within_limits(), "beyond limits")];
    let faults: Vec<_> = faults.iter().filter(|(fine, _)| !fine).map(|(_, fault)| *fault).collect();
    cells.push(faults.join(", "));
    cells
}

/// The greatest share of a limit, and the name of this limit.
fn greatest(joints: &[UsedByJoint]) -> String {
    let all = joints.iter().enumerate().flat_map(|(joint, used)| {
        used.all()
            .into_iter()
            .filter_map(move |(name, used)| used.share.map(|share| (share, joint + 1, name)))
    });
    let most = all.max_by(|one, two| one.0.total_cmp(&two.0));
    most.map_or_else(
        || "–".to_owned(),
        |(share, joint, name)| format!("{:.0} % {name} {joint}", 100.0 * share),
    )
}
