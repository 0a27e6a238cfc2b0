//! A mapping file in TOML: it gives the meaning of the columns of a recording from another tool.
//!
//! ```toml
//! separator = ";"                 # optional, as are decimal and skip: else detected from the file
//! decimal = ","
//! skip = 2                        # lines before the header
//! joints = ["shoulder", "elbow"]  # optional: the joints' names, in the order of the columns
//!
//! [t]
//! columns = "Time"                # or two, of whole seconds and of the rest: ["sec", "nanosec"], unit = ["s", "ns"]
//! unit = "ms"                     # s, ms, us, ns
//!
//! [q]
//! columns = ["J1 [deg]", "J2 [deg]"]   # or one name with {} for the joint's number: "pos_{}"
//! first = 1                       # optional: the number of the first joint in such a name
//! unit = "deg"                    # rad, deg; m, mm
//!
//! [tau]
//! columns = "current_{}"
//! unit = "N*m"                    # N*m, N*mm, N
//! scale = [95.2, 95.2]            # optional: by joint or for all, times the value in that unit (current × constant × ratio)
//! ```
//!
//! Further keys correct a recording whose conventions differ from those of its model: `offset` (subtracted from the scaled values, by joint or for all),
//! `unwrap = true` (for positions that jump by whole turns), `delay` (lag of the columns, s), `[[relative]]` with `joint`, `to` and `factor` (a position that
//! contains another joint's), and `gravity_compensated = true` (the torques lack the arm's weight). `freeplay diagnose --out` writes such a file, `setup.toml`.
//!
//! Tables: `t` and `q`, and for further columns `qd` (rad/s, deg/s, rpm, m/s, mm/s), `tau`, `q_ref` and `q_link` (as q), `tool` (x, y, z; m, mm) and
//! `orientation` (qx, qy, qz, qw). A unit is one for all columns or a list of one for each. Columns that the mapping does not name keep their names; a name
//! that is reserved by this crate gets the prefix `file_`.
//!
//! Numbers name the columns of a file without a header: `"1"`, `"2"` and on. In such a file a name with `{}` and other letters stands for an equal share of the
//! columns that no number claims, in the order of the list above.

use std::path::Path;

use serde::Deserialize;

use crate::corrections::{Relative, shifted, unwrapped};
use crate::csv_form::{Form, StatedForm};
use crate::mapped::{Mapped, Places};
use crate::mapping_error::MappingError;
use crate::mapping_text::MappingText;
use crate::names::{Group, ORIENTATION, TOOL, list};
use crate::place::Place;
use crate::recording::Recording;
use crate::sources::{Quantity, Sources};

/// Meaning of the columns of a foreign recording.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    separator: Option<char>,
    decimal: Option<char>,
    skip: Option<usize>,
    joints: Option<Vec<String>>,
    t: Columns,
    q: Columns,
    qd: Option<Columns>,
    tau: Option<Columns>,
    q_ref: Option<Columns>,
    q_link: Option<Columns>,
    tool: Option<Columns>,
    orientation: Option<Columns>,
    #[serde(default)]
    relative: Vec<Relative>,
    #[serde(default)]
    gravity_compensated: bool,
    #[serde(skip)]
    written: MappingText,
}

/// The columns of one quantity.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Columns {
    columns: Names,
    #[serde(default = "one")]
    first: usize,
    unit: Option<UnitNames>,
    scale: Option<Scale>,
    offset: Option<Scale>,
    #[serde(default)]
    unwrap: bool,
    #[serde(default)]
    delay: f64,
}

fn one() -> usize {
    1
}

/// A name, a name with `{}` for the joint's number, or all names.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a name in quotes, or a list of names")]
enum Names {
    One(String),
    All(Vec<String>),
}

/// A unit for all columns of a quantity, or one for each.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a unit in quotes, or a list of units")]
enum UnitNames {
    One(String),
    All(Vec<String>),
}

/// A factor for all columns of a quantity, or one for each.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number, or a list of numbers")]
enum Scale {
    One(f64),
    All(Vec<f64>),
}

