//! Ridge ARX: the best linear function of the network's regressors.
//!
//! # Formula
//! ŷ = ȳ + B (x − x̄), B = argmin Σ |y − ȳ − B (x − x̄)|² + λ n |B|² over the n training windows, on regressors and outputs scaled
//! to \[-1, 1\] (A. E. Hoerl, R. W. Kennard, "Ridge regression", Technometrics 12(1), 1970). λ is the one of
//! [`RIDGES`] with the least mean squared error on the validation windows.

use crate::columns::{column, column_mut};
use crate::gauss_newton::Samples;
use crate::narx::{PredictError, scale_regressors};
use crate::normal_equations::{DampedSolver, NormalEquations};
use crate::scaling::Scaling;
use crate::series::Series;
use crate::split::Split;
use crate::training::{fit_scaling, scaled};
use crate::window::{Layout, Window, WindowError, check_windows};
use nalgebra::DMatrix;

/// Candidate ridges λ, largest first.
pub const RIDGES: [f64; 13] =
    [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12];

/// A fitted linear model.
#[derive(Debug, Clone)]
pub struct Arx {
    layout: Layout,
    input_names: Vec<String>,
    output_names: Vec<String>,
    input_scaling: Scaling,
    output_scaling: Scaling,
    linear: Linear,
    ridge: f64,
}

/// ŷ = offset + B x, scaled.
#[derive(Debug, Clone)]
struct Linear {
    /// Regressors × outputs.
    coefficients: DMatrix<f64>,
    offset: Vec<f64>,
}

/// Reasons why no linear model can be fitted.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum ArxError {
    /// The layout is invalid, or a window does not match it.
    #[error(transparent)]
    Window(#[from] WindowError),
    /// There are no windows for the fit, or none for the choice of the ridge.
    #[error("{train} training and {validation} validation windows: the fit needs both")]
    NoWindows {
        /// Training windows.
        train: usize,
        /// Validation windows.
        validation: usize,
    },
    /// No ridge gives a finite model.
    #[error("the regressors are too large or too dependent for any ridge: check their units")]
    Singular,
}

impl Arx {
    /// Fits the linear model on `split.train`, choosing the ridge on `split.validation`.
    ///
    /// # Errors
    /// If the layout or a window is invalid, a part is empty, or no ridge gives a finite model.
    pub fn fit(series: &Series, split: &Split, layout: &Layout) -> Result<Self, ArxError> {
        layout.check(series.inputs(), series.outputs())?;
        for part in [&split.train, &split.validation] {
            check_windows(series, part, layout.memory(), layout.horizon)?;
        }
        let (train, validation) = (split.train.len(), split.validation.len());
        if train == 0 || validation == 0 {
            return Err(ArxError::NoWindows { train, validation });
        }
        let (input_scaling, output_scaling) = fit_scaling(series, &split.train, layout);
        let samples = |windows: &[Window]| scaled(series, windows, layout, &input_scaling, &output_scaling);
        let (linear, ridge) = fit_linear(samples(&split.train), &samples(&split.validation))?;
        let (input_names, output_names) = (series.input_names().to_vec(), series.output_names().to_vec());
        let layout = layout.clone();
        Ok(Self { layout, input_names, output_names, input_scaling, output_scaling, linear, ridge })
    }

    /// The chosen ridge λ.
    #[must_use]
    pub fn ridge(&self) -> f64 {
        self.ridge
    }

    /// The outputs at the windows' targets, row-major, in the outputs' own units.
    ///
    /// # Errors
    /// If the series has other channels, or a window lacks history or has another horizon.
    pub fn predict(&self, series: &Series, windows: &[Window]) -> Result<Vec<f64>, PredictError> {
        series.check_channels(&self.input_names, &self.output_names)?;
        check_windows(series, windows, self.layout.memory(), self.layout.horizon)?;
        let mut x = vec![0.0; self.linear.coefficients.nrows()];
        let mut predictions = Vec::with_capacity(windows.len() * self.output_names.len());
        for &window in windows {
            self.layout.regressors(series, window, &mut x);
            scale_regressors(&self.layout, &self.input_scaling, &self.output_scaling, &mut x);
            let row = predictions.len();
            predictions.extend(self.linear.outputs(&x));
            self.output_scaling.reverse(&mut predictions[row..]);
        }
        Ok(predictions)
    }
}

