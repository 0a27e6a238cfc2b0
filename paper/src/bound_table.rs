//! `freeplay bound`: the least deviation at sharp corners compared with that of the controllers.
//!
//! The printed optimum is found, not proved. A local search with full knowledge of the arm, from several starts (see `bound`), finds it, so that the true
//! optimum can be lower; and it counts no deviation outside the corners, so that no controller can reach it entirely. The closed share is `(quasi-static −
//! narx-qp)/(quasi-static − optimum)`, with the controllers' deviations from lockstep runs on the true plant in this process (see `cells`): with feedback,
//! torques held for a tick, and the first half second.

use std::fmt::Write as _;

use clap::Args;
use comfy_table::CellAlignment;
use freeplay_path::{PathKind, PathSpec};
use freeplay_plant::DeviationStatistics;
use freeplay_terminal::arguments::{Format, above_zero};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::layout::text_table;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::parallel::on_all_cores;
use serde::Serialize;

use crate::bound::{Bound, sharp_square};
use crate::cells::{Cell, Part, Row};

/// Computes the smallest possible deviation at sharp corners.
#[derive(Args, Debug)]
pub struct BoundArgs {
    /// Lap times, s.
    #[arg(long, value_delimiter = ',', default_value = "6,12", value_parser = above_zero)]
    period: Vec<f64>,
    /// Clearances, mm.
    #[arg(long, value_delimiter = ',', default_value = "0.2,0.4,0.6", value_parser = above_zero)]
    clearance: Vec<f64>,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// The optimum of one cell and the results of the controllers in it.
#[derive(Clone, Debug, Serialize)]
struct Compared {
    bound: Bound,
    reached: Row,
    /// Share of the difference between quasi-static and the optimum that narx-qp closes: for the RMS, and for the maximum.
    closed: [f64; 2],
}

impl Compared {
    fn of(period: f64, clearance: f64) -> Result<Self, Failure> {
        let path = PathSpec { kind: PathKind::SquareSharp, period, ..PathSpec::default() };
        let bound = sharp_square(period, clearance)?;
        let reached = Cell::plain(Part::Tracked, path, clearance).row(Default::default())?;
        let closed = |from: f64, to: f64, least: f64| (from - to) / (from - least);
        let (from, to) = (&reached.quasi_static, &reached.narx_qp);
        Ok(Self {
            closed: [closed(from.rms, to.rms, bound.rms()), closed(from.max, to.max, bound.max())],
            bound,
            reached,
        })
    }
}

/// Computes the bounds and prints them with the results of the controllers.
///
/// # Errors
/// An impossible clearance or period; runs that fail.
pub fn bound(args: &BoundArgs) -> Result<Exit, Failure> {
    let cells = args.period.iter().flat_map(|&period| args.clearance.iter().map(move |&c| (period, c)));
    let cells: Vec<_> = cells.collect();
    let compared = on_all_cores(cells.len(), |index| Compared::of(cells[index].0, cells[index].1))?;
    match args.format {
        Format::Json => {
            say(&format!("{}\n", serde_json::to_string_pretty(&compared).map_err(Failure::internal)?))?;
        }
        Format::Text => show(&in_words(&compared))?,
    }
    Ok(Exit::Done)
}

fn in_words(all: &[Compared]) -> String {
    let mut table = text_table();
    table.set_header([
        "\nT [s]",
        "\nc [mm]",
        "RMS [mm]\nnone",
        "\nquasi-static",
        "\nnarx-qp",
        "\nits plan",
        "\noptimum",
        "on the\nplant",
        "share of\nthe way",
        "max [mm]\nnone",
        "\nquasi-static",
        "\nnarx-qp",
        "\noptimum",
        "share of\nthe way",
    ]);
    for Compared { bound, reached, closed } in all {
        let mm = |value: f64| format!("{value:.4}");
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        table.add_row([
            bound.period.to_string(),
            bound.clearance.to_string(),
            mm(reached.none.rms),
            mm(reached.quasi_static.rms),
            mm(reached.narx_qp.rms),
            mm(bound.planned.rms),
            mm(bound.rms()),
            bound.measured.map_or_else(|| "–".to_owned(), |found| mm(found.rms)),
            percent(closed[0]),
            mm(reached.none.max),
            mm(reached.quasi_static.max),
            mm(reached.narx_qp.max),
            mm(bound.max()),
            percent(closed[1]),
        ]);
    }
    for column in 0..14 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let least = all.iter().map(|one| one.closed[0]).fold(f64::INFINITY, f64::min);
    let mut text = format!(
        "Sharp square, joint 5, after {} s: deviation under the controllers, and the least deviation found with full knowledge of the arm\n{table}\n",
        DeviationStatistics::START_DURATION
    );
    let _ = writeln!(
        text,
        "\nA local search from several starts finds the optimum without a proof, and only corners count; \"on the plant\" is the measurement of \
         prescribed joints on it there.\nIn RMS, narx-qp goes at least {:.0} % of the way from quasi-static to this optimum.",
        100.0 * least
    );
    text
}
