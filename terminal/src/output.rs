//! Standard output and standard error, each of which may be a pipe whose reader stops early.
//!
//! All text passes through here, and [`shown`] escapes invisible characters: names from files, arguments or the environment cannot control the terminal. Only
//! [`raw`] writes bytes unchanged, for scripts and manual pages of this program.

use std::io::{Error, ErrorKind, Write};

use clap::builder::styling::Style;
use freeplay_report::visible;

use crate::exit::Failure;
use crate::layout::{error_width, terminal_width, wrapped};
use crate::styles::STYLES;
use crate::{outside, step_line};

/// Writes `text` for a program or an editor: JSON and TOML, with values and lines unchanged.
///
/// # Errors
/// Standard output can't be written otherwise.
pub fn say(text: &str) -> Result<(), Failure> {
    step_line::clear();
    let text = outside::on_one_line(text);
    written(std::io::stdout().lock().write_all(visible(&text).as_bytes()))
}

/// Writes `text` for a person, wrapped to the width of the terminal. Styles in it are removed if --color, `NO_COLOR` or the lack of a terminal requires that.
///
/// # Errors
/// As [`say`].
pub fn show(text: &str) -> Result<(), Failure> {
    step_line::clear();
    written(anstream::stdout().lock().write_all(fitted(shown(text), terminal_width()).as_bytes()))
}

/// Writes `text`, which contains only this program's own words, unchanged.
///
/// # Errors
/// As [`say`].
pub fn raw(text: &str) -> Result<(), Failure> {
    written(std::io::stdout().lock().write_all(text.as_bytes()))
}

/// Writes a line to standard error; ignores errors, since there is no other way to report them.
pub fn tell(line: &str) {
    step_line::clear();
    let _ = writeln!(anstream::stderr().lock(), "{}", fitted(shown(line), error_width()));
}

/// `text` in lines of at most `width` characters, if there is a terminal.
fn fitted(text: String, width: Option<usize>) -> String {
    width.map_or_else(|| text.clone(), |width| wrapped(&text, width))
}

/// `text` for display: keeps this program's styles and escapes all other invisible characters.
pub fn shown(text: &str) -> String {
    let text = outside::on_one_line(text);
    let mut rest = text.as_ref();
    let mut shown = String::with_capacity(rest.len());
    while let Some((before, styled, after)) = first_styled(rest) {
        shown.push_str(&visible(before));
        shown.push_str(styled);
        rest = after;
    }
    shown + &visible(rest)
}

/// Splits `text` at its first words in one of our styles, from the style's first byte to its reset: the text before, the words, the text after.
///
/// Words that contain another escape sequence are not ours, nor is a style without its reset.
fn first_styled(text: &str) -> Option<(&str, &str, &str)> {
    let mut from = 0;
    loop {
        let begin = from + text[from..].find('\u{1b}')?;
        let end_of = |style: &Style| {
            let open = style.render().to_string();
            let inner = text[begin..].strip_prefix(&open).filter(|_| !open.is_empty())?;
            let close = style.render_reset().to_string();
            let length = inner.find(&close)?;
            let is_plain = visible(&inner[..length]).len() == length && !inner[..length].contains('\n');
            is_plain.then_some(begin + open.len() + length + close.len())
        };
        if let Some(end) = STYLES.iter().find_map(end_of) {
            return Some((&text[..begin], &text[begin..end], &text[end..]));
        }
        from = begin + 1;
    }
}

fn written(done: Result<(), Error>) -> Result<(), Failure> {
    match done {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::internal(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::shown;
    use crate::styles::{BAD, GOOD, styled};

    #[test]
    fn styles_of_this_program_stay_and_others_are_escaped() {
        let own = format!("a {} b {}\n", styled(GOOD, "named"), styled(BAD, "FAILS"));
        assert_eq!(shown(&own), own);
        let foreign = "\u{1b}[31mred\u{1b}[0m \u{1b}]0;title\u{7}\u{9b}2J\r\u{202e}";
        let written = shown(foreign);
        assert_eq!(written, "\\u001b[31mred\\u001b[0m \\u001b]0;title\\u0007\\u009b2J\\r\\u202e");
        let within = styled(GOOD, format!("named {foreign}"));
        assert!(!shown(&within).contains(['\u{1b}', '\u{7}']), "{:?}", shown(&within));
    }
}
