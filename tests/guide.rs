//! The guide is correct: the test runs every console block of its pages, in the order of the page, with the files that the page shows.
//!
//! The README is tested in the same way. Blocks ` ```console slow ` take minutes; ignored tests run them, with the README. Commands in ` ```sh ` blocks name
//! files of the reader, so that a test only checks that the command line is valid.
//!
//! A block ` ```console ` has commands behind `$ `. A block ` ```console python ` needs a Python with iceoryx2 and is skipped, with a message, on a machine
//! without it; likewise ` ```console mujoco ` one with mujoco, numpy and scipy, ` ```console fmpy ` one with FMPy, ` ```console pythonfmu ` one with pythonfmu3
//! and a shared library. A block with `file=NAME` is a file that the reader writes.

use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Call, FREEPLAY, fresh_folder};
use freeplay_skip::{Need, skip};

fn root() -> PathBuf {
    std::path::absolute(Path::new(env!("CARGO_MANIFEST_DIR")).join("..")).expect("a path")
}

/// A fenced block of a page: the words behind its fence, and its lines.
struct Block {
    kind: String,
    text: String,
}

fn blocks(page: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut open = false;
    for line in page.lines() {
        match (open, line.strip_prefix("```")) {
            (false, Some(kind)) => {
                blocks.push(Block { kind: kind.trim().to_owned(), text: String::new() });
                open = true;
            }
            (true, Some("")) => open = false,
            (true, _) => {
                let block = blocks.last_mut().expect("a block is open");
                block.text += &format!("{line}\n");
            }
            (false, None) => {}
        }
    }
    assert!(!open, "a fence is never closed");
    blocks
}

/// Python packages that blocks need, by the word behind `console`.
const NEEDS: [(&str, &str); 4] = [
    ("python", "import tomllib, iceoryx2"),
    ("mujoco", "import mujoco, numpy, scipy"),
    ("fmpy", "import fmpy"),
    (
        "pythonfmu",
        "import pythonfmu3, sysconfig; assert sysconfig.get_config_var('Py_ENABLE_SHARED'), 'no shared library'",
    ),
];

