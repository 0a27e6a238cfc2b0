//! The search for the effects that a given model with servos lacks. All parameters of the given model are fitted within their tolerances. The search adds
//! changes one after the other, each time the change with the smallest residual. It then removes the changes without which the recordings lose nothing.

use freeplay_servo::{Fitted, Noise, Problem, ServoArm, Track, Unknown, each, golden_section};

use super::alone::by_joint;
use super::burdens::Rival;
use super::changes::{Change, Given};
use super::findings::named_from;
use super::limits::lost;
use super::recorded::{Found, Recorded, is_same, stop};
use crate::sorting::sort_falling;
use crate::statistics::STRONG;

/// Changes that are fitted before the search takes the best of them, for each of its rankings: the first may rank first by chance, and a fit takes far longer
/// than a ranking.
const FITTED: usize = 2;

/// A model with changes, fitted.
#[derive(Clone, Debug)]
struct Changed {
    changes: Vec<Change>,
    fitted: Fitted,
    /// Parameters of the changes, and all other parameters within their tolerances.
    unknowns: Vec<Unknown>,
}

impl Changed {
    /// The unknowns; torques are divided by the stiffness.
    fn ratios(&self) -> Vec<Unknown> {
        let joints = &self.fitted.model.joints;
        self.unknowns.iter().map(|unknown| unknown.as_ratio(joints[unknown.joint].stiffness)).collect()
    }

    /// Logarithm of the typical residual, summed over all joints.
    fn size(&self) -> f64 {
        self.fitted.noise.size.iter().map(|size| size.ln()).sum()
    }

    /// True if this model and `other` have the same changes, in any order.
    fn has_same_changes(&self, other: &Changed) -> bool {
        let has = |change: &Change| self.changes.iter().any(|own| own.is_same(change));
        self.changes.len() == other.changes.len() && other.changes.iter().all(has)
    }
}

/// The search for changes.
struct Search<'a> {
    parts: [&'a Problem<'a>; 2],
    known: Vec<Unknown>,
    candidates: Vec<Change>,
    given: &'a ServoArm,
    /// The best fit so far of each set of changes. A descent may end in a local minimum; the search compares two models at the best known minimum of each.
    met: Vec<Changed>,
}

