//! Recording of a run in this process: joints, torques and the tracked tool, the reference and the controller's prediction.

use std::path::PathBuf;

use freeplay_recording::Recording;
use freeplay_terminal::exit::Failure;

use crate::closed_loop::{RATE, Tick};

/// The columns of a run, tick by tick; see the module.
pub struct LoopRecorder {
    columns: Vec<(String, Vec<f64>)>,
    joints: usize,
}

impl LoopRecorder {
    /// Creates a recorder for an arm with `joints` joints.
    pub fn new(joints: usize) -> LoopRecorder {
        let of_joints = ["q", "qd", "tau", "q_ref", "qd_ref_", "qdd_ref_"];
        let names = of_joints.iter().flat_map(|name| (1..=joints).map(move |joint| format!("{name}{joint}")));
        let rest = ["x", "y", "z", "predicted_x", "predicted_y", "predicted_z", "tick"].map(str::to_owned);
        let columns = std::iter::once("t".to_owned()).chain(names).chain(rest);
        LoopRecorder { columns: columns.map(|name| (name, Vec::new())).collect(), joints }
    }

    /// Records one tick.
    pub fn keep(&mut self, tick: &Tick<'_>) {
        let (state, n) = (tick.state, self.joints);
        let joints =
            [&state.q, &state.qd, &state.tau, &state.reference.q, &state.reference.qd, &state.reference.qdd];
        let row = std::iter::once(state.tick as f64 / RATE)
            .chain(joints.into_iter().flat_map(|values| values[..n].iter().copied()))
            .chain(state.tool[..3].iter().copied())
            .chain(tick.answer.deviation)
            .chain([state.tick as f64]);
        self.columns.iter_mut().zip(row).for_each(|((_, column), value)| column.push(value));
    }

    /// The recording of the run of `controller`.
    ///
    /// # Errors
    /// Invalid columns.
    pub fn finish(self, controller: &str) -> Result<Recording, Failure> {
        Recording::new(&PathBuf::from(format!("{controller}.csv")), self.columns).map_err(Failure::internal)
    }
}
