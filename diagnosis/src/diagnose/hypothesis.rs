//! Everything that might be missing: each kind of effect, of the catalogue and beyond it, at each place in each shape, as a block of columns.

use std::rc::Rc;

use freeplay_arm::{Arm, EffectTable};
use freeplay_laws::{Kind as EffectKind, LawError, Place, Placed, Recorded, START, Site, Term, kinds};
use freeplay_recording::Group;
use toml::Table;

use super::case::{Case, take_mean_off};
use super::columns::{Column, dot, sum_of};
use super::moment::{happens_in, in_each, plain, struck};
use super::report::Untestable;
use super::stage::{Answer, Stage};
use super::system::{Block, Score, System};
use super::upon::acted_on;
use crate::presence::masked;
use crate::residual::{Channel, Kind};

/// One effect at one place in one shape.
pub(crate) struct Hypothesis {
    /// Its kind.
    pub kind: &'static EffectKind,
    /// Where; `None`: the arm as a whole.
    pub joint: Option<usize>,
    /// Its shape.
    pub shape: Table,
    /// Whether it changes what is read of a machine.
    pub is_read: bool,
    /// Its terms that the motion shows, in the order of the block's columns.
    pub terms: Vec<Term>,
    /// Where these are among all terms of the law; the others are zero.
    shown: Vec<usize>,
    /// Number of all terms of the law.
    all: usize,
    /// Its columns.
    pub block: Block,
}

impl Hypothesis {
    /// Number of coefficients.
    pub fn size(&self) -> usize {
        self.terms.len()
    }

    /// Whether it changes what is read of a machine by a limit or with memory, and so acts on what all laws of the machine say. (A gain does, too, but laid
    /// upon a law it would stand in for that.)
    pub fn measures(&self) -> bool {
        self.is_read && self.kind.rough
    }

    /// The parameters for these coefficients of the terms shown, with the shape `shape`.
    pub fn compose(&self, shape: &Table, coefficients: &[f64]) -> Table {
        self.kind.compose(&plain(shape), &self.of_all(coefficients))
    }

    /// The coefficients of all terms of the law for these of the terms shown.
    fn of_all(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.all];
        self.shown.iter().zip(coefficients).for_each(|(&place, coefficient)| all[place] = *coefficient);
        all
    }

    /// Its shape with the law taken about these coefficients of the terms shown.
    pub fn shape_around(&self, coefficients: &[f64]) -> Table {
        let mut shape = self.shape.clone();
        shape.insert(AROUND.to_owned(), self.of_all(coefficients).into());
        shape
    }

    /// The table of an arm file that switches it on with these coefficients of the terms shown.
    pub fn table(&self, arm: &Arm, coefficients: &[f64]) -> EffectTable {
        table(self.kind, self.joint, arm, self.compose(&self.shape, coefficients))
    }

    /// The columns of its terms on the rows of `case`, another one than it was made for.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn columns_on(&self, case: &Case) -> Result<Rc<Vec<Column>>, LawError> {
        let key = format!("{} {:?} {:?} {}", self.kind.name, self.joint, self.shown, self.shape);
        case.laid(key, || {
            let (_, mut all) = columns(case, self.kind, self.joint, &self.shape)?;
            all.resize_with(self.all, || vec![None; case.kept.len()]);
            Ok(self.shown.iter().map(|&place| std::mem::take(&mut all[place])).collect())
        })
    }

    /// The same effect on the rows of `case`, whose system is `system`.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn laid_on(&self, case: &Case, system: &System) -> Result<Hypothesis, LawError> {
        Ok(Self {
            shape: self.shape.clone(),
            terms: self.terms.clone(),
            shown: self.shown.clone(),
            block: system.block(self.columns_on(case)?.to_vec()).held(limits(&self.terms)),
            ..*self
        })
    }

    /// The same effect at the same place.
    pub fn same_effect(&self, other: &Hypothesis) -> bool {
        self.kind.name == other.kind.name && self.joint == other.joint
    }

    /// Whether `other` is a special case of it, at the same place: a plainer law, or the same with fewer numbers to fit.
    pub fn contains(&self, other: &Hypothesis) -> bool {
        let is_plainer = |kind: &str| self.kind.contains.iter().any(|(plainer, _)| *plainer == kind);
        let is_shorter = self.kind.name == other.kind.name && self.size() > other.size();
        self.joint == other.joint && (is_shorter || is_plainer(other.kind.name))
    }

    /// Whether the coefficients of `score` are physical.
    pub fn is_physical(&self, score: &Score) -> bool {
        self.is_possible(score.beta.as_slice())
    }

    /// Whether the coefficients of `score` are physical, and so far inside their bounds that other weights don't push them out.
    pub fn is_well_inside(&self, score: &Score) -> bool {
        let is_inside = |(term, beta): (&Term, &f64)| {
            term.least <= 0.0 || *beta >= MARGIN * term.least && MARGIN * *beta <= term.most
        };
        self.is_physical(score) && self.terms.iter().zip(score.beta.iter()).all(is_inside)
    }

    /// Whether these coefficients are physical.
    fn is_possible(&self, beta: &[f64]) -> bool {
        self.terms.iter().zip(beta).all(|(term, beta)| *beta >= term.least && *beta <= term.most)
    }

    /// The effect with these coefficients on `arm`; `None` if they are not physical or an arm file cannot say them.
    pub fn placed(&self, arm: &Arm, beta: &[f64]) -> Option<Placed> {
        if self.is_possible(beta) { Placed::new(&self.table(arm, beta), arm).ok() } else { None }
    }

    /// Channels in which it shows.
    pub fn channels(&self) -> impl Iterator<Item = usize> + '_ {
        self.block.shows.iter().copied()
    }

    /// Whether both show in one channel at least: else neither can stand in the other's place.
    pub fn meets(&self, other: &Hypothesis) -> bool {
        self.channels().any(|c| other.block.shows.contains(&c))
    }
}

