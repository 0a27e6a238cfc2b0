//! From blocks to figures: merged histograms, and ratios with their spread over the blocks.

use hdrhistogram::Histogram;
use serde::Serialize;

use crate::bench::blocks::{Block, ByStage};

/// The quantiles that are compared, with their names.
pub const QUANTILES: [(&str, f64); 3] = [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999)];

/// A ratio at one quantile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratio {
    /// All blocks together.
    pub all: f64,
    /// Median of the single blocks.
    pub median: f64,
    /// Confidence interval of that median at 95 %: order statistics of the blocks, which assume no distribution.
    pub bounds: [f64; 2],
    /// Least value of a block.
    pub least: f64,
    /// Greatest value of a block.
    pub greatest: f64,
}

/// Stages whose durations are added up and compared with those of a yardstick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compared {
    /// The wake-up of awaited ticks, compared with the bare loop's: the quality of wake-ups on this machine.
    WakeUp,
    /// Lateness against the schedule, ticks of catching up after a stall included: a loop with more work per tick takes longer to catch up.
    Lateness,
    /// Transport of state and command, compared with that of bare iceoryx2.
    Transport,
}

impl Compared {
    fn stages(self) -> &'static [&'static str] {
        match self {
            Self::WakeUp => &["wake_up_uncorrected"],
            Self::Lateness => &["wake_up"],
            Self::Transport => &["state_transport", "command_transport"],
        }
    }

    fn yardstick(self, block: &Block) -> &ByStage {
        match self {
            Self::WakeUp | Self::Lateness => &block.clock,
            Self::Transport => &block.exchange,
        }
    }

    /// The sum of its stages at `quantile`, ns; `None` if one was not measured.
    pub fn at(self, stages: &ByStage, quantile: f64) -> Option<f64> {
        let of = |name: &&str| Some(stages.get(*name)?.value_at_quantile(quantile) as f64);
        self.stages().iter().map(of).sum()
    }
}

/// Ticks that a loop did not wait for because they were due already.
pub fn caught_up(stages: &ByStage) -> u64 {
    let count = |name: &str| stages.get(name).map_or(0, Histogram::len);
    count("wake_up").saturating_sub(count("wake_up_uncorrected"))
}

/// All histograms of `parts` added up, stage by stage.
pub fn merged<'a>(parts: impl Iterator<Item = &'a ByStage>) -> ByStage {
    let mut sum = ByStage::new();
    parts.for_each(|part| add(&mut sum, part));
    sum
}

/// Adds the histograms of `part` to those of `sum`, stage by stage.
pub fn add(sum: &mut ByStage, part: &ByStage) {
    for (stage, histogram) in part {
        match sum.get_mut(stage) {
            // They all have the same bounds.
            Some(total) => drop(total.add(histogram)),
            None => drop(sum.insert(stage.clone(), histogram.clone())),
        }
    }
}

/// The ratio of the controller number `which` to its yardstick at each of [`QUANTILES`].
pub fn ratios(blocks: &[Block], which: usize, compared: Compared) -> [Option<Ratio>; 3] {
    let ours = merged(blocks.iter().map(|block| &block.full[which].1));
    let bare = merged(blocks.iter().map(|block| compared.yardstick(block)));
    QUANTILES.map(|(_, quantile)| {
        let at = |stages: &ByStage| compared.at(stages, quantile);
        let each = blocks.iter().map(|block| (at(&block.full[which].1), at(compared.yardstick(block))));
        Ratio::of((at(&ours), at(&bare)), each)
    })
}

impl Ratio {
    /// Ratio of the first to the second of each pair (ours, yardstick), for `all` blocks together and for `each` block.
    pub fn of(
        all: (Option<f64>, Option<f64>),
        each: impl Iterator<Item = (Option<f64>, Option<f64>)>,
    ) -> Option<Self> {
        let ratio = |(ours, bare): (Option<f64>, Option<f64>)| {
            let bare = bare.filter(|&bare| bare > 0.0)?;
            Some(ours? / bare)
        };
        let mut each: Vec<f64> = each.filter_map(ratio).collect();
        each.sort_by(f64::total_cmp);
        Some(Self {
            all: ratio(all)?,
            median: *each.get(each.len() / 2)?,
            bounds: median_bounds(&each)?,
            least: *each.first()?,
            greatest: *each.last()?,
        })
    }
}

