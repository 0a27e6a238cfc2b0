//! The expected evidence of a motion for one of two causes: the odds that its recording would bring.
//!
//! If the first cause is true, a recording of the motion has its signal s. The other cause fits s as well as it can, with the help of the model's tolerances.
//! Its weighted residual Λ = min (s − Nη − Zβ)ᵀ W (s − Nη − Zβ) + |η|² is twice the log of the expected odds for the truth. The value of a motion is the lesser
//! of the two, with each cause taken as the truth once: the criterion T of Atkinson & Fedorov 1975 (Biometrika 62:57).

use std::collections::BTreeMap;
use std::path::Path;

use freeplay_arm::Arm;
use freeplay_laws::{Kind as EffectKind, LawError, Place, Placed, Trajectory};
use freeplay_model::EffectTable;
use freeplay_recording::Recording;
use toml::Table;

use crate::candidates::candidate::{Candidate, Form};
use crate::data::linearised::{LinearisedRecording, PreparedRecording};
use crate::data::stacked::Data;
use crate::data::tolerance::Tolerances;
use crate::data::weights::Weights;
use crate::evidence::system::{Gain, System};
use crate::next_motion::ExciteError;
use crate::report::diagnosis::ChannelNoise;
use crate::signals::motion::Settings;

/// Size of a cause with unknown parameters, as a multiple of the noise in the channel where it shows most: ten stands out of any noise, and is small enough
/// that the arm still follows the plan.
const PLAIN: f64 = 10.0;

/// A cause: a kind of effect at its place, with its parameters if they are known.
#[derive(Clone, Debug)]
pub struct Rival {
    /// The kind.
    pub kind: &'static EffectKind,
    /// Index of the joint; `None` for the arm as a whole.
    pub joint: Option<usize>,
    /// Its parameters.
    pub parameters: Option<Table>,
}

impl Rival {
    fn placed(&self, arm: &Arm, parameters: &Table) -> Result<Placed, LawError> {
        let joint = self.joint.map(|joint| arm.joints()[joint].name.clone());
        let table =
            EffectTable { kind: self.kind.name.to_owned(), joint, parameters: parameters.clone(), line: 0 };
        Placed::new(&table, arm)
    }
}

/// The arm and the noise for evaluating motions.
pub(super) struct Scales<'a> {
    pub arm: &'a Arm,
    pub known: &'a [&'a Placed],
    pub noise: &'a BTreeMap<String, ChannelNoise>,
    pub tolerances: &'a Tolerances,
}

/// A motion, prepared for evaluation.
struct Weighed<'d, 'a> {
    data: &'d Data<'a>,
    weights: Weights,
    /// Noise of every channel, infinite where unknown.
    deviation: Vec<f64>,
}

impl Scales<'_> {
    /// Twice the log of the odds that `motion` would bring for the first of `rivals` against each of the others, the lesser of both directions.
    ///
    /// # Errors
    /// See [`ExciteError`].
    pub fn odds(&self, motion: &Trajectory, rivals: &[Rival]) -> Result<Vec<f64>, ExciteError> {
        self.on(&self.blank(motion)?, |weighed| self.odds_on(weighed, rivals))
    }

    /// The odds on the motion of `weighed`.
    fn odds_on(&self, weighed: &Weighed, rivals: &[Rival]) -> Result<Vec<f64>, ExciteError> {
        let (first, others) = rivals.split_first().ok_or(ExciteError::TooFew)?;
        let of_first = self.signal(weighed, first)?;
        let mut odds = Vec::new();
        for other in others {
            let of_other = self.signal(weighed, other)?;
            let one = weighed.residual(&of_first, other)?;
            let two = weighed.residual(&of_other, first)?;
            odds.push(one.min(two));
        }
        Ok(odds)
    }

    /// The parameters with which each rival but the first best imitates the first in `recording` (rivals with given parameters keep them), and the odds that
    /// the motion of `recording` brings for these.
    ///
    /// # Errors
    /// See [`ExciteError`].
    pub fn matched(
        &self,
        recording: &Recording,
        rivals: &[Rival],
    ) -> Result<(Vec<Rival>, Vec<f64>), ExciteError> {
        self.on(recording, |weighed| {
            let (first, others) = rivals.split_first().ok_or(ExciteError::TooFew)?;
            let signal = self.signal(weighed, first)?;
            let mut all = vec![first.clone()];
            for other in others {
                let parameters = match &other.parameters {
                    Some(known) => Some(known.clone()),
                    None => weighed.best(&signal, other)?.map(|(_, table)| table),
                };
                all.push(Rival { parameters, ..other.clone() });
            }
            let odds = self.odds_on(weighed, &all)?;
            Ok((all, odds))
        })
    }

    /// A recording of `motion` that holds the motion and empty columns for the channels of known noise.
    fn blank(&self, motion: &Trajectory) -> Result<Recording, ExciteError> {
        let mut columns = vec![("t".to_owned(), motion.t.clone())];
        columns.extend(motion.q.iter().enumerate().map(|(j, q)| (format!("q{}", j + 1), q.clone())));
        let torques = self.noise.keys().any(|name| name.starts_with("tau"));
        let mut names: Vec<String> = Vec::new();
        names.extend((1..=self.arm.dof()).filter(|_| torques).map(|j| format!("tau{j}")));
        names.extend(self.noise.keys().filter(|name| !name.starts_with("tau")).cloned());
        columns.extend(names.into_iter().map(|name| (name, vec![0.0; motion.len()])));
        Recording::new(Path::new("planned motion"), columns)
            .map_err(|error| ExciteError::Motion { message: error.to_string() })
    }

    fn on<T>(
        &self,
        recording: &Recording,
        ask: impl FnOnce(&Weighed) -> Result<T, ExciteError>,
    ) -> Result<T, ExciteError> {
        let prepared = PreparedRecording::planned(self.arm, recording, &Settings::default())?;
        let recording = LinearisedRecording::new(self.arm, self.known, &prepared)?;
        let data = Data::whole(vec![recording], self.tolerances);
        let known = |name: &str| self.noise.get(name).map_or(f64::INFINITY, |noise| noise.deviation);
        let deviation: Vec<f64> =
            data.recordings[0].channels.iter().map(|channel| known(&channel.name)).collect();
        let weights = Weights::plain(&data, &deviation, &self.effective(&data));
        ask(&Weighed { data: &data, weights, deviation })
    }

    /// Effective number of rows of every channel; 0 for a channel of unknown noise.
    fn effective(&self, data: &Data) -> Vec<f64> {
        let recording = &data.recordings[0];
        let t = &recording.motion().t;
        let lasts = t.last().copied().unwrap_or(0.0) - t.first().copied().unwrap_or(0.0);
        let channels = recording.channels.iter().zip(&data.counts);
        channels
            .map(|(channel, counts)| match self.noise.get(&channel.name) {
                Some(noise) if noise.deviation > 0.0 => (noise.per_second * lasts).min(counts.iter().sum()),
                _ => 0.0,
            })
            .collect()
    }

    /// Contribution of `rival` to each channel.
    fn signal(&self, weighed: &Weighed, rival: &Rival) -> Result<Vec<Vec<f64>>, ExciteError> {
        let recording = &weighed.data.recordings[0];
        let parameters = match &rival.parameters {
            Some(known) => known.clone(),
            None => weighed.plain(rival)?,
        };
        let answer = recording.answer(&rival.placed(self.arm, &parameters)?)?;
        let column = weighed.data.column(vec![answer]);
        let rows = column.into_iter().zip(&weighed.data.counts);
        Ok(rows.map(|(part, counts)| part.unwrap_or_else(|| vec![0.0; counts.len()])).collect())
    }
}

