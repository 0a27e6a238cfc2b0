//! Lures of the parent for its analysts: resources that they must not reach.

use std::net::TcpListener;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::path::{Path, PathBuf};
use std::process::Command;

use freeplay_terminal::exit::Failure;

/// A file, an abstract socket and a TCP port that no analyst may reach; dropping this removes them.
pub struct Held {
    canary: PathBuf,
    name: String,
    socket: Option<UnixListener>,
    port: Option<TcpListener>,
}

impl Held {
    /// Creates the lures beside the sealed `cases`, with `secret` in the file and in the socket's name.
    ///
    /// # Errors
    /// A file that can't be written. A machine without a network has no port to try.
    pub fn beside(cases: &Path, secret: &str) -> Result<Self, Failure> {
        let canary = std::path::absolute(cases.join("canary")).map_err(Failure::internal)?;
        freeplay_terminal::files::write(&canary, secret)?;
        let name = format!("freeplay-{secret}");
        let socket = SocketAddr::from_abstract_name(&name).and_then(|at| UnixListener::bind_addr(&at));
        Ok(Self { canary, name, socket: socket.ok(), port: TcpListener::bind("127.0.0.1:0").ok() })
    }

    /// Passes the lures to an analyst on its command line.
    pub fn tell(&self, analyst: &mut Command) {
        analyst.arg("--canary").arg(&self.canary);
        if self.socket.is_some() {
            analyst.args(["--socket", &self.name]);
        }
        let port = self.port.as_ref().and_then(|port| port.local_addr().ok());
        if let Some(address) = port {
            analyst.args(["--port", &address.port().to_string()]);
        }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        // The file is no longer needed; a read-only folder was refused before.
        let _ = freeplay_storage::remove_file(&self.canary);
    }
}
