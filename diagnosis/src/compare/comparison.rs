//! How far a model is from a recording, in numbers.

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

/// How far a model is from a recording: `freeplay compare --format json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Points that were compared: the recording on a uniform grid, filtered, without its ends, decimated.
    pub samples: usize,
    /// Samples of the recording.
    pub rows: usize,
    /// From its first sample to its last, s.
    pub duration_s: f64,
    /// Samples of the recording per second, Hz.
    pub rate_hz: f64,
    /// Cutoff of the zero-phase low-pass, Hz; infinite (`null`) where positions are compared with commanded ones, which no filter touches.
    pub lowpass_hz: f64,
    /// Points per second after decimation, Hz.
    pub compared_hz: f64,
    /// One entry a channel: torques, tool, link encoders; or positions.
    pub channels: Vec<ChannelError>,
    /// Whether recording and model mean the same: the faults of the set-up.
    pub setup: Vec<SetupFinding>,
    /// What a reader of the numbers should know, one sentence each.
    pub notes: Vec<String>,
}

impl Comparison {
    /// The torque channel whose error is the most times its noise; where no torque has more error than its noise leaves, the channel of which that is true.
    /// Channels that hardly measure anything beside the others of their unit are passed over. Where no noise is known, the one that is explained worst, by
    /// `nrmse_std`.
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

    /// True if the noise of `channel` can explain the `deviation`. An estimate of the noise scatters about the true deviation; this one has to be below the 95 % quantile.
    /// Behind a low-pass two samples in each period of the cutoff are independent.
    pub fn is_within_noise(&self, channel: &ChannelError, deviation: f64) -> bool {
        let worth = 2.0 * self.lowpass_hz * self.samples as f64 / self.compared_hz;
        channel.noise.is_some_and(|noise| {
            deviation.powi(2)
                <= noise.powi(2) * (1.0 + normal_quantile(1.0 - SIGNIFICANT) * (2.0 / worth.max(1.0)).sqrt())
        })
    }

    /// The channels that vary, but by no more than their noise.
    pub fn of_noise(&self) -> impl Iterator<Item = &ChannelError> {
        let varying = self.channels.iter().filter(|channel| channel.nrmse_std.is_some());
        varying.filter(|channel| self.is_within_noise(channel, channel.std_measured))
    }

    /// Root of the mean square distance between the tracked tool and where the model puts it, m; `None` without a tracker.
    pub fn tool_distance(&self) -> Option<f64> {
        let tool = self.channels.iter().filter(|channel| matches!(channel.kind, Kind::Tool(_)));
        let squares: Vec<f64> = tool.map(|channel| channel.rmse.powi(2)).collect();
        (squares.len() == 3).then(|| squares.iter().sum::<f64>().sqrt())
    }
}

/// Compares `recording` with `arm` and its `effects`: the numbers, and the residuals they are made of. A recording of millions of rows is
/// worked on part by part, which the numbers don't show; of its residuals those points are left that a chart of all of it shows.
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
    let treatment = Treatment::judged_by(arm, recording, settings, most)?;
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

/// The deviation of the noise of each channel of `residuals` behind the low-pass of `treatment`.
fn noises(recording: &Recording, treatment: &Treatment, residuals: &Residuals) -> Vec<f64> {
    let points = treatment.whole_column(recording, &recording.t).len();
    let nothing_sharp = vec![vec![0.0; points]; recording.joints()];
    let noises = Noises::of(recording, treatment, &residuals.channels, &nothing_sharp);
    let gain = treatment.filter().noise_gain();
    noises.channels.iter().map(|noise| gain * noise.deviation).collect()
}
