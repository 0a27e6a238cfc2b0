//! The sandbox of an analyst: a hostile one tries every channel, and fails on each that the receipt calls closed.

use std::collections::BTreeMap;
use std::net::{TcpListener, UdpSocket};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::net::{SocketAddr, UnixDatagram, UnixListener};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use nix::mqueue::{MQ_OFlag, MqdT, mq_close, mq_open, mq_unlink};
use serde_json::Value;
use tempfile::TempDir;

/// A user without any right, where this test runs as root.
const NOBODY: u32 = 65534;

/// Resources that the hostile analyst must not reach.
struct Outside {
    folder: TempDir,
    name: String,
    port: TcpListener,
    udp: UdpSocket,
    _sockets: (UnixListener, UnixDatagram, UnixListener, UnixDatagram),
    queue: Option<MqdT>,
    sibling: Child,
}

impl Outside {
    fn new(user: Option<u32>) -> Self {
        let folder = tempfile::Builder::new().prefix("outside-").tempdir_in("/tmp").expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let write = |name: &str| std::fs::write(path(name), "secret").expect("a file");
        for case in ["case", "other"] {
            std::fs::create_dir(path(case)).expect("a folder");
            ["model.toml", "recording.csv", "second.csv"].iter().for_each(|f| write(&format!("{case}/{f}")));
        }
        write("canary");
        symlink(path("canary"), path("case/link")).expect("a link");
        std::fs::copy("/bin/true", path("case/program")).expect("a program");
        let name = format!("freeplay-test-{}", folder.path().file_name().expect("a name").to_string_lossy());
        std::fs::write(Path::new("/dev/shm").join(&name), "secret").expect("a file in shared memory");
        let address = |end: &str| SocketAddr::from_abstract_name(format!("{name}{end}")).expect("a name");
        let sockets = (
            UnixListener::bind_addr(&address("")).expect("a socket"),
            UnixDatagram::bind_addr(&address("-d")).expect("a socket"),
            UnixListener::bind(path("socket")).expect("a socket"),
            UnixDatagram::bind(path("datagrams")).expect("a socket"),
        );
        let queue = mq_open(
            format!("/{name}").as_str(),
            MQ_OFlag::O_CREAT | MQ_OFlag::O_RDWR,
            nix::sys::stat::Mode::from_bits_truncate(0o666),
            None,
        );
        for open in ["socket", "datagrams", "case", "other", ""] {
            let all = std::fs::Permissions::from_mode(0o777);
            std::fs::set_permissions(path(open), all).expect("permissions");
        }
        let mut sibling = Command::new("sleep");
        sibling.arg("600").env("SECRET", "truth").stdin(Stdio::null());
        user.map(|user| sibling.uid(user).gid(user));
        Self {
            name,
            port: TcpListener::bind("127.0.0.1:0").expect("a port"),
            udp: UdpSocket::bind("127.0.0.1:0").expect("a port"),
            _sockets: sockets,
            queue: queue.ok(),
            sibling: sibling.spawn().expect("sleep"),
            folder,
        }
    }

    /// The report of the hostile analyst, run as `user` in the folder of its case.
    fn attacked(&self, user: Option<u32>, sandboxed: bool) -> Value {
        let ports =
            [self.port.local_addr(), self.udp.local_addr()].map(|at| at.expect("a port").port().to_string());
        let mut command = Command::new(self.program());
        command.arg(self.folder.path()).args(ports).arg(self.sibling.id().to_string());
        command.arg(if sandboxed { "yes" } else { "no" });
        command.env_clear().current_dir(self.folder.path().join("case")).stdin(Stdio::null());
        user.map(|user| command.uid(user).gid(user));
        let output = command.output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stdout);
        serde_json::from_str(&said)
            .unwrap_or_else(|error| panic!("{error}: {said}{}", String::from_utf8_lossy(&output.stderr)))
    }

    /// A copy of the hostile analyst that every user can run.
    fn program(&self) -> PathBuf {
        let built = Path::new(crate::common::FREEPLAY).with_file_name("examples").join("hostile_analyst");
        let copy = self.folder.path().join("hostile");
        if !copy.exists() {
            std::fs::copy(&built, &copy).unwrap_or_else(|error| panic!("{}: {error}", built.display()));
        }
        copy
    }
}

impl Drop for Outside {
    fn drop(&mut self) {
        let _ = self.sibling.kill();
        let _ = self.sibling.wait();
        for end in ["", ".made"] {
            let _ = std::fs::remove_file(Path::new("/dev/shm").join(format!("{}{end}", self.name)));
        }
        if let Some(queue) = self.queue.take() {
            let _ = mq_close(queue);
            let _ = mq_unlink(format!("/{}", self.name).as_str());
        }
    }
}

