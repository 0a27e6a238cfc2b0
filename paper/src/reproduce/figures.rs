//! The paper's Figs. 2 and 5 to 13, drawn from these runs.

use freeplay_harness::scenario::Drive;
use freeplay_laws::FrictionLaw;
use freeplay_path::PathKind;
use freeplay_report::{Axis, Chart, Drawing, Mark, Series};

use super::case::{CLEARANCES, Case, FRICTIONS, PERIODS, drive_name, path_name, rubbing};
use super::dataset::STRIDE;
use super::network::{Prediction, Study};
use super::orbit::JournalOrbit;
use super::peaks::ContactMode;
use super::trace::{Outcome, Runs, Trace};
use crate::simulation::TICK;

/// The axes of the base frame.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Name and colour of a clearance.
pub fn clearance_name(clearance: f64) -> String {
    if clearance == 0.0 { "perfect joint".to_owned() } else { format!("c = {clearance} mm") }
}

fn time() -> Axis {
    Axis::new("time", "s")
}

/// A line for each clearance with a run.
fn lines(
    chart: Chart,
    runs: &Runs,
    base: &Case,
    clearances: &[f64],
    column: impl Fn(&Trace) -> &[f64],
) -> Chart {
    let found = clearances.iter().rev().filter_map(|&clearance| runs.get(&Case { clearance, ..*base }));
    found.fold(chart, |chart, run| {
        chart.series(Series::line(clearance_name(run.case.clearance), &run.trace.times(), column(&run.trace)))
    })
}

/// The journal's orbit and its distance from the centre, by contact mode.
pub fn orbit(title: &str, caption: &str, orbit: &JournalOrbit, clearance: f64) -> Drawing {
    let (x, z) = (&orbit.offset[0], &orbit.offset[1]);
    let eccentricity = orbit.eccentricity();
    let rim = Series::circle("bearing, less the journal's radius", (0.0, 0.0), clearance)
        .like("perfect joint")
        .dashed();
    let mut plane = Chart::xy(
        "orbit of the journal's centre",
        Axis::new("along the forearm", "mm"),
        Axis::new("across it", "mm"),
    )
    .equal_axes()
    .series(rim);
    let mut distance = Chart::trace("its distance from the middle", time(), Axis::new("eccentricity", "mm"))
        .height(390)
        .in_view(0.0)
        .mark(Mark::Level { y: clearance, label: "clearance".into() });
    for mode in ContactMode::ALL {
        plane = plane.series(Series::line(mode.name(), &orbit.only(mode, x), &orbit.only(mode, z)));
        distance = distance.series(Series::line(mode.name(), &orbit.time, &orbit.only(mode, &eccentricity)));
    }
    Drawing::new(title).caption(caption).beside().panel(plane).panel(distance)
}

/// The force of joint 1 at both periods.
pub fn base_force(runs: &Runs, drive: Drive, path: PathKind) -> Drawing {
    let mut drawing = Drawing::new(format!("Force of joint 1: {}, {}", path_name(path), drive_name(drive)))
        .caption("Magnitude of the force that the base exerts on the first moving body, gravity included; the greatest within each millisecond.");
    for period in PERIODS {
        let chart =
            Chart::trace(format!("T = {period} s"), time(), Axis::new("force of joint 1", "N")).height(230);
        let base = Case::new(drive, path, period, 0.0);
        drawing = drawing.panel(lines(chart, runs, &base, &with_perfect(), |trace| &trace.base_force));
    }
    let base = Case::new(drive, path, PERIODS[0], 0.0);
    let mut start =
        Chart::trace("the first 0.3 s of T = 6 s", time(), Axis::new("force of joint 1", "N")).height(230);
    for run in with_perfect().iter().rev().filter_map(|&clearance| runs.get(&Case { clearance, ..base })) {
        let (t, force) = part(run, &run.trace.base_force, 0.0, 0.3);
        start = start.series(Series::line(clearance_name(run.case.clearance), &t, &force));
    }
    drawing.panel(start)
}

/// No clearance and the paper's.
fn with_perfect() -> Vec<f64> {
    std::iter::once(0.0).chain(CLEARANCES).collect()
}

