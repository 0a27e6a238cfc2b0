//! The file below a writer: private to its owner, whole rows only, and silent after its first error.

use std::io::{self, Write};
use std::path::Path;

use freeplay_storage::{AtomicFile, LiveFile};

/// A byte sink that can be truncated.
pub(crate) trait Store: Write + Send {
    /// Removes everything after the first `length` bytes.
    fn cut(&mut self, length: u64) -> io::Result<()>;

    /// Makes all written bytes durable; an atomic file appears now.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

impl Store for LiveFile {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.truncate(length)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        LiveFile::finish(&self)
    }
}

impl Store for AtomicFile {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.truncate(length)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        Ok(self.commit()?)
    }
}

/// Bytes per system call. A longer call occupies its core for longer: 100 kB for 0.15 to 2.5 ms on a kernel without preemption, in which a loop on that core
/// misses its tick.
const PIECE: usize = 4096;

/// A store that always ends at the end of a block: if a block cannot be written completely, the written part is removed, and no later block is accepted.
pub(crate) struct Output {
    store: Box<dyn Store>,
    kept: u64,
    failed: bool,
}

impl Output {
    /// Begins a file that grows under its name.
    pub fn live(path: &Path) -> io::Result<Self> {
        Ok(Output::over(Box::new(LiveFile::create(path)?)))
    }

    /// Begins a file that appears under its name only when it is finished.
    pub fn atomic(path: &Path) -> io::Result<Self> {
        Ok(Output::over(Box::new(AtomicFile::create(path)?)))
    }

    /// Writes to any store.
    pub fn over(store: Box<dyn Store>) -> Self {
        Output { store, kept: 0, failed: false }
    }

    /// Closes the store, unless a block could not be written; returns its size, bytes.
    pub fn finish(self) -> io::Result<u64> {
        if self.failed {
            return Err(io::Error::other("an earlier block could not be written"));
        }
        self.store.finish()?;
        Ok(self.kept)
    }

    /// Writes a whole block or nothing.
    pub fn block(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.failed {
            return Err(io::Error::other("an earlier block could not be written"));
        }
        let written = bytes.chunks(PIECE).try_for_each(|piece| self.store.write_all(piece));
        match written.and_then(|()| self.store.flush()) {
            Ok(()) => {
                self.kept += bytes.len() as u64;
                Ok(())
            }
            Err(error) => {
                self.failed = true;
                // A device or a pipe cannot be truncated, but nobody reads it back either.
                let _ = self.store.cut(self.kept);
                Err(error)
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::io::{self, Write};
    use std::sync::{Arc, Mutex};

    use super::{Output, Store};

    /// A store in memory that is full after `room` bytes.
    #[derive(Clone, Default)]
    pub struct Disk {
        pub bytes: Arc<Mutex<Vec<u8>>>,
        pub room: usize,
    }

    impl Disk {
        pub fn with_room(room: usize) -> Self {
            Disk { bytes: Arc::default(), room }
        }

        pub fn content(&self) -> Vec<u8> {
            self.bytes.lock().expect("no writer panics").clone()
        }
    }

    impl Write for Disk {
        fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
            let mut bytes = self.bytes.lock().expect("no writer panics");
            let fits = buf.len().min(self.room - bytes.len());
            if fits == 0 && !buf.is_empty() {
                return Err(io::Error::from(io::ErrorKind::StorageFull));
            }
            bytes.extend_from_slice(&buf[..fits]);
            Ok(fits)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Store for Disk {
        fn cut(&mut self, length: u64) -> io::Result<()> {
            self.bytes.lock().expect("no writer panics").truncate(length as usize);
            Ok(())
        }

        fn finish(self: Box<Self>) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_block_is_kept_whole_or_not_at_all() {
        let disk = Disk::with_room(10);
        let mut output = Output::over(Box::new(disk.clone()));
        output.block(b"123456").expect("there is room");
        assert!(output.block(b"7890123").is_err());
        assert!(output.block(b"7").is_err(), "nothing after an error, even if it would fit");
        assert_eq!(disk.content(), b"123456");
    }
}
