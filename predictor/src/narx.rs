//! The trained model: a nonlinear autoregressive network with exogenous inputs (NARX).
//!
//! *Series-parallel* (open loop): every prediction uses measured outputs, h samples ahead. *Closed loop* (free run): from some instant on the
//! model uses its own predictions instead, so errors accumulate (K. S. Narendra, K. Parthasarathy, "Identification and control of dynamical
//! systems using neural networks", IEEE Trans. Neural Networks 1(1), 1990).

use crate::network::{Network, NetworkError};
use crate::push_error::PushError;
use crate::scaling::Scaling;
use crate::series::{Series, SeriesError};
use crate::window::{Layout, Window, WindowError, check_windows};
use serde::{Deserialize, Serialize};

/// Provenance of a model.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the arm whose motion trained the model.
    pub arm: String,
    /// Hash of the dynamic parameters of that arm.
    pub arm_hash: String,
    /// The joint whose play trained the model; empty if there is none.
    #[serde(default)]
    pub joint: String,
    /// The command that made the model.
    pub command: String,
    /// Descriptions of the training runs.
    #[serde(default)]
    pub scenarios: Vec<String>,
    /// Seed of the initial weights.
    #[serde(default)]
    pub seed: u64,
    /// True if runs outside the training proved that the model improves on the uncorrected prediction; false without a test.
    #[serde(default)]
    pub proved: bool,
}

/// A trained model; made by [`crate::train`] or read from a file.
#[derive(Debug, Clone)]
pub struct Narx {
    pub(crate) layout: Layout,
    pub(crate) input_names: Vec<String>,
    pub(crate) output_names: Vec<String>,
    pub(crate) input_scaling: Scaling,
    pub(crate) output_scaling: Scaling,
    pub(crate) network: Network,
    pub(crate) provenance: Provenance,
}

/// Errors of inconsistent parts of a model.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum NarxError {
    /// The layout is invalid.
    #[error(transparent)]
    Layout(#[from] WindowError),
    /// The network's first or last layer does not match the layout.
    #[error(
        "the lags of {inputs} input and {outputs} output channels make {width} regressors and {outputs} predictions, \
         but the network takes {network_inputs} and gives {network_outputs}"
    )]
    NetworkShape {
        /// Number of input channels.
        inputs: usize,
        /// Number of output channels.
        outputs: usize,
        /// Number of regressors according to the layout.
        width: usize,
        /// Number of inputs of the network.
        network_inputs: usize,
        /// Number of outputs of the network.
        network_outputs: usize,
    },
    /// Models without a mean: none, or models with different recipes.
    #[error(
        "models of other samples, channels, scalings, layers or units have no mean, and none has one: give models of one recipe"
    )]
    Mean,
    /// The given indices of the channels are invalid.
    #[error("{own} channels need a place each among {all}: give one place below {all} for each of them")]
    Places {
        /// Number of channels of the model.
        own: usize,
        /// Number of channels of the wider model.
        all: usize,
    },
    /// A scaling has the wrong number of channels, or an invalid value.
    #[error(
        "the {kind} scaling is not usable: it needs a finite minimum and a positive gain for each of {channels} channels"
    )]
    Scaling {
        /// `input` or `output`.
        kind: &'static str,
        /// Required number of channels.
        channels: usize,
    },
}

