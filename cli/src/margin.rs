//! Text with a word in its margin.

use freeplay_terminal::messages::width;
use freeplay_terminal::outside::on_one_line;

/// Width of what stands before a line, characters.
pub const MARGIN: usize = 9;

/// `words` behind `word`, in lines of the screen's width, all but the first `margin` characters in.
pub fn wrapped(word: &str, margin: usize, words: &str) -> String {
    let (first, others) = (format!("{word:margin$}"), " ".repeat(margin));
    let options = textwrap::Options::new(width()).initial_indent(&first).subsequent_indent(&others);
    // Wrapping would take a name with a line break in it apart.
    textwrap::fill(&on_one_line(words), options) + "\n"
}
