//! Runs with the inputs of the network at every instant, grouped in folds that are held out together.

use freeplay_arm::Arm;
use freeplay_controller::compensation::Motion;
use freeplay_controller::remainder::{InputGroup, Inputs};
use freeplay_predictor::scaling::LEAST_RANGE;
use freeplay_predictor::{Series, Window};
use freeplay_terminal::exit::Failure;
use nalgebra::Vector3;

use crate::recorded::RecordedRun;

/// Duration of the excluded start of a run, s: a centred journal drops and a correction sets in.
pub const START_DURATION: f64 = 0.5;
/// Two runs have the same path if their joint positions differ nowhere by more than this share of the range over all runs.
const SAME_PATH: f64 = 0.02;
/// Names of the outputs.
pub const OUTPUT_NAMES: [&str; 3] = ["x", "y", "z"];
/// Number of points of a run for the comparison of paths.
const COMPARED: usize = 200;

/// One candidate input channel of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Group of the channel.
    pub group: InputGroup,
    /// Index in the group, from 0; usually the joint.
    pub place: usize,
}

impl Channel {
    /// Every channel of an arm with `joints` joints, group by group.
    pub fn all(joints: usize) -> Vec<Channel> {
        InputGroup::ALL
            .into_iter()
            .flat_map(|group| (0..group.width(joints)).map(move |place| Channel { group, place }))
            .collect()
    }

    /// Name of the channel for an arm with `joints` joints, such as `position_3`.
    pub fn name(self, joints: usize) -> String {
        self.group.names(joints).swap_remove(self.place)
    }

    /// The groups of `channels`, each once, in the order of [`InputGroup::ALL`].
    pub fn groups(channels: &[Channel]) -> Vec<InputGroup> {
        let has = |group: &InputGroup| channels.iter().any(|channel| channel.group == *group);
        InputGroup::ALL.into_iter().filter(has).collect()
    }
}

/// The runs; see the module.
pub struct Data {
    /// Recorded runs.
    pub runs: Vec<RecordedRun>,
    /// Fold of each run, from 0.
    pub folds: Vec<usize>,
    joints: usize,
    /// All inputs of all groups, `[run][point][input]`.
    inputs: Vec<Vec<Vec<f64>>>,
}

impl Data {
    /// Computes the inputs of `runs` on the nominal `arm` of the model.
    ///
    /// # Errors
    /// Runs of fewer than two paths, because a path must be held out.
    pub fn new(arm: &Arm, runs: Vec<RecordedRun>) -> Result<Self, Failure> {
        let folds = folds(&runs);
        if folds.iter().all(|fold| *fold == 0) {
            return Err(Failure::input(
                "all recordings are of one path, so that none can be held out: record two other paths or more",
            ));
        }
        let inputs = runs.iter().map(|run| inputs(arm, run)).collect();
        Ok(Self { folds, joints: arm.dof(), inputs, runs })
    }

