//! Cost of recording and of the live view for the loop. Plain blocks, further plain blocks as a control, recorded blocks and watched blocks alternate; the
//! module compares their stages with those of the first.

use std::collections::BTreeMap;

use comfy_table::CellAlignment;
use freeplay_harness::scenario::RecordingKind;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::write;
use freeplay_terminal::layout::text_table;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::progress;
use hdrhistogram::Histogram;
use serde::Serialize;
use serde_json::json;

use crate::bench::bench_report::STAGES;
use crate::bench::blocks::{ByStage, Stand};
use crate::bench::figures::{QUANTILES, Ratio, add};

/// The schema of `cost.json`.
const SCHEMA: &str = "freeplay.cost/1";
/// Largest permitted ratio of the p99 of a stage to that without recording or live view.
const MOST: f64 = 1.05;

/// Results of the blocks of one kind: their summed histograms, and of each block only the quantiles, since histograms are large.
#[derive(Default)]
struct Measured {
    all: ByStage,
    each: Vec<BTreeMap<String, [f64; QUANTILES.len()]>>,
}

impl Measured {
    fn push(&mut self, block: &ByStage) {
        add(&mut self.all, block);
        self.each
            .push(block.iter().map(|(stage, histogram)| (stage.clone(), quantiles(histogram))).collect());
    }

    /// The quantile number `which` of `stage` over all blocks, ns.
    fn stage_quantile(&self, stage: &str, which: usize) -> Option<f64> {
        self.all.get(stage).map(|histogram| quantiles(histogram)[which])
    }

    /// The same of each block.
    fn block_quantiles(&self, stage: &str, which: usize) -> impl Iterator<Item = Option<f64>> {
        self.each.iter().map(move |block| block.get(stage).map(|quantiles| quantiles[which]))
    }
}

fn quantiles(histogram: &Histogram<u64>) -> [f64; QUANTILES.len()] {
    QUANTILES.map(|(_, quantile)| histogram.value_at_quantile(quantile) as f64)
}

/// Number of kinds of blocks.
const KINDS: usize = 4;

/// Kind of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum BlockKind {
    /// Neither recording nor live view.
    Plain,
    /// Neither, too: the control shows the ratios that chance alone causes.
    Control,
    /// With an MCAP recording.
    Recorded,
    /// With the live view of a terminal.
    Watched,
}

impl BlockKind {
    const ALL: [Self; KINDS] = [Self::Plain, Self::Control, Self::Recorded, Self::Watched];

    fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Control => "plain again",
            Self::Recorded => "recorded",
            Self::Watched => "watched",
        }
    }
}

/// One stage: ratio with recording or live view to without.
#[derive(Debug, Serialize)]
struct Cost {
    stage: &'static str,
    looking: BlockKind,
    /// At p50, p99 and p99.9.
    ratios: [Option<Ratio>; 3],
    /// Verdict on the limit of p99.
    verdict: LimitVerdict,
}

/// Verdict of the blocks on a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum LimitVerdict {
    /// Their median is within the limit at 95 %.
    Holds,
    /// The limit lies within the confidence interval of their median: more blocks or a quieter machine could decide.
    Open,
    /// Their median is beyond the limit at 95 %.
    Fails,
}

impl LimitVerdict {
    fn of(ratio: Option<Ratio>) -> Self {
        match ratio {
            Some(ratio) if ratio.bounds[0] > MOST => Self::Fails,
            Some(ratio) if ratio.bounds[1] > MOST => Self::Open,
            Some(_) | None => Self::Holds,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Open => "open",
            Self::Fails => "FAILS",
        }
    }
}

