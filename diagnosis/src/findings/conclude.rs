//! From the confirmed laws to the diagnosis.

use std::collections::BTreeMap;

use freeplay_laws::{Kind, LawError, kind};
use freeplay_model::{ArmFile, EffectTable};

use crate::candidates::candidate::Untestable;
use crate::data::columns::{add_all, less, sum_of};
use crate::data::parts::Part;
use crate::data::tolerance::Nuisance;
use crate::evidence::gain::{Compared, Gain};
use crate::evidence::nameless;
use crate::evidence::system::Fit;
use crate::findings::alternatives::{alternatives, rows_of_evidence};
use crate::findings::event::Event;
use crate::findings::locate::{correct, maps};
use crate::findings::passage::{Columns, Remains, passages};
use crate::findings::standing::{Cause, Standing};
use crate::report::diagnosis::{
    Alternative, ChannelNoise, DIAGNOSIS_SCHEMA, Diagnosis, Discrepancy, Effect, Fit as Errors, Location,
    Map, Rmse, Tuned, Verdict,
};
use crate::report::words;
use crate::signals::channel::Kind as ChannelKind;
use crate::sorting::sort_falling;
use crate::statistics::SIGNIFICANT;

/// Makes a diagnosis of the confirmed part of the answer. The diagnosis carries the notes `quality` and lists the effects that are `untestable`.
///
/// # Errors
/// See [`LawError`]; `None` if a fit is singular.
pub(crate) fn conclude(
    mut of: Standing,
    quality: Vec<String>,
    untestable: Vec<Untestable>,
) -> Result<Option<Diagnosis>, LawError> {
    let Some((fit, findings)) = of.standing()? else { return Ok(None) };
    let Some(bare) = of.search.system.fit_within_tolerances(&[]) else { return Ok(None) };
    let mut alternatives = alternatives(of.search, &fit);
    alternatives.extend(of.events.iter().flat_map(|event| event.alternatives.iter().cloned()));
    let evidence = rows_of_evidence(of.search, &bare, &fit);
    let conclusion = Conclusion { of: &of, fit: &fit };
    let Some(remains) = conclusion.remains()? else { return Ok(None) };
    let mut residual = of.search.system.residual(&bare);
    add_all(&mut residual, of.events.iter().flat_map(Event::columns));
    let maps = conclusion.maps(&residual);
    let verdict = conclusion.verdict(&alternatives, findings.is_empty());
    let laws = findings.iter().map(|finding| conclusion.contribution(&finding.of)).collect();
    let passages = passages(of.data(), &Columns { remains: &remains, laws });
    let (tables, effects): (Vec<EffectTable>, Vec<Effect>) =
        findings.into_iter().map(|finding| (finding.table, finding.effect)).unzip();
    let mut model = of.file.clone();
    if matches!(verdict, Verdict::Named | Verdict::OneOf | Verdict::Unknown) && !tables.is_empty() {
        model.arm = of.tuned_arm(&fit).unwrap_or(model.arm);
        add_to(&mut model, tables);
    }
    let is_named = |one: &Untestable| effects.iter().any(|e| e.kind == one.kind && e.joint == one.joint);
    let mut diagnosis = Diagnosis {
        schema: DIAGNOSIS_SCHEMA,
        verdict,
        statement: String::new(),
        setup: Vec::new(),
        location: conclusion.location(&remains, &maps),
        untestable: untestable.into_iter().filter(|one| !is_named(one)).collect(),
        effects,
        alternatives,
        fit: Some(conclusion.errors(&remains)),
        next: Vec::new(),
        quality,
        evidence,
        maps,
        tuned: conclusion.tuned(),
        noise: conclusion.noise(&remains),
        discrepancy: conclusion.discrepancy(),
        seed: of.settings.seed,
        passages,
        mapping: None,
        model,
    };
    words::put_into_words(&mut diagnosis);
    Ok(Some(diagnosis))
}

/// The laws of `fit`, all of them confirmed.
struct Conclusion<'s, 'c, 'd, 'a> {
    of: &'s Standing<'c, 'd, 'a>,
    fit: &'s Fit,
}

impl Conclusion<'_, '_, '_, '_> {
    /// The contribution of a finding to every row, by channel; that of a law with its coefficients in `fit`.
    fn contribution(&self, of: &Cause) -> Vec<Vec<f64>> {
        let system = &self.of.search.system;
        match of {
            Cause::Event(number) => sum_of(self.of.events[*number].columns(), self.of.target),
            // The pictures leave out rows of a joint at rest.
            Cause::Hold => sum_of(std::iter::empty(), self.of.target),
            Cause::Law(member) => {
                let place = self.fit.members.iter().position(|other| other == member);
                let beta = place.map_or(&[][..], |place| system.coefficients(self.fit, place));
                sum_of(system.candidate(*member).columns.iter().zip(beta.iter().copied()), self.of.target)
            }
        }
    }