/// The torques of joints 1 and 2, perfect and with the greatest clearance.
pub fn torques(runs: &Runs, drive: Drive, path: PathKind, period: f64) -> Drawing {
    let base = Case::new(drive, path, period, 0.0);
    let mut drawing = Drawing::new(format!("Torques of joints 1 and 2: {}", base.situation()))
        .caption("The motors' torque at every millisecond, without the values between. The bounces of the first drop show at the beginning.");
    for joint in 0..2 {
        let axis = Axis::new(format!("torque of joint {}", joint + 1), "N·m");
        let chart = Chart::trace(format!("joint {}", joint + 1), time(), axis).height(230);
        let clearances = [0.0, CLEARANCES[2]];
        drawing = drawing.panel(lines(chart, runs, &base, &clearances, |trace| &trace.torque[joint]));
    }
    drawing
}

/// The deviation of the tool along each axis.
pub fn deviation(runs: &Runs, drive: Drive, path: PathKind, period: f64) -> Drawing {
    let base = Case::new(drive, path, period, 0.0);
    let mut drawing = Drawing::new(format!("Deviation of the tool: {}", base.situation())).caption(
        "True tool position minus that of the perfect arm on the desired joints. The journal starts in the middle of its bearing and falls onto its lower side.",
    );
    for (axis, name) in AXES.into_iter().enumerate() {
        let chart = Chart::trace("", time(), Axis::new(format!("deviation along {name}"), "mm")).height(190);
        drawing = drawing.panel(lines(chart, runs, &base, &CLEARANCES, |trace| &trace.deviation[axis]));
    }
    drawing
}

/// Printed and corrected friction law side by side.
pub fn friction(runs: &Runs) -> Drawing {
    let mut drawing = Drawing::new("The friction law as printed and corrected")
        .caption("Deviation along x from 0.5 to 1.5 s, c = 0.4 mm, smooth path, prescribed motion, T = 6 s. As printed the friction pushes along the sliding and keeps the journal rattling.")
        .beside();
    for coefficient in FRICTIONS {
        let axis = Axis::new("deviation along x", "mm");
        let mut chart = Chart::trace(format!("μ = {coefficient}"), time(), axis).height(240);
        let laws = [
            (FrictionLaw::Printed, "as printed", "impact"),
            (FrictionLaw::Corrected, "corrected", "c = 0.4 mm"),
        ];
        for (law, name, like) in laws {
            let Some(run) = runs.get(&rubbing(law, coefficient)) else { continue };
            let (t, x) = part(run, &run.trace.deviation[0], 0.5, 1.5);
            chart = chart.series(Series::line(name, &t, &x).like(like));
        }
        if chart.series.len() == laws.len() {
            drawing = drawing.panel(chart);
        }
    }
    drawing
}

/// Times and a column of `run` between two instants.
fn part(run: &Outcome, column: &[f64], from: f64, to: f64) -> (Vec<f64>, Vec<f64>) {
    let tick = |time: f64| ((time / TICK).round() as usize).min(run.trace.ticks());
    let range = tick(from)..tick(to);
    (run.trace.times()[range.clone()].to_vec(), column[range].to_vec())
}

/// Prediction and error of the network, over time.
pub fn prediction(study: &Study) -> Drawing {
    let shown = &study.shown;
    let t: Vec<f64> = shown.sample.iter().map(|&sample| (sample * STRIDE) as f64 * TICK).collect();
    let mut drawing = Drawing::new(format!("Prediction and error of the network, {}", setting_name(study))).caption(
        "One sample (8 ms) ahead from measured deviations, first training, all samples of the run with c = 0.6 mm: training, validation and test together, as far as they are in the run. The error is prediction minus truth.",
    );
    let (x, z) = (0, 2);
    for axis in [x, z] {
        let chart =
            Chart::trace("", time(), Axis::new(format!("deviation along {}", AXES[axis]), "mm")).height(180);
        drawing = drawing.panel(
            chart
                .series(Series::line("deviation", &t, &shown.truth[axis]).like("c = 0.6 mm"))
                .series(Series::line("prediction", &t, &shown.predicted[axis]).like("impact").dashed()),
        );
    }
    let mut errors = Chart::trace("", time(), Axis::new("error", "mm")).height(190);
    for (axis, like) in ["free flight", "impact", "continuous contact"].into_iter().enumerate() {
        let error: Vec<f64> =
            shown.predicted[axis].iter().zip(&shown.truth[axis]).map(|(p, y)| p - y).collect();
        errors = errors.series(Series::line(format!("error along {}", AXES[axis]), &t, &error).like(like));
    }
    drawing.panel(errors)
}

fn setting_name(study: &Study) -> String {
    let setting = &study.setting;
    format!(
        "{}, {}, T = {} s, {}, {} split",
        path_name(setting.path),
        drive_name(setting.drive),
        setting.period,
        setting.pool.name(),
        setting.cut.name()
    )
}

