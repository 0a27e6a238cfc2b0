//! One panel of a drawing as SVG, drawn by `plotters`.
//!
//! plotters places everything on whole units and has only numeric colours. So this module draws a panel [`UNITS`] times as large as shown, in placeholder
//! colours for those of the style sheet ([`Ink`]), and substitutes them afterwards: the drawing follows the page from light to dark.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{
    Cartesian2d, ChartBuilder, ChartContext, Circle, DrawingArea, DrawingAreaErrorKind, IntoDrawingArea,
    LineSeries, PathElement, RGBColor, Rectangle, SVGBackend, ShapeStyle, TRANSPARENT, Text,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{IntoTextStyle, TextStyle};

use crate::chart::{Chart, Mark, Series, Style};
use crate::colours::{Colours, PALETTE};
use crate::text::{Digits, number};
use crate::thin::{extremes, pick, spread};

/// Units of the drawing to a CSS pixel.
const UNITS: i32 = 4;
/// plotters writes a font 1.24 times smaller than requested.
const FONT: f64 = 1.24;
/// Height of letters, CSS pixels.
const LETTERS: f64 = 12.5;
/// Margins left of a panel and below it, for numbers and labels, CSS pixels.
const MARGIN: (i32, i32) = (66, 44);
/// Room above a panel, and to its right for half of the last number below it, CSS pixels.
const EDGE: (i32, i32) = (10, 18);
/// Most points of a line, and of a cloud.
const MOST: (usize, usize) = (2_000, 700);

/// Placeholder for the colour of texts.
const TEXT: RGBColor = RGBColor(2, 0, 0);

/// A colour of the style sheet.
#[derive(Clone, Copy)]
enum Ink {
    Text,
    Rule,
    Hair,
    Mark,
    Series(usize),
}

impl Ink {
    /// The placeholder colour while plotters draws.
    fn stand_in(self) -> RGBColor {
        match self {
            Self::Text => TEXT,
            Self::Rule => RGBColor(2, 0, 1),
            Self::Hair => RGBColor(2, 0, 2),
            Self::Mark => RGBColor(2, 0, 3),
            Self::Series(place) => RGBColor(1, 0, (place % PALETTE) as u8),
        }
    }

    fn variable(self) -> String {
        match self {
            Self::Text => "--ink".to_owned(),
            Self::Rule => "--rule".to_owned(),
            Self::Hair => "--hair".to_owned(),
            Self::Mark => "--mark".to_owned(),
            Self::Series(place) => format!("--series-{}", place % PALETTE),
        }
    }

    fn all() -> impl Iterator<Item = Self> {
        [Self::Text, Self::Rule, Self::Hair, Self::Mark].into_iter().chain((0..PALETTE).map(Self::Series))
    }

    fn stroke(self, pixels: f64) -> ShapeStyle {
        ShapeStyle {
            color: self.stand_in().into(),
            filled: false,
            stroke_width: (pixels * f64::from(UNITS)) as u32,
        }
    }

    fn solid(self) -> ShapeStyle {
        ShapeStyle { filled: true, ..self.stroke(0.0) }
    }
}

type Failure = DrawingAreaErrorKind<std::io::Error>;
type Sheet<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// The SVG element of `panel`, `width` CSS pixels wide, with `words` as its text for screen readers; `None` without data.
///
/// # Errors
/// Errors of plotters.
pub(crate) fn panel(
    panel: &Chart,
    width: u32,
    words: &str,
    colours: &Colours<'_>,
) -> Result<Option<String>, String> {
    let Some((x, y)) = ranges(panel) else { return Ok(None) };
    let (wide, high) = size(panel, width);
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (wide as u32, high as u32)).into_drawing_area();
        draw(&root, panel, x, y, colours).and_then(|()| root.present()).map_err(|error| error.to_string())?;
    }
    Ok(Some(dressed(&text, (wide, high), words)))
}

/// Width and height in units. With equal axes the space between the axes is a square.
fn size(panel: &Chart, width: u32) -> (i32, i32) {
    let wide = width as i32;
    let high =
        if panel.equal_axes { wide - MARGIN.0 - EDGE.1 + MARGIN.1 + EDGE.0 } else { panel.height as i32 };
    (wide * UNITS, high * UNITS)
}

