//! The table of the outcomes, for a terminal.

use std::fmt::Write as _;

use freeplay_terminal::layout::text_table;

use super::outcome::{METHODS, Outcome};

/// The table of `outcomes`.
pub fn text(outcomes: &[Outcome]) -> String {
    let mut table = text_table();
    let header = ["machine", "path"].into_iter().chain(METHODS).chain(["removed", ""]);
    table.set_header(header.collect::<Vec<_>>());
    for outcome in outcomes {
        for (number, cell) in outcome.cells.iter().enumerate() {
            let mut row =
                vec![if number == 0 { outcome.machine.as_str() } else { "" }.to_owned(), cell.path.clone()];
            row.extend(cell.reached.iter().map(|reached| {
                reached.map_or_else(|| "–".to_owned(), |r| format!("{:.4} / {:.3}", r.rms, r.max))
            }));
            row.push(cell.taken().map_or_else(|| "–".to_owned(), |taken| format!("{:.0} %", 1e2 * taken)));
            row.push(if cell.holds() { "best" } else { "NOT BEST" }.to_owned());
            table.add_row(row);
        }
    }
    let mut text = format!("{table}\n\n");
    for outcome in outcomes {
        let named = if outcome.named.is_empty() { "nothing".to_owned() } else { outcome.named.join(", ") };
        let proved = |proved: bool| if proved { "proved" } else { "not proved, not used" };
        let _ = writeln!(
            text,
            "{}: {}; verdict {}, named {named}; network on the nominal model {}, on the diagnosed one {}",
            outcome.machine,
            outcome.hidden,
            outcome.verdict,
            proved(outcome.proved[0]),
            proved(outcome.proved[1])
        );
        if outcome.is_nominal {
            text.push_str(
                "    the held-out paths do not show a smaller remainder with the diagnosed model: the last column uses the nominal one\n",
            );
        }
        if let [Some(without), Some(with)] = outcome.far {
            let _ = writeln!(
                text,
                "    far outside the training: {:.4} / {:.3} without, {:.4} / {:.3} with the network",
                without.rms, without.max, with.rms, with.max
            );
        }
        for check in outcome.checks().iter().filter(|check| !check.holds) {
            let _ = writeln!(text, "    FAILS: {}", check.what);
        }
    }
    text.push_str(
        "\ndeviation of the tool after the first 0.5 s, RMS / greatest, mm, on paths and periods outside the training, without a tracker\nremoved: \
         share of the diagnosed model's remainder that the network removes\n",
    );
    text
}
