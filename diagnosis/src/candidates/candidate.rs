//! Candidates for missing effects: each kind of effect, of the catalogue and beyond it, at each place in each shape, as a block of columns.

use std::rc::Rc;

use freeplay_arm::Arm;
use freeplay_laws::{
    ArmParts, Injection, Kind as EffectKind, LawError, Need, OPERATING_POINT, Place, Placed, Site, Start,
    Term, kinds,
};
use freeplay_model::EffectTable;
use freeplay_recording::Group;
use nalgebra::{Cholesky, DMatrix, DVector};
use serde::Serialize;
use toml::{Table, Value};

use crate::candidates::transients::{WhiteTorques, window};
use crate::data::columns::{Answer, Column, dot};
use crate::data::linearised::LinearisedRecording;
use crate::data::stacked::{Data, REMEMBERED};
use crate::signals::channel::Kind;
use crate::signals::initial_state::InBearing;
use crate::statistics::{FINEST, span};

/// An effect that the recordings can't show.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Untestable {
    /// The kind of the effect.
    pub kind: &'static str,
    /// The joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// A plain sentence about the data that the recordings lack.
    pub because: String,
}

/// The nonlinear parameters of an effect, on which its columns depend.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Form {
    /// The numbers and words that shape its law.
    pub shape: Table,
    /// The only recording in which the effect occurs; `None`: all.
    pub only: Option<usize>,
    /// The coefficients of all terms at which the law is linearised; `None`: zero.
    pub around: Option<Vec<f64>>,
    /// True if the coefficients have the values that are common on most machines.
    pub is_usual: bool,
}

impl Form {
    /// The form with this `shape`, in all recordings.
    pub fn of(shape: Table) -> Self {
        Self { shape, ..Self::default() }
    }

    /// True if the form linearises its law along a chord, from zero to one coefficient of the only term.
    pub fn is_chord(&self) -> bool {
        self.shape.contains_key(OPERATING_POINT)
    }
}

/// The form with this `shape` in the recording number `only`.
pub(crate) fn in_one_recording(data: &Data, shape: Table, only: usize) -> Form {
    Form { only: (data.recordings.len() > 1).then_some(only), ..Form::of(shape) }
}
/// An effect at a place in a form, with its columns on the rows of the data.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    /// The kind of the effect.
    pub kind: &'static EffectKind,
    /// The joint of the effect; `None`: the arm as a whole.
    pub joint: Option<usize>,
    /// The nonlinear parameters.
    pub form: Form,
    /// The terms that the motion shows, in the order of the columns.
    pub terms: Vec<Term>,
    /// The contribution to each channel per unit of each term's coefficient.
    pub columns: Rc<Vec<Column>>,
    /// Channels in which a column is not zero.
    pub channels: Vec<usize>,
    /// Number of forms of this effect in the search: its prior probability is divided among them.
    pub forms: usize,
    /// True for an effect of a sensor, which acts on the sum of all other effects.
    pub acts_on_readings: bool,
    /// True if the effect changes masses, lengths or gravity of the arm. The diagnosis computes the columns of such an effect once, because no other
    /// effect changes these columns.
    pub changes_arm: bool,
    /// The effect has several possible solutions, and the motion does not determine which one holds.
    pub has_several_solutions: bool,
    /// The effect separates the parts of its joint: by clearance in the bearing (first), by a spring or a gap in the gear (second).
    parts: [bool; 2],
    /// Position of the journal in its bearing at the beginning of each recording, if the effect has a journal and the search has located it.
    journal_starts: Vec<Option<InBearing>>,
    /// The places of the shown terms among all terms of the law; the others are zero.
    shown: Vec<usize>,
    /// Number of all terms of the law.
    all: usize,
}

