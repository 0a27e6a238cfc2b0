//! The generator of the sealed recordings: this executable, or another program that keeps the contract of `proof/mujoco/README.md`.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use freeplay_concealed::GenerateError;
use freeplay_storage::{EntryKind, list, make_folder, remove_folder, write};
use freeplay_terminal::exit::Failure;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::hash;
use super::names::name;
use super::order::Order;

/// The name of the generator in MuJoCo.
pub const MUJOCO: &str = "mujoco";
/// The name of the same generator for machines on servos, recorded by commanded and measured positions.
const MUJOCO_SERVOS: &str = "mujoco-servos";
/// The name of these machines in an order.
const SERVOS: &str = "servos";
/// The schema of an order to another program.
const SCHEMA: &str = "freeplay.generator/1";
/// The file that Python starts in a folder.
const START: &str = "__main__.py";

/// The generator in MuJoCo, file by file. It is part of the executable, so that the hash of the executable binds it.
const FILES: [(&str, &str); 22] = [
    (START, include_str!("../../mujoco/__main__.py")),
    ("arms.py", include_str!("../../mujoco/arms.py")),
    ("body_laws.py", include_str!("../../mujoco/body_laws.py")),
    ("build.py", include_str!("../../mujoco/build.py")),
    ("cases.py", include_str!("../../mujoco/cases.py")),
    ("draw.py", include_str!("../../mujoco/draw.py")),
    ("families.py", include_str!("../../mujoco/families.py")),
    ("files.py", include_str!("../../mujoco/files.py")),
    ("friction_laws.py", include_str!("../../mujoco/friction_laws.py")),
    ("laws.py", include_str!("../../mujoco/laws.py")),
    ("machine.py", include_str!("../../mujoco/machine.py")),
    ("motions.py", include_str!("../../mujoco/motions.py")),
    ("orders.py", include_str!("../../mujoco/orders.py")),
    ("outside_laws.py", include_str!("../../mujoco/outside_laws.py")),
    ("plan.py", include_str!("../../mujoco/plan.py")),
    ("rigid.py", include_str!("../../mujoco/rigid.py")),
    ("sensor_laws.py", include_str!("../../mujoco/sensor_laws.py")),
    ("sensors.py", include_str!("../../mujoco/sensors.py")),
    ("servos.py", include_str!("../../mujoco/servos.py")),
    ("setup_faults.py", include_str!("../../mujoco/setup_faults.py")),
    ("strength.py", include_str!("../../mujoco/strength.py")),
    ("tolerances.py", include_str!("../../mujoco/tolerances.py")),
];

/// Another generator, as the receipt describes it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Other {
    /// `mujoco`, or the path on the command line.
    pub name: String,
    /// SHA-256 of its files.
    pub sha256: String,
}

/// The generator of the recordings.
#[derive(Clone, Debug)]
pub enum Source {
    /// This executable, through the crate `concealed`.
    Own,
    /// The program at this path: an executable, or a file or folder for Python; and the requested family of cases, if it has more than one.
    Program(PathBuf, Option<&'static str>),
}

impl Source {
    /// The source that `--generator` selects, with its description for the receipt. Writes the generator in MuJoCo into `folder`.
    ///
    /// # Errors
    /// A program that can't be read; a folder that can't be written.
    pub fn named(generator: Option<&Path>, folder: &Path) -> Result<(Self, Option<Other>), Failure> {
        let Some(path) = generator else { return Ok((Self::Own, None)) };
        let given = path.display().to_string();
        let family = (given == MUJOCO_SERVOS).then_some(SERVOS);
        let is_own = given == MUJOCO || family.is_some();
        let path = if is_own { written(&folder.join("generator"))? } else { path.to_owned() };
        let path = std::path::absolute(&path).map_err(Failure::input)?;
        let mut files = Vec::new();
        hashes(&path, "", &mut files)?;
        let sha256 = hash::of_json("generator", &json!(files));
        Ok((Self::Program(path, family), Some(Other { name: given, sha256 })))
    }

    /// Starts the process that carries out an order from its standard input.
    ///
    /// # Errors
    /// No such program, or no Python to run it; [`Failure::peer`].
    pub fn start(&self) -> Result<Child, Failure> {
        let mut command = match self {
            Self::Own => own()?,
            Self::Program(path, _) if is_python(path) => python(path),
            Self::Program(path, _) => Command::new(path),
        };
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        command.spawn().map_err(|error| {
            let program = command.get_program().to_string_lossy().into_owned();
            match (self, error.kind()) {
                (Self::Own, _) => Failure::internal(format!("generator: {error}")),
                (_, ErrorKind::NotFound) if self.is_python() => Failure::peer(format!(
                    "{program}: no such Python; let FREEPLAY_PYTHON name one that has the package mujoco"
                )),
                _ => Failure::peer(format!("{program}: {error}; --generator takes mujoco or an executable")),
            }
        })
    }

