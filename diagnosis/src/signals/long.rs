//! Long recordings: windows decide on the treatment, and the program processes a recording part by part, so that the memory does not grow with it.
//!
//! Windows spread over the recording determine where gaps begin, whether the stamps are corrected, and the cutoff. These decisions hold for every
//! part. Each part extends into its neighbours by more than the memory of the filters, and exactly one part keeps each grid point.

use std::borrow::Cow;
use std::ops::Range;

use freeplay_recording::Recording;

use crate::error::ResidualError;
use crate::signals::grid::{Grid, Stretch, no_grid};
use crate::signals::motion::Treatment;
use crate::signals::stamps::corrected_stamps;

/// Largest number of rows times joints of a recording without parts, and of each part of a longer one: such a column for every joint takes 16 MB, and
/// some tens exist at once.
const MOST_NUMBERS: usize = 2_000_000;
/// Number of windows that represent a long recording, spread evenly: fewer can all fall on one kind of motion, more are each too short relative to
/// the memory of the filters.
pub(crate) const WINDOWS: usize = 8;
/// Time before a part in which laws with a memory settle, s, at most an eighth of the part: most joints reverse within it, and a reversal resets
/// backlash and hysteresis.
const MEMORY_S: f64 = 10.0;
/// Rows beyond an end that the interpolation uses: the slopes of the cubic through two rows need one more row, and jitter may shift it by one.
const BEYOND: usize = 3;

/// Largest number of rows of a recording of `joints` joints without parts.
pub(crate) fn most_rows(joints: usize) -> usize {
    MOST_NUMBERS / joints.max(1)
}

/// Grid points of the stretch number `stretch` that one part keeps.
struct Cut {
    stretch: usize,
    keep: Range<usize>,
}

impl Grid {
    /// The grid of a recording. If it is longer than `most` rows, windows with so many rows determine where gaps begin and whether the stamps are
    /// corrected.
    ///
    /// # Errors
    /// See [`Grid::new`].
    pub(crate) fn decided_by_windows(recording: &Recording, most: usize) -> Result<Self, ResidualError> {
        if recording.len() <= most {
            return Self::new(recording);
        }
        let judged = Self::new(&windows_of(recording, most)).map_err(|_| no_grid(recording))?;
        // A sum of all steps would have an error of a thirtieth of a step after 50 million.
        let runs = recording.t.chunk_by(|before, after| after - before <= judged.longest);
        let (steps, lasts) = runs.fold((0, 0.0), |(steps, lasts), run| {
            (steps + run.len() - 1, lasts + (run[run.len() - 1] - run[0]))
        });
        // Lines through stamps with jitter give the step more accurately than the first and the last stamp.
        let step = if judged.is_steadied { judged.step } else { lasts / steps as f64 };
        let grid = Self::laid(&recording.t, step, judged.longest);
        let grid = grid.ok_or_else(|| no_grid(recording))?;
        Ok(Self { is_steadied: judged.is_steadied && !grid.is_even(), ..grid })
    }

    /// Cuts of the kept points with at most about `most` grid points each; across the cuts of a stretch, the treatment keeps every `every`-th point.
    fn cuts(&self, most: usize, every: usize) -> impl Iterator<Item = Cut> {
        self.stretches.iter().enumerate().flat_map(move |(stretch, whole)| {
            let Range { start, end } = whole.keep;
            let pieces = (end - start).div_ceil(most).max(1);
            let size = (end - start).div_ceil(pieces).max(1).next_multiple_of(every);
            let keep = move |begin: usize| begin..end.min(begin + size);
            (start..end).step_by(size).map(move |begin| Cut { stretch, keep: keep(begin) })
        })
    }

    /// The cuts in groups: short stretches together.
    fn groups(&self, most: usize, every: usize) -> Vec<Vec<Cut>> {
        let (mut groups, mut room) = (Vec::<Vec<Cut>>::new(), 0);
        for cut in self.cuts(most, every) {
            if cut.keep.len() > room {
                groups.push(Vec::new());
                room = most;
            }
            room = room.saturating_sub(cut.keep.len());
            if let Some(group) = groups.last_mut() {
                group.push(cut);
            }
        }
        groups
    }

