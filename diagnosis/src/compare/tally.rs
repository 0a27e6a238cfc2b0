//! Sums over the parts of a recording, equal to those of the whole.

use freeplay_arm::Arm;

use crate::compare::channel_error::ChannelError;
use crate::signals::channel::{Channel, Kind};
use crate::signals::missing::only;
use crate::statistics::{FINEST, Moments};

/// The [`Moments`] of a signal that comes part by part.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tally {
    count: usize,
    /// The moments of all parts so far.
    pub moments: Moments,
}

impl Default for Tally {
    fn default() -> Self {
        Self::of(&[])
    }
}

impl Tally {
    /// The tally of one part.
    pub fn of(values: &[f64]) -> Self {
        Self { count: values.len(), moments: Moments::of(values) }
    }

    /// Adds one part; the first part sets the moments to exactly its own.
    ///
    /// Source: Chan, Golub & LeVeque 1979, "Updating formulae and a pairwise algorithm for computing sample variances", eq. 2.1.
    pub fn add(&mut self, values: &[f64]) {
        if self.count == 0 {
            *self = Self::of(values);
            return;
        }
        if values.is_empty() {
            return;
        }
        let (before, part) = (self.moments, Moments::of(values));
        self.count += values.len();
        let share = values.len() as f64 / self.count as f64;
        let mixed = |before: f64, part: f64| (1.0 - share) * before + share * part;
        let apart = part.mean - before.mean;
        let variance = mixed(before.std.powi(2), part.std.powi(2)) + share * (1.0 - share) * apart.powi(2);
        self.moments = Moments {
            mean: before.mean + share * apart,
            std: variance.sqrt(),
            rms: mixed(before.rms.powi(2), part.rms.powi(2)).sqrt(),
        };
    }
}

/// The sums behind the error of one channel.
#[derive(Debug, Clone)]
pub(crate) struct ChannelTally {
    /// Name of the column.
    pub name: String,
    /// The measured quantity.
    pub kind: Kind,
    unit: &'static str,
    /// Measured.
    pub measured: Tally,
    /// Values of the model.
    pub model: Tally,
    /// Measured minus model.
    pub error: Tally,
    without_friction: Option<Tally>,
    max_error: f64,
    /// Sum of the squared noise over all values; `None` if the noise of a part is unknown.
    noise: Option<f64>,
}

impl ChannelTally {
    /// An empty tally for a channel like `channel`.
    pub fn like(channel: &Channel) -> Self {
        Self {
            name: channel.name.clone(),
            kind: channel.kind,
            unit: channel.unit,
            measured: Tally::default(),
            model: Tally::default(),
            error: Tally::default(),
            without_friction: channel.friction.as_ref().map(|_| Tally::default()),
            max_error: 0.0,
            noise: Some(0.0),
        }
    }

    /// Adds one part of the channel, in which it has noise of the deviation `noise`, if that is known.
    pub fn add(&mut self, part: &Channel, noise: Option<f64>) {
        let before = self.error.count;
        let present = part.present.as_deref();
        let residual = part.residual();
        self.measured.add(&only(&part.measured, present));
        self.model.add(&only(&part.model, present));
        self.error.add(&only(&residual, present));
        if let (Some(tally), Some(residual)) =
            (self.without_friction.as_mut(), part.residual_without_friction())
        {
            tally.add(&only(&residual, present));
        }
        let count = (self.error.count - before) as f64;
        self.noise = self.noise.zip(noise).map(|(sum, noise)| sum + count * noise * noise);
        self.max_error = residual.iter().fold(self.max_error, |most, error| most.max(error.abs()));
    }

    /// Returns true if no point of the channel has a measurement.
    pub fn is_missing(&self) -> bool {
        self.error.count == 0
    }

    /// The error of `arm` in the channel.
    pub fn error(&self, arm: &Arm) -> ChannelError {
        let (error, measured) = (self.error.moments, self.measured.moments);
        let ratio = |scale: f64, least: f64| (scale > least).then(|| error.rms / scale);
        ChannelError {
            name: self.name.clone(),
            kind: self.kind,
            unit: self.unit,
            joint: match self.kind {
                Kind::Torque(joint) | Kind::Link(joint) | Kind::Position(joint) => {
                    Some(arm.joints()[joint].name.clone())
                }
                Kind::Tool(_) => None,
            },
            rmse: error.rms,
            rms_measured: measured.rms,
            nrmse: ratio(measured.rms, 0.0),
            std_measured: measured.std,
            nrmse_std: ratio(measured.std, FINEST * measured.rms),
            rmse_without_friction: self.without_friction.map(|tally| tally.moments.rms),
            mean_error: error.mean,
            std_error: error.std,
            max_error: self.max_error,
            noise: self.noise.map(|sum| (sum / self.error.count.max(1) as f64).sqrt()),
            lag_s: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Tally;
    use crate::statistics::Moments;

    /// The same by sums over all values at once, without parts.
    #[test]
    fn parts_make_up_the_whole() {
        let values: Vec<f64> =
            (0..1000).map(|k| 5.0 + 0.01 * f64::from(k) + (f64::from(k) * 0.7).sin()).collect();
        let whole = Moments::of(&values);
        for size in [1, 7, 333, 999, 1000] {
            let mut tally = Tally::default();
            tally.add(&[]);
            values.chunks(size).for_each(|part| tally.add(part));
            let parts = tally.moments;
            let off = [parts.mean - whole.mean, parts.std - whole.std, parts.rms - whole.rms];
            println!("parts of {size}: off by {off:?}");
            assert!(off.iter().all(|off| off.abs() < 1e-12 * whole.rms));
            assert!(size < 1000 || parts == whole, "one part is the whole to the last digit");
        }
    }
}
