//! The line with the present step of a command; any other output removes it first.

use std::sync::Mutex;

use indicatif::ProgressBar;

/// The line, while there is one.
static STEP: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Shows `words` in the line, which `begin` makes if there is none; true on success.
pub(crate) fn show(words: &str, begin: impl FnOnce() -> ProgressBar) -> bool {
    let Ok(mut step) = STEP.lock() else { return false };
    step.get_or_insert_with(begin).set_message(words.to_owned());
    true
}

/// Removes the line before other output.
pub(crate) fn clear() {
    if let Some(bar) = STEP.lock().ok().and_then(|mut step| step.take()) {
        bar.finish_and_clear();
    }
}
