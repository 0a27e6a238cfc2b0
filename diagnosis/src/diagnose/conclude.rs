//! From the search and its proofs to what is said.

use std::collections::BTreeMap;

use freeplay_arm::{Arm, ArmFile, EffectTable};
use freeplay_laws::{ArmParts, Kind, LawError, PERIODS, kind};

use super::engine::DiagnoseSettings;
use super::excess::{Excess, beyond};
use super::hypothesis::Hypothesis;
use super::interval::draws;
use super::judge::Judge;
use super::locate::{Map, correct, maps};
use super::numbers::{parameters, widened};
use super::passage::{noise, passages};
use super::report::{
    Alternative, DIAGNOSIS_SCHEMA, Diagnosis, Effect, Evidence, EvidenceRow, Fit, Location, Rmse, Tuned,
    Untestable, Verdict,
};
use super::robust::Numbers;
use super::search::Search;
use super::show::HeldOut;
use super::system::Score;
use super::trial::{Proof, channels_of};
use super::words;
use crate::residual::Kind as ChannelKind;

/// Share of what an unnamed correction explains that naming may leave unexplained, in squares.
const UNNAMED_SHARE: f64 = 0.2;
/// Least share of the error that an unnamed correction takes away for something to be missing at all.
const LEAST_UNNAMED: f64 = 0.1;

/// Chance below which a part of the motion is named.
const SIGNIFICANT: f64 = 0.05;
/// From how many times the noise on what is left of a channel is taken for more than what tolerances leave, if nothing explains it.
const ABOVE_FLOOR: f64 = 1.5;

/// Ratio of the ends of the interval of how often a wave repeats from which on it says nothing.
const LEAST_TOLD: f64 = 3.0;

/// All that a conclusion rests on.
pub(crate) struct Conclusion<'c, 'a, 'b> {
    pub file: &'c ArmFile,
    pub settings: &'c DiagnoseSettings,
    pub search: &'c Search<'a, 'b>,
    /// Its numbers.
    pub numbers: &'c Numbers,
    /// The same effects on all that was recorded where that is more than the fit rests on: their numbers are these.
    pub whole: Option<(&'c Search<'a, 'b>, &'c Numbers)>,
    pub judge: &'c Judge<'a, 'b>,
    pub proofs: &'c [Proof],
    pub data: &'c str,
}

