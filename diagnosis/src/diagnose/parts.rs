//! The three parts of the data: the search sees the fit part, the choice between the few best answers the choice part too, and the report alone
//! sees the test part.

use super::stage::Stage;
use crate::statistics::span;

/// A part of the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// What the search sees.
    Fit,
    /// What decides between the few best answers.
    Choice,
    /// What the report alone sees.
    Test,
    /// A guard between two parts: what the low-pass smears from one into the other.
    Guard,
}

/// Shares of one recording in the fit part, and in the fit and the choice part together. What is fitted needs most of the motion; a third for
/// the test is what the field holds out.
const SHARES: [f64; 2] = [0.55, 0.70];
/// The same for a recording beside which another is the test part.
const WITHOUT_TEST: [f64; 2] = [0.75, 1.0];

/// The part of each row of `stages`, and how they were parted, in words: with several recordings one is the test part, with three or more another is the
/// choice part, and what is left to fit and to choose is cut in time, by rows in which anything moves.
///
/// The test part is the last recording in which no joint moves that the others leave at rest: where there is none, each recording is cut in time.
pub(crate) fn parts_of(stages: &[Stage], counts: &[Vec<f64>]) -> (Vec<Vec<Part>>, String) {
    let per_stage = stages.first().map_or(0, |stage| stage.channels.len());
    let cut_at = |index: usize, shares| {
        cut(&stages[index], &counts[index * per_stage..(index + 1) * per_stage], shares)
    };
    let all = 0..stages.len();
    let Some(test) = all.clone().rev().find(|&index| is_covered(stages, index)) else {
        let of = if stages.len() > 1 { "each" } else { "the" };
        let how = format!("the last 30 % of {of} recording, which no step before the report has seen");
        return (all.map(|index| cut_at(index, SHARES)).collect(), how);
    };
    let others: Vec<usize> = all.clone().filter(|&index| index != test).collect();
    let choice = others.iter().copied().rev().find(|&index| {
        let fitted: Vec<&Stage> =
            others.iter().filter(|&&other| other != index).map(|&other| &stages[other]).collect();
        !fitted.is_empty() && moves_less(&stages[index], &fitted)
    });
    let of = |index: usize| {
        let whole = |part| vec![part; stages[index].motion().len()];
        match choice {
            _ if index == test => whole(Part::Test),
            Some(choice) if index == choice => whole(Part::Choice),
            Some(_) => whole(Part::Fit),
            None => cut_at(index, WITHOUT_TEST),
        }
    };
    (all.map(of).collect(), format!("{}, which no step before the report has seen", file_name(&stages[test])))
}

/// Whether every joint that moves in the recording number `index` moves in another one, too.
fn is_covered(stages: &[Stage], index: usize) -> bool {
    let others: Vec<&Stage> =
        (0..stages.len()).filter(|&other| other != index).map(|other| &stages[other]).collect();
    !others.is_empty() && moves_less(&stages[index], &others)
}

/// Whether every joint that moves in `stage` moves in one of the `others`, too: goes a hundredth of its way at least.
fn moves_less(stage: &Stage, others: &[&Stage]) -> bool {
    const LITTLE: f64 = 0.01;
    let way = |stage: &Stage, joint: usize| span(&stage.motion().q[joint]);
    (0..stage.arm().dof()).all(|joint| {
        let most = others.iter().map(|other| way(other, joint)).fold(0.0, f64::max);
        most >= LITTLE * way(stage, joint)
    })
}

/// The name of the file of the recording of `stage`.
pub(crate) fn file_name(stage: &Stage) -> String {
    let origin = &stage.ground.recording.origin;
    origin.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Cuts the rows of `stage` at the `shares` of its rows that count in any channel.
fn cut(stage: &Stage, counts: &[Vec<f64>], shares: [f64; 2]) -> Vec<Part> {
    let motion = stage.motion();
    let weight = |row: usize| counts.iter().map(|counts| counts[row]).sum::<f64>();
    let all: f64 = (0..motion.len()).map(weight).sum();
    let mut seen = 0.0;
    let mut parts: Vec<Part> = (0..motion.len())
        .map(|row| {
            seen += weight(row);
            match seen / all.max(1.0) {
                share if share <= shares[0] => Part::Fit,
                share if share <= shares[1] => Part::Choice,
                _ => Part::Test,
            }
        })
        .collect();
    // Rows on either side of a cut share what the low-pass smears.
    let span = stage.ground.treatment.filter().settling_time();
    let cuts: Vec<f64> =
        (1..parts.len()).filter(|&row| parts[row] != parts[row - 1]).map(|row| motion.t[row]).collect();
    for (part, t) in parts.iter_mut().zip(&motion.t) {
        if cuts.iter().any(|cut| (t - cut).abs() < 0.5 * span) {
            *part = Part::Guard;
        }
    }
    parts
}
