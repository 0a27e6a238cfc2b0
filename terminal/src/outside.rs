//! Line breaks in names that come from the command line, the environment or the current folder.
//!
//! This program writes line breaks itself, unlike other control characters, so that the output module cannot distinguish a name's own from those between lines.
//! But the names are known at the start: wherever one of them occurs in a text, its line breaks are escaped.

use std::borrow::Cow;
use std::ffi::OsString;
use std::sync::OnceLock;

use freeplay_report::one_line;

/// Environment variables whose values appear in messages.
const SHOWN_VARIABLES: [&str; 3] = ["FREEPLAY_SHM", "FREEPLAY_RECORDINGS", "TMPDIR"];
/// A name needs at least this many characters besides a line break: shorter ones could occur in any text.
const LEAST_OTHERS: usize = 2;

/// The names with line breaks, the longest first.
static NAMES: OnceLock<Vec<String>> = OnceLock::new();

/// `text` with the line breaks of all names from outside escaped.
pub fn on_one_line(text: &str) -> Cow<'_, str> {
    escaped(text, NAMES.get_or_init(names))
}

fn names() -> Vec<String> {
    let variables = SHOWN_VARIABLES.into_iter().filter_map(std::env::var_os);
    let folder = std::env::current_dir().ok().map(OsString::from);
    names_among(std::env::args_os().skip(1).chain(variables).chain(folder))
}

/// The parts of `words` with line breaks: paths occur in texts whole, in part, and with another ending.
fn names_among(words: impl Iterator<Item = OsString>) -> Vec<String> {
    let mut found = Vec::new();
    for word in words {
        let word = word.to_string_lossy();
        for part in word.split(['/', '=', ',']).filter(|part| part.contains('\n')) {
            let stem = part.rfind('.').map(|end| &part[..end]).filter(|stem| stem.contains('\n'));
            let long = |name: &&str| name.chars().filter(|&c| c != '\n').count() >= LEAST_OTHERS;
            found.extend(std::iter::once(part).chain(stem).filter(long).map(str::to_owned));
        }
    }
    found.sort_by_key(|name| std::cmp::Reverse(name.len()));
    found
}

fn escaped<'a>(text: &'a str, names: &[String]) -> Cow<'a, str> {
    names.iter().fold(Cow::Borrowed(text), |text, name| match text.contains(name.as_str()) {
        true => Cow::Owned(text.replace(name.as_str(), &one_line(name))),
        false => text,
    })
}

#[cfg(test)]
mod tests {
    use super::{escaped, names_among};

    #[test]
    fn a_name_of_two_lines_is_shown_in_one_whole_or_in_part() {
        let names = names_among(["--out=/tmp/a\nb/c\nd.csv", "run", "\n}"].into_iter().map(Into::into));
        let text = "{\n}\n/tmp/a\nb: wrote c\nd.mcap\nand c\nd.csv\n";
        assert_eq!(escaped(text, &names), "{\n}\n/tmp/a\\nb: wrote c\\nd.mcap\nand c\\nd.csv\n");
    }
}
