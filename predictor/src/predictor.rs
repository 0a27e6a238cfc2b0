//! A model that receives one sample after another inside a control loop; nothing is allocated after [`Predictor::new`].
//!
//! Each [`Predictor::push`] takes the samples of the present k and returns the prediction for k + h. If the outputs of the
//! present are not measured, the model uses its own prediction for k, made h samples ago (closed loop). Before such a prediction
//! exists, it uses the last known outputs, and before those the outputs given to [`Predictor::start_from`] (zero by default).

use crate::narx::{Narx, PredictError};
use crate::network::Scratch;
use crate::push_error::PushError;
use crate::series::Series;
use crate::window::{Layout, Window, check_windows};

/// The latest rows of a signal, scaled; lag 0 is the newest.
#[derive(Debug, Clone)]
struct History {
    channels: usize,
    newest: usize,
    rows: usize,
    values: Vec<f64>,
}

impl History {
    fn new(rows: usize, channels: usize) -> Self {
        Self { channels, newest: 0, rows, values: vec![0.0; rows * channels] }
    }

    fn row(&self, lag: usize) -> &[f64] {
        &self.values[(self.newest + lag) % self.rows * self.channels..][..self.channels]
    }

    /// Returns the slot of a new row; the oldest row is overwritten.
    fn push(&mut self) -> &mut [f64] {
        self.newest = (self.newest + self.rows - 1) % self.rows;
        &mut self.values[self.newest * self.channels..][..self.channels]
    }
}

/// A model with its memory of the latest samples.
#[derive(Debug, Clone)]
pub struct Predictor {
    narx: Narx,
    scratch: Scratch,
    inputs: History,
    outputs: History,
    /// Own predictions of the latest h samples, scaled; lag h − 1 is for the present.
    pending: History,
    /// Inputs at the predicted instant, scaled.
    planned: Vec<f64>,
    /// Outputs in use for the present, scaled.
    present: Vec<f64>,
    regressors: Vec<f64>,
    prediction: Vec<f64>,
    /// Number of samples taken, and of own predictions made without a break.
    taken: usize,
    predicted: usize,
}

impl Predictor {
    /// Creates a predictor without samples; it assumes outputs of zero (in their own units) until some are given.
    #[must_use]
    pub fn new(narx: Narx) -> Self {
        let (inputs, outputs) = (narx.input_names.len(), narx.output_names.len());
        let Layout { horizon, .. } = narx.layout;
        let rows = narx.layout.memory() + 1;
        let mut predictor = Self {
            scratch: narx.network.scratch(),
            inputs: History::new(rows, inputs),
            outputs: History::new(rows, outputs),
            pending: History::new(horizon, outputs),
            planned: vec![0.0; inputs],
            present: vec![0.0; outputs],
            regressors: vec![0.0; narx.network.inputs()],
            prediction: vec![0.0; outputs],
            taken: 0,
            predicted: 0,
            narx,
        };
        predictor.reset();
        predictor
    }

    /// The model.
    #[must_use]
    pub fn narx(&self) -> &Narx {
        &self.narx
    }

    /// Clears all samples and resets the assumed outputs to zero.
    pub fn reset(&mut self) {
        (self.taken, self.predicted) = (0, 0);
        self.present.fill(0.0);
        self.narx.output_scaling.apply(&mut self.present);
    }

    /// Sets the assumed outputs until one is measured or predicted, in their own units.
    ///
    /// # Errors
    /// If the length is wrong or a value is not finite; nothing changes then.
    pub fn start_from(&mut self, outputs: &[f64]) -> Result<(), PushError> {
        check("output", outputs, self.present.len())?;
        self.present.copy_from_slice(outputs);
        self.narx.output_scaling.apply(&mut self.present);
        Ok(())
    }

    /// Takes the samples of the present k, with outputs only if they are measured, and predicts the outputs of k + h (own units).
    /// Returns `None` until the history is full.
    ///
    /// # Errors
    /// If a sample has the wrong length or is not finite, if the model also needs the inputs at k + h, or if the prediction is
    /// not finite.
    pub fn push(&mut self, inputs: &[f64], outputs: Option<&[f64]>) -> Result<Option<&[f64]>, PushError> {
        self.advance(inputs, None, outputs)
    }

    /// Works as [`Predictor::push`] does, for models that use the inputs of the predicted instant k + h, `planned`.
    ///
    /// # Errors
    /// See [`Predictor::push`]; also if the model does not use `planned`.
    pub fn push_planned(
        &mut self,
        inputs: &[f64],
        planned: &[f64],
        outputs: Option<&[f64]>,
    ) -> Result<Option<&[f64]>, PushError> {
        self.advance(inputs, Some(planned), outputs)
    }

