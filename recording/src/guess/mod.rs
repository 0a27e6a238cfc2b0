//! Guesses the meaning of the columns of a foreign file from their names: the text of a mapping file, to be shown and corrected.

mod time;
mod words;

use std::collections::{BTreeMap, HashSet};
use std::fmt::Write as _;

use time::Time;
use words::{Column, Quantity};

pub(crate) use words::words as words_of;

use crate::csv_form::Form;
use crate::names::{ORIENTATION, TOOL};
use crate::units::Unit;

type Names = [String];

/// The first rows of a file.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sample {
    /// By row; NaN for a cell without a number. Time stamps are in seconds.
    pub rows: Vec<Vec<f64>>,
    /// Words in the first row: single ones, or lists.
    pub texts: BTreeMap<usize, Vec<String>>,
    /// Columns of time stamps.
    pub time_stamps: HashSet<usize>,
}

impl Sample {
    fn first(&self, place: usize) -> Option<f64> {
        self.rows.iter().map(|row| row[place]).find(|value| value.is_finite())
    }

    /// True if the column may be a time: its numbers are not all equal, and mostly increase.
    fn goes_on(&self, place: usize) -> bool {
        let values: Vec<f64> =
            self.rows.iter().map(|row| row[place]).filter(|value| value.is_finite()).collect();
        let up = values.windows(2).filter(|pair| pair[1] > pair[0]).count();
        values.len() < 2 || 2 * up >= values.len() - 1
    }
}

/// A guess.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Guess {
    /// The mapping as a mapping file.
    pub toml: String,
    /// Its content, in one line.
    pub words: String,
}

/// The meaning of the columns `names`; `None` if there is no time or no position among them.
pub(crate) fn guess(file: &str, names: &Names, sample: &Sample, form: Option<&Form>) -> Option<Guess> {
    let time = Time::of(names, sample)?;
    let is_time = |place: usize| time.columns.iter().any(|(column, _)| *column == place);
    let columns: Vec<Column> = names
        .iter()
        .enumerate()
        .filter(|(place, _)| !is_time(*place) && !sample.texts.contains_key(place))
        .filter_map(|(place, name)| Column::of(place, name))
        .collect();
    let positions = family(&columns, Quantity::Position, None)?;
    let joints: Vec<&[String]> = positions.iter().map(|column| column.joint.as_slice()).collect();
    let mut text = Text { toml: String::new(), words: Vec::new(), names };
    let _ = writeln!(
        text.toml,
        "# Mapping of the columns of {file}. Correct wrong entries, and pass this file with --mapping."
    );
    if let Some(form) = form.filter(|form| (form.separator, form.decimal) != (b',', b'.')) {
        let _ = writeln!(text.toml, "separator = {}", quoted(&char::from(form.separator).to_string()));
        let _ = writeln!(text.toml, "decimal = {}", quoted(&char::from(form.decimal).to_string()));
    }
    if let Some(named) = joint_names(&positions, names, sample) {
        let _ = writeln!(text.toml, "joints = {}", list(named.iter().map(String::as_str)));
    }
    let units: Vec<&str> = time.columns.iter().map(|(_, unit)| *unit).collect();
    text.table("t", &time.columns.iter().map(|(place, _)| Some(*place)).collect::<Vec<_>>(), &units, "");
    text.quantity("q", &positions.iter().map(|column| Some(*column)).collect::<Vec<_>>(), "");
    for (key, quantity) in
        [("qd", Quantity::Velocity), ("q_ref", Quantity::Reference), ("q_link", Quantity::Link)]
    {
        if let Some(found) = family(&columns, quantity, Some(&joints)) {
            text.quantity(key, &of_joints(&found, &joints), "");
        }
    }
    let torques = family(&columns, Quantity::Torque, Some(&joints));
    if let Some(found) = torques {
        text.quantity("tau", &of_joints(&found, &joints), "");
    } else if let Some(found) = family(&columns, Quantity::Current, Some(&joints)) {
        let remark = "# amperes: give torque constant times gear ratio of each joint with scale = […]\n";
        text.quantity("tau", &of_joints(&found, &joints), remark);
    }
    for (key, axes) in [("tool", &TOOL[..]), ("orientation", &ORIENTATION[..])] {
        let places: Vec<Option<usize>> =
            axes.iter().map(|axis| names.iter().position(|name| name == axis)).collect();
        if places.iter().all(Option::is_some) {
            text.table(key, &places, &[], "");
        }
    }
    Some(Guess { toml: text.toml, words: text.words.join("; ") })
}

/// The text of the mapping.
struct Text<'a> {
    toml: String,
    words: Vec<String>,
    names: &'a Names,
}

