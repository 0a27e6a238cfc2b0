//! The sections of the report on confusions between effects, and on their places.

use std::collections::{BTreeMap, BTreeSet};

use freeplay_concealed::{Matrix, Severity, seats};
use freeplay_report::{Axis, Block, Cell, Chart, Column, Drawing, Section, Series, Table};

use super::confidence_intervals::Share;
use super::confusion::Mistake;
use super::judged::{Judged, of_sort};
use super::order::place;
use super::receipt::Part;
use super::score::Outcome;
use super::tally::{Bin, Score, WHOLE_ARM};
use super::truth::Sort;

/// Number of places that the report lists for a confusion.
const PLACES: usize = 4;

pub fn count(of: usize) -> Cell {
    Cell::from(of as u64)
}

/// The confusion matrix as dots: concealed effects vertically, named effects horizontally.
pub fn confusion(score: &Score) -> Section {
    let concealed: Vec<&String> = score.confusion.keys().collect();
    let mut said: BTreeSet<&String> = score.confusion.values().flat_map(|row| row.keys()).collect();
    said.extend(&concealed);
    let (verdicts, kinds): (Vec<&String>, Vec<&String>) =
        said.into_iter().partition(|said| said.starts_with('('));
    let columns: Vec<&String> = kinds.into_iter().chain(verdicts).collect();
    let mut drawn: [(Vec<f64>, Vec<f64>); 3] = Default::default();
    let mut table = Table::new("Answers by concealed effect, cases of one effect")
        .column(Column::text("concealed"))
        .column(Column::number("of", "").fixed(0))
        .column(Column::number("right", "%").fixed(0))
        .column(Column::text("answered instead; in brackets answers without another kind").wrapping());
    for (row, kind) in concealed.iter().enumerate() {
        let counts = &score.confusion[*kind];
        let all: usize = counts.values().sum();
        let right = counts.get(*kind).copied().unwrap_or(0);
        let others: Vec<String> = counts
            .iter()
            .filter(|(said, _)| said != kind)
            .map(|(said, times)| format!("{times} {said}"))
            .collect();
        let share = 100.0 * right as f64 / all as f64;
        table = table.row([(*kind).as_str().into(), count(all), share.into(), others.join(", ").into()]);
        for (said, dots) in counts {
            let Some(column) = columns.iter().position(|other| *other == said) else { continue };
            let class = if said == *kind { 0 } else { 1 + usize::from(said.starts_with('(')) };
            // A square of dots for each cell, with one dot per case.
            let side = (*dots as f64).sqrt().ceil();
            for dot in 0..*dots {
                let (x, y) = (
                    (dot as f64 % side + 0.5) / side - 0.5,
                    ((dot as f64 / side).floor() + 0.5) / side - 0.5,
                );
                drawn[class].0.push((column + 1) as f64 + 0.8 * x);
                drawn[class].1.push((row + 1) as f64 + 0.8 * y);
            }
        }
    }
    let mut chart =
        Chart::xy("", Axis::new("answered, by number", ""), Axis::new("concealed, by number", ""))
            .height(560);
    for (name, (x, y)) in ["right", "another name", "no name"].into_iter().zip(&drawn) {
        if !x.is_empty() {
            chart = chart.series(Series::points(name, x, y));
        }
    }
    let numbers: Vec<String> =
        columns.iter().enumerate().map(|(k, name)| format!("{} {name}", k + 1)).collect();
    let rows: Vec<String> =
        concealed.iter().enumerate().map(|(k, name)| format!("{} {name}", k + 1)).collect();
    let caption = format!("One dot a case. Across: {}. Upwards: {}.", numbers.join(", "), rows.join(", "));
    let section = Section::new("Confusion").with(table).with(mistakes(&score.mistakes));
    if concealed.is_empty() {
        return section;
    }
    section.with(Drawing::new("Confusion matrix").caption(caption).panel(chart))
}

/// The table of all confusions and their known causes.
fn mistakes(mistakes: &[Mistake]) -> Table {
    let mut table = Table::new("Confusions and their causes")
        .column(Column::text("concealed"))
        .column(Column::text("said").wrapping())
        .column(Column::text("times"))
        .column(Column::number("signal", "floors").fixed(1))
        .column(Column::text("place and cause").wrapping());
    for mistake in mistakes {
        let mut places: Vec<String> =
            mistake.places.iter().take(PLACES).map(|(place, times)| format!("{times} {place}")).collect();
        if mistake.places.len() > PLACES {
            places.push(format!("{} other places", mistake.places.len() - PLACES));
        }
        let severities = Severity::ALL.iter().zip(mistake.severities).filter(|(_, times)| *times > 0);
        let times: Vec<String> =
            severities.map(|(severity, times)| format!("{times} {}", severity.name())).collect();
        table = table.row([
            mistake.concealed.as_str().into(),
            mistake.said.as_str().into(),
            times.join(", ").into(),
            mistake.signal_to_floor.into(),
            format!("{}: {}", places.join(", "), mistake.why()).into(),
        ]);
    }
    table.note(
        "Signal: median of the signal-to-floor ratios. Threshold: least evidence for a name, compared with that of the concealed kind at its joint on \
         its own. Below it, the recording is too weak. Above it, if another kind is stronger, the two kinds are alike there. The last part is the \
         catalogue's remark on their difference.",
    )
}

