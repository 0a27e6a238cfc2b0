//! Measured torques that go with the model's, times a constant far from one: another sign, another unit, the other side of the gear.

use crate::residual::{Channel, Kind};
use crate::tally::{ChannelTally, Tally};

/// Least correlation, either way, of a measured torque that is a constant times the model's.
const CORRELATED: f64 = 0.8;
/// Such a constant, or its inverse, beyond which no friction and no wrong mass explains it.
const FAR: f64 = 20.0;
/// Share of the torques that have to be so, all with the same sign.
const SHARE: f64 = 0.5;

/// How a measured torque goes with the model's.
struct Scale {
    name: String,
    /// Slope of the regression of measured on model.
    slope: f64,
    correlation: f64,
}

impl Scale {
    /// Of all parts of a channel; `None` where the measured torque or the model's does not vary.
    fn of(tally: &ChannelTally) -> Option<Self> {
        let variance = |tally: Tally| tally.moments.std.powi(2);
        let [measured, model, error] = [tally.measured, tally.model, tally.error].map(variance);
        let covariance = 0.5 * (measured + model - error);
        let (slope, correlation) = (covariance / model, covariance / (measured * model).sqrt());
        let scale = Self { name: tally.name.clone(), slope, correlation };
        (slope.is_finite() && correlation.is_finite()).then_some(scale)
    }

    /// Whether the torque is the model's times a constant far from one.
    fn is_odd(&self) -> bool {
        let size = self.slope.abs();
        self.correlation.abs() > CORRELATED && (self.slope < 0.0 || !(1.0 / FAR..=FAR).contains(&size))
    }
}

/// A note where most torques of `channels` are the model's times a constant far from one, with the same sign.
pub(crate) fn of_channels<'c>(channels: impl Iterator<Item = &'c Channel>) -> Option<String> {
    let tally = |channel: &Channel| {
        let mut tally = ChannelTally::like(channel);
        tally.add(channel);
        tally
    };
    of_tallies(&channels.map(tally).collect::<Vec<_>>())
}

/// The same for channels that came part by part.
pub(crate) fn of_tallies(channels: &[ChannelTally]) -> Option<String> {
    let torques = channels.iter().filter(|channel| matches!(channel.kind, Kind::Torque(_)));
    let scales: Vec<Option<Scale>> = torques.map(Scale::of).collect();
    let of_sign = |sign: f64| -> Vec<&Scale> {
        scales.iter().flatten().filter(|scale| scale.is_odd() && scale.slope * sign > 0.0).collect()
    };
    let odd = [of_sign(1.0), of_sign(-1.0)].into_iter().max_by_key(Vec::len)?;
    if odd.is_empty() || (odd.len() as f64) < SHARE * scales.len() as f64 {
        return None;
    }
    let mut slopes: Vec<f64> = odd.iter().map(|scale| scale.slope).collect();
    slopes.sort_by(f64::total_cmp);
    let slope = slopes[slopes.len() / 2];
    let names: Vec<&str> = odd.iter().map(|scale| scale.name.as_str()).collect();
    Some(format!(
        "the measured torque is the model's times about {} in {}: {}? it should be in N*m (N) at the joint, positive where it drives the joint forward",
        brief(slope),
        names.join(", "),
        hint(slope)
    ))
}

/// What makes a torque `slope` times as large.
fn hint(slope: f64) -> &'static str {
    match (slope < 0.0, slope.abs()) {
        (true, size) if size > FAR => "the opposite sign, and N*mm or mA",
        (true, size) if size < 1.0 / FAR => "the opposite sign, and the motor's side of the gear or A",
        (true, _) => "the opposite sign, or the other direction of the joints",
        (false, size) if size > FAR => "N*mm or mA",
        (false, _) => "the motor's side of the gear, or A",
    }
}

/// Two digits.
fn brief(value: f64) -> String {
    let digits = (1.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.digits$}")
}
