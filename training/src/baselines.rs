//! Baselines on held-out paths: predictors without a network, and the network of the paper.
//!
//! - *the model alone*: predicts a remainder of zero;
//! - *the last value seen*: the tracker's last value at the end of the other paths (persistence without a tracker);
//! - *the nearest trained instant*: the remainder at the training instant with the closest inputs;
//! - *ridge ARX*: the best linear function of the same inputs;
//! - *the paper's NARX*: torques and path (of the joints) at the last two samples, with the last two of its own answers (closed loop), four layers of ten
//!   logistic units, Levenberg–Marquardt; a random half of the samples for training and a fifth for validation.

use freeplay_controller::remainder::InputGroup;
use freeplay_predictor::split::{Fractions, at_random};
use freeplay_predictor::{Activation, Arx, Layout, Series, Window};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::parallel::on_all_cores;
use nalgebra::Vector3;

use crate::bounds::around;
use crate::choice::PAPER;
use crate::data::{Channel, Data, OUTPUT_NAMES};
use crate::held_out::{Answers, Tried, scored};
use crate::structure::{Fitting, Structure, fit_with_split, predictions, split};

/// Predictor of the windows of a held-out fold, m.
type Say<'a> = dyn Fn(usize, &[Window]) -> Result<Vec<Vector3<f64>>, Failure> + 'a;

/// Most training windows of the paper's network, which has 700 weights.
const MOST: usize = 1500;

/// Scores all baselines on the inputs of `structure`.
///
/// # Errors
/// Too few samples.
pub fn all(data: &Data, structure: &Structure, fitting: Fitting) -> Result<Vec<Tried>, Failure> {
    let groups = Channel::groups(&structure.inputs);
    let series = data.series(&structure.inputs)?;
    let by = |name: &str, say: &Say<'_>| {
        let held = (0..data.fold_count()).map(|fold| {
            let windows = data.windows(fitting.stride, 0, |run| data.folds[run] == fold);
            Ok(Answers { fold, predicted: say(fold, &windows)?, windows })
        });
        let held: Vec<Answers> = held.collect::<Result<_, Failure>>()?;
        Ok::<Tried, Failure>(scored(data, name.to_owned(), held.iter()))
    };
    let mut all = vec![
        by("the model alone", &|_, windows| Ok(vec![Vector3::zeros(); windows.len()]))?,
        by("the last value seen", &|fold, windows| Ok(vec![last_seen(data, fold); windows.len()]))?,
        by("the nearest trained instant", &|fold, windows| {
            Ok(nearest(data, &groups, fitting, fold, windows))
        })?,
        by("ridge ARX", &|fold, windows| linear(data, structure, fitting, fold, &series, windows))?,
    ];
    all.extend(paper(data, fitting)?);
    Ok(all)
}

/// The remainder at the end of the last run of another path.
fn last_seen(data: &Data, fold: usize) -> Vector3<f64> {
    let last = (0..data.runs.len()).rev().find(|run| data.folds[*run] != fold);
    last.and_then(|run| data.runs[run].left.last().copied()).unwrap_or_default()
}

fn nearest(
    data: &Data,
    inputs: &[InputGroup],
    fitting: Fitting,
    fold: usize,
    windows: &[Window],
) -> Vec<Vector3<f64>> {
    let trained = data.windows(fitting.stride, 0, |run| data.folds[run] != fold);
    let gain = around(data, inputs, &trained).gain;
    let row = |window: &Window| -> Vec<f64> {
        let row = data.row(inputs, window.run, window.target);
        row.iter().zip(&gain).map(|(x, gain)| x * gain).collect()
    };
    let rows: Vec<Vec<f64>> = trained.iter().map(row).collect();
    let closest = |window: &Window| {
        let here = row(window);
        let square =
            |there: &Vec<f64>| -> f64 { here.iter().zip(there).map(|(a, b)| (a - b) * (a - b)).sum() };
        let best = (0..rows.len()).min_by(|&a, &b| square(&rows[a]).total_cmp(&square(&rows[b])));
        best.map_or_else(Vector3::zeros, |best| data.residual(trained[best].run, trained[best].target))
    };
    windows.iter().map(closest).collect()
}

fn linear(
    data: &Data,
    structure: &Structure,
    fitting: Fitting,
    fold: usize,
    series: &Series,
    windows: &[Window],
) -> Result<Vec<Vector3<f64>>, Failure> {
    let split = split(data, &structure.layout(), fitting, |run| data.folds[run] != fold);
    let arx = Arx::fit(series, &split, &structure.layout()).map_err(Failure::input)?;
    let rows = arx.predict(series, windows).map_err(Failure::internal)?;
    Ok(rows.chunks_exact(3).map(|row| Vector3::new(row[0], row[1], row[2])).collect())
}

/// Scores the paper's network on every held-out path; returns `None` for recordings without torques.
fn paper(data: &Data, fitting: Fitting) -> Result<Option<Tried>, Failure> {
    if data.runs.iter().any(|run| run.torque.is_empty()) {
        return Ok(None);
    }
    let series = paper_series(data)?;
    let structure = Structure {
        inputs: Vec::new(),
        hidden: PAPER.to_vec(),
        activation: Activation::Logistic,
        decay: false,
        feedback: vec![1, 2],
        members: 1,
    };
    let layout =
        Layout { input_lags: vec![0, 1], output_lags: vec![0, 1], horizon: 1, input_at_target: false };
    let held = on_all_cores(data.fold_count(), |fold| {
        let all = data.windows(1, layout.memory(), |run| data.folds[run] != fold);
        let stride = all.len().div_ceil(MOST).max(1);
        let some: Vec<Window> = all.into_iter().step_by(stride).collect();
        let split = at_random(&some, Fractions::PAPER, fitting.seed).map_err(Failure::internal)?;
        let narx = fit_with_split(&series, &structure, &layout, fitting, &split, Vec::new())?;
        let windows = data.windows(fitting.stride, layout.memory(), |run| data.folds[run] == fold);
        Ok(Answers { fold, predicted: predictions(&narx, &series, &windows)?, windows })
    })?;
    let name = "the paper's NARX (torques, path; 10-10-10-10), closed loop".to_owned();
    Ok(Some(scored(data, name, held.iter())))
}

/// A series with torques and joint path as inputs.
fn paper_series(data: &Data) -> Result<Series, Failure> {
    let torques: Vec<String> = (1..=data.joints()).map(|joint| format!("torque_{joint}")).collect();
    let positions: Vec<String> = (1..=data.joints()).map(|joint| format!("path_{joint}")).collect();
    let names: Vec<&str> = torques.iter().chain(&positions).map(String::as_str).collect();
    let mut series = Series::new(&names, &OUTPUT_NAMES).map_err(Failure::internal)?;
    for run in &data.runs {
        let columns = || run.torque.iter().chain(&run.reference.q);
        let inputs = (0..run.len()).flat_map(|point| columns().map(move |column| column[point])).collect();
        let outputs = run.left.iter().flat_map(|left| [left.x, left.y, left.z]).collect();
        series.push_run(&run.name, inputs, outputs).map_err(Failure::input)?;
    }
    Ok(series)
}
