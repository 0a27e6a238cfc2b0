//! The first block on the screen: differences in conventions between recording and model.

use freeplay_diagnosis::{Certainty, SetupFinding, sentences};
use freeplay_terminal::flags;

use crate::margin::{MARGIN, wrapped};

/// The block CHECK: each fault of the set-up with its remedy. After a certain fault the command `again` follows; it reads the corrected recording or writes a
/// mapping file that corrects it. A fault that is only likely becomes a question. Empty without faults.
pub fn block(findings: &[SetupFinding], again: &str) -> String {
    let mut text = String::new();
    for (index, (certainty, statement, remedy)) in sentences(findings).into_iter().enumerate() {
        let words = match certainty {
            Certainty::Sure => format!("{statement} {remedy}"),
            Certainty::Likely => {
                format!("Likely, although much of the recording stays unexplained: {statement} {remedy}")
            }
        };
        text.push_str(if index == 0 { "\n" } else { "" });
        text.push_str(&wrapped(if index == 0 { "CHECK" } else { "" }, MARGIN, &words));
    }
    if findings.iter().any(|finding| finding.certainty == Certainty::Sure) && !flags::is_quiet() {
        // In one line, so that it can be pasted.
        text.push_str(&format!("{:MARGIN$}{again}\n", ""));
    }
    text
}

#[cfg(test)]
mod tests {
    use freeplay_diagnosis::{Certainty, SetupFinding};

    use super::block;

    /// A statement shared by several joints appears once; a likely one is a question.
    #[test]
    fn what_joints_share_is_said_once() {
        let finding = |joint: &str, certainty, statement: &str| SetupFinding {
            kind: "torque_unit",
            joint: Some(joint.to_owned()),
            value: 4.0,
            unit: "1",
            certainty,
            statement: statement.to_owned(),
            remedy: "Scale them.".to_owned(),
            gravity: None,
        };
        let both = ["a", "b"].map(|joint| finding(joint, Certainty::Sure, "Four times."));
        let text = block(
            &[both.as_slice(), &[finding("c", Certainty::Likely, "Late?")]].concat(),
            "freeplay diagnose",
        );
        println!("{text}");
        assert_eq!(text.matches("Four times. Scale them.").count(), 1);
        assert!(text.contains("Likely") && text.starts_with("\nCHECK"));
        assert!(text.ends_with("\n         freeplay diagnose\n"), "a command stands in a line of its own");
        assert!(
            !block(&[finding("c", Certainty::Likely, "Late?")], "freeplay diagnose").contains("freeplay")
        );
        assert_eq!(block(&[], "freeplay diagnose"), "");
    }
}
