//! The text of a mapping file with the places of its keys and values, so that errors have line and column.

use std::ops::Range;
use std::path::{Path, PathBuf};

use freeplay_storage::plain_words;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::mapping_error::MappingError;
use crate::place::{Place, Row};

/// An error does not quote a longer line of a file.
const LONGEST_LINE: usize = 400;

/// The text of a mapping file, and its name.
#[derive(Clone, Debug, Default)]
pub(crate) struct MappingText {
    file: PathBuf,
    text: String,
}

impl MappingText {
    /// `text`, the content of `file`.
    pub fn new(text: &str, file: &Path) -> Self {
        Self { file: file.to_path_buf(), text: text.to_owned() }
    }

    /// The place of the value of the nested `keys`, or, if that is a list with the element `value`, of this element. Among tables in a list the first one with
    /// the key counts. Without a match, the place is the whole file.
    pub fn place(&self, keys: &[&str], value: Option<&str>) -> Place {
        let span = DeTable::parse(&self.text).ok().and_then(|table| span_in(table.get_ref(), keys, value));
        span.map_or_else(|| Place { file: self.file.clone(), row: Row::Whole }, |span| self.at(span.start))
    }

    /// The error of an invalid text, with the line and a mark under it.
    pub fn syntax(&self, error: &toml::de::Error) -> MappingError {
        let mut message = plain_words(error.message());
        let drawn = error.to_string();
        for line in drawn.lines().skip(1).take_while(|line| line.contains('|') && line.len() <= LONGEST_LINE)
        {
            message.push('\n');
            message.push_str(line);
        }
        MappingError::Syntax { at: self.at(error.span().map_or(0, |span| span.start)), message }
    }

    /// The place of the byte `offset`.
    fn at(&self, offset: usize) -> Place {
        let before = &self.text[..offset.min(self.text.len())];
        let start = before.rfind('\n').map_or(0, |end| end + 1);
        let (line, column) = (before.matches('\n').count() + 1, before[start..].chars().count() + 1);
        Place { file: self.file.clone(), row: Row::Cell(line as u64, column as u64) }
    }
}

/// The bytes of the value of the nested `keys` in `table`, or of its element `wanted`.
fn span_in(table: &DeTable<'_>, keys: &[&str], wanted: Option<&str>) -> Option<Range<usize>> {
    let (key, rest) = keys.split_first()?;
    let (_, value) = table.iter().find(|(name, _)| name.get_ref() == key)?;
    span_of(value, rest, wanted)
}

fn span_of(value: &Spanned<DeValue<'_>>, keys: &[&str], wanted: Option<&str>) -> Option<Range<usize>> {
    let is_wanted = |element: &&Spanned<DeValue<'_>>| matches!(element.get_ref(), DeValue::String(text) if Some(text.as_ref()) == wanted);
    match value.get_ref() {
        DeValue::Table(table) if !keys.is_empty() => span_in(table, keys, wanted),
        DeValue::Array(elements) if !keys.is_empty() => {
            elements.iter().find_map(|element| span_of(element, keys, wanted))
        }
        DeValue::Array(elements) => {
            Some(elements.iter().find(is_wanted).map_or_else(|| value.span(), Spanned::span))
        }
        _ => keys.is_empty().then(|| value.span()),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::MappingText;

    #[test]
    fn keys_and_elements_are_found_however_they_are_written() {
        let text = "q.columns = [\n  \"a\",\n  \"b\"]\n[t]\ncolumns = \"ü\" # x\n[[relative]]\njoint = 9\nto = 1\nfactor = 2\n";
        let at =
            |keys: &[&str], value| MappingText::new(text, Path::new("m.toml")).place(keys, value).to_string();
        assert_eq!(at(&["q", "columns"], Some("b")), "m.toml:3:3");
        assert_eq!(at(&["q", "columns"], Some("c")), "m.toml:1:13");
        assert_eq!(at(&["t", "columns"], Some("ü")), "m.toml:5:11");
        assert_eq!(at(&["relative", "joint"], None), "m.toml:7:9");
        assert_eq!(at(&["tau"], None), "m.toml");
    }
}