impl<'a> Search<'a> {
    /// A search in the fit and the choice part.
    fn new(parts: [&'a Problem<'a>; 2], given: &Given<'a>) -> Search<'a> {
        let (known, candidates) = (given.known(), given.candidates(parts[0]));
        Search { parts, known, candidates, given: given.model, met: Vec::new() }
    }

    /// The given model with the changes that the recordings demand, starting from those of `begun`.
    fn run(&mut self, begun: Option<Changed>, progress: &mut dyn FnMut(&str)) -> Changed {
        let mut changed = match begun {
            Some(begun) => self.fit(&begun.fitted.model, begun.changes, progress),
            None => self.fit(self.given, Vec::new(), progress),
        };
        // No change is added twice.
        for _ in 0..self.candidates.len() {
            let Some(more) = self.add(&mut changed, progress) else { break };
            changed = more;
        }
        while let Some(fewer) = self.drop(&mut changed, progress) {
            changed = fewer;
        }
        for index in 0..changed.changes.len() {
            changed.changes[index].rivals = self.rivals(&changed, index, progress);
        }
        changed
    }

    /// If change number `index` of `changed` belongs to the arm: the other causes that explain the recordings as well in its place.
    fn rivals(&self, changed: &Changed, index: usize, progress: &mut dyn FnMut(&str)) -> Vec<Rival> {
        let change = &changed.changes[index];
        if !change.is_burden() {
            return Vec::new();
        }
        let without = self.without(change, &changed.fitted.model);
        let is_new = |one: &&Change| one.is_burden() && !changed.changes.iter().any(|made| made.is_same(one));
        let new: Vec<&Change> = self.candidates.iter().filter(is_new).collect();
        let nearest = nearest(self.parts[0], &new, &without, &Far::Under(&changed.fitted.noise));
        let noise = &changed.fitted.noise;
        let total = |changed: &Changed, change: &Change| {
            self.left_in_both(changed, noise) + Search::price(change, changed)
        };
        let here = total(changed, change);
        let mut rivals = Vec::new();
        for (other, begin) in nearest {
            let mut changes = changed.changes.clone();
            changes[index] = other.clone();
            let unknowns = self.unknowns(&changes);
            let words = format!("fitting another cause instead of one of {} changes", changes.len());
            let fitted = self.parts[0]
                .fit(&begin, &unknowns, &mut |step, _| progress(&format!("{words}, step {step}")));
            let against = total(&Changed { changes, fitted, unknowns }, &other) - here;
            if against < STRONG {
                rivals.push(Rival { kind: other.kind, joint: other.joint, against });
            }
        }
        rivals
    }

    /// All unknowns of a model with `changes`.
    fn unknowns(&self, changes: &[Change]) -> Vec<Unknown> {
        let is_known = |unknown: &&Unknown| !changes.iter().any(|change| change.has(unknown));
        let known = self.known.iter().filter(is_known).copied();
        known.chain(changes.iter().flat_map(|change| change.unknowns.iter().copied())).collect()
    }

    /// Fits the given model with `changes`, starting from `model`, and returns this fit or an earlier one of the same changes if that is better.
    fn fit(&mut self, model: &ServoArm, changes: Vec<Change>, progress: &mut dyn FnMut(&str)) -> Changed {
        let unknowns = self.unknowns(&changes);
        let words = format!("fitting the given model with {} changes", changes.len());
        let fitted =
            self.parts[0].fit(model, &unknowns, &mut |step, _| progress(&format!("{words}, step {step}")));
        let changed = Changed { changes, fitted, unknowns };
        let Some(at) = self.met.iter().position(|known| known.has_same_changes(&changed)) else {
            self.met.push(changed.clone());
            return changed;
        };
        if self.is_nearer(&changed, &self.met[at]) {
            self.met[at] = changed.clone();
            return changed;
        }
        Changed { changes: changed.changes, ..self.met[at].clone() }
    }

    /// `model` without the numbers of `change` that the given model does not have, to begin a fit from.
    fn without(&self, change: &Change, model: &ServoArm) -> ServoArm {
        let mut model = model.clone();
        let is_known = |unknown: &&Unknown| self.known.iter().any(|known| known.is_same(unknown));
        let new = change.unknowns.iter().filter(|unknown| !is_known(unknown));
        new.for_each(|unknown| unknown.set(&mut model, unknown.of(self.given)));
        model
    }

    /// Returns true if `one` has a smaller loss than `other`; both have the same changes.
    fn is_nearer(&self, one: &Changed, other: &Changed) -> bool {
        let noise = nearer_noise(one, other);
        self.loss(one, noise) < self.loss(other, noise)
    }

    /// Loss of log-likelihood of the fit part under `changed`.
    fn loss(&self, changed: &Changed, noise: &Noise) -> f64 {
        self.parts[0].loss_of(&changed.fitted.model, noise, &changed.unknowns)
    }

    /// Loss of log-likelihood of the fit and the choice part under `changed`.
    fn left_in_both(&self, changed: &Changed, noise: &Noise) -> f64 {
        self.loss(changed, noise) + lost(self.parts[1], &changed.fitted.model, noise)
    }

    /// The value and the standard deviation of `unknown` in `changed`.
    fn value(unknown: &Unknown, changed: &Changed) -> (f64, f64) {
        let at = changed.unknowns.iter().position(|one| one.is_same(unknown));
        at.map_or((unknown.expected, unknown.deviation), |at| changed.fitted.values[at])
    }

    /// Log ratio of prior to posterior standard deviation, summed over the parameters of `change` (Occam's factor).
    fn price(change: &Change, changed: &Changed) -> f64 {
        let narrowed =
            |unknown: &Unknown| (unknown.deviation / Search::value(unknown, changed).1).ln().max(0.0);
        change.unknowns.iter().map(narrowed).sum::<f64>()
    }

    /// Log odds of `changed`, which has `change`, against `without` it: the loss of log-likelihood without the change minus its price. The odds are at most
    /// those of its parameter that deviates most from the given value, in units of tolerance and posterior deviation.
    fn evidence(&self, change: &Change, changed: &Changed, without: &Changed) -> f64 {
        // Under the larger noise of the poorer fit, all other differences would look alike, and its residual would look correlated.
        let noise = &changed.fitted.noise;
        let left = |changed: &Changed| self.left_in_both(changed, noise);
        let distance = |unknown: &Unknown| {
            let (value, deviation) = Search::value(unknown, changed);
            let known = self.known.iter().find(|known| known.is_same(unknown));
            let tolerance = known.map_or(0.0, |known| known.deviation);
            let given = unknown.of(self.given);
            // A limit that the given model lacks is infinitely far away.
            if given.is_finite() { (value - given) / deviation.hypot(tolerance) } else { f64::INFINITY }
        };
        let beyond = change.present().map(|unknown| 0.5 * distance(unknown).powi(2)).fold(0.0, f64::max);
        (left(without) - left(changed) - Search::price(change, changed)).min(beyond)
    }

    /// Adds one change to `changed`: the one with the smallest residual among those with enough evidence for a name. If a fit with one more change ends in a
    /// better minimum, the function first refits `changed` from there.
    fn add(&mut self, changed: &mut Changed, progress: &mut dyn FnMut(&str)) -> Option<Changed> {
        progress("searching for the change of the given model that explains most");
        let mut tried: Vec<(Changed, Change)> = Vec::new();
        for (change, begin) in self.promising(changed) {
            let changes = changed.changes.iter().cloned().chain([change.clone()]).collect();
            tried.push((self.fit(&begin, changes, progress), change));
        }
        let nearest = tried.iter().min_by(|a, b| a.0.size().total_cmp(&b.0.size()));
        if let Some((with, change)) = nearest.filter(|(with, _)| with.size() < changed.size()) {
            let begin = self.without(change, &with.fitted.model);
            *changed = self.fit(&begin, changed.changes.clone(), progress);
        }
        let mut best: Option<(Changed, Change)> = None;
        for (with, change) in tried {
            let evidence = self.evidence(&change, &with, changed);
            let is_better = best.as_ref().is_none_or(|(other, before)| {
                let noise = nearer_noise(&with, other);
                self.loss(&with, noise) + Search::price(&change, &with)
                    < self.loss(other, noise) + Search::price(before, other)
            });
            if is_better && evidence > named_from(self.given.joints.len()) {
                best = Some((with, change));
            }
        }
        best.map(|(with, _)| with)
    }

    /// The most promising changes beyond those of `changed`, each with a model to start its fit from. The function ranks them in three ways. With all other
    /// parameters as given, a cause shows that changes the whole motion. With all other parameters fitted, a cause shows that acts now and then. The parameters
    /// farthest beyond their tolerances point to a cause that other parameters imitate.
    fn promising(&self, changed: &Changed) -> Vec<(Change, ServoArm)> {
        let Fitted { model, noise, .. } = &changed.fitted;
        let given = changed.changes.iter().fold(self.given.clone(), |given, change| {
            let values: Vec<f64> = change.unknowns.iter().map(|unknown| unknown.of(model)).collect();
            change.placed(&given, &values)
        });
        let is_new = |one: &&Change| {
            !changed.changes.iter().any(|made| one.unknowns.iter().any(|unknown| made.has(unknown)))
        };
        let new: Vec<&Change> = self.candidates.iter().filter(is_new).collect();
        let beyond = |change: &Change| {
            let known = self.known.iter().filter(|known| change.has(known));
            known.map(|known| ((known.of(model) - known.expected) / known.deviation).powi(2)).sum::<f64>()
        };
        let hidden = new.iter().max_by(|a, b| beyond(a).total_cmp(&beyond(b)));
        let mut promising = nearest(self.parts[0], &new, &given, &Far::Usually);
        promising.extend(nearest(self.parts[0], &new, model, &Far::Under(noise)));
        promising.extend(hidden.map(|change| ((*change).clone(), model.clone())));
        promising
    }

    /// Removes the change with the least evidence from `changed` if that evidence is too small for a name. Otherwise the function stores in each change of
    /// `changed` its evidence.
    fn drop(&mut self, changed: &mut Changed, progress: &mut dyn FnMut(&str)) -> Option<Changed> {
        let mut least: Option<(f64, Changed)> = None;
        for index in 0..changed.changes.len() {
            let mut changes = changed.changes.clone();
            let dropped = changes.remove(index);
            let back: Vec<f64> = dropped.unknowns.iter().map(|unknown| unknown.of(self.given)).collect();
            let fewer = self.fit(&dropped.placed(&changed.fitted.model, &back), changes, progress);
            let evidence = self.evidence(&dropped, changed, &fewer);
            changed.changes[index].evidence = evidence;
            if least.as_ref().is_none_or(|(other, _)| evidence < *other) {
                least = Some((evidence, fewer));
            }
        }
        let named = named_from(self.given.joints.len());
        least.filter(|(evidence, _)| *evidence < named).map(|(_, fewer)| fewer)
    }
}

/// The distance between a model and the recorded positions.
enum Far<'a> {
    /// Sum over the joints of the logarithm of the typical residual: it finds the better of two models whose residuals have different noise.
    Usually,
    /// Loss of log-likelihood of the rows under this noise.
    Under(&'a Noise),
}

impl Far<'_> {
    /// Distance of the positions that `model` simulates from those recorded in `problem`. If `problem` holds a single joint of the arm, `alone` is the index of
    /// that joint.
    fn of(&self, problem: &Problem, model: &ServoArm, alone: Option<usize>) -> f64 {
        match (self, alone) {
            (Far::Usually, _) => {
                let noise = Noise::of(&problem.residuals(model), &problem.rounding);
                noise.size.iter().map(|size| size.ln()).sum()
            }
            (Far::Under(noise), Some(joint)) => lost(problem, model, &noise.alone(joint)),
            (Far::Under(noise), None) => lost(problem, model, noise),
        }
    }
}

