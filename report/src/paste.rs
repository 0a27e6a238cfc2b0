//! Paths in commands that a person pastes: relative to the person's folder, quoted for the shell.

use std::path::{Component, Path, PathBuf};

/// `path` for a command line: relative to the current folder if it is inside, quoted if a shell would change it otherwise.
pub fn shell_word(path: &Path) -> String {
    let here = std::env::current_dir().unwrap_or_default();
    let near = path.strip_prefix(&here).unwrap_or(path);
    quoted(&if near.as_os_str().is_empty() { Path::new(".") } else { near }.to_string_lossy())
}

/// `word` quoted for a POSIX shell: unchanged if it has no special characters, else in single quotes.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-./:,+@%=".contains(c);
    // A word that begins with a hyphen would be an option.
    let word = if word.starts_with('-') { format!("./{word}") } else { word.to_owned() };
    if !word.is_empty() && word.chars().all(is_plain) {
        return word;
    }
    if word.contains(char::is_control) {
        // Bash, zsh and POSIX 2024 read the usual escapes in $'…'; the terminal shows no control character.
        let escaped = word.chars().map(|c| match c {
            '\'' | '\\' => format!("\\{c}"),
            c if c.is_ascii_control() => format!("\\{:03o}", u32::from(c)),
            c => c.to_string(),
        });
        return format!("$'{}'", escaped.collect::<String>());
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// `path` relative to `folder`, so that both may move together; absolute if they share no root.
pub fn seen_from(folder: &Path, path: &Path) -> PathBuf {
    let real = |path: &Path| std::fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    let (Ok(from), Ok(to)) = (real(folder), real(path)) else { return path.to_owned() };
    let shared = from.components().zip(to.components()).take_while(|(one, other)| one == other).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(to.components().skip(shared)).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{quoted, seen_from, shell_word};

    #[test]
    fn a_shell_reads_a_pasted_word_back() {
        for word in
            ["plain.csv", "two words.csv", "it's", "$(rm x)", "a\nb\u{1b}[2J", "-rf", "größe", "a;b", ""]
        {
            let out = std::process::Command::new("bash")
                .args(["-c", &format!("printf %s {}", quoted(word))])
                .output()
                .expect("bash runs");
            let read = String::from_utf8_lossy(&out.stdout);
            assert_eq!(read.strip_prefix("./").filter(|_| word.starts_with('-')).unwrap_or(&read), word);
        }
    }

    #[test]
    fn what_lies_in_the_current_folder_is_named_from_there() {
        let here = std::env::current_dir().expect("a folder");
        assert_eq!(shell_word(&here.join("out/a b.toml")), "'out/a b.toml'");
        assert_eq!(shell_word(Path::new("/elsewhere/x")), "/elsewhere/x");
        assert_eq!(shell_word(&here), ".");
    }

    #[test]
    fn a_path_is_seen_from_a_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let (out, data) = (folder.path().join("out/a"), folder.path().join("data"));
        std::fs::create_dir_all(&out).expect("made");
        std::fs::create_dir_all(&data).expect("made");
        let seen = seen_from(&out, &data.join("r.csv"));
        // A file that does not exist yet keeps its folder's name.
        assert!(seen.ends_with("data/r.csv"), "{}", seen.display());
        std::fs::write(data.join("r.csv"), "t").expect("written");
        assert_eq!(seen_from(&out, &data.join("r.csv")), Path::new("../../data/r.csv"));
    }
}