    /// The grid of the `cuts` alone, each with up to `lead` additional grid points on either side.
    fn part(&self, recording: &Recording, cuts: &[Cut], lead: usize) -> Self {
        let piece = |cut: &Cut| self.piece(recording, &self.stretches[cut.stretch], &cut.keep, lead);
        Self { stretches: cuts.iter().map(piece).collect(), ..*self }
    }

    fn piece(&self, recording: &Recording, whole: &Stretch, keep: &Range<usize>, lead: usize) -> Stretch {
        let span = keep.start.saturating_sub(lead)..whole.len.min(keep.end + lead);
        let time = |point: usize| whole.start + point as f64 * self.step;
        let rows = if whole.even {
            whole.rows.start + span.start..whole.rows.start + span.end
        } else {
            let t = &recording.t[whole.rows.clone()];
            let first = t.partition_point(|t| *t <= time(span.start)).saturating_sub(BEYOND);
            let end = t.partition_point(|t| *t < time(span.end - 1)) + BEYOND;
            whole.rows.start + first..whole.rows.end.min(whole.rows.start + end)
        };
        let shake = self.is_steadied && !whole.even;
        let times =
            shake.then(|| corrected_stamps(&recording.t[rows.clone()], std::iter::once(0..rows.len())));
        let times = times.flatten();
        // A grid through corrected samples, at most half a step aside, needs interpolation only at a lost sample.
        let aside = times.as_ref().map_or(0.0, |t| (t[0] - time(span.start)) / self.step);
        Stretch {
            start: time(span.start) + (aside - aside.round()) * self.step,
            len: span.len(),
            even: whole.even,
            times,
            keep: keep.start - span.start..keep.end - span.start,
            rows,
        }
    }
}

impl Treatment {
    /// The treatments of the parts of `recording`, with about `most` grid points each, if it is longer than `most` rows.
    pub(crate) fn parts<'a>(
        &'a self,
        recording: &'a Recording,
        most: usize,
    ) -> impl Iterator<Item = Cow<'a, Self>> {
        let is_long = recording.len() > most;
        let groups = if is_long { self.grid.groups(most, self.decimation) } else { Vec::new() };
        let parts = groups.into_iter().map(move |cuts| Cow::Owned(self.part(recording, &cuts, most)));
        (!is_long).then_some(Cow::Borrowed(self)).into_iter().chain(parts)
    }

    /// The treatment of windows of `recording` with about `most` grid points together, if it is longer than so many rows.
    pub(crate) fn sample<'a>(&'a self, recording: &Recording, most: usize) -> Cow<'a, Self> {
        if recording.len() <= most {
            return Cow::Borrowed(self);
        }
        let mut groups = self.grid.groups((most / WINDOWS).max(1), self.decimation);
        let last = groups.len() - 1;
        let spread = (0..WINDOWS).map(|window| window * last / (WINDOWS - 1));
        let cuts: Vec<Cut> = spread.flat_map(|group| std::mem::take(&mut groups[group])).collect();
        Cow::Owned(self.part(recording, &cuts, most))
    }

    fn part(&self, recording: &Recording, cuts: &[Cut], most: usize) -> Self {
        let rate_hz = self.rate_hz();
        let memory = ((MEMORY_S * rate_hz) as usize).min(most / WINDOWS);
        // The filter runs forwards and backwards, and settles in each direction.
        let lead = memory.max((2.0 * self.filter.settling_time() * rate_hz).ceil() as usize);
        let (filter, fine) = (self.filter.clone(), self.fine.clone());
        let grid = self.grid.part(recording, cuts, lead);
        Self { grid, filter, fine, decimation: self.decimation, notes: Vec::new() }
    }
}

/// Times and positions of windows spread evenly over `recording`, `most` rows together.
fn windows_of(recording: &Recording, most: usize) -> Recording {
    let (all, long) = (recording.len(), most / WINDOWS);
    let begins = (0..WINDOWS).map(|window| window * (all - long) / (WINDOWS - 1));
    let column = |whole: &Vec<f64>| -> Vec<f64> {
        begins.clone().flat_map(|begin| whole[begin..begin + long].iter().copied()).collect()
    };
    Recording {
        origin: recording.origin.clone(),
        t: column(&recording.t),
        q: recording.q.iter().map(column).collect(),
        ..Recording::default()
    }
}