impl Candidate {
    /// The candidate of `kind` at `joint` in `form`, with the terms that the motion shows; `None` if it shows none.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn new(
        data: &Data,
        kind: &'static EffectKind,
        joint: Option<usize>,
        form: Form,
    ) -> Result<Option<Self>, LawError> {
        Self::with_journal_starts(data, kind, joint, form, vec![None; data.recordings.len()])
    }

    /// The candidate, with its journal near the positions `journal_starts` at the beginning of each recording, if these are known.
    fn with_journal_starts(
        data: &Data,
        kind: &'static EffectKind,
        joint: Option<usize>,
        form: Form,
        mut journal_starts: Vec<Option<InBearing>>,
    ) -> Result<Option<Self>, LawError> {
        let (terms, mut columns) = columns(data, (kind, joint), &form, &mut journal_starts)?;
        if columns.iter().flatten().flatten().flatten().any(|x| !x.is_finite()) {
            return Ok(None);
        }
        let all = terms.len();
        let mut shown = independent(&columns);
        shown.retain(|&place| is_seen(data, &columns[place], &terms[place]));
        // A law without one of its terms may be a simpler law of the catalogue, which is a candidate itself.
        if shown.is_empty() || shown.len() < all && !kind.contains.is_empty() {
            return Ok(None);
        }
        let columns: Vec<Column> = shown.iter().map(|&place| std::mem::take(&mut columns[place])).collect();
        if kind.happens() && !begins_or_ends(data, &columns) {
            return Ok(None);
        }
        let terms: Vec<Term> = shown.iter().map(|&place| terms[place].clone()).collect();
        let placed = Placed::new(&table(kind, joint, data.arm(), terms[0].plus.clone()), data.arm());
        let acts_on_readings = placed.as_ref().is_ok_and(|placed| placed.effect.measures());
        let mut arm = ArmParts::of(data.arm());
        let changes_arm = placed
            .as_ref()
            .is_ok_and(|placed| placed.effect.arm(&mut arm).is_ok() && !arm.are_of(data.arm()));
        let mut injection = Injection::default();
        if let Ok(placed) = &placed {
            placed.effect.inject(&mut injection);
        }
        let in_bearing = !injection.clearances.is_empty() || !injection.films.is_empty();
        let parts = [in_bearing, !injection.transmissions.is_empty()];
        let has_several_solutions = placed.as_ref().is_ok_and(|placed| !placed.effect.courses().is_empty());
        let channels = (0..data.channels()).filter(|&c| columns.iter().any(|column| column[c].is_some()));
        let channels = channels.collect();
        Ok(Some(Self {
            kind,
            joint,
            form,
            terms,
            columns: Rc::new(columns),
            channels,
            forms: 1,
            acts_on_readings,
            changes_arm,
            parts,
            has_several_solutions,
            journal_starts,
            shown,
            all,
        }))
    }

    /// The same effect in another `form`; `None` if the motion shows nothing of it, or other terms.
    pub fn reformed(&self, data: &Data, form: Form) -> Option<Self> {
        let other = Self::with_journal_starts(data, self.kind, self.joint, form, self.journal_starts.clone())
            .ok()??;
        (other.shown == self.shown).then_some(Self { forms: self.forms, ..other })
    }

    /// A law that is linearised along a chord: the same with the derivative of its contribution over its `coefficient` as column, from the contributions at both
    /// sides by `deviation`. `None` for other laws, and if a side has another sign.
    pub fn tangent(&self, data: &Data, coefficient: f64, deviation: f64) -> Option<Self> {
        if !self.form.is_chord() || deviation >= coefficient.abs() {
            return None;
        }
        let mut columns: Vec<Column> = vec![vec![None; data.channels()]];
        for way in [1.0, -1.0] {
            let at = coefficient + way * deviation;
            let mut form = self.form.clone();
            form.shape.insert(OPERATING_POINT.to_owned(), Value::Float(at));
            let there = self.reformed(data, form)?;
            for (sum, column) in columns[0].iter_mut().zip(&there.columns[0]) {
                let Some(column) = column else { continue };
                let sum = sum.get_or_insert_with(|| vec![0.0; column.len()]);
                let share = way * at / (2.0 * deviation);
                sum.iter_mut().zip(column).for_each(|(sum, x)| *sum += share * x);
            }
        }
        Some(Self { columns: Rc::new(columns), ..self.clone() })
    }

    /// A key for the candidate in another `form`: no two candidates with different columns share one.
    pub fn name_in(&self, form: &Form) -> String {
        format!(
            "{} {:?} {form:?} {:?} {:?} {}",
            self.kind.name, self.joint, self.journal_starts, self.shown, self.forms
        )
    }

    /// Number of values in the columns of the candidate.
    pub fn column_entries(&self) -> usize {
        self.columns.iter().flatten().flatten().map(Vec::len).sum()
    }

    /// The candidate as one of `forms` forms.
    pub fn with_form_count(self, forms: usize) -> Self {
        Self { forms, ..self }
    }

    /// Number of coefficients.
    pub fn size(&self) -> usize {
        self.terms.len()
    }

    /// Bounds of the coefficients.
    pub fn limits(&self) -> Vec<[f64; 2]> {
        self.terms.iter().map(|term| [term.least, term.most]).collect()
    }

    /// Returns true for the same effect at the same place, in any form. Two events at different times are different effects.
    pub fn same_effect(&self, other: &Self) -> bool {
        self.kind.name == other.kind.name
            && self.joint == other.joint
            && (self.form.only == other.form.only || self.form.only.is_none() || other.form.only.is_none())
            && (!self.kind.happens() || overlap(&self.form.shape, &other.form.shape))
    }

    /// Returns true if no machine has both: they are the same effect, or each takes the whole clearance of the joint, or the whole spring and gap of
    /// its gear.
    pub fn excludes(&self, other: &Self) -> bool {
        let both = self.parts.iter().zip(other.parts).any(|(own, other)| *own && other);
        self.same_effect(other) || both && self.joint == other.joint
    }

    /// Returns true if both are events and their times overlap.
    pub fn happens_with(&self, other: &Self) -> bool {
        self.kind.happens() && other.kind.happens() && overlap(&self.form.shape, &other.form.shape)
    }

    /// Returns true if both have a column in a common channel; otherwise neither can replace the other.
    pub fn meets(&self, other: &Self) -> bool {
        self.channels.iter().any(|c| other.channels.contains(c))
    }

    /// Returns true if `other` is a special case of this kind at the same place.
    pub fn contains(&self, other: &Self) -> bool {
        self.joint == other.joint && self.kind.contains.iter().any(|(plainer, _)| *plainer == other.kind.name)
    }

    /// The fixed coefficients of a form with the values of most machines; `None` for a form with fitted coefficients.
    pub fn usual(&self) -> Option<Vec<f64>> {
        self.terms.iter().map(|term| term.usual.filter(|_| self.form.is_usual)).collect()
    }

    /// The form with the coefficients of most machines; `None` if the candidate has this form, or the law has no such coefficients.
    pub fn usual_form(&self) -> Option<Form> {
        let has_usual = self.terms.iter().all(|term| term.usual.is_some());
        let mut form = Form { is_usual: true, ..self.form.clone() };
        form.shape.remove(OPERATING_POINT);
        (has_usual && !self.form.is_usual).then_some(form)
    }

    /// The coefficients of all terms of the law, from those of the shown terms.
    pub fn all_coefficients(&self, coefficients: &[f64]) -> Vec<f64> {
        let usual = self.usual();
        let coefficients = usual.as_deref().unwrap_or(coefficients);
        let mut all = vec![0.0; self.all];
        self.shown.iter().zip(coefficients).for_each(|(&place, coefficient)| all[place] = *coefficient);
        all
    }

    /// The parameters of an arm file for these coefficients of the shown terms.
    pub fn parameters(&self, coefficients: &[f64]) -> Table {
        self.kind.compose(&self.form.shape, &self.all_coefficients(coefficients))
    }

    /// The table of an arm file that adds the effect with these coefficients of the shown terms.
    pub fn table(&self, arm: &Arm, coefficients: &[f64]) -> EffectTable {
        table(self.kind, self.joint, arm, self.parameters(coefficients))
    }

    /// The effect with these coefficients on `arm`; `None` if an arm file can't describe it.
    pub fn placed(&self, arm: &Arm, coefficients: &[f64]) -> Option<Placed> {
        Placed::new(&self.table(arm, coefficients), arm).ok()
    }

    /// The effect in the recording number `recording`, with the initial position of its journal there.
    pub fn placed_in(&self, arm: &Arm, coefficients: &[f64], recording: usize) -> Option<Placed> {
        let mut placed = self.placed(arm, coefficients)?;
        let journal_starts = self.journal_starts[recording].map(|place| Start::Within(place.eccentricity()));
        if let Some(effect) =
            journal_starts.and_then(|journal_starts| placed.effect.with_initial_state(journal_starts))
        {
            placed.effect = effect;
        }
        Some(placed)
    }

    /// The continuous parameters of the shape, which a search may vary.
    pub fn numbers(&self) -> Vec<String> {
        let is_number = |value: &Value| value.as_float().is_some_and(|x| x != 0.0 || self.kind.happens());
        let numbers =
            self.form.shape.iter().filter(|(name, value)| is_number(value) && self.kind.refines(name));
        numbers.map(|(name, _)| name.clone()).collect()
    }

    /// The form with each parameter of `along` changed by `step` in its direction: in its logarithm, or, for a time, in units of the duration of the
    /// event.
    pub fn moved(&self, data: &Data, along: &[(&str, f64)], step: f64) -> Form {
        let mut form = self.form.clone();
        let lasts = self.kind.happens().then(|| lasts(data, &form));
        for (name, way) in along {
            if let Some(Value::Float(value)) = form.shape.get_mut(*name) {
                match lasts {
                    Some(lasts) => *value += way * step * lasts,
                    None => *value *= (way * step).exp(),
                }
            }
        }
        form
    }

    /// Returns true if a column of the candidate has a row in the channel number `channel` that is not zero and has a weight.
    pub fn has_weight_in(&self, channel: usize, weights: &[Vec<f64>]) -> bool {
        let says = |rows: &Vec<f64>| rows.iter().zip(&weights[channel]).any(|(x, w)| x * w != 0.0);
        self.columns.iter().any(|column| column[channel].as_ref().is_some_and(says))
    }

    /// The form linearised at a point between the present point of linearisation and these coefficients of the shown terms; `share` is the fraction
    /// of this distance. `None` if the law has the same columns there.
    pub fn about(&self, coefficients: &[f64], share: f64) -> Option<Form> {
        if self.form.is_usual {
            return None;
        }
        let mut form = self.form.clone();
        if let [coefficient] = coefficients {
            let now = form.shape.get(OPERATING_POINT).and_then(Value::as_float).unwrap_or(0.0);
            form.shape.insert(OPERATING_POINT.to_owned(), Value::Float(now + share * (coefficient - now)));
            return (*coefficient != 0.0).then_some(form);
        }
        let mut around = self.all_coefficients(coefficients);
        if let Some(now) = &self.form.around {
            around.iter_mut().zip(now).for_each(|(x, now)| *x = now + share * (*x - now));
        }
        form.around = Some(around);
        (!self.kind.rough).then_some(form)
    }
}

