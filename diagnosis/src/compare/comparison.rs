//! The errors of a model against a recording.

use freeplay_arm::Arm;
use freeplay_laws::Placed;
use freeplay_recording::Recording;
use serde::Serialize;

use crate::compare::channel_error::ChannelError;
use crate::compare::curves::Curves;
use crate::compare::notes;
use crate::compare::notes::MotionTally;
use crate::compare::tally::ChannelTally;
use crate::conventions::{SetupFinding, examine};
use crate::data::noise::Noises;
use crate::error::ResidualError;
use crate::signals::channel::Kind;
use crate::signals::long::most_rows;
use crate::signals::motion::{Settings, Treatment};
use crate::signals::residual::{Residuals, check_joints, residuals};
use crate::statistics::{FINEST, SIGNIFICANT, normal_quantile};

/// The schema of [`Comparison`] as JSON.
pub const SCHEMA: &str = "freeplay.compare/1";

/// The errors of a model against a recording: `freeplay compare --format json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Compared points: the recording on a uniform grid, filtered, without its ends, decimated.
    pub samples: usize,
    /// Samples of the recording.
    pub rows: usize,
    /// From its first sample to its last, s.
    pub duration_s: f64,
    /// Samples of the recording per second, Hz.
    pub rate_hz: f64,
    /// Cutoff of the zero-phase low-pass, Hz; infinite (`null`) for positions compared with commanded ones, without a filter.
    pub lowpass_hz: f64,
    /// Points per second after decimation, Hz.
    pub compared_hz: f64,
    /// One entry a channel: torques, tool, link encoders; or positions.
    pub channels: Vec<ChannelError>,
    /// The faults of the set-up: conventions on which recording and model disagree.
    pub setup: Vec<SetupFinding>,
    /// Remarks on the numbers, one sentence each.
    pub notes: Vec<String>,
}

impl Comparison {
    /// The channel with the largest error in multiples of its noise: a torque channel if the noise does not explain the error of one, otherwise any channel.
    /// Channels with hardly any signal compared with others of their unit are ignored. Without known noise, the channel with the largest `nrmse_std`.
    pub fn worst(&self) -> Option<&ChannelError> {
        let is_torque = |channel: &&ChannelError| matches!(channel.kind, Kind::Torque(_));
        let stands_out = |channel: &ChannelError| !self.is_within_noise(channel, channel.rmse);
        let any_torque = self.channels.iter().any(|channel| is_torque(&channel) && stands_out(channel));
        let greatest = |unit: &str| {
            let same = self.channels.iter().filter(|channel| channel.unit == unit);
            same.map(|channel| channel.rms_measured).fold(0.0, f64::max)
        };
        self.channels
            .iter()
            .filter(|channel| !any_torque || is_torque(channel))
            .filter(|channel| channel.std_measured > FINEST * greatest(channel.unit))
            .filter_map(|channel| Some((channel, channel.times_noise().or(channel.nrmse_std)?)))
            .filter(|(channel, _)| channel.nrmse_std.is_some())
            .max_by(|(_, a), (_, b)| a.total_cmp(b))
            .map(|(channel, _)| channel)
    }

    /// Returns true if the noise of `channel` can explain the `deviation`. An estimate of the noise scatters about the true deviation; the deviation must be
    /// below its 95 % quantile. After a low-pass two samples in each period of the cutoff are independent.
    pub fn is_within_noise(&self, channel: &ChannelError, deviation: f64) -> bool {
        let worth = 2.0 * self.lowpass_hz * self.samples as f64 / self.compared_hz;
        channel.noise.is_some_and(|noise| {
            deviation.powi(2)
                <= noise.powi(2) * (1.0 + normal_quantile(1.0 - SIGNIFICANT) * (2.0 / worth.max(1.0)).sqrt())
        })
    }

    /// The channels that vary by no more than their noise.
    pub fn of_noise(&self) -> impl Iterator<Item = &ChannelError> {
        let varying = self.channels.iter().filter(|channel| channel.nrmse_std.is_some());
        varying.filter(|channel| self.is_within_noise(channel, channel.std_measured))
    }

