//! The documented layout, the C header and the Python structures must equal those of the Rust types.

use std::path::{Path, PathBuf};
use std::process::Command;

use freeplay_shm::LAYOUT_VERSION;
use freeplay_shm::layout::{Field, Layout, messages};
use freeplay_shm::layout_text::{c_header, markdown};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn has(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Runs `command` and returns its output; on failure, panics with the error output.
fn printed(command: &mut Command) -> String {
    let output = command.output().expect("it starts");
    assert!(output.status.success(), "{command:?}\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn every_byte_of_a_message_is_described_once() {
    for layout in messages() {
        let end = layout.fields.iter().fold(0, |end, field| {
            assert_eq!(field.offset, end, "{}.{}", layout.name, field.name);
            end + field.size
        });
        assert_eq!(end, layout.size, "{}", layout.name);
    }
}

#[test]
fn the_files_are_those_that_the_types_make() {
    for (name, made) in [("docs/messages.md", markdown()), ("docs/freeplay.h", c_header())] {
        let found = std::fs::read_to_string(root().join(name)).expect("the file is there");
        let differing = found.lines().zip(made.lines()).position(|(found, made)| found != made);
        let says = "make it again: cargo run -p freeplay-shm --example layout";
        assert!(found == made, "{name} differs, first in line {differing:?}; {says}");
    }
    assert!(markdown().contains(&format!("Layout version **{LAYOUT_VERSION}**")));
}

/// The assertions in the header hold in C and in C++; a compiler that disagrees with Rust on an offset refuses the header.
#[test]
fn a_c_compiler_agrees() {
    let header = root().join("docs/freeplay.h");
    let folder = tempfile::tempdir().expect("a folder");
    for (compiler, standard, source) in [("cc", "-std=c11", "t.c"), ("c++", "-std=c++11", "t.cpp")] {
        if !has(compiler) {
            freeplay_skip::skip(freeplay_skip::Need::Compiler, format_args!("no {compiler}"));
            continue;
        }
        let source = folder.path().join(source);
        let check = |text: &str| {
            std::fs::write(&source, text).expect("written");
            Command::new(compiler)
                .args([standard, "-Wall", "-Wextra", "-Werror", "-fsyntax-only"])
                .arg(&source)
                .output()
                .expect("it starts")
        };
        let good = format!("#include \"{}\"\n", header.display());
        let output = check(&good);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let bad = format!("{good}static_assert(sizeof(freeplay_state) == 1, \"wrong on purpose\");\n");
        assert!(!check(&bad).status.success(), "{compiler} looks at assertions");
    }
}

/// A field in the format of the Python structures.
fn line(layout: &Layout, field: &Field) -> String {
    format!("{}.{} {} {}", layout.name, field.name, field.offset, field.size)
}

#[test]
fn the_python_structures_are_the_same() {
    let python = std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    if !has(&python) {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            format_args!("no {python}; FREEPLAY_PYTHON names one"),
        );
        return;
    }
    let script = "import ctypes, freeplay\n\
                  print(freeplay.LAYOUT_VERSION)\n\
                  for name in ('Reference', 'State', 'Command', 'Hello', 'Welcome'):\n\
                  \x20   kind = getattr(freeplay, name)\n\
                  \x20   assert kind.type_name() == 'freeplay.' + name\n\
                  \x20   for field, *_ in kind._fields_:\n\
                  \x20       at = getattr(kind, field)\n\
                  \x20       print(f'{name}.{field}', at.offset, at.size)\n";
    let found = printed(Command::new(python).args(["-c", script]).env("PYTHONPATH", root().join("python")));
    let expected: Vec<String> = std::iter::once(LAYOUT_VERSION.to_string())
        .chain(
            messages()
                .iter()
                .flat_map(|layout| layout.fields.iter().map(|field| line(layout, field)).collect::<Vec<_>>()),
        )
        .collect();
    assert_eq!(found.lines().collect::<Vec<_>>(), expected);
}
