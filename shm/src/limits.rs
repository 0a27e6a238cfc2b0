//! Limits of a run.

/// Longest path of a run's folder, bytes. iceoryx2 accepts paths of up to 255 bytes; its longest path within the folder,
/// `/nodes/<39 digits>/freeplay-<id>_<40 digits>.service_tag`, needs 109 bytes and the id.
pub(crate) const MAX_ROOT: usize = 112;

/// Largest number of slots of a run.
pub const MAX_SLOTS: usize = 8;
