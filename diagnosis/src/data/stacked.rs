//! The rows of a diagnosis: all channels of all recordings, the rows that count, and the part of the data to which each row belongs.

use std::ops::Range;

use freeplay_arm::Arm;
use freeplay_laws::{LawError, Placed};

use crate::data::columns::{Answer, Column};
use crate::data::nuisances::nuisances;
use crate::data::parts::{Part, parts_of};
use crate::data::rows::{apart_with, off_with, rows_that_count};
use crate::data::stage::Stage;
use crate::data::tolerance::{Nuisance, Tolerances};
use crate::signals::channel::Kind;
use crate::statistics::WIDE;

/// Share of a step that the low-pass retains after its settling time, approximately: its poles decay to 6·10⁻⁶ each, and the two passes add up.
pub(crate) const REMEMBERED: f64 = 1e-4;

/// All recordings, stacked. One sequence of numbers covers all channels: those of the first recording, those of the second, and so on.
pub(crate) struct Data<'a> {
    /// The recordings.
    pub stages: Vec<Stage<'a>>,
    /// The tolerances of the model, by recording; the same number and order in each.
    pub nuisances: Vec<Vec<Nuisance>>,
    /// The rows that count, 1 or 0, `[channel][row]`.
    pub counts: Vec<Vec<f64>>,
    /// Standard deviation of the error of a perfect model in each row, in the channel's unit, `[channel][row]`.
    pub off: Vec<Vec<f64>>,
    /// The part to which each row belongs, `[stage][row]`.
    pub parts: Vec<Vec<Part>>,
    /// The parts that the present step of the diagnosis uses.
    pub heard: Vec<Part>,
    /// How the data were divided, in words.
    pub how: String,
}

impl<'a> Data<'a> {
    /// Stacks `stages` and divides their rows into parts.
    pub fn new(stages: Vec<Stage<'a>>, tolerances: &Tolerances) -> Self {
        let nuisances = stages.iter().map(|stage| nuisances(stage, tolerances)).collect();
        let (mut counts, mut off) = (Vec::new(), Vec::new());
        for stage in &stages {
            for channel in 0..stage.channels.len() {
                let rows = rows_that_count(stage, channel);
                counts.push(rows.counts);
                off.push(rows.off);
            }
        }
        let (parts, how) = parts_of(&stages, &counts);
        Self { stages, nuisances, counts, off, parts, heard: vec![Part::Fit], how }
    }

    /// Recomputes the tolerances of the arm on the machine with the found effects: a gear twists more under a heavier link.
    pub fn follow(&mut self, tolerances: &Tolerances) {
        self.nuisances = self.stages.iter().map(|stage| nuisances(stage, tolerances)).collect();
    }

    /// Stacks `stages` with all rows in the fit part, for a planned motion.
    pub fn whole(stages: Vec<Stage<'a>>, tolerances: &Tolerances) -> Self {
        let mut data = Self::new(stages, tolerances);
        data.parts.iter_mut().for_each(|parts| parts.fill(Part::Fit));
        data
    }

    /// The arm of the model, with the effects of its file.
    pub fn arm(&self) -> &Arm {
        self.stages[0].arm()
    }

    /// Number of channels of one recording.
    pub fn per_stage(&self) -> usize {
        self.stages.first().map_or(0, |stage| stage.channels.len())
    }

    /// The channels that measure the same quantity as the channel `c` of the first recording, one of each recording.
    pub fn alike(&self, c: usize) -> Vec<usize> {
        (c..self.channels()).step_by(self.per_stage()).collect()
    }

    /// Number of channels of all recordings.
    pub fn channels(&self) -> usize {
        self.counts.len()
    }

    /// The recording of the channel number `channel`, and the number of the channel in that recording.
    pub fn place(&self, channel: usize) -> (usize, usize) {
        (channel / self.per_stage(), channel % self.per_stage())
    }

    /// The quantity that the channel number `channel` measures.
    pub fn kind(&self, channel: usize) -> Kind {
        let (stage, of_stage) = self.place(channel);
        self.stages[stage].channels[of_stage].kind
    }