/// The `changes` that bring `model` nearest to the recordings of `fit`, each with the changed model. A change of one joint is tried at that joint alone, while
/// the others follow their measured motion: no other error hides the change then.
fn nearest(fit: &Problem, changes: &[&Change], model: &ServoArm, far: &Far) -> Vec<(Change, ServoArm)> {
    let alone = by_joint(fit.tracks, &model.arm);
    let mut tried = each(changes.len(), fit.threads, |index| {
        let change = changes[index];
        let place = match change.joint.filter(|_| !change.is_burden()) {
            Some(joint) => {
                let fit = fit.alone(joint, &alone[joint]);
                let model = ServoArm::new(model.arm.clone(), vec![model.joints[joint]]);
                best_place(&change.of_first_joint(), &model, |model| far.of(&fit, model, Some(joint)))
            }
            None => {
                let fit = Problem { threads: 1, ..fit.clone() };
                best_place(change, model, |model| far.of(&fit, model, None))
            }
        };
        place.map(|(gain, place)| (gain, change.clone(), change.placed(model, &place)))
    });
    sort_falling(&mut tried, |one| one.as_ref().map_or(f64::NEG_INFINITY, |(gain, ..)| *gain));
    tried.into_iter().flatten().take(FITTED).map(|(_, change, model)| (change, model)).collect()
}

