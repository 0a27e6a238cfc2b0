//! The plant's end of the talk with its parent: glances out on standard output, wishes in on standard input.

use std::io::{BufRead, Write};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use freeplay_plant::{Wish, Wishes};
use freeplay_terminal::exit::Failure;

use super::Glance;
use freeplay_terminal::messages::fault;

/// Glances that may wait for the parent; more are not sent.
const WAITING: usize = 8;

/// The two threads of the talk.
pub struct Console {
    writer: JoinHandle<()>,
}

impl Console {
    /// Starts to pass on what the parent wishes to `wishes`; glances go into the channel that is handed back.
    ///
    /// # Errors
    /// What the system says if it has no threads for it.
    pub fn start(wishes: Wishes) -> Result<(Self, SyncSender<Glance>), Failure> {
        let (sender, glances) = sync_channel::<Glance>(WAITING);
        let writer = std::thread::Builder::new()
            .name("glances".to_owned())
            .spawn(move || {
                let mut out = std::io::stdout();
                for glance in glances {
                    let Ok(line) = serde_json::to_string(&glance) else { continue };
                    // A parent that no longer listens is no fault of the run.
                    if writeln!(out, "{line}").and_then(|()| out.flush()).is_err() {
                        return;
                    }
                }
            })
            .map_err(Failure::no_thread)?;
        // Ends with the process, or when the parent closes its end.
        std::thread::Builder::new()
            .name("wishes".to_owned())
            .spawn(move || {
                for line in std::io::stdin().lock().lines() {
                    let Ok(line) = line else { return };
                    match serde_json::from_str::<Wish>(&line) {
                        Ok(wish) if wishes.ask(wish) => {}
                        Ok(wish) => fault(format_args!("{wish:?} is dropped: too many wishes wait")),
                        Err(error) => fault(format_args!("not a wish: {line:?}: {error}")),
                    }
                }
            })
            .map_err(Failure::no_thread)?;
        Ok((Self { writer }, sender))
    }

    /// Waits until the last glance is out; the channel's other end must be closed before.
    pub fn finish(self) {
        // A thread that failed has said why on standard error.
        let _ = self.writer.join();
    }
}
