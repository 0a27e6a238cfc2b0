//! Checks the references between files of a crate: no cycle is longer than two files, and no folder of the diagnosis refers to one above it.
//!
//! A reference is a path in the code of a file (without comments and unit tests) to another file of its crate: one that begins with `crate`, `super` or `self`.
//! Names that a crate or a folder re-exports refer to the file that defines them. Paths in the file of a folder to the files in that folder do not count: they
//! are its list.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::crate_edges::packages;

/// The folders of the diagnosis, each below the one before.
const ROOMS: [&str; 19] = [
    "sorting",
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

/// A path, word by word from the root of its crate.
type Words = Vec<String>;

/// The source files of a crate by their paths without `.rs`, each with its code; the root of the crate is the empty path.
struct Crate {
    files: BTreeMap<Words, String>,
    /// Re-exports of a file: the target of each name.
    exports: BTreeMap<Words, BTreeMap<String, Words>>,
}

fn words(path: &str) -> Words {
    path.split("::").map(|word| word.trim().to_owned()).filter(|word| !word.is_empty()).collect()
}

/// The text of a file without its unit tests, a module at its end, and without comments.
fn code(text: &str) -> String {
    let is_module = |&(at, _): &(usize, &str)| {
        let head = text[at..].split(['{', ';']).next().unwrap_or_default();
        head.split_whitespace().rev().nth(1) == Some("mod") && text[at + head.len()..].starts_with('{')
    };
    let tests = text.match_indices("#[cfg(test)]").find(is_module);
    let code = &text[..tests.map_or(text.len(), |(at, _)| at)];
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join(" ")
}

fn add_files(folder: &Path, root: &Path, files: &mut BTreeMap<Words, String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            add_files(&path, root, files);
        } else {
            let name = path.strip_prefix(root).expect("a file below").with_extension("");
            let mut name: Words = name.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            if ["mod", "lib", "main"].contains(&name.last().map_or("", String::as_str)) {
                name.pop();
            }
            files.insert(name, code(&std::fs::read_to_string(&path).expect("text")));
        }
    }
}

/// The paths of the use tree `tree`: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn leaves(tree: &str) -> Vec<String> {
    let Some((start, rest)) = tree.split_once('{') else { return vec![tree.trim().to_owned()] };
    let inner = rest.rsplit_once('}').map_or(rest, |(inner, _)| inner);
    let (mut depth, mut parts) = (0, vec![String::new()]);
    for letter in inner.chars() {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        match parts.last_mut() {
            Some(part) if letter != ',' || depth > 0 => part.push(letter),
            _ => parts.push(String::new()),
        }
    }
    let parts = parts.iter().filter(|part| !part.trim().is_empty());
    parts.flat_map(|part| leaves(&format!("{}{}", start.trim(), part.trim()))).collect()
}

/// The use trees of `code` behind `start`, such as `pub use `.
fn use_trees<'a>(code: &'a str, start: &'a str) -> impl Iterator<Item = &'a str> {
    code.match_indices(start).filter_map(move |(at, _)| code[at + start.len()..].split(';').next())
}

/// The path `path`, as written in the file `file`, from the root of the crate; `None` if it leads out of the crate.
fn from_root(file: &Words, path: &str) -> Option<Words> {
    let path = words(path.split(" as ").next()?);
    let mut place = if path.first()? == "crate" { Words::new() } else { file.clone() };
    if !["crate", "super", "self"].contains(&path[0].as_str()) {
        return None;
    }
    for word in path {
        match word.as_str() {
            "crate" | "self" => {}
            "super" => drop(place.pop()),
            _ => place.push(word),
        }
    }
    Some(place)
}

impl Crate {
    fn read(root: &Path) -> Crate {
        let mut files = BTreeMap::new();
        add_files(root, root, &mut files);
        let mut exports: BTreeMap<Words, BTreeMap<String, Words>> = BTreeMap::new();
        for (file, code) in &files {
            let starts = ["pub use ", "pub(crate) use ", "pub(super) use "];
            for path in starts.iter().flat_map(|start| use_trees(code, start)).flat_map(leaves) {
                let place = from_root(file, &path).unwrap_or_else(|| {
                    let plain = path.split(" as ").next().unwrap_or_default();
                    file.iter().cloned().chain(words(plain)).collect()
                });
                let name = path.rsplit([':', ' ']).next().unwrap_or_default().to_owned();
                exports.entry(file.clone()).or_default().insert(name, place);
            }
        }
        Crate { files, exports }
    }

    /// The file that defines the item at `place`, also through re-exports from folder to folder.
    fn file_of(&self, place: &[String]) -> Words {
        let known = (0..=place.len()).rev().find(|&length| self.files.contains_key(&place[..length]));
        let (file, rest) = place.split_at(known.unwrap_or(0));
        let handed = rest.first().and_then(|name| self.exports.get(file)?.get(name));
        handed.filter(|next| *next != place).map_or_else(|| file.to_vec(), |next| self.file_of(next))
    }

