//! The first thing that a person should see: recording and model don't mean the same.

use std::path::Path;

use freeplay_diagnosis::{Certainty, SetupFinding, sentences};

use crate::diagnose_screen::{MARGIN, wrapped};

/// What is wrong with the set-up and how to mend it, and the file that does so; empty where nothing is. What is only likely is a question.
pub fn block(findings: &[SetupFinding], setup: Option<&Path>) -> String {
    let mut text = String::new();
    for (index, (certainty, statement, remedy)) in sentences(findings).into_iter().enumerate() {
        let words = match certainty {
            Certainty::Sure => format!("{statement} {remedy}"),
            Certainty::Likely => format!("Likely, but much stays unexplained: {statement} {remedy}"),
        };
        text.push_str(if index == 0 { "\n" } else { "" });
        text.push_str(&wrapped(if index == 0 { "CHECK" } else { "" }, MARGIN, &words));
    }
    if let Some(setup) = setup {
        text.push_str(&wrapped(
            "",
            MARGIN,
            &format!("freeplay diagnose … --mapping {} reads it so.", setup.display()),
        ));
    }
    text
}

#[cfg(test)]
mod tests {
    use freeplay_diagnosis::{Certainty, SetupFinding};

    use super::block;

    /// A statement that several joints share is said once; what is likely is a question.
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
        let text = block(&[both.as_slice(), &[finding("c", Certainty::Likely, "Late?")]].concat(), None);
        println!("{text}");
        assert_eq!(text.matches("Four times. Scale them.").count(), 1);
        assert!(text.contains("Likely") && text.starts_with("\nCHECK"));
        assert_eq!(block(&[], None), "");
    }
}
