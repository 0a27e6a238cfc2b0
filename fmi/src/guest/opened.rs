//! An FMU unpacked into a temporary folder, which is removed when it is no longer needed.

use std::path::{Path, PathBuf};

use super::slave::Slave;
use super::{Guest, GuestError, Version, unpack};

/// An FMU that is unpacked and described, before its library runs.
#[derive(Debug)]
pub struct Opened {
    /// The description.
    pub guest: Guest,
    library: PathBuf,
    folder: Unpacked,
}

/// A folder that is removed on drop.
#[derive(Debug)]
struct Unpacked(PathBuf);

impl Drop for Unpacked {
    fn drop(&mut self) {
        // If the removal fails, the folder stays among the temporary files.
        let _ = freeplay_storage::remove_folder(&self.0);
    }
}

impl Opened {
    /// Unpacks the FMU `path`; a process may have only one unpacked at a time.
    ///
    /// # Errors
    /// [`GuestError`]: an unusable archive, description or platform.
    pub fn new(path: &Path) -> Result<Opened, GuestError> {
        let folder = Unpacked(std::env::temp_dir().join(format!("freeplay-fmu-{}", std::process::id())));
        freeplay_storage::make_folder(&folder.0)?;
        unpack(path, &folder.0)?;
        let guest = Guest::parse(&freeplay_storage::read_text(&folder.0.join("modelDescription.xml"))?)?;
        let library = library(&folder.0, &guest)?;
        Ok(Opened { guest, library, folder })
    }

    /// Loads the library and initialises the FMU. The library is then mapped and has read its resources, so the function removes
    /// the folder.
    ///
    /// # Errors
    /// [`GuestError::Library`] or [`GuestError::Refused`].
    pub fn start(self) -> Result<Slave, GuestError> {
        Slave::start(&self.guest, &self.library, &self.folder.0.join("resources"))
    }
}

/// The library of the FMU in `folder` for this platform.
fn library(folder: &Path, guest: &Guest) -> Result<PathBuf, GuestError> {
    let arch = std::env::consts::ARCH;
    let platform = match guest.version {
        Version::Two if arch == "x86_64" => "linux64".to_owned(),
        Version::Two => format!("linux-{arch}"),
        Version::Three => format!("{arch}-linux"),
    };
    let wanted = Path::new("binaries").join(platform).join(format!("{}.so", guest.identifier));
    let path = folder.join(&wanted);
    if path.is_file() {
        return Ok(path);
    }
    let found: Vec<String> = freeplay_storage::list(&folder.join("binaries"))
        .map(|entries| {
            entries
                .iter()
                .filter_map(|entry| Some(entry.path.file_name()?.to_string_lossy().into_owned()))
                .collect()
        })
        .unwrap_or_default();
    let found = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
    Err(GuestError::Platform { wanted, found })
}
