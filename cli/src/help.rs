//! The list of commands in `freeplay --help`: grouped by purpose, the two main commands first.

use std::fmt::Write as _;

use clap::Command;
use clap::builder::styling::Style;
use clap::builder::{StyledStr, Styles};

use freeplay_terminal::messages::width;

/// The commands by purpose, in the order of the list.
const GROUPS: [(&str, &[&str]); 7] = [
    ("Main commands", &["run", "diagnose"]),
    ("Run", &["replay", "report"]),
    ("Diagnose", &["compare", "excite", "train", "demo"]),
    ("Prove", &["blind", "campaign"]),
    ("Exam", &["swap", "faults", "bench", "doctor"]),
    ("Files", &["arm", "export", "record", "scenario", "completions", "man", "exit-codes"]),
    ("Paper", &["reproduce", "reference-runs", "bound", "cells"]),
];

/// `command` with the list of its commands in groups, as wide as the terminal.
pub fn grouped(command: Command) -> Command {
    let styles = command.get_styles().clone();
    let heading = |words: &str| styled(styles.get_header(), &format!("{words}:"));
    let options = heading("Common options");
    let template = format!(
        "{{before-help}}{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{}{options}\n{{options}}{{after-help}}",
        list(&command, &styles, width())
    );
    command.max_term_width(0).help_template(StyledStr::from(template))
}

fn list(command: &Command, styles: &Styles, width: usize) -> String {
    let names = GROUPS.iter().flat_map(|(_, names)| names.iter());
    let longest = names.map(|name| name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for (group, names) in GROUPS {
        let _ = writeln!(text, "{}", styled(styles.get_header(), &format!("{group}:")));
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            let room = width.saturating_sub(longest + 4).max(20);
            let lines = textwrap::wrap(&about, room).join(&format!("\n{}", " ".repeat(longest + 4)));
            let gap = " ".repeat(longest - name.len() + 2);
            let _ = writeln!(text, "  {}{gap}{lines}", styled(styles.get_literal(), name));
        }
        text.push('\n');
    }
    text
}

fn styled(style: &Style, words: &str) -> String {
    format!("{style}{words}{style:#}")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::{GROUPS, grouped, list};
    use crate::args::Cli;

    #[test]
    fn every_command_stands_in_one_group() {
        let mut listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        let command = Cli::command();
        let mut known: Vec<&str> =
            command.get_subcommands().filter(|sub| !sub.is_hide_set()).map(clap::Command::get_name).collect();
        listed.sort_unstable();
        known.sort_unstable();
        assert_eq!(listed, known);
    }

    #[test]
    fn the_list_is_as_wide_as_it_may_be() {
        let command = Cli::command();
        for width in [60, 80, 200] {
            let text = list(&command, &clap::builder::Styles::plain(), width);
            let longest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
            assert!(longest <= width, "{longest} of {width}:\n{text}");
        }
        let help = grouped(Cli::command()).render_help().to_string();
        let at = |words: &str| help.find(words).unwrap_or_else(|| panic!("{words} in {help}"));
        assert!(
            at("Main commands:") < at("  run")
                && at("  run") < at("  diagnose")
                && at("  diagnose") < at("  replay")
        );
        assert!(at("Paper:") < at("Common options:") && at("Common options:") < at("--color"));
    }
}