/// Units of a quantity: names with their factors to SI.
type Units = &'static [(&'static str, f64)];

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const TIME: Units = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
const POSITION: Units = &[("rad", 1.0), ("deg", DEGREE), ("m", 1.0), ("mm", 1e-3)];
const VELOCITY: Units =
    &[("rad/s", 1.0), ("deg/s", DEGREE), ("rpm", 6.0 * DEGREE), ("m/s", 1.0), ("mm/s", 1e-3)];
const TORQUE: Units = &[("N*m", 1.0), ("N*mm", 1e-3), ("N", 1.0)];
const LENGTH: Units = &[("m", 1.0), ("mm", 1e-3)];
const NUMBER: Units = &[("1", 1.0)];

impl Mapping {
    /// Reads a mapping file.
    ///
    /// # Errors
    /// See [`MappingError`].
    pub fn load(path: &Path) -> Result<Self, MappingError> {
        let file = || path.to_path_buf();
        let text = freeplay_storage::read_config(path)
            .map_err(|error| MappingError::Unreadable { file: file(), source: error.into() })?;
        Self::parse(&text, path)
    }

    /// Parses `text`, the content of `file`.
    ///
    /// # Errors
    /// See [`MappingError`].
    pub(crate) fn parse(text: &str, file: &Path) -> Result<Self, MappingError> {
        let written = MappingText::new(text, file);
        let mapping: Self = toml::from_str(text).map_err(|error| written.syntax(&error))?;
        let mapping = Self { written, ..mapping };
        for (key, value) in [("separator", mapping.separator), ("decimal", mapping.decimal)] {
            let Some(value) = value else { continue };
            if !value.is_ascii() || value.is_ascii_alphanumeric() || value == '"' {
                return Err(MappingError::Sign { at: mapping.written.place(&[key], None), key, value });
            }
        }
        for (key, columns, units) in mapping.quantities() {
            columns.factors(key, units, &mapping.written)?;
            mapping.check_finite(key, columns)?;
        }
        if let Some(relative) = mapping.relative.iter().find(|relative| !relative.factor.is_finite()) {
            let at = mapping.written.place(&["relative", "factor"], None);
            return Err(MappingError::NotFinite {
                at,
                key: "relative",
                what: "factor",
                value: relative.factor,
            });
        }
        Ok(mapping)
    }

    /// Refuses NaN and infinity in the numbers of `columns`.
    fn check_finite(&self, key: &'static str, columns: &Columns) -> Result<(), MappingError> {
        let listed = |numbers: &Option<Scale>| match numbers {
            None => Vec::new(),
            Some(Scale::One(number)) => vec![*number],
            Some(Scale::All(numbers)) => numbers.clone(),
        };
        for (what, numbers) in [
            ("scale", listed(&columns.scale)),
            ("offset", listed(&columns.offset)),
            ("delay", vec![columns.delay]),
        ] {
            if let Some(&value) = numbers.iter().find(|number| !number.is_finite()) {
                return Err(MappingError::NotFinite {
                    at: self.written.place(&[key, what], None),
                    key,
                    what,
                    value,
                });
            }
        }
        Ok(())
    }

    /// The logs that `franka::logToCSV` writes (libfranka, `src/log.cpp`): time in ms, joints counted from 0.
    pub fn libfranka() -> Self {
        let joints = |name: &str| Columns { first: 0, ..Columns::of(name) };
        Mapping {
            separator: Some(','),
            decimal: Some('.'),
            skip: None,
            joints: None,
            t: Columns { unit: Some(UnitNames::One("ms".to_owned())), ..Columns::of("time") },
            q: joints("state.q[{}]"),
            qd: Some(joints("state.dq[{}]")),
            tau: Some(joints("state.tau_J[{}]")),
            q_ref: Some(joints("state.q_d[{}]")),
            q_link: None,
            tool: None,
            orientation: None,
            relative: Vec::new(),
            gravity_compensated: false,
            written: MappingText::new("", Path::new("the columns of a libfranka log")),
        }
    }

