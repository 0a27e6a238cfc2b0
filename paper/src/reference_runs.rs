//! `freeplay reference-runs`: the 40 reference runs of the paper's arm, compared with an independent simulator.
//!
//! Definition of a run: the arm of `freeplay_model::paper_arm` with play in joint 5, a path of `freeplay_path`, start on
//! the path with the journal centred. `driven`: the six joints follow the path exactly. `ctc`: every tick
//! τ = RNEA(q, v, q̈_d + 2ζω(q̇_d − v) + ω²(q_d − q)) of the six-joint model, ω = 50 rad/s, ζ = 1, applied at once and
//! held for the tick. The reference took semi-implicit Euler steps of 10 µs.

use std::path::PathBuf;

use clap::Args;
use comfy_table::CellAlignment;
use freeplay_harness::scenario::Drive;
use freeplay_laws::ClearanceTable;
use freeplay_path::{PathKind, PathSpec};
use freeplay_plant::DeviationStatistics;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::layout::text_table;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::parallel::on_all_cores;
use freeplay_terminal::{messages, progress};
use serde::Deserialize;

use crate::reference_pair::{Figures, Pair};
use crate::simulation::{Scene, Simulation, TICK};
use freeplay_terminal::files::claim;

/// The reference data, as received.
const REFERENCE: &str = include_str!("../data/reference_runs.csv");

