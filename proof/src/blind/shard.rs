//! The cases of a shard, and errors in their names.

use std::collections::BTreeSet;

use super::names::name;
use super::receipt::{Draw, Part};

/// Errors in the names of `part`: each case must belong to the shard, and each case of the shard must be sealed or listed as not made.
pub fn wrong(part: &Part, draw: &Draw) -> Vec<String> {
    let Some(indices) = indices(draw) else {
        return vec![format!("no shard {} of {} can be drawn", draw.shard[0], draw.shard[1])];
    };
    let (sealed, not_made) = (part.sealed.len(), part.not_made.len());
    if indices.len() != sealed + not_made {
        let drawn = indices.len();
        return vec![format!("{drawn} cases were drawn; {sealed} were sealed and {not_made} not made")];
    }
    let names: BTreeSet<String> = indices.map(|index| name(&draw.names, index)).collect();
    let strange = part.sealed.keys().filter(|name| !names.contains(*name));
    strange.map(|name| format!("{name} is no name of this draw")).collect()
}

/// The cases of the shard, by their index in the set; `None` for an impossible shard or set.
fn indices(draw: &Draw) -> Option<impl ExactSizeIterator<Item = usize> + use<>> {
    let [shard, shards] = draw.shard;
    let quota = &draw.quota;
    let sorts = [quota.single, quota.negative, quota.unknown, quota.double];
    let cases = sorts.into_iter().try_fold(0_usize, usize::checked_add)?;
    (1..=shards).contains(&shard).then(|| (shard - 1..cases.max(shard - 1)).step_by(shards))
}