    /// True if the torques lack the arm's weight; a caller that knows the arm has to add it.
    pub fn is_gravity_compensated(&self) -> bool {
        self.gravity_compensated
    }

    /// Applies the corrections that remain after naming and scaling: jumps of whole turns, offsets, delays, relative positions.
    ///
    /// # Errors
    /// [`MappingError::Count`] if the numbers of offsets and columns differ, [`MappingError::NoJoint`] if the recording lacks a joint of `[[relative]]`.
    pub(crate) fn finish(&self, recording: &mut Recording) -> Result<(), MappingError> {
        let joints = recording.joints();
        let finish = |columns: &Columns, key: &'static str, values: &mut [Vec<f64>], t: &[f64]| {
            let count = values.len();
            let mut each = values.iter_mut().enumerate();
            each.try_for_each(|(index, column)| columns.finish(key, (index, count), t, column, &self.written))
        };
        let [qd, tau, q_ref] = [&self.qd, &self.tau, &self.q_ref].map(Option::as_ref);
        let t = recording.t.clone();
        finish(&self.q, "q", &mut recording.q, &t)?;
        for (key, columns, values) in [
            ("qd", qd, &mut recording.qd),
            ("tau", tau, &mut recording.tau),
            ("q_ref", q_ref, &mut recording.q_ref),
        ] {
            if let (Some(columns), Some(values)) = (columns, values) {
                finish(columns, key, values, &t)?;
            }
        }
        if let (Some(columns), Some(values)) = (&self.tool, &mut recording.tool) {
            finish(columns, "tool", values, &t)?;
        }
        if let (Some(columns), Some(values)) = (&self.orientation, &mut recording.orientation) {
            finish(columns, "orientation", values, &t)?;
        }
        if let Some(columns) = &self.q_link {
            for (index, values) in recording.q_link.iter_mut().enumerate() {
                if let Some(values) = values {
                    columns.finish("q_link", (index, joints), &t, values, &self.written)?;
                }
            }
        }
        self.relative.iter().try_for_each(|relative| relative.take_out(recording, &self.written))
    }

    /// The form of the file as far as the mapping states it.
    pub(crate) fn stated_form(&self) -> StatedForm {
        let byte = |sign: Option<char>| sign.map(|sign| sign as u8);
        StatedForm { separator: byte(self.separator), decimal: byte(self.decimal), skip: self.skip }
    }

    /// The joints' names, in the order of the columns.
    pub(crate) fn joints(&self) -> &[String] {
        self.joints.as_deref().unwrap_or_default()
    }

    /// Renames the columns `names` of the recording to those of the contract. The header is at `header`; the columns of a file without a header are `numbered`.
    pub(crate) fn apply(
        &self,
        names: Vec<String>,
        numbered: bool,
        header: &Place,
    ) -> Result<Mapped, MappingError> {
        let places = Places::of(&names);
        let mut ours: Vec<Option<String>> = vec![None; names.len()];
        let mut picks = Mapped::own(names.clone()).picks;
        let mut time = 0;
        let shares = if numbered { self.shares(names.len()) } else { Vec::new() };
        let starts: Vec<String> = self.quantities().filter_map(|(_, columns, _)| columns.number()).collect();
        let expand = |key: &str, columns: &Columns| {
            let share = shares.iter().find(|(shared, _)| *shared == key);
            share.map_or_else(|| columns.expand(&places, &starts), |(_, share)| share.clone())
        };
        let joints = expand("q", &self.q).len();
        self.check_joints(joints)?;
        for (key, columns, units) in self.quantities() {
            let expanded = expand(key, columns);
            let expected = match key {
                "t" => expanded.len().clamp(1, 2),
                "q" => expanded.len().max(1),
                _ => expected_columns(key).unwrap_or(joints),
            };
            if expanded.len() != expected && key != "q_link" {
                return Err(self.count(key, "columns", "columns", (expanded.len(), expected)));
            }
            let units = columns.factors(key, units, &self.written)?;
            let is_needed = matches!(key, "t" | "q");
            let named = expanded.iter().enumerate().filter(|(_, column)| is_needed || !column.is_empty());
            for (index, column) in named {
                let at = || self.written.place(&[key, "columns"], Some(column));
                let Some(place) = places.get(column) else {
                    let (column, found, recording) = (column.clone(), list(&names), Box::new(header.clone()));
                    return Err(MappingError::NoColumn { at: at(), key, recording, column, found });
                };
                let unit = match units.as_slice() {
                    [one] => *one,
                    all => *all
                        .get(index)
                        .ok_or_else(|| self.count(key, "unit", "units", (all.len(), expanded.len())))?,
                };
                let factor = unit * columns.scale(key, index, expanded.len(), &self.written)?;
                if key == "t" && index == 1 {
                    picks[time].rest = Some((place, factor));
                    continue;
                }
                let name = our_name(key, index);
                if let Some(one) = ours[place].replace(name.clone()) {
                    return Err(MappingError::Twice { at: at(), column: column.clone(), one, other: name });
                }
                picks[place].factor = factor;
                time = if key == "t" { place } else { time };
            }
        }
        let names =
            names.into_iter().zip(ours).map(|(theirs, ours)| ours.unwrap_or_else(|| kept_name(theirs)));
        Ok(Mapped { names: names.collect(), picks, time })
    }

    /// Refuses another number of names than there are `joints`.
    fn check_joints(&self, joints: usize) -> Result<(), MappingError> {
        let names = self.joints().len();
        if names == 0 || names == joints {
            return Ok(());
        }
        let at = self.written.place(&["joints"], None);
        Err(MappingError::Count { at, key: "joints", what: "names", found: names, expected: joints })
    }

    /// The error for a `found` number of `what` in the key `inner` of a quantity, if another number is expected.
    fn count(
        &self,
        key: &'static str,
        inner: &str,
        what: &'static str,
        (found, expected): (usize, usize),
    ) -> MappingError {
        MappingError::Count { at: self.written.place(&[key, inner], None), key, what, found, expected }
    }

    /// The sources of the columns of `mapped` in a file with the columns `names`, and the corrections of this mapping.
    pub(crate) fn sources(&self, mapped: &Mapped, names: &[String], form: Option<&Form>) -> Sources {
        let mut sources = Sources { gravity_compensated: self.gravity_compensated, ..Sources::default() };
        sources.take_relative(&self.relative);
        let sign = |byte: u8| toml::Value::String(char::from(byte).to_string());
        if let Some(form) = form.filter(|form| (form.separator, form.decimal) != (b',', b'.')) {
            sources.form =
                format!("separator = {}\ndecimal = {}\n", sign(form.separator), sign(form.decimal));
        }
        if let Some(skip) = self.skip {
            sources.form += &format!("skip = {skip}\n");
        }
        let place = |ours: &str| mapped.names.iter().position(|name| name == ours);
        let joints = (0..).take_while(|&joint| place(&our_name("q", joint)).is_some()).count();
        for (key, columns, _) in self.quantities() {
            let count = if key == "t" { 1 } else { expected_columns(key).unwrap_or(joints) };
            let mut quantity = Quantity {
                unwrap: columns.unwrap,
                delay: columns.delay,
                ..Quantity::unscaled(key, Vec::new())
            };
            for index in 0..count {
                let pick = place(&our_name(key, index)).map(|place| mapped.picks[place]);
                let name = |source: usize| names[source].clone();
                quantity.columns.push(pick.map_or_else(String::new, |pick| name(pick.source)));
                quantity.scale.push(pick.map_or(1.0, |pick| pick.factor));
                if let Some((rest, factor)) = pick.and_then(|pick| pick.rest) {
                    quantity.columns.push(name(rest));
                    quantity.scale.push(factor);
                }
                let offset = columns.offset.as_ref().and_then(|offset| offset.at(index, count));
                quantity.offset.push(offset.unwrap_or(0.0));
            }
            sources.quantities.push(quantity);
        }
        sources
    }

    /// The columns of each name pattern in a file without a header of `count` columns: equal shares of the columns that no number claims.
    fn shares(&self, count: usize) -> Vec<(&'static str, Vec<String>)> {
        let patterns: Vec<&str> =
            self.quantities().filter(|(_, columns, _)| columns.is_pattern()).map(|(key, ..)| key).collect();
        let claimed = |number: &String| {
            self.quantities().any(|(_, columns, _)| match &columns.columns {
                Names::All(names) => names.contains(number),
                Names::One(name) => name == number,
            })
        };
        let free: Vec<String> =
            (1..=count).map(|number| number.to_string()).filter(|n| !claimed(n)).collect();
        let each = free.len() / patterns.len().max(1);
        patterns.into_iter().zip(free.chunks(each.max(1))).map(|(key, share)| (key, share.to_vec())).collect()
    }

    /// All quantities of the mapping: key, columns, units.
    fn quantities(&self) -> impl Iterator<Item = (&'static str, &Columns, Units)> {
        let optional = [
            ("qd", &self.qd, VELOCITY),
            ("tau", &self.tau, TORQUE),
            ("q_ref", &self.q_ref, POSITION),
            ("q_link", &self.q_link, POSITION),
            ("tool", &self.tool, LENGTH),
            ("orientation", &self.orientation, NUMBER),
        ];
        let present =
            optional.into_iter().filter_map(|(key, columns, units)| Some((key, columns.as_ref()?, units)));
        [("t", &self.t, TIME), ("q", &self.q, POSITION)].into_iter().chain(present)
    }
}