/// plotters' element with our head element and the style sheet's colours.
fn dressed(drawn: &str, (wide, high): (i32, i32), words: &str) -> String {
    let (_, inside) = drawn.split_once(">\n").unwrap_or(("", drawn));
    let mut inside = inside.to_owned();
    for ink in Ink::all() {
        let RGBColor(r, g, b) = ink.stand_in();
        // Quotation marks in texts are escaped, so that only attributes can match.
        inside = inside
            .replace(&format!("\"#{r:02X}{g:02X}{b:02X}\""), &format!("\"var({})\"", ink.variable()))
            .replace(" opacity=\"1\"", "");
    }
    let pixels = wide / UNITS;
    let head = maud::html! { (words) }.into_string();
    format!(
        "<svg viewBox=\"0 0 {wide} {high}\" role=\"img\" aria-label=\"{head}\" style=\"--wide: {pixels}px\">\n{inside}"
    )
}

/// Ranges of the axes: the data and the values that must be in view, with a little room; `None` without finite data.
fn ranges(panel: &Chart) -> Option<(Range<f64>, Range<f64>)> {
    let across = panel.series.iter().flat_map(|series| series.x.iter().copied());
    let zero = panel.series.iter().any(|series| series.style == Style::Bars).then_some(0.0);
    let upwards = panel.series.iter().flat_map(|series| series.y.iter().copied());
    let levels = panel.marks.iter().filter_map(|mark| match mark {
        Mark::Level { y, .. } => Some(*y),
        _ => None,
    });
    let x = span(across)?;
    let y = span(upwards.chain(panel.in_view.iter().copied()).chain(zero).chain(levels))?;
    let (x, y) = (wider(x, if panel.plane { 0.04 } else { 0.0 }), wider(y, 0.05));
    if !panel.equal_axes {
        return Some((x, y));
    }
    let half = 0.5 * (x.end - x.start).max(y.end - y.start);
    let around = |range: &Range<f64>| {
        let middle = 0.5 * (range.start + range.end);
        middle - half..middle + half
    };
    Some((around(&x), around(&y)))
}

fn span(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let finite = values.filter(|value| value.is_finite());
    finite.fold(None, |range: Option<Range<f64>>, value| {
        Some(range.map_or(value..value, |range| range.start.min(value)..range.end.max(value)))
    })
}

/// The range extended by a share of its length at both ends; a single value gets a range around it.
fn wider(range: Range<f64>, share: f64) -> Range<f64> {
    let length = range.end - range.start;
    let least = 1e-9 * range.start.abs().max(range.end.abs()).max(1e-3);
    let room = if length > least { share * length } else { 0.5 * range.start.abs().max(1e-3) };
    range.start - room..range.end + room
}

fn letters() -> TextStyle<'static> {
    ("sans-serif", LETTERS * FONT * f64::from(UNITS)).into_text_style(&(1, 1)).color(&TEXT)
}

fn draw(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    panel: &Chart,
    x: Range<f64>,
    y: Range<f64>,
    colours: &Colours<'_>,
) -> Result<(), Failure> {
    let mut sheet = ChartBuilder::on(root)
        .margin_top(EDGE.0 * UNITS)
        .margin_right(EDGE.1 * UNITS)
        .x_label_area_size(MARGIN.1 * UNITS)
        .y_label_area_size(MARGIN.0 * UNITS)
        .build_cartesian_2d(x.clone(), y.clone())?;
    bands(&mut sheet, panel, &y)?;
    axes(&mut sheet, panel, &x, &y)?;
    for series in &panel.series {
        let ink = Ink::Series(colours.index(series.colour_name()).unwrap_or(0));
        curve(&mut sheet, panel, series, ink)?;
    }
    marks(&mut sheet, panel, &x, &y)
}

fn axes(sheet: &mut Sheet<'_, '_>, panel: &Chart, x: &Range<f64>, y: &Range<f64>) -> Result<(), Failure> {
    let (of_x, of_y) = (x.end - x.start, y.end - y.start);
    sheet
        .configure_mesh()
        .x_desc(panel.x.heading())
        .y_desc(panel.y.heading())
        .x_labels(if panel.equal_axes { 5 } else { 9 })
        .y_labels((panel.height / 42).clamp(3, 8) as usize)
        .x_label_formatter(&|value| tick(*value, of_x))
        .y_label_formatter(&|value| tick(*value, of_y))
        .light_line_style(TRANSPARENT)
        .bold_line_style(Ink::Hair.stroke(1.0))
        .axis_style(Ink::Rule.stroke(1.0))
        .set_all_tick_mark_size(4 * UNITS)
        .label_style(letters())
        .axis_desc_style(letters())
        .draw()
}

