//! Actions of keys.

use std::time::Duration;

use ratatui::crossterm::event::{Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, poll, read};

/// Help text of the keys.
pub const HELP: &str = "1–8 swap · k kill · h hang/continue · n answer NaN · r restart · m mark · q quit";

/// Action that a person requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Make the controller in this slot the active one.
    Swap(usize),
    /// Kill the active controller (`SIGKILL`).
    Kill,
    /// Stop the active controller (`SIGSTOP`), or continue all that are stopped (`SIGCONT`).
    Hang,
    /// Replace the next answer of the active controller by NaN.
    Spoil,
    /// Restart controllers that have ended.
    Restart,
    /// Mark the recording.
    Mark,
    /// End the run and close its recording properly.
    Quit,
    /// End as an interruption does.
    Interrupt,
    /// No action, because the key has no meaning.
    Nothing(KeyCode),
}

impl Action {
    /// The action of `key`.
    fn of(key: KeyEvent) -> Option<Self> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Some(Self::Interrupt),
            KeyCode::Char(digit @ '1'..='8') => Some(Self::Swap(digit as usize - '1' as usize)),
            KeyCode::Char('k') => Some(Self::Kill),
            KeyCode::Char('h') => Some(Self::Hang),
            KeyCode::Char('n') => Some(Self::Spoil),
            KeyCode::Char('r') => Some(Self::Restart),
            KeyCode::Char('m') => Some(Self::Mark),
            KeyCode::Char('q') | KeyCode::Esc => Some(Self::Quit),
            other => Some(Self::Nothing(other)),
        }
    }

    /// The actions of keys pressed since the last call, in order; the terminal must be in raw mode.
    ///
    /// # Errors
    /// An error of the terminal.
    pub fn pressed() -> std::io::Result<Vec<Self>> {
        let mut actions = Vec::new();
        while poll(Duration::ZERO)? {
            if let Event::Key(key) = read()? {
                actions.extend(Self::of(key));
            }
        }
        Ok(actions)
    }
}

#[cfg(test)]
mod tests {
    use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

    use super::Action;

    #[test]
    fn keys_mean_what_the_help_says() {
        let key = |code, modifiers| Action::of(KeyEvent::new(code, modifiers));
        assert_eq!(key(KeyCode::Char('1'), KeyModifiers::NONE), Some(Action::Swap(0)));
        assert_eq!(key(KeyCode::Char('8'), KeyModifiers::NONE), Some(Action::Swap(7)));
        assert_eq!(key(KeyCode::Char('9'), KeyModifiers::NONE), Some(Action::Nothing(KeyCode::Char('9'))));
        assert_eq!(key(KeyCode::Up, KeyModifiers::NONE), Some(Action::Nothing(KeyCode::Up)));
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::CONTROL), Some(Action::Interrupt));
        assert_eq!(key(KeyCode::Esc, KeyModifiers::NONE), Some(Action::Quit));
    }
}
