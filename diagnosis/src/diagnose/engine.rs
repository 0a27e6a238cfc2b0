//! The diagnosis from end to end.

use freeplay_arm::{Arm, ArmFile};
use freeplay_laws::{Effects, LawError, Placed};
use freeplay_recording::Recording;
use thiserror::Error;

use super::candidate::candidates;
use super::choice::choose;
use super::conclude::{Conclusion, insufficient};
use super::data::Data;
use super::parts::Part;
use super::quality;
use super::report::Diagnosis;
use super::search::Search;
use super::stage::{Ground, Stage};
use super::system::System;
use super::thinning;
use super::tolerance::Tolerances;
use super::weights::Weights;
use crate::error::ResidualError;
use crate::motion::Settings;

/// What a user may choose of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiagnoseSettings {
    /// The treatment of recordings.
    pub treatment: Settings,
    /// How far a machine may be from its model without that being a finding.
    pub tolerances: Tolerances,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for DiagnoseSettings {
    fn default() -> Self {
        Self { treatment: Settings::default(), tolerances: Tolerances::default(), seed: 1 }
    }
}

/// Why there is no diagnosis.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No recording.
    #[error("no recording: give at least one")]
    NoRecording,
    /// The recordings don't hold the same columns.
    #[error("{first} and {other} hold different columns; diagnose them one by one, or record the same")]
    DifferentColumns {
        /// The first recording.
        first: String,
        /// One that differs.
        other: String,
    },
    /// Model and recording can't be compared.
    #[error(transparent)]
    Residual(#[from] ResidualError),
    /// The effects of the model can't be taken.
    #[error("the model's effects: {0}")]
    Law(#[from] LawError),
    /// The numbers of this recording are beyond double precision.
    #[error(
        "the fit of the model's tolerances to this recording is singular; are q in rad (or m), tau in N*m and t in s?"
    )]
    Singular,
}

/// Locates where `recordings` differ from the model `file`, names what is missing, fits it and shows the gain on the test part of the data, which no step
/// before has seen. `progress` is told what is being done.
///
/// # Errors
/// See [`DiagnoseError`].
pub(crate) fn diagnose(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    check(&file.arm, recordings)?;
    let known = Effects::of(file)?;
    let known: Vec<&Placed> = known.placed.iter().collect();
    let mut notes: Vec<String> = recordings.iter().flat_map(|recording| recording.notes.clone()).collect();
    progress("treating the recordings");
    let whole = recordings;
    let recordings = thinning::bounded(recordings, &mut notes);
    let mut grounds = Vec::new();
    for recording in &recordings {
        match Ground::new(&file.arm, recording, &settings.treatment) {
            Ok(ground) => grounds.push(ground),
            Err(short) if short.is_of_a_part(whole) => {
                return Ok(insufficient(file, settings, notes, short.in_a_diagnosis(whole)));
            }
            Err(error) => return Err(error.into()),
        }
    }
    notes.extend(grounds.iter().flat_map(|ground| ground.treatment.notes().to_vec()));
    let stages: Vec<Stage> =
        grounds.iter().map(|ground| Stage::new(&file.arm, &known, ground)).collect::<Result<_, _>>()?;
    let data = Data::new(stages, &settings.tolerances);
    if let Some(lack) = quality::lack(&data) {
        return Ok(insufficient(file, settings, notes, lack));
    }
    notes.extend(quality::notes(&data));
    let target = data.target();
    let weights = Weights::new(&data, &target, &[Part::Fit], settings.seed);
    let system = System::new(&data, target, weights, &[Part::Fit]).ok_or(DiagnoseError::Singular)?;
    let (candidates, untestable) = candidates(&data, progress);
    progress("searching");
    let mut search = Search::new(system, candidates);
    search.run(progress).ok_or(DiagnoseError::Singular)?;
    progress("choosing between the best answers");
    let answer = choose(&mut search).ok_or(DiagnoseError::Singular)?;
    let answer = search.agreed(&answer).ok_or(DiagnoseError::Singular)?;
    progress("testing");
    let answer = search.on_test(&answer)?.ok_or(DiagnoseError::Singular)?;
    let conclusion = Conclusion { file, settings, search: &mut search, answer: &answer };
    conclusion.diagnosis(notes, untestable)?.ok_or(DiagnoseError::Singular)
}

/// There are recordings, of this arm, with the same columns.
pub(crate) fn check(arm: &Arm, recordings: &[Recording]) -> Result<(), DiagnoseError> {
    let first = recordings.first().ok_or(DiagnoseError::NoRecording)?;
    let columns = |recording: &Recording| {
        let links: Vec<bool> = recording.q_link.iter().map(Option::is_some).collect();
        (recording.tau.is_some(), recording.tool.is_some(), links)
    };
    for recording in recordings {
        crate::residual::check_joints(arm, recording)?;
        if columns(recording) != columns(first) {
            return Err(DiagnoseError::DifferentColumns {
                first: first.origin.display().to_string(),
                other: recording.origin.display().to_string(),
            });
        }
    }
    Ok(())
}