/// The table of an arm file for `kind` at `joint` with `parameters`.
fn table(kind: &EffectKind, joint: Option<usize>, arm: &Arm, parameters: Table) -> EffectTable {
    let joint = joint.map(|joint| arm.joints()[joint].name.clone());
    EffectTable { kind: kind.name.to_owned(), joint, parameters, line: 0 }
}

/// The possible places of `kind` on an arm.
pub(crate) fn places(kind: &EffectKind, arm: &Arm) -> Vec<Option<usize>> {
    match kind.site {
        Site::Arm => vec![None],
        Site::Joint | Site::Revolute => {
            (0..arm.dof()).filter(|&joint| kind.fits(arm.joints().get(joint))).map(Some).collect()
        }
    }
}

/// Every effect that the recordings can show, in every form, and the effects that they can't show.
pub(crate) fn candidates(data: &Data, progress: &mut dyn FnMut(&str)) -> (Vec<Candidate>, Vec<Untestable>) {
    let (mut all, mut untestable) = (Vec::new(), Vec::new());
    let count = kinds().count();
    for (number, kind) in kinds().enumerate() {
        progress(&format!("computing the responses of possible effects: {} of {count} laws", number + 1));
        for joint in places(kind, data.arm()) {
            match at_place(data, kind, joint, None) {
                Ok((found, lacks)) => {
                    all.extend(found);
                    untestable.extend(lacks.map(|because| untestable_at(data, kind, joint, because)));
                }
                Err(because) => untestable.push(untestable_at(data, kind, joint, because)),
            }
        }
    }
    (all, untestable)
}

