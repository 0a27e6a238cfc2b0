//! Drawings: caption, legend and the panels as SVG.

use maud::{Markup, PreEscaped, html};

use super::Context;
use super::figure::in_words;
use super::inline::inline;
use crate::chart::{Chart, Series};
use crate::colours::PALETTE;
use crate::drawing::Drawing;
use crate::svg::panel;

/// Width of a panel in CSS pixels: alone in its row, and side by side with others.
const WIDTH: (u32, u32) = (780, 430);

/// A drawing with its caption and legend.
pub(crate) fn drawing(drawing: &Drawing, context: &Context<'_>) -> Markup {
    let width = if drawing.beside { WIDTH.1 } else { WIDTH.0 };
    html! {
        figure.drawing {
            figcaption { (inline(&drawing.title)) }
            (legend(&drawing.panels, context))
            div.panels.beside[drawing.beside] {
                @for chart in &drawing.panels { (one(chart, width, context)) }
            }
            @if !drawing.caption.is_empty() { p.note { (inline(&drawing.caption)) } }
        }
    }
}

fn one(chart: &Chart, width: u32, context: &Context<'_>) -> Markup {
    html! {
        div.panel {
            @if !chart.title.is_empty() { p.panel-title { (inline(&chart.title)) } }
            @match panel(chart, width, &in_words(chart), &context.colours) {
                Ok(Some(svg)) => div.sheet tabindex="0" role="region" aria-label=(chart.title) { (PreEscaped(svg)) },
                Ok(None) => p.nothing { "Nothing to draw: " (chart.y.heading()) " has no finite value." },
                Err(error) => p.nothing { "Cannot be drawn: " (error) },
            }
            @if !chart.note.is_empty() { p.remark { (inline(&chart.note)) } }
        }
    }
}

/// The names of all series with their colours, each once.
fn legend(panels: &[Chart], context: &Context<'_>) -> Markup {
    let mut named: Vec<&Series> = Vec::new();
    for series in panels.iter().flat_map(|panel| &panel.series) {
        if !series.name.is_empty() && named.iter().all(|known| known.name != series.name) {
            named.push(series);
        }
    }
    html! {
        @if !named.is_empty() {
            ul.legend {
                @for series in named {
                    @let place = context.colours.index(series.colour_name()).unwrap_or(0) % PALETTE;
                    li { span.swatch.{ "series-" (place) }.dashed[series.dashed] {} (series.name) }
                }
            }
        }
    }
}
