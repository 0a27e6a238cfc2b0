//! Errors that prevent a comparison of a recording and a model.

use std::path::PathBuf;

use freeplay_recording::Recording;
use thiserror::Error;

use crate::statistics::SHARES;

/// Fewest samples of a recording for a grid: a cubic needs four.
pub(crate) const FEWEST: usize = 4;
/// Least length that the program requests for a recording that is too short, s: each part of it then has several motions of a second.
pub(crate) const ENOUGH_S: f64 = 10.0;

/// Reason why the program can't compute residuals.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ResidualError {
    /// The recording has another number of joints than the model.
    #[error(
        "{}: {found} joint(s) (q1…q{found}), but the model has {expected}: {names}; give the model of this arm",
        origin.display()
    )]
    JointCount {
        /// The recording.
        origin: PathBuf,
        /// Joints of the model.
        expected: usize,
        /// Joints of the recording.
        found: usize,
        /// Names of the model's joints.
        names: String,
    },
    /// The recording has no channel that a model could predict.
    #[error(
        "{}: nothing to compare: no column tau1…tau{joints} (measured joint torques, N*m), none of x, y, z (tracked tool, m) \
         and no q_link (link-side encoders, rad); record one of them",
        origin.display()
    )]
    NothingToCompare {
        /// The recording.
        origin: PathBuf,
        /// Number of joints.
        joints: usize,
    },
    /// Time stamps without a uniform grid.
    #[error("{}: {samples} sample(s) over {duration_s:.3e} s make no time grid; record at least {} samples", origin.display(), FEWEST)]
    Stamps {
        /// The recording.
        origin: PathBuf,
        /// Number of samples.
        samples: usize,
        /// Time from the first to the last stamp, s.
        duration_s: f64,
    },
    /// No stretch without a gap is long enough for the filter and the trimmed ends.
    #[error(
        "{}: the longest stretch without a gap lasts {longest_s:.3} s, less than the {needed_s:.3} s that a low-pass at {cutoff_hz:.4} Hz and the \
         trimmed ends need; record longer, set a higher --lowpass or a lower --trim",
        origin.display()
    )]
    TooShort {
        /// The recording.
        origin: PathBuf,
        /// Length of the longest stretch, s.
        longest_s: f64,
        /// Least length, s.
        needed_s: f64,
        /// Cutoff of the filter, Hz.
        cutoff_hz: f64,
    },
    /// A cutoff that is too high for this sampling rate.
    #[error(
        "a low-pass at {cutoff_hz} Hz is not possible for {rate_hz:.4} samples a second: choose between 0 and {most_hz:.4} Hz"
    )]
    Cutoff {
        /// The requested cutoff, Hz.
        cutoff_hz: f64,
        /// Samples per second.
        rate_hz: f64,
        /// Half of that, Hz.
        most_hz: f64,
    },
    /// A trim that is no valid time.
    #[error("--trim {trim_s}: give the seconds to leave out at both ends, 0 or more")]
    Trim {
        /// The requested trim, s.
        trim_s: f64,
    },
    /// The effects make an arm that can't exist.
    #[error(transparent)]
    Effects(#[from] freeplay_laws::LawError),
    /// The prediction of the model for the recorded motion is not finite.
    #[error("{}: channel {channel}: the difference to the model is not finite; are q in rad (or m) and t in s?", origin.display())]
    NotFinite {
        /// The recording.
        origin: PathBuf,
        /// The channel.
        channel: String,
    },
}

impl ResidualError {
    /// Returns true if a part of one of `recordings` may be too small although the whole recording has enough samples.
    pub(crate) fn is_of_a_part(&self, recordings: &[Recording]) -> bool {
        match self {
            Self::TooShort { .. } => true,
            Self::Stamps { origin, .. } => {
                recordings.iter().any(|whole| whole.origin == *origin && whole.len() >= FEWEST)
            }
            _ => false,
        }
    }

    /// The error in words for the diagnosis of `recordings`; the error occurred in a part of one of them.
    pub(crate) fn in_a_diagnosis(&self, recordings: &[Recording]) -> String {
        if let Self::Stamps { origin, .. } = self {
            return format!(
                "{}: too few samples with motion are left; record at least {ENOUGH_S:.0} s of motion",
                origin.display()
            );
        }
        let Self::TooShort { origin, longest_s, needed_s, cutoff_hz } = self else { return self.to_string() };
        let whole = recordings.iter().find(|recording| recording.origin == *origin);
        let whole_s = whole.map_or(*longest_s, Recording::duration);
        let parts = if recordings.len() > 1 { 1.0 } else { SHARES[1] - SHARES[0] };
        format!(
            "{}: too short: it lasts {whole_s:.1} s; a low-pass at {cutoff_hz:.1} Hz needs {needed_s:.2} s without a gap in each of the parts for \
             fit, choice and test; record at least {:.0} s of motion without a gap",
            origin.display(),
            (needed_s / parts).max(ENOUGH_S).ceil()
        )
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use freeplay_recording::Recording;

    use super::ResidualError;

    #[test]
    fn a_diagnosis_speaks_of_the_whole_recording() {
        let t: Vec<f64> = (0..=200).map(|k| 0.01 * f64::from(k)).collect();
        let whole = Recording::new(Path::new("r.csv"), vec![("q1".into(), t.clone()), ("t".into(), t)]);
        let whole = [whole.expect("a recording")];
        let short = |needed_s| {
            let (origin, longest_s) = (whole[0].origin.clone(), 0.396);
            ResidualError::TooShort { origin, longest_s, needed_s, cutoff_hz: 4.0 / needed_s }
        };
        let said = short(0.4).in_a_diagnosis(&whole);
        println!("{said}");
        assert!(
            ["r.csv", "lasts 2.0 s", "0.40 s", "at 10.0 Hz", "at least 10 s"]
                .iter()
                .all(|words| said.contains(words))
        );
        assert!(!said.contains("--") && !said.contains("0.396"), "only a longer recording helps");
        let said = short(8.0).in_a_diagnosis(&whole);
        assert!(
            said.contains("at 0.5 Hz") && said.contains("at least 54 s"),
            "the choice part is the shortest: {said}"
        );
    }
}