/// Measures on `stand` with its first controller in `pairs` blocks of each kind, and prints the results.
///
/// # Errors
/// A run that fails; results that can't be written.
pub fn cost(stand: &Stand, pairs: usize, format: Format) -> Result<Exit, Failure> {
    let contestant = stand.contestants.first().ok_or_else(|| Failure::usage("no controller"))?;
    let bar = progress::bar(pairs as u64, "{msg} {wide_bar} {pos}/{len} {elapsed}").with_message("blocks");
    let mut measured: [Measured; KINDS] = Default::default();
    for number in 0..pairs {
        let mut order = BlockKind::ALL;
        order.rotate_left(number % BlockKind::ALL.len());
        for looking in order {
            let mut scenario = stand.scenario.clone();
            if looking == BlockKind::Recorded {
                scenario.recording = RecordingKind::Mcap;
            }
            let played = match looking {
                BlockKind::Watched => stand.watched(contestant, &scenario)?,
                BlockKind::Plain | BlockKind::Control | BlockKind::Recorded => {
                    stand.full(contestant, &scenario)?
                }
            };
            let Some((_, stages)) = played else { return Ok(Exit::Interrupted) };
            measured[looking as usize].push(&stages);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let costs = costs(&measured);
    let told = |word: LimitVerdict| {
        costs.iter().any(|cost| cost.looking != BlockKind::Control && cost.verdict == word)
    };
    let verdict = [LimitVerdict::Fails, LimitVerdict::Open]
        .into_iter()
        .find(|&word| told(word))
        .unwrap_or(LimitVerdict::Holds);
    let text = json!({
        "schema": SCHEMA, "freeplay": env!("CARGO_PKG_VERSION"), "scenario": stand.scenario,
        "controller": contestant.asked(), "blocks": pairs, "limit_p99": MOST, "verdict": verdict, "costs": costs,
    });
    let text = serde_json::to_string_pretty(&text).map_err(Failure::internal)?;
    write(&stand.out.join("cost.json"), &text)?;
    match format {
        Format::Json => say(&format!("{text}\n"))?,
        Format::Text => show(&in_words(&costs, verdict, pairs, contestant.asked()))?,
    }
    Ok(if verdict == LimitVerdict::Fails { Exit::Verdict } else { Exit::Done })
}

fn costs(measured: &[Measured; KINDS]) -> Vec<Cost> {
    let plain = &measured[BlockKind::Plain as usize];
    let mut costs = Vec::new();
    for looking in [BlockKind::Control, BlockKind::Recorded, BlockKind::Watched] {
        let with = &measured[looking as usize];
        for (stage, _) in STAGES {
            let ratios = [0, 1, 2].map(|which| {
                let each = with.block_quantiles(stage, which).zip(plain.block_quantiles(stage, which));
                Ratio::of((with.stage_quantile(stage, which), plain.stage_quantile(stage, which)), each)
            });
            if ratios.iter().any(Option::is_some) {
                costs.push(Cost { stage, looking, ratios, verdict: LimitVerdict::of(ratios[1]) });
            }
        }
    }
    costs
}

fn in_words(costs: &[Cost], verdict: LimitVerdict, pairs: usize, controller: &str) -> String {
    let mut table = text_table();
    table.set_header(["stage", "over plain", "p50", "p99", "p99, 95 % of the median", "p99.9", ""]);
    for cost in costs {
        let title =
            STAGES.iter().find(|(name, _)| *name == cost.stage).map_or(cost.stage, |(_, title)| title);
        let [p50, p99, p999] = cost
            .ratios
            .map(|ratio| ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{:.3}", ratio.median)));
        let bounds = cost.ratios[1]
            .map_or_else(String::new, |Ratio { bounds: [least, greatest], .. }| {
                format!("{least:.3} … {greatest:.3}")
            });
        let word = if cost.looking == BlockKind::Control { "" } else { cost.verdict.name() };
        let looking = cost.looking.name().to_owned();
        table.add_row([title.to_owned(), looking, p50, p99, bounds, p999, word.to_owned()]);
    }
    for column in 2..6 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let remark = match verdict {
        LimitVerdict::Holds => "",
        LimitVerdict::Open => {
            ": undecided where the bounds include the limit; use a quieter machine or more --pairs and --ticks"
        }
        LimitVerdict::Fails => ": a stage fails if both bounds of the median exceed the limit",
    };
    format!(
        "{controller}, {pairs} blocks of each kind in turn; medians of the blocks' ratios\n\n{table}\n\n\
         {:<7} recording and the live view: p99 of each stage at most {MOST} of that without{remark}\n",
        verdict.name()
    )
}
