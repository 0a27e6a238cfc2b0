//! The terminal output: one verdict per claim, and the place of the report.

use std::fmt::Write as _;
use std::path::Path;

use freeplay_terminal::flags::is_quiet;

use super::claim::{Claim, Ruling};

/// Width of the words after the verdict.
const WIDTH: usize = 84;

/// The verdicts on one screen.
pub fn summary(claims: &[Claim], folder: &Path) -> String {
    let mut text =
        "Erkaya (2018), reproduced: a six-axis arm whose joint 5 has 0.2 to 0.6 mm of play\n\n".to_owned();
    for claim in claims {
        let (agreeing, all) = claim.count();
        let mut words = match &claim.ruling {
            Ruling::HoldsOnlyIf(condition) => format!("{condition}: {}", claim.claim),
            _ => claim.claim.to_owned(),
        };
        let _ = write!(words, " ({agreeing} of {all})");
        for (place, line) in wrapped(&words).into_iter().enumerate() {
            let verdict = if place == 0 { claim.verdict() } else { "" };
            let _ = writeln!(text, "{verdict:<14} {line}");
        }
    }
    let _ =
        writeln!(text, "\n(k of n): in how many of the situations looked at; the numbers are in the report");
    let _ = writeln!(text, "report   {}", folder.join("report.html").display());
    let _ = writeln!(text, "numbers  {}", folder.join("reproduce.json").display());
    if !is_quiet() {
        let _ = writeln!(
            text,
            "next     freeplay reference-runs   ·   freeplay run --set path.kind=square_sharp"
        );
    }
    text
}

/// `words` in lines of at most [`WIDTH`] letters.
fn wrapped(words: &str) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for word in words.split_whitespace() {
        let line = lines.last_mut();
        match line {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= WIDTH => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
