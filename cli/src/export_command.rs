//! `freeplay export`: a model in the formats of other tools.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use freeplay_harness::setup::load_selected;
use freeplay_model::export::{Exported, to_mjcf, to_urdf};
use freeplay_model::{ArmFile, Selection};
use freeplay_report::one_line;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{check_target, write};
use freeplay_terminal::messages;
use freeplay_terminal::output::{say, show};
use serde_json::json;

/// Writes a model, such as the model.toml of a diagnosis, in the format of another tool.
///
/// URDF can express masses, positions, limits, damping and friction. MJCF can also express rotor inertias, springs, elastic
/// gears, gaps, play, shafts, drives and delays. The command lists what the format cannot express, here and at the top of the
/// file. An FMU is the plant with all effects.
#[derive(Args, Debug)]
pub struct ExportArgs {
    /// Model: an arm file (URDF, MJCF or TOML), or "paper".
    model: String,
    /// Format to write.
    #[arg(long, value_name = "FORMAT")]
    to: Target,
    /// Write the model to this file. Default: standard output, as text.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Link of the model at the end of the arm. Default: tool0, or the end of the longest chain without its fingers.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Output format of the list of effects that the file cannot express. Used with --out.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Format of another tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Target {
    /// Robot description for ROS, Pinocchio, Drake and most other tools.
    Urdf,
    /// Model file for MuJoCo.
    Mjcf,
    /// FMI 3.0 Co-Simulation: the simulated machine, for Simulink, Modelica tools and others.
    Fmu,
}

impl Target {
    fn name(self) -> &'static str {
        match self {
            Target::Urdf => "URDF",
            Target::Mjcf => "MJCF",
            Target::Fmu => "FMU",
        }
    }
}

/// Writes the model of `args`.
///
/// # Errors
/// A model that can't be read, or an impossible one with its effects; a file that can't be written.
pub fn export(args: &ExportArgs) -> Result<Exit, Failure> {
    args.out.as_deref().map_or(Ok(()), check_target)?;
    let file = load_selected(&args.model, &Selection { tip: args.tip.clone(), joints: Vec::new() })?;
    let mechanism = freeplay_laws::mechanism(&file)
        .map_err(|error| Failure::input(format!("{}: {error}", args.model)))?;
    let exported = match args.to {
        Target::Urdf => to_urdf(&mechanism),
        Target::Mjcf => to_mjcf(&mechanism),
        Target::Fmu => return fmu(args, &file),
    };
    let Some(out) = &args.out else {
        say(&exported.text)?;
        exported.not_expressed.iter().for_each(|line| messages::note(format_args!("not expressed: {line}")));
        return Ok(Exit::Done);
    };
    write(out, &exported.text)?;
    match args.format {
        Format::Json => say(&format!("{:#}\n", described(args, out, &exported)))?,
        Format::Text => show(&in_words(args, out, &file, &exported))?,
    }
    Ok(Exit::Done)
}

/// Writes the FMU of `file`.
fn fmu(args: &ExportArgs, file: &ArmFile) -> Result<Exit, Failure> {
    let Some(out) = &args.out else {
        return Err(Failure::usage("an FMU is an archive: name it with --out FILE.fmu"));
    };
    let program = std::env::current_exe().map_err(Failure::internal)?;
    freeplay_fmi::write_fmu(file, &program, out)
        .map_err(|error| Failure::input(format!("{}: {error}", args.model)))?;
    let all = Exported { text: String::new(), not_expressed: Vec::new() };
    match args.format {
        Format::Json => say(&format!("{:#}\n", described(args, out, &all)))?,
        Format::Text => show(&in_words(args, out, file, &all))?,
    }
    Ok(Exit::Done)
}

fn described(args: &ExportArgs, out: &Path, exported: &Exported) -> serde_json::Value {
    json!({
        "schema": "freeplay.export/1", "model": args.model, "to": args.to.name().to_lowercase(), "file": out,
        "unsaid": exported.not_expressed,
    })
}

fn in_words(args: &ExportArgs, out: &Path, file: &ArmFile, exported: &Exported) -> String {
    let (name, joints) = (one_line(file.arm.name()), file.arm.dof());
    let effects = match file.effects.len() {
        0 => String::new(),
        1 => ", 1 effect".to_owned(),
        count => format!(", {count} effects"),
    };
    let mut text = format!("{}: {name}, {joints} joints{effects} as {}\n", out.display(), args.to.name());
    if exported.not_expressed.is_empty() {
        text.push_str("the file expresses the whole model\n");
    } else {
        text.push_str("the file cannot express:\n");
    }
    for line in &exported.not_expressed {
        let _ = writeln!(text, "- {}", one_line(line));
    }
    text
}
