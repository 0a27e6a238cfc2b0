//! Text as wide as the terminal: long lines are wrapped between words, tables are narrowed. Where there is no terminal, lines stay whole.

use comfy_table::{ContentArrangement, Table, presets};
use textwrap::core::display_width;
use textwrap::{Options, WordSeparator, wrap};

/// Width of text where there is no terminal, characters.
const WIDTH: usize = 118;
/// Tables and texts need this width even where the terminal is narrower.
const LEAST_WIDTH: usize = 40;
/// A label at the start of a line ends within so many columns; the lines that continue it begin where its text does.
const LONGEST_LABEL: usize = 20;

/// Width of what a person reads, characters: the terminal's, else that of a usual one.
pub fn width() -> usize {
    terminal_width().unwrap_or(WIDTH)
}

/// Width of the terminal that standard output goes to, characters.
pub fn terminal_width() -> Option<usize> {
    width_of(terminal_size::terminal_size_of(std::io::stdout()))
}

/// Width of the terminal that standard error goes to, characters.
pub(crate) fn error_width() -> Option<usize> {
    width_of(terminal_size::terminal_size_of(std::io::stderr()))
}

fn width_of(size: Option<(terminal_size::Width, terminal_size::Height)>) -> Option<usize> {
    size.map(|(terminal_size::Width(width), _)| usize::from(width).max(LEAST_WIDTH))
}

/// An empty table without lines, at most as wide as the terminal.
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
        // Lines are cut at spaces alone, never within a path or a number.
        let options = Options::new(width)
            .break_words(false)
            .word_separator(WordSeparator::AsciiSpace)
            .subsequent_indent(&indent);
        wrap(line, options).join("\n")
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// Whether `line` is a command to copy, with or without a label.
fn is_command(line: &str) -> bool {
    let text = line.get(indent(line)..).unwrap_or(line);
    text.trim_start().starts_with("freeplay ")
}

/// The column at which the text of `line` begins: behind its spaces, and behind a label that two spaces part from the text.
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
