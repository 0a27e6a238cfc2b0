//! The common treatment of every column of a recording, and the resulting motion.

use std::ops::Range;

use freeplay_arm::Arm;
use freeplay_laws::Trajectory;
use freeplay_recording::Recording;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::error::ResidualError;
use crate::random::normals;
use crate::signals::cutoff::cutoff_for;
use crate::signals::filter::{LowPass, derivatives, mean_over_band};
use crate::signals::grid::{Grid, Stretch};
use crate::signals::missing::only;
use crate::statistics::{difference, median_of_normal, quantile};

/// The default cutoff as a share of the sampling rate: a period of it then has thirty samples, over which the noise of two derivatives averages out.
const CUTOFF_SHARE: f64 = 0.03;
/// Smallest default cutoff, Hz: the motion of an arm is below.
pub(crate) const LEAST_CUTOFF: f64 = 10.0;
/// Largest default cutoff, Hz: the structure of an arm resonates from about there on.
const GREATEST_CUTOFF: f64 = 40.0;
/// Ratio of the fine cutoff to the cutoff: at three times the cutoff the gain of the coarse low-pass is below 10⁻³, so that the fine low-pass
/// transmits all that passes the coarse one.
const FINE_CUTOFF_RATIO: f64 = 3.0;
/// Largest cutoff as a share of the sampling rate: at one half, the Nyquist frequency, a digital low-pass has no stop band left.
const MAX_CUTOFF_SHARE: f64 = 0.4;
/// Smallest number of points kept per period of the cutoff: twice the number of Shannon (1949), as the low-pass still transmits half of the signal at
/// the cutoff.
pub(crate) const POINTS_PER_PERIOD: f64 = 4.0;
/// Share of all periods that count as quiet. A motion with trapezoidal speeds has a jerk most of the time, and the least of all periods would depend on chance: in a
/// recording of 10 s a tenth is some thirty periods.
const QUIET: f64 = 0.1;
/// Largest share of a stretch that the treatment trims at either end: three quarters of a short stretch remain, even if the low-pass would require
/// more.
pub(crate) const GREATEST_TRIM: f64 = 0.125;

/// The settings of a user; `None` is the rule.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Settings {
    /// Cutoff of the low-pass, Hz. The rule: [`default_cutoff_hz`], or up to two octaves lower if the noise of the motion would cause torque that was
    /// not measured.
    pub lowpass_hz: Option<f64>,
    /// Time trimmed at both ends of every stretch, s. The rule: five periods of the cutoff, in which the filter's memory of the end decays to 10⁻⁵;
    /// at most an eighth of the stretch.
    pub trim_s: Option<f64>,
}

/// The cutoff for a recording of `rate_hz` samples a second, Hz: 3 % of the rate, but at least 10 Hz (an arm's motion is below), at most 40 Hz (its
/// structure resonates from about there on), and never above a quarter of the rate.
pub fn default_cutoff_hz(rate_hz: f64) -> f64 {
    (CUTOFF_SHARE * rate_hz).clamp(LEAST_CUTOFF, GREATEST_CUTOFF).min(rate_hz / 4.0)
}

/// The treatment: the uniform grid, the zero-phase low-pass, the trimmed ends, the decimation. Every column, measured or modelled, gets the same
/// treatment, so that both sides lose the same part of the signal.
#[derive(Debug, Clone)]
pub struct Treatment {
    pub(crate) grid: Grid,
    pub(crate) filter: LowPass,
    pub(crate) fine: LowPass,
    pub(crate) decimation: usize,
    pub(crate) notes: Vec<String>,
}

impl Treatment {
    /// The treatment of a `recording` of `arm`.
    ///
    /// # Errors
    /// [`ResidualError::Stamps`], [`ResidualError::Cutoff`], [`ResidualError::Trim`], and [`ResidualError::TooShort`] if no stretch
    /// lasts four periods of the cutoff.
    pub fn new(arm: &Arm, recording: &Recording, settings: &Settings) -> Result<Self, ResidualError> {
        Self::decided_by_windows(arm, recording, settings, usize::MAX)
    }

