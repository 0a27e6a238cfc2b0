//! `freeplay excite`: designs a safe next motion that distinguishes two causes which a recording left possible.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use freeplay_diagnosis::page::title;
use freeplay_diagnosis::{
    ChannelNoise, Diagnosis, Effect, Excitation, ExciteError, ExciteSettings, Rival, Tolerances,
    excite as sought,
};
use freeplay_harness::setup::{PAPER_MODEL, load_selected};
use freeplay_model::{ArmFile, Selection};
use freeplay_path::{JointPath, PathKind, PathSpec};
use freeplay_recording::Recording;
use freeplay_report::paste::{seen_from, shell_word};
use freeplay_report::units::power_of_ten;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{read_json, write};
use freeplay_terminal::output::{say, show};
use freeplay_terminal::target::{asked_file, claim_out, folder_of};
use freeplay_terminal::{flags, messages, progress};
use serde_json::Value;

use crate::inputs::Measured;

/// Rows per second of the written path.
const RATE: f64 = 200.0;
/// Most causes to be separated from the first.
const MOST: usize = 2;
/// Assumed noise without a diagnosis: a thousandth of a joint's greatest torque (or 0.1 N·m), 50 µm, 0.1 mrad.
const TORQUE_SHARE: f64 = 1e-3;
const TORQUE_NOISE: f64 = 0.1;
const TOOL_NOISE: f64 = 5e-5;
const LINK_NOISE: f64 = 1e-4;
/// Independent samples per second, assumed without a diagnosis.
const PER_SECOND: f64 = 10.0;

/// Designs a safe motion that distinguishes between the causes that a recording leaves possible, and estimates the odds.
///
/// The motion of every joint is a short Fourier series that starts and ends at rest. It stays within 80 % of the position, speed,
/// acceleration and torque limits in the arm file. The design ignores obstacles around the arm: check the motion before you run
/// it. excite.csv holds the rows of the motion (t, q1…qn), and excite.toml is a scenario for `freeplay run`.
#[derive(Args, Debug)]
pub struct ExciteArgs {
    /// Diagnosis file (diagnosis.json) that names its model and recordings.
    diagnosis: Option<PathBuf>,
    /// Model: an arm file (URDF, MJCF or TOML), or "paper". Default: the model of the diagnosis.
    #[arg(long, value_name = "FILE")]
    model: Option<String>,
    /// Link of the model at the end of the arm. Default: the link in the diagnosis.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Two kinds of effects to distinguish, if there is no diagnosis: --kinds backlash,joint_elasticity --joint elbow.
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    kinds: Vec<String>,
    /// Joint where the effects of --kinds may occur. Leave it out for effects of the whole arm.
    #[arg(long, requires = "kinds")]
    joint: Option<String>,
    /// Write excite.csv and excite.toml to this folder. A name that ends in .toml is the file of the scenario, and the rows go
    /// beside it.
    #[arg(long, value_name = "DIR|FILE", default_value = "out")]
    out: PathBuf,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Duration of the motion, s.
    #[arg(long, default_value_t = 16.0, value_name = "S")]
    duration: f64,
    /// Number of candidate motions.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    candidates: u32,
    /// Joint positions around which the arm moves, rad (m), one value for each joint. Default: the middle of the recording, or of
    /// the joints' ranges without a recording.
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_name = "Q1,Q2,…")]
    posture: Option<Vec<f64>>,
    /// Largest distance of a joint from the posture, rad (m).
    #[arg(long, default_value_t = 1.2, value_name = "RAD")]
    reach: f64,
    /// Seed of the search.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// The causes to be separated, with the known facts.
pub struct Question<'a> {
    /// The model's file.
    pub file: &'a ArmFile,
    /// The causes, the likeliest first.
    pub rivals: Vec<Rival>,
    /// The recording that left them possible.
    pub seen: Option<&'a Recording>,
}

/// Endings of the files that a search for a motion writes.
const EXTENSIONS: [&str; 1] = ["toml"];
/// Results in the folder that `--out` names.
const RESULTS: [&str; 2] = ["excite.csv", "excite.toml"];

