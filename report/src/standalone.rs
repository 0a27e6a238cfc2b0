//! A drawing as a separate file, for a README: the panels side by side, the legend above them.

use maud::{PreEscaped, html};

use crate::colours::{Colours, PALETTE};
use crate::document::Document;
use crate::drawing::Drawing;
use crate::svg::panel;

/// Width of a panel, CSS pixels.
const WIDTH: u32 = 430;
/// Room above the panels, for title, legend and the panels' own titles.
const HEAD: u32 = 76;
/// Width of a letter of the legend, CSS pixels.
const LETTER: usize = 8;
/// The colours of the page, light and dark: those of the style sheet of reports.
const STYLE: &str = include_str!("report.css");

impl Drawing {
    /// The panels side by side as a separate SVG file, with title and legend, in the colours of the reader's light or dark scheme; `None` without data.
    #[must_use]
    pub fn to_svg(&self) -> Option<String> {
        standalone_svg(self)
    }
}

/// The file; `None` without data.
fn standalone_svg(drawing: &Drawing) -> Option<String> {
    let document = Document::new("").overview(drawing.clone());
    let colours = Colours::of(&document);
    let drawn: Vec<String> = drawing
        .panels
        .iter()
        .filter_map(|chart| panel(chart, WIDTH, &chart.title, &colours).ok().flatten())
        .collect();
    let high =
        drawing.panels.iter().map(|chart| if chart.equal_axes { WIDTH } else { chart.height }).max()?;
    if drawn.is_empty() {
        return None;
    }
    let (wide, tall) = (WIDTH * drawn.len() as u32, high + HEAD);
    let placed = drawn.iter().enumerate().map(|(place, svg)| {
        let x = WIDTH * place as u32;
        svg.replacen("<svg ", &format!("<svg x=\"{x}\" y=\"{HEAD}\" width=\"{WIDTH}\" height=\"{high}\" "), 1)
    });
    let panels: String = placed.collect();
    let file = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (wide) " " (tall) } width=(wide) height=(tall) {
            style { (PreEscaped(style())) }
            rect width="100%" height="100%" fill="var(--paper)" {}
            text x="12" y="22" font-size="15" font-weight="600" fill="var(--ink)" { (drawing.title) }
            (legend(drawing, &colours))
            @for (place, chart) in drawing.panels.iter().enumerate() {
                text x=(12 + WIDTH * place as u32) y="68" font-size="13" fill="var(--soft)" { (chart.title) }
            }
            (PreEscaped(panels))
        }
    };
    Some(crate::visible(&file.into_string()).into_owned())
}

/// The two blocks of colours of the style sheet, the second for a dark scheme.
fn style() -> String {
    let block = |begin: &str| {
        let from = STYLE.find(begin).map_or("", |at| &STYLE[at..]);
        let open = from.find('{').map_or(0, |at| at + 1);
        let close = from.find('}').unwrap_or(open);
        from[open..close].to_owned()
    };
    format!(
        ":root {{{}}} @media (prefers-color-scheme: dark) {{ :root {{{}}} }} text {{ font-family: system-ui, sans-serif; }}",
        block(":root {"),
        block(":root[data-theme=\"dark\"] {")
    )
}

/// The names of all series with their colours, in one line.
fn legend(drawing: &Drawing, colours: &Colours<'_>) -> maud::Markup {
    let mut named: Vec<(&str, usize, usize)> = Vec::new();
    let mut x = 12;
    for series in drawing.panels.iter().flat_map(|panel| &panel.series) {
        if !series.name.is_empty() && named.iter().all(|(name, ..)| *name != series.name) {
            named.push((&series.name, colours.index(series.colour_name()).unwrap_or(0) % PALETTE, x));
            x += 40 + LETTER * series.name.chars().count();
        }
    }
    html! {
        @for (name, place, x) in named {
            rect x=(x) y="40" width="16" height="3" fill={ "var(--series-" (place) ")" } {}
            text x=(x + 22) y="46" font-size="13" fill="var(--ink)" { (name) }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Axis, Chart, Drawing, Series};

    #[test]
    fn a_picture_stands_alone_in_light_and_dark() {
        let chart = |title: &str| {
            Chart::xy(title, Axis::new("velocity", "rad/s"), Axis::new("torque", "N·m"))
                .height(300)
                .series(Series::points("points", &[0.0, 1.0], &[0.0, 2.0]))
        };
        let drawing = Drawing::new("Torque <over> velocity").panel(chart("before")).panel(chart("after"));
        let file = drawing.to_svg().unwrap_or_default();
        assert!(file.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 860 376\""));
        assert_eq!(file.matches("<svg ").count(), 3);
        for part in
            ["prefers-color-scheme: dark", "--series-0:", "Torque &lt;over&gt;", "velocity [rad/s]", "points"]
        {
            assert!(file.contains(part), "{part} in {file}");
        }
        assert!(Drawing::new("nothing").to_svg().is_none());
    }
}
