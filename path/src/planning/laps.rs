//! From the time of the motion to the time within a lap.

/// Times closer than this to a kink or to the seam of two laps count as on it, s. It covers the rounding of `tick × period` and is far
/// below any tick.
pub(crate) const SNAP: f64 = 1e-9;

/// A lap of `lap` seconds, `count` times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Laps {
    pub lap: f64,
    pub count: u32,
}

/// Position of a time in the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Phase {
    /// Before t = 0 (or NaN): the motion rests at its first point.
    Before,
    /// Within a lap, at this time since its beginning, s; the seam belongs to the lap that begins.
    Running(f64),
    /// After the last lap: the motion rests at its last point.
    After,
}

impl Laps {
    /// Time of the whole motion, s.
    pub fn duration(&self) -> f64 {
        f64::from(self.count) * self.lap
    }

    /// Finds `t` among the laps; 0 and the duration themselves belong to the motion.
    pub fn phase(&self, t: f64) -> Phase {
        if t.is_nan() || t < 0.0 {
            return Phase::Before;
        }
        if t > self.duration() {
            return Phase::After;
        }
        let last = f64::from(self.count - 1);
        let lap = ((t + SNAP) / self.lap).floor().min(last);
        Phase::Running((t - lap * self.lap).clamp(0.0, self.lap))
    }
}

#[cfg(test)]
mod tests {
    use super::{Laps, Phase};

    #[test]
    fn seams_belong_to_the_lap_that_begins_and_the_end_to_the_last() {
        let laps = Laps { lap: 0.1, count: 3 };
        let rounded_below = 3.0 * 0.1 - 0.1 - 1e-16;
        assert!(rounded_below < 0.2);
        assert_eq!(laps.phase(rounded_below), Phase::Running(0.0));
        assert_eq!(laps.phase(laps.duration()), Phase::Running(0.1));
        assert_eq!(laps.phase(-1e-300), Phase::Before);
        assert_eq!(laps.phase(f64::NAN), Phase::Before);
        assert_eq!(laps.phase(f64::INFINITY), Phase::After);
        assert_eq!(laps.phase(0.35), Phase::After);
    }
}
