//! Result of a training as text for a terminal.

use std::fmt::Write as _;

use comfy_table::{CellAlignment, Table, presets};

use crate::trained::Trained;

/// The table of all tried predictors, and the result of the proof.
pub fn text(trained: &Trained) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(["on held-out paths, without a tracker", "left x", "y", "z [µm]", "R x", "y", "z"]);
    for tried in &trained.tried {
        let mut row = vec![tried.name.clone()];
        row.extend(tried.left.map(|left| format!("{:.1}", left * 1e6)));
        row.extend(tried.r.map(|r| r.map_or_else(|| "–".to_owned(), |r| format!("{r:.3}"))));
        table.add_row(row);
    }
    for column in 1..7 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let mut text = format!(
        "{table}\n\nleft: RMS of the tool's deviation minus its prediction; R: correlation of the predicted deviation\nwith the measured one, 1 at \
         best. Weights predicted each path that it did not train. The first rows are baselines.\n\nchosen   {}\n",
        trained.structure
    );
    for (name, axis) in ["x", "y", "z"].iter().zip(&trained.file.learned.axes) {
        let _ = writeln!(
            text,
            "axis {name}   {:.1} → {:.1} µm within the trained region, share {:.2}, answers from {:.1} to {:.1} µm",
            axis.rms_um,
            axis.left_um,
            axis.share,
            axis.lowest * 1e6,
            axis.highest * 1e6
        );
    }
    for run in &trained.receipt.runs {
        let _ = writeln!(
            text,
            "run      along {}: {:.4} → {:.4} mm, with weights that it did not train",
            run.name, run.without_mm, run.with_mm
        );
    }
    if !trained.receipt.runs.is_empty() {
        let _ = writeln!(
            text,
            "chance   {:.3} % probability of runs as good by chance alone",
            1e2 * trained.receipt.chance
        );
    }
    let _ = writeln!(text, "{}", trained.verdict_in_words());
    text
}