/// Success by machine and joint, and each place of a matrix.
pub fn places(parts: &[Part], judged: &[Judged], score: &Score) -> Section {
    let mut table = Table::new("Success by machine and joint, one effect")
        .column(Column::text("machine"))
        .column(Column::text("joint"))
        .column(Column::number("of", "").fixed(0))
        .column(Column::number("detected", "%").fixed(0))
        .column(Column::number("right", "%").fixed(0))
        .column(Column::number("right of detected", "%").fixed(0))
        .column(Column::number("from", "%").fixed(0).group("95 % interval"))
        .column(Column::number("to", "%").fixed(0).group("95 % interval"));
    for (machine, joints) in &score.by_joint {
        for (joint, bin) in joints {
            table = table.row(place_row(machine, joint, bin));
        }
    }
    let mut section = Section::new("Places").with(table);
    let mut shown = BTreeSet::new();
    for matrix in parts.iter().filter_map(|part| part.draw.as_ref()?.matrix.as_ref()) {
        // Shards sweep the same matrix.
        if shown.insert(format!("{matrix:?}")) {
            section = grids(section, matrix, parts, judged);
        }
    }
    section
}

fn place_row(machine: &str, joint: &str, bin: &Bin) -> [Cell; 8] {
    let of_detected = Share::new(bin.right.count, bin.detected.count);
    let percent = |x: f64| Cell::from(100.0 * x);
    let [low, high] = of_detected.ci95.map(percent);
    [
        machine.into(),
        joint.into(),
        count(bin.right.of),
        percent(bin.detected.value()),
        percent(bin.right.value()),
        percent(of_detected.value()),
        low,
        high,
    ]
}

/// One table per machine: kinds vertically, joints horizontally, three letters per place.
fn grids(section: Section, matrix: &Matrix, parts: &[Part], judged: &[Judged]) -> Section {
    let letters = letters(parts, judged);
    let missing = letters.values().filter(|letter| **letter == NOT_MADE).count();
    let all = matrix.quota().map_or(0, |quota| quota.single);
    let mut section = section
        .with(Block::Heading("Every place of the matrix".to_owned()))
        .with(format!(
            "{all} cases of one effect were asked for: every kind at every joint that it can sit on, slight, clear and strong in this order. \
             {missing} of them could not be made, for no strength makes the effect visible there or parts it from a simpler one; each \
             stands under \"Protocol\" with its reason."
        ))
        .with(Block::List(vec![
            "r right, x right with an invented effect, o one of several with the truth among them, u unknown, m missed, w wrong, f no answer"
                .to_owned(),
            format!("{NOT_MADE} could not be made, · not in these shards, blank: the kind cannot occur there"),
        ]));
    for machine in &matrix.machines {
        let Ok(arm) = machine.data_sheet() else { continue };
        let joints = arm.joints().iter().map(|joint| joint.name.as_str());
        let mut table = Table::new(machine.name()).column(Column::text("concealed"));
        table = joints.chain([WHOLE_ARM]).fold(table, |table, joint| table.column(Column::text(joint)));
        for kind in &matrix.kinds {
            let held = seats(kind, &arm);
            let cell = |seat: Option<usize>| {
                if !held.contains(&seat) {
                    return Cell::from("");
                }
                let joint = seat.map(|joint| arm.joints()[joint].name.as_str());
                let letter = |s: Severity| letters.get(&place(kind, joint, machine.name(), s.name()));
                let word = Severity::ALL.map(|s| letter(s).copied().unwrap_or('·'));
                Cell::from(word.iter().collect::<String>().as_str())
            };
            let seats = (0..arm.dof()).map(Some).chain([None]);
            table = table.row(std::iter::once(Cell::from(kind.as_str())).chain(seats.map(cell)));
        }
        section = section.with(table);
    }
    section
}

/// Letter for a place without a possible case.
const NOT_MADE: char = '–';

/// The outcome at each place of a matrix.
fn letters(parts: &[Part], judged: &[Judged]) -> BTreeMap<String, char> {
    let mut letters = BTreeMap::new();
    for case in of_sort(judged, Sort::Single) {
        let effect = &case.truth.effects[0];
        let place = place(&effect.kind, effect.joint.as_deref(), &case.truth.machine, &effect.severity);
        letters.insert(place, letter(case));
    }
    for part in parts.iter().filter(|part| part.draw.as_ref().is_some_and(|d| d.matrix.is_some())) {
        let asked = part.not_made.iter().filter_map(|what| what.split_once(": "));
        // A control that could not be made has no place.
        let places = asked.map(|(place, _)| place).filter(|place| place.contains(" on "));
        letters.extend(places.map(|place| (place.to_owned(), NOT_MADE)));
    }
    letters
}

fn letter(case: &Judged) -> char {
    match (case.outcome, case.answer.verdict.as_str()) {
        (Outcome::Right, _) => 'r',
        (Outcome::Extra, _) => 'x',
        (Outcome::Refused, "one_of") => 'o',
        (Outcome::Refused, _) => 'u',
        (Outcome::Missed, _) => 'm',
        (Outcome::Wrong | Outcome::Partly, _) => 'w',
        (Outcome::Failed, _) => 'f',
    }
}