impl<'a, 'b> Conclusion<'_, 'a, 'b> {
    /// The diagnosis of recordings that can't tell, because of `lack`.
    pub fn insufficient(
        file: &ArmFile,
        settings: &DiagnoseSettings,
        quality: Vec<String>,
        lack: String,
    ) -> Diagnosis {
        // What it lacks; what to do.
        let (why, advice) = lack.rsplit_once("; ").unwrap_or((&lack, "record another motion"));
        Diagnosis {
            schema: DIAGNOSIS_SCHEMA,
            verdict: Verdict::InsufficientData,
            statement: format!("These recordings can't tell: {why}."),
            setup: Vec::new(),
            location: Vec::new(),
            effects: Vec::new(),
            alternatives: Vec::new(),
            fit: None,
            next: vec![advice.to_owned()],
            untestable: Vec::new(),
            quality,
            evidence: Vec::new(),
            maps: Vec::new(),
            tuned: Vec::new(),
            noise: BTreeMap::new(),
            twins: 0,
            seed: settings.seed,
            passages: Vec::new(),
            mapping: None,
            model: file.clone(),
        }
    }

    /// The diagnosis.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn diagnosis(
        &self,
        quality: Vec<String>,
        untestable: Vec<Untestable>,
    ) -> Result<Option<Diagnosis>, LawError> {
        let of_fit = &self.numbers.fit;
        let Some(errors) = self.judge.errors(self.search, of_fit)? else { return Ok(None) };
        let Some(black_box) = self.judge.black_box(self.search, &errors) else { return Ok(None) };
        let (Some(maps), Some(spread)) = (self.maps(), self.spread()) else { return Ok(None) };
        let (tables, mut effects) = self.effects(&spread);
        let is_named = |one: &Untestable| effects.iter().any(|e| e.kind == one.kind && e.joint == one.joint);
        let untestable = untestable.into_iter().filter(|one| !is_named(one)).collect();
        let (alternatives, stabilities) = self.alternatives()?;
        for (effect, stability) in effects.iter_mut().zip(stabilities) {
            effect.evidence.stability = stability;
        }
        let location = self.location(&maps, &errors);
        let channels = self.judged_channels(&errors, &black_box);
        let fit = self.fit(&errors, &black_box, &channels);
        let Some(passages) = passages(self.search, of_fit, self.judge, &errors, &black_box)? else {
            return Ok(None);
        };
        let Some(excess) = Excess::of(self.search, self.judge)? else { return Ok(None) };
        let verdict = if effects.iter().all(has_a_name) {
            self.verdict(&errors, &channels, &fit, &excess, &alternatives, &location)
        } else {
            Verdict::Unknown
        };
        let mut model = self.file.clone();
        if matches!(verdict, Verdict::Named | Verdict::OneOf | Verdict::Unknown) {
            if !tables.is_empty() {
                model.arm = self.tuned_arm().unwrap_or(model.arm);
            }
            model.effects.extend(tables);
        }
        let mut diagnosis = Diagnosis {
            schema: DIAGNOSIS_SCHEMA,
            verdict,
            statement: String::new(),
            setup: Vec::new(),
            location,
            effects,
            alternatives,
            fit: Some(fit),
            next: Vec::new(),
            untestable,
            quality,
            evidence: self.evidence(),
            maps,
            tuned: self.tuned(),
            noise: noise(self.search),
            twins: self.settings.twins,
            seed: self.settings.seed,
            passages,
            mapping: None,
            model,
        };
        word(&mut diagnosis);
        Ok(Some(diagnosis))
    }

    fn arm(&self) -> &Arm {
        &self.file.arm
    }

    pub(super) fn joint_name(&self, joint: Option<usize>) -> Option<String> {
        joint.map(|joint| self.arm().joints()[joint].name.clone())
    }

    /// What the numbers that are given out rest on, and these.
    fn given_out(&self) -> (&Search<'a, 'b>, &Numbers) {
        self.whole.unwrap_or((self.search, self.numbers))
    }

    /// The arm of the file, its masses, lengths and frictions where the fit has them inside their tolerances.
    fn tuned_arm(&self) -> Option<Arm> {
        let (search, Numbers { fit, .. }) = self.given_out();
        let mut parts = ArmParts::of(self.arm());
        let bound = search.case.nuisances[0].iter().filter(|nuisance| !nuisance.free);
        let eta = fit.eta.iter().zip(&search.system.precision).filter(|(_, precision)| **precision > 1e-6);
        for (nuisance, (deviations, _)) in bound.zip(eta) {
            nuisance.of.change(&mut parts, &self.settings.tolerances, *deviations);
        }
        parts.into_arm(self.arm().name()).ok()
    }

    /// Draws of each active coefficient about its value, nuisances first, then the effects in the order in which they were chosen.
    fn spread(&self) -> Option<Vec<Vec<f64>>> {
        let (search, numbers) = self.given_out();
        let (system, fit) = numbers.opened(search)?;
        let (drawn, covariance) =
            (draws(search.case, &system, &fit, self.settings.seed)?, system.covariance(&fit));
        // The bootstrap does not see what the priors leave open; the fit's own covariance does not see colour.
        let about = |(k, eta): (usize, &f64)| {
            let column: Vec<f64> = drawn.column(k).iter().copied().collect();
            widened(&column, *eta, covariance[(k, k)].sqrt())
        };
        Some(numbers.fit.eta.iter().enumerate().map(about).collect())
    }

    /// The named effects, as tables for an arm file and as findings.
    fn effects(&self, spread: &[Vec<f64>]) -> (Vec<EffectTable>, Vec<Effect>) {
        let (search, Numbers { fit, .. }) = self.given_out();
        let mut at = search.nuisances().len();
        let (mut tables, mut effects) = (Vec::new(), Vec::new());
        for (index, (chosen, proof)) in self.search.chosen.iter().zip(self.proofs).enumerate() {
            let hypothesis = search.named(index);
            let columns = at..at + hypothesis.size();
            at = columns.end;
            let beta: Vec<f64> = columns.clone().map(|k| fit.eta[k]).collect();
            let table = hypothesis.table(self.arm(), &beta);
            let spread = &spread[columns];
            let parameters = parameters(search, index, &table.parameters, spread, self.settings.seed);
            let phrase = words::phrase(hypothesis.kind, &parameters);
            let statement = words::statement(&phrase, table.joint.as_deref());
            effects.push(Effect {
                kind: hypothesis.kind.name,
                joint: table.joint.clone(),
                parameters,
                equation: hypothesis.kind.equation,
                source: hypothesis.kind.source,
                evidence: self.why(hypothesis, chosen.gain, proof),
                phrase,
                statement,
            });
            tables.push(table);
        }
        (tables, effects)
    }

    fn why(&self, hypothesis: &Hypothesis, gain: f64, proof: &Proof) -> Evidence {
        let channels = &self.search.case.stages[0].channels;
        Evidence {
            log_likelihood_ratio: gain,
            threshold: self.search.threshold(hypothesis),
            in_twins: self.search.null.gains.get(hypothesis.kind.name).copied().unwrap_or(0.0),
            held_out_gain: proof.gain,
            held_out: proof.held_out,
            stability: 1.0,
            channels: proof.channels.iter().map(|&c| channels[c].name.clone()).collect(),
        }
    }

    /// The strongest shape of every kind at every place, alone and beside what was named.
    fn evidence(&self) -> Vec<EvidenceRow> {
        let search = self.search;
        let (Some(bare), Some(fit)) =
            (search.system.fit(&search.nuisances()), search.system.fit(&search.active(None)))
        else {
            return Vec::new();
        };
        let mut rows: BTreeMap<(&str, Option<usize>), EvidenceRow> = BTreeMap::new();
        let blocks: Vec<_> = search.hypotheses.iter().map(|hypothesis| &hypothesis.block).collect();
        let [alone, beside] = [&bare, &fit].map(|fit| search.system.scores(fit, &blocks));
        for ((hypothesis, alone), beside) in search.hypotheses.iter().zip(alone).zip(beside) {
            let gain = |score: Option<Score>| {
                score.filter(|score| hypothesis.is_physical(score)).map_or(0.0, |score| score.gain)
            };
            let row = rows.entry((hypothesis.kind.name, hypothesis.joint)).or_insert_with(|| EvidenceRow {
                kind: hypothesis.kind.name,
                joint: self.joint_name(hypothesis.joint),
                alone: 0.0,
                beside: 0.0,
                threshold: search.threshold(hypothesis),
            });
            row.alone = row.alone.max(gain(alone));
            row.beside = row.beside.max(gain(beside));
        }
        let mut rows: Vec<EvidenceRow> = rows.into_values().collect();
        rows.sort_by(|a, b| b.alone.total_cmp(&a.alone));
        rows
    }

    /// Maps of what the tuned model leaves, over the first recording of the fit.
    fn maps(&self) -> Option<Vec<Map>> {
        let search = self.search;
        let bare = search.system.fit(&search.nuisances())?;
        let residual = search.system.residual(&bare);
        let case = search.case;
        let stage = &case.stages[0];
        let mut all: Vec<Map> = (0..case.per_stage())
            .flat_map(|c| maps(stage, c, &residual[c], &case.kept[c], self.settings.seed))
            .collect();
        correct(&mut all);
        all.sort_by(|a, b| a.p.total_cmp(&b.p).then(b.explained.total_cmp(&a.explained)));
        Some(all)
    }

    /// How far the tolerances are used.
    fn tuned(&self) -> Vec<Tuned> {
        let (search, fit) = (self.search, &self.numbers.fit);
        let bound = search.case.nuisances[0].iter().filter(|nuisance| !nuisance.free);
        let eta = fit.eta.iter().zip(&search.system.precision).filter(|(_, precision)| **precision > 1e-6);
        let mut tuned: Vec<Tuned> = bound
            .zip(eta)
            .map(|(nuisance, (eta, _))| Tuned { name: nuisance.name.clone(), deviations: *eta })
            .collect();
        tuned.sort_by(|a, b| b.deviations.abs().total_cmp(&a.deviations.abs()));
        tuned
    }

    /// Channels (numbers within a stage) in which something is: those that named effects show in, else those in which the unnamed
    /// correction finds something.
    fn judged_channels(&self, errors: &HeldOut, black_box: &[Vec<f64>]) -> Vec<usize> {
        let mut channels = channels_of(self.proofs);
        if channels.is_empty() {
            let left = self.judge.held.rms(&errors.retuned);
            let all = 0..self.search.case.per_stage();
            channels = all
                .filter(|&c| left[c] > ABOVE_FLOOR * self.judge.floor.transferred[c])
                .filter(|&c| {
                    let unnamed = self.judge.gain(self.search, &[c], &errors.retuned, black_box);
                    unnamed.value >= LEAST_UNNAMED && unnamed.ci95[0] > 0.0
                })
                .collect();
        }
        channels
    }

    /// Shares of what the tuned model leaves beyond the floor, in squares of each channel's own deviation.
    fn location(&self, maps: &[Map], errors: &HeldOut) -> Vec<Location> {
        let channels = &self.search.case.stages[0].channels;
        let left = self.judge.held.rms(&errors.retuned);
        let floors = &self.judge.floor.transferred;
        let of_channel = |((left, floor), counts): ((&f64, &f64), bool)| {
            if counts { beyond(&[left / floor.max(f64::MIN_POSITIVE)]) } else { 0.0 }
        };
        let beyond: Vec<f64> = left.iter().zip(floors).zip(self.counts()).map(of_channel).collect();
        let all: f64 = beyond.iter().sum();
        let mut groups: BTreeMap<Option<usize>, (f64, Vec<usize>)> = BTreeMap::new();
        for (index, channel) in channels.iter().enumerate() {
            let joint = match channel.kind {
                ChannelKind::Torque(joint) | ChannelKind::Link(joint) | ChannelKind::Position(joint) => {
                    Some(joint)
                }
                ChannelKind::Tool(_) => None,
            };
            let group = groups.entry(joint).or_default();
            group.0 += beyond[index];
            if beyond[index] > 0.1 {
                group.1.push(index);
            }
        }
        let mut location: Vec<Location> = groups
            .into_iter()
            .filter(|(_, (_, channels))| !channels.is_empty())
            .map(|(joint, (sum, members))| {
                let names: Vec<String> = members.iter().map(|&c| channels[c].name.clone()).collect();
                let strongest = maps.iter().filter(|map| names.contains(&map.channel)).max_by(|a, b| {
                    (-a.p, a.explained).partial_cmp(&(-b.p, b.explained)).unwrap_or(std::cmp::Ordering::Equal)
                });
                Location {
                    joint: self.joint_name(joint),
                    channels: names,
                    share: if all > 0.0 { sum / all } else { 0.0 },
                    when: words::when(strongest.filter(|map| map.p < SIGNIFICANT)),
                    p: strongest.map_or(1.0, |map| map.p),
                }
            })
            .collect();
        location.sort_by(|a, b| b.share.total_cmp(&a.share));
        location.retain(|place| place.share > 0.02);
        location
    }

    /// Which channels of a stage have rows that count in the held-out data.
    fn counts(&self) -> Vec<bool> {
        self.judge.held.by_channel(&self.judge.held.rows()).iter().map(|rows| *rows > 0.0).collect()
    }

    /// `values`, one a channel of a stage, by the names of the channels; of one without a row that counts there is none.
    fn by_name<T>(&self, values: impl Iterator<Item = T>) -> BTreeMap<String, T> {
        let channels = self.search.case.stages[0].channels.iter().zip(self.counts());
        let counted = channels.zip(values).filter(|((_, counts), _)| *counts);
        counted.map(|((channel, _), value)| (channel.name.clone(), value)).collect()
    }

    fn fit(&self, errors: &HeldOut, black_box: &[Vec<f64>], channels: &[usize]) -> Fit {
        let described = &self.search.case.stages[0].channels;
        let table = |values: Vec<f64>| self.by_name(values.into_iter().map(|rmse| Rmse { rmse }));
        let rms = |rows: &[Vec<f64>]| table(self.judge.held.rms(rows));
        let gain = |after: &[Vec<f64>]| {
            (!channels.is_empty()).then(|| self.judge.gain(self.search, channels, &errors.retuned, after))
        };
        Fit {
            noise_floor: table(self.judge.floor.transferred.clone()),
            before: rms(&errors.before),
            after: rms(&errors.tuned_after),
            retuned: rms(&errors.retuned),
            after_as_given: rms(&errors.after),
            black_box: rms(black_box),
            held_out: true,
            data: self.data.to_owned(),
            gain: gain(&errors.tuned_after).filter(|_| !self.proofs.is_empty()),
            black_box_gain: gain(black_box),
            units: self.by_name(described.iter().map(|channel| channel.unit)),
        }
    }

    fn verdict(
        &self,
        errors: &HeldOut,
        channels: &[usize],
        fit: &Fit,
        excess: &Excess,
        alternatives: &[Alternative],
        location: &[Location],
    ) -> Verdict {
        if excess.is_unnamed() {
            return Verdict::Unknown;
        }
        if self.proofs.is_empty() {
            let seen = location.iter().any(|place| place.p < SIGNIFICANT);
            return if channels.is_empty() || !seen { Verdict::NothingMissing } else { Verdict::Unknown };
        }
        let undecided = alternatives.iter().any(|alternative| alternative.indistinguishable);
        if !excess.is_left() {
            return if undecided { Verdict::OneOf } else { Verdict::Named };
        }
        let left = |gain: f64| (1.0 - gain).powi(2);
        let named = fit.gain.map_or(1.0, |gain| left(gain.value));
        let rest = self.judge.unnamed_rest(self.search, &self.numbers.fit, errors, channels);
        let unnamed = if rest.ci95[0] > 0.0 { named * left(rest.value) } else { named };
        if (named - unnamed) > UNNAMED_SHARE * (1.0 - unnamed) {
            return Verdict::Unknown;
        }
        if undecided { Verdict::OneOf } else { Verdict::Named }
    }
}

