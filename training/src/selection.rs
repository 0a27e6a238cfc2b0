//! Selection of the inputs of a network.
//!
//! A recorded path is a curve in the space of all inputs: a network with all inputs can fit it in many ways, few of which are valid on another path. If the
//! remainder depends on fewer inputs, the same few paths determine it at more points. The program therefore adds inputs one by one or group by group, and
//! removes them one by one, by the errors on held-out paths (stepwise selection, Efroymson 1960).
//!
//! The error of a path is the logarithm of the mean square of the residual ([`crate::significance`] uses the same measure for the simulated runs). The program
//! adds an input if the mean error over the paths falls by more than the standard error of the paired differences (the rule of one standard error, Breiman et
//! al. 1984, §3.4.3). The best of many candidates partly profits from its random initial weights; it must therefore pass a second time with initial weights
//! that had no part in the choice.

use freeplay_controller::remainder::InputGroup;
use freeplay_terminal::exit::Failure;

use crate::data::{Channel, Data};
use crate::held_out::{Answers, HeldOut, Tried, held_out, scored};
use crate::structure::{Fitting, Structure};

/// Hidden layers for the selection of inputs.
const PROBE: [usize; 1] = [8];
/// The network for the selection of inputs: a single one instead of a mean, because there are many to fit.
fn probe(inputs: &[Channel]) -> Structure {
    Structure { members: 1, ..Structure::plain(inputs, &PROBE) }
}

/// Negligible remainder, m; the same as in the simulated runs.
const NEGLIGIBLE: f64 = 1e-7;

/// The error of each path in `held`: the logarithm of the mean square of the residual over all axes, plus the negligible remainder.
pub fn errors(data: &Data, held: &[HeldOut]) -> Vec<f64> {
    let of_path = |held: &HeldOut| {
        let Answers { windows, predicted, .. } = &held.answers;
        let left = windows
            .iter()
            .zip(predicted)
            .map(|(window, predicted)| data.residual(window.run, window.target) - predicted);
        let (count, sum) =
            left.fold((0.0_f64, 0.0), |(count, sum), left| (count + 1.0, sum + left.norm_squared()));
        (sum / count.max(1.0) + NEGLIGIBLE * NEGLIGIBLE).ln()
    };
    held.iter().map(of_path).collect()
}

/// Arithmetic mean.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Returns true if the errors `found`, path by path, are lower than those `known` by more than one standard error.
pub fn is_lower(found: &[f64], known: &[f64]) -> bool {
    let falls: Vec<f64> = known.iter().zip(found).map(|(known, found)| known - found).collect();
    let (count, fall) = (falls.len() as f64, mean(&falls));
    let variance = falls.iter().map(|one| (one - fall).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    fall > (variance / count).sqrt()
}

/// Inputs, with the errors of each path.
type Outcome = (Vec<Channel>, Vec<f64>);

/// The search for inputs.
pub struct Selection<'a> {
    data: &'a Data,
    fitting: Fitting,
    /// Tried inputs.
    tried: Vec<Tried>,
    inputs: Vec<Channel>,
    /// Errors of these inputs on each path.
    errors: Vec<f64>,
}

impl<'a> Selection<'a> {
    /// Creates a selection among the inputs of `data`, by networks fitted with `fitting`.
    pub fn new(data: &'a Data, fitting: Fitting) -> Self {
        Self { data, fitting, tried: Vec::new(), inputs: Vec::new(), errors: Vec::new() }
    }
}

impl Selection<'_> {
    /// Returns the selected inputs, and all tried ones.
    ///
    /// # Errors
    /// Too few samples for the networks.
    pub fn run(mut self) -> Result<(Vec<Channel>, Vec<Tried>), Failure> {
        while self.add()? {
            while self.remove()? {}
        }
        Ok((self.inputs, self.tried))
    }

    /// The errors of the inputs `inputs` on each path.
    fn try_out(&mut self, inputs: &[Channel]) -> Result<Vec<f64>, Failure> {
        let structure = probe(inputs);
        let held = held_out(self.data, &structure, self.fitting)?;
        let name = structure.words(self.data.joints());
        self.tried.push(scored(self.data, name, held.iter().map(|held| &held.answers)));
        Ok(errors(self.data, &held))
    }

    /// The best inputs of `candidates`, with their errors.
    fn best(&mut self, candidates: Vec<Vec<Channel>>) -> Result<Option<Outcome>, Failure> {
        let mut best: Option<Outcome> = None;
        for inputs in candidates {
            let errors = self.try_out(&inputs)?;
            if best.as_ref().is_none_or(|(_, least)| mean(&errors) < mean(least)) {
                best = Some((inputs, errors));
            }
        }
        Ok(best)
    }

    /// The errors of the inputs `inputs` on each path with different initial weights.
    fn once_more(&self, inputs: &[Channel]) -> Result<Vec<f64>, Failure> {
        let fitting = Fitting { seed: self.fitting.seed.wrapping_add(1), ..self.fitting };
        Ok(errors(self.data, &held_out(self.data, &probe(inputs), fitting)?))
    }

    /// Adds the channel or group that helps most; returns false if none helps.
    fn add(&mut self) -> Result<bool, Failure> {
        let all = Channel::all(self.data.joints());
        let missing: Vec<Channel> =
            all.into_iter().filter(|channel| !self.inputs.contains(channel)).collect();
        let groups = Channel::groups(&missing).into_iter().map(|group| {
            missing.iter().copied().filter(|channel| channel.group == group).collect::<Vec<_>>()
        });
        let more = missing.iter().map(|channel| vec![*channel]).chain(groups.filter(|group| group.len() > 1));
        let candidates = more.map(|more| sorted([self.inputs.as_slice(), &more].concat())).collect();
        let Some((inputs, errors)) = self.best(candidates)? else { return Ok(false) };
        let helps = self.inputs.is_empty()
            || is_lower(&errors, &self.errors)
                && is_lower(&self.once_more(&inputs)?, &self.once_more(&self.inputs)?);
        if helps {
            (self.inputs, self.errors) = (inputs, errors);
        }
        Ok(helps)
    }

    /// Removes a channel whose removal does not raise the errors; returns false if there is none.
    fn remove(&mut self) -> Result<bool, Failure> {
        if self.inputs.len() < 2 {
            return Ok(false);
        }
        let without = |one: usize| {
            let rest = self.inputs.iter().enumerate().filter(|(at, _)| *at != one);
            rest.map(|(_, channel)| *channel).collect()
        };
        let candidates = (0..self.inputs.len()).map(without).collect();
        let Some((inputs, errors)) = self.best(candidates)? else { return Ok(false) };
        let is_useless = mean(&errors) <= mean(&self.errors);
        if is_useless {
            (self.inputs, self.errors) = (inputs, errors);
        }
        Ok(is_useless)
    }
}

