//! The page of the demonstration: one table, then each machine with its findings and their benefit.

use freeplay_diagnosis::page::{pictures, strongest_map};
use freeplay_model::paper_arm;
use freeplay_report::units::written;
use freeplay_report::{Axis, Block, Cell, Chart, Column, Document, Drawing, Section, Series, Table, Verdict};
use freeplay_terminal::exit::Failure;

use super::play::{CONTROLLER, Outcome, Played};
use super::{errors, found, judged, named, verdict};

/// Number of samples from one drawn deviation to the next.
const STRIDE: usize = 5;

/// The page.
///
/// # Errors
/// Recordings that can't be read back.
pub fn document(outcomes: &[Outcome], period: f64) -> Result<Document, Failure> {
    let right = outcomes.iter().filter(|outcome| outcome.is_right()).count();
    let all = outcomes.len();
    let mut document = Document::new("Freeplay demonstration")
        .subtitle(format!(
            "The paper's arm on two laps of the smooth path of {period} s each, controller {CONTROLLER}, in lockstep"
        ))
        .overview((
            Verdict::passed(right == all),
            format!("{right} of {all} machines are diagnosed right from their recordings alone."),
        ))
        .overview(table(outcomes));
    for outcome in outcomes {
        document = document.section(section(outcome)?);
    }
    Ok(document.footer("`freeplay demo`"))
}

fn table(outcomes: &[Outcome]) -> Table {
    let mut table = Table::new("Concealed effects, findings and their use")
        .column(Column::text("concealed").wrapping())
        .column(Column::text("verdict"))
        .column(Column::text("found").wrapping())
        .column(Column::text("held-out error"))
        .column(Column::number("nominal model", "mm").fixed(3).group("tool deviation, RMS"))
        .column(Column::number("diagnosed model", "mm").fixed(3).group("tool deviation, RMS"))
        .note("Held-out error: error of the model as given and with the findings, on data that were not in the fit. Tool deviation: true tool minus the tool of the perfect arm at the desired joints, after the first 0.5 s, with one controller and two models.");
    for outcome in outcomes {
        let error = errors(outcome).map_or_else(String::new, |(channel, unit, before, after)| {
            format!("{channel}: {} → {} {unit}", written(before), written(after))
        });
        table = table.row([
            Cell::from(outcome.case.hidden),
            Cell::verdict_in_words(judged(outcome).0, format!("{}: {}", verdict(outcome), judged(outcome).1)),
            found(outcome).join("; ").into(),
            error.into(),
            outcome.before.deviation.into(),
            outcome.after.as_ref().map(|after| after.deviation).into(),
        ]);
    }
    table
}

fn section(outcome: &Outcome) -> Result<Section, Failure> {
    let mut section =
        Section::new(format!("Concealed: {}", outcome.case.hidden)).with(outcome.diagnosis.statement.clone());
    if let Some(failure) = &outcome.failure {
        section = section.with((Verdict::Fail, format!("The run with the diagnosed model: {failure}")));
    }
    // The complete diagnosis shows the other pictures.
    section = picture(outcome).into_iter().fold(section, Section::with);
    if !named(outcome) {
        section = strongest_map(&outcome.diagnosis).into_iter().fold(section, Section::with);
    }
    let axis = Axis::new("tool deviation", "mm");
    let mut chart = Chart::trace("Tool deviation", Axis::new("time", "s"), axis).height(230).in_view(0.0);
    chart = chart.series(deviation(&outcome.before, "nominal model")?);
    if let Some(after) = &outcome.after {
        chart = chart.series(deviation(after, "diagnosed model")?);
    }
    let whole =
        format!("The whole diagnosis: `{0}/report.html`; its model: `{0}/model.toml`.", outcome.case.name);
    Ok(section.with(chart).with(Block::Text(whole)))
}

/// The picture of the first finding; `None` without one.
pub fn picture(outcome: &Outcome) -> Option<Drawing> {
    if outcome.diagnosis.effects.is_empty() {
        return None;
    }
    pictures(&outcome.diagnosis, &paper_arm().arm, 0).into_iter().next()
}

/// The distance of the tool from its position on the perfect arm.
fn deviation(played: &Played, name: &str) -> Result<Series, Failure> {
    let recording = freeplay_recording::read(&played.recording, None).map_err(Failure::input)?;
    let column = |axis: &str| recording.column(&format!("deviation_{axis}")).map(<[f64]>::to_vec);
    let (Some(x), Some(y), Some(z)) = (column("x"), column("y"), column("z")) else {
        return Err(Failure::internal(format!("{}: no deviation recorded", played.recording.display())));
    };
    let rows = (0..recording.len()).step_by(STRIDE);
    let (t, size): (Vec<f64>, Vec<f64>) =
        rows.map(|k| (recording.t[k], 1e3 * (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt())).unzip();
    Ok(Series::line(name, &t, &size))
}