/// Whether the catalogue has `effect`, and this tells it: a wave of which nobody can say how often it repeats is a curve that a piece of a wave happens
/// to follow.
fn has_a_name(effect: &Effect) -> bool {
    let periods = effect.parameters.get(PERIODS).and_then(|periods| periods.ci95);
    is_catalogued(effect) && periods.is_none_or(|[low, high]| high <= LEAST_TOLD * low)
}

/// Whether the catalogue has the kind of `effect`.
fn is_catalogued(effect: &Effect) -> bool {
    kind(effect.kind).is_some_and(Kind::is_catalogued)
}

/// Puts the verdict into words.
fn word(diagnosis: &mut Diagnosis) {
    let left_out = words::left_out(&diagnosis.along_the_arm());
    diagnosis.statement = match diagnosis.verdict {
        Verdict::NothingMissing => {
            "The recording agrees with the model inside its tolerances. Nothing is missing that this motion could show.".to_owned()
        }
        Verdict::Named => left_out,
        Verdict::OneOf => left_out + &words::open(&diagnosis.alternatives),
        Verdict::Unknown => unknown(&diagnosis.along_the_arm()),
        Verdict::InsufficientData | Verdict::Setup => diagnosis.statement.clone(),
    };
    if diagnosis.verdict == Verdict::OneOf {
        let undecided = diagnosis.alternatives.iter().filter(|a| a.indistinguishable);
        diagnosis.next = undecided.map(words::to_tell).collect();
        diagnosis.next.dedup();
    }
}

/// What is said where more is missing than has a name: that, what it looks like, and what has a name.
fn unknown(effects: &[&Effect]) -> String {
    let (named, nameless): (Vec<&Effect>, Vec<&Effect>) =
        effects.iter().copied().partition(|effect| is_catalogued(effect));
    let mut words = "Something is missing from the model that no effect of the catalogue says well enough; it is located, and an unnamed correction \
                     says how much it is."
        .to_owned();
    for like in nameless {
        words.push_str(&format!(" It looks like this: {}", like.statement));
    }
    if !named.is_empty() {
        words.push_str(&format!(
            " Part of it has a name, or is like what has one. {}",
            words::left_out(&named)
        ));
    }
    words
}
