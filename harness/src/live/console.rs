//! Communication of the plant with its parent process: snapshots on standard output, requests on standard input.

use std::io::{BufRead, Write};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use freeplay_plant::{OperatorRequest, OperatorRequests};
use freeplay_terminal::exit::Failure;

use super::LiveSnapshot;
use freeplay_terminal::messages::fault;

/// Largest number of snapshots waiting for the parent; further ones are dropped.
const WAITING: usize = 8;

/// The two threads of the communication.
pub struct Console {
    writer: JoinHandle<()>,
}

impl Console {
    /// Starts forwarding the parent's requests to `requests`. The returned channel takes snapshots.
    /// # Errors
    /// An error of the operating system if it has no threads left.
    pub fn start(requests: OperatorRequests) -> Result<(Self, SyncSender<LiveSnapshot>), Failure> {
        let (sender, snapshots) = sync_channel::<LiveSnapshot>(WAITING);
        let writer = std::thread::Builder::new()
            .name("glances".to_owned())
            .spawn(move || {
                let mut out = std::io::stdout();
                for snapshot in snapshots {
                    let Ok(line) = serde_json::to_string(&snapshot) else { continue };
                    // If the parent no longer listens, that is no fault of the run.
                    if writeln!(out, "{line}").and_then(|()| out.flush()).is_err() {
                        return;
                    }
                }
            })
            .map_err(Failure::no_thread)?;
        // This thread ends with the process, or when the parent closes its end.
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

    /// Waits until the last snapshot is written; close the channel's other end before.
    pub fn finish(self) {
        // A thread that failed has reported its error on standard error.
        let _ = self.writer.join();
    }
}
