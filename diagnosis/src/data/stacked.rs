//! The rows of a diagnosis: all channels of all recordings, the rows that count, and the part of the data to which each row belongs.

use std::ops::Range;

use freeplay_arm::Arm;
use freeplay_laws::{LawError, Placed};

use crate::data::columns::{Answer, Column};
use crate::data::linearised::LinearisedRecording;
use crate::data::nuisances::nuisances;
use crate::data::parts::{Part, parts_of};
use crate::data::rows::{row_error_with, solution_spread_with, usable_rows};
use crate::data::tolerance::{Nuisance, Of, Tolerances};
use crate::signals::channel::Kind;
use crate::statistics::WIDE;

/// Share of a step that the low-pass retains after its settling time, approximately: its poles decay to 6·10⁻⁶ each, and the two passes add up.
pub(crate) const REMEMBERED: f64 = 1e-4;

/// All recordings, stacked. One sequence of numbers covers all channels: those of the first recording, those of the second, and so on.
pub(crate) struct Data<'a> {
    /// The recordings.
    pub recordings: Vec<LinearisedRecording<'a>>,
    /// The tolerances of the model, by recording; the same number and order in each.
    pub nuisances: Vec<Vec<Nuisance>>,
    /// The rows that count, 1 or 0, `[channel][row]`.
    pub counts: Vec<Vec<f64>>,
    /// Standard deviation of the error of a perfect model in each row, in the channel's unit, `[channel][row]`.
    pub row_error: Vec<Vec<f64>>,
    /// The part to which each row belongs, `[recording][row]`.
    pub parts: Vec<Vec<Part>>,
    /// The parts that the present step of the diagnosis uses.
    pub active_parts: Vec<Part>,
    /// The division of the data, in words.
    pub how: String,
    /// The joints whose zeros are uncertain.
    fitted_zeros: Vec<usize>,
}

impl<'a> Data<'a> {
    /// Stacks `recordings` and divides their rows into parts. The zeros of the joints `fitted_zeros` are uncertain.
    pub fn new(
        recordings: Vec<LinearisedRecording<'a>>,
        tolerances: &Tolerances,
        fitted_zeros: &[usize],
    ) -> Self {
        let of_recording = |recording| nuisances(recording, tolerances, fitted_zeros);
        let nuisances = recordings.iter().map(of_recording).collect();
        let (mut counts, mut row_error) = (Vec::new(), Vec::new());
        for recording in &recordings {
            for channel in 0..recording.channels.len() {
                let rows = usable_rows(recording, channel);
                counts.push(rows.counts);
                row_error.push(rows.row_error);
            }
        }
        let (parts, how) = parts_of(&recordings, &counts);
        let (active_parts, fitted_zeros) = (vec![Part::Fit], fitted_zeros.to_vec());
        Self { recordings, nuisances, counts, row_error, parts, active_parts, how, fitted_zeros }
    }

    /// Recomputes the tolerances of the arm on the machine with the found effects: a gear twists more under a heavier link.
    pub fn update_tolerances(&mut self, tolerances: &Tolerances) {
        let of_recording = |recording| nuisances(recording, tolerances, &self.fitted_zeros);
        self.nuisances = self.recordings.iter().map(of_recording).collect();
    }

    /// Stacks `recordings` with all rows in the fit part, for a planned motion.
    pub fn whole(recordings: Vec<LinearisedRecording<'a>>, tolerances: &Tolerances) -> Self {
        let mut data = Self::new(recordings, tolerances, &[]);
        data.parts.iter_mut().for_each(|parts| parts.fill(Part::Fit));
        data
    }

    /// The arm of the model, with the effects of its file.
    pub fn arm(&self) -> &Arm {
        self.recordings[0].arm()
    }

    /// Number of channels of one recording.
    pub fn channels_per_recording(&self) -> usize {
        self.recordings.first().map_or(0, |recording| recording.channels.len())
    }

    /// The channels that measure the same quantity as the channel `c` of the first recording, one of each recording.
    pub fn same_channel(&self, c: usize) -> Vec<usize> {
        (c..self.channels()).step_by(self.channels_per_recording()).collect()
    }

    /// Number of channels of all recordings.
    pub fn channels(&self) -> usize {
        self.counts.len()
    }

    /// The recording of the channel number `channel`, and the number of the channel in that recording.
    pub fn place(&self, channel: usize) -> (usize, usize) {
        (channel / self.channels_per_recording(), channel % self.channels_per_recording())
    }

    /// The quantity that the channel number `channel` measures.
    pub fn kind(&self, channel: usize) -> Kind {
        let (recording, of_recording) = self.place(channel);
        self.recordings[recording].channels[of_recording].kind
    }

    /// The mask, 1 or 0, of the rows of the channel number `channel` that count and belong to one of `parts`.
    pub fn mask(&self, channel: usize, parts: &[Part]) -> Vec<f64> {
        let (recording, _) = self.place(channel);
        let rows = self.counts[channel].iter().zip(&self.parts[recording]);
        rows.map(|(counts, part)| if parts.contains(part) { *counts } else { 0.0 }).collect()
    }

    /// The mask, 1 or 0, of the rows of the channel number `channel` that count and that the present step uses.
    pub fn active_mask(&self, channel: usize) -> Vec<f64> {
        self.mask(channel, &self.active_parts)
    }

    /// Standard deviation of the error of each row, by channel, of a model that has all effects, namely those `found`: see [`row_error_with`].
    pub fn row_error_with(&self, found: &[Placed], seed: u64) -> Vec<Vec<f64>> {
        let of_recordings =
            self.recordings.iter().zip(self.row_error.chunks(self.channels_per_recording().max(1)));
        of_recordings
            .flat_map(|(recording, row_error)| row_error_with(recording, found, row_error, seed))
            .collect()
    }

