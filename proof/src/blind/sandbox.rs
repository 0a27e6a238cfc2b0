//! Where an analyst works: it can read the folder of its case, and nothing else of the file system.
//!
//! Landlock (Salaün 2017; Linux 5.13) takes all other rights from this process for good: files, and where the kernel knows how, the
//! network, signals to others and their memory. A canary outside the folder is tried afterwards: what counts is that it can't be read.

use std::path::Path;

use landlock::{
    ABI, Access, AccessFs, AccessNet, PathBeneath, PathFd, Ruleset, RulesetAttr, RulesetCreatedAttr,
    RulesetStatus, Scope,
};
use serde::{Deserialize, Serialize};

/// The newest rules that are asked for; an older kernel keeps those that it knows.
const RULES: ABI = ABI::V6;

/// What keeps an analyst from the truth, as it found it itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Isolation {
    /// What the kernel enforces, in words.
    pub mechanism: String,
    /// Whether the canary, a file outside the folder of the case, could not be read.
    pub canary_refused: bool,
    /// Whether the parent's memory could not be opened.
    pub parent_refused: bool,
}

/// Gives up all rights but to read the working folder, and tries the `canary` and the parent's memory.
pub fn enter(canary: Option<&Path>) -> Isolation {
    let mechanism = match restrict() {
        Ok(RulesetStatus::FullyEnforced) => "landlock, all rules",
        Ok(RulesetStatus::PartiallyEnforced) => "landlock, the rules that this kernel knows",
        Ok(_) => "none: this kernel has no landlock",
        Err(_) => "none: landlock refused",
    };
    let parent = format!("/proc/{}/mem", std::os::unix::process::parent_id());
    Isolation {
        mechanism: mechanism.to_owned(),
        canary_refused: canary.is_some_and(|canary| std::fs::read(canary).is_err()),
        parent_refused: std::fs::File::open(parent).is_err(),
    }
}

/// Any failure is the same to the caller: there is no sandbox.
fn restrict() -> Result<RulesetStatus, Box<dyn std::error::Error>> {
    let here = PathFd::new(".")?;
    let created = Ruleset::default()
        .handle_access(AccessFs::from_all(RULES))?
        .handle_access(AccessNet::from_all(RULES))?
        .scope(Scope::from_all(RULES))?
        .create()?;
    let status = created.add_rule(PathBeneath::new(here, AccessFs::from_read(RULES)))?.restrict_self()?;
    Ok(status.ruleset)
}
