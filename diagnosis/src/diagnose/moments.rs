//! What happens at a time: a push, a load that drops. Each recording has a clock of its own, and a repeat need not have the push.

use freeplay_laws::Kind as EffectKind;
use toml::{Table, Value};

use super::candidate::Form;
use super::data::Data;
use crate::residual::Kind;

/// Shares of a recording that what strikes may last, shorter than a list of windows goes.
const BRIEF: [f64; 3] = [1.0 / 24.0, 1.0 / 48.0, 1.0 / 96.0];
/// Names of the numbers of a law that begins and ends.
const BEGIN: &str = "start";
const END: &str = "end";

/// The form with this `shape` in the recording number `only`.
pub(crate) fn in_one_recording(data: &Data, shape: Table, only: usize) -> Form {
    Form { only: (data.stages.len() > 1).then_some(only), ..Form::of(shape) }
}

/// The shapes of a `kind` that begins and ends in which it would act where, for so long, most more is left of the torques of the recording number `index`
/// than before and after.
pub(crate) fn struck(data: &Data, kind: &EffectKind, index: usize) -> Vec<Table> {
    if kind.parameter(END).is_none() {
        return Vec::new();
    }
    let t = &data.stages[index].motion().t;
    let sums = running_sums(data, index);
    let within = |from: usize, to: usize| sums[to.min(t.len())] - sums[from.min(t.len())];
    let of_share = |share: f64| {
        let long = (share * t.len() as f64) as usize;
        let more = |k: &usize| {
            within(*k, k + long) - 0.5 * (within(k.saturating_sub(long), *k) + within(k + long, k + 2 * long))
        };
        let begin = (0..t.len().saturating_sub(long + 1)).max_by(|a, b| more(a).total_cmp(&more(b)))?;
        let times = [(BEGIN, t[begin]), (END, t[begin + long])];
        (long > 1)
            .then(|| times.map(|(name, time)| (name.to_owned(), Value::from(time))).into_iter().collect())
    };
    BRIEF.into_iter().filter_map(of_share).collect()
}

/// Sums, up to each point, of the squares that the model leaves of the torques of the recording number `index`, each by its own mean.
fn running_sums(data: &Data, index: usize) -> Vec<f64> {
    let stage = &data.stages[index];
    let mut squares = vec![0.0; stage.motion().len()];
    for channel in &stage.channels {
        let left = channel.residual();
        let mean = left.iter().map(|x| x * x).sum::<f64>() / left.len().max(1) as f64;
        if matches!(channel.kind, Kind::Torque(_)) && mean > 0.0 {
            squares.iter_mut().zip(left).for_each(|(square, x)| *square += x * x / mean);
        }
    }
    let summed = squares.into_iter().scan(0.0, |sum, square| {
        *sum += square;
        Some(*sum)
    });
    std::iter::once(0.0).chain(summed).collect()
}