#[cfg(test)]
mod tests {
    use freeplay_arm::{Arm, JointFriction, JointKind};
    use freeplay_laws::Placed;
    use freeplay_model::EffectTable;
    use freeplay_recording::Recording;

    use proptest::prelude::{ProptestConfig, any, prop, prop_assert, proptest};

    use crate::compare::channel_error::ChannelError;
    use crate::compare::comparison::in_parts;
    use crate::made::{arm, columns, even, jittered, link, recording};
    use crate::signals::motion::Settings;

    const RATE_HZ: f64 = 500.0;
    /// Rows of a part: the recordings here have 8 to 15 of them.
    const ROWS: usize = 4000;

    fn two_joints() -> Arm {
        let friction = JointFriction { viscous: 2.0, coulomb: 1.5 };
        arm(["shoulder", "elbow"].map(|name| link(name, JointKind::Revolute, friction)).into())
    }

    /// Noise between -1 and 1, as good as white.
    fn noise(k: usize) -> f64 {
        2.0 * ((k as f64 * 12.9898).sin() * 43_758.545_3).fract().abs() - 1.0
    }

    /// A simulated recording of the test motion at the times `t`, with a friction that differs from the model's, noise, velocities, and stamps `late`
    /// by parts of a step.
    fn made(t: &[f64], late: fn(usize) -> f64) -> Recording {
        let mut made = columns(&two_joints(), t, |joint, v| 3.0 * v + 1.0 * v.signum() + 0.4 * joint as f64);
        for (name, column) in &mut made[1..] {
            let size = if name.starts_with("tau") { 0.3 } else { 1e-6 };
            column.iter_mut().enumerate().for_each(|(k, x)| *x += size * noise(k + name.len()));
        }
        made.push(("q_link2".into(), made[2].1.iter().map(|q| q + 1e-3 * (3.0 * q).sin()).collect()));
        for joint in 1..=2 {
            made.push((format!("qd{joint}"), made[joint].1.iter().map(|q| q.cos()).collect()));
        }
        made[0].1.iter_mut().enumerate().for_each(|(k, t)| *t += late(k) / RATE_HZ);
        recording(made)
    }

    /// Fails unless the comparison of `recording` in parts equals that without parts: every point once, and all values within `most`, relative to
    /// their size.
    fn assert_same(name: &str, effects: &[Placed], recording: &Recording, most: f64) {
        let compare = |rows| {
            in_parts(&two_joints(), effects, recording, &Settings::default(), rows).expect("a comparison")
        };
        let ((whole, curves), (parts, pieces)) = (compare(usize::MAX), compare(ROWS));
        assert_eq!((parts.samples, &pieces.stretches), (whole.samples, &curves.stretches), "{name}");
        let late = pieces.t.iter().zip(&curves.t).map(|(a, b)| (a - b).abs() * RATE_HZ).fold(0.0, f64::max);
        assert!(pieces.t.len() == whole.samples && late < 0.5, "{name}: points are {late} of a step apart");
        let mut worst = 0.0_f64;
        for (part, whole) in parts.channels.iter().zip(&whole.channels) {
            let errors = |of: &ChannelError| {
                [of.rmse, of.mean_error, of.std_error, of.max_error, of.rmse_without_friction.unwrap_or(0.0)]
            };
            let measured = |of: &ChannelError| [of.rms_measured, of.std_measured];
            let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            worst = worst.max(off(&errors(part), &errors(whole)) / whole.rmse);
            worst = worst.max(off(&measured(part), &measured(whole)) / whole.rms_measured);
        }
        println!("{name}: {} points, off by {worst:.1e} (margin {most:.0e})", parts.samples);
        assert!(parts.samples > ROWS / 2 && worst > 0.0 && worst < most, "{name}");
        let beginnings =
            |notes: &[String]| notes.iter().map(|note| note[..40].to_owned()).collect::<Vec<_>>();
        assert_eq!(beginnings(&parts.notes), beginnings(&whole.notes), "{name}");
    }

