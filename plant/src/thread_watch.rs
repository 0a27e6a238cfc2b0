//! The kernel's counters of a thread, read from open files into a buffer, so that the loop can read them.

use std::fs::File;
use std::os::unix::fs::FileExt;

use crate::cause::ThreadDelays;

/// Longest line, bytes.
const LONGEST: usize = 1024;

/// The counters of one thread since it began: `schedstat` (time on a core, time waiting for one, number of times on one) and `stat` (page
/// faults: the same counters as `getrusage`, but also for other processes).
#[derive(Debug)]
pub struct ThreadWatch {
    schedstat: File,
    stat: File,
}

impl ThreadWatch {
    /// A watch of the first thread of the process `pid`; `None` if the system gives no counters.
    pub fn of_process(pid: u32) -> Option<Self> {
        Self::open(&format!("/proc/{pid}/task/{pid}"))
    }

    /// A watch of the calling thread.
    pub fn of_this_thread() -> Option<Self> {
        Self::open("/proc/thread-self")
    }

    fn open(folder: &str) -> Option<Self> {
        // The link `thread-self` has a different target in each thread; the folder behind it is fixed.
        let folder = std::fs::canonicalize(folder).ok()?;
        let open = |name: &str| File::open(folder.join(name)).ok();
        Some(Self { schedstat: open("schedstat")?, stat: open("stat")? })
    }

    /// The present counters; zero after the thread's end. Two system calls, some microseconds; allocates nothing.
    pub fn read(&self) -> ThreadDelays {
        let mut buffer = [0; LONGEST];
        let mut times = numbers(read(&self.schedstat, &mut buffer));
        let [ran_ns, waited_ns, turns] = std::array::from_fn(|_| times.next().unwrap_or(0));
        drop(times);
        let stat = read(&self.stat, &mut buffer);
        // The name of the program, field 2, may contain any character: the fields are counted from its closing parenthesis.
        let from = stat.iter().rposition(|&byte| byte == b')').map_or(stat.len(), |at| at + 1);
        let mut fields = stat[from..].split(u8::is_ascii_whitespace).filter(|field| !field.is_empty());
        let is_stopped = fields.next().is_some_and(|state| matches!(state, b"T" | b"t"));
        let minor_faults = fields.nth(10 - 4).map_or(0, number);
        let major_faults = fields.nth(1).map_or(0, number);
        ThreadDelays { ran_ns, turns, is_stopped, waited_ns, major_faults, minor_faults }
    }
}

/// The time that the hypervisor has taken from the machine, ns.
#[derive(Debug)]
pub struct StealWatch {
    stat: File,
}

impl StealWatch {
    /// Length of a step of the counter, ns: `USER_HZ` is 100 on every Linux.
    const STEP_NS: u64 = 10_000_000;

    /// `None` if the system does not count it.
    pub fn open() -> Option<Self> {
        Some(Self { stat: File::open("/proc/stat").ok()? })
    }

    /// The time so far, ns. Takes tens of microseconds: the system sums up all interrupts for it.
    pub fn read(&self) -> u64 {
        let mut buffer = [0; LONGEST];
        let text = read(&self.stat, &mut buffer);
        let line = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
        numbers(line.strip_prefix(b"cpu").unwrap_or_default()).nth(7).unwrap_or(0) * Self::STEP_NS
    }
}

fn read<'buffer>(file: &File, buffer: &'buffer mut [u8; LONGEST]) -> &'buffer [u8] {
    let length = file.read_at(buffer, 0).unwrap_or(0);
    &buffer[..length]
}

fn numbers(text: &[u8]) -> impl Iterator<Item = u64> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).map(number)
}

/// The number in `digits`; 0 if they are not a number.
fn number(digits: &[u8]) -> u64 {
    let digit = |sum: u64, byte: &u8| {
        let digit = byte.checked_sub(b'0').filter(|digit| *digit < 10)?;
        sum.checked_mul(10)?.checked_add(u64::from(digit))
    };
    digits.iter().try_fold(0, digit).unwrap_or(0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::{StealWatch, ThreadWatch, number};

    #[test]
    fn page_faults_of_this_thread_are_counted_as_they_happen() {
        let watch = ThreadWatch::of_this_thread().unwrap();
        let before = watch.read();
        // More than any allocator caches, so that the pages are fresh.
        let pages = 1 << 14;
        let fresh = vec![1_u8; pages * 4096];
        let after = watch.read();
        println!(
            "{before:?}, then {after:?}, sum {}",
            fresh.iter().map(|&byte| u64::from(byte)).sum::<u64>()
        );
        // One huge page may replace many small ones; without huge pages there is one fault per page.
        assert!(after.minor_faults > before.minor_faults);
        assert!(after.waited_ns >= before.waited_ns);
        let from_outside = ThreadWatch::of_process(std::process::id()).unwrap();
        assert!(from_outside.read().minor_faults > 0);
    }

    #[test]
    fn reading_allocates_nothing() {
        let watch = ThreadWatch::of_this_thread().unwrap();
        let steal = StealWatch::open().unwrap();
        let counted = allocation_counter::measure(|| {
            std::hint::black_box((watch.read(), steal.read()));
        });
        assert_eq!(counted.count_total, 0);
    }

    #[test]
    fn numbers_are_read_and_nothing_else() {
        assert_eq!([number(b"0"), number(b"1234567"), number(b"-1"), number(b"")], [0, 1_234_567, 0, 0]);
    }
}
