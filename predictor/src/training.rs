//! Training: from a series and a split to a trained model.
//!
//! The scaling is fitted to the training windows alone. Errors are those of the scaled outputs, so that every output has the same weight, whatever its
//! unit; the mean squared errors of the history are in these scaled units.

use crate::activation::Activation;
use crate::evidence::minimise_by_evidence;
use crate::gauss_newton::{NetworkErrors, Samples};
use crate::initialise::nguyen_widrow;
use crate::levenberg_marquardt::{Epoch, MinimiseError, Outcome, Settings, minimise};
use crate::narx::{Narx, NarxError, Provenance, scale_regressors};
use crate::network::{Network, NetworkError, weight_count};
use crate::scaling::Scaling;
use crate::series::Series;
use crate::split::Split;
use crate::window::{Layout, Window, WindowError, check_windows, targets};
use nalgebra::DMatrix;
use std::ops::ControlFlow;

/// Settings of a training.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// Samples of a prediction, and horizon.
    pub layout: Layout,
    /// Least range of each input channel, in its unit ([`Scaling::with_least_ranges`]); may be empty.
    pub least_ranges: Vec<f64>,
    /// Units of each hidden layer; an empty list gives a linear model.
    pub hidden: Vec<usize>,
    /// Kind of hidden unit.
    pub activation: Activation,
    /// Seed of the initial weights.
    pub seed: u64,
    /// Parameters of Levenberg–Marquardt.
    pub settings: Settings,
    /// If true, weight decay is chosen by the evidence of the data ([`crate::evidence`]), and the validation windows join the training.
    pub decay: bool,
}

/// A trained model and the course of its training.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The model.
    pub narx: Narx,
    /// Weights, reason to stop, and history; mean squared errors of scaled outputs.
    pub outcome: Outcome,
}

