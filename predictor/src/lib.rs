//! Learned prediction: NARX networks, Levenberg–Marquardt training, and the baselines that a network should beat.
//!
//! This crate works on time series of inputs u\[k\] and outputs y\[k\] (vectors, any units, evenly sampled) and is independent of
//! processes, arms and plants. Its nouns, in the order in which data passes through them:
//!
//! 1. [`series`]: [`Series`]: named input and output channels and one or more [`Run`]s of them, all finite.
//! 2. [`window`]: [`Layout`]: the past samples of a prediction and its horizon; [`Window`]: one prediction to make (run, present
//!    sample, target sample). Every predictor answers for the same windows.
//! 3. [`split`]: [`Split`]: the windows for training, for early stopping and for testing.
//! 4. [`scaling`]: [`Scaling`]: each channel's map to \[-1, 1\].
//! 5. [`activation`], [`network`]: [`Network`]: the feed-forward function; [`Scratch`]: its working memory.
//! 6. [`initialise`]: initial weights (Nguyen–Widrow, seeded).
//! 7. [`normal_equations`], [`levenberg_marquardt`]: the minimiser, for any [`LeastSquares`] problem; [`evidence`]: the same with
//!    a weight decay chosen by the evidence of the data; [`gauss_newton`]: a network's errors over a set of samples as such a
//!    problem.
//! 8. [`training`]: [`train`]: all of these steps, from [`Series`] and [`Split`] to a [`Narx`].
//! 9. [`narx`]: [`Narx`]: the trained model: layout, scaling, network and provenance; one-step prediction and free run.
//!    [`weight_file`]: a [`Narx`] as a versioned file.
//! 10. [`predictor`]: [`Predictor`]: a [`Narx`] fed sample by sample, for use inside a control loop.
//! 11. [`baselines`], [`arx`]: persistence, previous lap, a given physical prediction, ridge ARX.
//! 12. [`metrics`]: mean squared error, correlation and skill, per output channel.

pub mod activation;
pub mod arx;
pub mod baselines;
mod columns;
pub mod evidence;
pub mod gauss_newton;
pub mod initialise;
mod layer_pairs;
pub mod levenberg_marquardt;
pub mod metrics;
pub mod narx;
pub mod network;
pub mod normal_equations;
pub mod predictor;
pub mod push_error;
pub mod scaling;
pub mod series;
pub mod split;
pub mod training;
pub mod weight_file;
pub mod window;

pub use activation::Activation;
pub use arx::Arx;
pub use levenberg_marquardt::LeastSquares;
pub use narx::{Narx, Provenance};
pub use network::{Network, Scratch};
pub use predictor::Predictor;
pub use scaling::Scaling;
pub use series::{Run, Series};
pub use split::Split;
pub use training::train;
pub use window::{Layout, Window};
