//! Servos of arms with recorded torques, commanded and measured positions. The torques determine the arm; its servos are those that produce these torques from
//! the commands. The findings from the torques stay unchanged.

use freeplay_model::ArmFile;
use freeplay_recording::{Group, Recording};
use freeplay_servo::{ServoArm, Sight, Track, sights};
use toml::Value;

use super::compare::late;
use super::diagnose::{deviations_of, moves, quickest, rivals};
use super::findings::named_from;
use super::parts::{Parts, moving_cut, rounding};
use super::scores::{Deviations, deviations, gain};
use super::torque_law::{Sheet, TorqueLaw};
use super::torque_servos::{Simulated, delay_of, findings, number, with_servos};
use super::tracks::{for_fit, for_lags, track};
use crate::data::thinning::bounded;
use crate::report::diagnosis::{Diagnosis, Verdict};
use crate::report::settings::{DiagnoseError, DiagnoseSettings};
use crate::signals::motion::Treatment;
use crate::statistics::{SHARES, half_width};

/// The servos of the joints, as laws of torque.
pub struct Laws {
    /// The law of each joint; `None` for joints whose command does not move.
    pub of_joint: Vec<Option<TorqueLaw>>,
    /// Growth of each delay, s, per second of delay of the encoders behind the torques.
    pub growth: Vec<f64>,
    /// Standard deviation of the delay of the encoders behind the torques, s.
    pub deviation: f64,
}

/// Adds servos to `diagnosis`, which describes the arm from its torques, if servos produce these torques from the commanded positions of `recordings`. Every
/// joint whose command moves needs a valid law in torque and in position, on rows outside its fit. Its residual torque is at most that of the arm's own laws,
/// of the encoder's rounding and of the tolerance together. The positions simulated with it are nearer to the measured ones than the commands with any delay.
///
/// # Errors
/// [`DiagnoseError::Law`]: the effects of a model are invalid.
pub fn add_servos(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    mut diagnosis: Diagnosis,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    let has_both = |recording: &Recording| recording.q_ref.is_some() && recording.tau.is_some();
    if diagnosis.verdict == Verdict::InsufficientData || !recordings.iter().all(has_both) {
        return Ok(diagnosis);
    }
    progress("testing whether servos produce the torques from the commanded positions");
    let recordings = bounded(recordings, &mut Vec::new());
    let whole: Vec<Track> = recordings.iter().map(track).collect();
    let few: Vec<Track> = whole.iter().map(for_lags).collect();
    let seen = sights(&file.arm, &few);
    let tracks: Vec<Track> = whole.iter().map(|track| for_fit(track, quickest(&seen))).collect();
    drop((whole, few));
    let parts = in_two(&tracks);
    let question =
        Question { recordings: &recordings, tracks: &tracks, parts: &parts, sights: &seen, settings };
    let Some(laws) = question.laws(file, &diagnosis) else { return Ok(diagnosis) };
    progress("simulating the recordings from their commanded positions");
    let found = findings(file, &laws, &settings.tolerances);
    let model = with_servos(&diagnosis.model, &found, &laws, &seen);
    let Some(mut servos) = ServoArm::of(&model)? else { return Ok(diagnosis) };
    // The model has only delays that differ significantly from zero; this simulation has those of the rows.
    for (joint, law) in laws.of_joint.iter().enumerate() {
        let named = delay_of(&model, joint);
        servos.joints[joint].delay += law.map_or(0.0, |law| law.delay.0 - named);
    }
    let given = ServoArm::of(file)?;
    let before: Deviations = match &given {
        Some(given) => deviations_of(given, &tracks),
        None => tracks.iter().map(|track| deviations(track, &late(track, &vec![0.0; seen.len()]))).collect(),
    };
    let (lagged, filtered) = rivals(&parts.fit, &tracks, &seen);
    let after = deviations_of(&servos, &tracks);
    let joints: Vec<usize> = (0..seen.len()).filter(|joint| laws.of_joint[*joint].is_some()).collect();
    let nearer = gain([&lagged, &after], &parts.test, &joints, &tracks, settings.seed);
    if nearer.ci95[0] <= 0.0 {
        return Ok(diagnosis);
    }
    let simulated = Simulated {
        file,
        recordings: &recordings,
        tracks: &tracks,
        parts: &parts,
        sights: &seen,
        settings,
        joints,
        servos,
        before,
        lagged,
        filtered,
        after,
    };
    simulated.add_to(&mut diagnosis, &found);
    diagnosis.model = model;
    Ok(diagnosis)
}

/// Splits each of `tracks`: the last 30 % are the test part, the rest is the fit part.
fn in_two(tracks: &[Track]) -> Parts {
    let cut = |track: &Track| moving_cut(track, SHARES[1]);
    let each = || tracks.iter().enumerate();
    Parts {
        fit: each().map(|(index, track)| (index, 0..cut(track))).collect(),
        choice: Vec::new(),
        test: each().map(|(index, track)| (index, cut(track)..track.stamps.len())).collect(),
        words: "the last 30 % of each recording".to_owned(),
    }
}