/// Confidence interval of the median from a `sorted` sample, at 95 % (sign test, normal approximation of the binomial).
fn median_bounds(sorted: &[f64]) -> Option<[f64; 2]> {
    let count = sorted.len() as f64;
    let reach = 0.98 * count.sqrt();
    let least = (0.5 * count - reach).floor().max(0.0) as usize;
    let greatest = (0.5 * count + reach).ceil().min(count - 1.0) as usize;
    Some([*sorted.get(least)?, *sorted.get(greatest)?])
}

/// Points of a percentile curve, (quantile, µs), up to the resolution of the number of values.
pub fn curve(histogram: &Histogram<u64>) -> (Vec<f64>, Vec<f64>) {
    let most = 1.0 - 1.0 / histogram.len().max(1) as f64;
    let quantiles = (0..=144).map(|step| 1.0 - 10f64.powf(-f64::from(step) / 24.0));
    let x: Vec<f64> = quantiles.filter(|&quantile| quantile <= most).collect();
    let y = x.iter().map(|&quantile| histogram.value_at_quantile(quantile) as f64 * 1e-3).collect();
    (x, y)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::{ByStage, Compared, caught_up, curve, median_bounds, merged};
    use hdrhistogram::Histogram;

    fn stages(of: &[(&str, u64)]) -> ByStage {
        let one = |value: u64| {
            let mut histogram = Histogram::new_with_bounds(1, 1_000_000_000, 3).unwrap();
            histogram.record_n(value, 100).unwrap();
            histogram
        };
        of.iter().map(|&(stage, value)| (stage.to_owned(), one(value))).collect()
    }

    #[test]
    fn the_ways_of_state_and_command_are_added_up() {
        let one = stages(&[("state_transport", 1000), ("command_transport", 500), ("wake_up", 60)]);
        assert_eq!(Compared::Transport.at(&one, 0.5), Some(1500.0));
        assert_eq!(Compared::Lateness.at(&one, 0.99), Some(60.0));
        assert_eq!((Compared::WakeUp.at(&one, 0.99), caught_up(&one)), (None, 100));
        assert_eq!(Compared::Transport.at(&stages(&[("state_transport", 1000)]), 0.5), None);
    }

    #[test]
    fn histograms_are_added_stage_by_stage() {
        let parts = [stages(&[("wake_up", 10)]), stages(&[("wake_up", 1000), ("compute", 7)])];
        let sum = merged(parts.iter());
        assert_eq!((sum["wake_up"].len(), sum["compute"].len()), (200, 100));
        assert_eq!([0.5, 0.99].map(|quantile| sum["wake_up"].value_at_quantile(quantile)), [10, 1000]);
    }

    #[test]
    fn the_bounds_of_a_median_are_those_of_the_sign_test() {
        let hundred: Vec<f64> = (1..=100).map(f64::from).collect();
        // Conover (1999), section 3.2: the 40th and the 61st of a hundred values enclose the median at 95 %; the rounding here is outwards.
        let [least, greatest] = median_bounds(&hundred).unwrap();
        assert!((40.0..=41.0).contains(&least) && (60.0..=61.0).contains(&greatest), "{least} {greatest}");
        assert_eq!(median_bounds(&hundred[..3]), Some([1.0, 3.0]));
        assert_eq!(median_bounds(&[]), None);
    }

    #[test]
    fn a_curve_ends_where_the_values_do() {
        let (x, y) = curve(&stages(&[("wake_up", 2000)])["wake_up"]);
        assert_eq!((x[0], y[0]), (0.0, 2.0));
        assert!(x.last().is_some_and(|&last| last <= 0.99 && last > 0.98), "a hundred values");
    }
}