impl<'d, 'a> Weighed<'d, 'a> {
    /// The linear system with `signal` as the target.
    fn system(&self, signal: &[Vec<f64>]) -> Result<System<'d, 'a>, ExciteError> {
        System::new(self.data, signal.to_vec(), self.weights.clone()).ok_or(ExciteError::Singular)
    }

    /// Residual of `rival` in `signal`: twice a log of odds.
    fn residual(&self, signal: &[Vec<f64>], rival: &Rival) -> Result<f64, ExciteError> {
        let mut system = self.system(signal)?;
        let left = system.residual_squares();
        let best = self.scores(&mut system, rival).into_iter().map(|(_, gain)| gain.explained);
        Ok((left - 2.0 * best.fold(0.0, f64::max)).max(0.0))
    }

    /// The log evidence of `rival` for `signal`, and its best parameters; `None` if it explains none of the signal.
    fn best(&self, signal: &[Vec<f64>], rival: &Rival) -> Result<Option<(f64, Table)>, ExciteError> {
        let mut system = self.system(signal)?;
        let scores = self.scores(&mut system, rival);
        let best = scores.into_iter().max_by(|a, b| a.1.explained.total_cmp(&b.1.explained));
        Ok(best.map(|(found, gain)| (gain.explained, found.parameters(gain.beta.as_slice()))))
    }

    /// The gain of each form of `rival` that an arm file can express.
    fn scores(&self, system: &mut System, rival: &Rival) -> Vec<(Candidate, Gain)> {
        let recording = &self.data.recordings[0];
        let place = Place { scene: recording.baseline(rival.kind).scene(), joint: rival.joint };
        let Some(nothing) = system.fit(&[]) else { return Vec::new() };
        let mut all = Vec::new();
        for shape in (rival.kind.shapes)(&place) {
            // A planned motion may suggest a form that no arm file can express, such as a speed at which the joint stands.
            let Ok(Some(found)) = Candidate::new(self.data, rival.kind, rival.joint, Form::of(shape)) else {
                continue;
            };
            let Some(at) = system.take(found.clone()) else { continue };
            let gain = system.gains(&nothing, &[at]).pop().flatten();
            let can_be = |gain: &Gain| found.placed(recording.arm(), gain.beta.as_slice()).is_some();
            all.extend(gain.filter(can_be).map(|gain| (found, gain)));
        }
        all
    }

    /// Parameters of a cause with unknown parameters: [`PLAIN`] times the noise in size.
    fn plain(&self, rival: &Rival) -> Result<Table, ExciteError> {
        let recording = &self.data.recordings[0];
        let place = Place { scene: recording.baseline(rival.kind).scene(), joint: rival.joint };
        let shape = (rival.kind.shapes)(&place).into_iter().next().unwrap_or_default();
        let found = Candidate::new(self.data, rival.kind, rival.joint, Form::of(shape))?;
        let found = found.ok_or(ExciteError::Unseen { kind: rival.kind.name })?;
        let channels = found.columns[0].iter().zip(&self.deviation).zip(&self.data.counts);
        let sizes = channels.map(|((part, deviation), counts)| {
            let square: f64 = part.iter().flatten().map(|x| x * x).sum();
            (square / counts.iter().sum::<f64>().max(1.0)).sqrt() / deviation
        });
        let loudest = sizes.filter(|size| size.is_finite()).fold(0.0, f64::max);
        let mut beta = vec![0.0; found.size()];
        if loudest > 0.0 {
            beta[0] = (PLAIN / loudest).clamp(found.terms[0].least, found.terms[0].most);
        }
        Ok(found.parameters(&beta))
    }
}
