//! Blocks: short stretches of the full loop and of each yardstick in rotation, so that a disturbance by the machine affects all of them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, Ordering};

use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::histogram_files::read_hlog;
use freeplay_harness::processes::new_run;
use freeplay_harness::run::{play, play_unseen};
use freeplay_harness::run_files::Files;
use freeplay_harness::scenario::Scenario;
use freeplay_harness::setup::Setup;
use freeplay_harness::summary::RunSummary;
use freeplay_shm::Address;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::make_folder;
use freeplay_terminal::process::command_with_locked_memory;
use freeplay_terminal::running::Running;
use hdrhistogram::Histogram;

/// Histograms by stage, ns.
pub type ByStage = BTreeMap<String, Histogram<u64>>;

/// Results of one block of the full loop and the yardsticks.
pub struct Block {
    /// For each controller, in the order of the command line: its run and its histograms.
    pub full: Vec<(RunSummary, ByStage)>,
    /// The bare loop's wake-up.
    pub clock: ByStage,
    /// Bare iceoryx2.
    pub exchange: ByStage,
}

/// Settings shared by all blocks.
pub struct Stand<'a> {
    /// The scenario; its duration is that of a block.
    pub scenario: &'a Scenario,
    /// The controllers.
    pub contestants: &'a [ControllerSelection],
    /// Folder for files.
    pub out: &'a Path,
    /// Set to request an early end.
    pub stop: &'a AtomicBool,
}

impl Stand<'_> {
    /// Runs one block; every second one in reverse order. `None` if interrupted.
    ///
    /// # Errors
    /// A process that can't be started or fails.
    pub fn play(&self, number: usize) -> Result<Option<Block>, Failure> {
        let mut full: Vec<Option<(RunSummary, ByStage)>> = self.contestants.iter().map(|_| None).collect();
        let (mut clock, mut exchange) = (None, None);
        let mut order: Vec<usize> = (0..self.contestants.len() + 2).collect();
        if number % 2 == 1 {
            order.reverse();
        }
        for part in order {
            match part.checked_sub(2) {
                Some(which) => full[which] = self.full(&self.contestants[which], self.scenario)?,
                None if part == 0 => clock = Some(self.clock()?),
                None => exchange = Some(self.exchange()?),
            }
            if self.stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
        }
        let full: Option<Vec<_>> = full.into_iter().collect();
        let (Some(full), Some(clock), Some(exchange)) = (full, clock, exchange) else {
            return Err(Failure::peer("a run of the bench ended early; its message is above"));
        };
        Ok(Some(Block { full, clock, exchange }))
    }

    /// One run of the full loop.
    ///
    /// # Errors
    /// As [`Stand::play`].
    pub fn full(
        &self,
        contestant: &ControllerSelection,
        scenario: &Scenario,
    ) -> Result<Option<(RunSummary, ByStage)>, Failure> {
        self.played(contestant, scenario, false)
    }

    /// One run of the full loop with the live view of an invisible terminal.
    ///
    /// # Errors
    /// As [`Stand::play`].
    pub fn watched(
        &self,
        contestant: &ControllerSelection,
        scenario: &Scenario,
    ) -> Result<Option<(RunSummary, ByStage)>, Failure> {
        self.played(contestant, scenario, true)
    }

    fn played(
        &self,
        contestant: &ControllerSelection,
        scenario: &Scenario,
        watched: bool,
    ) -> Result<Option<(RunSummary, ByStage)>, Failure> {
        let setup = Setup::new(scenario)?;
        let folder = self.out.join("blocks");
        let files = Files::write(scenario, &setup, &folder)?;
        let (_, summary) = match watched {
            true => play_unseen(scenario, contestant, &setup, &files, self.stop)?,
            false => play(scenario, contestant, &files, 0.0, self.stop)?,
        };
        let Some(summary) = summary else { return Ok(None) };
        let histograms = read(&folder.join(format!("{}.hlog", summary.files)))?;
        Ok(Some((summary, histograms)))
    }

    fn clock(&self) -> Result<ByStage, Failure> {
        let root = new_run()?;
        let path = self.out.join("blocks").join("clock.hlog");
        self.make_folder()?;
        let cpu = self.scenario.realtime.plant_cpu;
        let mut process = self.start("clock", root.address(), cpu, 0, Some(&path))?;
        wait(&mut process)?;
        read(&path)
    }

    fn exchange(&self) -> Result<ByStage, Failure> {
        let root = new_run()?;
        let path = self.out.join("blocks").join("exchange.hlog");
        self.make_folder()?;
        let realtime = &self.scenario.realtime;
        let mut controller = self.start("controller", root.address(), realtime.controller_cpu, 0, None)?;
        let mut plant = self.start("plant", root.address(), realtime.plant_cpu, 0, Some(&path))?;
        wait(&mut plant)?;
        wait(&mut controller)?;
        read(&path)
    }

    fn make_folder(&self) -> Result<(), Failure> {
        make_folder(&self.out.join("blocks"))
    }

    fn start(
        &self,
        role: &str,
        address: &Address,
        cpu: Option<usize>,
        below: u8,
        out: Option<&PathBuf>,
    ) -> Result<Running, Failure> {
        let realtime = &self.scenario.realtime;
        let period = (1e9 / self.scenario.rate).round() as u64;
        let ticks = (self.scenario.duration.unwrap_or(1.0) * self.scenario.rate).round() as u64;
        let mut process = command_with_locked_memory()?;
        process.args(["yardstick", role, "--run", &address.to_string()]);
        process.args(["--ticks", &ticks.to_string(), "--period", &period.to_string()]);
        process.args(["--with-parent", &std::process::id().to_string()]);
        if realtime.priority > 0 {
            process.args(["--priority", &realtime.priority.saturating_sub(below).max(1).to_string()]);
        }
        if let Some(cpu) = cpu {
            process.args(["--cpu", &cpu.to_string()]);
        }
        if realtime.lock_memory {
            process.arg("--lock-memory");
        }
        if let Some(path) = out {
            process.arg("--out").arg(path);
        }
        let child = process.stdin(Stdio::null()).stdout(Stdio::null()).spawn();
        child
            .map(Running::alone)
            .map_err(|error| Failure::internal(format!("cannot start a yardstick: {error}")))
    }
}

fn wait(process: &mut Running) -> Result<(), Failure> {
    let status = process.0.wait().map_err(Failure::internal)?;
    if status.success() { Ok(()) } else { Err(Failure::internal(format!("a yardstick failed: {status}"))) }
}

fn read(path: &Path) -> Result<ByStage, Failure> {
    Ok(read_hlog(path)?.into_iter().collect())
}
