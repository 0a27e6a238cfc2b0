//! A controller of a run: built in, an FMU or an executable.

use std::path::{Path, PathBuf};

use freeplay_controller::BUILT_IN;
use freeplay_fmi::guest::FmuController;
use freeplay_terminal::exit::Failure;
use rustix::fs::{Access, access};

/// One controller to run.
#[derive(Clone, Debug)]
pub struct ControllerSelection {
    /// The requested name.
    pub(crate) asked: String,
    /// Name of its files.
    pub(crate) name: String,
    /// Executable, if the controller is not built in.
    pub executable: Option<PathBuf>,
    /// File with the plan of faults to inject into it.
    pub faults: Option<PathBuf>,
}

impl ControllerSelection {
    /// The requested name.
    pub fn asked(&self) -> &str {
        &self.asked
    }

    /// Name of its files.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// This selection with the faults of the file `plan`.
    pub fn with_faults(self, plan: PathBuf) -> Self {
        Self { faults: Some(plan), ..self }
    }

    /// The controller `asked`: a built-in name, or the path of an FMU or an executable.
    ///
    /// # Errors
    /// A name that is neither of them.
    pub fn of(asked: &str) -> Result<Self, Failure> {
        let built_in = BUILT_IN.contains(&asked);
        let path = Path::new(asked);
        if !built_in && !path.is_file() {
            return Err(if path.is_dir() && asked.contains('/') {
                Failure::input(format!("controller {asked} is a folder; name the executable in it"))
            } else if asked.contains('/') {
                Failure::input(format!(
                    "controller {asked}: the executable does not exist; build it, and check the path"
                ))
            } else {
                crate::controller_command::unknown(asked)
            });
        }
        let is_fmu = FmuController::is_named(path);
        if !built_in && !is_fmu && access(path, Access::EXEC_OK).is_err() {
            return Err(Failure::input(format!(
                "controller {asked}: not executable: name a program, or allow it with chmod +x"
            )));
        }
        let name =
            path.file_name().map_or_else(|| asked.to_owned(), |name| name.to_string_lossy().into_owned());
        let executable =
            (!built_in).then(|| std::path::absolute(path)).transpose().map_err(Failure::input)?;
        Ok(Self { asked: asked.to_owned(), name, executable, faults: None })
    }
}
