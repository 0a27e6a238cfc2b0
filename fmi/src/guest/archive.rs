//! Unpacking of the archive of an FMU.

use std::io::Read;
use std::path::{Component, Path, PathBuf};

use flate2::read::DeflateDecoder;
use rawzip::{CompressionMethod, ZipArchive};

use super::GuestError;

/// Largest archive, and largest sum of its contents, bytes.
const LONGEST: u64 = 1 << 30;
/// Largest number of entries of an archive.
const MOST: usize = 20_000;

/// Unpacks the FMU `file` into `folder`, which must be empty.
///
/// # Errors
/// [`GuestError::Archive`] for an invalid archive, a name that leads out of the folder, or contents above the limits.
pub fn unpack(file: &Path, folder: &Path) -> Result<(), GuestError> {
    let bytes = freeplay_storage::read_bytes(file, LONGEST)?;
    let bad = GuestError::Archive;
    let archive = ZipArchive::from_slice(&bytes[..])
        .map_err(|error| bad(format!("it is no FMU, which is a ZIP archive ({error})")))?;
    let (mut entries, mut count, mut room) = (archive.entries(), 0, LONGEST);
    while let Some(entry) =
        entries.next_entry().map_err(|error| bad(format!("its archive is damaged ({error})")))?
    {
        count += 1;
        if count > MOST {
            return Err(bad(format!("its archive has more than {MOST} entries")));
        }
        let path = entry.file_path();
        let name = String::from_utf8_lossy(path.as_ref()).into_owned();
        let Some(inside) = inside(&name) else {
            return Err(bad(format!("its archive has the entry {name:?}, which leads out of it")));
        };
        let target = folder.join(inside);
        if name.ends_with('/') {
            freeplay_storage::make_folder(&target)?;
            continue;
        }
        let held = archive
            .get_entry(entry.wayfinder())
            .map_err(|error| bad(format!("{name} is damaged ({error})")))?;
        let mut data: Box<dyn Read> = match entry.compression_method() {
            CompressionMethod::STORE => Box::new(held.data()),
            CompressionMethod::DEFLATE => Box::new(DeflateDecoder::new(held.data())),
            other => return Err(bad(format!("{name} is compressed by {other:?}"))),
        };
        let mut content = Vec::new();
        let read = data.by_ref().take(room + 1).read_to_end(&mut content);
        read.map_err(|error| bad(format!("{name} is damaged ({error})")))?;
        room = room
            .checked_sub(content.len() as u64)
            .ok_or_else(|| bad("it holds more than 1 GiB".to_owned()))?;
        if let Some(parent) = target.parent() {
            freeplay_storage::make_folder(parent)?;
        }
        freeplay_storage::write(&target, content)?;
    }
    Ok(())
}

/// The path of the entry `name` within the archive; `None` if it leads out.
fn inside(name: &str) -> Option<PathBuf> {
    let is_plain = |component: Component| matches!(component, Component::Normal(_) | Component::CurDir);
    let path = Path::new(name);
    let fits = !name.is_empty() && !name.contains(['\\', '\0']) && path.components().all(is_plain);
    fits.then(|| path.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::inside;

    #[test]
    fn no_entry_leads_out() {
        for name in ["../x", "/etc/x", "a/../../x", "a\\..\\x", "", "a\0b"] {
            assert_eq!(inside(name), None, "{name:?}");
        }
        assert!(inside("binaries/x86_64-linux/a.so").is_some());
    }
}
