//! The line that says which step a command is at; whatever else is shown removes it first.

use std::sync::Mutex;

use indicatif::ProgressBar;

/// The line, while there is one.
static STEP: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Says `words` in the line, which `begin` makes where there is none; whether that was possible.
pub(crate) fn show(words: &str, begin: impl FnOnce() -> ProgressBar) -> bool {
    let Ok(mut step) = STEP.lock() else { return false };
    step.get_or_insert_with(begin).set_message(words.to_owned());
    true
}

/// Removes the line: something else is going to be shown.
pub(crate) fn clear() {
    if let Some(bar) = STEP.lock().ok().and_then(|mut step| step.take()) {
        bar.finish_and_clear();
    }
}