/// The table of an arm file for `kind` at `joint` with `parameters`.
fn table(kind: &EffectKind, joint: Option<usize>, arm: &Arm, parameters: Table) -> EffectTable {
    let joint = joint.map(|joint| arm.joints()[joint].name.clone());
    EffectTable { kind: kind.name.to_owned(), joint, parameters, line: 0 }
}

/// Where `kind` can sit on an arm.
pub(crate) fn places(kind: &EffectKind, arm: &Arm) -> Vec<Option<usize>> {
    match kind.site {
        Site::Arm => vec![None],
        Site::Joint | Site::Revolute => {
            (0..arm.dof()).filter(|&joint| kind.fits(arm.joints().get(joint))).map(Some).collect()
        }
    }
}

/// After so many laws it is said how many are laid out.
const TOLD: usize = 2;

/// All hypotheses that the recordings of `case` can show, and those that they can't, or can't tell from others.
pub(crate) fn hypotheses(
    case: &Case,
    system: &System,
    progress: &mut dyn FnMut(&str),
) -> (Vec<Hypothesis>, Vec<Untestable>) {
    let (mut all, mut untestable) = (Vec::new(), Vec::new());
    let arm = case.stages[0].arm();
    let count = kinds().count();
    for (number, kind) in kinds().enumerate() {
        if number.is_multiple_of(TOLD) {
            progress(&format!("laying out what might be missing: {number} of {count} laws"));
        }
        for joint in places(kind, arm) {
            let because = |lacks: &dyn Fn(&Place, &Recorded) -> Option<String>| {
                let stages = case.stages.iter();
                let all: Option<Vec<String>> = stages
                    .map(|stage| {
                        let place = Place { scene: stage.baseline(kind).scene(), joint };
                        lacks(&place, &stage.recorded())
                    })
                    .collect();
                all.and_then(|all| all.into_iter().next())
            };
            let can_not = |because| Untestable {
                kind: kind.name,
                joint: joint.map(|joint| arm.joints()[joint].name.clone()),
                because,
            };
            if let Some(because) = because(&|place, recorded| kind.cannot_be_fitted(place, recorded)) {
                untestable.push(can_not(because));
                continue;
            }
            // What covers too little still stands beside what it could be taken for.
            untestable.extend(because(&|place, recorded| kind.missing(place, recorded)).map(can_not));
            let fastest = fastest(case, joint);
            let mut shapes = (kind.shapes)(&Place { scene: fastest.baseline(kind).scene(), joint });
            shapes.extend(in_each(case, kind, joint));
            shapes.extend(struck(case, kind));
            shapes.extend(reached(case, kind, joint));
            let before = all.len();
            let mut refused = None;
            for shape in shapes {
                match hypothesis(case, system, kind, joint, shape) {
                    Ok(found) => all.extend(found),
                    Err(error) => refused = Some(error.to_string()),
                }
            }
            if all.len() == before {
                let because = refused.or_else(|| no_torque_of(case, joint));
                untestable
                    .push(can_not(because.unwrap_or_else(|| "this motion shows nothing of it".to_owned())));
            }
        }
    }
    (all, untestable)
}