fn untestable_at(
    data: &Data,
    kind: &'static EffectKind,
    joint: Option<usize>,
    because: String,
) -> Untestable {
    let joint = joint.map(|joint| data.arm().joints()[joint].name.clone());
    Untestable { kind: kind.name, joint, because }
}

/// `kind` at `joint` in all its forms, and the lack of motion that keeps it from being distinguished. The error is the data that the recordings lack
/// if they show nothing of the effect.
pub(crate) fn at_place(
    data: &Data,
    kind: &'static EffectKind,
    joint: Option<usize>,
    torques: Option<&WhiteTorques>,
) -> Result<(Vec<Candidate>, Option<String>), String> {
    let lacks = |of: &dyn Fn(&Place, &LinearisedRecording) -> Option<String>| {
        let recordings = data.recordings.iter();
        let all: Option<Vec<String>> = recordings
            .map(|recording| of(&Place { scene: recording.baseline(kind).scene(), joint }, recording))
            .collect();
        all.and_then(|all| all.into_iter().next())
    };
    if let Some(because) = lacks(&|place, recording| kind.cannot_be_fitted(place, &recording.recorded())) {
        return Err(because);
    }
    let (mut found, mut refused) = (Vec::new(), None);
    for form in forms(data, kind, joint, torques) {
        match Candidate::new(data, kind, joint, form) {
            Ok(candidate) => found.extend(candidate),
            Err(error) => refused = Some(error.to_string()),
        }
    }
    if found.is_empty() {
        let because = refused.or_else(|| no_torque_of(data, joint));
        return Err(because.unwrap_or_else(|| "this motion does not show the effect".to_owned()));
    }
    let count = torques.filter(|_| kind.happens()).map_or(found.len(), |torques| torques.way_count(kind));
    found.iter_mut().for_each(|candidate| candidate.forms = count);
    Ok((found, lacks(&|place, recording| kind.missing(place, &recording.recorded()))))
}

