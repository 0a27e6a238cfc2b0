//! `freeplay train`: what a model leaves of a tracked tool's deviation, learned from recordings and proved before it moves anything.
//!
//! In the order in which data passes through it:
//!
//! 1. [`recorded`]: a [`RecordedRun`]: the reference, where the encoders were sent, and what the model leaves of the tool's deviation.
//! 2. [`data`]: [`Data`]: runs with the inputs of the network at every instant; runs of one path are one fold, held out together.
//! 3. [`structure`]: a [`Structure`]: inputs, layers, feedback of the own answer; how one is fitted and asked.
//! 4. [`held_out`]: paths predicted by what was trained on the others; [`selection`]: which inputs, and [`choice`]: which layers predict held-out paths best; [`baselines`]: what needs no network, and the paper's, beside them.
//! 5. [`bounds`]: what held-out paths confirm: a share for each axis, and the trust by the distance from what trained.
//! 6. [`weight_files`]: the weight files of all paths and of all but one; [`rehearsal`]: simulated runs of the model with the recorded remainder, which decide; [`significance`]: whether they are better, and not by chance.
//! 7. [`forecast`]: forecasts of held-out paths; [`text`] and [`page`]: all of it for a terminal and as a page.
//! 8. [`trained`]: what a training came to; [`command`]: the command line; [`train`] is all of it in one call.

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