    /// Standard deviation between the possible solutions of the effects `found`, by channel: see [`solution_spread_with`].
    pub fn solution_spread_with(&self, found: &[Placed]) -> Answer {
        self.recordings.iter().flat_map(|recording| solution_spread_with(recording, found)).collect()
    }

    /// Moves the rows in which one of `columns` is not zero, behind the low-pass, from the test part to the choice part. Each column belongs to an
    /// effect that begins and ends, and no other rows show that effect. Returns true if the test part remains longer than the memory of the low-pass;
    /// otherwise the method moves nothing.
    pub fn exclude_from_test<'c>(&mut self, columns: impl Iterator<Item = &'c Column>) -> bool {
        let before = self.parts.clone();
        // Where a force can't turn a joint, its torque there is a rounding error.
        let most =
            |column: &Column| column.iter().flatten().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        let columns = columns.map(|column| (column, REMEMBERED * most(column)));
        for (least, (channel, rows)) in
            columns.flat_map(|(column, least)| column.iter().enumerate().map(move |of| (least, of)))
        {
            let (recording, _) = self.place(channel);
            let Some(rows) = rows else { continue };
            let parts = self.parts[recording].iter_mut().zip(rows.iter().map(|x| x.abs() > least));
            parts
                .filter(|(part, says)| *says && **part == Part::Test)
                .for_each(|(part, _)| *part = Part::Choice);
        }
        let rests = self.recordings.iter().zip(&self.parts).map(|(recording, parts)| {
            let motion = recording.motion();
            let step = motion.stretches.first().map_or(0.0, |stretch| motion.step(stretch));
            let tests = parts.iter().filter(|part| **part == Part::Test).count();
            tests as f64 * step / recording.prepared.treatment.filter().settling_time()
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
            self.apply_mask(channel, rows);
            if rows.iter().all(|x| x.abs() <= 1e-9 * size) {
                *part = None;
            }
        }
        column
    }

    /// Sets the `rows` of the channel number `channel` that don't count to zero, and subtracts the mean from a link encoder.
    pub fn apply_mask(&self, channel: usize, rows: &mut [f64]) {
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
        let channels = self.recordings.iter().flat_map(|recording| &recording.channels);
        let residual = channels.enumerate().map(|(channel, of_recording)| {
            let mut rows = of_recording.residual();
            self.apply_mask(channel, &mut rows);
            rows
        });
        residual.collect()
    }

    /// Measured minus the model with `more` effects in each recording. All effects act together, as in an arm file.
    ///
    /// # Errors
    /// [`LawError::Changed`] if they leave no possible arm.
    pub fn residual_with(&self, more: impl Fn(usize) -> Vec<Placed>) -> Result<Vec<Vec<f64>>, LawError> {
        let mut residual = Vec::new();
        for (number, recording) in self.recordings.iter().enumerate() {
            residual.extend(recording.residual_with(&more(number).iter().collect::<Vec<_>>())?);
        }
        for (channel, rows) in residual.iter_mut().enumerate() {
            self.apply_mask(channel, rows);
        }
        Ok(residual)
    }

    /// Root of the mean square of `rows` where `masks` is one, in each channel of a recording, over all recordings; `None` without such a row.
    pub fn rms(&self, rows: &[Vec<f64>], masks: &[Vec<f64>]) -> Vec<Option<f64>> {
        let of_channel = |c: usize| {
            let (mut square, mut count) = (0.0, 0.0);
            for channel in self.same_channel(c) {
                for (x, mask) in rows[channel].iter().zip(&masks[channel]) {
                    square += mask * x * x;
                    count += mask;
                }
            }
            (count > 0.0).then(|| (square / count).sqrt())
        };
        (0..self.channels_per_recording()).map(of_channel).collect()
    }

    /// The columns of the tolerances, the precision of the prior of each, and its uncertain quantity. A tolerance without a prior has one column for each recording.
    pub fn tolerances(&self) -> (Vec<Column>, Vec<f64>, Vec<Of>) {
        let (mut columns, mut precision, mut of) = (Vec::new(), Vec::new(), Vec::new());
        let nothing = || vec![None; self.channels_per_recording()];
        for index in 0..self.nuisances.first().map_or(0, Vec::len) {
            let answer = |recording: usize| self.nuisances[recording][index].answer.clone();
            let recordings = 0..self.recordings.len();
            if self.nuisances[0][index].free {
                for only in recordings.clone() {
                    let answers = recordings.clone().map(|s| if s == only { answer(s) } else { nothing() });
                    columns.push(self.raw_column(answers.collect()));
                    precision.push(WIDE.powi(-2));
                    of.push(self.nuisances[0][index].of);
                }
            } else {
                columns.push(self.raw_column(recordings.map(answer).collect()));
                precision.push(1.0);
                of.push(self.nuisances[0][index].of);
            }
        }
        (columns, precision, of)
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

    /// Sets on each recording the effects that `found` returns for its arm: see [`LinearisedRecording::set_found`].
    pub fn set_found(&self, found: impl Fn(&Arm) -> Vec<Placed>) {
        self.recordings.iter().for_each(|recording| recording.set_found(found(recording.arm())));
    }

    /// The stretches without gaps of the recording of the channel number `channel`, and the time between their points, s.
    pub fn stretches(&self, channel: usize) -> impl Iterator<Item = (Range<usize>, f64)> + '_ {
        let motion = self.recordings[self.place(channel).0].motion();
        motion.stretches.iter().map(|stretch| (stretch.clone(), motion.step(stretch)))
    }
}
