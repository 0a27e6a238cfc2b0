//! Position of a key in a scenario file, so that error messages can give line and column.

use std::path::Path;

use toml::de::{DeTable, DeValue};

/// A position in a text, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

impl Place {
    fn of(text: &str, offset: usize) -> Self {
        let before = &text[..offset];
        let start = before.rfind('\n').map_or(0, |end| end + 1);
        Self { line: before.matches('\n').count() + 1, column: before[start..].chars().count() + 1 }
    }
}

/// The position of the dotted `key` in the TOML `text`; `None` if the key is missing.
pub fn place_of(text: &str, key: &str) -> Option<Place> {
    let document = DeTable::parse(text).ok()?;
    let mut parts = key.split('.');
    let mut offset = offset_of(document.get_ref(), parts.next()?)?;
    let mut value = value_of(document.get_ref(), key.split('.').next()?)?;
    for part in parts {
        let DeValue::Table(table) = value else { return None };
        offset = offset_of(table, part)?;
        value = value_of(table, part)?;
    }
    Some(Place::of(text, offset))
}

fn offset_of(table: &DeTable<'_>, key: &str) -> Option<usize> {
    table.iter().find(|(name, _)| name.get_ref() == key).map(|(name, _)| name.span().start)
}

fn value_of<'a, 'i>(table: &'a DeTable<'i>, key: &str) -> Option<&'a DeValue<'i>> {
    table.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value.get_ref())
}

/// `message` about the scenario in `file`. If it names a key of the file, the function appends the line of that key.
pub fn located(file: Option<&Path>, message: String) -> String {
    let drawn = file.and_then(|file| {
        let text = freeplay_storage::read_text(file).ok()?;
        let place = named_keys(&message).into_iter().find_map(|key| place_of(&text, &key))?;
        let line = text.lines().nth(place.line - 1)?;
        let margin = place.line.to_string();
        let (blank, indent) = (" ".repeat(margin.len()), " ".repeat(place.column - 1));
        Some(format!(
            "\n{blank}--> {}:{}:{}\n{margin} | {line}\n{blank} | {indent}^",
            file.display(),
            place.line,
            place.column
        ))
    });
    message + &drawn.unwrap_or_default()
}

/// Largest number of words after a table's name that may name its key.
const WORDS: usize = 4;

/// The keys that `message` may refer to, the longest first: `scenario: clearance.joint_5: effect joint_clearance: friction = -1 …`
/// refers to `clearance.joint_5.friction`, or else to `clearance.joint_5`.
fn named_keys(message: &str) -> Vec<String> {
    let rest = match message.strip_prefix("scenario: ") {
        Some(rest) => rest,
        None if message.starts_with("path.") => message,
        None => return Vec::new(),
    };
    let mut words = rest.split([' ', ':', '=', ',']).filter(|word| !word.is_empty());
    let Some(first) = words.next() else { return Vec::new() };
    words.take(WORDS).map(|word| format!("{first}.{word}")).chain([first.to_owned()]).collect()
}

#[cfg(test)]
mod tests {
    use super::{Place, named_keys, place_of};

    #[test]
    fn keys_are_found_however_they_are_written() {
        let text = "rate = 1\n[path]\n  period = 0 # é\n[clearance]\njoint_5 = { \"é\" = 1, friction = -1 }\nsensors.tool.noise = 2\n";
        let at = |key| place_of(text, key);
        assert_eq!(at("rate"), Some(Place { line: 1, column: 1 }));
        assert_eq!(at("path.period"), Some(Place { line: 3, column: 3 }));
        assert_eq!(at("clearance.joint_5.friction"), Some(Place { line: 5, column: 22 }));
        assert_eq!(at("clearance.sensors.tool"), Some(Place { line: 6, column: 9 }));
        assert_eq!((at("path.laps"), at("rate.x"), at("nothing")), (None, None, None));
    }

    #[test]
    fn a_message_about_something_else_names_no_key() {
        assert_eq!(named_keys("scenario: rate = 0"), ["rate.0", "rate"]);
        assert_eq!(named_keys("path.period = 0 s"), ["path.period.0", "path.period.s", "path.period"]);
        assert!(named_keys("controller ./x: there is no such executable").is_empty());
    }
}