    #[test]
    fn parts_say_what_the_whole_says() {
        let on_time = |_| 0.0;
        assert_same("even", &[], &made(&even(64.0, RATE_HZ), on_time), 1e-6);
        assert_same("interpolated", &[], &made(&jittered(64.0, RATE_HZ), on_time), 1e-6);
        let gaps = |t: f64| t + 7.0 * (t / 9.0).floor() + if t > 40.0 { 0.21 } else { 0.0 };
        let t: Vec<f64> = even(64.0, RATE_HZ).into_iter().map(gaps).collect();
        assert_same("with gaps", &[], &made(&t, on_time), 1e-6);
        let shaking = made(&even(64.0, RATE_HZ), |k| 0.3 * (1.0 + noise(k)));
        // The line through the stamps of a short part is less accurate.
        assert_same("steadied", &[], &shaking, 1e-2);
    }

    /// Laws with a memory start again in each part, early enough to reach their state.
    #[test]
    fn memories_are_there_when_they_are_asked() {
        let place = |kind: &str, joint: &str, parameters: [(&str, f64); 2]| {
            let parameters = parameters.map(|(name, value)| (name.to_owned(), value.into()));
            let (kind, joint) = (kind.to_owned(), Some(joint.to_owned()));
            let table = EffectTable { kind, joint, parameters: parameters.into_iter().collect(), line: 0 };
            Placed::new(&table, &two_joints()).expect("an effect")
        };
        let effects = [
            place("backlash", "elbow", [("gap", 2e-3), ("friction", 1.0)]),
            place("presliding_friction", "shoulder", [("stiffness", 300.0), ("coulomb", 1.0)]),
            place("friction_drift", "elbow", [("amount", 0.5), ("time_constant", 30.0)]),
        ];
        assert_same("with memories", &effects, &made(&even(64.0, RATE_HZ), |_| 0.0), 1e-6);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

        /// For any stamps, settings and length of parts, the result is an error or finite numbers, and no point appears twice.
        #[test]
        fn any_recording_in_parts_gives_finite_numbers_or_an_error(
            steps in prop::collection::vec((-6.0..1.0_f64, any::<bool>(), any::<bool>()), 1..400),
            lowpass_hz in prop::option::of(0.1..50.0_f64),
            trim_s in prop::option::of(0.0..0.5_f64),
            rows in 32..200_usize,
        ) {
            let mut t = vec![0.0];
            for (exponent, regular, usual) in &steps {
                t.push(t[t.len() - 1] + if *regular || *usual { 0.01 } else { 10_f64.powf(*exponent) });
            }
            let recording = made(&t, |_| 0.0);
            let settings = Settings { lowpass_hz, trim_s };
            if let Ok((comparison, curves)) = in_parts(&two_joints(), &[], &recording, &settings, rows) {
                prop_assert!(comparison.samples == curves.t.len() && comparison.samples <= t.len() + 1);
                prop_assert!(curves.t.windows(2).all(|pair| pair[0] < pair[1]), "{:?}", curves.t);
                prop_assert!(comparison.channels.iter().all(|channel| channel.rmse.is_finite()));
            }
        }
    }

    /// Windows from the whole recording decide on its treatment, not its beginning: here the arm is at rest at first, and vibrates later.
    #[test]
    fn windows_are_spread_over_the_recording() {
        let (arm, t) = (two_joints(), even(64.0, RATE_HZ));
        let mut columns = columns(&arm, &t, |_, v| 1.5 * v.signum());
        for (name, column) in columns.iter_mut().filter(|(name, _)| name != "t") {
            let shakes = |t: f64| if name.starts_with('q') { 2e-3 * (60.0 * t).sin() } else { 0.0 };
            let still = column[9000];
            column.iter_mut().zip(&t).for_each(|(x, t)| *x = if *t < 18.0 { still } else { *x + shakes(*t) });
        }
        let compare = |rows| {
            in_parts(&arm, &[], &recording(columns.clone()), &Settings::default(), rows)
                .expect("a comparison")
                .0
        };
        let (whole, parts) = (compare(usize::MAX), compare(ROWS));
        println!("low-pass at {:.2} Hz by all, {:.2} Hz by windows", whole.lowpass_hz, parts.lowpass_hz);
        assert!(whole.lowpass_hz < 9.6 && (parts.lowpass_hz / whole.lowpass_hz - 1.0).abs() < 1e-9);
    }
}
