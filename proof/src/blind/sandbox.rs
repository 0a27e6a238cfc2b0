//! The sandbox of an analyst: it can read the folder of its case, and nothing else.
//!
//! Two layers, each irrevocable for this process. Namespaces separate its file system, network, System V memory and credentials from all others (`namespaces`).
//! Landlock (Salaün 2017; Linux 5.13) leaves it the right to read the folder, and no other right over files, sockets and signals. A kernel may refuse either;
//! so the process tries each channel afterwards (`channels`), and the result is decisive.

use std::collections::BTreeMap;

use landlock::{
    ABI, Access, AccessFs, AccessNet, LandlockStatus, PathBeneath, PathFd, RestrictionStatus, Ruleset,
    RulesetAttr, RulesetCreatedAttr, Scope,
};
use rustix::process::{DumpableBehavior, set_dumpable_behavior};
use serde::{Deserialize, Serialize};

use super::channels::{self, Lures};
use super::namespaces;

/// The newest requested rules; an older kernel enforces those that it knows.
const RULES: ABI = ABI::V9;

/// Isolation of an analyst from the truth, as measured by itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Isolation {
    /// The mechanisms that the kernel enforces, in words.
    pub mechanism: String,
    /// True if reading the canary, a file outside the folder of the case, failed.
    pub canary_refused: bool,
    /// True if opening the parent's memory failed.
    pub parent_refused: bool,
    /// Every channel by its name: `closed`, or `open: ` and how.
    pub channels: BTreeMap<String, String>,
}

impl Isolation {
    /// In a few words.
    pub fn words(&self) -> String {
        if self.mechanism.is_empty() {
            return "unknown: no answer".to_owned();
        }
        let refused = |refused| if refused { "refused" } else { "OPEN" };
        let (canary, parent) = (refused(self.canary_refused), refused(self.parent_refused));
        let open = self.channels.iter().filter(|(_, state)| *state != channels::CLOSED);
        let open: Vec<&str> = open.map(|(name, _)| name.as_str()).collect();
        let closed = self.channels.len() - open.len();
        let mut words = format!(
            "{} (canary {canary}, memory of the parent {parent}; {closed} channels closed",
            self.mechanism
        );
        if !open.is_empty() {
            words += &format!("; open: {}", open.join(", "));
        }
        words + ")"
    }
}

/// Gives up all rights except reading the working folder, and tries every channel to `lures` and to the parent.
pub fn enter(lures: &Lures) -> Isolation {
    let inherited = channels::inherited();
    let namespaces = namespaces::enter();
    let landlock = restrict();
    // Other processes of the same user may not read this one. The call concerns this process alone, so that errors do not matter.
    let _ = set_dumpable_behavior(DumpableBehavior::NotDumpable);
    let channels = channels::all(lures, &inherited, &namespaces);
    let closed = |name: &str| channels.get(name).is_some_and(|state| state == channels::CLOSED);
    Isolation {
        mechanism: mechanism(landlock, &namespaces),
        canary_refused: lures.canary.is_some() && closed("files"),
        parent_refused: closed("memory"),
        channels,
    }
}

fn mechanism(landlock: Option<RestrictionStatus>, namespaces: &namespaces::Parted) -> String {
    let landlock = match landlock.map(|status| status.landlock) {
        Some(LandlockStatus::Available { effective_abi, .. }) => {
            Ok(format!("landlock {}", effective_abi as i32))
        }
        Some(_) => Err("this kernel has no landlock"),
        None => Err("landlock refused"),
    };
    match (landlock, namespaces) {
        (Ok(landlock), parted) => format!("{landlock}, {}", parted.words()),
        // If neither layer closes the file system, there is no isolation.
        (Err(why), parted) if parted.root => format!("{}; {why}", parted.words()),
        (Err(why), parted) => format!("none: {why}, {}", parted.words()),
    }
}

/// The caller treats all failures alike: there are no rules.
fn restrict() -> Option<RestrictionStatus> {
    let here = PathFd::new(".").ok()?;
    let created = Ruleset::default()
        .handle_access(AccessFs::from_all(RULES))
        .and_then(|rules| rules.handle_access(AccessNet::from_all(RULES)))
        .and_then(|rules| rules.scope(Scope::from_all(RULES)))
        .and_then(Ruleset::create)
        .ok()?;
    let readable = AccessFs::ReadFile | AccessFs::ReadDir;
    created.add_rule(PathBeneath::new(here, readable)).and_then(|rules| rules.restrict_self()).ok()
}