    /// Residuals of every row; `None` if a fit is singular.
    fn remains(&self) -> Result<Option<Remains>, LawError> {
        let system = &self.of.search.system;
        let Some(bare) = system.fit_within_tolerances(&[]) else { return Ok(None) };
        let as_given = self.of.left_as_given(self.fit)?;
        let [mut retuned, mut after] = [self.of.target.to_vec(), as_given.clone()];
        self.of.tune(&mut retuned, &bare);
        self.of.tune(&mut after, self.fit);
        Ok(Some(Remains {
            before: self.of.target.to_vec(),
            nameless: less(&retuned, &nameless::nameless_prediction(system, &retuned)),
            retuned,
            after,
            as_given,
        }))
    }

    /// The errors on the test part, channel by channel.
    fn errors(&self, remains: &Remains) -> Errors {
        let system = &self.of.search.system;
        let data = system.data;
        let test = system.weights.on(data, &[Part::Test]);
        let masks: Vec<Vec<f64>> = (0..data.channels()).map(|c| data.mask(c, &[Part::Test])).collect();
        let names = || data.recordings[0].channels.iter();
        let by_name = |rows: &[Vec<f64>]| -> BTreeMap<String, Rmse> {
            let rms = data.rms(rows, &masks);
            names().zip(rms).filter_map(|(c, rmse)| Some((c.name.clone(), Rmse { rmse: rmse? }))).collect()
        };
        let before = by_name(&remains.before);
        let noise =
            names().zip(&system.weights.noise).map(|(c, noise)| (c.name.clone(), Rmse { rmse: *noise }));
        let weights = test.by_row();
        let members = self.fit.members.iter().map(|&member| system.candidate(member));
        let members = members.chain(self.of.events.iter().map(|event| &event.candidate));
        let mut shown: Vec<usize> = members
            .flat_map(|candidate| candidate.channels.iter().map(|c| c % data.channels_per_recording()))
            .flat_map(|c| data.same_channel(c))
            .collect();
        shown.sort_unstable();
        shown.dedup();
        let gain = |after: &[Vec<f64>]| -> Option<Gain> {
            let compared = Compared { before: &remains.retuned, after, weights: &weights };
            compared.gain(data, &shown, self.of.settings.seed)
        };
        Errors {
            noise_floor: noise.filter(|(name, _)| before.contains_key(name)).collect(),
            after: by_name(&remains.after),
            retuned: by_name(&remains.retuned),
            after_as_given: by_name(&remains.as_given),
            black_box: by_name(&remains.nameless),
            held_out: true,
            test: data.how.clone(),
            gain: gain(&remains.after),
            black_box_gain: gain(&remains.nameless),
            units: names()
                .filter(|c| before.contains_key(&c.name))
                .map(|c| (c.name.clone(), c.unit))
                .collect(),
            before,
        }
    }

    /// Maps of the tuned model's residual, over the first recording.
    fn maps(&self, residual: &[Vec<f64>]) -> Vec<Map> {
        let data = self.of.data();
        let mut all: Vec<Map> = (0..data.channels_per_recording())
            .flat_map(|c| {
                maps(
                    &data.recordings[0],
                    c,
                    &residual[c],
                    &data.mask(c, &[Part::Fit, Part::Choice]),
                    self.of.settings.seed,
                )
            })
            .collect();
        correct(&mut all);
        all.sort_by(|a, b| a.p.total_cmp(&b.p).then(b.explained.total_cmp(&a.explained)));
        all
    }

