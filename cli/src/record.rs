//! `freeplay record`: shows recordings, exports them to other forms, and imports foreign ones.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use comfy_table::CellAlignment;
use freeplay_diagnosis::examine;
use freeplay_diagnosis::page::diagnose_command;
use freeplay_recording::{BagOptions, Group, ImportOptions, Mapping, Recording};
use freeplay_report::one_line;
use freeplay_report::text::{Digits, MISSING_NUMBER, number};
use freeplay_storage::same_file;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::layout::text_table;
use freeplay_terminal::messages;
use freeplay_terminal::output::{say, show};
use serde_json::{Value, json};

use crate::check;
use crate::inputs::Measured;

/// Shows recordings, and converts them to other formats.
#[derive(Args, Debug)]
pub struct RecordArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand, Debug)]
enum Action {
    /// Show the contents of a recording: joints, samples, rate, columns with their ranges, metadata, marks.
    Info(InfoArgs),
    /// Write a recording in another format: CSV, Parquet or MCAP.
    Export(ExportArgs),
    /// Convert a recording of another tool into Freeplay's format: a ROS bag, a CSV with other columns, Parquet, NumPy, MATLAB, a
    /// robot's log.
    Import(ImportArgs),
}

#[derive(Args, Debug)]
struct InfoArgs {
    /// Recording, in any format that Freeplay reads.
    recording: PathBuf,
    /// Model of the arm that made the recording: URDF, MJCF or TOML. With a model, the command also checks that model and
    /// recording agree in their conventions (units, signs, order, zeros, gravity, clocks).
    #[arg(long, value_name = "FILE")]
    model: Option<String>,
    /// Mapping file that defines the meaning of the columns. `record import` and `diagnose` write such files.
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Format for the export of a recording.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Form {
    /// Comma-separated values with a header. Each number has the fewest digits that read back to the same bits.
    Csv,
    /// Apache Parquet, in which each column holds doubles, for pandas and similar tools.
    Parquet,
    /// MCAP, for Foxglove and PlotJuggler.
    Mcap,
}

#[derive(Args, Debug)]
struct ExportArgs {
    /// Recording, in any format that Freeplay reads.
    recording: PathBuf,
    /// Format to write.
    #[arg(long)]
    format: Form,
    /// Write the export to this file. Default: a file beside the recording, with the extension of the format.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace an existing file.
    #[arg(long)]
    force: bool,
}

#[derive(Args, Debug)]
struct ImportArgs {
    /// File or folder to import: a ROS bag (MCAP, SQLite, ROS 1), CSV, Parquet, a LeRobot data set, .npz, .mat.
    file: PathBuf,
    /// Mapping file that defines the meaning of the columns. Without it, the command identifies the columns by their names and
    /// writes the mapping beside the recording.
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Topic of the bag with sensor_msgs/JointState. Default: the only such topic, or /joint_states.
    #[arg(long)]
    topic: Option<String>,
    /// Topic of the bag with geometry_msgs/msg/PoseStamped: the pose of the tool in the base frame. Default: the only such topic.
    #[arg(long)]
    pose_topic: Option<String>,
    /// Joints from base to tool. Give the name of each joint, a part of the name that no other joint has, or the column (q1) if
    /// joints have no names. Default: all joints in the order of the file.
    #[arg(long, value_delimiter = ',', value_name = "NAME,…")]
    joints: Vec<String>,
    /// Write the recording to this file: .mcap, .csv or .parquet.
    #[arg(long)]
    out: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    force: bool,
}

/// Carries out the command in `args`.
///
/// # Errors
/// A file that can't be read or written; each names place, value and remedy.
pub fn record(args: &RecordArgs) -> Result<Exit, Failure> {
    match &args.action {
        Action::Info(args) => info(args),
        Action::Export(args) => export(args),
        Action::Import(args) => import(args),
    }
}

fn info(args: &InfoArgs) -> Result<Exit, Failure> {
    let measured = Measured::read(&args.recording, args.mapping.as_deref())?;
    let recording = measured.recording().clone();
    let mut described = describe(&recording);
    let (mut setup, mut again) = (Vec::new(), String::new());
    if let Some(model) = &args.model {
        let file = measured.model(model, None)?;
        let matched = measured.for_arm(model, &file)?;
        setup = examine(&file.arm, &matched).findings;
        let recordings = std::slice::from_ref(&args.recording);
        again = diagnose_command(model, None, recordings, None, args.mapping.as_deref()) + " --out found";
        described["setup"] = serde_json::to_value(&setup).map_err(Failure::internal)?;
    }
    match args.format {
        Format::Json => {
            say(&format!("{}\n", serde_json::to_string_pretty(&described).map_err(Failure::internal)?))?;
        }
        Format::Text => show(&(in_words(&recording) + &check::block(&setup, &again)))?,
    }
    Ok(Exit::Done)
}

/// The unit of a column of the contract; empty for others.
fn unit(column: &str) -> &'static str {
    let stem = column.trim_end_matches(|c: char| c.is_ascii_digit());
    let group = Group::ALL.into_iter().find(|group| group.prefix() == stem && stem != column);
    match (group, column) {
        (Some(Group::Velocity), _) => "rad/s",
        (Some(Group::Torque), _) => "N*m",
        (Some(_), _) => "rad",
        (None, "t") => "s",
        (None, "x" | "y" | "z") => "m",
        (None, "qx" | "qy" | "qz" | "qw") => "1",
        (None, _) => "",
    }
}

