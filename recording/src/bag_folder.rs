//! Folders of bags: `ros2 bag record` makes one, with `metadata.yaml` and one or several files; `rosbag record --split` leaves several files.

use std::path::{Path, PathBuf};

use crate::error::ReadError;

const METADATA: &str = "metadata.yaml";
/// Endings of files that may be bags, if no metadata name them.
const ENDINGS: [&str; 3] = ["mcap", "db3", "bag"];

/// True if there are bags in the folder `path`.
pub(crate) fn is_bag(path: &Path) -> bool {
    path.join(METADATA).is_file() || !found(path).is_empty()
}

/// The files of a bag in a folder.
pub(crate) struct Files {
    /// The existing ones, in order.
    pub there: Vec<PathBuf>,
    /// Names of missing files that the metadata list.
    pub gone: Vec<String>,
}

/// The files of the bag in the folder `path`.
///
/// # Errors
/// [`ReadError::Folder`] if there are none.
pub(crate) fn files(path: &Path) -> Result<Files, ReadError> {
    let named =
        freeplay_storage::read_text(&path.join(METADATA)).map(|text| named(&text)).unwrap_or_default();
    let (there, gone): (Vec<PathBuf>, Vec<PathBuf>) =
        named.iter().map(|name| path.join(name)).partition(|file| file.is_file());
    let there = if there.is_empty() { found(path) } else { there };
    if there.is_empty() {
        return Err(ReadError::Folder { file: path.to_path_buf() });
    }
    let names = gone.iter().filter_map(|file| file.file_name());
    Ok(Files { there, gone: names.map(|name| name.to_string_lossy().into_owned()).collect() })
}

/// The files that `relative_file_paths` of a `metadata.yaml` lists.
fn named(metadata: &str) -> Vec<String> {
    let mut lines =
        metadata.lines().map(str::trim).skip_while(|line| !line.starts_with("relative_file_paths:"));
    let inline =
        lines.next().and_then(|line| line.split_once('[')).map(|(_, list)| list.trim_end_matches(']'));
    let unquoted = |name: &str| name.trim().trim_matches(['"', '\'']).to_owned();
    if let Some(inline) = inline {
        return inline.split(',').map(unquoted).filter(|name| !name.is_empty()).collect();
    }
    lines.map_while(|line| line.strip_prefix("- ")).map(unquoted).collect()
}

/// Files in the folder `path` with the ending of a bag; parts of one bag in the order of their numbers.
fn found(path: &Path) -> Vec<PathBuf> {
    let entries = freeplay_storage::list(path).unwrap_or_default().into_iter().map(|entry| entry.path);
    let is_bag = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let name = name.strip_suffix(".zstd").unwrap_or(&name);
        file.is_file() && ENDINGS.iter().any(|ending| name.ends_with(&format!(".{ending}")))
    };
    let mut files: Vec<PathBuf> = entries.filter(is_bag).collect();
    files.sort_by_key(|file| {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let number = crate::guess::words_of(&name).iter().rev().find_map(|word| word.parse::<u64>().ok());
        (number, name)
    });
    files
}

#[cfg(test)]
mod tests {
    use super::named;

    #[test]
    fn files_are_listed_in_the_order_of_the_metadata() {
        let text = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    - run_0.db3\n    - \"run_1.db3\"\n  duration:\n    nanoseconds: 1\n";
        assert_eq!(named(text), ["run_0.db3", "run_1.db3"]);
        assert_eq!(named("relative_file_paths: [a.mcap, b.mcap]\n"), ["a.mcap", "b.mcap"]);
        assert!(named("").is_empty());
    }
}