impl Linear {
    fn outputs(&self, x: &[f64]) -> impl Iterator<Item = f64> {
        self.offset.iter().enumerate().map(move |(output, offset)| {
            offset + column(&self.coefficients, output).iter().zip(x).map(|(b, x)| b * x).sum::<f64>()
        })
    }

    fn sum_of_squares(&self, samples: &Samples) -> f64 {
        let mut error = samples.outputs.clone();
        for (output, offset) in self.offset.iter().enumerate() {
            column_mut(&mut error, output).iter_mut().for_each(|e| *e -= offset);
        }
        error.gemm(-1.0, &samples.inputs, &self.coefficients, 1.0);
        error.norm_squared()
    }
}

/// The linear model with the ridge that gives the least error on `validation`.
#[expect(clippy::cast_precision_loss)]
fn fit_linear(train: Samples, validation: &Samples) -> Result<(Linear, f64), ArxError> {
    let Samples { mut inputs, mut outputs } = train;
    let (count, width) = (inputs.nrows() as f64, inputs.ncols());
    let (mean_x, mean_y) = (centre(&mut inputs), centre(&mut outputs));
    let mut equations = NormalEquations::new(width);
    let across = inputs.transpose();
    equations.matrix.gemm(1.0, &across, &inputs, 0.0);
    let mut moment = DMatrix::zeros(width, outputs.ncols());
    moment.gemm(-1.0, &across, &outputs, 0.0);
    let mut solver = DampedSolver::new(width);
    let mut solve = |ridge: f64| {
        let mut coefficients = DMatrix::zeros(width, mean_y.len());
        let mut offset = mean_y.clone();
        for (output, offset) in offset.iter_mut().enumerate() {
            equations.gradient.copy_from_slice(column(&moment, output));
            let found = column_mut(&mut coefficients, output);
            solver.step(&equations, ridge * count, found).ok()?;
            *offset -= found.iter().zip(&mean_x).map(|(b, x)| b * x).sum::<f64>();
        }
        let linear = Linear { coefficients, offset };
        let error = linear.sum_of_squares(validation);
        error.is_finite().then_some((linear, ridge, error))
    };
    let fits = RIDGES.iter().filter_map(|&ridge| solve(ridge));
    let best = fits.min_by(|a, b| a.2.total_cmp(&b.2)).ok_or(ArxError::Singular)?;
    Ok((best.0, best.1))
}

