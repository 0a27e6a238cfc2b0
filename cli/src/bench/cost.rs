//! What looking on costs the loop: blocks that are neither recorded nor watched, more of the same as a control, blocks that are recorded and
//! blocks that are watched take turns, and their stages are set against those of the first.

use comfy_table::{CellAlignment, Table, presets};
use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::json;

use crate::bench::bench_report::STAGES;
use crate::bench::blocks::{ByStage, Stand};
use crate::bench::figures::{QUANTILES, Ratio, merged};
use crate::exit::{Exit, Failure};
use crate::files::write;
use crate::run::Format;
use crate::say::say;
use crate::scenario::RecordingKind;

/// The schema of `cost.json`.
const SCHEMA: &str = "freeplay.cost/1";
/// What the p99 of a stage may be of the same without recording or live view.
const MOST: f64 = 1.05;

/// Ways to look on.
const KINDS: usize = 4;

/// A way to look on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Looking {
    /// Nobody does.
    Plain,
    /// Nobody does either: what chance alone makes of the ratios.
    Control,
    /// An MCAP recording is written.
    Recorded,
    /// The live view of a terminal is drawn.
    Watched,
}

impl Looking {
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

/// One stage, with somebody looking on over without.
#[derive(Debug, Serialize)]
struct Cost {
    stage: &'static str,
    looking: Looking,
    /// At p50, p99 and p99.9.
    ratios: [Option<Ratio>; 3],
    /// Whether p99 is within its limit, the median of the blocks. Of the control: whether it says that this machine is quiet enough to tell.
    holds: bool,
}

/// Measures on `stand` with its first controller in `pairs` blocks of each kind, and says.
///
/// # Errors
/// A run that fails; results that can't be written.
pub fn cost(stand: &Stand, pairs: usize, format: Format, quiet: bool) -> Result<Exit, Failure> {
    let contestant = stand.contestants.first().ok_or_else(|| Failure::usage("no controller"))?;
    let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(pairs as u64) };
    let mut blocks: [Vec<ByStage>; KINDS] = Default::default();
    for number in 0..pairs {
        let mut order = Looking::ALL;
        order.rotate_left(number % Looking::ALL.len());
        for looking in order {
            let mut scenario = stand.scenario.clone();
            if looking == Looking::Recorded {
                scenario.recording = RecordingKind::Mcap;
            }
            let played = match looking {
                Looking::Watched => stand.watched(contestant, &scenario)?,
                Looking::Plain | Looking::Control | Looking::Recorded => stand.full(contestant, &scenario)?,
            };
            let Some((_, stages)) = played else { return Ok(Exit::Interrupted) };
            blocks[looking as usize].push(stages);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let costs = costs(&blocks);
    let holds = costs.iter().all(|cost| cost.holds || cost.looking == Looking::Control);
    let text = json!({
        "schema": SCHEMA, "freeplay": env!("CARGO_PKG_VERSION"), "scenario": stand.scenario,
        "controller": contestant.asked(), "blocks": pairs, "limit_p99": MOST, "holds": holds, "costs": costs,
    });
    let text = serde_json::to_string_pretty(&text).map_err(Failure::internal)?;
    write(&stand.out.join("cost.json"), &text)?;
    match format {
        Format::Json => say(&format!("{text}\n"))?,
        Format::Text => say(&in_words(&costs, holds, pairs, contestant.asked()))?,
    }
    Ok(if holds { Exit::Done } else { Exit::Verdict })
}

fn costs(blocks: &[Vec<ByStage>; KINDS]) -> Vec<Cost> {
    let sums = Looking::ALL.map(|looking| merged(blocks[looking as usize].iter()));
    let plain = Looking::Plain as usize;
    let mut costs = Vec::new();
    for looking in [Looking::Control, Looking::Recorded, Looking::Watched] {
        for (stage, _) in STAGES {
            let ratios = QUANTILES.map(|(_, quantile)| {
                let at = |stages: &ByStage| Some(stages.get(stage)?.value_at_quantile(quantile) as f64);
                let each = blocks[looking as usize].iter().zip(&blocks[plain]);
                Ratio::of(
                    (at(&sums[looking as usize]), at(&sums[plain])),
                    each.map(|(with, without)| (at(with), at(without))),
                )
            });
            if ratios.iter().any(Option::is_some) {
                let least = if looking == Looking::Control { 1.0 / MOST } else { 0.0 };
                let holds = ratios[1].is_none_or(|ratio| (least..=MOST).contains(&ratio.median));
                costs.push(Cost { stage, looking, ratios, holds });
            }
        }
    }
    costs
}

fn in_words(costs: &[Cost], holds: bool, pairs: usize, controller: &str) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(["stage", "over plain", "p50", "p99", "p99.9", ""]);
    for cost in costs {
        let title =
            STAGES.iter().find(|(name, _)| *name == cost.stage).map_or(cost.stage, |(_, title)| title);
        let [p50, p99, p999] = cost.ratios.map(|ratio| {
            ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{:.3} [{:.3}]", ratio.all, ratio.median))
        });
        let word = match (cost.holds, cost.looking) {
            (true, _) => "",
            (false, Looking::Control) => "noise",
            (false, _) => "FAILS",
        };
        table.add_row([title.to_owned(), cost.looking.name().to_owned(), p50, p99, p999, word.to_owned()]);
    }
    for column in 2..5 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let word = if holds { "holds  " } else { "FAILS  " };
    let noise = match costs.iter().all(|cost| cost.holds || cost.looking != Looking::Control) {
        true => "",
        false => {
            "\nnote    blocks of the same kind differ by more than that: nothing finer can be told here; quieter machine, more --ticks"
        }
    };
    format!(
        "{controller}, {pairs} blocks of each kind in turn; all blocks together, and the median of the blocks' own in brackets\n\n{table}\n\n\
         {word} recording and the live view: p99 of each stage, median of the blocks, at most {MOST} of that without{noise}\n"
    )
}
