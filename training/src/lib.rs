//! `freeplay train`: trains a network on the remainder of a tracked tool's deviation beyond a model, and proves it in simulated runs before its use.
//!
//! The modules, in the order in which data passes through them:
//!
//! 1. [`recorded`]: a [`RecordedRun`]: the reference, the commanded encoder positions, and the residual of the model in the tool's position.
//! 2. [`data`]: [`Data`]: runs with the inputs of the network at every instant; runs of one path are one fold, held out together.
//! 3. [`structure`]: a [`Structure`]: inputs, layers, feedback of its own answers; its fit and its predictions.
//! 4. [`held_out`]: predictions of paths by networks trained on the others; [`selection`]: choice of the inputs; [`choice`]: choice of the layers;
//!    [`baselines`]: predictors without a network, and the paper's network, for comparison.
//! 5. [`bounds`]: bounds confirmed by held-out paths: a share for each axis, and the trust by the distance from the training motions.
//! 6. [`weight_files`]: the weight files of all paths and of all but one; [`rehearsal`]: simulated runs of the model with the recorded remainder as the proof;
//!    [`significance`]: test of the improvement.
//! 7. [`forecast`]: forecasts of held-out paths; [`text`] and [`page`]: the results for a terminal and as a page.
//! 8. [`trained`]: result of a training; [`command`]: the command line; [`train`] runs all of these steps in one call.

pub mod baselines;
pub mod bounds;
pub mod choice;
pub mod command;
pub mod data;
pub mod forecast;
pub mod held_out;
pub mod page;
pub mod recorded;
pub mod rehearsal;
pub mod selection;
pub mod significance;
pub mod structure;
pub mod text;
pub mod trained;
pub mod weight_files;

pub use command::{Settings, TrainArgs, train, train_command};
pub use data::Data;
pub use recorded::RecordedRun;
pub use structure::Structure;
pub use trained::Trained;
