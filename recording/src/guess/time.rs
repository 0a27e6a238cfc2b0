//! Finds the time column and its unit.

use super::words::words;
use super::{Names, Sample};
use crate::units::{Unit, without_unit};

const SECONDS: [&str; 5] = ["s", "sec", "secs", "second", "seconds"];
const NANOSECONDS: [&str; 6] = ["ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds"];

/// The time of a file: its columns, one or two, with their units.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Time {
    pub columns: Vec<(usize, &'static str)>,
    score: u8,
}

impl Time {
    /// The time column, by its name and by its values in `sample`.
    pub fn of(names: &Names, sample: &Sample) -> Option<Self> {
        let single = names.iter().enumerate().filter_map(|(place, name)| single(place, name, sample));
        let candidates = split(names).into_iter().chain(single);
        let goes = |time: &Time| {
            time.columns.len() == 2 || time.columns.iter().all(|(place, _)| sample.goes_on(*place))
        };
        // Among equal candidates the first.
        candidates.filter(goes).fold(None, |best: Option<Time>, time| {
            if best.as_ref().is_none_or(|best| time.score > best.score) { Some(time) } else { best }
        })
    }
}

/// Whole seconds and nanoseconds in two columns of one stem; a message header's time stamp has priority.
fn split(names: &Names) -> Option<Time> {
    let parted: Vec<Vec<String>> = names.iter().map(|name| words(name)).collect();
    let ends = |words: &[String], of: &[&str]| words.last().is_some_and(|last| of.contains(&last.as_str()));
    let seconds = parted.iter().enumerate().filter(|(_, words)| ends(words, &SECONDS));
    let pairs = seconds.filter_map(|(place, words)| {
        let stem = &words[..words.len() - 1];
        let rest =
            parted.iter().position(|other| ends(other, &NANOSECONDS) && &other[..other.len() - 1] == stem)?;
        Some(Time { columns: vec![(place, "s"), (rest, "ns")], score: 5 })
    });
    pairs.into_iter().next()
}

/// A single column, if its name or its cells denote time.
fn single(place: usize, name: &str, sample: &Sample) -> Option<Time> {
    let (stem, unit) = without_unit(name);
    let parted = words(stem);
    let time_unit = |text: &str| match Unit::of(text) {
        Some(Unit::Time(unit)) => Some(unit),
        _ => None,
    };
    let (last, rest) = parted.split_last()?;
    let behind = (!rest.is_empty()).then(|| time_unit(last)).flatten();
    let told = unit.and_then(time_unit).or(behind);
    let named = if behind.is_some() { rest } else { parted.as_slice() };
    let is = |word: &str| named.iter().any(|named| named == word);
    let is_time_stamp = sample.time_stamps.contains(&place);
    let score = if stem == "t" {
        6
    } else if is("stamp") || is("timestamp") || is("timestamps") {
        if is("header") { 5 } else { 4 }
    } else if is("time") || is("zeit") || is("datetime") || (named.len() == 1 && is("t")) {
        if named.len() == 1 { 4 } else { 3 }
    } else if is_time_stamp {
        2
    } else if parted.len() == 1 && time_unit(last).is_some() {
        1
    } else {
        return None;
    };
    let lone = (parted.len() == 1).then(|| time_unit(last)).flatten();
    let unit =
        if is_time_stamp { "s" } else { told.or(lone).unwrap_or_else(|| by_size(sample.first(place))) };
    Some(Time { columns: vec![(place, unit)], score })
}

/// The unit of a time since 1970, from its size in this century; seconds for other times.
fn by_size(first: Option<f64>) -> &'static str {
    match first.unwrap_or(0.0) {
        value if value > 9e17 => "ns",
        value if value > 9e14 => "us",
        value if value > 9e11 => "ms",
        _ => "s",
    }
}