/// The sentence that the torque of `joint` is no measurement in any recording: the same for all such joints.
fn no_torque_of(data: &Data, joint: Option<usize>) -> Option<String> {
    let is_stuck = |j| data.recordings.iter().all(|recording| recording.prepared.is_stuck(Kind::Torque(j)));
    joint.filter(|joint| is_stuck(*joint))?;
    let stuck: Vec<String> =
        (0..data.arm().dof()).filter(|j| is_stuck(*j)).map(|j| Group::Torque.column(j)).collect();
    let is = if stuck.len() > 1 { "are" } else { "is" };
    Some(format!("{} {is} no measurement", stuck.join(", ")))
}

/// Duration of the event with this `form`, s: until the end of its recording, if the event does not end.
pub(crate) fn lasts(data: &Data, form: &Form) -> f64 {
    match window(&form.shape) {
        Some([begin, end]) => end - begin,
        None => span(&data.recordings[form.only.unwrap_or(0)].motion().t),
    }
}

/// Returns true if the times of the shapes `one` and `other` overlap; a shape without an end overlaps all.
fn overlap(one: &Table, other: &Table) -> bool {
    match (window(one), window(other)) {
        (Some([from, to]), Some([begin, end])) => begin < to && from < end,
        _ => true,
    }
}

/// The forms of `kind` at `joint` for which the search has candidates.
fn forms(data: &Data, kind: &EffectKind, joint: Option<usize>, torques: Option<&WhiteTorques>) -> Vec<Form> {
    let shapes_of = |recording: &LinearisedRecording| {
        (kind.shapes)(&Place { scene: recording.baseline(kind).scene(), joint })
    };
    if !kind.happens() {
        return shapes_of(widest(data, kind, joint)).into_iter().map(Form::of).collect();
    }
    // Each recording has its own clock, and an event happens in one recording alone.
    let mut forms = Vec::new();
    for (index, recording) in data.recordings.iter().enumerate() {
        let at_times = torques.map(|torques| torques.shapes(data, kind, joint, index));
        let shapes = shapes_of(recording).into_iter().chain(at_times.into_iter().flatten());
        forms.extend(shapes.map(|shape| in_one_recording(data, shape, index)));
    }
    forms
}