/// That the torque of `joint` is no measurement in any recording of `case`, in words: the same for all such joints.
fn no_torque_of(case: &Case, joint: Option<usize>) -> Option<String> {
    let is_stuck = |j| case.stages.iter().all(|stage| stage.ground.is_stuck(Kind::Torque(j)));
    joint.filter(|joint| is_stuck(*joint))?;
    let stuck: Vec<String> =
        (0..case.stages[0].arm().dof()).filter(|j| is_stuck(*j)).map(|j| Group::Torque.column(j)).collect();
    let is = if stuck.len() > 1 { "are" } else { "is" };
    Some(format!("{} {is} no measurement", stuck.join(", ")))
}

/// Share of the samples whose torque is beyond what is taken for the greatest that was reached: noise and spikes.
const BEYOND: f64 = 0.005;

/// Name of the parameter of a law that nothing measured goes beyond.
const LIMIT: &str = "limit";

/// A drive at its limit gives this share of it at least…
const AT_LIMIT: f64 = 0.7;
/// …wherever the model wants this much more than the limit, but for half of the time: the model lacks something.
const WANTED: f64 = 1.3;

/// The shape of a `kind` with a limit that is the greatest torque of `joint` in the recordings of `case`; `None` if the drive hardly ever gives that much
/// where the model wants more.
fn reached(case: &Case, kind: &EffectKind, joint: Option<usize>) -> Option<Table> {
    kind.parameter(LIMIT)?;
    let torques: Vec<&Channel> = case
        .stages
        .iter()
        .flat_map(|stage| &stage.channels)
        .filter(|channel| joint.is_some_and(|joint| channel.kind == Kind::Torque(joint)))
        .collect();
    let mut sizes: Vec<f64> =
        torques.iter().flat_map(|channel| channel.measured.iter().map(|x| x.abs())).collect();
    let beyond = (BEYOND * sizes.len() as f64) as usize;
    let at = sizes.len().checked_sub(1 + beyond)?;
    let (_, &mut reached, _) = sizes.select_nth_unstable_by(at, f64::total_cmp);
    let rows = torques.iter().flat_map(|channel| channel.measured.iter().zip(&channel.model));
    let wanted: Vec<bool> = rows
        .filter(|(_, model)| model.abs() > WANTED * reached)
        .map(|(measured, model)| measured * model.signum() > AT_LIMIT * reached)
        .collect();
    let given = wanted.iter().filter(|given| **given).count();
    (2 * given >= wanted.len()).then(|| [(LIMIT.to_owned(), reached.into())].into_iter().collect())
}

/// The recording in which `joint` moves fastest, which spans the speeds and loads that shapes are laid out over; for the whole arm the first.
fn fastest<'c, 'a>(case: &'c Case<'a>, joint: Option<usize>) -> &'c Stage<'a> {
    let greatest = |stage: &Stage| {
        let joint = joint.map(|joint| stage.motion().v[joint].iter());
        joint.into_iter().flatten().fold(0.0_f64, |most, v| most.max(v.abs()))
    };
    let first = &case.stages[0];
    case.stages
        .iter()
        .skip(1)
        .fold(first, |most, stage| if greatest(stage) > greatest(most) { stage } else { most })
}