/// `channels` in the order of a weight file.
fn sorted(mut channels: Vec<Channel>) -> Vec<Channel> {
    let place = |group: InputGroup| InputGroup::ALL.iter().position(|other| *other == group);
    channels.sort_by_key(|channel| (place(channel.group), channel.place));
    channels
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::{errors, is_lower};
    use crate::choice::choose;
    use crate::data::Data;
    use crate::recorded::RecordedRun;
    use crate::structure::Fitting;
    use freeplay_laws::Trajectory;
    use freeplay_model::paper_arm;
    use nalgebra::Vector3;

    const PERIOD: f64 = 0.02;

    /// A run in which every joint moves, at frequencies that depend on `path`; a detent in joint 3 displaces the tool by up to 0.2 mm.
    fn run(path: u32) -> RecordedRun {
        let points = 300;
        let t: Vec<f64> = (0..points).map(|k| f64::from(k) * PERIOD).collect();
        let of = |value: &dyn Fn(usize, f64) -> f64| -> Vec<Vec<f64>> {
            (0..6).map(|joint| t.iter().map(|t| value(joint, *t)).collect()).collect()
        };
        let rate = |joint: usize| 1.0 + 0.31 * f64::from(path) + 0.4 * ((joint * 7 + 3) % 5) as f64;
        let phase = |joint: usize| f64::from(path) * 1.7 + joint as f64;
        let q = of(&|joint, t| 0.3 * (rate(joint) * t + phase(joint)).sin());
        let v = of(&|joint, t| 0.3 * rate(joint) * (rate(joint) * t + phase(joint)).cos());
        let a = of(&|joint, t| -0.3 * rate(joint).powi(2) * (rate(joint) * t + phase(joint)).sin());
        let left = q[2].iter().map(|q| {
            let x = (q - 0.1) / 0.08;
            let size = x * (0.5 - 0.5 * x * x).exp();
            Vector3::new(-2e-5, 5e-6, 2e-4) * size
        });
        RecordedRun {
            name: path.to_string(),
            period: PERIOD,
            first_tick: 0,
            left: left.collect(),
            torque: Vec::new(),
            reference: Trajectory { stretches: std::iter::once(0..t.len()).collect(), t, q, v, a },
        }
    }

    /// If a remainder depends on one joint, a network with that joint as its only input predicts it on every path. With all positions as inputs the same
    /// networks fit the training paths equally well, but have errors of a third and more on a held-out one.
    #[test]
    fn a_remainder_of_one_joint_is_found_in_that_joint() {
        let data = Data::new(&paper_arm().arm, (0..3).map(run).collect()).unwrap();
        let fitting = Fitting { stride: 1, epochs: 60, seed: 1 };
        let (structure, held, tried) = choose(&data, fitting).unwrap();
        println!("{} of {} tried: {:?}", structure.words(6), tried.len(), errors(&data, &held));
        let names: Vec<String> = structure.inputs.iter().map(|channel| channel.name(6)).collect();
        // Without noise the last hundredths of a micrometre may add one or two more inputs.
        assert!(names.contains(&"position_3".to_owned()) && names.len() <= 3, "{names:?}");
        let square = |of: &dyn Fn(usize) -> Vector3<f64>, count: usize| {
            (0..count).map(|k| of(k).norm_squared()).sum::<f64>()
        };
        for one in &held {
            let windows = &one.answers.windows;
            let truth = |k: usize| data.residual(windows[k].run, windows[k].target);
            let (all, left) = (
                square(&truth, windows.len()),
                square(&|k| truth(k) - one.answers.predicted[k], windows.len()),
            );
            println!("path {}: {:.4} of the remainder is left", one.answers.fold, (left / all).sqrt());
            assert!((left / all).sqrt() < 0.1);
        }
    }

    #[test]
    fn an_input_is_taken_for_more_than_one_standard_error() {
        assert!(is_lower(&[-2.0, -2.1, -1.9], &[-1.0, -1.0, -1.0]));
        assert!(!is_lower(&[-4.0, -1.0, -0.99], &[-1.0, -1.0, -1.0]), "one path alone");
        assert!(!is_lower(&[-1.0, -1.0], &[-1.0, -1.0]) && !is_lower(&[0.0, 0.1], &[-1.0, -1.0]));
    }
}