/// The recording that covers most of what the shapes of `kind` at `joint` depend on: torques for a law of the load, else speeds. For the whole arm the first
/// recording.
fn widest<'c, 'a>(
    data: &'c Data<'a>,
    kind: &EffectKind,
    joint: Option<usize>,
) -> &'c LinearisedRecording<'a> {
    let is_of_load = kind.needs.iter().any(|need| matches!(need, Need::LoadRange(_)));
    let reach = |recording: &LinearisedRecording| {
        let greatest = |column: &[f64]| column.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let Some(joint) = joint else { return 0.0 };
        match recording.number_of(Kind::Torque(joint)).filter(|_| is_of_load) {
            Some(torque) => greatest(&recording.channels[torque].measured),
            None => greatest(&recording.motion().v[joint]),
        }
    };
    let first = &data.recordings[0];
    data.recordings
        .iter()
        .skip(1)
        .fold(first, |most, recording| if reach(recording) > reach(most) { recording } else { most })
}

/// Smallest share of a column's square that is independent of the columns before it in the same law, for the motion to show its term: above the
/// rounding error.
const OWN_SHARE: f64 = 1e-8;

/// The columns that are linearly independent of those before them.
fn independent(columns: &[Column]) -> Vec<usize> {
    let n = columns.len();
    let product = |i: usize, j: usize| -> f64 {
        let pairs = columns[i].iter().zip(&columns[j]);
        pairs.filter_map(|(a, b)| Some(dot(a.as_ref()?, b.as_ref()?))).sum()
    };
    let gram = DMatrix::from_fn(n, n, |i, j| if i <= j { product(i, j) } else { 0.0 });
    let gram = &gram + gram.transpose() - DMatrix::from_diagonal(&gram.diagonal());
    let mut found: Vec<usize> = Vec::new();
    for place in 0..n {
        let known = gram.select_rows(&found).select_columns(&found);
        let cross = DVector::from_iterator(found.len(), found.iter().map(|&k| gram[(k, place)]));
        let said = Cholesky::new(known).map_or(0.0, |factor| cross.dot(&factor.solve(&cross)));
        let whole = gram[(place, place)];
        if whole > 0.0 && whole - said > OWN_SHARE * whole {
            found.push(place);
        }
    }
    found
}

/// Returns true if `column`, with the largest coefficient of its `term`, is large enough to be measured: a force along the axis of a joint is a
/// rounding error.
fn is_seen(data: &Data, column: &Column, term: &Term) -> bool {
    let most = term.least.abs().max(term.most.abs());
    column.iter().enumerate().any(|(c, part)| {
        let (recording, channel) = data.place(c);
        let measured: f64 = data.recordings[recording].channels[channel].measured.iter().map(|x| x * x).sum();
        let said = part.as_ref().map_or(0.0, |rows| dot(rows, rows));
        said > 0.0 && said.sqrt() * most > FINEST * measured.sqrt()
    })
}

/// Returns true if `columns` of an event have active rows with it and without it, each for longer than the memory of the low-pass: an effect that
/// lasts from the first sample to the last is no event.
fn begins_or_ends(data: &Data, columns: &[Column]) -> bool {
    (0..data.channels()).any(|c| {
        let mask = data.active_mask(c);
        let parts: Vec<(&Vec<f64>, f64)> = columns
            .iter()
            .filter_map(|column| column[c].as_ref())
            .map(|part| (part, REMEMBERED * part.iter().fold(0.0_f64, |most, x| most.max(x.abs()))))
            .collect();
        let says = |row: usize| parts.iter().any(|(part, least)| part[row].abs() > *least);
        let (mut with, mut without) = (0.0, 0.0);
        for (stretch, step) in data.stretches(c) {
            for row in stretch.filter(|&row| mask[row] > 0.0) {
                *(if says(row) { &mut with } else { &mut without }) += step;
            }
        }
        let recording = &data.recordings[data.place(c).0];
        let memory = recording.prepared.treatment.filter().settling_time();
        with > 0.0 && without > memory && (with > memory || without > with)
    })
}