/// How far inside bounds of one sign a coefficient has to be while a shape is moved, as a factor.
const MARGIN: f64 = 1.15;

/// Least share of a column's square that the columns of the same law before it do not say, for the motion to show its term.
const OWN_SHARE: f64 = 1e-8;

/// Least share of what a channel measures that a term has to say there with its greatest coefficient.
const SEEN: f64 = 1e-6;

/// Whether the column number `place` of `block`, with the greatest coefficient of its `term`, says anything that could be measured: a force
/// along the axis of a joint is a rounding error.
fn is_seen(case: &Case, block: &Block, place: usize, term: &Term) -> bool {
    let most = term.least.abs().max(term.most.abs());
    block.shows.iter().any(|&c| {
        let (stage, channel) = case.place(c);
        let measured: f64 = case.stages[stage].channels[channel].measured.iter().map(|x| x * x).sum();
        let said = block.columns[place][c].as_ref().map_or(0.0, |rows| dot(rows, rows));
        said.sqrt() * most > SEEN * measured.sqrt()
    })
}

/// `kind` at `joint` in `shape`, with the terms that the motion shows; `None` if it shows none.
///
/// # Errors
/// See [`LawError`].
pub(crate) fn hypothesis(
    case: &Case,
    system: &System,
    kind: &'static EffectKind,
    joint: Option<usize>,
    shape: Table,
) -> Result<Option<Hypothesis>, LawError> {
    if is_refuted(case, kind, joint, &shape)? {
        return Ok(None);
    }
    let (terms, columns) = columns(case, kind, joint, &shape)?;
    if columns.iter().flatten().flatten().flatten().any(|x| !x.is_finite()) {
        return Ok(None);
    }
    let all = terms.len();
    let mut block = system.block(columns);
    let is_seen = |place: &usize| is_seen(case, &block, *place, &terms[*place]);
    let shown: Vec<usize> = block.independent(OWN_SHARE).into_iter().filter(is_seen).collect();
    // A law without one of its terms may be a plainer one of the catalogue, which stands there by itself.
    if shown.is_empty() || shown.len() < all && !kind.contains.is_empty() {
        return Ok(None);
    }
    if shown.len() < all {
        block = system.block(shown.iter().map(|&place| std::mem::take(&mut block.columns[place])).collect());
    }
    let terms: Vec<Term> = shown.iter().map(|&place| terms[place].clone()).collect();
    let block = block.held(limits(&terms));
    let arm = case.stages[0].arm();
    let is_read = Placed::new(&table(kind, joint, arm, terms[0].plus.clone()), arm)
        .is_ok_and(|placed| placed.effect.measures());
    Ok(Some(Hypothesis { kind, joint, shape, is_read, terms, shown, all, block }))
}

/// Share of the squares of what is left of a channel from which on what a law says there can be looked for in it.
const PLAIN: f64 = 0.25;

/// Least share of it that has to be found.
const FOUND: f64 = 0.5;

