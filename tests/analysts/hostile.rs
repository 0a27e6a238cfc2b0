//! An analyst that enters the sandbox and then tries to escape from it, with code of its own.
//!
//! `hostile_analyst FOLDER PORT UDP PID SANDBOXED`: FOLDER contains files that it must not reach (`tests/sandbox.rs`), PORT and UDP are ports of its parent,
//! PID is another process of the same user. Unless SANDBOXED is `yes` it stays outside the sandbox, to show that every attempt works there.

#[path = "../../proof/src/blind/channels.rs"]
mod channels;
#[path = "../../proof/src/blind/namespaces.rs"]
mod namespaces;
#[path = "../../proof/src/blind/sandbox.rs"]
mod sandbox;

use std::collections::BTreeMap;
use std::fs;
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::os::fd::AsRawFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram, UnixStream};
use std::path::{Path, PathBuf};
use std::process::Command;

use nix::sys::uio::{RemoteIoVec, process_vm_readv};
use rustix::process::{
    Pid, PidfdFlags, PidfdGetfdFlags, Signal, getpgid, kill_process, pidfd_getfd, pidfd_open,
};

/// Attempts by channel, with their results.
#[derive(Default)]
struct Tried(BTreeMap<&'static str, Vec<(String, bool)>>);

impl Tried {
    fn one(&mut self, channel: &'static str, what: impl Into<String>, succeeded: bool) {
        self.0.entry(channel).or_default().push((what.into(), succeeded));
    }
}

struct Target {
    folder: PathBuf,
    port: u16,
    udp: u16,
    processes: Vec<i32>,
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |at: usize| arguments[at].parse::<i32>().expect("a number");
    let folder = PathBuf::from(&arguments[1]);
    let parent = std::os::unix::process::parent_id() as i32;
    let target =
        Target { port: number(2) as u16, udp: number(3) as u16, processes: vec![parent, number(4)], folder };
    let lures = channels::Lures {
        canary: Some(target.folder.join("canary")),
        socket: Some(target.abstract_name()),
        port: Some(target.port),
    };
    let isolation = (arguments[5] == "yes").then(|| sandbox::enter(&lures));
    let words = isolation.as_ref().map(sandbox::Isolation::words);
    let mut tried = Tried::default();
    target.files(&mut tried);
    target.writing(&mut tried);
    target.inherited(&mut tried);
    target.processes(&mut tried);
    target.sockets(&mut tried);
    target.shared_memory(&mut tried);
    println!("{}", serde_json::json!({ "isolation": isolation, "words": words, "tried": tried.0 }));
}

impl Target {
    fn abstract_name(&self) -> String {
        format!("freeplay-test-{}", self.folder.file_name().expect("a name").to_string_lossy())
    }

    /// Files and folders outside, by every path to them, and programs.
    fn files(&self, tried: &mut Tried) {
        let canary = self.folder.join("canary");
        let below = canary.strip_prefix("/").expect("an absolute path");
        let parent = self.processes[0];
        let paths = [
            canary.clone(),
            PathBuf::from("../canary"),
            PathBuf::from("../other/recording.csv"),
            Path::new("/proc/self/root").join(below),
            Path::new("/proc/self/cwd/../canary").to_owned(),
            Path::new(&format!("/proc/{parent}/root")).join(below),
            Path::new("link").to_owned(),
            PathBuf::from("/etc/passwd"),
        ];
        for path in &paths {
            tried.one("files", format!("read {}", path.display()), fs::read(path).is_ok());
        }
        for folder in [self.folder.clone(), PathBuf::from("/etc"), PathBuf::from("/proc/self/fd")] {
            tried.one("files", format!("list {}", folder.display()), fs::read_dir(&folder).is_ok());
        }
        for program in ["/bin/true", "./program"] {
            tried.one("files", format!("run {program}"), Command::new(program).status().is_ok());
        }
        for path in
            [canary.clone(), self.folder.join("other/recording.csv"), "/etc/passwd".into(), "/proc/1".into()]
        {
            let found = path.symlink_metadata().is_ok();
            tried.one("names and sizes of files", format!("size of {}", path.display()), found);
        }
        tried.one(
            "names and sizes of files",
            "link of /proc/self/exe",
            fs::read_link("/proc/self/exe").is_ok(),
        );
    }

    fn writing(&self, tried: &mut Tried) {
        tried.one("writing", "a new file", fs::write("new", "x").is_ok());
        tried.one("writing", "a folder", fs::create_dir("folder").is_ok());
        tried.one("writing", "another name", fs::rename("second.csv", "third.csv").is_ok());
        tried.one(
            "writing",
            "into a recording",
            fs::OpenOptions::new().append(true).open("recording.csv").is_ok(),
        );
        let link = std::os::unix::fs::symlink(self.folder.join("canary"), "link-of-mine").is_ok();
        tried.one("writing", "a link", link);
        let permissions = fs::metadata("recording.csv").expect("its own file").permissions();
        tried.one("writing", "permissions", fs::set_permissions("recording.csv", permissions).is_ok());
        let now = fs::FileTimes::new().set_modified(std::time::SystemTime::now());
        let file = fs::File::open("recording.csv").expect("its own file");
        tried.one("writing", "times", file.set_times(now).is_ok());
        tried.one("writing", "outside", fs::write(self.folder.join("new"), "x").is_ok());
    }

    /// Open files, duplicated by number with `pidfd_getfd`, and environment variables.
    fn inherited(&self, tried: &mut Tried) {
        let own = Pid::from_raw(std::process::id() as i32).expect("a process");
        let Ok(handle) = pidfd_open(own, PidfdFlags::empty()) else { return };
        for number in (3..64).filter(|number| *number != handle.as_raw_fd()) {
            let open = pidfd_getfd(&handle, number, PidfdGetfdFlags::empty()).is_ok();
            tried.one("inherited files", format!("file {number}"), open);
        }
        tried.one("environment", "any variable", std::env::vars_os().next().is_some());
    }

    fn processes(&self, tried: &mut Tried) {
        for &number in &self.processes {
            let pid = Pid::from_raw(number).expect("a process");
            for file in ["environ", "cmdline", "stat", "status", "maps", "comm", "io", "mountinfo"] {
                let path = format!("/proc/{number}/{file}");
                tried.one("processes", format!("read {path}"), fs::read(&path).is_ok());
            }
            for link in ["cwd", "root", "exe", "fd/0", "ns/net"] {
                let path = format!("/proc/{number}/{link}");
                tried.one("processes", format!("link {path}"), fs::read_link(&path).is_ok());
            }
            let memory = format!("/proc/{number}/mem");
            tried.one("memory", format!("open {memory}"), fs::File::open(&memory).is_ok());
            let handle = pidfd_open(pid, PidfdFlags::empty());
            for file in 0..3 {
                let taken =
                    handle.as_ref().is_ok_and(|h| pidfd_getfd(h, file, PidfdGetfdFlags::empty()).is_ok());
                tried.one("memory", format!("take file {file} of {number}"), taken);
            }
            let nix_pid = nix::unistd::Pid::from_raw(number);
            let mut buffer = [0; 8];
            // The system checks the right first, then the address.
            let (mut into, from) =
                ([std::io::IoSliceMut::new(&mut buffer)], [RemoteIoVec { base: 16, len: 8 }]);
            let read = process_vm_readv(nix_pid, &mut into, &from);
            tried.one("memory", format!("read memory of {number}"), read != Err(nix::errno::Errno::EPERM));
            let traced = nix::sys::ptrace::attach(nix_pid).is_ok();
            if traced {
                let _ = nix::sys::wait::waitpid(nix_pid, None);
                let _ = nix::sys::ptrace::detach(nix_pid, None);
            }
            tried.one("memory", format!("trace {number}"), traced);
            tried.one("numbers of processes", format!("getpgid {number}"), getpgid(Some(pid)).is_ok());
            tried.one("signals", format!("signal to {number}"), kill_process(pid, Signal::CONT).is_ok());
            let sent = handle.is_ok_and(|h| rustix::process::pidfd_send_signal(h, Signal::CONT).is_ok());
            tried.one("signals", format!("signal by a handle to {number}"), sent);
        }
        tried.one("processes", "list /proc", fs::read_dir("/proc").is_ok());
    }

    fn sockets(&self, tried: &mut Tried) {
        for host in ["127.0.0.1", "0.0.0.0"] {
            let reached = TcpStream::connect((host, self.port)).is_ok();
            tried.one("network", format!("TCP to {host}"), reached);
        }
        tried.one("network", "a TCP port for others", TcpListener::bind("127.0.0.1:0").is_ok());
        let sent = UdpSocket::bind("0.0.0.0:0").and_then(|s| s.send_to(b"x", ("127.0.0.1", self.udp)));
        tried.one("network", "UDP", sent.is_ok());
        let address = SocketAddr::from_abstract_name(self.abstract_name()).expect("a name");
        tried.one("abstract sockets", "stream", UnixStream::connect_addr(&address).is_ok());
        let datagrams = SocketAddr::from_abstract_name(self.abstract_name() + "-d").expect("a name");
        let sent = UnixDatagram::unbound().and_then(|s| s.send_to_addr(b"x", &datagrams));
        tried.one("abstract sockets", "datagram", sent.is_ok());
        for path in [self.folder.join("socket"), PathBuf::from("../socket")] {
            let what = format!("connect to {}", path.display());
            tried.one("socket files", what, UnixStream::connect(&path).is_ok());
        }
        let sent = UnixDatagram::unbound().and_then(|s| s.send_to(b"x", self.folder.join("datagrams")));
        tried.one("socket files", "datagram", sent.is_ok());
    }

    fn shared_memory(&self, tried: &mut Tried) {
        let name = self.abstract_name();
        let path = Path::new("/dev/shm").join(&name);
        tried.one("shared memory files", "read", fs::read(&path).is_ok());
        tried.one("shared memory files", "list", fs::read_dir("/dev/shm").is_ok());
        tried.one("shared memory files", "make", fs::write(path.with_extension("made"), "x").is_ok());
        let queue = format!("/{name}");
        let flags = nix::mqueue::MQ_OFlag::O_RDWR;
        let opened = nix::mqueue::mq_open(queue.as_str(), flags, nix::sys::stat::Mode::empty(), None).is_ok();
        tried.one("System V memory and queues", "message queue", opened);
        tried.one("System V memory and queues", "list", fs::read("/proc/sysvipc/shm").is_ok());
    }
}