/// Least and greatest finite value, if any, and the number of non-finite values.
fn range(values: &[f64]) -> (Option<[f64; 2]>, usize) {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let least_and_most = finite().reduce(f64::min).zip(finite().reduce(f64::max));
    (least_and_most.map(|(least, most)| [least, most]), values.len() - finite().count())
}

/// Shortest and longest step, s; `None` for less than two samples.
fn steps(recording: &Recording) -> Option<[f64; 2]> {
    range(&recording.t.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>()).0
}

/// Duration, s, and rate, Hz; `None` for less than two samples, or for times without a finite duration.
fn timing(recording: &Recording) -> Option<(f64, f64)> {
    let (duration, rate) = (recording.duration(), recording.rate_hz());
    (recording.len() > 1 && duration.is_finite() && rate.is_finite()).then_some((duration, rate))
}

/// The number of samples in words.
fn samples(recording: &Recording) -> String {
    match recording.len() {
        1 => "1 sample".to_owned(),
        count => format!("{count} samples"),
    }
}

fn describe(recording: &Recording) -> Value {
    let columns: Vec<Value> = recording
        .named()
        .map(|(name, values)| {
            let (range, odd) = range(values);
            let [least, most] = range.map_or([None; 2], |range| range.map(Some));
            json!({ "name": name, "unit": unit(&name), "min": least, "max": most, "not_finite": odd })
        })
        .collect();
    let [shortest, longest] = steps(recording).map_or([None; 2], |steps| steps.map(Some));
    let timing = timing(recording);
    let median = timing.map(|_| recording.median_step());
    json!({
        "schema": "freeplay.recording-info/1", "file": recording.origin, "joints": recording.joints(),
        "joint_names": recording.joint_names, "mapping": recording.guessed,
        "samples": recording.len(), "duration_s": timing.map(|(duration, _)| duration), "rate_hz": timing.map(|(_, rate)| rate),
        "step_s": { "min": shortest, "median": median, "max": longest },
        "tool_tracked": recording.tool.is_some(), "columns": columns,
        "metadata": recording.metadata.iter().map(|(key, value)| (key.clone(), json!(value))).collect::<serde_json::Map<_, _>>(),
        "events": recording.events, "truncated": recording.truncated, "notes": recording.notes,
    })
}

/// Up to so many columns outside the contract are listed on lines of their own; more share one line.
const MOST_OTHERS: usize = 6;

/// The joints' names, if there are any.
fn joints_in_words(recording: &Recording) -> String {
    match recording.joint_names.as_slice() {
        [] => String::new(),
        [only] => format!("joint q1: {only}\n\n"),
        names => format!("joints q1…q{}: {}\n\n", names.len(), names.join(", ")),
    }
}