    /// Number of folds.
    pub fn fold_count(&self) -> usize {
        self.folds.iter().max().map_or(0, |last| last + 1)
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Names of the runs of `fold`.
    pub fn fold_name(&self, fold: usize) -> String {
        let names = self.runs.iter().zip(&self.folds).filter(|(_, of)| **of == fold);
        names.map(|(run, _)| run.name.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The inputs of `groups` at `point` of `run`.
    pub fn row(&self, groups: &[InputGroup], run: usize, point: usize) -> Vec<f64> {
        let all = &self.inputs[run][point];
        groups
            .iter()
            .flat_map(|group| {
                let first = before(*group, self.joints);
                all[first..first + group.width(self.joints)].iter().copied()
            })
            .collect()
    }

    /// Residual of the model at `point` of `run`, m.
    pub fn residual(&self, run: usize, point: usize) -> Vector3<f64> {
        self.runs[run].left[point]
    }

    /// The runs as a series with `channels` as inputs.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn series(&self, channels: &[Channel]) -> Result<Series, Failure> {
        let names: Vec<String> = channels.iter().map(|channel| channel.name(self.joints)).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let columns: Vec<usize> = channels.iter().map(|channel| self.column(*channel)).collect();
        let mut series = Series::new(&names, &OUTPUT_NAMES).map_err(Failure::internal)?;
        for (run, all) in self.runs.iter().zip(&self.inputs) {
            let inputs = all.iter().flat_map(|row| columns.iter().map(|column| row[*column])).collect();
            let outputs = run.left.iter().flat_map(|left| [left.x, left.y, left.z]).collect();
            series.push_run(&run.name, inputs, outputs).map_err(Failure::input)?;
        }
        Ok(series)
    }

    /// The least range of each of `channels` at `windows`: [`LEAST_RANGE`] of the widest of its group.
    pub fn least_ranges(&self, channels: &[Channel], windows: &[Window]) -> Vec<f64> {
        let range = |channel: Channel| {
            let column = self.column(channel);
            let values = windows.iter().map(|window| self.inputs[window.run][window.target][column]);
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            high - low
        };
        let widest = |group: InputGroup| {
            let of_group = Channel::all(self.joints).into_iter().filter(|channel| channel.group == group);
            of_group.map(range).fold(0.0, f64::max)
        };
        channels.iter().map(|channel| LEAST_RANGE * widest(channel.group)).collect()
    }

    /// Column of `channel` among all inputs.
    fn column(&self, channel: Channel) -> usize {
        before(channel.group, self.joints) + channel.place
    }

    /// The windows of the runs selected by `is_in`, one every `stride` samples, after the start and with `memory` samples before.
    pub fn windows(&self, stride: usize, memory: usize, is_in: impl Fn(usize) -> bool) -> Vec<Window> {
        let mut windows = Vec::new();
        for (run, recorded) in self.runs.iter().enumerate().filter(|(run, _)| is_in(*run)) {
            let begun = recorded.first_tick as f64 * recorded.period;
            let start = ((START_DURATION - begun).max(0.0) / recorded.period).ceil() as usize;
            let first = start.max(memory + 1);
            let targets = (first..recorded.len()).step_by(stride);
            windows.extend(targets.map(|target| Window { run, present: target - 1, target }));
        }
        windows
    }
}

/// Number of inputs before `group`.
fn before(group: InputGroup, joints: usize) -> usize {
    InputGroup::ALL.iter().take_while(|other| **other != group).map(|other| other.width(joints)).sum()
}

fn inputs(arm: &Arm, run: &RecordedRun) -> Vec<Vec<f64>> {
    let mut inputs = Inputs::new(arm, &InputGroup::ALL, run.period);
    let blank = vec![0.0; arm.dof()];
    let [mut q, mut v, mut a] = [blank.clone(), blank.clone(), blank];
    (0..run.len())
        .map(|point| {
            run.reference.at(point, &mut q, &mut v, &mut a);
            inputs.at(run.first_tick + point as u64, Motion { q: &q, v: &v, a: &a }).to_vec()
        })
        .collect()
}

/// The fold of each run; runs of one path have the same fold.
fn folds(runs: &[RecordedRun]) -> Vec<usize> {
    let joints = runs.first().map_or(0, |run| run.reference.q.len());
    let range = |joint: usize| {
        let values = runs.iter().flat_map(|run| &run.reference.q[joint]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        (high - low).max(f64::MIN_POSITIVE)
    };
    let ranges: Vec<f64> = (0..joints).map(range).collect();
    let widest = ranges.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let points = |run: &RecordedRun| -> Vec<Vec<f64>> {
        let step = (run.len() / COMPARED).max(1);
        (0..run.len())
            .step_by(step)
            .map(|k| run.reference.q.iter().map(|q| q[k] / widest).collect())
            .collect()
    };
    let all: Vec<Vec<Vec<f64>>> = runs.iter().map(points).collect();
    let far = |from: &[Vec<f64>], to: &[Vec<f64>]| -> f64 {
        let nearest = |point: &Vec<f64>| {
            let square =
                |other: &Vec<f64>| -> f64 { point.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum() };
            to.iter().map(square).fold(f64::INFINITY, f64::min)
        };
        from.iter().map(nearest).fold(0.0, f64::max).sqrt()
    };
    let mut folds: Vec<usize> = Vec::with_capacity(runs.len());
    for run in 0..runs.len() {
        let same = (0..run).find(|&other| {
            far(&all[run], &all[other]) < SAME_PATH && far(&all[other], &all[run]) < SAME_PATH
        });
        let next = folds.iter().max().map_or(0, |last| last + 1);
        folds.push(same.map_or(next, |other| folds[other]));
    }
    folds
}
