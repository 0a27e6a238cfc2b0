//! Other choices of effects for a joint that the model stays far from: those of the search from the other start, and the laws that every joint has.
//!
//! What a search takes in first bends what it takes in next, joint by joint, and of a machine that follows no law of the catalogue closely a rare
//! law that says a little more of one motion says nothing of another.

use freeplay_laws::LawError;

use super::judge::{Judge, Sifted, size};
use super::search::{Chosen, Search, Standing};
use super::select::USUAL;
use super::trial::{Proof, proof};

/// The share of the error of one channel that rare laws of a joint have to take away of held-out data beside what sits on every joint, where the model
/// stays far off anyway.
const WORTH: f64 = 0.15;

/// From how many times the noise on what is left of a channel says that no law of the catalogue is followed closely there.
const VERY_FAR: f64 = 8.0;
/// What the model of a real machine often lacks besides.
const ROTOR: &str = "rotor_inertia";
/// The same as Coulomb friction beside an offset.
const ASYMMETRIC: &str = "asymmetric_friction";
/// Laws of a joint's torque that are rarer, and can stand in for one another in one motion.
const RARE: [&str; 10] = [
    "stribeck_friction",
    "presliding_friction",
    "load_dependent_friction",
    "position_dependent_friction",
    "friction_drift",
    "quadratic_drag",
    "torque_ripple",
    "torque_gain",
    "sensor_lowpass",
    "joint_coupling",
];

