//! How far what is left is above what noise explains: whether anything is missing at all, and whether naming has found most of it.

use freeplay_laws::LawError;

use super::case::Case;
use super::judge::Judge;
use super::search::Search;
use crate::residual::Kind;

/// A channel this many times above the floor holds more than noise: twins stay below 1.2, laws that are idealised add to that.
const BEYOND: f64 = 2.5;
/// The same for a channel of which most is left, when others have their names.
const FAR: f64 = 8.0;
/// Greatest share of the squares beyond the floor that naming may leave.
const LEFT: f64 = 0.4;

/// A channel below this many times the floor is followed to its noise.
const FOLLOWED: f64 = 1.5;
/// Greatest share of the squares beyond the floor that naming may leave of one torque of a machine that is followed to its noise elsewhere.
const POOR: f64 = 0.0064;

/// Share of its torque to which an arm follows the laws of a rigid body and of dry friction, which are idealisations.
const IDEAL: f64 = 0.005;

/// What is left over the noise floor in each channel, the model's parameters tuned inside their tolerances to the very data that are
/// looked at: so nothing of it is for the tolerances to explain.
#[derive(Clone, Debug)]
pub(crate) struct Excess {
    /// Without what was named: of the fit, then of the held-out data.
    before: Vec<f64>,
    /// With it.
    after: Vec<f64>,
    /// Which of the channels of a stage are torques.
    torques: Vec<bool>,
}

impl Excess {
    /// The excess of what `search` was given and of the held-out data of `judge`; `None` if a fit is singular.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn of(search: &Search, judge: &Judge) -> Result<Option<Self>, LawError> {
        let system = &search.system;
        let (Some(bare), Some(fit)) = (system.fit(&search.nuisances()), system.fit(&search.active(None)))
        else {
            return Ok(None);
        };
        let mut before = search.case.rms(&system.residual(&bare));
        let mut after = search.case.rms(&system.residual(&fit));
        let Some(held) = judge.retuned_there(search)? else { return Ok(None) };
        before.extend(judge.held.rms(&held[0]));
        after.extend(judge.held.rms(&held[1]));
        let of_fit = search.case.by_channel(&search.null.floor);
        let floors: Vec<f64> = of_fit.iter().chain(&judge.floor.tuned_there).copied().collect();
        let ideal = [search.case, judge.held].into_iter().flat_map(idealised);
        let floors: Vec<f64> = floors.iter().zip(ideal).map(|(floor, ideal)| floor.hypot(ideal)).collect();
        let over = |rms: Vec<f64>| {
            rms.iter().zip(&floors).map(|(rms, floor)| rms / floor.max(f64::MIN_POSITIVE)).collect()
        };
        let channels = search.case.stages[0].channels.iter();
        let torques = channels.map(|channel| matches!(channel.kind, Kind::Torque(_))).collect();
        Ok(Some(Self { before: over(before), after: over(after), torques }))
    }

    /// Whether something is left that noise does not explain.
    pub fn is_left(&self) -> bool {
        self.after.iter().any(|left| *left > BEYOND)
    }

    /// Share of the squares beyond the floor that naming leaves, by the channels' own floors.
    pub fn share_left(&self) -> f64 {
        beyond(&self.after) / beyond(&self.before).max(f64::MIN_POSITIVE)
    }

    /// Whether most of what is there has no name: in all channels together, or in one that has much of it, of the fit and held out together. Of a
    /// machine that is followed to its noise in most channels, a torque of which a law leaves far more is followed poorly: there is another law. (The
    /// tool is not held to that: a journal that flies takes another course each time.)
    pub fn is_unnamed(&self) -> bool {
        let channels = self.after.len() / 2;
        let of = |all: &[f64], c: usize| [all[c], all[c + channels]];
        let leaves =
            |c: usize, share: f64| beyond(&of(&self.after, c)) > share * beyond(&of(&self.before, c));
        let is_all = |c: usize, is: fn(&f64) -> bool| of(&self.after, c).iter().all(is);
        let stays = |c: usize| of(&self.after, c).iter().any(|left| *left > FAR) && leaves(c, LEFT);
        // What nothing was said of is no law that is followed poorly.
        let is_poor = |c: usize| {
            self.torques[c] && is_all(c, |left| *left > BEYOND) && leaves(c, POOR) && !leaves(c, LEFT)
        };
        let followed = (0..channels).filter(|&c| is_all(c, |left| *left < FOLLOWED)).count();
        self.is_left() && self.share_left() > LEFT
            || (0..channels).any(stays)
            || 2 * followed >= channels && (0..channels).any(is_poor)
    }
}

/// Sum of the squares of `left`, multiples of the floor, beyond the floor.
pub(super) fn beyond(left: &[f64]) -> f64 {
    left.iter().map(|left| (left * left - 1.0).max(0.0)).sum()
}

/// By how much the laws may be off in each channel of a stage of `case`: the part of its torque that they are idealised by.
fn idealised(case: &Case) -> Vec<f64> {
    let channels = case.stages.iter().flat_map(|stage| &stage.channels);
    let measured: Vec<Vec<f64>> = channels
        .zip(&case.kept)
        .map(|(channel, kept)| {
            let share = if matches!(channel.kind, Kind::Torque(_)) { IDEAL } else { 0.0 };
            channel.measured.iter().zip(kept).map(|(x, kept)| share * x * kept).collect()
        })
        .collect();
    case.rms(&measured)
}