    /// The locations where the tuned model and the machine differ: shares of the residual beyond the noise, in squares of each channel's own noise.
    fn location(&self, remains: &Remains, maps: &[Map]) -> Vec<Location> {
        let data = self.of.data();
        let masks: Vec<Vec<f64>> =
            (0..data.channels()).map(|c| data.mask(c, &[Part::Fit, Part::Choice, Part::Test])).collect();
        let residual = data.rms(&remains.retuned, &masks);
        let beyond = |c: usize| {
            let noise = self.of.search.system.weights.noise[c].max(f64::MIN_POSITIVE);
            residual[c].map_or(0.0, |residual| ((residual / noise).powi(2) - 1.0).max(0.0))
        };
        let mut groups: BTreeMap<Option<usize>, (f64, Vec<usize>)> = BTreeMap::new();
        for (c, channel) in data.recordings[0].channels.iter().enumerate() {
            let joint = match channel.kind {
                ChannelKind::Torque(joint) | ChannelKind::Link(joint) | ChannelKind::Position(joint) => {
                    Some(joint)
                }
                ChannelKind::Tool(_) => None,
            };
            let group = groups.entry(joint).or_default();
            group.0 += beyond(c);
            if beyond(c) > 1.0 {
                group.1.push(c);
            }
        }
        let all: f64 = groups.values().map(|group| group.0).sum();
        let name = |c: &usize| data.recordings[0].channels[*c].name.clone();
        let mut location: Vec<Location> = groups
            .into_iter()
            .filter(|(_, (_, channels))| !channels.is_empty())
            .map(|(joint, (sum, channels))| {
                let channels: Vec<String> = channels.iter().map(name).collect();
                let strongest = maps.iter().find(|map| channels.contains(&map.channel));
                Location {
                    joint: joint.map(|joint| self.of.arm().joints()[joint].name.clone()),
                    channels,
                    share: sum / all.max(f64::MIN_POSITIVE),
                    when: words::when(strongest.filter(|map| map.p < SIGNIFICANT)),
                    p: strongest.map_or(1.0, |map| map.p),
                }
            })
            .collect();
        sort_falling(&mut location, |place| place.share);
        location
    }

    /// Use of the tolerances, the largest first.
    fn tuned(&self) -> Vec<Tuned> {
        let bound = self.of.bound(&self.of.search.system.tolerances_beside(self.fit));
        let one = |(nuisance, deviations): (&Nuisance, f64)| Tuned {
            name: nuisance.name.clone(),
            deviations,
            of: nuisance.of,
        };
        let mut tuned: Vec<Tuned> = bound.into_iter().map(one).collect();
        sort_falling(&mut tuned, |tuned| tuned.deviations.abs());
        tuned
    }

    /// Residual noise of each channel under the findings, for the design of the next motion.
    fn noise(&self, remains: &Remains) -> BTreeMap<String, ChannelNoise> {
        let system = &self.of.search.system;
        let data = system.data;
        let masks: Vec<Vec<f64>> = (0..data.channels()).map(|c| data.active_mask(c)).collect();
        let rms = data.rms(&remains.after, &masks);
        let of = |(c, rms): (usize, Option<f64>)| {
            let (stretch, step) = data.stretches(c).next()?;
            let lasts = step * masks[c].iter().sum::<f64>();
            let noise = ChannelNoise {
                deviation: rms?.max(system.weights.noise[c]),
                per_second: system.weights.rows[c].effective()
                    / lasts.max(step * stretch.len().min(1) as f64).max(1e-9),
            };
            Some((data.recordings[0].channels[c].name.clone(), noise))
        };
        rms.into_iter().enumerate().filter_map(of).collect()
    }

    /// Relative accuracy of each channel's laws.
    fn discrepancy(&self) -> BTreeMap<String, Discrepancy> {
        let system = &self.of.search.system;
        let channels = system.data.recordings[0].channels.iter().enumerate();
        let active = channels.filter(|(c, _)| system.weights.rows[*c].effective() > 0.0);
        active
            .map(|(c, channel)| {
                let discrepancy =
                    Discrepancy { share: system.weights.rows[c].share, noise: system.weights.noise[c] };
                (channel.name.clone(), discrepancy)
            })
            .collect()
    }

    fn verdict(&self, alternatives: &[Alternative], is_nothing_found: bool) -> Verdict {
        let system = &self.of.search.system;
        let is_catalogued = |&member: &usize| system.candidate(member).kind.is_catalogued();
        if !self.fit.members.iter().all(is_catalogued) || self.of.leaves_more(self.fit) {
            return Verdict::Unknown;
        }
        if is_nothing_found {
            return Verdict::NothingMissing;
        }
        if alternatives.iter().any(|alternative| alternative.indistinguishable) {
            Verdict::OneOf
        } else {
            Verdict::Named
        }
    }
}

/// Adds `tables` to `model`; each replaces the model's effect of the same kind at the same place, except for transients.
fn add_to(model: &mut ArmFile, tables: Vec<EffectTable>) {
    for table in tables {
        let happens = kind(&table.kind).is_some_and(Kind::happens);
        let same =
            |other: &&mut EffectTable| !happens && other.kind == table.kind && other.joint == table.joint;
        match model.effects.iter_mut().find(same) {
            Some(known) => *known = table,
            None => model.effects.push(table),
        }
    }
}