impl Columns {
    fn of(name: &str) -> Self {
        let columns = Names::One(name.to_owned());
        Columns { columns, first: 1, unit: None, scale: None, offset: None, unwrap: false, delay: 0.0 }
    }

    /// True if the columns have one name with `{}` and other letters.
    fn is_pattern(&self) -> bool {
        matches!(&self.columns, Names::One(name) if name.contains("{}") && name != "{}")
    }

    /// The number of the first column, if numbers name the columns.
    fn number(&self) -> Option<String> {
        let name = match &self.columns {
            Names::One(name) if name == "{}" => self.first.to_string(),
            Names::One(name) => name.clone(),
            Names::All(names) => names.first()?.clone(),
        };
        Some(name).filter(|name| name.parse::<usize>().is_ok())
    }

    /// The names. A pattern is expanded to as many numbers as the file has columns, but ends where another quantity `starts`.
    fn expand(&self, places: &Places, starts: &[String]) -> Vec<String> {
        match &self.columns {
            Names::All(names) => names.clone(),
            Names::One(pattern) if pattern.contains("{}") => {
                let numbered = (self.first..).map(|number| pattern.replacen("{}", &number.to_string(), 1));
                let own = pattern.replacen("{}", &self.first.to_string(), 1);
                let found: Vec<String> = numbered
                    .take_while(|name| places.get(name).is_some() && (*name == own || !starts.contains(name)))
                    .collect();
                // No column found: report the first one as missing.
                if found.is_empty() { vec![own] } else { found }
            }
            Names::One(name) => vec![name.clone()],
        }
    }