    /// The treatment of a `recording` of `arm`. Decisions about the whole recording use about `most` rows.
    ///
    /// # Errors
    /// See [`Treatment::new`].
    pub(crate) fn decided_by_windows(
        arm: &Arm,
        recording: &Recording,
        settings: &Settings,
        most: usize,
    ) -> Result<Self, ResidualError> {
        if let Some(trim_s) = settings.trim_s.filter(|trim| !(*trim >= 0.0 && trim.is_finite())) {
            return Err(ResidualError::Trim { trim_s });
        }
        let grid = Grid::decided_by_windows(recording, most)?;
        let mut treatment = Self::on(grid.clone(), recording, settings)?;
        if settings.lowpass_hz.is_some() {
            return Ok(treatment);
        }
        let usual_hz = treatment.filter.cutoff_hz();
        let lower_hz = cutoff_for(arm, recording, &treatment.sample(recording, most));
        // A recording too short for a lower cutoff keeps the default one.
        if lower_hz < usual_hz
            && let Ok(lower) =
                Self::on(grid, recording, &Settings { lowpass_hz: Some(lower_hz), ..*settings })
        {
            treatment = lower;
            treatment.notes.push(format!(
                "low-pass at {lower_hz:.1} Hz instead of {usual_hz:.1} Hz: above that frequency, the recorded positions contain more noise than motion (--lowpass sets another cutoff)"
            ));
        }
        Ok(treatment)
    }

    /// The treatment of `recording` on its `grid`, independent of the content of the columns.
    fn on(grid: Grid, recording: &Recording, settings: &Settings) -> Result<Self, ResidualError> {
        let rate_hz = grid.rate_hz();
        let cutoff_hz = settings.lowpass_hz.unwrap_or_else(|| default_cutoff_hz(rate_hz));
        let filter = LowPass::new(rate_hz, cutoff_hz)?;
        let fine = LowPass::new(
            rate_hz,
            (FINE_CUTOFF_RATIO * cutoff_hz).min(MAX_CUTOFF_SHARE * rate_hz).max(cutoff_hz),
        )?;
        let decimation = ((rate_hz / (POINTS_PER_PERIOD * cutoff_hz) + 1e-6) as usize).max(1);
        let mut treatment = Self { grid, filter, fine, decimation, notes: Vec::new() };
        treatment.drop_short_stretches(recording, settings.trim_s)?;
        treatment.leave_ends_out(settings.trim_s);
        Ok(treatment)
    }

    fn drop_short_stretches(
        &mut self,
        recording: &Recording,
        trim_s: Option<f64>,
    ) -> Result<(), ResidualError> {
        let step = self.grid.step;
        let needed_s = self.filter.settling_time().max(2.0 * trim_s.unwrap_or(0.0) + 2.0 * step);
        let lasts = |stretch: &Stretch| (stretch.len - 1) as f64 * step;
        let longest_s = self.grid.stretches.iter().map(lasts).fold(0.0, f64::max);
        let all = self.grid.stretches.len();
        self.grid.stretches.retain(|stretch| lasts(stretch) >= needed_s);
        let kept = self.grid.stretches.len();
        if kept == 0 {
            let (origin, cutoff_hz) = (recording.origin.clone(), self.filter.cutoff_hz());
            return Err(ResidualError::TooShort { origin, longest_s, needed_s, cutoff_hz });
        }
        if all > 1 {
            let dropped = all - kept;
            self.notes.push(format!(
                "the time stamps have {} gap(s); each stretch between them is filtered separately{}",
                all - 1,
                if dropped > 0 { format!(", {dropped} too short to be used") } else { String::new() }
            ));
        }
        if !self.grid.is_even() {
            let (off, rate_hz) = (self.grid.jitter, self.grid.rate_hz());
            let done = if self.grid.is_steadied {
                format!(
                    "the positions are smoother on an even grid, so that the samples count as even, at {rate_hz:.4} Hz"
                )
            } else {
                format!("columns are interpolated to {rate_hz:.4} Hz")
            };
            self.notes.push(format!("the time stamps are uneven (up to {off:.2} of a step off): {done}"));
        }
        Ok(())
    }