/// Searches the motion that `args` ask for, and writes it.
///
/// # Errors
/// Bad input, or no safe motion.
pub fn excite(args: &ExciteArgs) -> Result<Exit, Failure> {
    if !(args.duration >= 2.0 && args.duration <= 600.0) {
        return Err(Failure::usage(format!("--duration {}: between 2 and 600 s", args.duration)));
    }
    if !(args.reach > 0.0 && args.reach.is_finite()) {
        return Err(Failure::usage(format!("--reach {}: give a number above 0", args.reach)));
    }
    let found = args.diagnosis.as_deref().map(PriorDiagnosis::read).transpose()?;
    let model = args.model.clone().or_else(|| found.as_ref().map(|found| found.model.clone()));
    let model = model.ok_or_else(|| Failure::usage("name a diagnosis.json, or --model with --kinds"))?;
    let tip = args.tip.clone().or_else(|| found.as_ref().and_then(|found| found.tip.clone()));
    let measured = found.as_ref().and_then(|found| found.recordings.first());
    let measured = measured.map(|path| Measured::read(path, None)).transpose()?;
    let file = match &measured {
        Some(measured) => measured.model(&model, tip.as_deref())?,
        None => load_selected(&model, &Selection { tip, joints: Vec::new() })?,
    };
    let seen = measured.map(|measured| measured.for_arm(&model, &file)).transpose()?;
    let rivals = match &found {
        _ if !args.kinds.is_empty() => named(args, &file)?,
        Some(found) => found.rivals(&file)?,
        None => return Err(Failure::usage("name a diagnosis.json, or two --kinds with their --joint")),
    };
    args.posture.as_deref().map_or(Ok(()), |posture| within_reach(posture, &file))?;
    let noise = match found.map(|found| found.noise).filter(|noise| !noise.is_empty()) {
        Some(noise) => noise,
        None => usual_noise(&file),
    };
    let settings = ExciteSettings {
        duration: args.duration,
        candidates: args.candidates as usize,
        seed: args.seed,
        posture: args.posture.clone(),
        reach: args.reach,
        tolerances: Tolerances::default(),
        noise,
    };
    let question = Question { file: &file, rivals, seen: seen.as_ref() };
    // Checked first, since the search takes minutes.
    let folder = claim_out(&args.out, &EXTENSIONS, &RESULTS, args.force)?;
    let found = seek(&question, &settings)?;
    let path = write_path(&found, &model, &file, &args.out)?;
    drop(folder);
    match args.format {
        Format::Json => say(&format!("{:#}\n", json(&found, &file, &path)))?,
        Format::Text => show(&text(&found, &file, &path))?,
    }
    Ok(Exit::Done)
}

/// Searches a motion, with progress on standard error.
///
/// # Errors
/// Bad input, or no safe motion.
pub fn seek(question: &Question, settings: &ExciteSettings) -> Result<Excitation, Failure> {
    messages::detail(format_args!("comparing {} motions", settings.candidates));
    let bar = progress::bar(settings.candidates as u64, "comparing motions {wide_bar} {pos}/{len}  {msg}");
    let found = sought(question.file, &question.rivals, question.seen, settings, &mut |number, _, best| {
        bar.set_position(number as u64);
        bar.set_message(format!("best {} : 1", power_of_ten(best)));
    });
    bar.finish_and_clear();
    found.map_err(|error| match error {
        ExciteError::TooFew => Failure::input(
            "the diagnosis leaves only one cause, so that no motion has to separate two; name two --kinds with their --joint",
        ),
        other => Failure::input(other),
    })
}

/// Checks that `posture` lies within the ranges of the joints. The search itself checks the number of values.
fn within_reach(posture: &[f64], file: &ArmFile) -> Result<(), Failure> {
    let mut joints = file.arm.joints().iter().zip(posture);
    match joints.find(|(joint, q)| !(joint.limits.lower..=joint.limits.upper).contains(*q)) {
        None => Ok(()),
        Some((joint, q)) => Err(Failure::usage(format!(
            "--posture: {} at {q} is beyond its range; give {} to {} rad (m)",
            joint.name, joint.limits.lower, joint.limits.upper
        ))),
    }
}

/// The two kinds on the command line.
fn named(args: &ExciteArgs, file: &ArmFile) -> Result<Vec<Rival>, Failure> {
    let joint = args.joint.as_deref();
    args.kinds.iter().map(|kind| rival(kind, joint, None, file)).collect()
}

