//! Names of the folders of cases. They follow from a key of the operating system, never from the seed.
//!
//! The analysts do not know the key, so that a name tells neither index nor seed. The receipt holds it, so that `--verify` can say of each
//! name whether the draw has it.

use serde_json::json;

use super::hash;
use super::receipt::{Draw, Part};

/// Hexadecimal digits of a name.
const DIGITS: usize = 16;

/// The name of case `index` of a set whose names follow from `key`.
pub fn name(key: &str, index: usize) -> String {
    let mut name = hash::of_json("name", &json!([key, index]));
    name.truncate(DIGITS);
    name
}

/// What is wrong with the names of `part`: each case is one of the shard, and each of the shard was sealed or is listed as not made.
pub fn wrong(part: &Part, draw: &Draw) -> Vec<String> {
    let Some(indices) = indices(draw) else {
        return vec![format!("no shard {} of {} can be drawn", draw.shard[0], draw.shard[1])];
    };
    let (sealed, not_made) = (part.sealed.len(), part.not_made.len());
    if indices.len() != sealed + not_made {
        let drawn = indices.len();
        return vec![format!("{drawn} cases were drawn; {sealed} were sealed and {not_made} not made")];
    }
    let names: std::collections::BTreeSet<String> = indices.map(|index| name(&draw.names, index)).collect();
    let strange = part.sealed.keys().filter(|name| !names.contains(*name));
    strange.map(|name| format!("{name} is no name of this draw")).collect()
}

/// The cases of the shard, by their place in the set; `None` where there is no such shard or no such set.
pub fn indices(draw: &Draw) -> Option<impl ExactSizeIterator<Item = usize> + use<>> {
    let [shard, shards] = draw.shard;
    let quota = &draw.quota;
    let sorts = [quota.single, quota.negative, quota.unknown, quota.double];
    let cases = sorts.into_iter().try_fold(0_usize, usize::checked_add)?;
    (1..=shards).contains(&shard).then(|| (shard - 1..cases.max(shard - 1)).step_by(shards))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::name;

    /// Names are unlike, follow the key, and their order is not that of the cases.
    #[test]
    fn names_tell_nothing() {
        let names: Vec<String> = (0..2000).map(|index| name("00ff", index)).collect();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), 2000);
        assert!(names.iter().all(|name| name.len() == 16));
        assert!((0..2000).all(|index| name("00fe", index) != names[index]));
        let rising = names.windows(2).filter(|pair| pair[0] < pair[1]).count();
        println!("{rising} of 1999 neighbours rise");
        // Half of them by chance; 5 standard deviations of the count of rises in a random order, √((n + 1) / 12), are 65.
        assert!(rising.abs_diff(1000) < 65);
    }
}