    /// Trims `trim_s` at both ends of every stretch, or the time by the rule.
    fn leave_ends_out(&mut self, trim_s: Option<f64>) {
        let (step, settling_s) = (self.grid.step, self.filter.settling_time());
        for stretch in &mut self.grid.stretches {
            let most_s = GREATEST_TRIM * (stretch.len - 1) as f64 * step;
            let trim = (trim_s.unwrap_or(settling_s.min(most_s)) / step + 1e-6) as usize;
            stretch.keep = trim..stretch.len - trim;
        }
    }

    /// The low-pass.
    pub fn filter(&self) -> &LowPass {
        &self.filter
    }

    /// Rate of the grid before decimation, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.grid.rate_hz()
    }

    /// Decimation factor: the treatment keeps one grid point in so many.
    pub fn decimation(&self) -> usize {
        self.decimation
    }

    /// Notes on the treatment, one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Grid points of `stretch` that the treatment keeps.
    pub(crate) fn kept(&self, stretch: &Stretch) -> impl Iterator<Item = usize> {
        stretch.keep.clone().step_by(self.decimation)
    }

    /// Times of the kept points, s.
    pub fn times(&self) -> Vec<f64> {
        let times =
            |s: &Stretch| self.kept(s).map(|k| s.start + k as f64 * self.grid.step).collect::<Vec<_>>();
        self.grid.stretches.iter().flat_map(times).collect()
    }

    /// The stretches without gaps, as ranges of kept points.
    pub fn stretches(&self) -> Vec<Range<usize>> {
        laid(self.grid.stretches.iter().map(|stretch| self.kept(stretch).count()))
    }

    /// `column` of `recording` on the kept points, not filtered.
    pub fn unfiltered(&self, recording: &Recording, column: &[f64]) -> Vec<f64> {
        let mut out = Vec::new();
        for stretch in &self.grid.stretches {
            let raw = self.grid.resample(stretch, recording, column);
            out.extend(self.kept(stretch).map(|k| raw[k]));
        }
        out
    }

    /// `column` of `recording`, treated.
    pub fn smooth(&self, recording: &Recording, column: &[f64]) -> Vec<f64> {
        let mut out = Vec::new();
        for stretch in &self.grid.stretches {
            let smooth = self.filter.apply(&self.grid.resample(stretch, recording, column));
            out.extend(self.kept(stretch).map(|k| smooth[k]));
        }
        out
    }

    /// `column` treated, with its first and second derivative with respect to time.
    pub fn smooth_with_derivatives(&self, recording: &Recording, column: &[f64]) -> [Vec<f64>; 3] {
        let mut out = [const { Vec::new() }; 3];
        for stretch in &self.grid.stretches {
            let smooth = self.filter.apply(&self.grid.resample(stretch, recording, column));
            let (first, second) = derivatives(&smooth, self.grid.step);
            for (out, whole) in out.iter_mut().zip([smooth, first, second]) {
                out.extend(self.kept(stretch).map(|k| whole[k]));
            }
        }
        out
    }

    /// The smoothed motion on every grid point of the recording, without trimming: laws with jumps are evaluated on it, before
    /// [`Treatment::low_pass`] and [`Treatment::keep`].
    pub fn whole_motion(&self, recording: &Recording) -> Trajectory {
        self.motion_through(&self.filter, recording)
    }

    /// The motion on every grid point, less smoothed: for nonlinear functions of the motion, which then pass [`Treatment::low_pass`]. The torque of a
    /// smoothed motion is not the smoothed torque.
    pub fn fine_motion(&self, recording: &Recording) -> Trajectory {
        self.motion_through(&self.fine, recording)
    }

    /// The less smoothed motion of positions with added `noise`, by joint and grid point.
    pub(crate) fn fine_motion_with(&self, recording: &Recording, noise: &[Vec<f64>]) -> Trajectory {
        self.motion_of(&self.fine, recording, Some(noise))
    }

    fn motion_through(&self, filter: &LowPass, recording: &Recording) -> Trajectory {
        self.motion_of(filter, recording, None)
    }

    /// The motion of the recorded positions, with `noise` by joint and grid point added if it is given.
    fn motion_of(&self, filter: &LowPass, recording: &Recording, noise: Option<&[Vec<f64>]>) -> Trajectory {
        let stretches = laid(self.grid.stretches.iter().map(|stretch| stretch.len));
        let mut whole = Trajectory { stretches, ..Trajectory::default() };
        for stretch in &self.grid.stretches {
            whole.t.extend((0..stretch.len).map(|k| stretch.start + k as f64 * self.grid.step));
        }
        for (number, column) in recording.q.iter().enumerate() {
            let mut joint = [const { Vec::new() }; 3];
            for (stretch, points) in self.grid.stretches.iter().zip(&whole.stretches) {
                let mut read = self.grid.resample(stretch, recording, column);
                if let Some(noise) = noise {
                    read.to_mut()
                        .iter_mut()
                        .zip(&noise[number][points.clone()])
                        .for_each(|(q, noise)| *q += noise);
                }
                let smooth = filter.apply(&read);
                let (first, second) = derivatives(&smooth, self.grid.step);
                joint.iter_mut().zip([smooth, first, second]).for_each(|(out, part)| out.extend(part));
            }
            let [q, v, a] = joint;
            whole.q.push(q);
            whole.v.push(v);
            whole.a.push(a);
        }
        whole
    }

    /// One column of `recording` on every grid point, not filtered.
    pub fn whole_column(&self, recording: &Recording, column: &[f64]) -> Vec<f64> {
        let stretches = self.grid.stretches.iter();
        stretches.flat_map(|s| self.grid.resample(s, recording, column).into_owned()).collect()
    }

    /// The low-pass on one column of the points of [`Treatment::whole_motion`], stretch by stretch.
    pub fn low_pass(&self, column: &[f64]) -> Vec<f64> {
        self.through(&self.filter, column)
    }

    /// `filter` on one column of the points of [`Treatment::whole_motion`], stretch by stretch.
    pub(crate) fn through(&self, filter: &LowPass, column: &[f64]) -> Vec<f64> {
        filter.apply_to_each(self.grid.stretches.iter().map(|stretch| stretch.len), column)
    }

    /// Standard deviation of the white noise with the same amplitude as `column`, on all grid points, in the octave above the cutoff.
    ///
    /// The function takes the median of the amplitude where the column is `present`, because occasional jumps are no noise (Hampel 1974).
    pub(crate) fn deviation_above(&self, column: &[f64], present: Option<&[bool]>) -> f64 {
        let Some((band, wider)) = self.octave_above(column) else { return 0.0 };
        let amplitudes: Vec<f64> = band.iter().map(|x| x.abs()).collect();
        let share = share_between(&self.filter, &wider, self.rate_hz());
        quantile(only(&amplitudes, present).into_owned(), 0.5) / median_of_normal() / share.sqrt()
    }

    /// As [`Self::deviation_above`], from the quiet periods alone, of the quieter one of two `columns`.
    ///
    /// Each jerk of a motion reaches into the octave above the cutoff, and some motions have one most of the time. The power in the quietest periods is
    /// compared with that of white noise on the same grid.
    pub(crate) fn quiet_deviation_above(&self, columns: [&[f64]; 2], present: Option<&[bool]>) -> f64 {
        let white = normals(&mut ChaCha8Rng::seed_from_u64(0), columns[0].len(), 1.0);
        let power = |column: &[f64]| self.quiet_power_above(column, present);
        let (of_white, [one, other]) = (power(&white), columns.map(power));
        if of_white > 0.0 { (one.min(other) / of_white).sqrt() } else { 0.0 }
    }

    /// Mean power of `column` over a period of the cutoff, in the octave above it, where that is the least.
    fn quiet_power_above(&self, column: &[f64], present: Option<&[bool]>) -> f64 {
        let Some((band, _)) = self.octave_above(column) else { return 0.0 };
        let half = (0.5 * self.rate_hz() / self.filter.cutoff_hz()) as usize;
        let mut power = Vec::with_capacity(band.len());
        for stretch in laid(self.grid.stretches.iter().map(|stretch| stretch.len)) {
            let band = &band[stretch];
            power.extend((0..band.len()).map(|k| {
                let period = &band[k.saturating_sub(half)..(k + half + 1).min(band.len())];
                period.iter().map(|x| x * x).sum::<f64>() / period.len() as f64
            }));
        }
        quantile(only(&power, present).into_owned(), QUIET)
    }

    /// The part of `column`, on all grid points, in the octave above the cutoff, and the low-pass at its upper end; `None` if the sampling rate is too low.
    fn octave_above(&self, column: &[f64]) -> Option<(Vec<f64>, LowPass)> {
        let (rate_hz, cutoff_hz) = (self.rate_hz(), self.filter.cutoff_hz());
        let wider = LowPass::new(rate_hz, (2.0 * cutoff_hz).min(MAX_CUTOFF_SHARE * rate_hz)).ok()?;
        let band = difference(&self.through(&wider, column), &self.low_pass(column));
        Some((band, wider))
    }

    /// The kept points of one column of the points of [`Treatment::whole_motion`].
    pub fn keep(&self, column: &[f64]) -> Vec<f64> {
        let mut begin = 0;
        let mut out = Vec::new();
        for stretch in &self.grid.stretches {
            out.extend(self.kept(stretch).map(|k| column[begin + k]));
            begin += stretch.len;
        }
        out
    }

    /// The motion of `recording` on the kept points.
    ///
    /// Velocity and acceleration are derivatives of the position, even if the recording has velocities: a recorded velocity has passed a filter of
    /// the drive, whose delay would appear as viscous friction or inertia that the arm does not have.
    pub fn motion(&self, recording: &Recording) -> Trajectory {
        let mut motion = Trajectory { t: self.times(), stretches: self.stretches(), ..Trajectory::default() };
        for column in &recording.q {
            let [q, v, a] = self.smooth_with_derivatives(recording, column);
            motion.q.push(q);
            motion.v.push(v);
            motion.a.push(a);
        }
        motion
    }
}

