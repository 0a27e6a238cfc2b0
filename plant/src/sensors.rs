//! The machine's measurements: quantised, noisy, delayed.
//!
//! Each channel reads y(k) = Q(x(k − d) + σ ν), with the delay d in ticks, the standard deviation σ of a seeded Gaussian noise ν, and
//! rounding Q to multiples of the resolution. With all three zero, a channel reads the true value.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Resolution, noise and delay of one kind of sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Channel {
    /// Resolution, in the channel's unit. 0 means no quantisation.
    pub resolution: f64,
    /// Standard deviation of the noise, in the channel's unit.
    pub noise: f64,
    /// Delay of the measurement, ticks.
    pub delay: u32,
}

impl Channel {
    /// The longest permitted delay, ticks.
    pub const LONGEST_DELAY: u32 = 1000;

    /// Describes the invalid field of this channel, if there is one.
    pub fn fault(&self) -> Option<String> {
        if !(self.resolution.is_finite() && self.resolution >= 0.0) {
            return Some(format!("resolution = {} must be 0 or more", self.resolution));
        }
        if !(self.noise.is_finite() && self.noise >= 0.0) {
            return Some(format!("noise = {} must be 0 or more", self.noise));
        }
        (self.delay > Self::LONGEST_DELAY)
            .then(|| format!("delay = {} ticks; at most {} are kept", self.delay, Self::LONGEST_DELAY))
    }
}

/// The sensors of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorsSpec {
    /// Joint positions, rad (m).
    pub position: Channel,
    /// Joint velocities, rad/s (m/s).
    pub velocity: Channel,
    /// Joint torques, N·m (N).
    pub torque: Channel,
    /// Tool position, m. Resolution, noise and delay do not apply to the tool orientation.
    pub tool: Channel,
    /// True if a tracker measures the tool.
    pub track_tool: bool,
}

impl Default for SensorsSpec {
    fn default() -> Self {
        let ideal = Channel::default();
        Self { position: ideal, velocity: ideal, torque: ideal, tool: ideal, track_tool: true }
    }
}

impl SensorsSpec {
    /// Describes the invalid channel and its field, if there is one.
    pub fn fault(&self) -> Option<String> {
        [
            ("position", &self.position),
            ("velocity", &self.velocity),
            ("torque", &self.torque),
            ("tool", &self.tool),
        ]
        .into_iter()
        .find_map(|(name, channel)| Some(format!("sensors.{name}: {}", channel.fault()?)))
    }
}

/// A group of readings of one kind with their history.
#[derive(Clone, Debug)]
struct Probe {
    channel: Channel,
    width: usize,
    past: Vec<f64>,
    newest: usize,
    started: bool,
}

impl Probe {
    fn new(channel: Channel, width: usize) -> Self {
        let past = vec![0.0; width * (channel.delay as usize + 1)];
        Self { channel, width, past, newest: 0, started: false }
    }

    /// Reads `values` in place. Before the first delay has passed, the readings are the first values.
    fn read(&mut self, values: &mut [f64], noise: &mut ChaCha8Rng) {
        let slots = self.channel.delay as usize + 1;
        if !self.started {
            self.past.chunks_exact_mut(self.width).for_each(|slot| slot.copy_from_slice(values));
            self.started = true;
        }
        self.newest = (self.newest + 1) % slots;
        self.past[self.newest * self.width..][..self.width].copy_from_slice(values);
        let oldest = (self.newest + 1) % slots;
        values.copy_from_slice(&self.past[oldest * self.width..][..self.width]);
        let Channel { resolution, noise: deviation, .. } = self.channel;
        for value in values {
            if deviation > 0.0 {
                let normal: f64 = StandardNormal.sample(noise);
                *value += deviation * normal;
            }
            if resolution > 0.0 {
                *value = (*value / resolution).round() * resolution;
            }
        }
    }
}

/// The sensors with their state.
#[derive(Clone, Debug)]
pub struct Sensors {
    noise: ChaCha8Rng,
    position: Probe,
    velocity: Probe,
    torque: Probe,
    tool: Probe,
}

impl Sensors {
    /// Sensors for `joints` joints whose noise comes from `seed`.
    pub fn new(spec: &SensorsSpec, joints: usize, seed: u64) -> Self {
        Self {
            noise: ChaCha8Rng::seed_from_u64(seed),
            position: Probe::new(spec.position, joints),
            velocity: Probe::new(spec.velocity, joints),
            torque: Probe::new(spec.torque, joints),
            tool: Probe::new(spec.tool, 3),
        }
    }

    /// Reads one tick in place: true positions, velocities and torques of the joints, position of the tool.
    pub fn read(&mut self, q: &mut [f64], v: &mut [f64], torque: &mut [f64], tool: &mut [f64]) {
        self.position.read(q, &mut self.noise);
        self.velocity.read(v, &mut self.noise);
        self.torque.read(torque, &mut self.noise);
        self.tool.read(tool, &mut self.noise);
    }
}

#[cfg(test)]
mod tests {
    use super::{Channel, Sensors, SensorsSpec};

    fn read(sensors: &mut Sensors, x: f64) -> f64 {
        let mut q = [x];
        sensors.read(&mut q, &mut [0.0], &mut [0.0], &mut [0.0; 3]);
        q[0]
    }

    fn with(channel: Channel) -> SensorsSpec {
        SensorsSpec { position: channel, ..SensorsSpec::default() }
    }

    #[test]
    fn an_ideal_sensor_reads_the_truth() {
        let mut sensors = Sensors::new(&SensorsSpec::default(), 1, 1);
        assert_eq!(read(&mut sensors, 0.123_456), 0.123_456);
    }

    #[test]
    fn a_delay_reads_the_past() {
        let mut sensors = Sensors::new(&with(Channel { delay: 2, ..Channel::default() }), 1, 1);
        let readings: Vec<f64> = (0..5).map(|k| read(&mut sensors, f64::from(k))).collect();
        assert_eq!(readings, [0.0, 0.0, 0.0, 1.0, 2.0]);
    }

    #[test]
    fn quantisation_rounds_to_the_step() {
        let mut sensors = Sensors::new(&with(Channel { resolution: 0.25, ..Channel::default() }), 1, 1);
        assert_eq!(read(&mut sensors, 0.3), 0.25);
        assert_eq!(read(&mut sensors, -0.4), -0.5);
    }

    #[test]
    fn noise_has_its_deviation_and_repeats_with_its_seed() {
        let spec = with(Channel { noise: 2e-3, ..Channel::default() });
        let sample = |seed| {
            let mut sensors = Sensors::new(&spec, 1, seed);
            (0..20_000).map(|_| read(&mut sensors, 1.0) - 1.0).collect::<Vec<_>>()
        };
        let (first, again, other) = (sample(5), sample(5), sample(6));
        assert_eq!(first, again);
        assert_ne!(first, other);
        let deviation = (first.iter().map(|x| x * x).sum::<f64>() / first.len() as f64).sqrt();
        println!("deviation {deviation:.3e}, expected 2e-3 within 2 %");
        assert!((deviation / 2e-3 - 1.0).abs() < 0.02);
    }
}