    /// The files to which `file` refers.
    fn named(&self, file: &Words) -> BTreeSet<Words> {
        let code = &self.files[file];
        let mut paths: Vec<String> = use_trees(code, "use ").flat_map(leaves).collect();
        for start in ["crate::", "super::", "self::"] {
            for (at, _) in code.match_indices(start) {
                if !code[..at].ends_with(|letter: char| letter.is_alphanumeric() || "_:".contains(letter)) {
                    let is_of_path = |letter: &char| letter.is_alphanumeric() || "_:".contains(*letter);
                    paths.push(code[at..].chars().take_while(is_of_path).collect());
                }
            }
        }
        let places = paths.iter().filter_map(|path| from_root(file, path));
        let mut named: BTreeSet<Words> = places.map(|place| self.file_of(&place)).collect();
        named.retain(|other| other != file && !other.is_empty() && !other.starts_with(file));
        named
    }

    /// The references from file to file; the root of the crate, which lists its files, has none.
    fn arrows(&self) -> BTreeMap<String, BTreeSet<String>> {
        let files = self.files.keys().filter(|file| !file.is_empty());
        files
            .map(|file| (file.join("/"), self.named(file).iter().map(|other| other.join("/")).collect()))
            .collect()
    }
}

/// The cycles: groups of files that refer to each other, directly or indirectly.
fn circles(arrows: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<BTreeSet<&String>> {
    let reached = |start: &String| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
        while let Some(file) = open.pop() {
            open.extend(arrows[file].iter().filter(|next| seen.insert((*next).clone())));
        }
        seen
    };
    let reached: BTreeMap<&String, BTreeSet<String>> =
        arrows.keys().map(|file| (file, reached(file))).collect();
    let circle = |file: &String| -> BTreeSet<&String> {
        let back = reached[file].iter().filter(|other| reached[*other].contains(file));
        back.map(|other| arrows.get_key_value(other).expect("a file").0).collect()
    };
    arrows.keys().map(circle).filter(|circle| circle.len() > 1).collect()
}

#[test]
fn files_that_name_each_other_are_at_most_two() {
    let mut long = Vec::new();
    for (name, package) in packages() {
        let manifest = Path::new(package["manifest_path"].as_str().expect("a path"));
        let arrows = Crate::read(&manifest.with_file_name("src")).arrows();
        let circles = circles(&arrows);
        let count: usize = arrows.values().map(BTreeSet::len).sum();
        println!("{name}: {} files, {count} arrows, circles {circles:?}", arrows.len());
        long.extend(
            circles.iter().filter(|circle| circle.len() > 2).map(|circle| format!("{name}: {circle:?}")),
        );
    }
    assert!(long.is_empty(), "{long:#?}");
}

#[test]
fn no_room_of_the_diagnosis_looks_up() {
    let room = |file: &str| {
        let first = file.split('/').next().unwrap_or_default();
        ROOMS.iter().position(|room| *room == first).unwrap_or_else(|| panic!("{file} is in no room"))
    };
    let arrows = Crate::read(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../diagnosis/src"))).arrows();
    let all = arrows.iter().flat_map(|(from, to)| to.iter().map(move |to| (from, to)));
    let upward: Vec<_> = all.clone().filter(|(from, to)| room(to) > room(from)).collect();
    println!("{} files, {} arrows", arrows.len(), all.count());
    assert!(upward.is_empty(), "{upward:?}");
}

/// The reader of paths detects a cycle over a re-exported name of the root, and over a list of names.
#[test]
fn a_circle_over_re_exports_is_seen() {
    let file = |text: &str| code(text);
    let files: BTreeMap<Words, String> = [
        ("", file("mod a;\nmod b;\nmod c;\npub use a::One;\npub use c::{Three, Four as Five};")),
        ("a", file("use crate::{Five,\n    b::Two};\n")),
        ("b", file("use super::c::Three; // crate::a\n")),
        ("c", file("fn c(_: crate::One) {}\n#[cfg(test)]\nmod tests {\n    use crate::b::Two;\n}\n")),
    ]
    .map(|(name, text)| (words(name), text))
    .into();
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in &files {
        let name = if name.is_empty() { "lib".to_owned() } else { name.join("/") };
        std::fs::write(folder.path().join(name + ".rs"), text).expect("a file");
    }
    let arrows = Crate::read(folder.path()).arrows();
    println!("{arrows:?}");
    assert_eq!(arrows["a"], BTreeSet::from(["b".to_owned(), "c".to_owned()]));
    assert_eq!(arrows["b"], BTreeSet::from(["c".to_owned()]));
    assert_eq!(arrows["c"], BTreeSet::from(["a".to_owned()]));
    assert_eq!(circles(&arrows).len(), 1);
}