/// A number at an axis of length `length`.
fn tick(value: f64, length: f64) -> String {
    let decimals = (1.0 - (length / 6.0).log10().floor()).clamp(0.0, 9.0) as usize;
    let written = number(value, Digits::Fixed(decimals));
    if !written.contains('.') {
        return written;
    }
    written.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The marks behind everything else.
fn bands(sheet: &mut Sheet<'_, '_>, panel: &Chart, y: &Range<f64>) -> Result<(), Failure> {
    let bands = panel.marks.iter().filter_map(|mark| match mark {
        Mark::Span { from, to, .. } => {
            Some(Rectangle::new([(*from, y.start), (*to, y.end)], Ink::Hair.solid()))
        }
        _ => None,
    });
    sheet.draw_series(bands).map(|_| ())
}

/// The lines of the marks, and their labels.
fn marks(sheet: &mut Sheet<'_, '_>, panel: &Chart, x: &Range<f64>, y: &Range<f64>) -> Result<(), Failure> {
    let stroke = Ink::Mark.stroke(1.2);
    for mark in &panel.marks {
        let (line, at, anchor) = match *mark {
            Mark::At { x, .. } => {
                (vec![(x, y.start), (x, y.end)], (x, y.end), Pos::new(HPos::Left, VPos::Top))
            }
            Mark::Level { y, .. } => {
                (vec![(x.start, y), (x.end, y)], (x.end, y), Pos::new(HPos::Right, VPos::Bottom))
            }
            Mark::Span { from, .. } => (vec![], (from, y.end), Pos::new(HPos::Left, VPos::Top)),
        };
        sheet.draw_series([PathElement::new(line, stroke)])?;
        let style = letters().pos(anchor);
        sheet.draw_series([Text::new(format!(" {} ", mark.label()), at, style)])?;
    }
    Ok(())
}

fn curve(sheet: &mut Sheet<'_, '_>, panel: &Chart, series: &Series, ink: Ink) -> Result<(), Failure> {
    let length = series.x.len().min(series.y.len());
    let (x, y) = (&series.x[..length], &series.y[..length]);
    let kept = match (series.style, panel.plane) {
        (Style::Points, _) => spread(x, y, MOST.1),
        (_, true) => extremes(&[x, y], MOST.0),
        (_, false) => extremes(&[y], MOST.0),
    };
    let points: Vec<(f64, f64)> = pick(x, &kept).into_iter().zip(pick(y, &kept)).collect();
    let width = if series.dashed { 1.2 } else { 1.5 };
    match series.style {
        Style::Points => {
            let radius = 7 * UNITS as u32 / 4;
            let dots = points.into_iter().filter(is_finite).map(|at| Circle::new(at, radius, ink.solid()));
            sheet.draw_series(dots).map(|_| ())
        }
        Style::Bars => {
            let stroke = |(x, y)| PathElement::new(vec![(x, 0.0), (x, y)], ink.stroke(2.0));
            sheet.draw_series(points.into_iter().filter(is_finite).map(stroke)).map(|_| ())
        }
        Style::Line | Style::Step => {
            let pieces = points.split(|at| !is_finite(at)).filter(|piece| !piece.is_empty());
            for piece in pieces {
                let piece = if series.style == Style::Step { steps(piece) } else { piece.to_vec() };
                line(sheet, piece, ink.stroke(width), series.dashed)?;
            }
            Ok(())
        }
    }
}

fn line(
    sheet: &mut Sheet<'_, '_>,
    points: Vec<(f64, f64)>,
    style: ShapeStyle,
    dashed: bool,
) -> Result<(), Failure> {
    if dashed {
        let dashes = plotters::prelude::DashedLineSeries::new(points, 5 * UNITS, 4 * UNITS, style);
        sheet.draw_series(dashes).map(|_| ())
    } else {
        sheet.draw_series(LineSeries::new(points, style)).map(|_| ())
    }
}

fn is_finite((x, y): &(f64, f64)) -> bool {
    x.is_finite() && y.is_finite()
}

/// Each value held until the next one.
fn steps(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let corners = points.windows(2).flat_map(|pair| [pair[0], (pair[1].0, pair[0].1)]);
    corners.chain(points.last().copied()).collect()
}