/// Whether the `shape` of a law with a memory moves a link, however strong the law is, as its encoder, the tool or what the other joints carry does not.
fn is_refuted(
    case: &Case,
    kind: &'static EffectKind,
    joint: Option<usize>,
    shape: &Table,
) -> Result<bool, LawError> {
    let is_elsewhere = |stage: &Stage, channel: &Channel| {
        joint.is_none_or(|joint| channel.kind != Kind::Torque(joint)) && !stage.ground.is_stuck(channel.kind)
    };
    if !(kind.takes_as_given(START) && shape.contains_key(START)) {
        return Ok(false);
    }
    for stage in &case.stages {
        if !stage.channels.iter().any(|channel| is_elsewhere(stage, channel)) {
            continue;
        }
        let Some(term) = stage.terms(kind, joint, &plain(shape), &[], &[])?.into_iter().next() else {
            continue;
        };
        let answer =
            stage.answer(&Placed::new(&table(kind, joint, stage.arm(), term.0.plus), stage.arm())?)?;
        let elsewhere = stage.channels.iter().zip(answer).filter(|(channel, _)| is_elsewhere(stage, channel));
        for (channel, said) in elsewhere {
            let Some(mut said) = said else { continue };
            let mut left = channel.residual();
            let present = masked(vec![1.0; left.len()], channel.present.as_deref());
            take_mean_off(&mut said, &present);
            take_mean_off(&mut left, &present);
            let square = dot(&said, &said);
            if square > PLAIN * dot(&left, &left) && dot(&said, &left) < FOUND * square {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// Within which the coefficients of `terms` are held.
fn limits(terms: &[Term]) -> Vec<[f64; 2]> {
    let free = [f64::NEG_INFINITY, f64::INFINITY];
    terms.iter().map(|term| if term.held { [term.least, term.most] } else { free }).collect()
}

/// Name of the entry in a shape that lists the coefficients of all terms about which a law of several terms is taken: with these, what the columns say
/// together is then what the law says.
pub(crate) const AROUND: &str = "around";

/// Adds to the `columns` of `kind` at `joint` what the law says beyond their sum with the coefficients `around`, each by its share of that sum.
fn take_around(
    case: &Case,
    (kind, joint): (&'static EffectKind, Option<usize>),
    shape: &Table,
    columns: &mut [Column],
) -> Result<(), LawError> {
    let Some(around) = shape.get(AROUND).and_then(toml::Value::as_array) else { return Ok(()) };
    let around: Vec<f64> = around.iter().filter_map(toml::Value::as_float).collect();
    let parameters = kind.compose(&plain(shape), &around);
    let answer = |stage: &Stage| -> Result<Answer, LawError> {
        stage.answer(&Placed::new(&table(kind, joint, stage.arm(), parameters.clone()), stage.arm())?)
    };
    let answers = case.stages.iter().map(answer).collect::<Result<_, _>>()?;
    let mut beyond: Vec<Vec<f64>> =
        case.centred(case.column(answers)).into_iter().map(Option::unwrap_or_default).collect();
    let square = |column: &Column| column.iter().flatten().flatten().map(|x| x * x).sum::<f64>();
    let said: Vec<f64> = columns.iter().zip(&around).map(|(column, c)| c * square(column)).collect();
    let all: f64 = said.iter().zip(&around).map(|(said, c)| said * c).sum();
    let sum = sum_of(columns.iter().zip(around), beyond.len());
    for (beyond, sum) in beyond.iter_mut().zip(&sum) {
        beyond.iter_mut().zip(sum).for_each(|(beyond, x)| *beyond -= x);
    }
    for (column, said) in columns.iter_mut().zip(said).filter(|_| all > 0.0) {
        for (part, beyond) in column.iter_mut().zip(&beyond) {
            let part = part.iter_mut().flatten();
            part.zip(beyond).for_each(|(x, beyond)| *x += said / all * beyond);
        }
    }
    Ok(())
}

/// All terms of a law and their columns, those of link encoders less their means.
fn columns(
    case: &Case,
    kind: &'static EffectKind,
    joint: Option<usize>,
    shape: &Table,
) -> Result<(Vec<Term>, Vec<Column>), LawError> {
    let mut terms = Vec::new();
    let mut answers: Vec<Vec<Answer>> = Vec::new();
    for (number, stage) in case.stages.iter().enumerate() {
        let (upon, nuisances) = (acted_on(shape, stage.arm()), &case.nuisances[number]);
        let (of_stage, mut said): (Vec<Term>, Vec<Answer>) =
            stage.terms(kind, joint, &plain(shape), &upon, nuisances)?.into_iter().unzip();
        if !happens_in(shape, stage) {
            said.iter_mut().for_each(|said| said.fill(None));
        }
        if number == 0 {
            answers.resize_with(of_stage.len(), Vec::new);
            terms = of_stage;
        }
        answers.iter_mut().zip(said).for_each(|(answers, said)| answers.push(said));
    }
    let mut columns: Vec<Column> =
        answers.into_iter().map(|answers| case.centred(case.column(answers))).collect();
    take_around(case, (kind, joint), shape, &mut columns)?;
    Ok((terms, columns))
}