    /// Root mean square distance between the tracked and the modelled tool, m; `None` without a tracker.
    pub fn tool_distance(&self) -> Option<f64> {
        let tool = self.channels.iter().filter(|channel| matches!(channel.kind, Kind::Tool(_)));
        let squares: Vec<f64> = tool.map(|channel| channel.rmse.powi(2)).collect();
        (squares.len() == 3).then(|| squares.iter().sum::<f64>().sqrt())
    }
}

/// Compares `recording` with `arm` and its `effects`: the numbers, and their residuals. The function processes a recording of millions of rows in parts, which
/// does not change the numbers; it keeps those points of the residuals that a chart of the whole recording shows.
///
/// # Errors
/// See [`ResidualError`].
pub fn compare(
    arm: &Arm,
    effects: &[Placed],
    recording: &Recording,
    settings: &Settings,
) -> Result<(Comparison, Residuals), ResidualError> {
    in_parts(arm, effects, recording, settings, most_rows(recording.joints()))
}

/// [`compare`] in parts of `most` rows, if there are more.
pub(crate) fn in_parts(
    arm: &Arm,
    effects: &[Placed],
    recording: &Recording,
    settings: &Settings,
    most: usize,
) -> Result<(Comparison, Residuals), ResidualError> {
    check_joints(arm, recording)?;
    let treatment = Treatment::decided_by_windows(arm, recording, settings, most)?;
    let samples = treatment.stretches().last().map_or(0, |stretch| stretch.end);
    let compared_hz = treatment.rate_hz() / treatment.decimation() as f64;
    let mut motion = MotionTally::of(recording);
    let mut channels: Vec<ChannelTally> = Vec::new();
    let mut curves = Curves::new(samples, 1.0 / compared_hz, recording.len() > most);
    for part in treatment.parts(recording, most) {
        motion.add(recording, &part);
        let residuals = residuals(arm, effects, recording, &part)?;
        if channels.is_empty() {
            channels = residuals.channels.iter().map(ChannelTally::like).collect();
        }
        let noises = noises(recording, &part, &residuals);
        let parts = residuals.channels.iter().zip(noises);
        channels.iter_mut().zip(parts).for_each(|(tally, (channel, noise))| tally.add(channel, Some(noise)));
        curves.add(residuals);
    }
    let missing: Vec<Kind> =
        channels.iter().filter(|channel| channel.is_missing()).map(|channel| channel.kind).collect();
    channels.retain(|channel| !channel.is_missing());
    let errors: Vec<ChannelError> = channels.iter().map(|channel| channel.error(arm)).collect();
    let mut notes = recording.notes.clone();
    notes.extend_from_slice(treatment.notes());
    notes.extend(notes::beyond_limits(arm, recording));
    notes.extend(motion.notes(treatment.filter().cutoff_hz()));
    notes.extend(notes::on_channels(recording, &errors));
    let comparison = Comparison {
        schema: SCHEMA,
        samples,
        rows: recording.len(),
        duration_s: recording.duration(),
        rate_hz: treatment.rate_hz(),
        lowpass_hz: treatment.filter().cutoff_hz(),
        compared_hz,
        channels: errors,
        setup: examine(arm, recording).findings,
        notes,
    };
    let mut curves = curves.finish();
    curves.channels.retain(|channel| !missing.contains(&channel.kind));
    Ok((comparison, curves))
}

/// Standard deviation of the noise of each channel of `residuals` after the low-pass of `treatment`.
fn noises(recording: &Recording, treatment: &Treatment, residuals: &Residuals) -> Vec<f64> {
    let points = treatment.whole_column(recording, &recording.t).len();
    let nothing_sharp = vec![vec![0.0; points]; recording.joints()];
    let noises = Noises::of(recording, treatment, &residuals.channels, &nothing_sharp);
    let gain = treatment.filter().noise_gain();
    noises.channels.iter().map(|noise| gain * noise.deviation).collect()
}
