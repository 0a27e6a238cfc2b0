//! The pages: one with the table of all machines, one for each machine with the results of its training.

use freeplay_harness::closed_loop::RATE;
use freeplay_report::{Axis, Block, Cell, Chart, Column, Document, Figure, Section, Series, Table, Verdict};
use freeplay_training::Trained;

use super::bench::CURVE_STRIDE;
use super::outcome::{METHODS, Outcome};

/// The page of all machines.
pub fn document(outcomes: &[Outcome]) -> Document {
    let checks: Vec<_> = outcomes.iter().flat_map(Outcome::checks).collect();
    let held = checks.iter().filter(|check| check.holds).count();
    let cells: Vec<_> = outcomes.iter().flat_map(|outcome| &outcome.cells).collect();
    let best = cells.iter().filter(|cell| cell.holds()).count();
    let mut document = Document::new("Freeplay: learning the remainder without a name")
        .subtitle("The machines run three paths with a tracker. A diagnosis names their effects, and a network learns the remainder. The test uses other paths and periods without a tracker")
        .overview((Verdict::passed(held == checks.len()), format!("{held} of {} checks hold.", checks.len())))
        .overview(Block::Figures(vec![
            Figure::new("diagnosed model and network is the best", format!("{best} of {}", cells.len()), "paths")
                .verdict(Verdict::passed(best == cells.len())),
        ]))
        .overview(table(outcomes));
    for outcome in outcomes {
        document = document.section(section(outcome));
    }
    document.footer("`freeplay demo --nameless`")
}

fn table(outcomes: &[Outcome]) -> Table {
    let mut table = Table::new("Deviation of the tool after the first 0.5 s")
        .column(Column::text("machine"))
        .column(Column::text("path"));
    for what in ["RMS", "greatest"] {
        for way in METHODS {
            table = table.column(Column::number(way, "mm").fixed(4).group(what));
        }
    }
    table = table.column(Column::number("removed", "%").fixed(0)).column(Column::text("best"));
    for outcome in outcomes {
        for cell in &outcome.cells {
            let number = |of: fn(&super::outcome::Reached) -> f64| {
                cell.reached.iter().map(move |reached| Cell::from(reached.as_ref().map(of)))
            };
            let judged = Cell::verdict_in_words(
                Verdict::passed(cell.holds()),
                if cell.holds() { "yes" } else { "no" },
            );
            let row = [Cell::from(outcome.machine.clone()), cell.path.clone().into()];
            let end = [Cell::from(cell.taken().map(|taken| 1e2 * taken)), judged];
            let numbers = number(|reached| reached.rms).chain(number(|reached| reached.max));
            table = table.row(row.into_iter().chain(numbers).chain(end));
        }
    }
    table.note("Removed: share of the diagnosed model's remainder that the network removes.")
}

fn section(outcome: &Outcome) -> Section {
    let named = if outcome.named.is_empty() { "nothing".to_owned() } else { outcome.named.join(", ") };
    let proved = |proved: bool| if proved { "proved" } else { "not proved, not used" };
    let words = format!(
        "Concealed: {}. Verdict of the diagnosis: `{}`; it names {named}. The network on the nominal model is {}, the one on the diagnosed model is \
         {}. Report on the network: `{}/report.html`.",
        outcome.hidden,
        outcome.verdict,
        proved(outcome.proved[0]),
        proved(outcome.proved[1]),
        outcome.machine
    );
    let mut section = Section::new(outcome.machine.clone()).with(words);
    if outcome.is_nominal {
        section =
            section.with("The held-out paths do not show a smaller remainder with the diagnosed model, so that the last column uses the nominal one.");
    }
    checked(outcome, section)
}

/// Adds the checks of `outcome`, and its result far outside the training, to `section`.
fn checked(outcome: &Outcome, section: Section) -> Section {
    let checks = outcome.checks().into_iter();
    let mut section = checks
        .fold(section, |section, check| section.with((Verdict::passed(check.holds), check.what.to_owned())));
    if let [Some(without), Some(with)] = outcome.far {
        section = section.with(format!(
            "On a path far outside the training, `narx-qp` leaves {:.4} mm RMS without the network and {:.4} mm with it.",
            without.rms, with.rms
        ));
    }
    section
}

/// The page of one machine: the tool's deviation on the judged paths, `courses` by path and method, and the results of the training.
pub fn of_machine(outcome: &Outcome, trained: &Trained, courses: &[(&str, Vec<Vec<f64>>)]) -> Document {
    let mut judged = checked(outcome, Section::new("On other paths, without a tracker"));
    for (path, drawn) in courses {
        let mut chart = Chart::trace(*path, Axis::new("time", "s"), Axis::new("tool deviation", "mm"))
            .in_view(0.0)
            .height(240);
        for (way, course) in METHODS.iter().zip(drawn) {
            let t: Vec<f64> = (0..course.len()).map(|k| (k as u64 * CURVE_STRIDE) as f64 / RATE).collect();
            chart = chart.series(Series::line(*way, &t, course));
        }
        judged = judged.with(chart);
    }
    freeplay_training::page::document(trained).section(judged)
}
