//! The weight files of a training: one of all paths, and one without each held-out path for the simulated runs.

use freeplay_controller::remainder::{Condition, Learned, Machine, Region, WeightFile};
use freeplay_controller::{Model, Task};
use freeplay_predictor::Narx;
use freeplay_predictor::narx::NarxError;
use freeplay_terminal::exit::Failure;

use crate::bounds::{around, confirmed};
use crate::data::{Channel, Data};
use crate::held_out::{Answers, HeldOut, rms};
use crate::recorded::RecordedRun;
use crate::structure::{Fitting, Structure, fitted};

/// Inputs of the weight files.
pub struct Weights<'a> {
    /// The recordings.
    pub data: &'a Data,
    /// The network.
    pub structure: &'a Structure,
    /// Settings of the fit.
    pub fitting: Fitting,
    /// The command, for the file.
    pub command: &'a str,
    /// The task of the recordings.
    pub task: &'a Task,
    /// The model whose remainder is learned.
    pub model: &'a Model,
}

impl Weights<'_> {
    /// The weights of all paths, and for each of the `held` paths the weights of the others.
    ///
    /// # Errors
    /// Too few samples for the network, or inconsistent parts.
    pub fn files(&self, held: &[HeldOut]) -> Result<(WeightFile, Vec<WeightFile>), Failure> {
        let (data, stride) = (self.data, self.fitting.stride);
        let groups = Channel::groups(&self.structure.inputs);
        let answers: Vec<&Answers> = held.iter().map(|held| &held.answers).collect();
        let of_region = Region::inputs_for(&groups);
        let (trust, axes) = confirmed(data, &of_region, &answers, stride);
        let parts = |fold: Option<usize>| {
            let windows = data.windows(stride, 0, |run| Some(data.folds[run]) != fold);
            let region = around(data, &of_region, &windows);
            Learned {
                machine: self.machine(),
                command: self.command.to_owned(),
                conditions: self.conditions(),
                inputs: groups.clone(),
                axes: axes.clone(),
                region: Region { trust: trust.clone(), ..region },
            }
        };
        let series = data.series(&self.structure.inputs)?;
        let narx = fitted(data, &series, self.structure, self.fitting, |_| true)?;
        let file = |narx: &Narx, fold: Option<usize>| {
            let narx = self.widen_to_groups(narx).map_err(Failure::internal)?;
            WeightFile::new(&narx, parts(fold)).map_err(Failure::internal)
        };
        let whole = file(&narx, None)?;
        let of_fold = |held: &HeldOut| file(&held.narx, Some(held.answers.fold));
        Ok((whole, held.iter().map(of_fold).collect::<Result<_, _>>()?))
    }

    /// Widens the network `narx` of some channels to the channels of their whole groups, as a weight file requires.
    fn widen_to_groups(&self, narx: &Narx) -> Result<Narx, NarxError> {
        let (joints, inputs) = (self.data.joints(), &self.structure.inputs);
        let groups = Channel::groups(inputs);
        let all: Vec<Channel> =
            Channel::all(joints).into_iter().filter(|channel| groups.contains(&channel.group)).collect();
        let names: Vec<String> = all.iter().map(|channel| channel.name(joints)).collect();
        let places: Vec<usize> =
            inputs.iter().filter_map(|input| all.iter().position(|channel| channel == input)).collect();
        narx.widened(&names, &places)
    }

    fn machine(&self) -> Machine {
        let [arm, model] = self.model.hashes.clone();
        Machine::of(self.model.arm.name(), arm, model, self.task)
    }

    fn conditions(&self) -> Vec<Condition> {
        let of_run = |(index, run): (usize, &RecordedRun)| {
            let windows = self.data.windows(self.fitting.stride, 0, |other| other == index);
            let left = |axis: usize| 1e6 * rms(windows.iter().map(|window| run.left[window.target][axis]));
            let duration = run.len() as f64 * run.period;
            Condition { name: run.name.clone(), duration, rms_um: [left(0), left(1), left(2)] }
        };
        self.data.runs.iter().enumerate().map(of_run).collect()
    }
}
