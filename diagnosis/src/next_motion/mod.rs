//! The next motion: a safe one that separates causes which the recorded motion could not separate.
//!
//! - `family`: the motions to choose from, a few harmonics a joint ([`Fourier`]).
//! - `envelope`: the limits of a safe motion, and their use ([`Used`]).
//! - `odds`: the expected evidence of a motion for one of two causes ([`Rival`]), from the noise of each channel ([`ChannelNoise`]).
//! - here: the search, at random first, then about the best (Solis & Wets 1981, Math. Oper. Res. 6:19).

mod envelope;
mod family;
mod odds;

use std::collections::BTreeMap;

use envelope::Envelope;
use family::HARMONICS;
use freeplay_arm::Arm;
use freeplay_laws::{Effects, LawError, Placed};
use freeplay_model::ArmFile;
use freeplay_recording::Recording;
use odds::Scales;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use crate::data::tolerance::Tolerances;
use crate::error::ResidualError;
use crate::report::diagnosis::ChannelNoise;
use crate::statistics::extremes;

pub use envelope::Used;
pub use family::Fourier;
pub use odds::Rival;

/// Rate at which the search evaluates and checks a motion, Hz: its fastest harmonics are of a few hertz, so that the samples miss no peak by more than a per
/// cent.
const RATE: f64 = 100.0;
/// Share of candidates drawn at random; the others are drawn about the best: half of the effort explores and half refines, as neither is known to be worth
/// more.
const FRESH: f64 = 0.5;
/// Distance at which new motions are drawn about the best motion, as a share of the way to another: a third keeps most of what is good in the best.
const NEAR: f64 = 0.35;
/// Greatest distance between the posture of a candidate and the given one, as a share of the range that the joint limits leave: the motion about that posture needs
/// the other half of the range.
const ELSEWHERE: f64 = 0.4;

/// Options of a search.
#[derive(Clone, Debug)]
pub struct ExciteSettings {
    /// Duration of the motion, s.
    pub duration: f64,
    /// Number of candidate motions.
    pub candidates: usize,
    /// Seed of the search.
    pub seed: u64,
    /// Posture about which the search draws motions, rad (m); `None`: the middle of the recorded motion, or without a recording that of the joints' ranges.
    pub posture: Option<Vec<f64>>,
    /// Greatest distance of a joint from that posture, rad (m).
    pub reach: f64,
    /// Tolerances of the machine about its model.
    pub tolerances: Tolerances,
    /// Unexplained noise of each channel, by the channel's name: the next recording has these channels only.
    pub noise: BTreeMap<String, ChannelNoise>,
}

/// A motion that separates causes.
#[derive(Clone, Debug)]
pub struct Excitation {
    /// The motion.
    pub motion: Fourier,
    /// Natural logarithm of the expected odds for the true cause: for the first cause against each of the others.
    pub log_odds: Vec<f64>,
    /// The same for the recorded motion.
    pub log_odds_before: Option<Vec<f64>>,
    /// The causes, with the parameters used in the comparison.
    pub rivals: Vec<Rival>,
    /// Use of the limits; 1 is the whole allowance.
    pub used: Used,
    /// The assumptions, one sentence each.
    pub notes: Vec<String>,
}

