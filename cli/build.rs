//! Sets the version of the program with its commit: `FREEPLAY_COMMIT` if that is set, else, in a release build, the commit of the checkout according to git,
//! else the version alone, so that an unpacked archive gives the same build everywhere. A debug build does not ask git: it would be compiled anew after every
//! commit.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-env-changed=FREEPLAY_COMMIT");
    println!("cargo::rerun-if-changed=build.rs");
    let variable = |name| std::env::var(name).unwrap_or_default();
    let given = variable("FREEPLAY_COMMIT");
    let commit = match given.as_str() {
        "" if variable("PROFILE") == "release" => commit().unwrap_or_default(),
        given => given.to_owned(),
    };
    let version = variable("CARGO_PKG_VERSION");
    let version = if commit.is_empty() { version } else { format!("{version} ({commit})") };
    println!("cargo::rustc-env=FREEPLAY_VERSION={version}");
}

/// The commit of the checkout that contains this crate; `None` without git or in a foreign checkout.
fn commit() -> Option<String> {
    if !Path::new("../.git").exists() {
        return None;
    }
    // cargo would take the absence of this file, as in a worktree, for a change.
    if Path::new("../.git/logs/HEAD").exists() {
        println!("cargo::rerun-if-changed=../.git/logs/HEAD");
    }
    let output = Command::new("git").args(["rev-parse", "--short=12", "HEAD"]).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