    pub(crate) fn advance(
        &mut self,
        inputs: &[f64],
        planned: Option<&[f64]>,
        outputs: Option<&[f64]>,
    ) -> Result<Option<&[f64]>, PushError> {
        self.check(inputs, planned, outputs)?;
        self.remember(inputs, planned, outputs);
        if self.taken <= self.narx.layout.memory() {
            return Ok(None);
        }
        let Self { narx, inputs, outputs, .. } = self;
        let planned = narx.layout.input_at_target.then_some(self.planned.as_slice());
        narx.layout.gather(|lag| inputs.row(lag), planned, |lag| outputs.row(lag), &mut self.regressors);
        let scaled = narx.network.forward(&self.regressors, &mut self.scratch);
        if let Some((channel, &value)) = scaled.iter().enumerate().find(|(_, value)| !value.is_finite()) {
            self.predicted = 0;
            return Err(PushError::NonFinitePrediction { channel, value });
        }
        self.pending.push().copy_from_slice(scaled);
        self.predicted += 1;
        self.prediction.copy_from_slice(scaled);
        narx.output_scaling.reverse(&mut self.prediction);
        Ok(Some(&self.prediction))
    }

    fn check(
        &self,
        inputs: &[f64],
        planned: Option<&[f64]>,
        outputs: Option<&[f64]>,
    ) -> Result<(), PushError> {
        let (used, given) = (self.narx.layout.input_at_target, planned.is_some());
        if used != given {
            return Err(PushError::Planned { used, given });
        }
        check("input", inputs, self.planned.len())?;
        planned.map_or(Ok(()), |planned| check("planned input", planned, self.planned.len()))?;
        outputs.map_or(Ok(()), |outputs| check("output", outputs, self.present.len()))
    }

    fn remember(&mut self, inputs: &[f64], planned: Option<&[f64]>, outputs: Option<&[f64]>) {
        let (of_inputs, of_outputs) = (&self.narx.input_scaling, &self.narx.output_scaling);
        let row = self.inputs.push();
        row.copy_from_slice(inputs);
        of_inputs.apply(row);
        if let Some(planned) = planned {
            self.planned.copy_from_slice(planned);
            of_inputs.apply(&mut self.planned);
        }
        if let Some(outputs) = outputs {
            self.present.copy_from_slice(outputs);
            of_outputs.apply(&mut self.present);
        } else if self.predicted >= self.narx.layout.horizon {
            self.present.copy_from_slice(self.pending.row(self.narx.layout.horizon - 1));
        }
        self.outputs.push().copy_from_slice(&self.present);
        self.taken += 1;
    }
}

fn check(kind: &'static str, values: &[f64], channels: usize) -> Result<(), PushError> {
    if values.len() != channels {
        return Err(PushError::WrongLength { kind, given: values.len(), channels });
    }
    match values.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        None => Ok(()),
        Some((channel, &value)) => Err(PushError::NonFinite { kind, channel, value }),
    }
}

impl Narx {
    /// Closed loop: predicts the outputs of samples `start` to `start + steps − 1` of one run, row-major, from measured inputs
    /// and, from `start` on, from the model's own outputs.
    ///
    /// # Errors
    /// If the series has other channels, `start` has less than memory + horizon samples before it, the run ends too early, or a
    /// prediction is not finite.
    pub fn free_run(
        &self,
        series: &Series,
        run: usize,
        start: usize,
        steps: usize,
    ) -> Result<Vec<f64>, PredictError> {
        series.check_channels(&self.input_names, &self.output_names)?;
        let Layout { horizon, .. } = self.layout;
        let present = start.saturating_sub(horizon);
        let edge = |ahead: usize| Window {
            run,
            present: present.saturating_add(ahead),
            target: start.saturating_add(ahead),
        };
        let ends = [edge(0), edge(steps.saturating_sub(1))];
        check_windows(series, &ends, self.layout.memory(), horizon)?;
        let mut predictor = Predictor::new(self.clone());
        let mut predictions = Vec::with_capacity(steps * series.outputs());
        for sample in present - self.layout.memory()..present + steps {
            let measured = (sample < start).then(|| series.output(run, sample));
            let ahead = self.layout.input_at_target.then(|| series.input(run, sample + horizon));
            let prediction = predictor
                .advance(series.input(run, sample), ahead, measured)
                .map_err(|source| PredictError::FreeRun { run, start, source })?;
            predictions.extend(prediction.into_iter().flatten());
        }
        Ok(predictions)
    }
}
