//! A bench in words, for the terminal.

use std::path::Path;

use comfy_table::{CellAlignment, Table};
use freeplay_terminal::layout::text_table;
use freeplay_terminal::styles::judgement;
use hdrhistogram::Histogram;

use crate::bench::bench_report::{Report, STAGES, causes_alone};
use crate::bench::figures::{QUANTILES, Ratio};
use crate::bench::verdicts::YardstickComparison;

impl Report<'_> {
    /// The text for the terminal.
    pub fn in_words(&self, out: &Path) -> String {
        let mut table = text_table();
        let quantiles = QUANTILES.map(|(name, _)| name);
        table.set_header(["stage [µs]", "", quantiles[0], quantiles[1], quantiles[2], "max", "count"]);
        let measured = self.measured();
        for (stage, title) in STAGES {
            for (name, stages) in &measured {
                let Some(histogram) = stages.get(stage) else { continue };
                table.add_row(row(title, name, histogram));
            }
        }
        for column in 2..7 {
            if let Some(column) = table.column_mut(column) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        let realtime = &self.scenario.realtime;
        let core =
            |cpu: Option<usize>| cpu.map_or_else(|| "any core".to_owned(), |cpu| format!("core {cpu}"));
        let mut text = format!(
            "{} blocks of {} ticks each in turn, {} Hz, plant on {}, controller on {}\n\n{table}\n\n{}\n\n",
            self.blocks.len(),
            self.scenario.duration.unwrap_or(0.0) * self.scenario.rate,
            self.scenario.rate,
            core(realtime.plant_cpu),
            core(realtime.controller_cpu),
            self.ratio_table(),
        );
        for contest in self.contests {
            text += &format!(
                "{}: {} of {} ticks caught up after stalls; the bare loop caught up {}\n",
                contest.controller, contest.caught_up, contest.ticks, contest.bare_caught_up
            );
        }
        for contest in self.contests.iter().filter(|contest| contest.missed > 0) {
            text += &format!("{}: {}\n", contest.controller, causes(contest));
        }
        for contest in self.contests {
            text += &self.cliff_words(&contest.controller).map_or(String::new(), |words| words + "\n");
        }
        for (holds, words) in self.verdict_lines() {
            text += &format!("{} {words}\n", judgement(holds));
        }
        let machine = self.machine["doctor"]["verdict"]["words"].as_str().unwrap_or("?");
        text + &format!(
            "this machine: {machine} (see freeplay doctor)\n\nreport      {}\nlatencies   {}/*.hlog, *.hgrm\n",
            out.join("report.html").display(),
            out.display()
        )
    }

    fn ratio_table(&self) -> Table {
        let mut table = text_table();
        table.set_header(["of the yardstick", "", "p50 [blocks]", "p99 [blocks]", "p99.9 [blocks]"]);
        for contest in self.contests {
            for (what, ratios) in contest.compared() {
                let [p50, p99, p999] = ratios.map(in_words);
                table.add_row([what.to_owned(), contest.controller.clone(), p50, p99, p999]);
            }
        }
        table
    }
}

fn row(title: &str, name: &str, histogram: &Histogram<u64>) -> [String; 7] {
    let us = |ns: u64| format!("{:.2}", ns as f64 * 1e-3);
    let [p50, p99, p999] = QUANTILES.map(|(_, quantile)| us(histogram.value_at_quantile(quantile)));
    [title.to_owned(), name.to_owned(), p50, p99, p999, us(histogram.max()), histogram.len().to_string()]
}

fn in_words(ratio: Option<Ratio>) -> String {
    ratio.map_or_else(
        || "–".to_owned(),
        |ratio| {
            format!("{:.3} [{:.2} … {:.2} … {:.2}]", ratio.all, ratio.least, ratio.median, ratio.greatest)
        },
    )
}

fn causes(contest: &YardstickComparison) -> String {
    format!("{} of {} deadlines missed: {}", contest.missed, contest.ticks, causes_alone(contest))
}
