//! The data of a chart for the script in the page: small JSON without any text that a browser could take for HTML.

use serde::{Serialize, Serializer};

use crate::chart::{Axis, Chart, Mark, Scale, Series, Style};
use crate::colours::Colours;
use crate::thin::{extremes, pick, spread};

/// A prepared chart: points sorted, drawable, thinned.
#[derive(Debug, Serialize)]
pub(crate) struct ChartData<'a> {
    plane: bool,
    equal: bool,
    x: AxisData<'a>,
    y: AxisData<'a>,
    group: &'a str,
    height: u32,
    in_view: Vec<Short>,
    /// The distinct lists of x values; series that share a list refer to it by index.
    grids: Vec<Vec<Short>>,
    series: Vec<SeriesData<'a>>,
    marks: Vec<MarkData<'a>>,
    /// Number of drawn points, and of all points.
    #[serde(skip)]
    drawn_of: (usize, usize),
    /// Omissions in the drawing, in words.
    #[serde(skip)]
    pub(crate) remarks: Vec<String>,
}

#[derive(Debug, Serialize)]
struct AxisData<'a> {
    /// The quantity alone, for the legend.
    name: &'a str,
    /// The quantity with its unit.
    label: String,
    unit: &'a str,
    scale: Scale,
}

#[derive(Debug, Serialize)]
struct SeriesData<'a> {
    name: &'a str,
    colour: usize,
    style: Style,
    dashed: bool,
    grid: usize,
    y: Vec<Short>,
}

/// A vertical line or band from one x to another, which may be equal, or a horizontal line at one y.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum MarkData<'a> {
    Upright { from: Short, to: Short, label: &'a str },
    Level { y: Short, label: &'a str },
}

/// A number in its shortest form; `null` unless finite.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Short(f64);

impl Serialize for Short {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(value) = *self;
        if !value.is_finite() {
            serializer.serialize_none()
        } else if value.fract() == 0.0 && value.abs() < 1e9 {
            serializer.serialize_i64(value as i64)
        } else {
            serializer.serialize_f64(value)
        }
    }
}

impl<'a> ChartData<'a> {
    /// Prepares a chart, with at most `most` points in each series.
    pub(crate) fn new(chart: &'a Chart, colours: &Colours<'_>, most: usize) -> Self {
        let mut data = Self {
            plane: chart.plane,
            equal: chart.equal_axes,
            x: AxisData::new(&chart.x),
            y: AxisData::new(&chart.y),
            group: &chart.group,
            height: chart.height,
            in_view: chart.in_view.iter().filter_map(|&y| placed(chart.y.scale, y)).collect(),
            grids: Vec::new(),
            series: Vec::new(),
            marks: chart.marks.iter().filter_map(|mark| MarkData::new(mark, chart)).collect(),
            drawn_of: (0, 0),
            remarks: Vec::new(),
        };
        if chart.series.iter().any(|series| series.style == Style::Bars) {
            // Bars that do not begin at zero would mislead.
            data.in_view.extend(placed(chart.y.scale, 0.0));
        }
        for series in &chart.series {
            data.add(chart, series, colours, most);
        }
        let (drawn, all) = data.drawn_of;
        if drawn < all {
            data.remarks.push(format!("{drawn} of {all} points drawn; the extremes are kept."));
        }
        data
    }

    /// True without anything to draw.
    pub(crate) fn is_empty(&self) -> bool {
        self.series.iter().all(|series| series.y.iter().all(|y| !y.0.is_finite()))
    }

    /// The JSON, safe in a `script` element: `<`, `>` and `&` are written as escapes.
    pub(crate) fn to_json(&self) -> String {
        let json = serde_json::to_string(self).expect("numbers and strings alone always make JSON");
        json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
    }

