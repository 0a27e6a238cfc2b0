//! Corrections of a recording other than factors: jumps by whole turns, zeros, positions relative to another joint, clocks.

use serde::Deserialize;

/// A joint whose recorded position contains another joint's, times a factor; joints are counted from 1.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Relative {
    /// The joint with the position to be corrected.
    pub joint: usize,
    /// The joint whose position it contains.
    pub to: usize,
    /// The factor.
    pub factor: f64,
}

/// Tolerance of a jump around a whole turn, as a share of a turn.
const NEAR: f64 = 0.1;
/// Limit of the steps before and after a jump, as a share of the jump.
const STEADY: f64 = 0.2;
/// A turn in rad, and in degrees.
const TURNS: [f64; 2] = [std::f64::consts::TAU, 360.0];

/// `column`, positions in rad or degrees, without its jumps by whole turns; `None` if it has none. A jump is a turn between two samples, with far smaller steps
/// before and after it.
pub fn unwrapped(column: &[f64]) -> Option<Vec<f64>> {
    let steps: Vec<f64> = column.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let around = |k: usize| {
        let near = [k.checked_sub(1), Some(k + 1)].into_iter().flatten().filter_map(|k| steps.get(k));
        near.fold(0.0_f64, |most, step| most.max(step.abs()))
    };
    let jump = |k: usize| -> Option<f64> {
        let turn = TURNS.into_iter().find(|turn| (steps[k].abs() / turn - 1.0).abs() < NEAR)?;
        (around(k) < STEADY * turn).then_some(turn * steps[k].signum())
    };
    let jumps: Vec<(usize, f64)> = (0..steps.len()).filter_map(|k| Some((k + 1, jump(k)?))).collect();
    if jumps.is_empty() {
        return None;
    }
    let (mut column, mut sum, mut next) = (column.to_vec(), 0.0, jumps.iter().peekable());
    for (row, x) in column.iter_mut().enumerate() {
        if let Some((_, turn)) = next.next_if(|(at, _)| *at == row) {
            sum += turn;
        }
        *x -= sum;
    }
    Some(column)
}

/// `column`, sampled at the times `t` \[s\], shifted by `delay` s into the future, with linear interpolation; beyond the ends, the end's value.
pub fn shifted(t: &[f64], column: &[f64], delay: f64) -> Vec<f64> {
    if delay == 0.0 || t.len() < 2 {
        return column.to_vec();
    }
    let mut below = 0;
    let at = |time: &f64| {
        let time = time + delay;
        while below + 2 < t.len() && t[below + 1] <= time {
            below += 1;
        }
        let u = ((time - t[below]) / (t[below + 1] - t[below])).clamp(0.0, 1.0);
        column[below] + u * (column[below + 1] - column[below])
    };
    t.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::{shifted, unwrapped};

    /// Positions that pass the end of their turn, in both directions, are restored; a joint in fast motion stays unchanged.
    #[test]
    fn jumps_by_a_turn_are_taken_out_and_nothing_else() {
        let smooth: Vec<f64> = (0..400).map(|k| 4.0 * (0.03 * f64::from(k)).sin()).collect();
        for turn in super::TURNS {
            let unit = turn / std::f64::consts::TAU;
            let wrapped: Vec<f64> = smooth
                .iter()
                .map(|x| (x + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI)
                .map(|x| x * unit)
                .collect();
            let mended = unwrapped(&wrapped).expect("it jumps");
            let off = mended.iter().zip(&smooth).map(|(a, b)| (a - b * unit).abs()).fold(0.0, f64::max);
            println!("a turn of {turn:.2}: off by {off:.1e}");
            assert!(off < 1e-9 * turn);
        }
        assert_eq!(unwrapped(&smooth), None);
        let fast: Vec<f64> = (0..100).map(|k| 6.2 * f64::from(k % 2)).collect();
        assert_eq!(unwrapped(&fast), None, "every step is as long");
    }

    #[test]
    fn a_late_column_is_brought_back() {
        let t: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let late: Vec<f64> = t.iter().map(|t| 3.0 * (t - 0.125)).collect();
        for (t, x) in t.iter().zip(shifted(&t, &late, 0.125)).take(180) {
            assert!((x - 3.0 * t).abs() < 1e-12);
        }
        let early = shifted(&t, &late, -0.05);
        assert!((early[100] - 3.0 * (t[100] - 0.175)).abs() < 1e-12);
    }
}
