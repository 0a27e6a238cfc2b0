//! The number of cores.

use std::sync::OnceLock;
use std::thread::available_parallelism;

/// Number of cores this process may use, as it was when first asked: a thread tied to one core later does not count.
pub(crate) fn cores() -> usize {
    static CORES: OnceLock<usize> = OnceLock::new();
    *CORES.get_or_init(|| available_parallelism().map_or(1, usize::from))
}