    /// The mask, 1 or 0, of the rows of the channel number `channel` that count and belong to one of `parts`.
    pub fn mask(&self, channel: usize, parts: &[Part]) -> Vec<f64> {
        let (stage, _) = self.place(channel);
        let rows = self.counts[channel].iter().zip(&self.parts[stage]);
        rows.map(|(counts, part)| if parts.contains(part) { *counts } else { 0.0 }).collect()
    }

    /// The mask, 1 or 0, of the rows of the channel number `channel` that count and that the present step uses.
    pub fn heard(&self, channel: usize) -> Vec<f64> {
        self.mask(channel, &self.heard)
    }

    /// Standard deviation of the error of each row, by channel, of a model that has all effects, namely those `found`: see [`off_with`].
    pub fn off_with(&self, found: &[Placed], seed: u64) -> Vec<Vec<f64>> {
        let of_stages = self.stages.iter().zip(self.off.chunks(self.per_stage().max(1)));
        of_stages.flat_map(|(stage, off)| off_with(stage, found, off, seed)).collect()
    }

    /// Standard deviation between the possible solutions of the effects `found`, by channel: see [`apart_with`].
    pub fn apart_with(&self, found: &[Placed]) -> Answer {
        self.stages.iter().flat_map(|stage| apart_with(stage, found)).collect()
    }

