//! How far a model is from a recording, in numbers.

use freeplay_arm::Arm;
use freeplay_laws::Placed;
use freeplay_recording::Recording;
use serde::Serialize;

use crate::conventions::{SetupFinding, examine};
use crate::curves::Curves;
use crate::diagnose::Noises;
use crate::error::ResidualError;
use crate::long::most_rows;
use crate::motion::{Settings, Treatment};
use crate::notes::{self, MotionTally};
use crate::residual::{Kind, Residuals, check_joints, residuals};
use crate::statistics::{FINEST, SIGNIFICANT, normal_quantile};
use crate::tally::ChannelTally;

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

/// How far the model is from one channel. Numbers without a unit of their own are in the channel's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelError {
    /// Name of the column.
    pub name: String,
    /// What it measures.
    #[serde(skip)]
    pub kind: Kind,
    /// `N*m`, `N`, `m` or `rad`.
    pub unit: &'static str,
    /// Name of the joint in the model; `None` for the tool.
    pub joint: Option<String>,
    /// Root of the mean square of measured minus model.
    pub rmse: f64,
    /// Root of the mean square of the measured signal.
    pub rms_measured: f64,
    /// `rmse / rms_measured`, a fraction: 1 is as bad as a model that says zero. `None` if nothing but zero was measured.
    pub nrmse: Option<f64>,
    /// Standard deviation of the measured signal.
    pub std_measured: f64,
    /// `rmse / std_measured`, a fraction: 1 is as bad as a model that says the mean. `None` if the measured signal is constant.
    pub nrmse_std: Option<f64>,
    /// `rmse` of the model without its nominal friction; `None` if it names none for this joint.
    pub rmse_without_friction: Option<f64>,
    /// Mean of measured minus model.
    pub mean_error: f64,
    /// Standard deviation of measured minus model: `rmse` without the constant part.
    pub std_error: f64,
    /// Largest amount of measured minus model.
    pub max_error: f64,
    /// Standard deviation of the channel's own noise behind the low-pass, by what its samples have above it; `None` of positions compared with commanded ones, which no filter touches.
    pub noise: Option<f64>,
    /// Time by which the measured position follows the commanded one, s; of command channels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag_s: Option<f64>,
}

impl ChannelError {
    /// How many times its noise the error is.
    pub fn times_noise(&self) -> Option<f64> {
        self.noise.filter(|noise| *noise > 0.0).map(|noise| self.rmse / noise)
    }
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
    let compared_hz = treatment.rate_hz() / treatment.every() as f64;
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
