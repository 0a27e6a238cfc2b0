//! The plant's end of the talk with its parent: snapshots out on standard output, requests in on standard input.

use std::io::{BufRead, Write};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use freeplay_plant::{OperatorRequest, OperatorRequests};
use freeplay_terminal::exit::Failure;

use super::LiveSnapshot;
use freeplay_terminal::messages::fault;

/// Glances that may wait for the parent; more are not sent.
const WAITING: usize = 8;

/// The two threads of the talk.
pub struct Console {
    writer: JoinHandle<()>,
}

impl Console {
    /// Starts to pass on what the parent requests to `requests`; snapshots go into the channel that is handed back.
    ///
    /// # Errors
    /// What the system says if it has no threads for it.
    pub fn start(requests: OperatorRequests) -> Result<(Self, SyncSender<LiveSnapshot>), Failure> {
        let (sender, snapshots) = sync_channel::<LiveSnapshot>(WAITING);
        let writer = std::thread::Builder::new()
            .name("glances".to_owned())
            .spawn(move || {
                let mut out = std::io::stdout();
                for snapshot in snapshots {
                    let Ok(line) = serde_json::to_string(&snapshot) else { continue };
                    // A parent that no longer listens is no fault of the run.
                    if writeln!(out, "{line}").and_then(|()| out.flush()).is_err() {
                        return;
                    }
                }
            })
            .map_err(Failure::no_thread)?;
        // Ends with the process, or when the parent closes its end.
        std::thread::Builder::new()
            .name("requests".to_owned())
            .spawn(move || {
                for line in std::io::stdin().lock().lines() {
                    let Ok(line) = line else { return };
                    match serde_json::from_str::<OperatorRequest>(&line) {
                        Ok(request) if requests.ask(request) => {}
                        Ok(request) => {
                            fault(format_args!("{request:?} is dropped: too many requests are waiting"))
                        }
                        Err(error) => fault(format_args!("not a request: {line:?}: {error}")),
                    }
                }
            })
            .map_err(Failure::no_thread)?;
        Ok((Self { writer }, sender))
    }

    /// Waits until the last snapshot is out; the channel's other end must be closed before.
    pub fn finish(self) {
        // A thread that failed has said why on standard error.
        let _ = self.writer.join();
    }
}
