//! What pictures are drawn from: every recording of the fit and of the held-out data, point by point.

use std::collections::BTreeMap;

use freeplay_laws::{LawError, Trajectory};

use super::case::Case;
use super::columns::{Column, less, sum_of};
use super::excite::ChannelNoise;
use super::judge::Judge;
use super::parts::file_name;
use super::search::Search;
use super::show::HeldOut;
use super::system::Fit;
use super::variables::{Variable, of_joint, time};

/// One recording of the fit, or of the held-out data, as it was worked on.
#[derive(Clone, Debug)]
pub struct Passage {
    /// The file that it comes from.
    pub recording: String,
    /// Whether it took no part in the fit.
    pub held_out: bool,
    /// The motion; its times are those of all columns here.
    pub motion: Trajectory,
    /// What residuals may depend on: the time, then the variables of each joint.
    pub variables: Vec<Variable>,
    /// The channels.
    pub traces: Vec<Trace>,
}

/// A channel over time, in its unit. NaN where its rows don't count: the torque of a joint that stands.
#[derive(Clone, Debug)]
pub struct Trace {
    /// The channel, by the name of its column.
    pub channel: String,
    /// Its unit.
    pub unit: &'static str,
    /// What was measured, treated.
    pub measured: Vec<f64>,
    /// Measured minus the model as given.
    pub before: Vec<f64>,
    /// Measured minus the model with its parameters tuned inside their tolerances.
    pub retuned: Vec<f64>,
    /// Measured minus the tuned model with the named effects.
    pub after: Vec<f64>,
    /// Measured minus the tuned model with an unnamed correction in the place of all effects.
    pub unnamed: Vec<f64>,
    /// What each named effect says here, in the order of the findings; empty where it says nothing.
    pub laws: Vec<Vec<f64>>,
}

/// The rows of one side, the fit's or the held-out data's, all recordings stacked.
struct Rows {
    before: Vec<Vec<f64>>,
    retuned: Vec<Vec<f64>>,
    after: Vec<Vec<f64>>,
    unnamed: Vec<Vec<f64>>,
    /// What each effect says, `[effect][channel]`.
    laws: Vec<Vec<Vec<f64>>>,
}

/// All passages under the coefficients of `fit`, those of the fit first. `None` if a fit is singular.
///
/// # Errors
/// See [`LawError`].
pub(crate) fn passages(
    search: &Search,
    fit: &Fit,
    judge: &Judge,
    errors: &HeldOut,
    black_box: &[Vec<f64>],
) -> Result<Option<Vec<Passage>>, LawError> {
    let Some(bare) = search.system.fit(&search.nuisances()) else { return Ok(None) };
    let retuned = search.system.residual(&bare);
    let said = search.case.unnamed_on(search.case, &retuned);
    let (mut of_fit, mut of_held) = (Vec::new(), Vec::new());
    let mut at = search.nuisances().len();
    for chosen in &search.chosen {
        let hypothesis = &search.hypotheses[chosen.hypothesis];
        let beta = &fit.eta.as_slice()[at..at + hypothesis.size()];
        at += hypothesis.size();
        let law = |columns: &[Column], case: &Case| {
            sum_of(columns.iter().zip(beta.iter().copied()), case.kept.len())
        };
        of_fit.push(law(&hypothesis.block.columns, search.case));
        of_held.push(law(&hypothesis.columns_on(judge.held)?, judge.held));
    }
    let fitted = Rows {
        before: search.case.target(),
        unnamed: less(&retuned, &said),
        retuned,
        after: search.system.residual(fit),
        laws: of_fit,
    };
    let held = Rows {
        before: errors.before.clone(),
        retuned: errors.retuned.clone(),
        after: errors.tuned_after.clone(),
        unnamed: black_box.to_vec(),
        laws: of_held,
    };
    let mut all = cut(search.case, &fitted, false);
    all.extend(cut(judge.held, &held, true));
    Ok(Some(all))
}

/// What the findings leave in each channel of the first recording of the fit. Joints that stood while it was made count as those that moved.
pub(crate) fn noise(search: &Search) -> BTreeMap<String, ChannelNoise> {
    let Some(fit) = search.system.fit(&search.active(None)) else { return BTreeMap::new() };
    let weighing = search.case.weigh(&search.system.residual(&fit));
    let stage = &search.case.stages[0];
    let stretches = &stage.motion().stretches;
    let lasts: f64 = stretches.iter().map(|s| stage.motion().step(s) * s.len() as f64).sum();
    let rows = search.case.rows();
    let channels = stage.channels.iter().enumerate().filter(|(c, _)| rows[*c] > 0.0);
    let of = |(c, channel): (usize, &crate::residual::Channel)| {
        let floor = search.null.floor.get(c).copied().unwrap_or(0.0);
        let share = rows[c] / stage.motion().len().max(1) as f64;
        let noise = ChannelNoise {
            deviation: weighing.deviation[c].max(floor),
            per_second: weighing.effective[c] / (lasts * share).max(1e-9),
        };
        (channel.name.clone(), noise)
    };
    channels.map(of).collect()
}

/// `rows` by recording and channel.
fn cut(case: &Case, rows: &Rows, held_out: bool) -> Vec<Passage> {
    let per_stage = case.per_stage();
    let of_stage = |(index, stage): (usize, &super::stage::Stage)| {
        let mut variables = vec![time(stage)];
        variables.extend((0..stage.arm().dof()).flat_map(|joint| of_joint(stage, joint)));
        let traces = stage.channels.iter().enumerate().map(|(c, channel)| {
            let at = index * per_stage + c;
            let kept = &case.kept[at];
            let counted = |column: &[f64]| -> Vec<f64> {
                column.iter().zip(kept).map(|(x, kept)| if *kept > 0.0 { *x } else { f64::NAN }).collect()
            };
            Trace {
                channel: channel.name.clone(),
                unit: channel.unit,
                measured: channel.measured.clone(),
                before: counted(&rows.before[at]),
                retuned: counted(&rows.retuned[at]),
                after: counted(&rows.after[at]),
                unnamed: counted(&rows.unnamed[at]),
                laws: rows.laws.iter().map(|law| counted(law.get(at).map_or(&[], Vec::as_slice))).collect(),
            }
        });
        Passage {
            recording: file_name(stage.ground.recording),
            held_out,
            motion: stage.motion().clone(),
            variables,
            traces: traces.collect(),
        }
    };
    case.stages.iter().enumerate().map(of_stage).collect()
}
