//! All recordings that a fit rests on, stacked: the rows, the nuisances and the unnamed correction of every channel.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use freeplay_arm::Arm;
use freeplay_laws::{LawError, Placed};

use super::columns::Column;
use super::counted::rows_that_count;
use super::noise::effective_samples;
use super::show::rms;
use super::stage::{Answer, Stage};
use super::system::System;
use super::tolerance::{Nuisance, Tolerances, nuisances};
use super::universal::{Knots, Transfer, Universal};
use crate::residual::Kind;

/// Most numbers that are kept of the columns of laws, if each of these shows in all channels: 256 MB.
const MOST_LAID: usize = 1 << 25;

/// All recordings of a fit, stacked. Channels are numbered through: those of the first stage, those of the second, and so on.
pub(crate) struct Case<'a> {
    /// The recordings.
    pub stages: Vec<Stage<'a>>,
    /// The nuisances, by stage; the same in number and order in each.
    pub nuisances: Vec<Vec<Nuisance>>,
    /// How much each row counts, 0 to 1, by channel.
    pub kept: Vec<Vec<f64>>,
    /// By how much a perfect model may be off in each row, by channel: see [`super::counted::Counted`].
    pub doubt: Vec<Vec<f64>>,
    /// The unnamed correction of each channel.
    pub universal: Vec<Universal>,
    /// Knots of its hat functions, by joint.
    pub knots: Vec<Knots>,
    /// Columns of laws that were laid on it, by what they say: the same are asked for again and again.
    laid: RefCell<BTreeMap<String, Rc<Vec<Column>>>>,
}

/// How sure each channel is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Weighing {
    /// Standard deviation of what nothing explains, in the channel's unit.
    pub deviation: Vec<f64>,
    /// Effective number of samples.
    pub effective: Vec<f64>,
    /// Long-run variance of what the laws that were taken in miss, in squares of the channel's unit.
    pub misfit: Vec<f64>,
}

impl Weighing {
    /// w = 1/(σ² n/n_eff + misfit) of every channel, with σ at least `floor`: one over the long-run variance.
    pub fn weights(&self, rows: &[f64], floor: &[f64]) -> Vec<f64> {
        let channels =
            self.deviation.iter().zip(&self.effective).zip(&self.misfit).zip(rows.iter().zip(floor));
        channels
            .map(|(((deviation, effective), misfit), (rows, floor))| {
                let variance = deviation.max(*floor).powi(2) * rows / effective.max(1.0) + misfit;
                if *rows < 1.0 || variance <= 0.0 { 0.0 } else { 1.0 / variance }
            })
            .collect()
    }
}

impl<'a> Case<'a> {
    /// Stacks `stages`.
    pub fn new(stages: Vec<Stage<'a>>, tolerances: &Tolerances) -> Self {
        let nuisances: Vec<_> = stages.iter().map(|stage| nuisances(stage, tolerances)).collect();
        let knots = stages.first().map(Knots::of).unwrap_or_default();
        let (mut kept, mut doubt) = (Vec::new(), Vec::new());
        let mut universal = Vec::new();
        for (stage, nuisances) in stages.iter().zip(&nuisances) {
            for channel in 0..stage.channels.len() {
                let counted = rows_that_count(stage, channel);
                universal.push(Universal::new(stage, nuisances, channel, &counted.rows, &knots));
                kept.push(counted.rows);
                doubt.push(counted.doubt);
            }
        }
        Self { stages, nuisances, kept, doubt, universal, knots, laid: RefCell::default() }
    }