    /// The factors from the units to SI: one for all columns, or one for each.
    fn factors(
        &self,
        key: &'static str,
        units: Units,
        written: &MappingText,
    ) -> Result<Vec<f64>, MappingError> {
        let factor = |unit: &String| {
            let known = units.iter().find(|(name, _)| name == unit);
            known.map(|(_, factor)| *factor).ok_or_else(|| MappingError::Unit {
                at: written.place(&[key, "unit"], Some(unit)),
                key,
                unit: unit.clone(),
                known: units.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", "),
            })
        };
        match &self.unit {
            None => Ok(vec![1.0]),
            Some(UnitNames::One(unit)) => Ok(vec![factor(unit)?]),
            Some(UnitNames::All(units)) => units.iter().map(factor).collect(),
        }
    }

    /// The scale of column `index` of `count`, beyond its unit.
    fn scale(
        &self,
        key: &'static str,
        index: usize,
        count: usize,
        written: &MappingText,
    ) -> Result<f64, MappingError> {
        let scale = self.scale.as_ref();
        scale.map_or(Ok(1.0), |scale| scale.of((key, "scale", "factors in scale"), (index, count), written))
    }

    /// Applies unwrapping, offset and delay to column number `place.0` of `place.1`.
    fn finish(
        &self,
        key: &'static str,
        place: (usize, usize),
        t: &[f64],
        column: &mut Vec<f64>,
        written: &MappingText,
    ) -> Result<(), MappingError> {
        if self.unwrap
            && let Some(smooth) = unwrapped(column)
        {
            *column = smooth;
        }
        if let Some(offset) = &self.offset {
            let offset = offset.of((key, "offset", "numbers in offset"), place, written)?;
            column.iter_mut().for_each(|x| *x -= offset);
        }
        if self.delay != 0.0 {
            *column = shifted(t, column, self.delay);
        }
        Ok(())
    }
}

