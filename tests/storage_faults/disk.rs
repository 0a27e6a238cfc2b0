//! A disk that loses power: the surviving effects of the calls in a log.
//!
//! File data survive from a sync of the file on, names from a sync of their folder on (POSIX promises no more). Data that a system writes on its own account
//! may survive, too; the tests try the worst of these mixtures, like ALICE (Pillai et al. 2014).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Data that survive beyond the synced ones.
#[derive(Clone, Copy, Debug)]
pub enum Survives {
    /// Nothing.
    Nothing,
    /// All names, no data: the system wrote out folders first.
    Names,
    /// All data, no names.
    Data,
    /// All names, and half of the data that was not synced.
    NamesAndHalf,
    /// Everything, as after the kill of the process.
    All,
}

impl Survives {
    pub const ALL: [Survives; 5] =
        [Survives::Nothing, Survives::Names, Survives::Data, Survives::NamesAndHalf, Survives::All];
}

#[derive(Clone, Debug, Default)]
struct Inode {
    data: Vec<u8>,
    synced: Vec<u8>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Node {
    File(String),
    Folder,
}

/// The disk after some calls.
#[derive(Clone, Debug, Default)]
pub struct Disk {
    inodes: BTreeMap<String, Inode>,
    names: BTreeMap<PathBuf, Node>,
    durable: BTreeMap<PathBuf, Node>,
}

/// A call of the log.
#[derive(Clone, Debug)]
pub struct Call {
    /// First argument of the process that made it.
    pub role: String,
    /// Its number in that process, from 1.
    pub number: u64,
    /// It succeeded.
    pub is_ok: bool,
    /// Its kind, such as `rename`.
    pub kind: String,
    fields: Vec<String>,
}

impl Call {
    /// Parses the calls in the text of a log.
    pub fn parse_all(text: &str) -> Vec<Call> {
        let parse = |line: &str| {
            let mut fields = line.split('\t').map(str::to_owned);
            Some(Call {
                role: fields.next()?,
                number: fields.next()?.parse().ok()?,
                is_ok: fields.next()? == "ok",
                kind: fields.next()?,
                fields: fields.collect(),
            })
        };
        text.lines().map(|line| parse(line).unwrap_or_else(|| panic!("{line}"))).collect()
    }
}

fn bytes_of(hex: &str) -> Vec<u8> {
    let digit = |byte: u8| char::from(byte).to_digit(16).expect("a hexadecimal digit") as u8;
    hex.as_bytes().chunks(2).map(|pair| digit(pair[0]) * 16 + digit(pair[1])).collect()
}

impl Disk {
    /// A disk with the durable files below `folder`.
    pub fn of(folder: &Path) -> Self {
        let mut disk = Disk::default();
        disk.add(folder);
        disk
    }

    fn add(&mut self, folder: &Path) {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            let node = if path.is_dir() {
                self.add(&path);
                Node::Folder
            } else {
                let data = std::fs::read(&path).expect("a file");
                let name = format!("old {}", path.display());
                self.inodes.insert(name.clone(), Inode { synced: data.clone(), data });
                Node::File(name)
            };
            self.names.insert(path.clone(), node.clone());
            self.durable.insert(path, node);
        }
    }

    /// Carries out `call`; relative paths begin at `here`.
    pub fn make(&mut self, call: &Call, here: &Path) {
        if !call.is_ok {
            return;
        }
        let path = |field: usize| here.join(&call.fields[field]);
        let number = |field: usize| call.fields[field].parse::<usize>().expect("a number");
        match call.kind.as_str() {
            "create" => {
                self.inodes.insert(call.fields[0].clone(), Inode::default());
                self.names.insert(path(1), Node::File(call.fields[0].clone()));
            }
            "append" => {
                let old = match self.names.get(&path(1)) {
                    Some(Node::File(old)) => self.inodes[old].clone(),
                    _ => Inode::default(),
                };
                self.inodes.insert(call.fields[0].clone(), old);
                self.names.insert(path(1), Node::File(call.fields[0].clone()));
            }
            "write" => {
                let (offset, bytes) = (number(1), bytes_of(&call.fields[2]));
                let data = &mut self.inodes.get_mut(&call.fields[0]).expect("created before").data;
                data.resize(data.len().max(offset + bytes.len()), 0);
                data[offset..offset + bytes.len()].copy_from_slice(&bytes);
            }
            "truncate" => {
                self.inodes.get_mut(&call.fields[0]).expect("created before").data.resize(number(1), 0);
            }
            "sync_file" => {
                let inode = self.inodes.get_mut(&call.fields[0]).expect("created before");
                inode.synced.clone_from(&inode.data);
            }
            "sync_folder" => self.sync_folder(&path(0)),
            "rename" => {
                if let Some(node) = self.names.remove(&path(0)) {
                    self.names.insert(path(1), node);
                }
            }
            "make_folder" => drop(self.names.insert(path(0), Node::Folder)),
            "remove" => drop(self.names.remove(&path(0))),
            "remove_folder" => self.names.retain(|name, _| !name.starts_with(path(0))),
            "open" | "read" | "list" | "lock" | "set_times" => {}
            other => panic!("a call of the kind {other}"),
        }
    }

    fn sync_folder(&mut self, folder: &Path) {
        let is_in = |name: &Path| name.parent() == Some(folder);
        self.durable.retain(|name, _| !is_in(name));
        let now = self.names.iter().filter(|(name, _)| is_in(name));
        self.durable.extend(now.map(|(name, node)| (name.clone(), node.clone())));
    }

    /// The files after a power cut: name, bytes, and the full content without the cut.
    pub fn after_cut(&self, survives: Survives) -> Vec<(PathBuf, Vec<u8>, String)> {
        let names = match survives {
            Survives::Nothing | Survives::Data => &self.durable,
            _ => &self.names,
        };
        let files = names.iter().filter_map(|(name, node)| match node {
            Node::File(inode) => Some((name.clone(), inode.clone())),
            Node::Folder => None,
        });
        files
            .map(|(name, inode)| {
                let Inode { data, synced } = &self.inodes[&inode];
                let bytes = match survives {
                    Survives::Nothing | Survives::Names => synced.clone(),
                    Survives::Data | Survives::All => data.clone(),
                    Survives::NamesAndHalf if data.starts_with(synced) => {
                        data[..synced.len() + (data.len() - synced.len()) / 2].to_vec()
                    }
                    Survives::NamesAndHalf => synced.clone(),
                };
                (name, bytes, inode)
            })
            .collect()
    }

    /// The bytes of a file.
    pub fn data(&self, inode: &str) -> &[u8] {
        &self.inodes[inode].data
    }
}
