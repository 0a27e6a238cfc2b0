//! The documentation of all kinds of effects: `docs/effects.md`.

use crate::beyond::BEYOND_CATALOGUE;
use crate::catalogue::{CATALOGUE, COMMANDED};
use crate::kind::Kind;
use crate::parameter::{Absent, Parameter, Range, Role};
use crate::place::Site;

/// The command that generates it.
const MADE_BY: &str = "cargo run -p freeplay-laws --example effects";

/// The text of `docs/effects.md`.
pub fn manual() -> String {
    let mut text = format!(
        "<!-- Made by `{MADE_BY}` from the laws themselves. -->\n\n# Effects\n\nPhysical effects that the model of a rigid arm leaves out. An arm \
         file switches an effect on with a table:\n\n```toml\n[[effect]]\nkind = \"coulomb_friction\"\njoint = \"joint_3\"\ncoulomb = 40.0\n```\n\nAn \
         effect of the whole arm has no `joint`. Units are SI; where a table gives two, the second is that of a sliding joint. The plant simulates the \
         effects of its arm file, `compare` predicts with them, controllers with this file correct for them, and `diagnose` finds effects in a \
         recording and writes such tables.\n"
    );
    for kind in CATALOGUE {
        describe(&mut text, kind);
    }
    text.push_str(
        "\n# Commanded positions\n\nEffects that a diagnosis finds in recordings with commanded positions (`q_ref1`…). `compare` predicts the \
         measured positions with them. `diagnose` finds them if a recording has neither torques nor the tool. It also finds servos and delays beside \
         torques, if servos produce these torques from the commands.\n",
    );
    for kind in COMMANDED {
        describe(&mut text, kind);
    }
    text.push_str(
        "\n# Beyond the catalogue\n\nLaws with which a diagnosis compares the catalogue, so that it does not give them the names of similar effects. \
         An effect that one of these laws explains best is `unknown`; the report describes it, and the arm file contains it.\n",
    );
    for kind in BEYOND_CATALOGUE {
        describe(&mut text, kind);
    }
    text
}

fn describe(text: &mut String, kind: &Kind) {
    let site = match kind.site {
        Site::Arm => "the arm as a whole",
        Site::Joint => "any joint",
        Site::Revolute => "any joint that turns",
    };
    let seen = match (kind.seen.torque, kind.seen.pose) {
        (true, true) => "torques, tool and link encoders",
        (true, false) => "torques",
        (false, false) => "commanded against measured positions",
        (false, true) => "tool and link encoders",
    };
    let Kind { name, title, equation, source, signature, .. } = kind;
    let mut line = |words: String| text.extend([words.as_str(), "\n"]);
    line(format!("\n## `{name}`: {title}\n"));
    line(format!("`{equation}` ({source}).\n"));
    line(format!("Place: {site}. Visible in {seen}: {signature}.\n"));
    line("| parameter | meaning | unit | range | default |\n| --- | --- | --- | --- | --- |".to_owned());
    kind.parameters.iter().for_each(|parameter| line(row(parameter)));
    if !kind.confounders.is_empty() {
        line("\nSimilar effects:\n".to_owned());
        kind.confounders.iter().for_each(|(other, how)| line(format!("- `{other}`, which {how}")));
    }
}

fn row(parameter: &Parameter) -> String {
    let Parameter { name, meaning, range } = parameter;
    let [unit, values, absent] = match range {
        Range::Number { unit, prismatic_unit, least, most, absent, role } => {
            let unit =
                if unit == prismatic_unit { (*unit).to_owned() } else { format!("{unit}, {prismatic_unit}") };
            let given = if *role == Role::Given { "; taken as given, not identified" } else { "" };
            [
                unit,
                format!("{} to {}{given}", figure(*least), figure(*most)),
                default_words(absent, f64::to_string),
            ]
        }
        Range::Vector { unit, absent, .. } => [
            (*unit).to_owned(),
            "three numbers".to_owned(),
            default_words(absent, |default| format!("{default:?}")),
        ],
        Range::OtherJoint => [String::new(), "the name of another joint".to_owned(), "refused".to_owned()],
        Range::Word(words) => {
            let listed: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
            let first = listed.first().cloned().unwrap_or_default();
            [String::new(), listed.join(", "), first]
        }
        Range::Table => [String::new(), "a table".to_owned(), "its defaults".to_owned()],
    };
    format!("| `{name}` | {meaning} | {unit} | {values} | {absent} |")
}

/// The default of a parameter in words; `figure` formats a default value.
fn default_words<T>(absent: &Absent<T>, figure: impl Fn(&T) -> String) -> String {
    match absent {
        Absent::Refused => "refused".to_owned(),
        Absent::Is(value) => figure(value),
        Absent::Means(words) => (*words).to_owned(),
    }
}

/// A number in decimal or scientific notation.
fn figure(value: f64) -> String {
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}