/// Reasons why a model cannot predict a series.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum PredictError {
    /// The series has other channels than the model.
    #[error(transparent)]
    Channels(#[from] SeriesError),
    /// A window does not match the model.
    #[error(transparent)]
    Window(#[from] WindowError),
    /// The model's own predictions diverged.
    #[error("free run from sample {start} of run {run}: {source}")]
    FreeRun {
        /// Index of the run.
        run: usize,
        /// First predicted sample.
        start: usize,
        /// Cause.
        source: PushError,
    },
}

impl Narx {
    /// Samples used for a prediction, and horizon.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Names of the input channels.
    #[must_use]
    pub fn input_names(&self) -> &[String] {
        &self.input_names
    }

    /// Names of the output channels.
    #[must_use]
    pub fn output_names(&self) -> &[String] {
        &self.output_names
    }

    /// The network between scaled regressors and scaled outputs.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// The network between regressors and outputs in their own units. The function moves the scalings into the first and last layers, so that
    /// no sample needs scaling.
    ///
    /// # Errors
    /// A weight that is not finite in these units.
    pub fn in_physical_units(&self) -> Result<Network, NetworkError> {
        let sizes = self.network.sizes();
        let mut weights = self.network.weights().to_vec();
        // The scaling of every regressor as s = v · gain + shift, and of every output as v = s · gain + shift.
        let map = |row: &mut dyn FnMut(&mut [f64]), count: usize| -> Vec<[f64; 2]> {
            let (mut at_zero, mut at_one) = (vec![0.0; count], vec![1.0; count]);
            row(&mut at_zero);
            row(&mut at_one);
            at_zero.iter().zip(&at_one).map(|(shift, one)| [one - shift, *shift]).collect()
        };
        let entering = map(
            &mut |row| scale_regressors(&self.layout, &self.input_scaling, &self.output_scaling, row),
            sizes[0],
        );
        for unit in weights[..(sizes[0] + 1) * sizes[1]].chunks_exact_mut(sizes[0] + 1) {
            let (bias, of_inputs) = unit.split_at_mut(1);
            for (weight, [gain, shift]) in of_inputs.iter_mut().zip(&entering) {
                bias[0] += *weight * shift;
                *weight *= gain;
            }
        }
        let (fan_in, outputs) = (sizes[sizes.len() - 2], self.output_names.len());
        let leaving = map(&mut |row| self.output_scaling.reverse(row), outputs);
        let last = weights.len() - (fan_in + 1) * outputs;
        for (unit, [gain, shift]) in weights[last..].chunks_exact_mut(fan_in + 1).zip(&leaving) {
            unit.iter_mut().for_each(|weight| *weight *= gain);
            unit[0] += shift;
        }
        Network::new(sizes, self.network.activation(), weights)
    }

    /// This model with the input channels `names`. Its own channels have the indices `places` among them; the weights of all other channels are
    /// zero.
    ///
    /// # Errors
    /// Invalid indices.
    pub fn widened(&self, names: &[String], places: &[usize]) -> Result<Self, NarxError> {
        let (own, all) = (self.input_names.len(), names.len());
        if places.len() != own || places.iter().any(|place| *place >= all) {
            return Err(NarxError::Places { own, all });
        }
        let sizes = self.network.sizes();
        let samples = self.layout.input_lags.len() + usize::from(self.layout.input_at_target);
        let (narrow, wide) = (sizes[0], sizes[0] + samples * (all - own));
        let mut weights = Vec::with_capacity(self.network.weights().len() + (wide - narrow) * sizes[1]);
        let (first, rest) = self.network.weights().split_at((narrow + 1) * sizes[1]);
        for unit in first.chunks_exact(narrow + 1) {
            let mut widened = vec![0.0; wide + 1];
            widened[0] = unit[0];
            for sample in 0..samples {
                for (channel, place) in places.iter().enumerate() {
                    widened[1 + sample * all + place] = unit[1 + sample * own + channel];
                }
            }
            widened[1 + samples * all..].copy_from_slice(&unit[1 + samples * own..]);
            weights.extend(widened);
        }
        weights.extend(rest);
        let mut widths = sizes.to_vec();
        widths[0] = wide;
        let network = Network::new(&widths, self.network.activation(), weights);
        let model = Self {
            input_names: names.to_vec(),
            input_scaling: self.input_scaling.widened(all, places),
            network: network.map_err(|_| NarxError::Places { own, all })?,
            ..self.clone()
        };
        model.checked()
    }

    /// The mean of `models` of one recipe as one model: their hidden units side by side, without weights between the units of different models.
    ///
    /// # Errors
    /// No model, or models that differ in more than their weights.
    pub fn mean(models: &[Self]) -> Result<Self, NarxError> {
        let (first, others) = models.split_first().ok_or(NarxError::Mean)?;
        let is_alike = |other: &Self| {
            (&first.layout, &first.input_names, &first.output_names)
                == (&other.layout, &other.input_names, &other.output_names)
                && first.input_scaling == other.input_scaling
                && first.output_scaling == other.output_scaling
        };
        if !others.iter().all(is_alike) {
            return Err(NarxError::Mean);
        }
        let networks: Vec<&Network> = models.iter().map(|model| &model.network).collect();
        let network = Network::mean(&networks).ok_or(NarxError::Mean)?;
        Self { network, ..first.clone() }.checked()
    }

    /// Provenance of the model.
    #[must_use]
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }

    /// This model, with the result of its proof on runs outside the training.
    #[must_use]
    pub fn with_proof(mut self, proved: bool) -> Self {
        self.provenance.proved = proved;
        self
    }

    /// Checks that the parts of the model are consistent.
    pub(crate) fn checked(self) -> Result<Self, NarxError> {
        let (inputs, outputs) = (self.input_names.len(), self.output_names.len());
        self.layout.check(inputs, outputs)?;
        let (width, network) = (self.layout.width(inputs, outputs), &self.network);
        let (network_inputs, network_outputs) = (network.inputs(), network.outputs());
        if (width, outputs) != (network_inputs, network_outputs) {
            return Err(NarxError::NetworkShape { inputs, outputs, width, network_inputs, network_outputs });
        }
        for (kind, scaling, channels) in
            [("input", &self.input_scaling, inputs), ("output", &self.output_scaling, outputs)]
        {
            if scaling.channels() != channels || !scaling.is_usable() {
                return Err(NarxError::Scaling { kind, channels });
            }
        }
        Ok(self)
    }

    /// Open loop: predicts the outputs at the windows' targets from measured samples, row-major, in the outputs' own units.
    ///
    /// # Errors
    /// If the series has other channels, or a window lacks history or has another horizon.
    pub fn predict(&self, series: &Series, windows: &[Window]) -> Result<Vec<f64>, PredictError> {
        series.check_channels(&self.input_names, &self.output_names)?;
        check_windows(series, windows, self.layout.memory(), self.layout.horizon)?;
        let mut scratch = self.network.scratch();
        let mut x = vec![0.0; self.network.inputs()];
        let mut predictions = Vec::with_capacity(windows.len() * self.output_names.len());
        for &window in windows {
            self.layout.regressors(series, window, &mut x);
            scale_regressors(&self.layout, &self.input_scaling, &self.output_scaling, &mut x);
            let row = predictions.len();
            predictions.extend_from_slice(self.network.forward(&x, &mut scratch));
            self.output_scaling.reverse(&mut predictions[row..]);
        }
        Ok(predictions)
    }
}

/// Scales one row of regressors, in the order of [`Layout`].
pub(crate) fn scale_regressors(layout: &Layout, inputs: &Scaling, outputs: &Scaling, row: &mut [f64]) {
    let of_inputs = layout.input_lags.len() + usize::from(layout.input_at_target);
    let (u, y) = row.split_at_mut(of_inputs * inputs.channels());
    u.chunks_exact_mut(inputs.channels().max(1)).for_each(|sample| inputs.apply(sample));
    y.chunks_exact_mut(outputs.channels().max(1)).for_each(|sample| outputs.apply(sample));
}
