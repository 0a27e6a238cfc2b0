//! Structure of a network: inputs and layers; its fit, and its predictions along a run.

use std::ops::ControlFlow;

use freeplay_predictor::levenberg_marquardt::Settings as Minimiser;
use freeplay_predictor::training::{Recipe, train as fit};
use freeplay_predictor::{Activation, Layout, Narx, Provenance, Series, Split, Window};
use freeplay_terminal::exit::Failure;
use nalgebra::Vector3;

use crate::data::{Channel, Data};

/// Length of the pieces of a run for training or validation, s. It is long compared with the time in which a remainder changes, so that predicting a piece is
/// not interpolation between its neighbours.
const PIECE: f64 = 0.4;
/// One of this many pieces serves validation.
const PIECES: usize = 5;
/// Number of networks of one layer in a mean; the tick has time for no more.
///
/// Between and beyond its samples, the output of a network depends on its initial weights. It differs from fit to fit, and the mean of several networks has a
/// smaller error than one of them (L. K. Hansen, P. Salamon, "Neural network ensembles", IEEE Trans. PAMI 12(10), 1990). The mean of such networks with the
/// same inputs is one network.
pub const MEMBERS: usize = 4;

/// Inputs and layers of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// Input channels.
    pub inputs: Vec<Channel>,
    /// Units of each hidden layer.
    pub hidden: Vec<usize>,
    /// Kind of hidden unit.
    pub activation: Activation,
    /// If true, weight decay is chosen by the evidence of the data; otherwise a part of the samples stops the training.
    pub decay: bool,
    /// Lags of its own answers that are fed back, as in a NARX in closed loop, samples.
    pub feedback: Vec<usize>,
    /// Number of fitted networks with different initial weights, whose mean is the answer.
    pub members: usize,
}

impl Structure {
    /// A structure without feedback, of tanh units, with the mean of [`MEMBERS`].
    pub fn plain(inputs: &[Channel], hidden: &[usize]) -> Self {
        Self {
            inputs: inputs.to_vec(),
            hidden: hidden.to_vec(),
            activation: Activation::Tanh,
            decay: true,
            feedback: Vec::new(),
            members: MEMBERS,
        }
    }

    /// Samples of a prediction: the planned inputs of the predicted instant, and its own answers.
    pub fn layout(&self) -> Layout {
        Layout {
            input_lags: Vec::new(),
            output_lags: self.feedback.iter().map(|lag| lag - 1).collect(),
            horizon: 1,
            input_at_target: true,
        }
    }

    /// Text of the structure, for an arm with `joints` joints.
    pub fn words(&self, joints: usize) -> String {
        let hidden: Vec<String> = self.hidden.iter().map(ToString::to_string).collect();
        let feedback = if self.feedback.is_empty() { "" } else { ", own answers fed back" };
        let units = if self.activation == Activation::Logistic { " logistic" } else { "" };
        let inputs: Vec<String> = self.inputs.iter().map(|input| input.name(joints)).collect();
        let members =
            if self.members > 1 { format!("mean of {} times ", self.members) } else { String::new() };
        format!("{members}{}{units} of {}{feedback}", hidden.join("-"), inputs.join(", "))
    }
}

/// Settings of a fit.
#[derive(Clone, Copy, Debug)]
pub struct Fitting {
    /// Samples between windows.
    pub stride: usize,
    /// Largest number of epochs.
    pub epochs: usize,
    /// Seed of the initial weights; the members of a mean use this one and the following ones.
    pub seed: u64,
}

/// The windows of the runs of `data` selected by `is_in`; every fifth piece of them serves validation.
pub fn split(data: &Data, layout: &Layout, fitting: Fitting, is_in: impl Fn(usize) -> bool) -> Split {
    let windows = data.windows(fitting.stride, layout.memory(), is_in);
    let stops = |window: &Window| {
        let at = window.target as f64 * data.runs[window.run].period;
        (at / PIECE) as usize % PIECES == PIECES - 1
    };
    let (validation, train) = windows.into_iter().partition(stops);
    Split { train, validation, test: Vec::new() }
}

/// Fits `structure` on the runs of `data` selected by `is_in`.
///
/// # Errors
/// Too few samples for the network.
pub fn fitted(
    data: &Data,
    series: &Series,
    structure: &Structure,
    fitting: Fitting,
    is_in: impl Fn(usize) -> bool,
) -> Result<Narx, Failure> {
    let layout = structure.layout();
    let split = split(data, &layout, fitting, is_in);
    let least_ranges = data.least_ranges(&structure.inputs, &split.train);
    fit_with_split(series, structure, &layout, fitting, &split, least_ranges)
}

/// Fits `structure` with the given `layout`, `split` and least ranges of the inputs.
///
/// # Errors
/// Too few samples for the network.
pub fn fit_with_split(
    series: &Series,
    structure: &Structure,
    layout: &Layout,
    fitting: Fitting,
    split: &Split,
    least_ranges: Vec<f64>,
) -> Result<Narx, Failure> {
    let recipe = Recipe {
        layout: layout.clone(),
        least_ranges,
        hidden: structure.hidden.clone(),
        activation: structure.activation,
        seed: fitting.seed,
        settings: Minimiser { epochs: fitting.epochs, ..Minimiser::default() },
        decay: structure.decay,
    };
    let one = |member: usize| {
        let recipe = Recipe { seed: fitting.seed.wrapping_add(member as u64), ..recipe.clone() };
        let trained = fit(series, split, &recipe, Provenance::default(), |_| ControlFlow::Continue(()));
        trained.map(|trained| trained.narx).map_err(Failure::input)
    };
    let members: Vec<Narx> = (0..structure.members).map(one).collect::<Result<_, _>>()?;
    Narx::mean(&members).map_err(Failure::internal)
}

/// Predictions of `narx` at the targets of `windows`, without any measurement of the tool, m.
///
/// # Errors
/// A network whose own answers diverge.
pub fn predictions(narx: &Narx, series: &Series, windows: &[Window]) -> Result<Vec<Vector3<f64>>, Failure> {
    let vector = |row: &[f64]| Vector3::new(row[0], row[1], row[2]);
    if narx.layout().output_lags.is_empty() {
        let rows = narx.predict(series, windows).map_err(Failure::internal)?;
        return Ok(rows.chunks_exact(3).map(vector).collect());
    }
    let mut all = Vec::with_capacity(windows.len());
    for of_run in windows.chunk_by(|a, b| a.run == b.run) {
        let (Some(first), Some(last)) = (of_run.first(), of_run.last()) else { continue };
        let mut predictor = freeplay_predictor::Predictor::new(narx.clone());
        let start = first.present.saturating_sub(narx.layout().memory() + 1);
        let mut wanted = of_run.iter().peekable();
        for present in start..=last.present {
            let (now, ahead) = (series.input(first.run, present), series.input(first.run, present + 1));
            let is_planned = narx.layout().input_at_target;
            let found =
                if is_planned { predictor.push_planned(now, ahead, None) } else { predictor.push(now, None) };
            let found = found.ok().flatten().map_or_else(Vector3::zeros, vector);
            if wanted.next_if(|window| window.present == present).is_some() {
                all.push(found);
            }
        }
    }
    Ok(all)
}
