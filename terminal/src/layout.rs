//! Text as wide as the terminal: long lines are wrapped between words, tables are narrowed. Without a terminal, lines stay whole.

use comfy_table::{ContentArrangement, Table, presets};
use textwrap::core::display_width;
use textwrap::{Options, WordSeparator, wrap};

/// Width of text without a terminal, characters.
const WIDTH: usize = 118;
/// Least width of tables and texts, even on a narrower terminal.
const LEAST_WIDTH: usize = 40;
/// A label at the start of a line ends within this number of columns; continuation lines begin where its text does.
const LONGEST_LABEL: usize = 20;

/// Width of text for a person, characters: the terminal's, or else a usual one.
pub fn width() -> usize {
    terminal_width().unwrap_or(WIDTH)
}

/// Width of the terminal on standard output, characters.
pub fn terminal_width() -> Option<usize> {
    width_of(terminal_size::terminal_size_of(std::io::stdout()))
}

/// Width of the terminal on standard error, characters.
pub(crate) fn error_width() -> Option<usize> {
    width_of(terminal_size::terminal_size_of(std::io::stderr()))
}

fn width_of(size: Option<(terminal_size::Width, terminal_size::Height)>) -> Option<usize> {
    size.map(|(terminal_size::Width(width), _)| usize::from(width).max(LEAST_WIDTH))
}

/// An empty table without rules, at most as wide as the terminal.
#[must_use]
pub fn text_table() -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    if let Some(width) = terminal_width() {
        table.set_content_arrangement(ContentArrangement::Dynamic);
        table.set_width(u16::try_from(width).unwrap_or(u16::MAX));
    }
    table
}

/// `text` with each line wrapped to `width` columns. A command stays on one line, so that it can be copied whole.
#[must_use]
pub fn wrapped(text: &str, width: usize) -> String {
    let line = |line: &str| {
        if display_width(line) <= width || is_command(line) {
            return line.to_owned();
        }
        let indent = " ".repeat(indent(line).min(width / 2));
        // Lines break at spaces only, never within a path or a number.
        let options = Options::new(width)
            .break_words(false)
            .word_separator(WordSeparator::AsciiSpace)
            .subsequent_indent(&indent);
        wrap(line, options).join("\n")
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// True if `line` is a command to copy, with or without a label.
fn is_command(line: &str) -> bool {
    let text = line.get(indent(line)..).unwrap_or(line);
    text.trim_start().starts_with("freeplay ")
}

/// The column at which the text of `line` begins: behind its spaces, and behind a label that two spaces separate from the text.
fn indent(line: &str) -> usize {
    let start = line.len() - line.trim_start().len();
    let label = line[start..].find("  ").filter(|length| *length <= LONGEST_LABEL);
    label.map_or(start, |length| {
        let rest = &line[start + length..];
        start + length + (rest.len() - rest.trim_start().len())
    })
}

#[cfg(test)]
mod tests {
    use super::wrapped;

    #[test]
    fn long_lines_are_wrapped_behind_their_label_and_commands_stay_whole() {
        let text = "report      a/long/path/that/has/no/space\nnext        a few words more than fit\n  freeplay run --model arm.urdf --out here\n";
        assert_eq!(
            wrapped(text, 30),
            "report\n            a/long/path/that/has/no/space\nnext        a few words more\n            than fit\n  freeplay run --model arm.urdf --out here\n"
        );
    }

    #[test]
    fn lines_that_fit_keep_every_space() {
        let text = "  a   b\n\n  c";
        assert_eq!(wrapped(text, 30), text);
    }
}
