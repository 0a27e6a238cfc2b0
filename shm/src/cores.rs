//! The number of cores.

use std::sync::OnceLock;
use std::thread::available_parallelism;

/// Number of cores that this process may use, read at the first call; a later restriction of a thread to one core does not change
/// it.
pub(crate) fn core_count() -> usize {
    static CORES: OnceLock<usize> = OnceLock::new();
    *CORES.get_or_init(|| available_parallelism().map_or(1, usize::from))
}