    /// Number of cases that it draws for all shards of `order`.
    pub fn case_count(&self, order: &Order) -> Result<usize, GenerateError> {
        match self {
            Self::Own => Ok(order.cases()?.len()),
            Self::Program(..) => Ok(order.quota.cases()),
        }
    }

    /// The request for the case at `index` of its draw for `order`, as far as this program knows it.
    pub fn asked_at(&self, order: &Order, index: usize) -> Result<String, GenerateError> {
        match self {
            Self::Own => Ok(order.asked(&order.cases()?[index])),
            Self::Program(..) => Ok(format!("case {index}")),
        }
    }

    /// The text that the process reads from standard input.
    ///
    /// # Errors
    /// None in practice: every order can be written as JSON.
    pub fn order(&self, order: &Order) -> Result<String, Failure> {
        let value = match self {
            Self::Own => serde_json::to_value(order).map_err(Failure::internal)?,
            Self::Program(_, family) => asked_of_another(order, *family)?,
        };
        Ok(value.to_string())
    }

    fn is_python(&self) -> bool {
        matches!(self, Self::Program(path, _) if is_python(path))
    }
}

/// The order in the form of the contract: the cases with their names, and the folder.
fn asked_of_another(order: &Order, family: Option<&str>) -> Result<Value, Failure> {
    let folder = std::path::absolute(&order.folder).map_err(Failure::input)?;
    let case = |index: usize| json!({ "index": index, "name": name(&order.names, index) });
    let cases: Vec<Value> = order.open(order.quota.cases()).into_iter().map(case).collect();
    let mut asked = json!({
        "schema": SCHEMA, "seed": order.seed, "quota": order.quota, "folder": folder, "jobs": order.jobs, "cases": cases,
    });
    if let Some(family) = family {
        asked["family"] = json!(family);
    }
    Ok(asked)
}

fn own() -> Result<Command, Failure> {
    let mut command = Command::new(std::env::current_exe().map_err(Failure::internal)?);
    command.arg("blind-generate").args(["--with-parent", &std::process::id().to_string()]);
    Ok(command)
}

fn is_python(path: &Path) -> bool {
    path.is_dir() || path.extension().is_some_and(|extension| extension == "py")
}

fn python(path: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("FREEPLAY_PYTHON").unwrap_or_else(|| "python3".into()));
    // No compiled files beside the hashed sources; one thread per process, since the order sets the number of processes.
    command.arg("-B").arg(path).env("OMP_NUM_THREADS", "1").env("OPENBLAS_NUM_THREADS", "1");
    command
}

/// Writes the generator in MuJoCo into `folder`, and replaces existing files.
fn written(folder: &Path) -> Result<PathBuf, Failure> {
    remove_folder(folder)?;
    make_folder(folder)?;
    for (name, text) in FILES {
        write(&folder.join(name), text)?;
    }
    Ok(folder.to_owned())
}

/// The hash of each file of the program at `path`, by its name below it.
fn hashes(path: &Path, name: &str, all: &mut Vec<(String, String)>) -> Result<(), Failure> {
    if !path.is_dir() {
        all.push((name.to_owned(), hash::of_file(path)?));
        return Ok(());
    }
    let mut entries = list(path)?;
    entries.sort_by(|a, b| a.path.cmp(&b.path));
    for entry in entries {
        let last = entry.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if entry.kind != EntryKind::Folder || last != "__pycache__" {
            hashes(&entry.path, &format!("{name}/{last}"), all)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::FILES;

    /// A file missing from this list would be missing on a machine without the sources.
    #[test]
    fn every_file_of_the_generator_is_part_of_the_executable() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("mujoco");
        let there = std::fs::read_dir(folder).expect("the folder of the generator");
        let there = there.map(|entry| entry.expect("an entry").file_name().into_string().expect("a name"));
        let there: BTreeSet<String> = there.filter(|name| name.ends_with(".py")).collect();
        let named: BTreeSet<String> = FILES.iter().map(|(name, _)| (*name).to_owned()).collect();
        assert_eq!(named, there);
    }
}
