//! The arguments of `freeplay diagnose`.

use std::path::PathBuf;

use clap::Args;
use freeplay_diagnosis::{DiagnoseSettings, Settings, Tolerances};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::Failure;

/// Locates where a recording and a model differ, names the missing physics, models it and shows how the fit improves, or gives
/// the reason why it cannot.
///
/// The diagnosis cuts each recording in time, by its rows with motion. It searches for missing physics in the first 70 %. No law is
/// fitted to the last 30 %: the errors and gains come from there. The diagnosis leaves out laws that this part contradicts.
/// With commanded positions instead of torques, the last of several recordings takes the place of that part.
///
/// Verdicts: nothing_missing, named, one_of, unknown, insufficient_data, setup. The verdict setup means that the recording and
/// the model use different conventions (units, signs, order, zeros, gravity, clocks). All other results then apply to the
/// corrected recording. All verdicts end with exit code 0.
#[derive(Args, Debug)]
pub struct DiagnoseArgs {
    /// Model: an arm file (URDF, MJCF or TOML), or "paper".
    #[arg(long, value_name = "FILE")]
    pub model: String,
    /// Link of the model at the end of the arm. Default: the end of the chain whose joints the recording names, or of the longest
    /// chain.
    #[arg(long, value_name = "LINK")]
    pub tip: Option<String>,
    /// Recordings of one machine with the same columns, in any format that `freeplay record` reads. The diagnosis holds out a
    /// part of each recording.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub recording: Vec<PathBuf>,
    /// Mapping file that defines the meaning of the columns, such as the setup.toml of a diagnosis.
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Output format.
    #[arg(long, default_value = "text")]
    pub format: Format,
    /// Write diagnosis.json, report.html and model.toml to this folder. model.toml is the model with the missing physics, tuned
    /// within its tolerances. A name that ends in .toml writes the model alone to that file. A name that ends in .json writes the
    /// diagnosis alone.
    #[arg(long, value_name = "DIR|FILE")]
    pub out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    pub force: bool,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Cutoff frequency of the low-pass filter. Default: 3 % of the recording's sample rate, between 10 and 40 Hz, or less if the
    /// motion is noisy.
    #[arg(long, value_name = "HZ")]
    pub lowpass: Option<f64>,
    /// Tolerance of masses and inertias, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 2.0)]
    pub mass_tolerance: f64,
    /// Tolerance of the friction in the model, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 5.0)]
    pub friction_tolerance: f64,
    /// Tolerance of encoder zeros, mrad (mm for a prismatic joint).
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
