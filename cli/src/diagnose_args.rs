//! The arguments of `freeplay diagnose`.

use std::path::PathBuf;

use clap::Args;
use freeplay_diagnosis::{DiagnoseSettings, Settings, Tolerances};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::Failure;

/// Locates where a recording and a model differ, names the physics left out, models it and shows the fit improve, or says why not.
///
/// What is missing is sought in the first 70 % of a recording and judged on the rest, and on each other part by a fit that has not seen
/// it; its numbers rest on all of it. With several recordings, on all but the last, which judges. Verdicts:
/// nothing_missing, named, one_of, unknown, insufficient_data; setup, where recording and model don't mean the same (units, signs, order, zeros,
/// gravity, clocks): then all else is said of the mended reading. All of them end with exit code 0.
#[derive(Args, Debug)]
pub struct DiagnoseArgs {
    /// The model: an arm file (URDF, MJCF or TOML), or "paper".
    #[arg(long, value_name = "FILE")]
    pub model: String,
    /// The link of the model at the end of the arm; without it: the chain whose joints the recording names, else the longest one.
    #[arg(long, value_name = "LINK")]
    pub tip: Option<String>,
    /// Recordings of one machine with the same columns, of any kind that `freeplay record` reads. A part of each is held out.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub recording: Vec<PathBuf>,
    /// Mapping file that gives the meaning of the columns, such as the setup.toml of a diagnosis.
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Output format.
    #[arg(long, default_value = "text")]
    pub format: Format,
    /// Folder for diagnosis.json, report.html and model.toml, the model with what was missing, tuned inside its tolerances; a name that
    /// ends in .toml or .json is the file of the model, or of the diagnosis, alone.
    #[arg(long, value_name = "DIR|FILE")]
    pub out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    pub force: bool,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Cutoff of the low-pass; without it: 3 % of the recording's rate, 10 to 40 Hz, or less where the motion is noisy.
    #[arg(long, value_name = "HZ")]
    pub lowpass: Option<f64>,
    /// Tolerance of masses and inertias, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 2.0)]
    pub mass_tolerance: f64,
    /// Tolerance of the friction that the model names, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 5.0)]
    pub friction_tolerance: f64,
    /// Tolerance of encoder zeros, mrad (mm for a slide).
    #[arg(long, value_name = "MRAD", default_value_t = 0.1)]
    pub zero_tolerance: f64,
    /// Tolerance of lengths, mm.
    #[arg(long, value_name = "MM", default_value_t = 0.1)]
    pub length_tolerance: f64,
    /// Tolerance of delays between channels, ms.
    #[arg(long, value_name = "MS", default_value_t = 0.6)]
    pub delay_tolerance: f64,
}

impl DiagnoseArgs {
    /// The settings of the diagnosis.
    ///
    /// # Errors
    /// An invalid tolerance.
    pub fn settings(&self) -> Result<DiagnoseSettings, Failure> {
        let given = [
            ("--mass-tolerance", self.mass_tolerance),
            ("--friction-tolerance", self.friction_tolerance),
            ("--zero-tolerance", self.zero_tolerance),
            ("--length-tolerance", self.length_tolerance),
            ("--delay-tolerance", self.delay_tolerance),
        ];
        if let Some((name, value)) = given.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            return Err(Failure::usage(format!("{name} {value}: give a number above 0")));
        }
        let tolerances = Tolerances {
            mass: self.mass_tolerance / 100.0,
            inertia: self.mass_tolerance / 100.0,
            friction: self.friction_tolerance / 100.0,
            zero: self.zero_tolerance / 1e3,
            length: self.length_tolerance / 1e3,
            delay: self.delay_tolerance / 1e3,
            ..Tolerances::default()
        };
        let treatment = Settings { lowpass_hz: self.lowpass, trim_s: None };
        Ok(DiagnoseSettings { treatment, tolerances, seed: self.seed })
    }
}