/// All terms of a law and their columns. The search for the journal starts near `journal_starts` in each recording, and stores its result there.
fn columns(
    data: &Data,
    (kind, joint): (&'static EffectKind, Option<usize>),
    form: &Form,
    journal_starts: &mut [Option<InBearing>],
) -> Result<(Vec<Term>, Vec<Column>), LawError> {
    let mut terms = Vec::new();
    let mut answers: Vec<Vec<Answer>> = Vec::new();
    let is_asked = |number: usize| form.only.is_none_or(|only| only == number);
    for (number, recording) in data.recordings.iter().enumerate() {
        if !(is_asked(number) || terms.is_empty() && number + 1 == data.recordings.len()) {
            answers.iter_mut().for_each(|answers| answers.push(vec![None; data.channels_per_recording()]));
            continue;
        }
        let terms_of_recording = recording.terms(
            (kind, joint),
            &form.shape,
            &data.nuisances[number],
            &mut journal_starts[number],
        )?;
        let (of_recording, mut said): (Vec<Term>, Vec<Answer>) = terms_of_recording.into_iter().unzip();
        if !is_asked(number) {
            said.iter_mut().for_each(|said| said.fill(None));
        }
        if terms.is_empty() {
            answers
                .resize_with(of_recording.len(), || vec![vec![None; data.channels_per_recording()]; number]);
            terms = of_recording;
        }
        answers.iter_mut().zip(said).for_each(|(answers, said)| answers.push(said));
    }
    let mut columns: Vec<Column> = answers.into_iter().map(|answers| data.column(answers)).collect();
    if let Some(around) = &form.around {
        take_around(data, (kind, joint), form, around, &mut columns)?;
    }
    Ok((terms, columns))
}

/// Adds to the `columns` of `kind` at `joint` the nonlinear remainder of the law at the coefficients `around`: the law minus the sum of the columns
/// with these coefficients. Each column takes its share of that sum.
fn take_around(
    data: &Data,
    (kind, joint): (&'static EffectKind, Option<usize>),
    form: &Form,
    around: &[f64],
    columns: &mut [Column],
) -> Result<(), LawError> {
    let parameters = kind.compose(&form.shape, around);
    let answer = |recording: &LinearisedRecording| -> Result<Answer, LawError> {
        recording
            .answer(&Placed::new(&table(kind, joint, recording.arm(), parameters.clone()), recording.arm())?)
    };
    let answers = data.recordings.iter().map(answer).collect::<Result<_, _>>()?;
    let mut beyond = data.column(answers);
    for (column, c) in columns.iter().zip(around) {
        for (beyond, part) in beyond.iter_mut().zip(column) {
            if let (Some(beyond), Some(part)) = (beyond, part) {
                beyond.iter_mut().zip(part).for_each(|(beyond, x)| *beyond -= c * x);
            }
        }
    }
    let square = |column: &Column| column.iter().flatten().flatten().map(|x| x * x).sum::<f64>();
    let said: Vec<f64> = columns.iter().zip(around).map(|(column, c)| c * square(column)).collect();
    let all: f64 = said.iter().zip(around).map(|(said, c)| said * c).sum();
    for (column, said) in columns.iter_mut().zip(said).filter(|_| all > 0.0) {
        for (part, beyond) in column.iter_mut().zip(&beyond) {
            if let (Some(part), Some(beyond)) = (part, beyond) {
                part.iter_mut().zip(beyond).for_each(|(x, beyond)| *x += said / all * beyond);
            }
        }
    }
    Ok(())
}
