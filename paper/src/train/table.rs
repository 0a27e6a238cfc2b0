//! The table of skills.

use std::fmt::Write as _;

use comfy_table::{CellAlignment, Table, presets};
use freeplay_predictor::{Narx, Series};
use freeplay_terminal::exit::Failure;
use serde::Serialize;

use crate::train::Fitted;
use crate::train::collect::{Collected, Row};
use crate::train::score::{self, LEAST_ERROR, LEAST_VARIATION, Part};
use crate::train::series::{View, journals};

const AXES: [&str; 3] = ["x", "y", "z"];
/// How the names of the baselines begin, column by column.
const BASELINES: [&str; 4] = ["persistence", "quasi-static", "ridge", "previous"];

/// One axis in one part of one run.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// The run.
    pub run: String,
    /// Steady contact, or around detachments.
    pub part: Part,
    /// The axis of the base frame.
    pub axis: &'static str,
    /// Predictions.
    pub count: usize,
    /// Standard deviation of what is to be predicted, m.
    pub spread: f64,
    /// Root mean square error of each baseline, m.
    pub baselines: Vec<(&'static str, f64)>,
    /// Root mean square error of the plain NARX and of the paper's, if there are any, of the twin without a network, and with it, m.
    pub plain: Option<f64>,
    /// See above.
    pub paper: Option<f64>,
    /// See above.
    pub twin: f64,
    /// See above.
    pub network: f64,
    /// Root mean square error of the forecast of narx-qp: the twin's, corrected by what has proved right, m.
    pub product: f64,
}

impl Figures {
    /// 1 − MSE/MSE of the best baseline; none where that is off by less than [`LEAST_ERROR`].
    pub fn skill(&self, error: f64) -> Option<f64> {
        let best = self.baselines.iter().map(|(_, rms)| *rms).fold(f64::INFINITY, f64::min);
        (best >= LEAST_ERROR).then(|| 1.0 - (error / best).powi(2))
    }