/// The effect `kind` at `joint` as a cause; a kind of the whole arm ignores the joint.
fn rival(
    kind: &str,
    joint: Option<&str>,
    parameters: Option<toml::Table>,
    file: &ArmFile,
) -> Result<Rival, Failure> {
    let known = freeplay_laws::kind(kind).ok_or_else(|| {
        let all: Vec<&str> = freeplay_laws::CATALOGUE.iter().map(|kind| kind.name).collect();
        Failure::usage(format!("unknown effect kind {kind:?}; choose among {}", all.join(", ")))
    })?;
    let whole = known.site == freeplay_laws::Site::Arm;
    let joint = match joint.filter(|_| !whole) {
        None => None,
        Some(name) => Some(file.arm.joint_index(name).ok_or_else(|| {
            let names: Vec<&str> = file.arm.joints().iter().map(|joint| joint.name.as_str()).collect();
            Failure::usage(format!("the arm has no joint {name:?}; choose among {}", names.join(", ")))
        })?),
    };
    if !known.fits(joint.map(|joint| &file.arm.joints()[joint])) {
        let joints: Vec<&str> = file.arm.joints().iter().map(|joint| joint.name.as_str()).collect();
        let place = joint.map_or("without a joint".to_owned(), |joint| format!("at {}", joints[joint]));
        return Err(Failure::usage(format!(
            "{kind} does not apply {place}: name another joint with --joint; the arm has {}",
            joints.join(", ")
        )));
    }
    Ok(Rival { kind: known, joint, parameters })
}

/// The fields of a diagnosis.json that the next motion needs.
struct PriorDiagnosis {
    path: PathBuf,
    model: String,
    tip: Option<String>,
    recordings: Vec<PathBuf>,
    noise: BTreeMap<String, ChannelNoise>,
    json: Value,
}

