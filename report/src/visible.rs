//! Text without invisible characters.
//!
//! Names come from files, arguments and the environment. A terminal obeys the control characters in them, and a reader never sees those that have no width or
//! reverse the direction of writing. This module escapes such characters as JSON, TOML and most programming languages do, `\u202e`: a JSON text keeps its
//! meaning.

use std::borrow::Cow;

/// Characters without a glyph that Rust's own escaping takes for letters or marks (Unicode: `Default_Ignorable_Code_Point`).
const FILLERS: [char; 8] =
    ['\u{34f}', '\u{115f}', '\u{1160}', '\u{17b4}', '\u{17b5}', '\u{180f}', '\u{3164}', '\u{ffa0}'];

/// `text` with every invisible character escaped, except line breaks.
///
/// ```
/// use freeplay_report::visible;
/// assert_eq!(visible("joint \u{1b}[2J\u{202e}\n"), "joint \\u001b[2J\\u202e\n");
/// assert_eq!(visible("größer als 3 µm"), "größer als 3 µm");
/// ```
#[must_use]
pub fn visible(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c == '\n' || is_visible(c))
}

/// The same with line breaks escaped, too: a name cannot pretend to be several lines.
///
/// ```
/// assert_eq!(freeplay_report::one_line("a\nb"), "a\\nb");
/// ```
#[must_use]
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, is_visible)
}

/// True if a reader can see `c`: printable by the rules of Rust's escaping, or a space.
#[must_use]
pub fn is_visible(c: char) -> bool {
    if c.is_ascii() {
        return c == ' ' || c.is_ascii_graphic();
    }
    // A combining mark is printable only behind a letter: `é` may consist of two characters.
    let after_a_letter: String = ['e', c].iter().collect();
    let mut written = after_a_letter.escape_debug().skip(1);
    written.next() == Some(c) && !FILLERS.contains(&c)
}

fn escaped(text: &str, is_kept: impl Fn(char) -> bool) -> Cow<'_, str> {
    if text.chars().all(&is_kept) {
        return Cow::Borrowed(text);
    }
    let mut written = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            c if is_kept(c) => written.push(c),
            '\n' => written.push_str("\\n"),
            '\r' => written.push_str("\\r"),
            '\t' => written.push_str("\\t"),
            c => c
                .encode_utf16(&mut [0; 2])
                .iter()
                .for_each(|unit| written.push_str(&format!("\\u{unit:04x}"))),
        }
    }
    Cow::Owned(written)
}

#[cfg(test)]
mod tests {
    use super::{is_visible, one_line, visible};

    #[test]
    fn what_a_terminal_obeys_and_what_nobody_sees_is_escaped() {
        let control = (0..0xa0).filter_map(char::from_u32).filter(|c| c.is_control());
        let hidden = "\u{ad}\u{61c}\u{200b}\u{200e}\u{2028}\u{202a}\u{202e}\u{2060}\u{2066}\u{2069}\u{feff}\u{e0041}\u{e000}\u{fdd0}\u{3164}\u{34f}";
        for c in control.chain(hidden.chars()) {
            let name = format!("a{c}b");
            let written = one_line(&name);
            assert!(
                written.chars().all(is_visible) && written.len() > 3,
                "U+{:04X} became {written:?}",
                u32::from(c)
            );
        }
        assert_eq!(visible("one\ntwo\r\n"), "one\ntwo\\r\n");
    }

    #[test]
    fn what_people_write_stays_as_it_is() {
        for text in ["Gelenk_1 ✓ – ± µm █ ⠋ │", "cafe\u{301}", "関節", "\"q\\u\""] {
            assert_eq!(one_line(text), text);
        }
    }

    #[test]
    fn a_json_text_keeps_its_value() {
        let value = serde_json::json!({ "name": "a\u{1b}[2J\u{202e}\u{e0041}\u{9b}\n" });
        let written = format!("{value:#}");
        let shown = visible(&written);
        assert!(shown.chars().all(|c| c == '\n' || is_visible(c)), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).ok(), Some(value));
    }
}
