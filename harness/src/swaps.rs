//! Planned swaps: converts the names and times of a scenario to slots and ticks.

use std::path::Path;
use std::sync::Arc;

use freeplay_plant::{Comparison, ControllerSet, PlannedSwap, ReferenceDivergence};
use freeplay_shm::MAX_JOINTS;
use freeplay_terminal::exit::Failure;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::columns;
use crate::scenario::Scenario;
use crate::swap_tables::CompareTable;

/// First tick of a random swap; before it, no command can be in force.
const FIRST_TICK: u64 = 2;

impl CompareTable {
    /// The comparison of `controllers` controllers.
    fn comparison(&self, controllers: usize) -> Result<Comparison, Failure> {
        if let Some(bad) = self.tolerance.iter().find(|value| value.is_nan() || **value < 0.0) {
            return Err(Failure::input(format!(
                "scenario: compare.tolerance = {bad} is out of range; it must be at least 0"
            )));
        }
        let mut tolerance = [f64::INFINITY; MAX_JOINTS];
        tolerance.iter_mut().zip(&self.tolerance).for_each(|(to, from)| *to = *from);
        let divergence = self.sound.as_deref().map(|file| usual_of(file, controllers)).transpose()?;
        Ok(Comparison { tolerance, ticks: self.ticks, divergence: divergence.map(Arc::new) })
    }
}

/// The differences between the `controllers` controllers of the sound run recorded in `file`.
fn usual_of(file: &Path, controllers: usize) -> Result<ReferenceDivergence, Failure> {
    let recording = freeplay_recording::read(file, None).map_err(Failure::input)?;
    columns::reference_divergence(&recording).filter(|usual| usual.slots() == controllers).ok_or_else(|| {
        Failure::input(format!(
            "scenario: compare.sound = {} is not a recording of a run with {controllers} controllers; give one that `freeplay run` made with the same controllers and standbys, in the same order",
            file.display()
        ))
    })
}

/// The names of a run's controllers by slot, the initially active one first; if several have one name, the second is `name#2`.
pub fn names(first: &str, standby: &[String]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for asked in std::iter::once(first).chain(standby.iter().map(String::as_str)) {
        let plain = Path::new(asked)
            .file_name()
            .map_or_else(|| asked.to_owned(), |name| name.to_string_lossy().into_owned());
        let same = names.iter().filter(|name| name.split('#').next() == Some(&plain)).count();
        names.push(if same == 0 { plain } else { format!("{plain}#{}", same + 1) });
    }
    names
}

/// The controllers of `scenario` with the names `names`, and their swaps over `ticks` ticks of `period` s.
///
/// # Errors
/// A swap to an unknown controller, after the end, or without a standby; more controllers than slots.
pub fn controller_set(
    scenario: &Scenario,
    names: &[String],
    ticks: u64,
    period: f64,
) -> Result<ControllerSet, Failure> {
    let bad = |message: String| Err(Failure::input(format!("scenario: {message}")));
    if names.len() > freeplay_shm::MAX_SLOTS {
        return bad(format!(
            "{} controllers at once; a run takes at most {}",
            names.len(),
            freeplay_shm::MAX_SLOTS
        ));
    }
    let blend = (scenario.swap_blend / period).round() as u32;
    let mut swaps = Vec::with_capacity(scenario.swap.len() + scenario.random_swaps as usize);
    for swap in &scenario.swap {
        let Some(to) = names.iter().position(|name| *name == swap.to) else {
            return bad(format!(
                "swap to {:?}: this run has {}; name others in standby",
                swap.to,
                names.join(", ")
            ));
        };
        if swap.tick >= ticks {
            return bad(format!("swap at tick {}: the run has {ticks} ticks", swap.tick));
        }
        swaps.push(PlannedSwap { tick: swap.tick, to });
    }
    if scenario.random_swaps > 0 {
        let (count, apart) = (u64::from(scenario.random_swaps), u64::from(blend.max(1)));
        if names.len() < 2 || ticks < FIRST_TICK + count * apart + 1 {
            return bad(format!(
                "random_swaps = {count} needs a standby, and {apart} ticks (the length of a blend) for each swap; the run has {} controllers and \
                 {ticks} ticks",
                names.len()
            ));
        }
        swaps.extend(random(scenario.seed, scenario.random_swaps, names.len(), ticks, apart));
    }
    swaps.sort_by_key(|swap| swap.tick);
    let comparison = scenario.compare.as_ref().map(|compare| compare.comparison(names.len())).transpose()?;
    if let Some(bad) = scenario.swap_change.iter().flatten().find(|value| value.is_nan() || **value < 0.0) {
        return Err(Failure::input(format!(
            "scenario: swap_change = {bad} is out of range; it must be at least 0"
        )));
    }
    let hand_over_change = scenario.swap_change.as_ref().map(|given| {
        let mut most = [f64::INFINITY; MAX_JOINTS];
        most.iter_mut().zip(given).for_each(|(to, from)| *to = *from);
        most
    });
    Ok(ControllerSet { controllers: names.len(), swaps, blend, hand_over_change, comparison })
}

/// `count` swaps at random ticks at least `apart` apart, each to another controller than the one before.
fn random(seed: u64, count: u32, slots: usize, ticks: u64, apart: u64) -> Vec<PlannedSwap> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let free = ticks - u64::from(count) * apart;
    let mut at: Vec<u64> = (0..count).map(|_| random.random_range(FIRST_TICK..free)).collect();
    at.sort_unstable();
    at.iter_mut().zip(0..).for_each(|(tick, before)| *tick += before * apart);
    let mut in_charge = 0;
    let swap = |tick| {
        in_charge = (in_charge + random.random_range(1..slots)) % slots;
        PlannedSwap { tick, to: in_charge }
    };
    at.into_iter().map(swap).collect()
}

#[cfg(test)]
mod tests {
    use super::{controller_set, names};
    use crate::scenario::Scenario;
    use crate::swap_tables::SwapTable;

    #[test]
    fn controllers_of_one_name_are_told_apart() {
        let standby = ["./bin/mine", "quasi-static", "other/mine"].map(str::to_owned);
        assert_eq!(names("quasi-static", &standby), ["quasi-static", "mine", "quasi-static#2", "mine#2"]);
    }

    #[test]
    fn random_swaps_repeat_with_their_seed_and_always_change_something() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let of = |seed| {
            let scenario = Scenario { seed, random_swaps: 500, swap_blend: 0.01, ..Scenario::default() };
            controller_set(&scenario, &names, 6000, 1e-3).unwrap().swaps
        };
        let swaps = of(7);
        assert_eq!((swaps.len(), &swaps), (500, &of(7)));
        assert_ne!(swaps, of(8));
        assert!(swaps.windows(2).all(|pair| pair[0].tick < pair[1].tick && pair[0].to != pair[1].to));
        assert!(swaps[0].to != 0 && (0..3).all(|slot| swaps.iter().any(|swap| swap.to == slot)));
    }

    #[test]
    fn a_swap_to_nobody_is_told() {
        let mut scenario = Scenario { random_swaps: 1, ..Scenario::default() };
        let alone = ["a".to_owned()];
        assert!(
            controller_set(&scenario, &alone, 6000, 1e-3).unwrap_err().message.contains("needs a standby")
        );
        scenario.random_swaps = 0;
        scenario.swap = vec![SwapTable { tick: 3, to: "b".into() }];
        assert!(
            controller_set(&scenario, &alone, 6000, 1e-3).unwrap_err().message.contains("this run has a")
        );
    }
}