/// Reason why there is no motion.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExciteError {
    /// There is nothing to separate.
    #[error("fewer than two causes: nothing to separate")]
    TooFew,
    /// A posture with the wrong number of joints.
    #[error("the posture has {found} values, the arm {expected} joints")]
    Posture {
        /// Values given.
        found: usize,
        /// Joints of the arm.
        expected: usize,
    },
    /// No motion of this family is safe.
    #[error(
        "no motion about the posture {posture:?} stays inside the limits of the arm file; name another with --posture"
    )]
    NoRoom {
        /// The posture, rad (m).
        posture: Vec<f64>,
    },
    /// No recorded channel shows an effect.
    #[error("none of the tried motions shows {kind} in a recorded channel")]
    Unseen {
        /// The kind.
        kind: &'static str,
    },
    /// A planned motion that the program can't process.
    #[error("the planned motion: {message}")]
    Motion {
        /// The reason.
        message: String,
    },
    /// The system of equations is singular in double precision.
    #[error("the comparison of the causes is singular in double precision; is the noise of a channel 0?")]
    Singular,
    /// A motion without residuals.
    #[error(transparent)]
    Residual(#[from] ResidualError),
    /// An effect that can't be built.
    #[error(transparent)]
    Law(#[from] LawError),
}

/// Finds, among random candidates, the motion of `file`'s arm that best separates the first of `rivals` from all others. `seen` is a recording that could not
/// separate them. The function calls `progress` after every candidate, with its number, the total and the best so far.
///
/// # Errors
/// See [`ExciteError`].
pub fn excite(
    file: &ArmFile,
    rivals: &[Rival],
    seen: Option<&Recording>,
    settings: &ExciteSettings,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Excitation, ExciteError> {
    if rivals.len() < 2 {
        return Err(ExciteError::TooFew);
    }
    let arm = &file.arm;
    let effects = Effects::of(file)?;
    let known: Vec<&Placed> = effects.placed.iter().collect();
    let scales = Scales { arm, known: &known, noise: &settings.noise, tolerances: &settings.tolerances };
    let (rivals, before) = match seen {
        Some(recording) => {
            let (matched, before) = scales.matched(recording, rivals)?;
            (matched, Some(before))
        }
        None => (rivals.to_vec(), None),
    };
    let posture = posture(arm, seen, settings)?;
    let envelope = Envelope::new(arm, &posture, settings.reach);
    let mut search = Search {
        rng: ChaCha8Rng::seed_from_u64(settings.seed),
        arm,
        envelope: &envelope,
        posture: &posture,
        duration: settings.duration,
    };
    let fresh = (FRESH * settings.candidates as f64).ceil() as usize;
    let mut best: Option<(f64, Vec<f64>, Fourier)> = None;
    for number in 0..settings.candidates {
        let drawn = match &best {
            Some((_, _, motion)) if number >= fresh => search.near(motion),
            _ => search.anew(),
        };
        if let Some(motion) = envelope.inside(arm, &drawn) {
            match scales.odds(&motion.trajectory(RATE), &rivals) {
                Ok(odds) => {
                    let worst = odds.iter().copied().fold(f64::INFINITY, f64::min);
                    if best.as_ref().is_none_or(|(most, ..)| worst > *most) {
                        best = Some((worst, odds, motion));
                    }
                }
                // This motion does not show one of the causes; another motion may.
                Err(ExciteError::Unseen { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        progress(number + 1, settings.candidates, best.as_ref().map_or(0.0, |(most, ..)| 0.5 * most));
    }
    let Some((_, odds, motion)) = best else { return Err(ExciteError::NoRoom { posture }) };
    Ok(Excitation {
        used: envelope.used(arm, &motion),
        log_odds: odds.iter().map(|twice| 0.5 * twice).collect(),
        log_odds_before: before.map(|before| before.iter().map(|twice| 0.5 * twice).collect()),
        motion,
        rivals,
        notes: envelope.notes,
    })
}

/// The posture about which the search draws motions.
fn posture(arm: &Arm, seen: Option<&Recording>, settings: &ExciteSettings) -> Result<Vec<f64>, ExciteError> {
    if let Some(given) = &settings.posture {
        if given.len() != arm.dof() {
            return Err(ExciteError::Posture { found: given.len(), expected: arm.dof() });
        }
        return Ok(given.clone());
    }
    let middle =
        |low: f64, high: f64| if low.is_finite() && high.is_finite() { 0.5 * (low + high) } else { 0.0 };
    Ok(match seen {
        Some(recording) => recording
            .q
            .iter()
            .map(|q| {
                let (low, high) = extremes(q);
                middle(low, high)
            })
            .collect(),
        None => arm.joints().iter().map(|joint| middle(joint.limits.lower, joint.limits.upper)).collect(),
    })
}

/// Draws motions.
struct Search<'s> {
    rng: ChaCha8Rng,
    arm: &'s Arm,
    envelope: &'s Envelope,
    posture: &'s [f64],
    duration: f64,
}

impl Search<'_> {
    /// A random motion: another posture, and for every joint a random share of its range.
    fn anew(&mut self) -> Fourier {
        let cycles = f64::from(self.rng.random_range(1..=4_u32));
        let (mut posture, mut waves) = (Vec::new(), Vec::new());
        for joint in 0..self.arm.dof() {
            let [low, high] = self.envelope.range[joint];
            let away = self.rng.random_range(-ELSEWHERE..=ELSEWHERE);
            let at = self.posture[joint];
            let middle = at + away * if away > 0.0 { high - at } else { at - low };
            let room = (high - middle).min(middle - low) * self.rng.random_range(0.2..=1.0);
            let mut wave = [(0.0, 0.0); HARMONICS];
            for (k, (a, b)) in wave.iter_mut().enumerate() {
                let size = 1.0 / (k + 1) as f64;
                (*a, *b) =
                    (size * self.rng.random_range(-1.0..=1.0), size * self.rng.random_range(-1.0..=1.0));
            }
            // About the reach of the waves together; the envelope reduces any excess.
            let far: f64 = wave.iter().map(|(a, b)| 0.5 * a.abs() + b.abs()).sum();
            let scale = room / far.max(1e-9);
            waves.push(wave.map(|(a, b)| (scale * a, scale * b)));
            posture.push(middle);
        }
        Fourier { duration: self.duration, cycles, posture, waves }
    }

    /// A motion near `best`.
    fn near(&mut self, best: &Fourier) -> Fourier {
        let other = self.anew();
        let mix = |own: f64, other: f64| own + NEAR * (other - own);
        let waves = best.waves.iter().zip(&other.waves).map(|(own, other)| {
            let mut wave = *own;
            // The new motion is wider as well as different: the envelope reduces any excess.
            wave.iter_mut()
                .zip(other)
                .for_each(|((a, b), (c, d))| (*a, *b) = (1.2 * mix(*a, *c), 1.2 * mix(*b, *d)));
            wave
        });
        let posture = best.posture.iter().zip(&other.posture).map(|(own, other)| mix(*own, *other));
        Fourier { waves: waves.collect(), posture: posture.collect(), ..best.clone() }
    }
}