/// The Python that has the packages of `word`, if there is one.
fn python_with(word: &str) -> Option<String> {
    let python = std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let (_, packages) = NEEDS.into_iter().find(|(known, _)| *known == word)?;
    let script = format!("{packages}; import sys; print(sys.executable)");
    let output = Command::new(python).args(["-c", &script]).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The Python for controllers, if there is one.
fn python() -> Option<String> {
    python_with("python")
}

/// Runs the page called `name` of the guide without its slow commands; returns the number of commands.
fn play(name: &str) -> usize {
    play_file(&format!("docs/guide/{name}"), false)
}

/// A command of the README without its call of cargo.
fn without_cargo(line: &str) -> String {
    line.replace("cargo run --release --", "freeplay")
}

/// Runs the page `name`, with its slow commands or without; returns the number of commands.
fn play_file(name: &str, with_slow: bool) -> usize {
    let page = std::fs::read_to_string(root().join(name)).expect("the page");
    let binaries = Path::new(FREEPLAY).parent().expect("a folder").to_owned();
    let mut folder = fresh_folder();
    // The reader's folder of the project, except for the files that the page writes.
    symlink(root().join("scenarios"), folder.path().join("scenarios")).expect("linked");
    std::fs::create_dir_all(folder.path().join("target")).expect("made");
    symlink(&binaries, folder.path().join("target/release")).expect("linked");
    std::fs::create_dir_all(folder.path().join("python")).expect("made");
    for part in ["freeplay", "examples"] {
        symlink(root().join("python").join(part), folder.path().join("python").join(part)).expect("linked");
    }
    let python = NEEDS.into_iter().find_map(|(word, _)| python_with(word));
    let folders = python.iter().filter_map(|python| Path::new(python).parent()).map(Path::to_owned);
    let system = std::env::var("PATH").unwrap_or_default();
    let path = std::env::join_paths(folders.chain([binaries]).chain(std::env::split_paths(&system)))
        .expect("a path");
    let mut count = 0;
    for block in blocks(&page) {
        if let Some(file) = block.kind.split(' ').find_map(|part| part.strip_prefix("file=")) {
            std::fs::write(folder.path().join(file), &block.text).expect("written");
        }
        if !block.kind.starts_with("console") || (block.kind == "console slow" && !with_slow) {
            continue;
        }
        let need = NEEDS.into_iter().find(|(word, _)| block.kind.ends_with(word));
        if let Some((word, packages)) = need.filter(|(word, _)| python_with(word).is_none()) {
            let need = match word {
                "pythonfmu" => Need::PythonLibrary,
                _ => Need::Python,
            };
            skip(need, format_args!("no Python for `{packages}`; FREEPLAY_PYTHON names one\n{}", block.text));
            continue;
        }
        for line in block.text.lines().filter_map(|line| line.strip_prefix("$ ")) {
            if line == "cargo test" {
                continue;
            }
            let mut command = Command::new("sh");
            command.args(["-c", &without_cargo(line)]).env("PATH", &path).env_remove("CARGO_MANIFEST_DIR");
            // Acts as if the wheel were installed.
            command.env("PYTHONPATH", root().join("python"));
            let ran = Call::of(folder, command).run();
            println!("{name}: {line}: exit code {:?}", ran.output.status.code());
            assert_eq!(ran.output.status.code(), Some(0), "{name}: {line}\n{}", ran.dump());
            folder = ran.folder;
            count += 1;
        }
    }
    count
}

#[test]
fn writing_a_controller_in_rust() {
    assert!(
        Path::new(FREEPLAY).with_file_name("examples").join("minimal").is_file(),
        "cargo build --workspace --example minimal"
    );
    assert_eq!(play("controller-rust.md"), 4);
}

#[test]
fn writing_a_controller_in_python() {
    let expected = if python().is_some() { 6 } else { 0 };
    assert_eq!(play("controller-python.md"), expected);
}

#[test]
fn working_in_python() {
    let expected = if python().is_some() { 1 } else { 0 };
    assert_eq!(play("python.md"), expected);
}

#[test]
fn spreading_a_campaign() {
    let expected = if python().is_some() { 1 } else { 0 };
    assert_eq!(play("campaigns.md"), expected);
}

#[test]
fn writing_a_scenario() {
    assert_eq!(play("scenario.md"), 3);
}

#[test]
fn ten_minutes() {
    assert_eq!(play("tour.md"), 9);
}

#[test]
fn what_the_paper_leaves_open() {
    assert_eq!(play("paper.md"), 2);
}

#[test]
fn bringing_an_arm() {
    assert_eq!(play("own-arm.md"), 5);
}

#[test]
fn bringing_a_recording() {
    assert_eq!(play("own-recording.md"), 6);
}

#[test]
fn taking_the_arm_to_other_tools() {
    let more = [("mujoco", 1), ("fmpy", 2)].into_iter().filter(|(word, _)| python_with(word).is_some());
    assert_eq!(play("other-tools.md"), 7 + more.map(|(_, commands)| commands).sum::<usize>());
}

#[test]
fn bringing_a_controller_as_an_fmu() {
    let expected = if python_with("pythonfmu").is_some() { 2 } else { 0 };
    assert_eq!(play("controller-fmu.md"), expected);
}

#[test]
fn reading_results() {
    assert_eq!(play("results.md"), 3);
}

#[test]
#[ignore = "minutes without optimisation: .ci/thorough"]
fn slow_commands_of_the_guide() {
    assert_eq!(play_file("docs/guide/own-recording.md", true), 7);
    assert_eq!(play_file("docs/guide/paper.md", true), 3);
    assert_eq!(play_file("docs/guide/learning.md", true), 7);
}

#[test]
#[ignore = "minutes without optimisation: .ci/thorough"]
fn the_readme() {
    assert_eq!(play_file("README.md", true), 4);
}

/// A rendered page does not show the name behind a fence, so that the text before the block has to state it; of two blocks in a row, the text before the first.
#[test]
fn pages_name_the_files_that_the_reader_writes() {
    let guide = std::fs::read_dir(root().join("docs/guide")).expect("a folder").flatten();
    let mut count = 0;
    for page in guide.map(|page| page.path()) {
        let text = std::fs::read_to_string(&page).expect("the page");
        let (mut prose, mut in_block, mut follows) = (String::new(), false, false);
        for line in text.lines() {
            let fence = line.strip_prefix("```");
            if let Some(name) =
                fence.and_then(|kind| kind.split(' ').find_map(|part| part.strip_prefix("file=")))
            {
                assert!(prose.contains(&format!("`{name}`")), "{}: {name}: {prose}", page.display());
                count += 1;
            }
            match (fence, in_block) {
                (Some(_), _) => (in_block, follows) = (!in_block, true),
                (None, false) if !line.is_empty() => {
                    if std::mem::take(&mut follows) {
                        prose.clear();
                    }
                    prose += line;
                }
                _ => {}
            }
        }
    }
    assert!(count >= 10, "{count} files");
}

/// Commands with files of the reader: the command line is valid, the file is missing.
#[test]
fn commands_with_files_of_the_reader_are_understood() {
    let guide = std::fs::read_dir(root().join("docs/guide")).expect("a folder").flatten();
    let pages = guide.map(|page| page.path()).chain([root().join("README.md")]);
    let mut count = 0;
    for page in pages {
        let text = std::fs::read_to_string(&page).expect("the page");
        for block in blocks(&text).iter().filter(|block| block.kind == "sh") {
            for line in block.text.lines().filter_map(|line| line.strip_prefix("freeplay ")) {
                let words: Vec<&str> = line.split_whitespace().collect();
                let ran = Call::new(fresh_folder(), &words).run();
                assert_eq!(ran.code(), 3, "{}: {line}\n{}", page.display(), ran.dump());
                count += 1;
            }
        }
    }
    assert!(count >= 6, "{count} commands");
}

/// Pages for strangers are short, and an index lists each.
#[test]
fn documents_are_short_and_found() {
    let text = |name: &str| std::fs::read_to_string(root().join(name)).expect("the page");
    assert!(text("README.md").lines().count() <= 100, "README.md");
    let architecture = text("ARCHITECTURE.md");
    let (_, rows) = architecture.split_once("## Where to change what").expect("the table");
    let rows = rows.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| ---")).count() - 1;
    assert!(rows <= 30, "ARCHITECTURE.md has {rows} rows");
    let index = text("decisions/README.md");
    for page in std::fs::read_dir(root().join("decisions")).expect("a folder").flatten() {
        let name = page.file_name().to_string_lossy().into_owned();
        assert!(text(&format!("decisions/{name}")).lines().count() <= 60, "{name}");
        assert!(name == "README.md" || index.contains(&format!("({name})")), "{name} is in no index");
    }
}

/// The table of sealed sets is the output of its command.
#[test]
fn the_table_of_sealed_sets_is_drawn() {
    let python = std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python).arg(root().join("docs/blind/table.py")).output();
    let Ok(output) = output else { return skip(Need::Python, "no Python; FREEPLAY_PYTHON names one") };
    let table = std::fs::read_to_string(root().join("docs/blind/sets.md")).expect("the table");
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        table,
        "python docs/blind/table.py > docs/blind/sets.md"
    );
}