    /// The columns that are known by the name `key`, which `make` makes the first time.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn laid<E>(
        &self,
        key: String,
        make: impl FnOnce() -> Result<Vec<Column>, E>,
    ) -> Result<Rc<Vec<Column>>, E> {
        if let Some(known) = self.laid.borrow().get(&key) {
            return Ok(Rc::clone(known));
        }
        let made = Rc::new(make()?);
        let mut laid = self.laid.borrow_mut();
        if laid.len() * self.kept.iter().map(Vec::len).sum::<usize>() > MOST_LAID {
            laid.clear();
        }
        laid.insert(key, Rc::clone(&made));
        Ok(made)
    }

    /// Lets the columns of laws follow the arm with the effects that `found` makes for it: see [`Stage::lay_upon`].
    pub fn lay_upon(&self, found: impl Fn(&Arm) -> Vec<Placed>) {
        self.laid.borrow_mut().clear();
        self.stages.iter().for_each(|stage| stage.lay_upon(found(stage.arm())));
    }

    /// Number of channels of one recording.
    pub fn per_stage(&self) -> usize {
        self.stages.first().map_or(0, |stage| stage.channels.len())
    }

    /// Weights of the channels here: those of the same channel in the first recording of the fit, whose weights are `fitted`, sample by sample.
    pub fn weights_as(&self, fitted: &[f64]) -> Vec<f64> {
        (0..self.kept.len()).map(|c| fitted[c % self.per_stage()]).collect()
    }

    /// Of all recordings, the channels that are `of_stage` within a stage.
    pub fn all_of(&self, of_stage: &[usize]) -> Vec<usize> {
        (0..self.kept.len()).filter(|c| of_stage.contains(&(c % self.per_stage()))).collect()
    }

    /// Measured minus model of all channels with `more` effects, all of them at once: see [`Stage::left_with`]. Of link encoders the mean is taken
    /// off, whose zero nobody sets against the motors'.
    ///
    /// # Errors
    /// [`LawError::Changed`] if they leave no possible arm.
    pub fn left_with(&self, more: &[&Placed]) -> Result<Vec<Vec<f64>>, LawError> {
        let left: Vec<Vec<Vec<f64>>> =
            self.stages.iter().map(|stage| stage.left_with(more)).collect::<Result<_, _>>()?;
        let mut left: Vec<Vec<f64>> = left.into_iter().flatten().collect();
        for channel in (0..left.len()).filter(|&channel| self.is_link(channel)) {
            take_mean_off(&mut left[channel], &self.kept[channel]);
        }
        Ok(left)
    }

    /// Which stage and which of its channels the channel number `channel` is.
    pub fn place(&self, channel: usize) -> (usize, usize) {
        (channel / self.per_stage(), channel % self.per_stage())
    }

    /// Stacks one answer a stage into a column, with the rows that don't count set to zero; nothing where none counts.
    pub fn column(&self, answers: Vec<Answer>) -> Column {
        let mut column: Column = answers.into_iter().flatten().collect();
        for (part, kept) in column.iter_mut().zip(&self.kept) {
            match part {
                Some(_) if kept.iter().all(|kept| *kept == 0.0) => *part = None,
                Some(part) => part.iter_mut().zip(kept).for_each(|(x, kept)| *x *= kept),
                None => {}
            }
        }
        column
    }

    /// `column` with the mean taken off the link encoders, whose zero nobody sets against the motors': what is constant there says nothing.
    pub fn centred(&self, mut column: Column) -> Column {
        for (channel, part) in column.iter_mut().enumerate() {
            if let Some(rows) = part.as_mut().filter(|_| self.is_link(channel)) {
                let size = rows.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
                take_mean_off(rows, &self.kept[channel]);
                if rows.iter().all(|x| x.abs() <= 1e-9 * size) {
                    *part = None;
                }
            }
        }
        column
    }

    /// Whether the channel number `channel` is a link encoder.
    pub fn is_link(&self, channel: usize) -> bool {
        let (stage, of_stage) = self.place(channel);
        matches!(self.stages[stage].channels[of_stage].kind, Kind::Link(_))
    }

    /// Measured minus model in every channel.
    pub fn target(&self) -> Vec<Vec<f64>> {
        let channels = self.stages.iter().flat_map(|stage| &stage.channels);
        let masked = channels
            .zip(&self.kept)
            .map(|(channel, kept)| channel.residual().iter().zip(kept).map(|(x, kept)| x * kept).collect());
        masked.collect()
    }

    /// Number of rows that count, by channel.
    pub fn rows(&self) -> Vec<f64> {
        self.kept.iter().map(|kept| kept.iter().sum()).collect()
    }

    /// Root of the mean square of `rows` in each channel of a stage, over all recordings.
    pub fn rms(&self, rows: &[Vec<f64>]) -> Vec<f64> {
        let of_each: Vec<f64> = rows.iter().zip(&self.kept).map(|(rows, kept)| rms(rows, kept)).collect();
        self.by_channel(&of_each)
    }

    /// Root of the mean square of `deviations`, one of each channel of each recording, in each channel of a stage.
    pub fn by_channel(&self, deviations: &[f64]) -> Vec<f64> {
        let (per_stage, stages) = (self.per_stage(), self.stages.len().max(1) as f64);
        let of_channel = |c: usize| {
            let squares: f64 = deviations.iter().skip(c).step_by(per_stage).map(|rms| rms * rms).sum();
            (squares / stages).sqrt()
        };
        (0..per_stage).map(of_channel).collect()
    }

    /// The system of the nuisances for `target`.
    pub fn system(&self, target: Vec<Vec<f64>>) -> System {
        self.system_behind(target, None)
    }

    /// The same behind sensors that let through the `shares` of what each channel would show, by row.
    pub fn system_behind(&self, target: Vec<Vec<f64>>, shares: Option<&[Vec<f64>]>) -> System {
        let behind = |mut column: Column| {
            for (part, shares) in column.iter_mut().zip(shares.into_iter().flatten()) {
                part.iter_mut().flatten().zip(shares).for_each(|(x, share)| *x *= share);
            }
            column
        };
        let count = self.nuisances.first().map_or(0, Vec::len);
        let mut base = Vec::new();
        let mut precision = Vec::new();
        for index in 0..count {
            let of_stage = |stage: usize| self.nuisances[stage][index].answer.clone();
            if self.nuisances[0][index].free {
                // Free ones differ from recording to recording.
                for stage in 0..self.stages.len() {
                    let nothing = || vec![None; self.per_stage()];
                    let answers =
                        (0..self.stages.len()).map(|s| if s == stage { of_stage(s) } else { nothing() });
                    base.push(behind(self.column(answers.collect())));
                    precision.push(1e-12);
                }
            } else {
                base.push(behind(self.column((0..self.stages.len()).map(of_stage).collect())));
                precision.push(1.0);
            }
        }
        System::new(base, precision, target)
    }

    /// What the unnamed correction of each channel, fitted to `residual` here, says of the rows of `other`.
    pub fn unnamed_on(&self, other: &Case<'a>, residual: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let per_stage = self.per_stage();
        let mut out = vec![Vec::new(); other.kept.len()];
        for channel in 0..per_stage {
            let ours: Vec<usize> = (0..self.stages.len()).map(|stage| stage * per_stage + channel).collect();
            let theirs = (0..other.stages.len()).map(|stage| stage * per_stage + channel);
            let transfer = Transfer {
                channel,
                knots: &self.knots,
                fitted: ours.iter().map(|&c| self.part(c)).collect(),
                others: theirs.clone().map(|c| other.part(c)).collect(),
            };
            let columns: Vec<&[f64]> = ours.iter().map(|&c| residual[c].as_slice()).collect();
            for (index, said) in theirs.zip(transfer.explained(&columns)) {
                out[index] = said;
            }
        }
        out
    }

    /// Stage, nuisances and rows that count of the channel number `channel`.
    fn part(&self, channel: usize) -> (&Stage<'a>, &[Nuisance], &[f64]) {
        let (stage, _) = self.place(channel);
        (&self.stages[stage], &self.nuisances[stage], &self.kept[channel])
    }

    /// What nothing explains in each channel: what the unnamed correction leaves of `residual`.
    pub fn weigh(&self, residual: &[Vec<f64>]) -> Weighing {
        let nothing = vec![0.0; residual.len()];
        let mut weighing = Weighing { deviation: Vec::new(), effective: Vec::new(), misfit: nothing };
        for ((residual, universal), kept) in residual.iter().zip(&self.universal).zip(&self.kept) {
            let rest: Vec<f64> =
                residual.iter().zip(universal.explained(residual)).map(|(r, e)| r - e).collect();
            let effective = effective_samples(&rest);
            let rows: f64 = kept.iter().sum();
            let square: f64 = rest.iter().map(|x| x * x).sum();
            // The correction has taken part of the noise with it.
            let taken = (universal.size() as f64 / effective.max(1.0)).min(0.5);
            weighing.deviation.push((square / rows.max(1.0) / (1.0 - taken)).sqrt());
            weighing.effective.push(effective.min(rows));
        }
        weighing
    }
}

/// Takes their mean off those `rows` that are `kept`; the others are zero.
pub(crate) fn take_mean_off(rows: &mut [f64], kept: &[f64]) {
    let mean =
        rows.iter().zip(kept).map(|(x, kept)| x * kept).sum::<f64>() / kept.iter().sum::<f64>().max(1.0);
    rows.iter_mut().zip(kept).for_each(|(x, kept)| *x = (*x - mean) * kept);
}
