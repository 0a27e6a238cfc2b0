//! The files that the processes of a run share.

use std::path::{Path, PathBuf};

use freeplay_recording::ReadError;
use freeplay_storage::{FileIdentity, remove_file};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;

use crate::controller_selection::ControllerSelection;
use crate::scenario::Scenario;
use crate::setup::Setup;
use crate::weights;

/// The files that the processes of a run share.
pub struct Files {
    /// The effective scenario.
    pub scenario: PathBuf,
    /// Task of the controllers.
    pub task: PathBuf,
    /// Model written for the controllers, if there is one.
    pub model: Option<PathBuf>,
    /// The folder of results.
    pub out: PathBuf,
}

impl Files {
    /// Creates the folder `out` and writes the files into it.
    ///
    /// # Errors
    /// A folder or a file that cannot be created.
    pub fn write(scenario: &Scenario, setup: &Setup, out: &Path) -> Result<Self, Failure> {
        freeplay_terminal::files::make_folder(out)?;
        let out = std::path::absolute(out).map_err(Failure::input)?;
        let model = out.join("model.toml");
        let earlier = FileIdentity::of(&model);
        let task = setup.write_task(scenario, &out)?;
        let model = (FileIdentity::of(&model) != earlier).then_some(model);
        let files = Self { scenario: out.join("scenario.toml"), task, model, out };
        write(&files.scenario, &absolute(scenario)?.to_toml().map_err(Failure::internal)?)?;
        Ok(files)
    }

    /// Removes these files, and those of runs of `contestants` that did not begin. If one of them recorded a tick, the function removes
    /// nothing.
    pub fn give_up(&self, contestants: &[ControllerSelection]) -> Result<(), Failure> {
        let named = |ending: &str| {
            let file =
                |contestant: &ControllerSelection| self.out.join(format!("{}.{ending}", contestant.name));
            contestants.iter().map(file).collect::<Vec<PathBuf>>()
        };
        let recordings = RECORDED.map(named).concat();
        if recordings.iter().any(|file| file.exists() && !is_without_samples(file)) {
            return Ok(());
        }
        let all = recordings.into_iter().chain(named("stderr"));
        all.chain([self.scenario.clone(), self.task.clone()])
            .chain(self.model.clone())
            .try_for_each(|file| Ok(remove_file(&file)?))
    }
}

/// Returns true if the recording `file` exists and has no samples.
pub fn is_without_samples(file: &Path) -> bool {
    matches!(
        freeplay_recording::read_overview(file, None, 1),
        Err(ReadError::NoSamples { .. } | ReadError::Empty { .. })
    )
}

/// Endings of recordings.
pub const RECORDED: [&str; 2] = ["mcap", "csv"];

/// The scenario with absolute paths, which are valid in any folder.
fn absolute(scenario: &Scenario) -> Result<Scenario, Failure> {
    let mut scenario = scenario.clone();
    if scenario.model != freeplay_controller::task::PAPER_MODEL {
        scenario.model = std::path::absolute(&scenario.model).map_err(Failure::input)?.display().to_string();
    }
    if let Some(model) = scenario.controller.model.as_mut()
        && *model != freeplay_controller::task::PAPER_MODEL
    {
        *model = std::path::absolute(&*model).map_err(Failure::input)?.display().to_string();
    }
    scenario.controller.weights = weights::of(&scenario)?;
    scenario.path.file = scenario.path.file.map(std::path::absolute).transpose().map_err(Failure::input)?;
    if let Some(sound) = scenario.compare.as_mut().and_then(|compare| compare.sound.as_mut()) {
        *sound = std::path::absolute(&*sound).map_err(Failure::input)?;
    }
    Ok(scenario)
}
