//! The live view of a run: a terminal with keys, or plain lines without a terminal.

use std::io::{BufRead, BufReader, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use freeplay_plant::OperatorRequest;
use freeplay_storage::{LiveFile, read_text, remove_file};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::unwritable;
use freeplay_terminal::flags::is_coloured;
use freeplay_terminal::output::tell;
use freeplay_terminal::running::Running;
use indicatif::ProgressBar;
use ratatui::backend::TestBackend;
use ratatui::crossterm::style::force_color_output;
use ratatui::{DefaultTerminal, Terminal};
use rustix::process::{Pid, Signal, kill_process};

use super::keys::HELP;
use super::{Action, ControllerState, Dashboard, LiveSnapshot, PICTURE, Title, draw};

/// Time between two lines.
const LINE: Duration = Duration::from_secs(1);

/// Kind of display.
enum Face {
    /// The whole terminal.
    Screen(Box<DefaultTerminal>),
    /// A line a second on standard error.
    Lines,
    /// A progress bar.
    Bar(ProgressBar),
    /// The picture of a terminal, drawn as often but not displayed.
    Unseen(Box<Terminal<TestBackend>>),
}

/// Columns and lines of the undisplayed picture.
const UNSEEN: (u16, u16) = (140, 48);

/// The view of a run.
pub struct Watch {
    face: Face,
    board: Dashboard,
    shown: Option<Instant>,
    /// Tick of the last printed line.
    told: Option<u64>,
    /// File for the standard error of the run's processes, which would disturb the picture.
    said: PathBuf,
    plant: Option<ChildStdin>,
    snapshots: Option<Receiver<LiveSnapshot>>,
    stopped: Vec<usize>,
    /// Time of the last new snapshot.
    seen: Instant,
    /// True if the person has quit by a key.
    left: Arc<AtomicBool>,
}

impl Watch {
    /// Opens the view of the run `title`. With a screen, the standard error of the run's processes goes to the file `said` until
    /// the view closes.
    ///
    /// # Errors
    /// A terminal that cannot be set up.
    pub fn open(title: Title, said: &Path) -> Result<Self, Failure> {
        let has_terminal = std::io::stdout().is_terminal() && std::io::stdin().is_terminal();
        let face = if has_terminal {
            let terminal = ratatui::try_init()
                .map_err(|error| Failure::usage(format!("--live: the terminal can't be taken: {error}")))?;
            // The library checks only NO_COLOR.
            force_color_output(is_coloured());
            Face::Screen(Box::new(terminal))
        } else {
            Face::Lines
        };
        Ok(Self::with(face, title, said))
    }

    /// A view that does all the work of a live view without a terminal, to measure its influence on the loop.
    ///
    /// # Errors
    /// An error of the library; none is known.
    pub fn unseen(title: Title, said: &Path) -> Result<Self, Failure> {
        let terminal = Terminal::new(TestBackend::new(UNSEEN.0, UNSEEN.1)).map_err(Failure::internal)?;
        Ok(Self::with(Face::Unseen(Box::new(terminal)), title, said))
    }

    /// A view that moves `bar` up to the ticks of the run `title`.
    pub fn for_progress_bar(bar: ProgressBar, title: Title, said: &Path) -> Self {
        Self::with(Face::Bar(bar), title, said)
    }

    /// Flag that becomes true when the person quits by a key.
    pub fn quit_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.left)
    }

    fn with(face: Face, title: Title, said: &Path) -> Self {
        Self {
            face,
            board: Dashboard::new(title),
            shown: None,
            told: None,
            said: said.to_owned(),
            plant: None,
            snapshots: None,
            stopped: Vec::new(),
            seen: Instant::now(),
            left: Arc::default(),
        }
    }

    /// Target for the standard error of the run's processes.
    ///
    /// # Errors
    /// An unwritable file.
    pub fn stderr(&self) -> Result<Stdio, Failure> {
        Ok(match &self.face {
            Face::Lines | Face::Bar(_) | Face::Unseen(_) => Stdio::inherit(),
            Face::Screen(_) => LiveFile::open_to_append(&self.said)?
                .to_stdio()
                .map_err(|error| unwritable(&self.said, error))?,
        })
    }

    /// Starts listening to `plant`, whose standard input and output are pipes.
    ///
    /// # Errors
    /// An error of the operating system if it has no thread left.
    pub fn listen(&mut self, plant: &mut Child) -> Result<(), Failure> {
        self.plant = plant.stdin.take();
        let Some(out) = plant.stdout.take() else { return Ok(()) };
        let (sender, snapshots) = channel();
        self.snapshots = Some(snapshots);
        std::thread::Builder::new()
            .name("glances".to_owned())
            .spawn(move || {
                let lines = BufReader::new(out).lines().map_while(Result::ok);
                let mut snapshots = lines.filter_map(|line| serde_json::from_str(&line).ok());
                while snapshots.next().is_some_and(|snapshot| sender.send(snapshot).is_ok()) {}
            })
            .map_err(Failure::no_thread)?;
        Ok(())
    }

    /// Updates the view once and runs the actions of keys. Returns true if the person has quit.
    ///
    /// # Errors
    /// The terminal is gone, or a controller cannot be restarted.
    pub fn look(
        &mut self,
        controllers: &mut [Running],
        restart: &dyn Fn(usize, Stdio) -> Result<Running, Failure>,
    ) -> Result<bool, Failure> {
        while let Some(snapshot) = self.snapshots.as_ref().and_then(|snapshots| snapshots.try_recv().ok()) {
            self.board.add_snapshot(snapshot);
            self.seen = Instant::now();
        }
        self.board.still = self.seen.elapsed().as_secs_f64();
        self.board.fates = controllers.iter_mut().map(fate).collect();
        let mut quits = false;
        if matches!(self.face, Face::Screen(_)) {
            for action in Action::pressed().map_err(Failure::internal)? {
                quits |= matches!(action, Action::Quit | Action::Interrupt);
                self.left.fetch_or(action == Action::Quit, Ordering::Relaxed);
                self.act(action, controllers, restart)?;
            }
        }
        self.show()?;
        Ok(quits)
    }

    /// Updates the view a last time with the snapshots that the plant sent before its end.
    ///
    /// # Errors
    /// The terminal is gone.
    pub fn end(&mut self) -> Result<(), Failure> {
        // The channel closes with the plant's standard output.
        while let Some(Ok(snapshot)) = self.snapshots.as_ref().map(|snapshots| snapshots.recv_timeout(LINE)) {
            self.board.add_snapshot(snapshot);
        }
        self.shown = None;
        self.show()
    }

    fn show(&mut self) -> Result<(), Failure> {
        let every = if matches!(self.face, Face::Lines) { LINE } else { PICTURE };
        if self.shown.is_some_and(|shown| shown.elapsed() < every) {
            return Ok(());
        }
        self.shown = Some(Instant::now());
        match &mut self.face {
            Face::Lines => {
                let tick = self.board.now.as_ref().map(|now| now.tick).filter(|&tick| tick > 0);
                if tick > self.told {
                    tell(&self.board.status_line());
                    self.told = tick;
                } else if let Some(words) =
                    self.board.waits().filter(|_| self.board.still >= LINE.as_secs_f64())
                {
                    tell(&words);
                }
            }
            Face::Bar(bar) => {
                if let Some(now) = &self.board.now {
                    bar.set_position(now.tick);
                }
            }
            Face::Screen(terminal) => {
                let colours = is_coloured();
                terminal.draw(|frame| draw(frame, &self.board, colours)).map_err(Failure::internal)?;
            }
            Face::Unseen(terminal) => {
                terminal.draw(|frame| draw(frame, &self.board, true)).map_err(Failure::internal)?;
            }
        }
        Ok(())
    }

    fn act(
        &mut self,
        action: Action,
        controllers: &mut [Running],
        restart: &dyn Fn(usize, Stdio) -> Result<Running, Failure>,
    ) -> Result<(), Failure> {
        let in_charge = self.board.now.as_ref().map_or(0, |now| now.in_charge);
        let name = self.board.controller(in_charge).to_owned();
        match action {
            Action::Swap(to) if to >= controllers.len() => {
                self.board.note(format!("there is no controller {}: --standby adds one", to + 1));
            }
            Action::Swap(to) => {
                let words = format!("switch to {} requested", self.board.controller(to));
                self.request(OperatorRequest::Swap { to }, words);
            }
            Action::Spoil => self.request(OperatorRequest::Spoil, format!("{name} answers with NaN once")),
            Action::Mark => self.request(OperatorRequest::Mark, "mark requested".to_owned()),
            Action::Kill | Action::Hang
                if self.board.fates.get(in_charge) == Some(&ControllerState::Ended) =>
            {
                self.board.note(format!("{name} has ended already: r restarts it"));
            }
            Action::Kill => {
                send(Signal::KILL, &controllers[in_charge]);
                self.board.note(format!("{name} killed"));
            }
            Action::Hang if self.stopped.is_empty() => {
                send(Signal::STOP, &controllers[in_charge]);
                self.stopped.push(in_charge);
                self.board.note(format!("{name} hangs"));
            }
            Action::Hang => {
                for slot in self.stopped.drain(..) {
                    send(Signal::CONT, &controllers[slot]);
                }
                self.board.note("every stopped controller continues");
            }
            Action::Restart if self.board.fates.iter().all(|fate| *fate != ControllerState::Ended) => {
                self.board.note("no controller has ended: there is none to restart");
            }
            Action::Restart => {
                for (slot, controller) in controllers.iter_mut().enumerate() {
                    if controller.0.try_wait().map_err(Failure::internal)?.is_some() {
                        *controller = restart(slot, self.stderr()?)?;
                        let words = format!("{} restarted", self.board.controller(slot));
                        self.board.note(words);
                    }
                }
            }
            Action::Quit | Action::Interrupt => self.board.note("end of the run requested"),
            Action::Nothing(key) => self.board.note(format!("no command has the key {key}: {HELP}")),
        }
        Ok(())
    }

    /// Sends `request` to the plant, which may have ended meanwhile.
    fn request(&mut self, request: OperatorRequest, words: String) {
        let line = serde_json::to_string(&request).unwrap_or_default();
        let told = self.plant.as_mut().map(|plant| writeln!(plant, "{line}").and_then(|()| plant.flush()));
        self.board.note(if matches!(told, Some(Ok(()))) {
            words
        } else {
            "the plant takes no requests any more".to_owned()
        });
    }
}

impl Drop for Watch {
    /// Restores the terminal, and prints the standard error of the processes.
    fn drop(&mut self) {
        if matches!(self.face, Face::Screen(_)) {
            ratatui::restore();
        }
        if let Ok(said) = read_text(&self.said) {
            said.lines().for_each(tell);
            // The output is on the terminal now; a remaining file does no harm.
            let _ = remove_file(&self.said);
        }
    }
}

/// State of a controller's process.
fn fate(controller: &mut Running) -> ControllerState {
    match controller.0.try_wait() {
        Ok(None) if is_stopped(controller.0.id()) => ControllerState::Hangs,
        Ok(None) => ControllerState::Runs,
        _ => ControllerState::Ended,
    }
}

/// Returns true if a signal has stopped the process `id`, according to the letter after its name in its `stat`.
fn is_stopped(id: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with(['T', 't']))
}

/// Sends `signal` to a controller that may have ended.
fn send(signal: Signal, controller: &Running) {
    if let Some(pid) = i32::try_from(controller.0.id()).ok().and_then(Pid::from_raw) {
        let _ = kill_process(pid, signal);
    }
}
