//! Page of a training: key figures, the forecasts of held-out paths, the tool's deviation before and after, and the region of validity.

use freeplay_controller::remainder::WeightFile;
use freeplay_report::{
    Axis, Block, Cell, Chart, Column, Document, Drawing, Figure, Mark, Section, Series, Table, Verdict,
};

use crate::forecast::Forecast;
use crate::held_out::{Tried, rms};
use crate::rehearsal::DeviationCurve;
use crate::trained::Trained;

/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// The page of a training.
pub fn document(trained: &Trained) -> Document {
    let file = &trained.file;
    let verdict = Verdict::passed(trained.receipt.proved);
    Document::new("Freeplay training")
        .subtitle(format!(
            "Remainder of the tool's deviation beyond the model, learned on {}",
            conditions(file)
        ))
        .overview((verdict, trained.verdict_in_words().to_owned()))
        .overview(Block::Figures(figures(trained)))
        .overview(table(&trained.tried))
        .section(section(trained))
        .footer(format!("`{}`", file.learned.command))
}

/// Key figures: the remaining residual, and its significance.
fn figures(trained: &Trained) -> Vec<Figure> {
    let axes = &trained.file.learned.axes;
    let total = |of: fn(&freeplay_controller::remainder::Axis) -> f64| {
        axes.iter().map(|axis| of(axis).powi(2)).sum::<f64>().sqrt()
    };
    let (before, after) = (total(|axis| axis.rms_um), total(|axis| axis.left_um));
    let receipt = &trained.receipt;
    let mean =
        |of: fn(&freeplay_controller::remainder::Rehearsed) -> f64| 1e3 * rms(receipt.runs.iter().map(of));
    let mut figures = vec![
        Figure::new("remainder on held-out paths, RMS", format!("{before:.1} → {after:.1}"), "µm")
            .note("tracked deviation beyond the model, minus the forecast"),
    ];
    if !receipt.runs.is_empty() {
        let [without, with] = [mean(|run| run.without_mm), mean(|run| run.with_mm)];
        figures.push(
            Figure::new("tool deviation in simulated runs, RMS", format!("{without:.1} → {with:.1}"), "µm")
                .note(format!("probability of this result by chance alone: {:.2} %", 1e2 * receipt.chance))
                .verdict(Verdict::passed(receipt.proved)),
        );
    }
    let reach = trained.file.learned.region.trust.iter().rev().find(|[_, share]| *share > 0.0);
    if let Some([distance, _]) = reach {
        let note = "half ranges of the trained inputs; beyond this distance the correction fades to zero";
        figures.push(Figure::new("used up to a distance of", format!("{distance:.2}"), "").note(note));
    }
    figures
}

/// Table of all predictors tried on held-out paths.
fn table(tried: &[Tried]) -> Table {
    let mut table = Table::new("Predictions of held-out paths without a tracker")
        .column(Column::text("predicted by").wrapping());
    for axis in AXES {
        table = table.column(Column::number(axis, "µm").fixed(1).lowest().group("left, RMS"));
    }
    for axis in AXES {
        table = table.column(Column::number(axis, "").fixed(3).group("R"));
    }
    for one in tried {
        let left = one.left.map(|left| Cell::from(left * 1e6));
        let r = one.r.map(Cell::from);
        table = table.row(std::iter::once(Cell::from(one.name.clone())).chain(left).chain(r));
    }
    table
}

/// The drawings: forecasts, simulated runs, region.
fn section(trained: &Trained) -> Section {
    let mut section = Section::new("Forecasts of held-out paths");
    for (number, forecast) in trained.forecasts.iter().enumerate() {
        section = section.with(Block::Drawing(Box::new(along(forecast))));
        if let Some(course) = trained.courses.get(number) {
            section = section.with(Block::Chart(Box::new(deviation(course))));
        }
    }
    section.with(Block::Drawing(Box::new(region(trained))))
}

/// Forecast and tracker along one path, axis by axis.
fn along(forecast: &Forecast) -> Drawing {
    let um = |values: &[f64]| values.iter().map(|value| value * 1e6).collect::<Vec<_>>();
    let panel = |axis: usize| {
        Chart::trace(AXES[axis], Axis::new("time", "s"), Axis::new("beyond the model", "µm"))
            .series(Series::line("tracked", &forecast.t, &um(&forecast.tracked[axis])))
            .series(Series::line("forecast", &forecast.t, &um(&forecast.predicted[axis])).dashed())
            .in_view(0.0)
            .height(180)
    };
    let drawing = Drawing::new(format!(
        "Forecast of the path of {} by the network of the other paths",
        forecast.name
    ))
    .caption(
        "Tracked deviation of the tool beyond the model, and the forecast within its bounds, base frame.",
    );
    (0..AXES.len()).fold(drawing, |drawing, axis| drawing.panel(panel(axis)))
}

/// The tool's deviation in the simulated runs of one path.
fn deviation(course: &DeviationCurve) -> Chart {
    Chart::trace(
        format!("Tool deviation in simulated runs along {}", course.name),
        Axis::new("time", "s"),
        Axis::new("tool deviation", "mm"),
    )
    .series(Series::line("without the network", &course.t, &course.without_mm))
    .series(Series::line("with the network", &course.t, &course.with_mm))
    .in_view(0.0)
    .height(230)
}

/// The used share of an answer by the distance from the training motions, and the distances of held-out paths.
fn region(trained: &Trained) -> Drawing {
    let trust = &trained.file.learned.region.trust;
    let distances: Vec<f64> = trust.iter().map(|[distance, _]| *distance).collect();
    let shares: Vec<f64> = trust.iter().map(|[_, share]| *share).collect();
    let mut chart = Chart::trace(
        "Permitted use of the network",
        Axis::new("distance from the trained inputs", "half ranges"),
        Axis::new("share of the answer that is used", ""),
    )
    .series(Series::line("confirmed by held-out paths", &distances, &shares))
    .in_view(0.0)
    .in_view(1.0)
    .height(230);
    for forecast in &trained.forecasts {
        let farthest = forecast.distance.iter().copied().fold(0.0, f64::max);
        chart = chart.mark(Mark::At { x: farthest, label: forecast.name.clone() });
    }
    Drawing::new("Region of validity")
        .caption("Marks: the farthest instant of each held-out path. Beyond the end of the line, the network has no effect.")
        .panel(chart)
}

/// Names of the recordings.
fn conditions(file: &WeightFile) -> String {
    let names: Vec<&str> = file.learned.conditions.iter().map(|condition| condition.name.as_str()).collect();
    names.join(", ")
}
