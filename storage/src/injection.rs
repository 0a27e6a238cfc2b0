//! Fault injection and a log of calls, in debug builds.
//!
//! `FREEPLAY_STORAGE_FAULT=ROLE:N:ERRNO` makes the N-th call (from 1) fail in every process whose first argument is ROLE, such as
//! `plant`; `N+` makes all calls from the N-th on fail that need space or write. `FREEPLAY_STORAGE_LOG=FILE` appends one line a call, in
//! the order of the calls of all processes: role, number, `ok` or `failed`, the call, its handle, its paths and, for a write, offset and
//! bytes. From the log a test reconstructs the data and names that survive a power cut after any call.

use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::call::Call;

/// Number of calls of this process so far.
static CALLS: AtomicU64 = AtomicU64::new(0);

/// Settings from the environment.
struct Injection {
    role: String,
    fault: Option<Fault>,
    log: Option<File>,
}

/// The failing call, and its error.
struct Fault {
    number: u64,
    and_later: bool,
    errno: i32,
}

fn injection() -> Option<&'static Injection> {
    static INJECTION: OnceLock<Option<Injection>> = OnceLock::new();
    INJECTION.get_or_init(Injection::from_environment).as_ref()
}

impl Injection {
    fn from_environment() -> Option<Self> {
        let role = std::env::args().nth(1).unwrap_or_default();
        let fault = std::env::var("FREEPLAY_STORAGE_FAULT").ok().and_then(|text| Fault::parse(&text, &role));
        let log = std::env::var_os("FREEPLAY_STORAGE_LOG")
            .and_then(|path| OpenOptions::new().append(true).create(true).open(path).ok());
        (fault.is_some() || log.is_some()).then_some(Self { role, fault, log })
    }
}

impl Fault {
    fn parse(text: &str, role: &str) -> Option<Self> {
        let mut parts = text.split(':');
        let (asked, number, errno) = (parts.next()?, parts.next()?, parts.next()?);
        let and_later = number.ends_with('+');
        let number = number.trim_end_matches('+').parse().ok()?;
        (asked == role).then_some(Self { number, and_later, errno: errno.parse().ok()? })
    }

    fn meets(&self, number: u64, call: &Call) -> bool {
        number == self.number || (self.and_later && number > self.number && takes_space(call))
    }
}

/// Returns true if `call` fails on a full disk.
fn takes_space(call: &Call) -> bool {
    matches!(
        call,
        Call::Create { .. }
            | Call::Append { .. }
            | Call::Write { .. }
            | Call::SyncFile { .. }
            | Call::SyncFolder(_)
            | Call::Rename { .. }
            | Call::MakeFolder(_)
    )
}

/// Makes `call` by `act`, unless a fault is injected, and logs it.
pub(crate) fn perform<T>(call: &Call, act: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
    let Some(injection) = injection() else { return act() };
    let number = CALLS.fetch_add(1, Ordering::Relaxed) + 1;
    let fault = injection.fault.as_ref().filter(|fault| fault.meets(number, call));
    let done = fault.map_or_else(act, |fault| Err(io::Error::from_raw_os_error(fault.errno)));
    if let Some(mut log) = injection.log.as_ref() {
        let line = line(&injection.role, number, done.is_ok(), call);
        // Each line is one write, so that lines of several processes do not mix.
        let _ = log.write_all(line.as_bytes());
    }
    done
}

/// One line of the log; fields are separated by tabs.
fn line(role: &str, number: u64, is_ok: bool, call: &Call) -> String {
    let process = std::process::id();
    let outcome = if is_ok { "ok" } else { "failed" };
    let name = |handle: u64| format!("{process}-{handle}");
    let fields = match *call {
        Call::Open(path) => format!("open\t{}", path.display()),
        Call::Read(path) => format!("read\t{}", path.display()),
        Call::List(path) => format!("list\t{}", path.display()),
        Call::Create { path, handle } => format!("create\t{}\t{}", name(handle), path.display()),
        Call::Append { path, handle } => format!("append\t{}\t{}", name(handle), path.display()),
        Call::Write { handle, offset, bytes } => {
            let mut text = format!("write\t{}\t{offset}\t", name(handle));
            for byte in bytes {
                let _ = write!(text, "{byte:02x}");
            }
            text
        }
        Call::Truncate { handle, length } => format!("truncate\t{}\t{length}", name(handle)),
        Call::SyncFile { handle } => format!("sync_file\t{}", name(handle)),
        Call::SyncFolder(path) => format!("sync_folder\t{}", path.display()),
        Call::Rename { from, to } => format!("rename\t{}\t{}", from.display(), to.display()),
        Call::MakeFolder(path) => format!("make_folder\t{}", path.display()),
        Call::Lock(path) => format!("lock\t{}", path.display()),
        Call::SetTimes(path) => format!("set_times\t{}", path.display()),
        Call::Remove(path) => format!("remove\t{}", path.display()),
        Call::RemoveFolder(path) => format!("remove_folder\t{}", path.display()),
    };
    format!("{role}\t{number}\t{outcome}\t{fields}\n")
}