impl Scale {
    /// The number for column `index` of `count`; `None` for a list of another length.
    fn at(&self, index: usize, count: usize) -> Option<f64> {
        match self {
            Scale::One(factor) => Some(*factor),
            Scale::All(factors) => factors.get(index).copied().filter(|_| factors.len() == count),
        }
    }

    /// As [`Scale::at`], with an error that names the quantity, the key and `what` the numbers are.
    fn of(
        &self,
        (key, inner, what): (&'static str, &str, &'static str),
        (index, count): (usize, usize),
        written: &MappingText,
    ) -> Result<f64, MappingError> {
        let found = if let Scale::All(factors) = self { factors.len() } else { 1 };
        self.at(index, count).ok_or_else(|| MappingError::Count {
            at: written.place(&[key, inner], None),
            key,
            what,
            found,
            expected: count,
        })
    }
}

impl Relative {
    /// Subtracts the other joint's position, times `factor`, from the joint's positions and velocities in every column group that has them.
    fn take_out(&self, recording: &mut Recording, written: &MappingText) -> Result<(), MappingError> {
        let joints = recording.joints();
        for (key, number) in [("joint", self.joint), ("to", self.to)] {
            if !(1..=joints).contains(&number) {
                let at = written.place(&["relative", key], None);
                return Err(MappingError::NoJoint { at, number, joints });
            }
        }
        let (joint, to) = (self.joint - 1, self.to - 1);
        let take = |columns: &mut [Vec<f64>]| {
            let other = columns[to].clone();
            columns[joint].iter_mut().zip(&other).for_each(|(x, other)| *x -= self.factor * other);
        };
        take(&mut recording.q);
        [&mut recording.qd, &mut recording.q_ref].into_iter().flatten().for_each(|columns| take(columns));
        if let Some(Some(link)) = recording.q_link.get_mut(joint) {
            link.iter_mut().zip(&recording.q[to]).for_each(|(x, other)| *x -= self.factor * other);
        }
        Ok(())
    }
}

/// Number of columns of a quantity that has no column per joint.
fn expected_columns(key: &str) -> Option<usize> {
    match key {
        "tool" => Some(TOOL.len()),
        "orientation" => Some(ORIENTATION.len()),
        _ => None,
    }
}

/// The contract's name for column `index` of a quantity.
fn our_name(key: &str, index: usize) -> String {
    match key {
        "t" => "t".to_owned(),
        "tool" => TOOL[index].to_owned(),
        "orientation" => ORIENTATION[index].to_owned(),
        _ => format!("{key}{}", index + 1),
    }
}

/// The name of a column that the mapping does not name: its own, or with the prefix `file_` if the contract uses its own name.
fn kept_name(name: String) -> String {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let numbered = stem != name && Group::ALL.into_iter().any(|group| group.prefix() == stem);
    let single = name == "t" || TOOL.contains(&name.as_str()) || ORIENTATION.contains(&name.as_str());
    if numbered || single { format!("file_{name}") } else { name }
}
