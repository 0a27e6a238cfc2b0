//! Charts: the frame, the data for the script, and the same in words.

use maud::{Markup, PreEscaped, html};

use super::Context;
use super::inline::inline;
use crate::chart::{Chart, Mark, Scale, Series};
use crate::chart_data::ChartData;
use crate::text::{Digits, number};

/// A chart with its title, its remarks and its text alternative.
pub(crate) fn chart(chart: &Chart, context: &Context<'_>) -> Markup {
    let data = ChartData::new(chart, &context.colours, context.most_points);
    html! {
        figure.chart.plane[chart.plane] {
            figcaption { (inline(&chart.title)) }
            @if data.is_empty() {
                p.nothing { "Nothing to draw: " (chart.y.heading()) " has no finite value." }
            } @else {
                div.plot role="group" aria-label=(chart.title) style=(place(chart)) {}
                script type="application/json" { (PreEscaped(data.to_json())) }
                p.alternative { (in_words(chart)) }
            }
            @if !chart.note.is_empty() { p.note { (inline(&chart.note)) } }
            @for remark in &data.remarks { p.remark { (remark) } }
        }
    }
}

/// Reserves the space until the script has drawn, so that links into the page lead to the right place.
fn place(chart: &Chart) -> String {
    // The height of a chart with equal axes follows from the width of the window.
    if chart.equal_axes { String::new() } else { format!("min-height: {}px", chart.height) }
}

/// The description of the chart for a reader who cannot see it.
pub(crate) fn in_words(chart: &Chart) -> String {
    let kind = if chart.plane { "Points in the plane" } else { "Chart" };
    let mut words = format!("{kind}: {} upwards against {} across.", chart.y.heading(), chart.x.heading());
    for series in &chart.series {
        words.push_str(&format!(" {}: {}.", series.name, extent(series, chart.x.scale)));
    }
    let labels: Vec<&str> = chart.marks.iter().map(Mark::label).filter(|label| !label.is_empty()).collect();
    if !labels.is_empty() {
        words.push_str(&format!(" Marked: {}.", labels.join("; ")));
    }
    words
}

/// The range of a series on both axes.
fn extent(series: &Series, x_scale: Scale) -> String {
    let Some((low, high)) = range(&series.y) else { return "nothing to draw".to_owned() };
    let written = |value| number(value, Digits::Significant(3));
    let upwards = format!("{} to {} upwards", written(low), written(high));
    match (range(&series.x), x_scale) {
        (Some((low, high)), Scale::Linear | Scale::Log) => {
            format!("{upwards}, {} to {} across", written(low), written(high))
        }
        _ => upwards,
    }
}

fn range(values: &[f64]) -> Option<(f64, f64)> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let low = finite().reduce(f64::min)?;
    Some((low, finite().reduce(f64::max)?))
}