/// Number of attempts in each channel, and the successful ones.
fn ways(said: &Value) -> BTreeMap<String, (usize, Vec<String>)> {
    let channels = said["tried"].as_object().expect("channels");
    let of = |tried: &Value| {
        let tried = tried.as_array().expect("ways");
        let out = tried.iter().filter(|way| way[1] == true).map(|way| way[0].to_string());
        (tried.len(), out.collect())
    };
    channels.iter().map(|(name, tried)| (name.clone(), of(tried))).collect()
}

/// Runs as `user`; with `foreign` a file of the case belongs to another user, so that a user namespace could not read it.
fn closed_is_closed(user: Option<u32>, foreign: bool) {
    // As `freeplay blind` does: the analyst must not inherit the files that this test inherited.
    close_fds::set_fds_cloexec(3, &[]);
    let free = ways(&Outside::new(user).attacked(user, false));
    let outside = Outside::new(user);
    if foreign {
        let path = outside.folder.path().join("case/model.toml");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).expect("permissions");
        std::os::unix::fs::chown(&path, Some(NOBODY), None).expect("another owner");
    }
    let said = outside.attacked(user, true);
    println!("user {user:?}: {}", said["words"]);
    let mut count = 0;
    for (channel, (tried, out)) in ways(&said) {
        let state = said["isolation"]["channels"][&channel].as_str().expect("every channel is named");
        println!(
            "{channel}: {state}; {tried} ways, {} out; without sandbox {}",
            out.len(),
            free[&channel].1.len()
        );
        assert!(state != "closed" || out.is_empty(), "{channel} is called closed; out: {out:?}");
        count += tried;
    }
    println!("{count} ways tried");
    // The attempts work: without the sandbox each of these channels is open.
    for channel in [
        "files",
        "names and sizes of files",
        "writing",
        "processes",
        "numbers of processes",
        "network",
        "abstract sockets",
        "socket files",
        "shared memory files",
        "System V memory and queues",
    ] {
        assert!(!free[channel].1.is_empty(), "{channel}: no way out without the sandbox");
    }
    // Channels that every kernel with landlock closes.
    if said["isolation"]["mechanism"].as_str().is_some_and(|words| words.contains("landlock ")) {
        for channel in
            ["files", "environment", "inherited files", "memory", "processes", "shared memory files"]
        {
            assert_eq!(said["isolation"]["channels"][channel], "closed");
        }
    }
}

#[test]
fn a_hostile_analyst_finds_closed_what_is_called_closed() {
    closed_is_closed(None, false);
}

/// Runs as another user than root, with fewer permissions; a system may also forbid it namespaces.
#[test]
fn so_does_one_without_privileges() {
    if nix::unistd::geteuid().is_root() {
        closed_is_closed(Some(NOBODY), false);
    } else {
        println!("this user is not root: the other test says it");
    }
}

/// With Landlock alone, fewer channels are closed, and the receipt calls the others open.
#[test]
fn so_does_one_without_namespaces() {
    if nix::unistd::geteuid().is_root() {
        closed_is_closed(None, true);
    } else {
        println!("only root can give a file to another user");
    }
}

/// An analyst inherits no open file and no variable of a shell, and the receipt names every channel.
#[test]
fn nothing_is_inherited() {
    let folder = crate::common::fresh_folder();
    let case = folder.path().join("cases/one");
    std::fs::create_dir_all(&case).expect("a folder");
    std::fs::write(case.join("model.toml"), "no arm").expect("a file");
    std::fs::write(folder.path().join("truth"), "secret").expect("a file");
    let script = format!(
        "exec 3<truth 7<truth 9<truth; exec {} blind --analyse cases --quiet",
        crate::common::FREEPLAY
    );
    let mut command = Command::new("sh");
    command.args(["-c", &script]).env("TRUTH", "secret").current_dir(folder.path());
    let output = command.output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(folder.path().join("cases/receipt.json")).expect("a receipt");
    let receipt: Value = serde_json::from_str(&text).expect("JSON");
    let channels = &receipt["cases"]["one"]["answer"]["isolation"]["channels"];
    println!("{channels:#}");
    assert_eq!(channels["inherited files"], "closed");
    assert_eq!(channels["environment"], "closed");
    assert!(channels.as_object().is_some_and(|all| all.len() == 16));
    let verified = Command::new(crate::common::FREEPLAY)
        .args(["blind", "--verify", "cases/receipt.json"])
        .current_dir(folder.path())
        .output()
        .expect("it starts");
    let said = String::from_utf8_lossy(&verified.stdout).into_owned();
    assert!(verified.status.success() && said.contains("not revealed yet"), "{said}");
}
