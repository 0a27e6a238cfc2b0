//! A threshold is a debt: every numeric constant of this crate states the reason for its value, and their number does not grow.

use std::path::Path;

/// Largest number of numeric constants of this crate. A change that makes one unnecessary lowers this number; no change raises it.
const MOST: usize = 186;

/// A `const` item with a numeric value.
#[derive(Debug, PartialEq)]
struct Constant {
    name: String,
    value: String,
    /// Its doc comment.
    doc: String,
}

impl Constant {
    /// Returns true if its doc comment continues after the definition of the constant.
    fn has_reason(&self) -> bool {
        let doc = self.doc.trim_end_matches('.');
        [": ", "; ", ". ", " because ", " since ", " so that "].iter().any(|joint| doc.contains(joint))
    }
}

/// The constants of a source `text` without its unit tests, including those inside functions.
fn constants(text: &str) -> Vec<Constant> {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let lines: Vec<&str> = code.lines().map(str::trim).collect();
    let constant = |(at, line): (usize, &&str)| {
        let item =
            line.split_once("const ").filter(|(before, _)| before.is_empty() || before.starts_with("pub"))?.1;
        let (name, typed) = item.split_once(": ")?;
        let (kind, begin) = typed.split_once(" =")?;
        let kind = kind.trim_start_matches('[');
        let is_numeric =
            ["f64", "f32", "usize", "u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64", "isize"]
                .iter()
                .any(|number| kind.split(';').next() == Some(number));
        if !is_numeric
            || !name.chars().all(|letter| letter.is_ascii_uppercase() || "_0123456789".contains(letter))
        {
            return None;
        }
        let value = std::iter::once(begin).chain(lines[at + 1..].iter().copied());
        let ends = value.clone().position(|line| line.ends_with(';'))?;
        let doc: Vec<&str> = lines[..at].iter().rev().map_while(|line| line.strip_prefix("/// ")).collect();
        Some(Constant {
            name: name.to_owned(),
            value: value.take(ends + 1).collect::<String>().trim_matches([' ', ';']).to_owned(),
            doc: doc.into_iter().rev().collect::<Vec<_>>().join(" "),
        })
    };
    lines.iter().enumerate().filter_map(constant).collect()
}

/// The sources in `folder`, file by file.
fn sources(folder: &Path) -> Vec<(String, String)> {
    let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    let of = |path: &std::path::PathBuf| match path.is_dir() {
        true => sources(path),
        false => vec![(path.display().to_string(), std::fs::read_to_string(path).unwrap())],
    };
    entries.iter().flat_map(of).collect()
}

#[test]
fn every_constant_has_a_reason_and_none_is_added() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut count, mut bare) = (0, Vec::new());
    for (file, text) in sources(&root) {
        let file = file.trim_start_matches(&root.display().to_string()).to_owned();
        for constant in constants(&text) {
            println!("{} = {} ({file}): {}", constant.name, constant.value, constant.doc);
            count += 1;
            bare.extend((!constant.has_reason()).then(|| format!("{} in {file}", constant.name)));
        }
    }
    println!("{count} constants");
    assert!(
        bare.is_empty(),
        "the doc comments of these constants give no reason for their values: {bare:#?}"
    );
    assert!(
        count > 0 && count <= MOST,
        "{count} constants, {MOST} before: find the principle that makes the new one unnecessary"
    );
}

#[test]
fn constants_are_found_wherever_they_stand() {
    let found = constants(
        "/// Share of a range: the rest is noise.\npub(crate) const SHARE: f64 = 0.2;\nfn f() {\n    const MOST: [usize; 2] =\n        [1, 2];\n}\n\
         const NAME: &str = \"a: b\";\n#[cfg(test)]\nmod tests {\n    const ROWS: usize = 3;\n}\n",
    );
    let names: Vec<(&str, &str)> = found.iter().map(|one| (&*one.name, &*one.value)).collect();
    assert_eq!(names, [("SHARE", "0.2"), ("MOST", "[1, 2]")]);
    assert_eq!([found[0].has_reason(), found[1].has_reason()], [true, false]);
}
