//! The function that makes every call to the operating system.

use std::io;

use crate::call::Call;

/// Makes `call` by `act`.
pub(crate) fn perform<T>(call: &Call, act: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
    #[cfg(debug_assertions)]
    return crate::injection::perform(call, act);
    #[cfg(not(debug_assertions))]
    {
        let _ = call;
        act()
    }
}