impl<'a, 'b> Judge<'a, 'b> {
    /// `best` with the laws that sit on every joint of a real machine, joint by joint where much is left: beside what was found there if that leaves
    /// less of the held-out data, and in the place of rarer laws if it leaves hardly more: of a machine that the model stays far from, a rare law
    /// that says a little more says nothing of another motion.
    pub(super) fn plainer(
        &self,
        mut best: Sifted,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Sifted, LawError> {
        for joint in 0..self.held.stages[0].arm().dof() {
            search.go_back(best.standing.clone());
            let at_joint =
                (0..search.hypotheses.len()).filter(|&at| search.is_at(joint, &USUAL, at)).collect();
            if search.has_friction_inside(joint) || self.where_is_left(VERY_FAR, search, at_joint)?.is_empty()
            {
                continue;
            }
            let rare = search.rare_at(joint);
            let mut plain: Option<Sifted> = None;
            for (with_rotor, all_of_it) in [(false, false), (true, false), (true, true)] {
                search.go_back(best.standing.clone());
                if search.make_plain(joint, with_rotor, all_of_it).is_none() {
                    continue;
                }
                let all = self.as_it_stands(search)?;
                let proven = self.drop_unproven(search, progress)?;
                for sifted in [all, proven].into_iter().flatten() {
                    plain = Some(sifted.or_smaller(plain));
                }
            }
            let worth = WORTH / self.held.per_stage().max(1) as f64;
            let most = best.size + if rare.is_empty() { -self.least_less() } else { worth };
            if let Some(plain) = plain.filter(|plain| plain.size < most) {
                let joint = &search.case.stages[0].arm().joints()[joint].name;
                let words: Vec<String> = rare.into_iter().map(|at| search.hypothesis_in_words(at)).collect();
                let instead = if words.is_empty() {
                    String::new()
                } else {
                    format!(" in the place of {}", words.join(", "))
                };
                progress(&format!("{joint} has what every joint has{instead}"));
                best = plain;
            }
        }
        Ok(best)
    }

    /// `best` with what `other` has at a joint in the place of its own, joint by joint, where that leaves less of the held-out data: what a
    /// search takes in first at one joint has nothing to do with what it takes in at another.
    pub(super) fn crossed(
        &self,
        mut best: Sifted,
        other: &Standing,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Sifted, LawError> {
        let joints = self.held.stages[0].arm().dof();
        for joint in (0..joints).map(Some).chain([None]) {
            let Some(child) = best.standing.crossed(other, joint, search) else { continue };
            search.go_back(child);
            if search.settle().is_none() {
                continue;
            }
            let least = best.size - self.least_less();
            if let Some(sifted) = self.drop_unproven(search, progress)?.filter(|sifted| sifted.size < least) {
                let at_joint = (0..search.chosen.len()).filter(|&index| search.named(index).joint == joint);
                let words: Vec<String> = at_joint.map(|index| search.in_words(index)).collect();
                progress(&format!(
                    "{} from the other start leaves less of the held-out data",
                    words.join(", ")
                ));
                best = sifted;
            }
        }
        Ok(best)
    }

    /// `best` without effects that neither the data of the fit nor held-out data are sure of: another choice at one joint leaves less to others.
    pub(super) fn without_idle(
        &self,
        mut best: Sifted,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Sifted, LawError> {
        loop {
            search.go_back(best.standing.clone());
            if search.update_gains().is_none() {
                return Ok(best);
            }
            let is_idle = |index: usize| search.is_idle(index) && best.proofs[index].gain.ci95[0] <= 0.0;
            let Some(index) = (0..best.proofs.len()).find(|&index| is_idle(index)) else {
                return Ok(best);
            };
            progress(&format!("{} says too little beside the others", search.in_words(index)));
            search.veto(index);
            if search.settle().is_none() {
                return Ok(best);
            }
            let Some(sifted) = self.as_it_stands(search)? else { return Ok(best) };
            best = sifted;
        }
    }

    /// What `search` has chosen, proven or not; `None` if a fit is singular.
    fn as_it_stands(&self, search: &Search<'a, 'b>) -> Result<Option<Sifted>, LawError> {
        let judged = self.tried(search, |trials| {
            let proofs: Option<Vec<Proof>> =
                (0..search.chosen.len()).map(|index| proof(trials, index, self.seed)).collect();
            size(trials, None).zip(proofs)
        })?;
        Ok(judged.map(|(size, proofs)| Sifted { size, standing: search.standing(), proofs }))
    }
}

impl Search<'_, '_> {
    /// The rare laws of `joint` that were taken in.
    fn rare_at(&self, joint: usize) -> Vec<usize> {
        let taken = self.chosen.iter().map(|it| it.hypothesis);
        taken.filter(|&at| self.is_at(joint, &RARE, at)).collect()
    }

    /// Whether a law that stays at `joint` has the friction of a joint inside, as that of a gap with friction behind it.
    fn has_friction_inside(&self, joint: usize) -> bool {
        let dry = self.hypotheses.iter().find(|one| one.joint == Some(joint) && one.kind.name == USUAL[0]);
        let holds = |at: usize| dry.is_some_and(|dry| self.hypotheses[at].contains(dry));
        let mut taken = self.chosen.iter().map(|it| it.hypothesis);
        taken.any(|at| holds(at) && !self.is_replaceable(joint, at))
    }

    /// Whether the hypothesis number `at` is a law of `joint` in whose place what sits on every joint may stand.
    fn is_replaceable(&self, joint: usize, at: usize) -> bool {
        self.is_at(joint, &RARE, at) || self.is_at(joint, &[ASYMMETRIC], at)
    }

    /// Puts what sits on every joint, with or without the inertia of a rotor, in the place of the rare laws of `joint`: all of it, or as far as it
    /// counts there.
    fn make_plain(&mut self, joint: usize, with_rotor: bool, all_of_it: bool) -> Option<()> {
        let stays = |it: &&Chosen| !self.is_replaceable(joint, it.hypothesis);
        let kept: Vec<Chosen> = self.chosen.iter().filter(stays).cloned().collect();
        let plain: Vec<usize> = (0..self.hypotheses.len())
            .filter(|&at| self.is_at(joint, &USUAL, at) || with_rotor && self.is_at(joint, &[ROTOR], at))
            .filter(|&at| kept.iter().all(|it| it.hypothesis != at))
            .collect();
        self.chosen = kept;
        let added: Vec<Chosen> = plain.iter().map(|&at| self.admit(at)).collect();
        self.chosen.extend(added);
        self.weigh_anew()?;
        while !all_of_it && self.drop_idle_of(&plain)? {}
        self.settle()
    }

    /// Drops the weakest of the `hypotheses` that were taken in, if it does not count; whether it did.
    fn drop_idle_of(&mut self, hypotheses: &[usize]) -> Option<bool> {
        self.update_gains()?;
        let is_of = |index: usize| hypotheses.contains(&self.chosen[index].hypothesis);
        let dropped = self.weakest(|index| is_of(index) && self.is_idle(index));
        if let Some(index) = dropped {
            self.chosen.remove(index);
        }
        Some(dropped.is_some())
    }

    /// Whether the hypothesis number `at` is one of `kinds` at `joint`.
    fn is_at(&self, joint: usize, kinds: &[&str], at: usize) -> bool {
        let hypothesis = &self.hypotheses[at];
        hypothesis.joint == Some(joint) && kinds.contains(&hypothesis.kind.name)
    }
}