/// The recordings, their commands and their parts: the input of the search for servo laws.
struct Question<'a> {
    recordings: &'a [Recording],
    tracks: &'a [Track],
    parts: &'a Parts,
    sights: &'a [Sight],
    settings: &'a DiagnoseSettings,
}

impl Question<'_> {
    /// The laws of all joints; `None` unless every joint whose command moves has a valid one.
    fn laws(&self, file: &ArmFile, diagnosis: &Diagnosis) -> Option<Laws> {
        let treated = |recording| Treatment::new(&file.arm, recording, &self.settings.treatment).ok();
        let treatments: Vec<Treatment> = self.recordings.iter().map(treated).collect::<Option<_>>()?;
        let joints = 0..self.sights.len();
        let moving: Vec<usize> =
            joints.clone().filter(|joint| moves(self.tracks, &self.parts.fit, *joint)).collect();
        let sheets: Vec<Vec<Sheet>> =
            moving.iter().map(|joint| self.sheets(*joint, &treatments)).collect::<Option<_>>()?;
        let fitted = |late: f64| -> Option<Vec<TorqueLaw>> {
            let of = |(joint, sheets): (&usize, &Vec<Sheet>)| {
                TorqueLaw::fit(sheets, self.sights[*joint].lag, late)
            };
            moving.iter().zip(&sheets).map(of).collect()
        };
        let (late, deviation) = lateness(diagnosis);
        let as_recorded = fitted(0.0)?;
        let mut laws = as_recorded.clone();
        let mut growth = vec![0.0; moving.len()];
        if late != 0.0 {
            // The servos use either positions without delay, or the recorder's delayed encoders: the better fit decides.
            let in_time = fitted(late)?;
            let left = |laws: &[TorqueLaw]| laws.iter().map(|law| law.left.ln()).sum::<f64>();
            if left(&in_time) < left(&as_recorded) {
                let by = |(a, b): (&TorqueLaw, &TorqueLaw)| (a.delay.0 - b.delay.0) / late;
                growth = in_time.iter().zip(&as_recorded).map(by).collect();
                laws = in_time;
            }
        }
        let mut all = Laws { of_joint: vec![None; joints.len()], growth: vec![0.0; joints.len()], deviation };
        for ((joint, law), growth) in moving.into_iter().zip(laws).zip(growth) {
            if !self.holds(joint, &law, diagnosis) {
                return None;
            }
            (all.of_joint[joint], all.growth[joint]) = (Some(law), growth);
        }
        all.of_joint.iter().any(Option::is_some).then_some(all)
    }

    /// The sheets of `joint`; `None` if a recording has incomplete columns of it.
    fn sheets<'a>(&'a self, joint: usize, treatments: &'a [Treatment]) -> Option<Vec<Sheet<'a>>> {
        let sheet = |(index, treatment): (usize, &'a Treatment)| {
            let cut = self.tracks[index].stamps[self.parts.fit[index].1.end - 1];
            Sheet::of(&self.recordings[index], treatment, joint, cut)
        };
        treatments.iter().enumerate().map(sheet).collect()
    }

    /// Returns true if `law` is valid at `joint`. Its stiffness must differ from zero significantly, and its damping must not be significantly negative. Its
    /// residual torque in the test part must not exceed three errors together: that of the diagnosed arm, the rounding of the encoder times the stiffness, and
    /// the tolerance of friction times the torque.
    fn holds(&self, joint: usize, law: &TorqueLaw, diagnosis: &Diagnosis) -> bool {
        let least = (2.0 * named_from(self.sights.len())).sqrt();
        let (stiffness, deviation) = law.stiffness;
        let channel = Group::Torque.column(joint);
        let arms = diagnosis.fit.as_ref().and_then(|fit| fit.after.get(&channel)).map(|error| error.rmse);
        let Some(arms) = arms else { return false };
        let rounded = stiffness * rounding(self.sights[joint].tick);
        stiffness > least * deviation
            && law.damping.0 > -least * law.damping.1
            && law.left_in_test
                <= arms.hypot(rounded).hypot(self.settings.tolerances.friction * law.size_in_test)
    }
}

/// Delay of the encoders behind the torques in the model of `diagnosis`, and its standard deviation, s.
fn lateness(diagnosis: &Diagnosis) -> (f64, f64) {
    let mut late = 0.0;
    for table in diagnosis.model.effects.iter().filter(|table| table.kind == "time_delay") {
        let delay = number(table, "delay").unwrap_or(0.0);
        match table.parameters.get("channel").and_then(Value::as_str) {
            Some("position") => late += delay,
            Some("torque") => late -= delay,
            _ => {}
        }
    }
    let found = diagnosis.effects.iter().filter(|effect| effect.kind == "time_delay");
    let intervals = found.filter_map(|effect| effect.parameters.get("delay")?.ci95);
    let deviation = intervals.map(|[low, high]| (high - low) / (2.0 * half_width()));
    (late, deviation.fold(0.0, f64::hypot))
}
