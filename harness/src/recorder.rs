//! The recorder's thread: it writes the recording and the hash from the ticks of the loop, so that the loop does no I/O.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam::queue::ArrayQueue;
use freeplay_plant::TickRecord;
use freeplay_recording::{RowWriter, WriteError};
use freeplay_terminal::hex::hex;
use sha2::{Digest, Sha256};

use crate::columns::RunColumns;
use crate::live::Observer;

/// Capacity of the queue between loop and recorder, ticks.
pub const QUEUE: usize = 4096;

/// Sleep of the recorder while the queue is empty.
const NAP: Duration = Duration::from_millis(2);

/// Results of the recorder.
#[derive(Debug)]
pub struct Kept {
    /// SHA-256 of every State and Command, without the wall-clock times.
    pub state_hash: String,
    /// Error that ended the recording early, if there was one; the rows written before stay readable.
    pub fault: Option<WriteError>,
    /// Path of the recording, if there is one.
    pub recording: Option<PathBuf>,
}

/// The recorder's thread.
pub struct Recorder {
    finished: Arc<AtomicBool>,
    thread: std::thread::JoinHandle<Kept>,
}

impl Recorder {
    /// Starts moving rows from `queue` to `writer`; `observer` sees each of them.
    ///
    /// # Errors
    /// An error of the operating system if it has no thread left.
    pub fn start(
        queue: Arc<ArrayQueue<TickRecord>>,
        columns: RunColumns,
        writer: Option<(PathBuf, RowWriter)>,
        observer: Option<Observer>,
    ) -> std::io::Result<Self> {
        let finished = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&finished);
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || keep(&queue, &columns, writer, observer, &told))?;
        Ok(Self { finished, thread })
    }

    /// Waits until all ticks are recorded. Returns `None` if the recorder itself failed.
    pub fn finish(self) -> Option<Kept> {
        self.finished.store(true, Ordering::Release);
        self.thread.join().ok()
    }
}

fn keep(
    queue: &ArrayQueue<TickRecord>,
    columns: &RunColumns,
    writer: Option<(PathBuf, RowWriter)>,
    mut observer: Option<Observer>,
    finished: &AtomicBool,
) -> Kept {
    let mut hash = Sha256::new();
    let mut row = Vec::new();
    let (recording, mut writer) = writer.unzip();
    let mut fault = None;
    loop {
        // Read the flag before emptying the queue, so that ticks pushed in between are recorded as well.
        let last = finished.load(Ordering::Acquire);
        while let Some(record) = queue.pop() {
            record.digest(&mut hash);
            if let Some(observer) = &mut observer {
                observer.see(&record);
            }
            columns.fill(&record, &mut row);
            if let Some(Err(error)) = writer.as_mut().map(|writer| writer.write(&row)) {
                fault = Some(error);
                writer = None;
            }
        }
        if let Some(observer) = &mut observer {
            observer.send_if_due(last);
        }
        if last {
            break;
        }
        std::thread::sleep(NAP);
    }
    if let Some(Err(error)) = writer.map(RowWriter::finish) {
        fault = Some(error);
    }
    let state_hash = hex(&hash.finalize());
    Kept { state_hash, fault, recording }
}