/// Prediction against truth on the test samples, with the line of best fit and R.
pub fn scatter(study: &Study) -> Drawing {
    let mut drawing = Drawing::new(format!("Prediction against truth, test samples, {}", setting_name(study)))
        .caption("The points of a good prediction lie on the diagonal. The converse does not hold: repeating the last value puts them there, too; see the claims.")
        .beside();
    for (axis, name) in AXES.into_iter().enumerate() {
        let (truth, predicted) = tested(&study.shown, axis);
        let Some(fit) = Fit::of(&truth, &predicted) else { continue };
        let low = truth.iter().copied().fold(f64::INFINITY, f64::min);
        let high = truth.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let ends = [low, high];
        let title =
            format!("{name}: R = {:.5}, prediction = {:.4} · truth {:+.2e} mm", fit.r, fit.slope, fit.offset);
        let chart = Chart::xy(
            title,
            Axis::new(format!("deviation along {name}"), "mm"),
            Axis::new("prediction", "mm"),
        );
        drawing = drawing.panel(
            Chart { height: 330, ..chart }
                .series(Series::points("test samples", &truth, &predicted).like("c = 0.6 mm"))
                .series(Series::line("prediction = truth", &ends, &ends).like("perfect joint").dashed())
                .series(
                    Series::line("best fit", &ends, &ends.map(|x| fit.slope * x + fit.offset)).like("impact"),
                ),
        );
    }
    drawing
}

/// Truth and prediction of the test samples.
fn tested(shown: &Prediction, axis: usize) -> (Vec<f64>, Vec<f64>) {
    let pairs = shown.truth[axis].iter().zip(&shown.predicted[axis]).zip(&shown.tested);
    pairs.filter(|(_, tested)| **tested).map(|((y, p), _)| (*y, *p)).unzip()
}

/// The line of least squares through points, and their correlation.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fit {
    slope: f64,
    offset: f64,
    r: f64,
}

impl Fit {
    /// `None` for fewer than two different points.
    fn of(x: &[f64], y: &[f64]) -> Option<Self> {
        let count = x.len() as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
        let (mx, my) = (mean(x), mean(y));
        let moment = |a: &[f64], ma: f64, b: &[f64], mb: f64| -> f64 {
            a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum()
        };
        let (xx, xy, yy) = (moment(x, mx, x, mx), moment(x, mx, y, my), moment(y, my, y, my));
        (xx > 0.0 && yy > 0.0).then(|| Self {
            slope: xy / xx,
            offset: my - xy / xx * mx,
            r: xy / (xx * yy).sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Fit, orbit};
    use crate::reproduce::orbit::JournalOrbit;
    use crate::reproduce::peaks::ContactMode;
    use freeplay_report::Document;

    #[test]
    fn a_fit_finds_the_line_and_r_its_closed_form() {
        let x = [0.0, 1.0, 2.0, 3.0];
        let line = Fit::of(&x, &x.map(|x| 2.0 * x - 1.0)).expect("a line");
        assert!(
            (line.slope - 2.0).abs() < 1e-12
                && (line.offset + 1.0).abs() < 1e-12
                && (line.r - 1.0).abs() < 1e-12
        );
        // y = (0, 1, 0, 1): slope 0.2, R = 1/√5.
        let rough = Fit::of(&x, &[0.0, 1.0, 0.0, 1.0]).expect("a line");
        println!("slope {} R {}", rough.slope, rough.r);
        assert!((rough.slope - 0.2).abs() < 1e-12 && (rough.r - 0.2f64.sqrt()).abs() < 1e-12);
        assert_eq!(Fit::of(&[1.0, 1.0], &[0.0, 1.0]), None);
    }

    #[test]
    fn the_orbit_s_axes_have_units_and_its_modes_names() {
        let drop = JournalOrbit {
            time: vec![0.0, 1e-4, 2e-4],
            offset: [vec![0.0, 0.1, 0.2], vec![0.0, -0.3, -0.6]],
            mode: vec![ContactMode::Free, ContactMode::Impact, ContactMode::Continuous],
        };
        let page = Document::new("t").overview(orbit("Orbit", "Seen across the axis.", &drop, 0.6)).to_html();
        let wanted = [
            "along the forearm [mm]",
            "across it [mm]",
            "time [s]",
            "eccentricity [mm]",
            "free flight",
            "continuous contact",
        ];
        for text in wanted {
            assert!(page.contains(text), "{text}");
        }
        assert_eq!(page.matches("<svg ").count(), 2);
    }
}