/// The values of `change` that bring `model` nearest, and the reduction of the distance. From the best tabulated place, a line search continues between its
/// neighbours, or along each parameter in turn.
fn best_place(change: &Change, model: &ServoArm, far: impl Fn(&ServoArm) -> f64) -> Option<(f64, Vec<f64>)> {
    let at = |place: &[f64]| far(&change.placed(model, place));
    let tried: Vec<f64> = change.places.iter().map(|place| at(place)).collect();
    let best = (0..tried.len()).min_by(|a, b| tried[*a].total_cmp(&tried[*b]))?;
    let mut place = (tried[best], change.places[best].clone());
    if change.is_along_a_line() {
        let [low, high] =
            [best.saturating_sub(1), (best + 1).min(tried.len() - 1)].map(|at| &change.places[at]);
        let between =
            |share: f64| low.iter().zip(high).map(|(a, b)| a + share * (b - a)).collect::<Vec<f64>>();
        let nearer = between(golden_section([0.0, 1.0], |share| at(&between(share))));
        let left = at(&nearer);
        if left < place.0 {
            place = (left, nearer);
        }
    } else {
        for number in 0..place.1.len() {
            place = nearer_along(number, place, &change.places, at);
        }
    }
    Some((far(model) - place.0, place.1))
}

/// Improves `place`, which holds a distance and parameters, in its parameter `number` alone. The search covers, in both directions, the largest value of this
/// parameter among `places`.
fn nearer_along(
    number: usize,
    place: (f64, Vec<f64>),
    places: &[Vec<f64>],
    left: impl Fn(&[f64]) -> f64,
) -> (f64, Vec<f64>) {
    let reach = places.iter().map(|other| other[number].abs()).fold(0.0, f64::max);
    let moved = |x: f64| {
        let mut moved = place.1.clone();
        moved[number] = x;
        moved
    };
    let here = place.1[number];
    let nearer = moved(golden_section([here - reach, here + reach], |x| left(&moved(x))));
    let there = left(&nearer);
    if there < place.0 { (there, nearer) } else { place }
}

