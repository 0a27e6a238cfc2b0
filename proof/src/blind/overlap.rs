//! Checks that no case occurs in two parts of a receipt, in time linear in the number of cases.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use serde_json::json;

use super::analyst::FILES;
use super::receipt::{Draw, Part};

/// The cases of the parts so far.
#[derive(Debug, Default)]
pub struct Overlap {
    /// The shards of each draw: for each number of shards, the indices present.
    shards: HashMap<String, BTreeMap<usize, BTreeSet<usize>>>,
    names: HashSet<String>,
    /// The case of each recording, by the hash of the recording.
    recordings: HashMap<String, String>,
}

impl Overlap {
    /// Adds the cases of `part`. Returns the reason if it contains a case of an earlier part: the same draw with overlapping shards, a name, or a recording.
    pub fn add(&mut self, part: &Part) -> Option<String> {
        let shards = part.draw.as_ref().and_then(|draw| self.add_shard(draw));
        let name = part.sealed.keys().find(|name| self.names.contains(*name));
        let name = name.map(|name| format!("case {name} is in two receipts"));
        let twins = recorded(part).find_map(|(hash, name)| Some((name, self.recordings.get(hash)?)));
        let twins = twins.map(|(name, twin)| format!("cases {name} and {twin} are one recording"));
        self.names.extend(part.sealed.keys().cloned());
        self.recordings.extend(recorded(part).map(|(hash, name)| (hash.to_owned(), name.clone())));
        shards.or(name).or(twins)
    }

    /// Adds the shard of `draw`; returns the earlier one of the same draw that overlaps with it, in words.
    fn add_shard(&mut self, draw: &Draw) -> Option<String> {
        let [shard, count] = draw.shard;
        let of_draw = self
            .shards
            .entry(json!([draw.seed, draw.quota, draw.matrix, draw.generator]).to_string())
            .or_default();
        // Shards i of n and j of m share a case if i and j have the same remainder modulo the greatest common divisor of n and m.
        let earlier = of_draw.iter().find_map(|(other_count, others)| {
            let step = divisor(count, *other_count).max(1);
            let meets = |other: &&usize| *other % step == shard % step;
            // Among shards of the same count, only identical ones overlap.
            let other = match count == *other_count {
                true => others.get(&shard),
                false => others.iter().find(meets),
            };
            other.map(|other| (*other, *other_count))
        });
        of_draw.entry(count).or_default().insert(shard);
        earlier.map(|(other, other_count)| {
            format!(
                "shard {shard} of {count} and shard {other} of {other_count} of seed {} hold the same cases",
                draw.seed
            )
        })
    }
}

fn divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { divisor(b, a % b) }
}

/// The first recording of each case by its hash.
pub fn recorded(part: &Part) -> impl Iterator<Item = (&str, &String)> {
    part.sealed.iter().filter_map(|(name, files)| Some((files.get(FILES[1])?.sha256.as_str(), name)))
}

#[cfg(test)]
mod tests {
    use freeplay_concealed::Quota;

    use super::Overlap;
    use crate::blind::receipt::Draw;

    fn draw(seed: u64, shard: [usize; 2]) -> Draw {
        Draw {
            seed,
            seed_from: String::new(),
            names: String::new(),
            quota: Quota::small(40),
            shard,
            matrix: None,
            generator: None,
        }
    }

    /// The shards "every second case" and "every fourth case" overlap if they begin alike; other seeds have other cases.
    #[test]
    fn shards_that_are_cut_otherwise_overlap_where_their_cases_meet() {
        let mut overlap = Overlap::default();
        assert_eq!(overlap.add_shard(&draw(1, [1, 2])), None);
        assert_eq!(overlap.add_shard(&draw(1, [2, 4])), None);
        assert!(overlap.add_shard(&draw(1, [3, 4])).is_some_and(|why| why.contains("shard 1 of 2")));
        assert!(overlap.add_shard(&draw(1, [2, 4])).is_some_and(|why| why.contains("same cases")));
        assert_eq!(overlap.add_shard(&draw(2, [3, 4])), None);
        assert!(overlap.add_shard(&draw(2, [1, 3])).is_some(), "3 of 4 and 1 of 3 have a case in common");
    }
}