/// The ranges of stretches of these `lengths`, one after the other.
pub(crate) fn laid(lengths: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let mut begin = 0;
    let range = |length| {
        let end = begin + length;
        std::mem::replace(&mut begin, end)..end
    };
    lengths.map(range).collect()
}

/// Share of the power of white noise that `wide` transmits and `narrow` does not, by the closed form of their gains.
fn share_between(narrow: &LowPass, wide: &LowPass, rate_hz: f64) -> f64 {
    mean_over_band(rate_hz, |f| (wide.gain(f) - narrow.gain(f)).powi(2))
}

#[cfg(test)]
mod tests {
    use freeplay_arm::{JointFriction, JointKind};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{Settings, Treatment};
    use crate::made::{arm, columns, even, link, nothing, recording};
    use crate::random::normals;

    /// White noise, alone and below a torque that steps by 1 N·m each 50 ms during four fifths of the time. The quiet periods show its deviation in both, at most twice
    /// as large: the quietest tenth of all periods is then half of the quiet ones.
    #[test]
    fn jerks_do_not_count_as_noise() {
        let (t, deviation) = (even(60.0, 1000.0), 0.05);
        let arm = arm(vec![link("elbow", JointKind::Revolute, JointFriction::default())]);
        let recording = recording(columns(&arm, &t, nothing));
        let treatment = Treatment::new(&arm, &recording, &Settings::default()).expect("a treatment");
        let white = normals(&mut ChaCha8Rng::seed_from_u64(3), t.len(), deviation);
        let steps = |t: f64| if t < 48.0 { (20.0 * t).floor() % 2.0 } else { 0.0 };
        let jerky: Vec<f64> = t.iter().zip(&white).map(|(t, noise)| steps(*t) + noise).collect();
        for column in [&white, &jerky] {
            let quiet = treatment.quiet_deviation_above([column, column], None) / deviation;
            let middle = treatment.deviation_above(column, None) / deviation;
            println!("of the deviation: {quiet:.3} in quiet periods, {middle:.3} by the median");
            assert!((0.9..2.0).contains(&quiet));
        }
        assert!(
            treatment.deviation_above(&jerky, None) > 10.0 * deviation,
            "the steps fill most of the time"
        );
    }
}