#[test]
fn every_page_is_in_the_index() {
    let index = std::fs::read_to_string(root().join("docs/guide/README.md")).expect("the index");
    for page in std::fs::read_dir(root().join("docs/guide")).expect("a folder").flatten() {
        let name = page.file_name().to_string_lossy().into_owned();
        assert!(name == "README.md" || index.contains(&format!("({name})")), "{name} is in no index");
    }
}

/// For a reader who stays in one folder: no command of the README and the guide writes to a place that an earlier page has used, and none overwrites a file of
/// the reader.
#[test]
fn pages_write_to_places_of_their_own() {
    let guide = std::fs::read_dir(root().join("docs/guide")).expect("a folder").flatten();
    let mut owners = std::collections::BTreeMap::new();
    for page in guide.map(|page| page.path()).chain([root().join("README.md")]) {
        let text = std::fs::read_to_string(&page).expect("the page");
        for block in blocks(&text) {
            let file = block.kind.split(' ').find_map(|part| part.strip_prefix("file="));
            let console = block.text.lines().filter(|_| block.kind.starts_with("console"));
            let outs = console.filter_map(|line| line.split_once("--out ")?.1.split_whitespace().next());
            for place in file.into_iter().chain(outs) {
                let earlier = owners.insert(place.to_owned(), page.clone());
                assert_eq!(earlier, None, "{}: {place} is taken", page.display());
            }
        }
    }
    assert!(owners.len() > 40, "{} places", owners.len());
}

/// The reader types in the project's folder: no page writes into a folder of its sources, be it in a console, in Python or in a sentence.
#[test]
fn pages_write_to_no_folder_of_the_project() {
    let entries = std::fs::read_dir(root()).expect("the project").flatten();
    let folders: Vec<String> = entries
        .filter(|entry| entry.path().is_dir())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    assert!(folders.iter().any(|folder| folder == "exam"), "{folders:?}");
    let guide =
        std::fs::read_dir(root().join("docs/guide")).expect("a folder").flatten().map(|page| page.path());
    let others = [
        "README.md",
        "python/README.md",
        "docs/results.md",
        "docs/python-reference.md",
        "cli/src/campaign_command.rs",
    ];
    let mut count = 0;
    for page in guide.chain(others.map(|name| root().join(name))) {
        let text = std::fs::read_to_string(&page).expect("the page");
        for start in ["--out ", "out=\""] {
            for rest in text.split(start).skip(1) {
                let place: String =
                    rest.chars().take_while(|c| c.is_alphanumeric() || "-_./".contains(*c)).collect();
                let place = place.trim_end_matches('/');
                assert!(!folders.iter().any(|folder| folder == place), "{}: {start}{place}", page.display());
                count += 1;
            }
        }
    }
    assert!(count > 40, "{count} places");
}