fn in_words(recording: &Recording) -> String {
    let fixed = |value: f64, decimals| number(value, Digits::Fixed(decimals));
    let pace = match (timing(recording), steps(recording)) {
        (Some((duration, rate)), Some([shortest, longest])) => format!(
            "{} s at {} Hz (steps {} to {} ms)",
            fixed(duration, 3),
            fixed(rate, 1),
            fixed(shortest * 1e3, 3),
            fixed(longest * 1e3, 3)
        ),
        _ if recording.len() < 2 => "too few samples for a duration and a rate".to_owned(),
        _ => "times too large for a duration and a rate".to_owned(),
    };
    let mut text = format!(
        "{}: {} joints, {}, {pace}\n\n",
        recording.origin.display(),
        recording.joints(),
        samples(recording),
    );
    text += &joints_in_words(recording);
    let mut table = text_table();
    table.set_header(["column", "unit", "least", "greatest", ""]);
    let others = recording.others.len();
    let shown = recording.columns().len() - if others > MOST_OTHERS { others } else { 0 };
    for (name, values) in recording.named().take(shown) {
        let (range, odd) = range(values);
        let note = match odd {
            0 => String::new(),
            odd if odd == values.len() => "missing".to_owned(),
            odd => format!("missing in {odd}"),
        };
        let [least, most] = range
            .map_or([(); 2].map(|()| MISSING_NUMBER.to_owned()), |both| both.map(|value| fixed(value, 6)));
        table.add_row([name.as_str(), unit(&name), &least, &most, &note]);
    }
    for column in [2, 3] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    text += &format!("{table}\n");
    if others > MOST_OTHERS {
        let names: Vec<&str> = recording.others.iter().map(|(name, _)| name.as_str()).collect();
        text += &format!(
            "\n{others} other columns, not used (--format json shows their ranges): {}\n",
            names.join(", ")
        );
    }
    if !recording.metadata.is_empty() {
        let keys: Vec<&str> = recording.metadata.iter().map(|(key, _)| key.as_str()).collect();
        text += &format!("\nmetadata: {} (--format json shows them)\n", one_line(&keys.join(", ")));
    }
    for event in &recording.events {
        text += &format!("mark at {:.3} s: {}: {}\n", event.t, one_line(&event.kind), one_line(&event.text));
    }
    for note in &recording.notes {
        text += &format!("note: {}\n", one_line(note));
    }
    text
}

fn export(args: &ExportArgs) -> Result<Exit, Failure> {
    let ending = match args.format {
        Form::Csv => "csv",
        Form::Parquet => "parquet",
        Form::Mcap => "mcap",
    };
    let out = args.out.clone().unwrap_or_else(|| args.recording.with_extension(ending));
    if !out.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending)) {
        return Err(Failure::usage(format!("--out {}: the form {ending} ends in .{ending}", out.display())));
    }
    may_write(&out, &args.recording, args.force)?;
    let recording = freeplay_recording::read(&args.recording, None).map_err(Failure::input)?;
    write(&recording, &out)
}

fn import(args: &ImportArgs) -> Result<Exit, Failure> {
    may_write(&args.out, &args.file, args.force)?;
    let mapping = args.mapping.as_deref().map(Mapping::load).transpose().map_err(Failure::input)?;
    let bag = BagOptions {
        topic: args.topic.clone(),
        pose_topic: args.pose_topic.clone(),
        joints: args.joints.clone(),
    };
    let recording = freeplay_recording::import(&args.file, &ImportOptions { mapping, bag });
    let mut recording = recording.map_err(Failure::input)?;
    if !args.joints.is_empty() {
        recording = recording.only_joints(&args.joints).map_err(Failure::input)?;
    }
    let Some(guessed) = recording.guessed.take() else { return write(&recording, &args.out) };
    let beside = args.out.with_extension("mapping.toml");
    may_write(&beside, &args.file, args.force)?;
    let done = write(&recording, &args.out)?;
    freeplay_terminal::files::write(&beside, &guessed)?;
    say(&format!(
        "\n{guessed}\n{} holds this mapping; correct its errors, and import again with --mapping {} --force\n",
        beside.display(),
        beside.display()
    ))?;
    Ok(done)
}

/// Checks that `out` may be written: it is not the source, and does not exist unless `force`.
fn may_write(out: &Path, source: &Path, force: bool) -> Result<(), Failure> {
    if same_file(out, source) {
        return Err(Failure::usage(format!(
            "{}: the input cannot be the output as well; name another file with --out",
            out.display()
        )));
    }
    if (out.exists() || out.is_symlink()) && !force {
        return Err(Failure::usage(format!(
            "{}: the file exists already; name another with --out, or replace it with --force",
            out.display()
        )));
    }
    Ok(())
}

fn write(recording: &Recording, out: &Path) -> Result<Exit, Failure> {
    let summary = freeplay_recording::export(recording, out).map_err(Failure::input)?;
    for note in &recording.notes {
        messages::note(format_args!("note: {note}"));
    }
    say(&format!(
        "{}{}: {} of {} columns, {:.1} kB\n",
        joints_in_words(recording).replace("\n\n", "\n"),
        summary.file.display(),
        samples(recording),
        recording.columns().len(),
        summary.bytes as f64 * 1e-3
    ))?;
    Ok(Exit::Done)
}
