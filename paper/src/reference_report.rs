//! The report of `freeplay reference-runs`.

use std::path::{Path, PathBuf};

use freeplay_report::{Cell, Column, Document, Section, Table, Verdict};
use freeplay_terminal::exit::Failure;

use crate::reference_pair::Pair;

/// Writes `report.html` into `folder`; returns its path.
///
/// # Errors
/// A folder or file that can't be written.
pub fn write(pairs: &[Pair], substeps: u32, folder: &Path) -> Result<PathBuf, Failure> {
    freeplay_terminal::files::make_folder(folder)?;
    let passed = pairs.iter().filter(|pair| pair.faults.is_empty()).count();
    let words = format!("{passed} of {} runs agree with the reference within tolerance", pairs.len());
    let document = Document::new("Reference runs of the paper's arm")
        .subtitle(format!("an independent simulator (semi-implicit Euler, 10 µs) beside this one ({substeps} sub-steps a tick)"))
        .overview((Verdict::passed(passed == pairs.len()), words))
        .overview("Tolerances: contact fractions 0.5 points; RMS of the deviation 1 % on smooth paths, 5 % on sharp ones; peak normal force 2 % on smooth paths; peak force of joint 1 2 %. At sharp corners in 6 s a run is chaotic: where one start is out of tolerance, the reference must lie within tolerance of the spread over clearances within 0.002 %.")
        .section(Section::new("Contact").with(contact(pairs)))
        .section(Section::new("Deviation").with(deviation(pairs)))
        .footer(format!("freeplay {}", env!("CARGO_PKG_VERSION")));
    let path = folder.join("report.html");
    freeplay_terminal::files::write(&path, &document.to_html())?;
    Ok(path)
}

fn judged(pair: &Pair) -> Cell {
    Cell::from(pair.run.as_str()).judged(Verdict::passed(pair.faults.is_empty()))
}

fn number(value: Option<f64>, scale: f64) -> Cell {
    value.map_or(Cell::from(f64::NAN), |value| Cell::from(value * scale))
}

fn contact(pairs: &[Pair]) -> Table {
    let mut table = Table::new("Contact and peak forces").column(Column::text("run"));
    for (group, unit, digits) in [
        ("free flight", "%", 2),
        ("continuous", "%", 2),
        ("contacts", "", 0),
        ("peak normal force", "N", 0),
        ("peak force of joint 1", "N", 0),
    ] {
        for whose in ["reference", "ours"] {
            table = table.column(Column::number(whose, unit).fixed(digits).group(group));
        }
    }
    for pair in pairs {
        let (theirs, ours) = (&pair.theirs, &pair.ours);
        table = table.row([
            judged(pair),
            number(theirs.free, 100.0),
            number(ours.free, 100.0),
            number(theirs.continuous, 100.0),
            number(ours.continuous, 100.0),
            number(theirs.n_contacts, 1.0),
            number(ours.n_contacts, 1.0),
            number(theirs.peak_normal, 1.0),
            number(ours.peak_normal, 1.0),
            theirs.peak_base.into(),
            ours.peak_base.into(),
        ]);
    }
    table
}

fn deviation(pairs: &[Pair]) -> Table {
    let mut table = Table::new("Tool deviation").column(Column::text("run"));
    for group in ["rms x", "rms y", "rms z", "rms", "max"] {
        for whose in ["reference", "ours"] {
            table = table.column(Column::number(whose, "mm").fixed(4).group(group));
        }
    }
    table = table.column(Column::text("verdict"));
    for pair in pairs {
        let (theirs, ours) = (&pair.theirs, &pair.ours);
        let figures = [
            (theirs.rms_x, ours.rms_x),
            (theirs.rms_y, ours.rms_y),
            (theirs.rms_z, ours.rms_z),
            (theirs.norm_rms, ours.norm_rms),
            (theirs.norm_max, ours.norm_max),
        ];
        let cells = figures.into_iter().flat_map(|(theirs, ours)| [Cell::from(theirs), Cell::from(ours)]);
        table = table.row(std::iter::once(judged(pair)).chain(cells).chain([Cell::from(pair.verdict())]));
    }
    table
}
