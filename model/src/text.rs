//! The texts of model files, and their limits.

use std::path::Path;

use crate::error::{MAX_FILE_BYTES, ModelError};

/// The text of a file no longer than [`MAX_FILE_BYTES`].
pub(crate) fn read_text(path: &Path) -> Result<String, ModelError> {
    let origin = path.display().to_string();
    let bytes =
        freeplay_storage::read_bytes(path, MAX_FILE_BYTES).map_err(|error| match error.refusal() {
            Some(freeplay_storage::Refusal::TooLarge { .. }) => {
                ModelError::TooLarge { origin: origin.clone() }
            }
            _ => ModelError::Read { path: origin.clone(), source: error.into() },
        })?;
    String::from_utf8(bytes)
        .map_err(|error| ModelError::NotUtf8 { path: origin, offset: error.utf8_error().valid_up_to() })
}

/// Refuses a text longer than [`MAX_FILE_BYTES`] or without content.
pub(crate) fn check_extent(text: &str, origin: &str) -> Result<(), ModelError> {
    if text.len() as u64 > MAX_FILE_BYTES {
        return Err(ModelError::TooLarge { origin: origin.to_owned() });
    }
    if text.trim_start_matches('\u{feff}').trim().is_empty() {
        return Err(ModelError::Empty { origin: origin.to_owned() });
    }
    Ok(())
}