    fn add(&mut self, chart: &Chart, series: &'a Series, colours: &Colours<'_>, most: usize) {
        if series.x.len() != series.y.len() {
            let (x, y) = (series.x.len(), series.y.len());
            self.remarks.push(format!(
                "{}: {x} values of x, {y} values of y; the surplus is not drawn.",
                series.name
            ));
        }
        let (x, y) = drawable(chart, series);
        let kept = match (chart.plane, series.style) {
            (true, Style::Points) => spread(&x, &y, most),
            (true, _) => extremes(&[&x, &y], most),
            (false, _) => extremes(&[&y], most),
        };
        self.drawn_of.0 += kept.len();
        self.drawn_of.1 += x.len();
        let (x, y) = (shortened(&pick(&x, &kept), 9), shortened(&pick(&y, &kept), 6));
        let grid = self.grids.iter().position(|grid| *grid == x).unwrap_or_else(|| {
            self.grids.push(x);
            self.grids.len() - 1
        });
        self.series.push(SeriesData {
            name: &series.name,
            colour: colours.index(series.colour_name()).unwrap_or(0),
            style: series.style,
            dashed: series.dashed,
            grid,
            y,
        });
    }
}

impl<'a> AxisData<'a> {
    fn new(axis: &'a Axis) -> Self {
        Self { name: &axis.label, label: axis.heading(), unit: &axis.unit, scale: axis.scale }
    }
}

impl<'a> MarkData<'a> {
    /// `None` for a mark outside the domain of the axes.
    fn new(mark: &'a Mark, chart: &Chart) -> Option<Self> {
        let across = |x: f64| placed(chart.x.scale, x);
        let label = mark.label();
        Some(match *mark {
            Mark::At { x, .. } => Self::Upright { from: across(x)?, to: across(x)?, label },
            Mark::Span { from, to, .. } => Self::Upright { from: across(from)?, to: across(to)?, label },
            Mark::Level { y, .. } => Self::Level { y: placed(chart.y.scale, y)?, label },
        })
    }
}

/// The value on its scale, before the logarithm; NaN outside the domain of the scale.
fn on_scale(scale: Scale, value: f64) -> f64 {
    let placed = match scale {
        Scale::Linear => value,
        Scale::Log => positive(value),
        Scale::Percentile if value >= 0.0 => positive(1.0 / (1.0 - value)),
        Scale::Percentile => f64::NAN,
    };
    if placed.is_finite() { placed } else { f64::NAN }
}

/// A single value for the script; `None` outside the domain of the scale.
fn placed(scale: Scale, value: f64) -> Option<Short> {
    let value = on_scale(scale, value);
    value.is_finite().then_some(Short(value))
}

fn positive(value: f64) -> f64 {
    if value > 0.0 { value } else { f64::NAN }
}

