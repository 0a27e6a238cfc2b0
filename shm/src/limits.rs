//! Limits of a run.

/// Longest path of a run's folder, bytes. iceoryx2 takes paths of up to 255 bytes; the longest it makes within the folder,
/// `/nodes/<39 digits>/freeplay-<id>_<40 digits>.service_tag`, takes 109 and the id.
pub(crate) const MAX_ROOT: usize = 112;

/// Largest number of slots of a run.
pub const MAX_SLOTS: usize = 8;