/// Reasons why a model cannot be trained.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum TrainError {
    /// The layout is invalid, or a window does not match it.
    #[error(transparent)]
    Window(#[from] WindowError),
    /// There are fewer errors than weights.
    #[error(
        "{windows} training windows of {outputs} outputs are too few for {weights} weights: give at least {needed}, \
         or fewer lags or units"
    )]
    TooFewSamples {
        /// Given training windows.
        windows: usize,
        /// Number of outputs of a window.
        outputs: usize,
        /// Number of weights of the network.
        weights: usize,
        /// Required windows.
        needed: usize,
    },
    /// An output is constant.
    #[error(
        "output `{channel}` is {value} in every training window: leave it out or train on runs in which it varies"
    )]
    ConstantOutput {
        /// Name of the output.
        channel: String,
        /// Constant value of the output.
        value: f64,
    },
    /// The layer sizes are invalid.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Levenberg–Marquardt cannot start.
    #[error(transparent)]
    Minimise(#[from] MinimiseError),
    /// The parts of the trained model are inconsistent.
    #[error(transparent)]
    Model(#[from] NarxError),
}

/// Trains a model on `split.train`, with early stopping on `split.validation` unless that is empty. The same arguments give the same model. The function
/// calls `progress` for every epoch; the callback may end the training.
///
/// # Errors
/// If the layout, a window or a setting is invalid, the training windows are too few, or an output is constant in them.
pub fn train(
    series: &Series,
    split: &Split,
    recipe: &Recipe,
    provenance: Provenance,
    progress: impl FnMut(&Epoch) -> ControlFlow<()>,
) -> Result<Trained, TrainError> {
    let layout = &recipe.layout;
    let sizes = check(series, split, recipe)?;
    let (input_scaling, output_scaling) = fit_scaling(series, &split.train, layout);
    let input_scaling = input_scaling.with_least_ranges(&recipe.least_ranges);
    let samples = |windows: &[Window]| scaled(series, windows, layout, &input_scaling, &output_scaling);
    let validation = (!split.validation.is_empty()).then(|| samples(&split.validation));
    let start = nguyen_widrow(&sizes, recipe.activation, recipe.seed);
    let outcome = if recipe.decay {
        let all: Vec<Window> = split.train.iter().chain(&split.validation).copied().collect();
        let mut errors = NetworkErrors::new(&sizes, recipe.activation, samples(&all), None);
        minimise_by_evidence(&mut errors, &decay_classes(&sizes), start, &recipe.settings, progress)?
    } else {
        let mut errors = NetworkErrors::new(&sizes, recipe.activation, samples(&split.train), validation);
        minimise(&mut errors, start, &recipe.settings, progress)?
    };
    let narx = Narx {
        layout: layout.clone(),
        input_names: series.input_names().to_vec(),
        output_names: series.output_names().to_vec(),
        network: Network::new(&sizes, recipe.activation, outcome.weights.clone())?,
        input_scaling,
        output_scaling,
        provenance,
    };
    Ok(Trained { narx: narx.checked()?, outcome })
}

/// The class of each weight of a network with layers of `sizes`: the weights of one input, the biases of the first layer, and those of each further layer.
fn decay_classes(sizes: &[usize]) -> Vec<usize> {
    let mut classes = Vec::new();
    for (layer, pair) in sizes.windows(2).enumerate() {
        for _ in 0..pair[1] {
            classes.push(sizes[0] + layer);
            classes.extend((0..pair[0]).map(|input| if layer == 0 { input } else { sizes[0] + layer }));
        }
    }
    classes
}

/// The layer sizes, if series, split and recipe are consistent.
fn check(series: &Series, split: &Split, recipe: &Recipe) -> Result<Vec<usize>, TrainError> {
    let (layout, outputs) = (&recipe.layout, series.outputs());
    layout.check(series.inputs(), outputs)?;
    for part in [&split.train, &split.validation] {
        check_windows(series, part, layout.memory(), layout.horizon)?;
    }
    let mut sizes = vec![layout.width(series.inputs(), outputs)];
    sizes.extend(&recipe.hidden);
    sizes.push(outputs);
    if sizes.contains(&0) {
        return Err(NetworkError::BadSizes { sizes }.into());
    }
    let (windows, weights) = (split.train.len(), weight_count(&sizes));
    let needed = weights.div_ceil(outputs);
    if windows < needed {
        return Err(TrainError::TooFewSamples { windows, outputs, weights, needed });
    }
    let value = |window: &Window, channel: usize| series.output(window.run, window.target)[channel];
    for (channel, name) in series.output_names().iter().enumerate() {
        let first = value(&split.train[0], channel);
        if split.train.iter().all(|window| value(window, channel) == first) {
            return Err(TrainError::ConstantOutput { channel: name.clone(), value: first });
        }
    }
    Ok(sizes)
}

/// Fits the scaling of inputs and outputs to all samples in the windows.
pub(crate) fn fit_scaling(series: &Series, windows: &[Window], layout: &Layout) -> (Scaling, Scaling) {
    let inputs = windows.iter().flat_map(|w| {
        let past = layout.input_lags.iter().map(|lag| w.present - lag);
        past.chain(layout.input_at_target.then_some(w.target)).map(|sample| series.input(w.run, sample))
    });
    let outputs = windows.iter().flat_map(|w| {
        let past = layout.output_lags.iter().map(|lag| w.present - lag);
        past.chain([w.target]).map(|sample| series.output(w.run, sample))
    });
    (Scaling::fit(series.inputs(), inputs), Scaling::fit(series.outputs(), outputs))
}

/// The windows' scaled regressors and true outputs.
pub(crate) fn scaled(
    series: &Series,
    windows: &[Window],
    layout: &Layout,
    input_scaling: &Scaling,
    output_scaling: &Scaling,
) -> Samples {
    let (width, outputs) = (layout.width(series.inputs(), series.outputs()), series.outputs());
    let mut inputs = DMatrix::zeros(windows.len(), width);
    let mut row = vec![0.0; width];
    for (index, &window) in windows.iter().enumerate() {
        layout.regressors(series, window, &mut row);
        scale_regressors(layout, input_scaling, output_scaling, &mut row);
        row.iter().enumerate().for_each(|(column, value)| inputs[(index, column)] = *value);
    }
    let mut truth = targets(series, windows);
    truth.chunks_exact_mut(outputs).for_each(|row| output_scaling.apply(row));
    Samples { inputs, outputs: DMatrix::from_fn(windows.len(), outputs, |i, j| truth[i * outputs + j]) }
}