    /// The table for a person.
    pub fn in_words(all: &[Self]) -> String {
        let mut table = Table::new();
        table.load_style(presets::NOTHING);
        let mut head = vec!["\nrun", "\npart", "\naxis", "\nn", "spread\n[µm]"];
        let lap = "previous\nlap";
        head.extend(["persist-\nence", "quasi-st.\n+ resid.", "ridge\nARX", lap]);
        head.extend(["plain\nNARX", "paper's\nNARX", "\ntwin", "twin +\nnetwork", "\nnarx-qp"]);
        head.extend(["skill\nplain", "\npaper's", "\ntwin", "twin +\nnetwork", "\nnarx-qp"]);
        table.set_header(head);
        for one in all {
            let short =
                |value: f64| if value.abs() < 1e6 { format!("{value:.3}") } else { format!("{value:.0e}") };
            let micro = |value: f64| short(value * 1e6);
            let skill = |error: f64| one.skill(error).map_or_else(|| "–".to_owned(), short);
            let part = match one.part {
                Part::Steady => "steady",
                Part::Detachment => "detach",
                Part::FreeRun => "free run",
            };
            let mut row = vec![one.run.clone(), part.to_owned(), one.axis.to_owned()];
            row.extend([one.count.to_string(), micro(one.spread)]);
            row.extend(BASELINES.map(|known| {
                let found = one.baselines.iter().find(|(name, _)| name.starts_with(known));
                found.map_or_else(|| "–".into(), |(_, rms)| micro(*rms))
            }));
            let narx = [one.plain, one.paper];
            row.extend(narx.map(|error| error.map_or_else(|| "–".into(), micro)));
            row.extend([micro(one.twin), micro(one.network), micro(one.product)]);
            row.extend(narx.map(|error| error.map_or_else(|| "–".into(), skill)));
            row.extend([skill(one.twin), skill(one.network), skill(one.product)]);
            table.add_row(row);
        }
        for column in 3..19 {
            if let Some(column) = table.column_mut(column) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        format!("{table}\n{}", in_short(all))
    }
}

/// A way to predict, by name, with its error in a row.
type Way = (&'static str, fn(&Figures) -> Option<f64>);
/// Those that learn.
const WAYS: [Way; 5] = [
    ("plain NARX", |one| one.plain),
    ("the paper's NARX", |one| one.paper),
    ("the twin", |one| Some(one.twin)),
    ("the twin with its network", |one| Some(one.network)),
    ("the forecast of narx-qp", |one| Some(one.product)),
];
/// The skill asked for around detachments.
const BAR: f64 = 0.5;

/// What the rows come to, way by way.
fn in_short(all: &[Figures]) -> String {
    let mut text = format!(
        "\nRMS errors in µm after 0.5 s; skill = 1 - MSE / MSE of the best baseline; – where that baseline is off by less than {} nm: nothing \
         is left to predict.\nFree run: the tool is never seen, the twin goes on from its own estimate over the whole run; the baseline is \
         quasi-static alone.\n",
        LEAST_ERROR * 1e9
    );
    for (name, error) in WAYS {
        let skills = |part: Part| -> Vec<f64> {
            let rows = all.iter().filter(|one| one.part == part);
            rows.filter_map(|one| one.skill(error(one)?)).collect()
        };
        let above = |skills: &[f64], bar: f64| skills.iter().filter(|skill| **skill > bar).count();
        let [steady, detached, free] = [Part::Steady, Part::Detachment, Part::FreeRun].map(skills);
        if detached.is_empty() {
            continue;
        }
        let least = detached.iter().copied().fold(f64::INFINITY, f64::min);
        let _ = write!(
            text,
            "{name}: skill above 0 in {} of {} rows of steady contact; around detachments above 0 in {} of {}, above {BAR} in {}, least \
             {least:.3}",
            above(&steady, 0.0),
            steady.len(),
            above(&detached, 0.0),
            detached.len(),
            above(&detached, BAR),
        );
        let free = if free.is_empty() {
            String::new()
        } else {
            format!("; free run above 0 in {} of {}", above(&free, 0.0), free.len())
        };
        let _ = writeln!(text, "{free}");
    }
    text
}

/// Scores what was predicted in `runs` without ever seeing the tool, beside quasi-static alone.
pub fn free_run(runs: &[Collected], horizon: usize) -> Vec<Figures> {
    let mut all = Vec::new();
    for (index, run) in runs.iter().enumerate() {
        let windows = score::whole(runs, index, horizon);
        let truth = score::truth(runs, &windows);
        let of = |said: fn(&Row) -> [f64; 2]| {
            let said: Vec<_> = windows.iter().map(|window| said(&run.rows[window.present])).collect();
            score::errors(runs, &windows, &truth, &said).map(f64::sqrt)
        };
        let (statics, twin) = (of(|row| row.rests[1]), of(|row| row.forecast));
        let (network, product) = (of(|row| row.piloted), of(|row| row.product));
        let spread = score::variance(runs, &windows, &truth).map(f64::sqrt);
        let moves = AXES.into_iter().enumerate().filter(|(axis, _)| spread[*axis] > LEAST_VARIATION);
        all.extend(moves.map(|(axis, name)| Figures {
            run: run.spec.name.clone(),
            part: Part::FreeRun,
            axis: name,
            count: windows.len(),
            spread: spread[axis],
            baselines: vec![("quasi-static", statics[axis])],
            plain: None,
            paper: None,
            twin: twin[axis],
            network: network[axis],
            product: product[axis],
        }));
    }
    all
}

/// Scores `fitted` on `runs`, which it has not seen.
///
/// # Errors
/// Weights that do not suit the runs.
pub fn score(fitted: &Fitted, runs: &[Collected]) -> Result<Vec<Figures>, Failure> {
    let mut all = Vec::new();
    let horizon = fitted.twin.layout().horizon;
    let twin = View::Twin.series(runs, horizon)?;
    let plain = View::Plain.series(runs, horizon)?;
    let paper = View::Paper.series(runs, horizon)?;
    let memory = View::Plain.layout(horizon).memory().max(horizon);
    for index in 0..runs.len() {
        let spec = &runs[index].spec;
        let lap = (spec.path.laps > 1).then(|| (spec.path.period * 1e3).round() as usize);
        let parts = score::windows(runs, index, horizon, memory, lap.unwrap_or(0));
        for (part, windows) in [Part::Steady, Part::Detachment].into_iter().zip(parts) {
            if windows.is_empty() {
                continue;
            }
            let truth = score::truth(runs, &windows);
            let of = |said: &[[f64; 2]]| score::errors(runs, &windows, &truth, said).map(f64::sqrt);
            let network = of(&journals(View::Twin, runs, &twin, &windows, &fitted.twin)?);
            let alone: Vec<_> = windows.iter().map(|w| runs[w.run].rows[w.present].forecast).collect();
            let alone = of(&alone);
            let product: Vec<_> = windows.iter().map(|w| runs[w.run].rows[w.present].product).collect();
            let product = of(&product);
            let others = fitted.others.as_ref();
            let said = |view: View, series: &Series, narx: &Narx| {
                journals(view, runs, series, &windows, narx).map(|said| of(&said))
            };
            let plain_narx = others.map(|others| said(View::Plain, &plain, &others.plain)).transpose()?;
            let paper_narx = others.map(|others| said(View::Paper, &paper, &others.paper)).transpose()?;
            let arx = others.map(|others| (&plain, &others.arx));
            let baselines = score::baselines(runs, &windows, arx, lap)?;
            let baselines: Vec<_> = baselines.iter().map(|(name, said)| (*name, of(said))).collect();
            let spread = score::variance(runs, &windows, &truth).map(f64::sqrt);
            for (axis, name) in
                AXES.into_iter().enumerate().filter(|(axis, _)| spread[*axis] > LEAST_VARIATION)
            {
                all.push(Figures {
                    run: spec.name.clone(),
                    part,
                    axis: name,
                    count: windows.len(),
                    spread: spread[axis],
                    baselines: baselines.iter().map(|(name, rms)| (*name, rms[axis])).collect(),
                    plain: plain_narx.map(|rms| rms[axis]),
                    paper: paper_narx.map(|rms| rms[axis]),
                    twin: alone[axis],
                    network: network[axis],
                    product: product[axis],
                });
            }
        }
    }
    Ok(all)
}
