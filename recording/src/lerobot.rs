//! LeRobot data sets: a folder with `meta/info.json`, which names the elements of lists, and episodes in Parquet files.

use std::path::{Path, PathBuf};

use freeplay_storage::Entry;
use serde_json::Value;

use crate::error::ReadError;
use crate::foreign::Foreign;
use crate::input::Source;
use crate::open::open;
use crate::parquet_reader;

const INFO: &str = "meta/info.json";
/// Number of folders above an episode in which the data set may be.
const ABOVE: usize = 4;

/// True if the folder `path` is a data set.
pub(crate) fn is_dataset(path: &Path) -> bool {
    path.join(INFO).is_file()
}

/// All episodes of the data set in the folder `path`.
///
/// # Errors
/// See [`ReadError`].
pub(crate) fn read_folder(path: &Path, source: &Source) -> Result<Foreign, ReadError> {
    let mut files = Vec::new();
    collect(&path.join("data"), &mut files, ABOVE);
    files.sort();
    let mut all: Option<Foreign> = None;
    for file in &files {
        let episode = parquet_reader::read(open(file)?, &Source { file, ..*source })?;
        match &mut all {
            Some(all) => {
                let rows = all.rows() + episode.rows();
                source.check_size(all.names.len(), rows as u64, "give fewer episodes")?;
                all.append(&episode);
            }
            None => all = Some(episode),
        }
    }
    let Some(mut all) = all else {
        let what = format!("a LeRobot data set without a Parquet file in {}", path.join("data").display());
        return Err(ReadError::Unusable { file: path.to_path_buf(), what });
    };
    name_lists(&mut all, &path.join(INFO));
    all.lay_episodes_out();
    Ok(all)
}

/// Names the elements of the lists of one episode, if it belongs to a data set.
pub(crate) fn name_episode(foreign: &mut Foreign, path: &Path) {
    let info =
        path.ancestors().skip(1).take(ABOVE).map(|folder| folder.join(INFO)).find(|info| info.is_file());
    if let Some(info) = info {
        name_lists(foreign, &info);
    }
    foreign.lay_episodes_out();
}

/// The Parquet files in `folder` and, down to so many `levels`, those below it.
fn collect(folder: &Path, files: &mut Vec<PathBuf>, levels: usize) {
    for Entry { path, .. } in freeplay_storage::list(folder).unwrap_or_default() {
        if path.is_dir() && levels > 0 {
            collect(&path, files, levels - 1);
        } else if path.extension().is_some_and(|ending| ending == "parquet") {
            files.push(path);
        }
    }
}

/// Renames the elements of lists, `observation.state[2]`, to the names in `info`: `observation.state.elbow.pos`.
fn name_lists(foreign: &mut Foreign, info: &Path) {
    let parsed =
        freeplay_storage::read_text(info).ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
    let Some(features) = parsed.as_ref().and_then(|info| info["features"].as_object()) else {
        foreign.notes.push(format!("{} can't be read: the elements of lists have no names", info.display()));
        return;
    };
    for (feature, described) in features {
        for (place, name) in names(&described["names"]).into_iter().enumerate() {
            let numbered = format!("{feature}[{place}]");
            if let Some(column) = foreign.names.iter_mut().find(|column| **column == numbered) {
                *column = format!("{feature}.{name}");
            }
        }
    }
}

/// The names in a list, or in the only list of an object (`{"motors": […]}`).
fn names(value: &Value) -> Vec<String> {
    let inner = value.as_object().and_then(|object| object.values().find(|inner| inner.is_array()));
    let listed = inner.unwrap_or(value).as_array();
    listed.into_iter().flatten().filter_map(|name| name.as_str().map(str::to_owned)).collect()
}
