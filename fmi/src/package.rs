//! The FMU as one file: a ZIP archive of description, library and arm file.

use std::io::Write;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::DeflateEncoder;
use freeplay_laws::LawError;
use freeplay_model::{ArmFile, to_toml};
use freeplay_storage::StorageError;
use rawzip::{CompressionMethod, ZipArchiveWriter};
use thiserror::Error;

use crate::description::{LIBRARY, description};

/// Name of the arm file among the resources of an FMU.
pub(crate) const MODEL: &str = "model.toml";

/// Largest library, bytes.
const LONGEST: u64 = 1 << 30;

/// Errors when an FMU is written.
#[derive(Debug, Error)]
pub enum PackageError {
    /// An unusable effect.
    #[error(transparent)]
    Law(#[from] LawError),
    /// The shared library is missing next to the program.
    #[error(
        "the shared library that an FMU carries, lib{LIBRARY}.so, is neither in {} nor in {}; `cargo build --release -p freeplay-fmi` in the project's folder \
         makes target/release/lib{LIBRARY}.so: copy it there, or name it in FREEPLAY_FMI_LIBRARY",
        folder.display(), shared(folder).display()
    )]
    NoLibrary {
        /// The folder of the program.
        folder: PathBuf,
    },
    /// This platform is not one of FMI's.
    #[error("FMUs are written for Linux on x86_64 or aarch64, not for this machine")]
    Platform,
    /// The archive cannot be created.
    #[error("the archive of the FMU can't be made: {0}")]
    Archive(String),
    /// A file cannot be read or written.
    #[error(transparent)]
    Storage(#[from] StorageError),
}

/// Writes the FMU of `file` to `out` atomically. The library is the one named by `FREEPLAY_FMI_LIBRARY`, or else the one next to `program`, or else the one
/// of its installation: `lib/freeplay` next to the program's folder.
///
/// # Errors
/// [`PackageError`]
pub fn write_fmu(file: &ArmFile, program: &Path, out: &Path) -> Result<(), PackageError> {
    let library = freeplay_storage::read_bytes(&library(program)?, LONGEST)?;
    let text = to_toml(file);
    let xml = description(file, &text)?;
    let platform = platform().ok_or(PackageError::Platform)?;
    let entries: [(String, &[u8]); 3] = [
        ("modelDescription.xml".to_owned(), xml.as_bytes()),
        (format!("binaries/{platform}/{LIBRARY}.so"), &library),
        (format!("resources/{MODEL}"), text.as_bytes()),
    ];
    let bytes = archive(&entries)?;
    Ok(freeplay_storage::write(out, bytes)?)
}

/// The path of the library to pack.
fn library(program: &Path) -> Result<PathBuf, PackageError> {
    if let Some(named) = std::env::var_os("FREEPLAY_FMI_LIBRARY") {
        return Ok(named.into());
    }
    let folder = program.parent().unwrap_or(Path::new(".")).to_owned();
    let name = format!("lib{LIBRARY}.so");
    // Cargo puts the library of a dependency into `deps`; a library next to the program was built separately and may be older. The wheel installs the
    // program in `bin` and the library in `lib/freeplay` of one environment.
    let folders = [folder.join("deps"), folder.clone(), shared(&folder)];
    let found = folders.into_iter().map(|folder| folder.join(&name)).find(|path| path.is_file());
    found.ok_or(PackageError::NoLibrary { folder })
}

/// The library folder of an installation with its programs in `folder`.
fn shared(folder: &Path) -> PathBuf {
    folder.parent().unwrap_or(folder).join("lib").join("freeplay")
}

/// FMI's name of this platform.
fn platform() -> Option<&'static str> {
    match (std::env::consts::OS, std::env::consts::ARCH) {
        ("linux", "x86_64") => Some("x86_64-linux"),
        ("linux", "aarch64") => Some("aarch64-linux"),
        _ => None,
    }
}

/// A ZIP archive of `entries`: names and contents.
///
/// # Errors
/// [`PackageError::Archive`]
pub fn archive(entries: &[(String, &[u8])]) -> Result<Vec<u8>, PackageError> {
    let failed = |error: &dyn std::fmt::Display| PackageError::Archive(error.to_string());
    let mut archive = ZipArchiveWriter::new(Vec::new());
    for (name, bytes) in entries {
        let file = archive.new_file(name.as_str()).compression_method(CompressionMethod::DEFLATE);
        let (mut entry, config) = file.start().map_err(|error| failed(&error))?;
        let mut writer = config.wrap(DeflateEncoder::new(&mut entry, Compression::default()));
        writer.write_all(bytes).map_err(|error| failed(&error))?;
        let (encoder, descriptor) = writer.finish().map_err(|error| failed(&error))?;
        encoder.finish().map_err(|error| failed(&error))?;
        entry.finish(descriptor).map_err(|error| failed(&error))?;
    }
    archive.finish().map_err(|error| failed(&error))
}
