//! The dependencies between the crates are those of `ARCHITECTURE.md`, and no others.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

type Edges = BTreeMap<String, BTreeSet<String>>;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace")
}

fn short(name: &str) -> String {
    name.trim_start_matches("freeplay-").to_owned()
}

/// The packages of the workspace by their short names, as cargo describes them.
pub fn packages() -> BTreeMap<String, Value> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root())
        .output()
        .expect("cargo runs");
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("metadata is JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    // A reader's own controllers do not belong to the project's crates.
    let own = root().join("controllers");
    let is_ours =
        |package: &&Value| !Path::new(package["manifest_path"].as_str().expect("a path")).starts_with(&own);
    packages
        .iter()
        .filter(is_ours)
        .map(|package| (short(package["name"].as_str().expect("name")), package.clone()))
        .collect()
}

/// The crates of the workspace on which `package` depends, without development dependencies.
fn edges_of(package: &Value) -> BTreeSet<String> {
    let dependencies = package["dependencies"].as_array().expect("dependencies");
    let ours = dependencies.iter().filter(|d| d["path"].is_string() && d["kind"].is_null());
    ours.map(|d| short(d["name"].as_str().expect("name"))).collect()
}

/// The edges according to cargo.
fn actual() -> Edges {
    packages().iter().map(|(name, package)| (name.clone(), edges_of(package))).collect()
}

/// The text of all Rust files in `folder` and below.
fn sources(folder: &Path) -> String {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    entries
        .map(|path| match path.extension() {
            _ if path.is_dir() => sources(&path),
            Some(extension) if extension == "rs" => std::fs::read_to_string(&path).expect("text"),
            _ => String::new(),
        })
        .collect()
}

/// The edges that the architecture allows.
fn allowed() -> Edges {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let section =
        text.split("## Crates").nth(1).expect("the section").split("\n## ").next().expect("its end");
    let rows = section
        .lines()
        .filter(|line| line.starts_with("| ") && !line.contains("---") && !line.contains("may use"));
    rows.map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let uses =
            cells[2].split(',').map(str::trim).filter(|name| !name.is_empty()).map(str::to_owned).collect();
        (cells[0].to_owned(), uses)
    })
    .collect()
}

#[test]
fn crates_depend_on_each_other_as_the_architecture_says() {
    let (actual, allowed) = (actual(), allowed());
    assert!(actual.len() > 8, "found {} crates", actual.len());
    assert_eq!(actual.keys().collect::<Vec<_>>(), allowed.keys().collect::<Vec<_>>());
    for (name, uses) in &actual {
        let extra: Vec<_> = uses.difference(&allowed[name]).collect();
        assert!(extra.is_empty(), "{name} uses {extra:?}, which ARCHITECTURE.md does not allow");
        let idle: Vec<_> = allowed[name].difference(uses).collect();
        assert!(
            idle.is_empty(),
            "ARCHITECTURE.md allows {name} to use {idle:?}, which it does not: strike them off"
        );
    }
}

#[test]
fn every_dependency_on_another_crate_is_used() {
    for (name, package) in &packages() {
        let folder = Path::new(package["manifest_path"].as_str().expect("a path")).with_file_name("src");
        let text = sources(&folder);
        for other in edges_of(package) {
            let named = format!("freeplay_{}::", other.replace('-', "_"));
            assert!(
                text.contains(&named),
                "{name} depends on {other}, which no file in {} names",
                folder.display()
            );
        }
    }
}

/// Every crate that `from` can name, directly or through another, itself included.
fn reached_from(from: &str) -> BTreeSet<String> {
    let edges = actual();
    let mut reached: BTreeSet<String> = BTreeSet::new();
    let mut open = vec![from.to_owned()];
    while let Some(name) = open.pop() {
        if reached.insert(name.clone()) {
            open.extend(edges[&name].iter().cloned());
        }
    }
    reached
}

#[test]
fn a_controller_can_never_name_the_plant() {
    let reached = reached_from("controller");
    assert!(reached.len() > 3 && !reached.contains("plant"), "{reached:?}");
}

#[test]
fn the_concealed_machines_share_no_law_with_their_judge() {
    let reached = reached_from("concealed");
    assert!(reached.contains("arm") && reached.contains("recording"), "{reached:?}");
    for judge in ["diagnosis", "laws", "plant", "controller", "path", "shm", "predictor"] {
        assert!(!reached.contains(judge), "concealed can name {judge}: {reached:?}");
    }
    assert!(!reached_from("diagnosis").contains("concealed"), "the judge can name the generator");
}

#[test]
fn the_products_do_not_know_each_other() {
    for product in ["exam", "proof", "paper"] {
        let reached = reached_from(product);
        for other in ["exam", "proof", "paper", "freeplay"].iter().filter(|other| **other != product) {
            assert!(!reached.contains(*other), "{product} can name {other}: {reached:?}");
        }
    }
}