impl PriorDiagnosis {
    fn read(path: &Path) -> Result<Self, Failure> {
        let wrong = |what: String| Failure::input(format!("{}: {what}", path.display()));
        let json: Value = read_json(path, "a diagnosis.json that freeplay diagnose --out left")?;
        let model = json["inputs"]["model"].as_str().ok_or_else(|| {
            wrong(
                "inputs.model is missing; give a diagnosis.json that freeplay diagnose --out left".to_owned(),
            )
        })?;
        let recordings = json["inputs"]["recordings"].as_array().into_iter().flatten();
        let mut noise = BTreeMap::new();
        for (channel, one) in json["noise"].as_object().into_iter().flatten() {
            let number = |key: &str| one[key].as_f64().unwrap_or(0.0);
            let known = ChannelNoise { deviation: number("deviation"), per_second: number("per_second") };
            noise.insert(channel.clone(), known);
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        // If the diagnosis was moved without its inputs, their original paths may still exist.
        let beside =
            |name: &str| Some(folder.join(name)).filter(|path| path.exists()).unwrap_or_else(|| name.into());
        Ok(Self {
            path: path.to_owned(),
            model: if model == PAPER_MODEL { model.to_owned() } else { beside(model).display().to_string() },
            tip: json["inputs"]["tip"].as_str().map(str::to_owned),
            recordings: recordings.filter_map(Value::as_str).map(beside).collect(),
            noise,
            json,
        })
    }

    /// The first effect that has a rival, and the causes that the recordings cannot tell from it.
    fn rivals(&self, file: &ArmFile) -> Result<Vec<Rival>, Failure> {
        let wrong = |what: &str| Failure::input(format!("{}: {what}", self.path.display()));
        let list = |key: &str| self.json[key].as_array().cloned().unwrap_or_default();
        let open: Vec<Value> =
            list("alternatives").into_iter().filter(|other| other["indistinguishable"] == true).collect();
        let Some(first) = open.first() else {
            return Err(wrong("only one cause is left; name two --kinds with their --joint"));
        };
        let instead_of = first["instead_of"].as_str().unwrap_or_default();
        let effect = list("effects")
            .into_iter()
            .find(|effect| is_said_by(instead_of, effect["kind"].as_str(), effect["joint"].as_str()))
            .ok_or_else(|| wrong("the effect that has an alternative is not in `effects`"))?;
        let mut parameters = toml::Table::new();
        for (name, one) in effect["parameters"].as_object().into_iter().flatten() {
            let value = toml::Value::try_from(&one["value"]).map_err(|error| wrong(&error.to_string()))?;
            parameters.insert(name.clone(), value);
        }
        let kind = |value: &Value| value["kind"].as_str().unwrap_or_default().to_owned();
        let mut rivals = vec![rival(&kind(&effect), effect["joint"].as_str(), Some(parameters), file)?];
        let others = open.iter().filter(|other| other["instead_of"].as_str() == Some(instead_of));
        for other in others.take(MOST) {
            rivals.push(rival(&kind(other), other["joint"].as_str(), None, file)?);
        }
        Ok(rivals)
    }
}

/// The first effect of `diagnosis` that has a rival, and the causes that the recordings cannot tell from it; `None` if there is no such effect.
///
/// # Errors
/// An effect that does not fit the arm.
pub fn rivals(diagnosis: &Diagnosis, file: &ArmFile) -> Result<Vec<Rival>, Failure> {
    let open: Vec<_> = diagnosis.alternatives.iter().filter(|other| other.indistinguishable).collect();
    let Some(first) = open.first() else { return Ok(Vec::new()) };
    let stands = |effect: &&Effect| is_said_by(&first.instead_of, Some(effect.kind), effect.joint.as_deref());
    let Some(effect) = diagnosis.effects.iter().find(stands) else { return Ok(Vec::new()) };
    let parameters = effect.parameters.iter().map(|(name, one)| (name.clone(), one.value.clone())).collect();
    let mut rivals = vec![rival(effect.kind, effect.joint.as_deref(), Some(parameters), file)?];
    let others = open.iter().filter(|other| other.instead_of == first.instead_of);
    for other in others.take(MOST) {
        rivals.push(rival(other.kind, other.joint.as_deref(), None, file)?);
    }
    Ok(rivals)
}

/// True if `instead_of` of an alternative denotes the effect `kind` at `joint`.
fn is_said_by(instead_of: &str, kind: Option<&str>, joint: Option<&str>) -> bool {
    let of_kind = kind.is_some_and(|kind| instead_of.split(' ').next() == Some(kind));
    of_kind && joint.is_none_or(|joint| instead_of.ends_with(joint))
}

/// Assumed noise of the channels without a diagnosis.
fn usual_noise(file: &ArmFile) -> BTreeMap<String, ChannelNoise> {
    let with = |deviation: f64| ChannelNoise { deviation, per_second: PER_SECOND };
    let joints = file.arm.joints().iter().enumerate();
    let mut noise: BTreeMap<String, ChannelNoise> = joints
        .map(|(index, joint)| {
            let effort = joint.limits.effort;
            let deviation =
                if effort.is_finite() && effort > 0.0 { TORQUE_SHARE * effort } else { TORQUE_NOISE };
            (format!("tau{}", index + 1), with(deviation))
        })
        .collect();
    noise.extend(["x", "y", "z"].map(|axis| (axis.to_owned(), with(TOOL_NOISE))));
    noise.extend((1..=file.arm.dof()).map(|joint| (format!("q_link{joint}"), with(LINK_NOISE))));
    noise
}

/// Writes excite.csv and excite.toml into the folder `out`, or the file `out` that ends in .toml with its rows beside it. Plans the path as the plant would.
/// Returns the scenario's path.
///
/// # Errors
/// A file that can't be written.
pub fn write_path(found: &Excitation, model: &str, file: &ArmFile, out: &Path) -> Result<PathBuf, Failure> {
    let is_file = asked_file(out, &EXTENSIONS).is_some();
    let folder = if is_file { folder_of(out) } else { out };
    let scenario_file = if is_file { out.to_owned() } else { out.join("excite.toml") };
    let motion = found.motion.trajectory(RATE);
    let mut rows = String::from("t");
    (1..=file.arm.dof()).for_each(|joint| {
        let _ = write!(rows, ",q{joint}");
    });
    for (k, t) in motion.t.iter().enumerate() {
        let _ = write!(rows, "\n{t:.4}");
        for q in &motion.q {
            let _ = write!(rows, ",{:.9}", q[k]);
        }
    }
    rows.push('\n');
    let csv = std::path::absolute(scenario_file.with_extension("csv")).map_err(Failure::input)?;
    write(&csv, &rows)?;
    let spec = PathSpec { kind: PathKind::File, file: Some(csv.clone()), ..PathSpec::default() };
    JointPath::plan(&file.arm, &spec, 1000.0).map_err(Failure::internal)?;
    let mut scenario = toml::Table::new();
    // A scenario's paths are relative to its own folder.
    let seen = if model == PAPER_MODEL { PathBuf::from(model) } else { seen_from(folder, Path::new(model)) };
    scenario.insert("model".to_owned(), seen.display().to_string().into());
    let rows_name = csv.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut path = toml::Table::new();
    path.insert("kind".to_owned(), "file".into());
    path.insert("file".to_owned(), rows_name.into());
    scenario.insert("path".to_owned(), toml::Value::Table(path));
    let names: Vec<String> = found.rivals.iter().map(|rival| name(rival, file)).collect();
    let text = format!(
        "# A motion that separates {}: expected odds about {} : 1.\n{}",
        names.join(" and "),
        power_of_ten(least(&found.log_odds)),
        toml::to_string(&scenario).map_err(Failure::internal)?
    );
    write(&scenario_file, &text)?;
    Ok(scenario_file)
}

/// Kind and place of a cause.
fn name(rival: &Rival, file: &ArmFile) -> String {
    title(rival.kind.name, rival.joint.map(|joint| file.arm.joints()[joint].name.as_str()))
}

fn least(odds: &[f64]) -> f64 {
    odds.iter().copied().fold(f64::INFINITY, f64::min)
}

/// One sentence: the motion, the causes that it separates, and the odds.
pub fn sentence(found: &Excitation, file: &ArmFile, path: &Path) -> String {
    let names: Vec<String> = found.rivals.iter().map(|rival| name(rival, file)).collect();
    format!(
        "the motion in {} ({:.0} s) would separate {} with odds of about {} : 1",
        shell_word(path),
        found.motion.duration,
        names.join(" and "),
        power_of_ten(least(&found.log_odds))
    )
}

fn text(found: &Excitation, file: &ArmFile, path: &Path) -> String {
    let mut text = String::new();
    let first = name(&found.rivals[0], file);
    for (index, (rival, odds)) in found.rivals[1..].iter().zip(&found.log_odds).enumerate() {
        let _ = write!(text, "{first} or {}: expected odds {} : 1", name(rival, file), power_of_ten(*odds));
        let _ = match found.log_odds_before.as_ref().and_then(|before| before.get(index)) {
            Some(before) => writeln!(text, " (the recorded motion: {} : 1)", power_of_ten(*before)),
            None => writeln!(text, " for causes ten times as large as the noise"),
        };
    }
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let used = &found.used;
    let _ = writeln!(
        text,
        "the motion uses {} of the range, {} of the speed, {} of the acceleration and {} of the torque that are allowed (80 % of the arm file's limits)",
        percent(used.position),
        percent(used.speed),
        percent(used.acceleration),
        percent(used.torque)
    );
    for note in &found.notes {
        let _ = writeln!(text, "note: {note}");
    }
    text.push_str("Freeplay does not know the surroundings of the arm: check the path before you run it.\n");
    let _ = writeln!(
        text,
        "path    {}   {:.0} s, from rest to rest",
        shell_word(&path.with_extension("csv")),
        found.motion.duration
    );
    if !flags::is_quiet() {
        let _ = writeln!(text, "next    freeplay run {}", shell_word(path));
    }
    text
}

fn json(found: &Excitation, file: &ArmFile, path: &Path) -> Value {
    let rivals = found.rivals.iter().map(|rival| {
        let joint = rival.joint.map(|joint| file.arm.joints()[joint].name.clone());
        serde_json::json!({ "kind": rival.kind.name, "joint": joint, "parameters": rival.parameters })
    });
    serde_json::json!({
        "schema": "freeplay.excite/1",
        "rivals": rivals.collect::<Vec<_>>(),
        "log_odds": found.log_odds,
        "log_odds_before": found.log_odds_before,
        "duration": found.motion.duration,
        "used": { "position": found.used.position, "speed": found.used.speed,
                  "acceleration": found.used.acceleration, "torque": found.used.torque },
        "notes": found.notes,
        "scenario": path,
        "path": path.with_extension("csv"),
    })
}