impl Text<'_> {
    /// One quantity of the joints, in the units that its columns name.
    fn quantity(&mut self, key: &str, columns: &[Option<&Column>], remark: &str) {
        let unit = |column: &&Column| match column.unit {
            Some(Unit::Position(unit) | Unit::Velocity(unit) | Unit::Torque(unit)) => Some(unit),
            _ => None,
        };
        let default = columns.iter().flatten().find_map(unit);
        let units: Vec<&str> = columns
            .iter()
            .map(|column| column.as_ref().and_then(unit).or(default))
            .collect::<Option<_>>()
            .unwrap_or_default();
        let places: Vec<Option<usize>> = columns.iter().map(|column| Some((*column)?.place)).collect();
        self.table(key, &places, &units, remark);
    }

    fn table(&mut self, key: &str, places: &[Option<usize>], units: &[&str], remark: &str) {
        let name = |place: &Option<usize>| place.map_or("", |place| self.names[place].as_str());
        let columns: Vec<&str> = places.iter().map(name).collect();
        let toml = match columns.as_slice() {
            [one] => quoted(one),
            all => list(all.iter().copied()),
        };
        let mut text = format!("\n[{key}]\n{remark}columns = {toml}\n");
        let same = units.iter().all(|unit| Some(unit) == units.first());
        match units {
            [] => {}
            [unit, ..] if same => text += &format!("unit = {}\n", quoted(unit)),
            units => text += &format!("unit = {}\n", list(units.iter().copied())),
        }
        self.toml += &text;
        let shown = match columns.as_slice() {
            [first, .., last] => format!("{first} … {last}"),
            _ => columns.concat(),
        };
        let unit = units.first().map_or_else(String::new, |unit| format!(" in {unit}"));
        self.words.push(format!("{key} from {shown}{unit}"));
    }
}

/// The columns of `quantity` that belong together. Of several families, selects the one that covers most of `joints`, or whose names denote measured values
/// most clearly. Numbered columns of joints are sorted by number.
fn family<'c>(
    columns: &'c [Column],
    quantity: Quantity,
    joints: Option<&[&[String]]>,
) -> Option<Vec<&'c Column>> {
    let mut families: Vec<Vec<&Column>> = Vec::new();
    for column in columns.iter().filter(|column| column.quantity == quantity) {
        match families.iter_mut().find(|family| family[0].family == column.family) {
            Some(family) => family.push(column),
            None => families.push(vec![column]),
        }
    }
    let is_one_each = |family: &Vec<&Column>| {
        family.iter().map(|column| &column.joint).collect::<HashSet<_>>().len() == family.len()
    };
    families.retain(is_one_each);
    let covers = |family: &[&Column]| match joints {
        Some(joints) if is_by_order(family, joints) => joints.len(),
        Some(joints) => family.iter().filter(|column| joints.contains(&column.joint.as_slice())).count(),
        None => 1,
    };
    let score = |family: &[&Column]| {
        let strength = family.iter().map(|column| column.strength).max().unwrap_or(0);
        (covers(family), strength, family[0].is_measured, family.len())
    };
    let mut best: Option<Vec<&Column>> = None;
    for family in families.into_iter().filter(|family| covers(family) > 0) {
        if best.as_ref().is_none_or(|best| score(&family) > score(best)) {
            best = Some(family);
        }
    }
    let mut best = best?;
    if best.iter().all(|column| column.number().is_some()) {
        best.sort_by_key(|column| column.number());
    }
    Some(best)
}

/// True if a family has numbers while the joints have names, and as many: then it is in the order of the joints.
fn is_by_order(family: &[&Column], joints: &[&[String]]) -> bool {
    let numbered = |joint: &[String]| matches!(joint, [only] if only.parse::<u64>().is_ok());
    family.len() == joints.len()
        && family.iter().all(|column| numbered(&column.joint))
        && !joints.iter().any(|joint| numbered(joint))
}

/// The column of each of `joints`.
fn of_joints<'c>(found: &[&'c Column], joints: &[&[String]]) -> Vec<Option<&'c Column>> {
    if is_by_order(found, joints) {
        return found.iter().map(|column| Some(*column)).collect();
    }
    joints.iter().map(|joint| found.iter().find(|column| column.joint == *joint).copied()).collect()
}

/// The names of the joints whose positions are in the columns `places` of a file with the columns `names`, if the columns or the file have names of joints.
pub(crate) fn joints_of(places: &[usize], names: &Names, sample: &Sample) -> Vec<String> {
    let columns: Option<Vec<Column>> = places.iter().map(|&place| Column::of(place, &names[place])).collect();
    let columns = columns.unwrap_or_default();
    let columns: Vec<&Column> = columns.iter().collect();
    if columns.is_empty() { Vec::new() } else { joint_names(&columns, names, sample).unwrap_or_default() }
}

/// The joints' names: the words that distinguish their columns, or the names in the file if the columns have numbers.
fn joint_names(positions: &[&Column], names: &Names, sample: &Sample) -> Option<Vec<String>> {
    let is_number = |word: &String| word.bytes().all(|c| c.is_ascii_digit());
    if positions.iter().all(|column| !column.joint.iter().all(is_number)) {
        return Some(positions.iter().map(|column| column.joint.join("_")).collect());
    }
    let listed = sample.texts.values().find(|texts| texts.len() == positions.len() && texts.len() > 1);
    if let Some(listed) = listed {
        return Some(listed.clone());
    }
    // One column each, as `field.name0`.
    let of_column = |column: &&Column| {
        let number = column.number()?.to_string();
        let is_name = |place: &&usize| {
            let words = words::words(&names[**place]);
            words.ends_with(&["name".to_owned(), number.clone()])
        };
        let place = sample.texts.keys().find(is_name)?;
        sample.texts[place].first().cloned()
    };
    positions.iter().map(of_column).collect()
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn list<'t>(texts: impl Iterator<Item = &'t str>) -> String {
    format!("[{}]", texts.map(quoted).collect::<Vec<_>>().join(", "))
}