/// True if the documentation in `text` has an example in Rust, which `cargo test` runs as a test of its own.
fn has_examples(text: &str) -> bool {
    let fences = text.lines().filter_map(|line| {
        let line = line.trim_start();
        line.strip_prefix("///").or_else(|| line.strip_prefix("//!"))?.trim_start().strip_prefix("```")
    });
    // Fences come in pairs; the first of each names the language.
    fences.step_by(2).any(|kind| matches!(kind.trim(), "" | "rust" | "no_run" | "should_panic"))
}

fn is_library(target: &Value) -> bool {
    ["lib", "rlib"].iter().any(|kind| target["kind"][0] == *kind)
}

/// `doctest` in the manifest of a crate is set exactly if its documentation has examples: searching for them costs seconds of a build.
#[test]
fn examples_in_documentation_are_tests_where_there_are_some() {
    for (name, package) in &packages() {
        let targets = package["targets"].as_array().expect("targets");
        let Some(library) = targets.iter().find(|target| is_library(target)) else { continue };
        let folder = Path::new(package["manifest_path"].as_str().expect("a path")).with_file_name("src");
        assert_eq!(
            library["doctest"],
            Value::from(has_examples(&sources(&folder))),
            "{name}: `doctest` in its manifest has to say whether its documentation has examples"
        );
    }
}

/// Source files that access the file system themselves, with the reason.
const NOT_THROUGH_STORAGE: [(&str, &str); 12] = [
    ("storage/src/", "it is the one place"),
    ("recording/src/sqlite_bag.rs", "SQLite opens by path, once it is known to be a regular file"),
    ("shm/src/", "shared memory has rules of its own: other owners, segments, seats"),
    ("plant/src/thread_watch.rs", "reads /proc of its own threads in the loop, without allocating"),
    ("doctor/src/", "reads /proc and /sys, and holds a device open"),
    ("exam/src/faults/kills.rs", "reads /proc of its children and counts segments in shared memory"),
    ("proof/src/blind/protocol.rs", "names the machine from /proc"),
    ("proof/src/blind/channels.rs", "tries what the kernel has to refuse"),
    ("proof/src/blind/namespaces.rs", "looks at what is mounted for an analyst"),
    ("harness/src/live/watch.rs", "reads /proc of its children"),
    ("terminal/src/process.rs", "reads /proc of itself"),
    ("report/src/paste.rs", "resolves links in paths that are shown"),
];

/// The source files of all crates below `folder`, by their path in the workspace.
fn all_sources(folder: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        let name = path.strip_prefix(root()).expect("in the workspace").to_string_lossy().into_owned();
        if path.is_dir() && !name.starts_with("target") && !name.starts_with('.') {
            all_sources(&path, found);
        } else if name.ends_with(".rs") && name.contains("/src/") {
            found.push(name);
        }
    }
}

/// The first line of `text` that accesses the file system, without comments and the unit tests at its end.
fn touches_files(text: &str) -> Option<&str> {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or(text);
    let code = code.split("#[cfg(test)]\npub(crate) mod tests").next().unwrap_or(code);
    let signs = [
        "std::fs",
        "unix::fs::",
        "OpenOptions",
        ".from_path(",
        "rustix::fs::open",
        "generate_to(",
        "Connection::open",
    ];
    let is_opening = |line: &str| {
        line.match_indices("File::").any(|(at, _)| {
            let before = line[..at].chars().next_back();
            let is_whole = !before.is_some_and(|before| before.is_alphanumeric() || before == '_');
            is_whole
                && ["File::open", "File::create", "File::options"]
                    .iter()
                    .any(|call| line[at..].starts_with(call))
        })
    };
    let mut lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.find(|line| is_opening(line) || signs.iter().any(|sign| line.contains(sign)))
}

#[test]
fn files_are_touched_in_one_place() {
    let mut files = Vec::new();
    all_sources(root(), &mut files);
    assert!(files.len() > 300, "{} files", files.len());
    let mut used = BTreeSet::new();
    for name in &files {
        let text = std::fs::read_to_string(root().join(name)).expect("a source file");
        let Some(line) = touches_files(&text) else { continue };
        let allowed = NOT_THROUGH_STORAGE.iter().find(|(start, _)| name.starts_with(start));
        let (start, _) =
            allowed.unwrap_or_else(|| panic!("{name} touches files outside of storage: {}", line.trim()));
        used.insert(*start);
    }
    for (start, reason) in NOT_THROUGH_STORAGE {
        assert!(used.contains(start), "{start} ({reason}) is allowed and touches no file: strike it off");
    }
}

#[test]
fn what_touches_files_is_recognised() {
    for line in [
        "use std::fs;",
        "let file = File::open(path)?;",
        "fs::OpenOptions::new()",
        "use std::os::unix::fs::symlink;",
    ] {
        assert_eq!(touches_files(&format!("fn f() {{\n{line}\n}}")), Some(line));
    }
    for line in ["InputFile::open(path)?;", "// std::fs", "PathKind::File => 1,", "AtomicFile::create(path)"]
    {
        assert_eq!(touches_files(line), None, "{line}");
    }
}
