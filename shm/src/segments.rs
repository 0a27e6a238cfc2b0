//! The shared memory objects of a run. iceoryx2 keeps them beside those of all other programs, told apart by a prefix.

use std::fs::{self, File, Permissions};
use std::io::{self, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use crate::address::Address;

/// Where Linux keeps POSIX shared memory objects.
pub(crate) const SEGMENTS: &str = "/dev/shm";

/// Second part of the name of the file that says where the folder of a run is, so that what a dead run left is found even
/// when its folder is gone.
const MARK: &str = "_root";

/// How long a segment may stay empty, ms: a living process gives it its size within microseconds of making it.
const BIRTH_MS: u32 = 200;

/// Writes beside the run's segments where its folder is.
pub(crate) fn mark(address: &Address) -> io::Result<()> {
    let path = Path::new(SEGMENTS).join(format!("{}{MARK}", address.prefix()));
    let mut file = File::options().write(true).create_new(true).mode(0o600).open(path)?;
    write!(file, "{address}")
}

/// The runs that have left a mark, be they dead or alive.
pub(crate) fn marked() -> Vec<Address> {
    let entries = fs::read_dir(SEGMENTS).into_iter().flatten().flatten();
    let marks = entries.filter(|entry| {
        let name = entry.file_name();
        name.as_encoded_bytes().starts_with(b"freeplay-")
            && name.as_encoded_bytes().ends_with(MARK.as_bytes())
    });
    marks.filter_map(|mark| fs::read_to_string(mark.path()).ok()?.parse().ok()).collect()
}

/// Gives the owner alone access: iceoryx2 makes one segment, a counter of nodes, that everybody may write to.
pub(crate) fn make_private(address: &Address) -> io::Result<()> {
    for path in segments(address) {
        if fs::metadata(&path)?.permissions().mode() & 0o077 != 0 {
            fs::set_permissions(&path, Permissions::from_mode(0o600))?;
        }
    }
    Ok(())
}

/// Removes what processes left that were killed between making a segment and giving it its size. iceoryx2 0.10 would wait
/// for such a segment for ever (`posix_shared_memory::Builder::open_impl` tries again on an empty segment, whatever its
/// timeout), also when it cleans up after the dead.
pub(crate) fn remove_unborn(address: &Address) {
    let mut unborn: Vec<PathBuf> = segments(address).filter(|path| is_empty(path)).collect();
    for _ in 0..BIRTH_MS {
        if unborn.is_empty() {
            return;
        }
        sleep(Duration::from_millis(1));
        unborn.retain(|path| is_empty(path));
    }
    for path in unborn {
        let _ = fs::remove_file(path);
    }
}

/// Removes all segments of the run.
pub(crate) fn remove_all(address: &Address) {
    for path in segments(address) {
        let _ = fs::remove_file(path);
    }
}

fn segments(address: &Address) -> impl Iterator<Item = PathBuf> {
    let prefix = address.prefix();
    let entries = fs::read_dir(SEGMENTS).into_iter().flatten().flatten();
    entries
        .filter(move |entry| entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()))
        .map(|entry| entry.path())
}

fn is_empty(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|metadata| metadata.len() == 0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn only_empty_segments_of_this_run_are_removed_and_only_if_they_stay_empty() {
        let id = format!("test-{}", std::process::id());
        let address = Address::parse(&format!("/dev/shm/freeplay-test/{id}")).unwrap();
        let path = |name: &str| Path::new(SEGMENTS).join(format!("freeplay-{id}{name}"));
        let [dead, born, full, other] = [path("_dead"), path("_born"), path("_full"), path("0_other")];
        for empty in [&dead, &born, &other] {
            fs::write(empty, "").unwrap();
        }
        fs::write(&full, "full").unwrap();
        let grown = born.clone();
        let birth = std::thread::spawn(move || {
            sleep(Duration::from_millis(u64::from(BIRTH_MS) / 4));
            fs::write(grown, "born").unwrap();
        });
        remove_unborn(&address);
        birth.join().unwrap();
        assert_eq!([&dead, &born, &full, &other].map(|path| path.exists()), [false, true, true, true]);
        remove_all(&address);
        assert_eq!([&born, &full, &other].map(|path| path.exists()), [false, false, true]);
        fs::remove_file(other).unwrap();
    }
}
