//! `freeplay doctor`: checks the fitness of this machine for runs, for medians and for tails of latencies, and names remedies.

mod clocks;
mod facts;
mod findings;
mod judge;
mod probe;
mod system;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use freeplay_report::{Block, Document, Section, Verdict as Mark};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::write;
use freeplay_terminal::messages;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::styles::styled;
use serde_json::{Value, json};

use crate::facts::Facts;
use crate::probe::{Probe, SystemState};

pub use findings::{Finding, Level, Verdict};

/// The SCHED_FIFO priority that a run requests unless its scenario sets another.
pub const DEFAULT_PRIORITY: u8 = 80;
/// The schema of its JSON output.
const SCHEMA: &str = "freeplay.doctor/1";

/// Checks whether the machine is fit for runs in real time.
#[derive(Args, Debug)]
pub struct DoctorArgs {
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
    /// Exit with code 4 unless the machine is fit for measuring tail latencies.
    #[arg(long)]
    require_rt: bool,
    /// Skip the wake-up measurement, which takes 3 s.
    #[arg(long)]
    quick: bool,
    /// Also write the findings to this HTML file.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Read the files of /proc and /sys below this folder.
    #[arg(long, value_name = "DIR", hide = true)]
    root: Option<PathBuf>,
}

/// The facts, and the findings on them.
pub struct Examination {
    findings: Vec<Finding>,
    verdict: Verdict,
    probe: Option<Probe>,
}

impl Examination {
    /// Examines the machine without any measurement, in milliseconds.
    pub fn quick() -> Self {
        Self::of(Path::new("/"), None)
    }

    fn of(root: &Path, probe: Option<Probe>) -> Self {
        let findings =
            judge::judge(&Facts::read(root), &SystemState::read(), probe.as_ref(), DEFAULT_PRIORITY);
        Self { verdict: Verdict::of(&findings), findings, probe }
    }

    /// The facts that affect timing, with the doctor's findings: for the results of a run.
    pub fn machine(&self) -> Value {
        let mut machine = json!(freeplay_shm::Machine::read());
        machine["doctor"] = json!({ "verdict": self.verdict, "findings": self.findings });
        machine
    }

    /// Checks the requirement of `--require-rt`.
    ///
    /// # Errors
    /// [`Exit::Unfit`] with the failed lines, unless the machine is fit for tails.
    pub fn require_rt(&self) -> Result<(), Failure> {
        if self.verdict.tails {
            return Ok(());
        }
        let mut message = format!("this machine is {}", self.verdict.words);
        for finding in self.findings.iter().filter(|finding| finding.level == Level::Fail) {
            let _ = write!(message, "\n  {}: {}", finding.item, finding.found);
            if let Some(remedy) = &finding.remedy {
                let _ = write!(message, ": {remedy}");
            }
        }
        Err(Failure { exit: Exit::Unfit, message })
    }

    fn json(&self) -> Value {
        json!({
            "schema": SCHEMA, "freeplay": env!("CARGO_PKG_VERSION"), "machine": freeplay_shm::Machine::read(),
            "verdict": self.verdict, "findings": self.findings, "measured": self.probe,
        })
    }

    fn in_words(&self) -> String {
        let width = self.findings.iter().map(|finding| finding.item.len()).max().unwrap_or(0);
        let mut text = String::new();
        for finding in &self.findings {
            let level = styled(finding.level.style(), format_args!("{:<4}", finding.level.word()));
            let _ = writeln!(text, " {level}  {:<width$}  {}", finding.item, finding.found);
            if let Some(remedy) = &finding.remedy {
                let _ = writeln!(text, "       {:<width$}  → {remedy}", "");
            }
        }
        let _ = writeln!(text, "\n verdict: {}{}", self.verdict.words, self.hint());
        text
    }

    fn hint(&self) -> &'static str {
        if self.verdict.tails { "" } else { " (--require-rt refuses to run on it)" }
    }

    fn page(&self) -> Document {
        let mark = |level: Level| match level {
            Level::Ok => Mark::Ok,
            Level::Warn => Mark::Warn,
            Level::Fail => Mark::Fail,
        };
        let (mut change, mut order) = (Section::new("Settings to change"), Section::new("Correct settings"));
        for finding in &self.findings {
            let words = format!("{}: {}", finding.item, finding.found);
            match &finding.remedy {
                Some(remedy) => {
                    let words = format!("{words} → {remedy}");
                    change = change.with(Block::Verdict(mark(finding.level), words));
                }
                None => order = order.with(Block::Verdict(mark(finding.level), words)),
            }
        }
        let fit = |holds: bool, what: &str| Block::Verdict(Mark::passed(holds), what.to_owned());
        Document::new("Is this machine fit?")
            .subtitle(self.verdict.words.clone())
            .overview(fit(self.verdict.lockstep, "runs in lockstep"))
            .overview(fit(self.verdict.medians, "medians of latencies in real time"))
            .overview(fit(self.verdict.tails, "tails of latencies in real time"))
            .section(change)
            .section(order)
            .footer(format!("freeplay {}", env!("CARGO_PKG_VERSION")))
    }
}

/// Examines the machine, prints its fitness and the remedies.
///
/// # Errors
/// [`Exit::Unfit`] with `--require-rt`; a file that can't be written.
pub fn doctor(args: &DoctorArgs) -> Result<Exit, Failure> {
    let probe = match (args.quick, &args.root) {
        (false, None) => {
            messages::detail("measuring how late this machine wakes a sleeping thread");
            Some(Probe::run(DEFAULT_PRIORITY)?)
        }
        _ => None,
    };
    let examination = Examination::of(args.root.as_deref().unwrap_or(Path::new("/")), probe);
    if let Some(path) = &args.html {
        write(path, &examination.page().to_html())?;
    }
    match args.format {
        Format::Json => {
            say(&format!(
                "{}\n",
                serde_json::to_string_pretty(&examination.json()).map_err(Failure::internal)?
            ))?;
        }
        Format::Text => show(&examination.in_words())?,
    }
    if args.require_rt {
        examination.require_rt()?;
    }
    Ok(Exit::Done)
}
