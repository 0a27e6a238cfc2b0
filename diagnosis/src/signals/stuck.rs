//! Torques with a constant value while their joint moves: no measurement, whatever the model predicts.

use freeplay_laws::Trajectory;
use freeplay_recording::Recording;

use crate::signals::missing::only;
use crate::signals::motion::Treatment;
use crate::statistics::FEWEST_ROWS;

/// Thresholds of motion: a joint moves and drives its load where speed and acceleration exceed this share of their maxima. At the lowest cutoff of the
/// low-pass, 2 % is the noise of a differentiated encoder.
pub(crate) const MOVES: f64 = 0.02;
/// Least share of the rows in motion, forwards and backwards, with the same value for a stuck torque: clearly more than a half, which dry friction with a
/// coarse step can cause.
const SHARE: f64 = 0.7;

/// A stuck torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stuck {
    /// The value, unit of the torque.
    pub at: f64,
    /// Share of the rows in which its joint moves.
    pub share: f64,
}

impl Stuck {
    /// The stuck torques by joint, along the motion `whole` of all grid points; `None` for a torque that varies, or without one.
    pub fn of(recording: &Recording, treatment: &Treatment, whole: &Trajectory) -> Vec<Option<Self>> {
        let Some(torques) = &recording.tau else { return vec![None; recording.joints()] };
        let of_joint = |(joint, torque): (usize, &Vec<f64>)| {
            let present = treatment.whole_present(recording, torque);
            let of = |column: &[f64]| only(column, present.as_deref()).into_owned();
            Self::along(
                &of(&treatment.whole_column(recording, torque)),
                &of(&whole.v[joint]),
                &of(&whole.a[joint]),
            )
        };
        torques.iter().enumerate().map(of_joint).collect()
    }

    /// The stuck value of `torque`, whose joint has the velocities `v` and accelerations `a`. A drive in steady motion may have a steady torque, and dry
    /// friction makes a different one in each direction: neither is stuck.
    pub fn along(torque: &[f64], v: &[f64], a: &[f64]) -> Option<Self> {
        let least = |x: &[f64]| MOVES * x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let (slow, steady) = (least(v), least(a));
        let drives = |&k: &usize| v[k].abs() > slow && a[k].abs() > steady;
        let (forwards, backwards): (Vec<usize>, Vec<usize>) =
            (0..torque.len()).filter(drives).partition(|&k| v[k] > 0.0);
        let both = [forwards.as_slice(), &backwards].concat();
        if both.len() < FEWEST_ROWS {
            let first = *torque.first()? + 0.0;
            return torque.iter().all(|x| *x == first).then_some(Self { at: first, share: 1.0 });
        }
        // Adding zero turns −0 into +0.
        let at = most_common(both.iter().map(|&k| torque[k])) + 0.0;
        let share = |rows: &[usize]| {
            rows.iter().filter(|&&k| torque[k] == at).count() as f64 / rows.len().max(1) as f64
        };
        let ways: Vec<&Vec<usize>> =
            [&forwards, &backwards, &both].into_iter().filter(|rows| rows.len() >= FEWEST_ROWS).collect();
        let is_stuck = ways.iter().all(|rows| share(rows) > SHARE);
        is_stuck.then(|| Self { at, share: share(&both) })
    }
}

/// The majority value of `x`, by Boyer and Moore's vote (1991); without a majority, an arbitrary value.
fn most_common(x: impl Iterator<Item = f64>) -> f64 {
    let vote = |(value, count): (f64, usize), x: f64| match count {
        0 => (x, 1),
        _ if x == value => (value, count + 1),
        _ => (value, count - 1),
    };
    x.fold((f64::NAN, 0), vote).0
}

#[cfg(test)]
mod tests {
    use super::Stuck;

    const POINTS: usize = 1000;

    fn along(torque: impl Fn(usize) -> f64) -> Option<Stuck> {
        let at = |k: usize| 0.02 * k as f64;
        let torque: Vec<f64> = (0..POINTS).map(torque).collect();
        let v: Vec<f64> = (0..POINTS).map(|k| at(k).cos()).collect();
        let a: Vec<f64> = (0..POINTS).map(|k| -at(k).sin()).collect();
        Stuck::along(&torque, &v, &a)
    }

    #[test]
    fn a_torque_that_hardly_ever_answers_is_stuck() {
        let mostly = along(|k| if k % 8 == 0 { 0.03 * (k % 24) as f64 } else { 0.0 });
        println!("{mostly:?}");
        assert!(mostly.is_some_and(|stuck| stuck.at == 0.0 && stuck.share > 0.85));
        assert!(along(|_| 3.5).is_some_and(|stuck| stuck.at == 3.5 && stuck.share == 1.0));
    }

    /// Fewer than twenty rows in each direction, thirty together.
    #[test]
    fn a_torque_of_a_short_motion_is_not_stuck_for_want_of_rows() {
        let at = |k: usize| 0.2 * k as f64;
        let [torque, v, a] = [|x: f64| 3.0 * x.sin() + x, f64::cos, |x: f64| -x.sin()]
            .map(|of: fn(f64) -> f64| (0..30).map(|k| of(at(k))).collect::<Vec<f64>>());
        assert_eq!(Stuck::along(&torque, &v, &a), None);
    }

    #[test]
    fn friction_and_coarse_rounding_are_no_stuck_torque() {
        assert_eq!(along(|k| (0.02 * k as f64).cos().signum()), None, "dry friction alone");
        assert_eq!(along(|k| (0.02 * k as f64).cos().round()), None, "rounded to three values");
        assert_eq!(along(|k| (0.02 * k as f64).sin()), None);
    }
}
