//! The rooms of the crate follow the data: each names the rooms before it, and none looks up.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The rooms, each below the one before.
const ROOMS: [&str; 18] = [
    "statistics",
    "random",
    "error",
    "signals",
    "conventions",
    "data",
    "candidates",
    "evidence",
    "search",
    "choice",
    "report",
    "findings",
    "compare",
    "servo",
    "next_motion",
    "diagnose",
    "recorded",
    "page",
];

/// Each source file of the crate by its path without `.rs` and `/mod`, and its text without tests.
fn sources(folder: &Path, root: &Path) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(sources(&path, root));
        } else {
            let name = path.strip_prefix(root).unwrap().with_extension("").display().to_string();
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
            let code: Vec<&str> =
                code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
            all.insert(name.trim_end_matches("/mod").to_owned(), code.join("\n"));
        }
    }
    all
}

/// The files that the text of the file `name` names with a path that begins with `crate` or `super`.
fn named(name: &str, text: &str, files: &BTreeSet<String>) -> BTreeSet<String> {
    let mut named = BTreeSet::new();
    for start in ["crate::", "super::"] {
        for (at, _) in text.match_indices(start) {
            if text[..at].ends_with("super::") {
                continue;
            }
            let path: String =
                text[at..].chars().take_while(|c| c.is_alphanumeric() || "_:".contains(*c)).collect();
            let mut parts: Vec<&str> =
                if start == "crate::" { Vec::new() } else { name.split('/').collect() };
            for word in path.split("::").filter(|word| !word.is_empty()) {
                match word {
                    "crate" => parts.clear(),
                    "super" => drop(parts.pop()),
                    word => parts.push(word),
                }
            }
            while !parts.is_empty() && !files.contains(&parts.join("/")) {
                parts.pop();
            }
            let file = parts.join("/");
            if !file.is_empty() && file != name {
                named.insert(file);
            }
        }
    }
    named
}

fn edges() -> BTreeMap<String, BTreeSet<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut sources = sources(&root, &root);
    sources.remove("lib");
    let files: BTreeSet<String> = sources.keys().cloned().collect();
    sources.iter().map(|(name, text)| (name.clone(), named(name, text, &files))).collect()
}

#[test]
fn no_room_looks_up() {
    let room = |file: &str| {
        let first = file.split('/').next().unwrap_or_default();
        ROOMS.iter().position(|room| *room == first).unwrap_or_else(|| panic!("{file} is in no room"))
    };
    let edges = edges();
    let all = edges.iter().flat_map(|(from, to)| to.iter().map(move |to| (from, to)));
    let upward: Vec<_> = all.clone().filter(|(from, to)| room(to) > room(from)).collect();
    println!("{} files, {} arrows", edges.len(), all.count());
    assert!(upward.is_empty(), "{upward:?}");
}

#[test]
fn files_that_name_each_other_are_at_most_two() {
    let edges = edges();
    let reached = |start: &String| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
        while let Some(file) = open.pop() {
            open.extend(edges[file].iter().filter(|next| seen.insert((*next).clone())));
        }
        seen
    };
    let reached: BTreeMap<&String, BTreeSet<String>> =
        edges.keys().map(|file| (file, reached(file))).collect();
    let circle = |file: &String| -> BTreeSet<&String> {
        let back = reached[file].iter().filter(|other| reached[other].contains(file));
        back.collect()
    };
    let circles: BTreeSet<BTreeSet<&String>> =
        edges.keys().map(circle).filter(|circle| circle.len() > 1).collect();
    println!("{circles:?}");
    assert!(circles.iter().all(|circle| circle.len() == 2), "{circles:?}");
}