/// The points within the domain of the axes: of a trace in order of x, of a plane in the given order. Gaps stay, as NaN.
fn drawable(chart: &Chart, series: &Series) -> (Vec<f64>, Vec<f64>) {
    let mut points: Vec<(f64, f64)> = series
        .x
        .iter()
        .zip(&series.y)
        .map(|(&x, &y)| (on_scale(chart.x.scale, x), on_scale(chart.y.scale, y)))
        .filter(|(x, _)| chart.plane || !x.is_nan())
        .map(|(x, y)| if x.is_nan() || (chart.plane && y.is_nan()) { (f64::NAN, f64::NAN) } else { (x, y) })
        .collect();
    if !chart.plane {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    points.into_iter().unzip()
}

/// The numbers with about `digits` significant digits, and more if their differences are small relative to their size.
fn shortened(values: &[f64], digits: usize) -> Vec<Short> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let lost = (low.abs().max(high.abs()) / (high - low)).log10();
    let more = if lost.is_finite() { lost.ceil().clamp(0.0, 9.0) as usize } else { 0 };
    let digits = (digits + more).min(15);
    let short = |value: f64| format!("{value:.*e}", digits - 1).parse().unwrap_or(value);
    values.iter().map(|&value| Short(short(value))).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::{ChartData, Short, on_scale, shortened};
    use crate::chart::{Axis, Chart, Scale, Series};
    use crate::colours::Colours;

    fn json(chart: &Chart) -> serde_json::Value {
        let text = ChartData::new(chart, &Colours::default(), 4_000).to_json();
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error} in {text}"))
    }

    fn xy(x: Axis, y: Axis) -> Chart {
        Chart::trace("chart", x, y)
    }

    #[test]
    fn numbers_are_short_and_exact_enough() {
        let third = shortened(&[1.0 / 3.0, 0.0, -2.0], 6);
        assert_eq!(serde_json::to_string(&third).unwrap(), "[0.333333,0,-2]");
        let close = [1_000.000_1, 1_000.000_2];
        for (short, value) in shortened(&close, 6).iter().zip(close) {
            println!("{value} is written {}", short.0);
            assert!((short.0 - value).abs() < 1e-9, "a small difference beside a large number is kept");
        }
        assert_eq!(shortened(&[f64::MAX, f64::MIN_POSITIVE], 6)[0].0, 1.797_69e308);
    }

    #[test]
    fn what_cannot_be_drawn_becomes_a_gap_or_nothing() {
        let y = [1.0, f64::NAN, f64::INFINITY, -1.0];
        let linear = json(&xy(Axis::new("x", ""), Axis::new("y", "")).series(Series::line(
            "a",
            &[0.0, 1.0, 2.0, 3.0],
            &y,
        )));
        assert_eq!(linear["series"][0]["y"], serde_json::json!([1, null, null, -1]));
        let log = json(&xy(Axis::log("x", ""), Axis::log("y", "")).series(Series::line(
            "a",
            &[0.0, 1.0, 2.0, 3.0],
            &y,
        )));
        assert_eq!(log["grids"][0], serde_json::json!([1, 2, 3]));
        assert_eq!(log["series"][0]["y"], serde_json::json!([null, null, null]));
        let empty =
            Chart::trace("none", Axis::new("x", ""), Axis::new("y", "")).series(Series::line("a", &[], &[]));
        assert!(ChartData::new(&empty, &Colours::default(), 100).is_empty());
    }

    #[test]
    fn percentiles_spread_as_hdrhistogram_plots_do() {
        for (p, expected) in [(0.0, 1.0), (0.9, 10.0), (0.99, 100.0), (0.999, 1_000.0)] {
            let got = on_scale(Scale::Percentile, p);
            println!("p = {p}: {got}");
            assert!((got - expected).abs() < 1e-9 * expected);
        }
        for p in [1.0, 1.5, -0.1, f64::NAN] {
            assert!(on_scale(Scale::Percentile, p).is_nan(), "p = {p} has no place");
        }
    }

    #[test]
    fn traces_are_sorted_and_share_their_grid() {
        let chart = xy(Axis::new("x", ""), Axis::new("y", ""))
            .series(Series::line("a", &[2.0, 0.0, 1.0], &[20.0, 0.0, 10.0]))
            .series(Series::line("b", &[0.0, 1.0, 2.0], &[1.0, 2.0, 3.0]));
        let data = json(&chart);
        assert_eq!(data["grids"], serde_json::json!([[0, 1, 2]]));
        assert_eq!(data["series"][0]["y"], serde_json::json!([0, 10, 20]));
        let plane = json(&Chart { plane: true, ..chart });
        assert_eq!(plane["grids"][0], serde_json::json!([2, 0, 1]), "a plane keeps the order");
    }

    #[test]
    fn what_was_left_out_is_said() {
        let x: Vec<f64> = (0..100).map(f64::from).collect();
        let chart = xy(Axis::new("x", ""), Axis::new("y", "")).series(Series::line("a", &x, &x[..90]));
        let data = ChartData::new(&chart, &Colours::default(), 20);
        assert_eq!(data.remarks.len(), 2, "{:?}", data.remarks);
        assert!(data.remarks[0].contains("100 values of x, 90 values of y"));
        assert!(data.remarks[1].contains("of 90 points drawn"));
        assert!(data.series[0].y.len() <= 20 && data.series[0].y.contains(&Short(89.0)));
    }
}
