//! Covert channels: ways to learn anything but the own case. The process of the analyst tries each of them.

use std::collections::BTreeMap;
use std::io::Write;
use std::net::{TcpStream, UdpSocket};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixStream};
use std::os::unix::process::parent_id;
use std::path::{Path, PathBuf};

use rustix::process::{
    Pid, PidfdFlags, PidfdGetfdFlags, getpgid, pidfd_getfd, pidfd_open, test_kill_process,
};

use super::namespaces::Parted;

/// State of a channel that gave no access.
pub const CLOSED: &str = "closed";

/// Lures that an analyst must not reach. The parent keeps them open, so that a refusal proves isolation.
#[derive(Debug, Default)]
pub struct Lures {
    /// A file beside the sealed cases.
    pub canary: Option<PathBuf>,
    /// The name of an abstract Unix socket that listens.
    pub socket: Option<String>,
    /// A TCP port of this machine that listens.
    pub port: Option<u16>,
}

/// Resources that this process inherited: open files beyond the three standard ones, and environment variables.
#[derive(Debug, Default)]
pub struct InheritedResources {
    files: Vec<String>,
    variables: usize,
}

/// Lists the resources that this process inherited.
pub fn inherited() -> InheritedResources {
    let variables = std::env::vars_os().count();
    let Ok(open) = std::fs::read_dir("/proc/self/fd") else {
        return InheritedResources { files: vec!["their list can't be read".to_owned()], variables };
    };
    // The list itself is open, too.
    let list = PathBuf::from(format!("/proc/{}/fd", std::process::id()));
    let told = open.flatten().filter_map(|entry| {
        let number: u32 = entry.file_name().to_str()?.parse().ok()?;
        let target = std::fs::read_link(entry.path()).unwrap_or_default();
        (number > 2 && target != list).then(|| format!("{number}, {}", target.display()))
    });
    InheritedResources { files: told.collect(), variables }
}

/// Every channel by its name: [`CLOSED`], or `open: ` and how.
pub fn all(lures: &Lures, inherited: &InheritedResources, parted: &Parted) -> BTreeMap<String, String> {
    let parent = parent_id();
    let variables = (inherited.variables > 0).then(|| format!("{} variables", inherited.variables));
    let states = [
        ("files", files(lures.canary.as_deref())),
        ("names and sizes of files", names(lures.canary.as_deref())),
        ("writing", writing()),
        ("inherited files", inherited.files.first().cloned()),
        ("environment", variables),
        ("memory", memory(parent)),
        ("processes", processes(parent)),
        ("numbers of processes", numbers(parent)),
        ("signals", signals(parent)),
        ("network", network(lures.port)),
        ("abstract sockets", abstract_sockets(lures.socket.as_deref())),
        ("socket files", (!parted.root).then(|| "the root is that of all processes".to_owned())),
        ("shared memory files", shared_memory()),
        (
            "System V memory and queues",
            (!parted.spaces).then(|| "they are those of all processes".to_owned()),
        ),
        // The layers do not close these channels; a stricter test runs the analysts on separate machines.
        ("kernel keyring", Some("the session's keyring is inherited; no truth is in it".to_owned())),
        ("load of the machine", Some("analysts share processors and caches".to_owned())),
    ];
    let state = |how: Option<String>| how.map_or_else(|| CLOSED.to_owned(), |how| format!("open: {how}"));
    states.into_iter().map(|(name, how)| (name.to_owned(), state(how))).collect()
}

/// Tries to read the canary and its folder.
fn files(canary: Option<&Path>) -> Option<String> {
    if canary.is_none() {
        return Some("not tried: the parent holds no file".to_owned());
    }
    let folder = canary.and_then(Path::parent);
    let read = canary.filter(|canary| std::fs::read(canary).is_ok());
    let listed = folder.filter(|folder| std::fs::read_dir(folder).is_ok());
    read.or(listed).map(|path| format!("{} was read", path.display()))
}

fn names(canary: Option<&Path>) -> Option<String> {
    let about = canary?.symlink_metadata().ok()?;
    Some(format!("of a file whose path is known, as of the canary: {} bytes", about.len()))
}

/// Tries to create a file in the folder, and to change the permissions of the folder.
fn writing() -> Option<String> {
    let name = "written";
    let written = std::fs::File::create_new(name).and_then(|mut file| file.write_all(b"0")).is_ok();
    if written {
        // This process created it.
        let _ = std::fs::remove_file(name);
    }
    if written {
        return Some("a file was made in the folder of the case".to_owned());
    }
    let permissions = std::fs::metadata(".").ok()?.permissions();
    std::fs::set_permissions(".", permissions).ok()?;
    Some("permissions and times of the folder can be changed".to_owned())
}

/// Tries to read the parent's memory and its open files, through its folder in /proc and a handle of the process.
fn memory(parent: u32) -> Option<String> {
    if std::fs::File::open(format!("/proc/{parent}/mem")).is_ok() {
        return Some(format!("/proc/{parent}/mem was opened"));
    }
    let handle = pidfd_open(pid(parent)?, PidfdFlags::empty()).ok()?;
    let stolen = pidfd_getfd(handle, 0, PidfdGetfdFlags::empty()).is_ok();
    stolen.then(|| "a file of the parent was taken".to_owned())
}

/// Tries to read the entries of the parent and of any other process in /proc.
fn processes(parent: u32) -> Option<String> {
    let path = |what: &str| PathBuf::from(format!("/proc/{parent}/{what}"));
    let read = ["cmdline", "environ", "status", "maps"].map(path);
    let linked = ["cwd", "root", "exe", "fd/0"].map(path);
    let read = read.into_iter().find(|path| std::fs::read(path).is_ok());
    let open = read.or_else(|| linked.into_iter().find(|path| std::fs::read_link(path).is_ok()));
    open.or_else(|| Some(PathBuf::from("/proc")).filter(|path| std::fs::read_dir(path).is_ok()))
        .map(|path| format!("{} was read", path.display()))
}

/// Tries to learn whether a process with that number lives, which many system calls reveal.
fn numbers(parent: u32) -> Option<String> {
    getpgid(pid(parent)).ok()?;
    Some("system calls tell which process numbers are in use; they follow the order of the names".to_owned())
}

fn signals(parent: u32) -> Option<String> {
    test_kill_process(pid(parent)?).ok()?;
    Some("the parent can be signalled".to_owned())
}

fn pid(number: u32) -> Option<Pid> {
    Pid::from_raw(i32::try_from(number).ok()?)
}

/// Tries a connection to the parent's port and a datagram to this machine.
fn network(port: Option<u16>) -> Option<String> {
    if port.is_some_and(|port| TcpStream::connect(("127.0.0.1", port)).is_ok()) {
        return Some("TCP reaches the parent".to_owned());
    }
    let socket = UdpSocket::bind("0.0.0.0:0").ok()?;
    let sent = socket.send_to(b"0", "127.0.0.1:9").is_ok();
    sent.then(|| "UDP reaches this machine".to_owned())
}

fn abstract_sockets(name: Option<&str>) -> Option<String> {
    let Some(name) = name else { return Some("not tried: the parent holds no socket".to_owned()) };
    let address = SocketAddr::from_abstract_name(name).ok()?;
    UnixStream::connect_addr(&address).ok()?;
    Some("an abstract socket of the parent was reached".to_owned())
}

fn shared_memory() -> Option<String> {
    std::fs::read_dir("/dev/shm").ok()?;
    Some("/dev/shm was listed".to_owned())
}
