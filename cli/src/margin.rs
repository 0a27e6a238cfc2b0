//! Text with a word in its margin.

use freeplay_terminal::messages::width;
use freeplay_terminal::outside::on_one_line;

/// Width of the margin before a line, characters.
pub const MARGIN: usize = 9;

/// `words` after `word`, wrapped to the screen's width; all lines but the first are indented by `margin` characters.
pub fn wrapped(word: &str, margin: usize, words: &str) -> String {
    let (first, others) = (format!("{word:margin$}"), " ".repeat(margin));
    let options = textwrap::Options::new(width()).initial_indent(&first).subsequent_indent(&others);
    // Wrapping would split a name with a line break in it.
    textwrap::fill(&on_one_line(words), options) + "\n"
}