    /// Moves the rows in which one of `columns` is not zero, behind the low-pass, from the test part to the choice part. Each column belongs to an
    /// effect that begins and ends, and no other rows show that effect. Returns true if the test part remains longer than the memory of the low-pass;
    /// otherwise the method moves nothing.
    pub fn give_moments<'c>(&mut self, columns: impl Iterator<Item = &'c Column>) -> bool {
        let before = self.parts.clone();
        // Where a force can't turn a joint, its torque there is a rounding error.
        let most =
            |column: &Column| column.iter().flatten().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        let columns = columns.map(|column| (column, REMEMBERED * most(column)));
        for (least, (channel, rows)) in
            columns.flat_map(|(column, least)| column.iter().enumerate().map(move |of| (least, of)))
        {
            let (stage, _) = self.place(channel);
            let Some(rows) = rows else { continue };
            let parts = self.parts[stage].iter_mut().zip(rows.iter().map(|x| x.abs() > least));
            parts
                .filter(|(part, says)| *says && **part == Part::Test)
                .for_each(|(part, _)| *part = Part::Choice);
        }
        let rests = self.stages.iter().zip(&self.parts).map(|(stage, parts)| {
            let motion = stage.motion();
            let step = motion.stretches.first().map_or(0.0, |stretch| motion.step(stretch));
            let tests = parts.iter().filter(|part| **part == Part::Test).count();
            tests as f64 * step / stage.ground.treatment.filter().settling_time()
        });
        let is_left = rests.sum::<f64>() > 1.0;
        if !is_left {
            self.parts = before;
        }
        is_left
    }

    /// Stacks one answer a recording into a column, and sets the rows that don't count to zero. A channel without a value holds `None`. The method
    /// subtracts the mean from link encoders, because nobody aligns their zero with that of the motors.
    pub fn column(&self, answers: Vec<Answer>) -> Column {
        let mut column: Column = answers.into_iter().flatten().collect();
        for (channel, part) in column.iter_mut().enumerate() {
            let Some(rows) = part else { continue };
            let size = rows.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            self.count(channel, rows);
            if rows.iter().all(|x| x.abs() <= 1e-9 * size) {
                *part = None;
            }
        }
        column
    }

    /// Sets the `rows` of the channel number `channel` that don't count to zero, and subtracts the mean from a link encoder.
    pub fn count(&self, channel: usize, rows: &mut [f64]) {
        let counts = &self.counts[channel];
        if matches!(self.kind(channel), Kind::Link(_)) {
            let sum: f64 = rows.iter().zip(counts).map(|(x, counts)| x * counts).sum();
            let mean = sum / counts.iter().sum::<f64>().max(1.0);
            rows.iter_mut().for_each(|x| *x -= mean);
        }
        rows.iter_mut().zip(counts).for_each(|(x, counts)| *x *= counts);
    }

    /// Measured minus the given model, in every channel.
    pub fn target(&self) -> Vec<Vec<f64>> {
        let channels = self.stages.iter().flat_map(|stage| &stage.channels);
        let residual = channels.enumerate().map(|(channel, of_stage)| {
            let mut rows = of_stage.residual();
            self.count(channel, &mut rows);
            rows
        });
        residual.collect()
    }

    /// Measured minus the model with `more` effects in each recording. All effects act together, as in an arm file.
    ///
    /// # Errors
    /// [`LawError::Changed`] if they leave no possible arm.
    pub fn left_with(&self, more: impl Fn(usize) -> Vec<Placed>) -> Result<Vec<Vec<f64>>, LawError> {
        let mut left = Vec::new();
        for (number, stage) in self.stages.iter().enumerate() {
            left.extend(stage.left_with(&more(number).iter().collect::<Vec<_>>())?);
        }
        for (channel, rows) in left.iter_mut().enumerate() {
            self.count(channel, rows);
        }
        Ok(left)
    }

    /// Root of the mean square of `rows` where `masks` is one, in each channel of a recording, over all recordings; `None` without such a row.
    pub fn rms(&self, rows: &[Vec<f64>], masks: &[Vec<f64>]) -> Vec<Option<f64>> {
        let of_channel = |c: usize| {
            let (mut square, mut count) = (0.0, 0.0);
            for channel in self.alike(c) {
                for (x, mask) in rows[channel].iter().zip(&masks[channel]) {
                    square += mask * x * x;
                    count += mask;
                }
            }
            (count > 0.0).then(|| (square / count).sqrt())
        };
        (0..self.per_stage()).map(of_channel).collect()
    }

    /// The columns of the tolerances, and the precision of the prior of each. A tolerance without a prior has one column for each recording.
    pub fn tolerances(&self) -> (Vec<Column>, Vec<f64>) {
        let (mut columns, mut precision) = (Vec::new(), Vec::new());
        let nothing = || vec![None; self.per_stage()];
        for index in 0..self.nuisances.first().map_or(0, Vec::len) {
            let answer = |stage: usize| self.nuisances[stage][index].answer.clone();
            let stages = 0..self.stages.len();
            if self.nuisances[0][index].free {
                for only in stages.clone() {
                    let answers = stages.clone().map(|s| if s == only { answer(s) } else { nothing() });
                    columns.push(self.raw_column(answers.collect()));
                    precision.push(WIDE.powi(-2));
                }
            } else {
                columns.push(self.raw_column(stages.map(answer).collect()));
                precision.push(1.0);
            }
        }
        (columns, precision)
    }

    /// [`Data::column`] without the subtraction of the mean from link encoders.
    fn raw_column(&self, answers: Vec<Answer>) -> Column {
        let mut column: Column = answers.into_iter().flatten().collect();
        for (part, counts) in column.iter_mut().zip(&self.counts) {
            if let Some(rows) = part {
                rows.iter_mut().zip(counts).for_each(|(x, counts)| *x *= counts);
            }
        }
        column
    }

    /// Sets on each recording the effects that `found` returns for its arm: see [`Stage::set_found`].
    pub fn set_found(&self, found: impl Fn(&Arm) -> Vec<Placed>) {
        self.stages.iter().for_each(|stage| stage.set_found(found(stage.arm())));
    }

    /// The stretches without gaps of the recording of the channel number `channel`, and the time between their points, s.
    pub fn stretches(&self, channel: usize) -> impl Iterator<Item = (Range<usize>, f64)> + '_ {
        let motion = self.stages[self.place(channel).0].motion();
        motion.stretches.iter().map(|stretch| (stretch.clone(), motion.step(stretch)))
    }
}