/// The noise of the better of two fits: the noise of the poorer one would make both look alike.
fn nearer_noise<'a>(one: &'a Changed, other: &'a Changed) -> &'a Noise {
    if one.size() < other.size() { &one.fitted.noise } else { &other.fitted.noise }
}

/// The changes of the `given` model that the recordings demand.
pub fn changes(recorded: &Recorded, given: &ServoArm, progress: &mut dyn FnMut(&str)) -> Found {
    progress("looking for stops");
    let mut given = with_stops(recorded, given);
    let first = search(recorded, (&given, recorded.tracks), None, progress);
    progress("looking for contacts and stops");
    let events = recorded.events(&first.fitted, &first.unknowns);
    let is_stopped = events.iter().filter(|event| stop(&mut given, event)).count() > 0;
    // An event on the arm is no change of its model: the search continues without its rows.
    let undisturbed = recorded.undisturbed(events);
    let changed = if is_stopped || !is_same(&undisturbed, recorded.tracks) {
        search(recorded, (&given, &undisturbed), Some(first), progress)
    } else {
        first
    };
    let unknowns = changed.ratios();
    let [fit, _] = recorded.fit_and_choice(&undisturbed, &changed.fitted.model);
    let fitted = fit.fit(&changed.fitted.model, &unknowns, &mut |step, _| {
        progress(&format!("fitting the changed model, step {step}"));
    });
    drop(fit);
    let burdened = changed.changes.iter().filter(|change| change.is_burden()).map(Change::burdened).collect();
    Found { fitted, unknowns, burdened, changes: Some(changed.changes), undisturbed }
}

/// Searches `tracks` for the changes of `given`, beginning with those of `begun`.
fn search(
    recorded: &Recorded,
    (given, tracks): (&ServoArm, &[Track]),
    begun: Option<Changed>,
    progress: &mut dyn FnMut(&str),
) -> Changed {
    let begun = begun.map(|mut begun| {
        let joints = begun.fitted.model.joints.iter_mut().zip(&given.joints);
        joints.for_each(|(joint, given)| joint.stops = given.stops);
        begun
    });
    let [fit, choice] =
        recorded.fit_and_choice(tracks, begun.as_ref().map_or(given, |begun| &begun.fitted.model));
    Search::new([&fit, &choice], &recorded.given(given)).run(begun, progress)
}

/// `given` with the end stops that its residual in the recordings shows. A stop is no change of the model.
fn with_stops(recorded: &Recorded, given: &ServoArm) -> ServoArm {
    let mut given = given.clone();
    let [fit, _] = recorded.fit_and_choice(recorded.tracks, &given);
    // A joint has two.
    for _ in 0..2 * given.joints.len() {
        let known = recorded.given(&given).known();
        let events = recorded.events(&fit.unfitted(&given, &known), &known);
        if events.iter().filter(|event| stop(&mut given, event)).count() == 0 {
            break;
        }
    }
    given
}
