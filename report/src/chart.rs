//! Charts: axes, series and marks.

use serde::Serialize;

/// A chart. See [`Chart::trace`] and [`Chart::xy`] for the two kinds.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Title above the chart.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The series, the first at the bottom.
    pub series: Vec<Series>,
    /// Lines and bands behind the series.
    pub marks: Vec<Mark>,
    /// True if the points lie in any order in the plane, false if y is a function of x.
    pub plane: bool,
    /// True if one unit is equally long on both axes (planes only).
    pub equal_axes: bool,
    /// Charts of the same group share cursor, horizontal zoom and hidden series; empty for none. Their x must be the same quantity.
    pub group: String,
    /// Values of y that stay in view even if the data is far from them, such as zero or a limit.
    pub in_view: Vec<f64>,
    /// A remark below the chart; may be empty.
    pub note: String,
    /// Height of the chart in CSS pixels; with equal axes it follows from the width, which is then at most this.
    pub height: u32,
}

/// An axis.
#[derive(Debug, Clone)]
pub struct Axis {
    /// The quantity.
    pub label: String,
    /// Its unit, shown in brackets; may be empty.
    pub unit: String,
    /// Spacing of the values along it.
    pub scale: Scale,
}

/// Spacing of the values along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm; values that are not positive are not drawn.
    Log,
    /// For x: fractions p in 0 ≤ p < 1, spread by 1/(1-p) as the plots of HdrHistogram do: 0 %, 90 %, 99 %, 99.9 %, …
    /// Points at p = 1, which lies at infinity, are not drawn.
    Percentile,
}

/// A set of points with a name.
#[derive(Debug, Clone)]
pub struct Series {
    /// The name in the legend.
    pub name: String,
    /// The name of the series whose colour this one takes; empty for its own. The same name has the same colour in the whole document.
    pub like: String,
    /// The horizontal values. If one list of x and y is longer, the surplus is not drawn and the chart says so.
    pub x: Vec<f64>,
    /// The vertical values; NaN and infinity are gaps.
    pub y: Vec<f64>,
    /// Drawing style.
    pub style: Style,
    /// True if its line is dashed.
    pub dashed: bool,
}

/// Drawing style of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Style {
    /// Joined by straight lines.
    Line,
    /// Each value holds until the next one.
    Step,
    /// Dots.
    Points,
    /// Bars from zero.
    Bars,
}

/// A reference mark behind the series. Labels may be empty.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A vertical line.
    At {
        /// Its position.
        x: f64,
        /// The event at this x.
        label: String,
    },
    /// A vertical band.
    Span {
        /// Its left edge.
        from: f64,
        /// Its right edge.
        to: f64,
        /// Its meaning.
        label: String,
    },
    /// A horizontal line.
    Level {
        /// Its position.
        y: f64,
        /// Its meaning.
        label: String,
    },
}

impl Chart {
    /// A chart of y as a function of x. The chart sorts the points by x; one x has one y.
    #[must_use]
    pub fn trace(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            series: Vec::new(),
            marks: Vec::new(),
            plane: false,
            equal_axes: false,
            group: String::new(),
            in_view: Vec::new(),
            note: String::new(),
            height: 260,
        }
    }

    /// An x-y chart of points in the order given: a cloud, an orbit, a hysteresis loop. Lines join the points in that order;
    /// [`Style::Step`] and [`Style::Bars`] become lines.
    #[must_use]
    pub fn xy(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { plane: true, height: 380, ..Self::trace(title, x, y) }
    }

    /// Makes one unit equally long on both axes (planes only).
    #[must_use]
    pub fn equal_axes(mut self) -> Self {
        self.equal_axes = true;
        self
    }

    /// Adds a series.
    #[must_use]
    pub fn series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Adds a mark.
    #[must_use]
    pub fn mark(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }

    /// Joins the charts of the same group: cursor, horizontal zoom, hidden series.
    #[must_use]
    pub fn group(mut self, group: impl Into<String>) -> Self {
        self.group = group.into();
        self
    }

    /// Keeps a value of y in view.
    #[must_use]
    pub fn in_view(mut self, y: f64) -> Self {
        self.in_view.push(y);
        self
    }

    /// Sets the remark below the chart.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Sets the height in CSS pixels.
    #[must_use]
    pub fn height(mut self, pixels: u32) -> Self {
        self.height = pixels;
        self
    }
}

impl Axis {
    /// A linear axis.
    #[must_use]
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), unit: unit.into(), scale: Scale::Linear }
    }

    /// A logarithmic axis.
    #[must_use]
    pub fn log(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { scale: Scale::Log, ..Self::new(label, unit) }
    }

    /// An axis of percentiles, see [`Scale::Percentile`].
    #[must_use]
    pub fn percentile(label: impl Into<String>) -> Self {
        Self { scale: Scale::Percentile, ..Self::new(label, "") }
    }

    /// The label with its unit: `time [s]`.
    pub(crate) fn heading(&self) -> String {
        if self.unit.is_empty() { self.label.clone() } else { format!("{} [{}]", self.label, self.unit) }
    }
}

impl Series {
    /// Points joined by a line.
    #[must_use]
    pub fn line(name: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Self {
            name: name.into(),
            like: String::new(),
            x: x.to_vec(),
            y: y.to_vec(),
            style: Style::Line,
            dashed: false,
        }
    }

    /// A staircase: each value holds until the next one.
    #[must_use]
    pub fn step(name: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Self { style: Style::Step, ..Self::line(name, x, y) }
    }

    /// Dots.
    #[must_use]
    pub fn points(name: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Self { style: Style::Points, ..Self::line(name, x, y) }
    }

    /// Bars from zero, such as those of a histogram.
    #[must_use]
    pub fn bars(name: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Self { style: Style::Bars, ..Self::line(name, x, y) }
    }

    /// A circle in a plane, such as a clearance or a limit.
    #[must_use]
    pub fn circle(name: impl Into<String>, centre: (f64, f64), radius: f64) -> Self {
        let angles = || (0..=120).map(|i| f64::from(i) * std::f64::consts::TAU / 120.0);
        let x: Vec<f64> = angles().map(|angle| centre.0 + radius * angle.cos()).collect();
        let y: Vec<f64> = angles().map(|angle| centre.1 + radius * angle.sin()).collect();
        Self::line(name, &x, &y)
    }

    /// Takes the colour of another name: the maximum of a controller in the colour of that controller.
    #[must_use]
    pub fn like(mut self, name: impl Into<String>) -> Self {
        self.like = name.into();
        self
    }

    /// Dashes the line.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        self.dashed = true;
        self
    }

    /// The name that selects its colour.
    pub(crate) fn colour_name(&self) -> &str {
        if self.like.is_empty() { &self.name } else { &self.like }
    }
}

impl Mark {
    /// Its label; empty for none.
    pub(crate) fn label(&self) -> &str {
        match self {
            Self::At { label, .. } | Self::Span { label, .. } | Self::Level { label, .. } => label,
        }
    }
}