/// Simulates the reference runs, and compares them with an independent reference.
#[derive(Args, Debug)]
pub struct ReferenceArgs {
    /// Number of sub-steps in one tick.
    #[arg(long, default_value_t = 50)]
    substeps: u32,
    /// Simulate only runs whose name contains this text.
    #[arg(long, default_value = "")]
    only: String,
    /// Write a report to this folder.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// One row of the reference. Without play the contact columns are empty.
#[derive(Clone, Debug, Deserialize)]
pub struct Reference {
    /// Its name.
    pub run: String,
    /// "driven" or "ctc".
    pub mode: String,
    /// Shape of the path.
    pub path: PathKind,
    /// Radial clearance, mm.
    pub c_mm: f64,
    /// Time of the lap, s.
    #[serde(rename = "T_s")]
    pub period: f64,
    gravity: f64,
    /// Its results, from the same row.
    #[serde(skip)]
    pub figures: Figures,
}

/// The scene of the reference simulation in `row`, with its clearance changed by the fraction `nudge`.
fn scene(row: &Reference, substeps: u32, nudge: f64) -> Scene {
    Scene {
        drive: if row.mode == "driven" { Drive::Driven } else { Drive::Torque },
        path: PathSpec { kind: row.path, period: row.period, ..PathSpec::default() },
        play: (row.c_mm > 0.0).then(|| ClearanceTable::new(row.c_mm * 1e-3 * (1.0 + nudge))),
        gravity: row.gravity,
        tick: TICK,
        substeps,
    }
}

/// Simulates `row` with its clearance changed by the fraction `nudge`.
fn simulate(row: &Reference, substeps: u32, nudge: f64) -> Result<Figures, Failure> {
    let mut run = Simulation::new(&scene(row, substeps, nudge))?;
    let mut deviation = DeviationStatistics::new(DeviationStatistics::START_DURATION);
    let ticks = (row.period / TICK).round() as u64;
    for tick in 0..=ticks {
        let now = run.deviation();
        deviation.add(tick as f64 * TICK, &now);
        if tick < ticks {
            run.tick().map_err(|error| Failure::internal(format!("{}: {error}", row.run)))?;
        }
    }
    let [norm, x, y, z] = deviation.components();
    let tally = run.system().tallies().next();
    let fractions = tally.map(|tally| tally.fractions());
    Ok(Figures {
        free: fractions.map(|f| f[0]),
        impact: fractions.map(|f| f[1]),
        continuous: fractions.map(|f| f[2]),
        n_contacts: tally.map(|tally| tally.contacts as f64),
        peak_normal: tally.map(|tally| tally.peak_normal_force),
        peak_base: run.system_mut().take_peaks().base_force,
        rms_x: x.rms,
        rms_y: y.rms,
        rms_z: z.rms,
        norm_rms: norm.rms,
        norm_max: norm.max,
    })
}

/// Relative changes of the clearance that show the uncertainty of a chaotic run: each is less than 0.01 µm, but the bounces at a sharp corner multiply it.
const PERTURBATIONS: [f64; 8] = [-2e-5, -1.5e-5, -1e-5, -5e-6, 5e-6, 1e-5, 1.5e-5, 2e-5];

/// The least and greatest of each figure over nudged runs, `ours` included.
fn spread(row: &Reference, substeps: u32, ours: Figures) -> Result<[Figures; 2], Failure> {
    let mut ends = [ours, ours];
    for nudge in PERTURBATIONS {
        let other = simulate(row, substeps, nudge)?;
        for (end, choose) in ends.iter_mut().zip([f64::min as fn(f64, f64) -> f64, f64::max]) {
            end.merge(&other, choose);
        }
    }
    Ok(ends)
}

/// The values within `ends` that are nearest to the figures `theirs`.
fn nearest(theirs: &Figures, ends: &[Figures; 2]) -> Figures {
    let mut nearest = *theirs;
    nearest.merge(&ends[0], f64::max);
    nearest.merge(&ends[1], f64::min);
    nearest
}

/// The figures of `ours` beyond the tolerance: fractions 0.5 points; RMS 1 % on smooth paths, 5 % on sharp ones; peak normal force 2 % on smooth paths; peak
/// force of joint 1 2 %.
fn faults(smooth: bool, theirs: &Figures, ours: &Figures) -> Vec<String> {
    let mut faults = Vec::new();
    let mut relative = |name: &str, theirs: f64, ours: f64, tolerance: f64| {
        let error = ours / theirs - 1.0;
        if error.abs() > tolerance {
            faults.push(format!("{name} {:+.2} % (tolerance {} %)", error * 100.0, tolerance * 100.0));
        }
    };
    // Without play the deviation is a tracking error of less than a micrometre, below the resolution of the samples of the path.
    if theirs.free.is_some() {
        relative("RMS", theirs.norm_rms, ours.norm_rms, if smooth { 0.01 } else { 0.05 });
    }
    relative("peak force of joint 1", theirs.peak_base, ours.peak_base, 0.02);
    if let (true, Some(theirs), Some(ours)) = (smooth, theirs.peak_normal, ours.peak_normal) {
        relative("peak normal force", theirs, ours, 0.02);
    }
    let shares = [
        ("free", theirs.free, ours.free),
        ("impact", theirs.impact, ours.impact),
        ("continuous", theirs.continuous, ours.continuous),
    ];
    for (name, theirs, ours) in shares {
        if let (Some(theirs), Some(ours)) = (theirs, ours)
            && (theirs - ours).abs() > 5e-3
        {
            faults.push(format!("{name} {:+.2} points (tolerance 0.5)", (ours - theirs) * 100.0));
        }
    }
    faults
}

/// Judges one run. If corners make it chaotic and a single start is out of tolerance, the reference must lie within tolerance of the spread over clearances
/// within 0.002 %.
fn pair(row: &Reference, substeps: u32, ours: Figures) -> Result<Pair, Failure> {
    let smooth = row.path != PathKind::SquareSharp;
    let theirs = row.figures;
    let mut pair = Pair {
        run: row.run.clone(),
        smooth,
        theirs,
        ours,
        faults: faults(smooth, &theirs, &ours),
        spread: None,
    };
    if !smooth && !pair.faults.is_empty() {
        let ends = spread(row, substeps, ours)?;
        pair.faults = faults(smooth, &theirs, &nearest(&theirs, &ends));
        pair.spread = Some(ends);
    }
    Ok(pair)
}

impl Pair {
    /// The verdict in words.
    pub fn verdict(&self) -> String {
        let range = |ends: &[Figures; 2]| {
            let percent = |end: &Figures| end.free.unwrap_or(f64::NAN) * 100.0;
            format!(
                "{:.1} to {:.1} % free for clearances within 0.002 %",
                percent(&ends[0]),
                percent(&ends[1])
            )
        };
        match (&self.spread, self.faults.is_empty()) {
            (None, true) => "ok".to_owned(),
            (Some(ends), true) => format!("ok, chaotic: {}", range(ends)),
            (None, false) => self.faults.join("; "),
            (Some(ends), false) => format!("{} beyond the spread: {}", self.faults.join("; "), range(ends)),
        }
    }
}

/// The rows of the reference.
///
/// # Errors
/// A table that can't be read.
pub fn read_reference() -> Result<Vec<Reference>, csv::Error> {
    let mut reader = csv::Reader::from_reader(REFERENCE.as_bytes());
    let headers = reader.headers()?.clone();
    reader
        .records()
        .map(|record| {
            let record = record?;
            let figures = record.deserialize(Some(&headers))?;
            Ok(Reference { figures, ..record.deserialize(Some(&headers))? })
        })
        .collect()
}

/// Simulates the reference runs and prints them beside the reference.
///
/// # Errors
/// A folder that can't be written; a run that can't be simulated.
pub fn reference_runs(args: &ReferenceArgs) -> Result<Exit, Failure> {
    let mut rows = read_reference().map_err(Failure::internal)?;
    rows.retain(|row| row.run.contains(&args.only));
    if rows.is_empty() {
        let words = "give a part of a name, such as lissajous or T12, or leave out --only for all runs";
        return Err(Failure::usage(format!("no reference run has {:?} in its name; {words}", args.only)));
    }
    let claimed = |out| claim(Some(out), &["report.html"], args.force);
    let folder = args.out.as_deref().map(claimed).transpose()?;
    let bar = progress::bar(rows.len() as u64, "{msg} {wide_bar} {pos}/{len} {elapsed}")
        .with_message("reference runs");
    let figures = on_all_cores(rows.len(), |index| {
        let figures = simulate(&rows[index], args.substeps, 0.0);
        bar.inc(1);
        figures
    })?;
    bar.finish_and_clear();
    let pairs = rows
        .iter()
        .zip(figures)
        .map(|(row, ours)| pair(row, args.substeps, ours))
        .collect::<Result<Vec<_>, _>>()?;
    match args.format {
        Format::Json => {
            say(&format!("{}\n", serde_json::to_string_pretty(&pairs).map_err(Failure::internal)?))?
        }
        Format::Text => show(&in_words(&pairs, args.substeps))?,
    }
    if let Some(folder) = &folder {
        let report = crate::reference_report::write(&pairs, args.substeps, folder.path())?;
        messages::note(format_args!("report  {}", report.display()));
    }
    Ok(if pairs.iter().all(|pair| pair.faults.is_empty()) { Exit::Done } else { Exit::Verdict })
}

/// "theirs / ours" of one figure.
pub fn beside(theirs: Option<f64>, ours: Option<f64>, scale: f64, digits: usize) -> String {
    match (theirs, ours) {
        (Some(theirs), Some(ours)) => format!("{:.digits$} / {:.digits$}", theirs * scale, ours * scale),
        _ => "–".to_owned(),
    }
}

fn in_words(pairs: &[Pair], substeps: u32) -> String {
    let mut table = text_table();
    table.set_header([
        "run",
        "free %",
        "continuous %",
        "contacts",
        "peak F_N [N]",
        "peak J1 [N]",
        "RMS [mm]",
        "max [mm]",
        "",
    ]);
    for pair in pairs {
        let (theirs, ours) = (&pair.theirs, &pair.ours);
        table.add_row([
            pair.run.clone(),
            beside(theirs.free, ours.free, 100.0, 2),
            beside(theirs.continuous, ours.continuous, 100.0, 2),
            beside(theirs.n_contacts, ours.n_contacts, 1.0, 0),
            beside(theirs.peak_normal, ours.peak_normal, 1.0, 0),
            beside(Some(theirs.peak_base), Some(ours.peak_base), 1.0, 0),
            beside(Some(theirs.norm_rms), Some(ours.norm_rms), 1.0, 4),
            beside(Some(theirs.norm_max), Some(ours.norm_max), 1.0, 3),
            pair.verdict(),
        ]);
    }
    for column in 1..8 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let passed = pairs.iter().filter(|pair| pair.faults.is_empty()).count();
    format!(
        "reference / ours, {substeps} sub-steps a tick\n{table}\n\n{passed} of {} runs within tolerance (fractions 0.5 points; RMS 1 % smooth, 5 % sharp; peaks 2 %)\n",
        pairs.len()
    )
}