/// Subtracts each column's mean and returns it.
#[expect(clippy::cast_precision_loss)]
fn centre(matrix: &mut DMatrix<f64>) -> Vec<f64> {
    let (rows, columns) = (matrix.nrows() as f64, matrix.ncols());
    let centre_column = |index| {
        let values = column_mut(matrix, index);
        let mean = values.iter().sum::<f64>() / rows;
        values.iter_mut().for_each(|value| *value -= mean);
        mean
    };
    (0..columns).map(centre_column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::score;
    use crate::split::{Fractions, by_block};
    use crate::window::{targets, windows};
    use rand::{RngExt, SeedableRng};

    fn layout() -> Layout {
        Layout { input_lags: vec![0, 1], output_lags: vec![0, 1], horizon: 1, input_at_target: false }
    }

    /// y\[k+1\] = 0.6 y\[k\] − 0.2 y\[k−1\] + 0.5 u\[k\] + 0.1 u\[k−1\] + 3, plus noise.
    fn linear_system(noise: f64) -> Series {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(21);
        let u: Vec<f64> = (0..400).map(|_| rng.random_range(-1.0..1.0)).collect();
        let mut y = vec![5.0, 5.0];
        for k in 1..399 {
            let clean = 0.6 * y[k] - 0.2 * y[k - 1] + 0.5 * u[k] + 0.1 * u[k - 1] + 3.0;
            y.push(clean + noise * rng.random_range(-1.0..1.0));
        }
        let mut series = Series::new(&["u"], &["y"]).unwrap();
        series.push_run("run", u, y).unwrap();
        series
    }

    fn blocks(series: &Series) -> Split {
        by_block(&windows(series, 1, 1).unwrap(), Fractions::PAPER, 2).unwrap()
    }

    #[test]
    fn a_linear_system_is_predicted_exactly() {
        let series = linear_system(0.0);
        let split = blocks(&series);
        let arx = Arx::fit(&series, &split, &layout()).unwrap();
        let prediction = arx.predict(&series, &split.test).unwrap();
        let test = score(&targets(&series, &split.test), &prediction, 1, None).unwrap()[0];
        eprintln!("ridge {:e}, largest error {:.1e} on {} windows", arx.ridge(), test.max, test.count);
        assert!(test.max < 1.0e-9 && test.count > 100);
    }

    #[test]
    fn coefficients_equal_the_stacked_least_squares_solution() {
        let series = linear_system(0.3);
        let split = blocks(&series);
        let arx = Arx::fit(&series, &split, &layout()).unwrap();
        let Samples { mut inputs, mut outputs } =
            scaled(&series, &split.train, &arx.layout, &arx.input_scaling, &arx.output_scaling);
        centre(&mut inputs);
        centre(&mut outputs);
        let (rows, width) = (inputs.nrows(), inputs.ncols());
        let damping = (arx.ridge * rows as f64).sqrt();
        let stacked = DMatrix::from_fn(rows + width, width, |i, j| match i.checked_sub(rows) {
            None => inputs[(i, j)],
            Some(i) if i == j => damping,
            Some(_) => 0.0,
        });
        let right = DMatrix::from_fn(rows + width, 1, |i, _| if i < rows { outputs[(i, 0)] } else { 0.0 });
        let expected = stacked.svd(true, true).solve(&right, 0.0).unwrap();
        let found = column(&arx.linear.coefficients, 0);
        let worst = expected.iter().zip(found).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        eprintln!("ridge {:e}, {found:?}, largest difference {worst:.1e}", arx.ridge());
        assert!(expected.amax() > 0.1 && worst < 1.0e-11);
    }

    #[test]
    fn the_ridge_is_the_best_on_validation() {
        let series = linear_system(1.0);
        // Few training windows and useless lags: an unregularised fit overfits the noise.
        let layout = Layout { output_lags: (0..16).collect(), ..layout() };
        let all = windows(&series, layout.memory(), 1).unwrap();
        let split =
            Split { train: all[..24].to_vec(), validation: all[60..180].to_vec(), test: all[200..].to_vec() };
        let ridge = Arx::fit(&series, &split, &layout).unwrap().ridge();
        eprintln!("ridge chosen: {ridge:e}");
        assert!(ridge > 1.0e-4, "noise asks for damping");
    }

    #[test]
    fn bad_input_is_refused() {
        let series = linear_system(0.0);
        let split = blocks(&series);
        let empty = Split { validation: vec![], ..split.clone() };
        assert!(matches!(
            Arx::fit(&series, &empty, &layout()),
            Err(ArxError::NoWindows { validation: 0, .. })
        ));
        let longer = Layout { output_lags: vec![0, 9], ..layout() };
        assert!(matches!(Arx::fit(&series, &split, &longer), Err(ArxError::Window(_))));
        let arx = Arx::fit(&series, &split, &layout()).unwrap();
        let other = Series::new(&["v"], &["y"]).unwrap();
        assert!(matches!(arx.predict(&other, &[]), Err(PredictError::Channels(_))));
    }
}
