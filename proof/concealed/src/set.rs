//! A set of cases: the number of each sort, drawn from one seed.

use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::arms::Machine;
use crate::case::{Case, Demand, GenerateError, Made, Severity, generate};
use crate::kinds::{CATALOGUE, OUTSIDE, seats};
use crate::random::{pick, stream};
use crate::sensors::Noise;

/// Rounds over all machines if none shows an effect with the requested strength.
const ROUNDS: usize = 3;

/// Number of cases of each sort.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Quota {
    /// One effect of the catalogue.
    pub single: usize,
    /// No effect.
    pub negative: usize,
    /// One effect outside the catalogue.
    pub unknown: usize,
    /// Two effects of the catalogue.
    pub double: usize,
}

impl Quota {
    /// The quota of a full proof.
    pub const FULL: Quota = Quota { single: 1080, negative: 300, unknown: 152, double: 156 };

    /// About `cases` cases in the shares of a small proof: of ten, five with one effect, two with none, two outside the catalogue, one
    /// with two.
    pub fn small(cases: usize) -> Self {
        let (negative, unknown, double) = (cases / 5, cases / 5, cases / 10);
        Self { single: cases - negative - unknown - double, negative, unknown, double }
    }

    /// All together.
    pub fn cases(&self) -> usize {
        self.single + self.negative + self.unknown + self.double
    }
}

/// Deals kinds, severities and noise levels evenly: every combination occurs once before any repeats.
struct Deck {
    cards: Vec<Card>,
    dealt: usize,
}

type Card = (&'static str, Severity, Noise);

impl Deck {
    fn new(kinds: &[&'static str], rng: &mut ChaCha8Rng) -> Self {
        // A round over all kinds has each once, in random order; severities and noise levels change from round to round.
        let mut shifts: Vec<usize> = (0..9).collect();
        shifts.shuffle(rng);
        let offsets: Vec<usize> = kinds.iter().map(|_| pick(rng, &[0, 1, 2, 3, 4, 5, 6, 7, 8])).collect();
        let mut cards = Vec::new();
        for shift in shifts {
            let mut round: Vec<Card> = kinds
                .iter()
                .zip(&offsets)
                .map(|(kind, offset)| {
                    let cell = (shift + offset) % 9;
                    (*kind, Severity::ALL[cell / 3], Noise::ALL[cell % 3])
                })
                .collect();
            round.shuffle(rng);
            cards.extend(round);
        }
        Self { cards, dealt: 0 }
    }

    fn deal(&mut self) -> Card {
        let card = self.cards[self.dealt % self.cards.len()];
        self.dealt += 1;
        card
    }
}

fn demand((kind, severity, _): Card) -> Demand {
    Demand { kind: kind.to_owned(), joint: None, severity }
}

/// The cases of `quota` from `seed`, in an uninformative order. Every effect of the catalogue occurs with every severity and noise level before any combination
/// repeats; so does every effect outside it.
///
/// # Errors
/// As [`Machine::data_sheet`].
pub fn draw_set(quota: &Quota, seed: u64) -> Result<Vec<Case>, GenerateError> {
    let mut rng = stream(seed, "set");
    let mut cases = Vec::new();
    let mut singles = Deck::new(&CATALOGUE, &mut rng);
    let mut add = |effects: Vec<Demand>, noise, hollow, rng: &mut ChaCha8Rng| {
        let machine = pick(rng, &machines(&effects)?);
        let seed = rng.random();
        cases.push(Case { machine, effects, family: None, noise, hollow, seed });
        Ok::<_, GenerateError>(())
    };
    for _ in 0..quota.single {
        let card = singles.deal();
        add(vec![demand(card)], card.2, false, &mut rng)?;
    }
    let mut others = Deck::new(&CATALOGUE, &mut rng);
    for _ in 0..quota.negative {
        let card = others.deal();
        add(vec![demand(card)], card.2, true, &mut rng)?;
    }
    let mut outside = Deck::new(&OUTSIDE, &mut rng);
    for _ in 0..quota.unknown {
        let card = outside.deal();
        add(vec![demand(card)], card.2, false, &mut rng)?;
    }
    let mut firsts = Deck::new(&CATALOGUE, &mut rng);
    let mut seconds = Deck::new(&CATALOGUE, &mut rng);
    for _ in 0..quota.double {
        let card = firsts.deal();
        let mut second = seconds.deal();
        while second.0 == card.0 {
            second = seconds.deal();
        }
        add(vec![demand(card), demand(second)], card.2, false, &mut rng)?;
    }
    cases.shuffle(&mut rng);
    Ok(cases)
}

/// The machines with a place for each of `effects`.
///
/// # Errors
/// [`GenerateError::NoPlace`] if no machine has; as [`Machine::data_sheet`].
fn machines(effects: &[Demand]) -> Result<Vec<Machine>, GenerateError> {
    let mut fits = Vec::new();
    for machine in Machine::ALL {
        let arm = machine.data_sheet()?;
        if effects.iter().all(|e| !seats(&e.kind, &arm).is_empty()) && arm.dof() >= effects.len() {
            fits.push(machine);
        }
    }
    match (fits.is_empty(), effects.first()) {
        (true, Some(effect)) => Err(GenerateError::NoPlace {
            kind: effect.kind.clone(),
            machine: Machine::Paper,
            joint: effect.joint,
        }),
        _ => Ok(fits),
    }
}

/// Makes `case`. If its machine can't show the effects as requested, tries other machines; if none can, tries all again with other motions, loads and
/// tolerances.
///
/// # Errors
/// As [`generate`], for the last machine.
pub fn make_case(case: &Case) -> Result<Made, GenerateError> {
    let mut rng = stream(case.seed, "other machines");
    let mut order = machines(&case.effects)?;
    order.retain(|machine| *machine != case.machine);
    order.shuffle(&mut rng);
    order.insert(0, case.machine);
    make_on(&order, case, &mut rng)
}

/// Makes `case` on its own machine only, at the requested joints.
///
/// # Errors
/// As [`generate`], for the last attempt over motions, loads and tolerances.
pub fn make_here(case: &Case) -> Result<Made, GenerateError> {
    make_on(&[case.machine], case, &mut stream(case.seed, "other benches"))
}

/// Makes `case` on the first suitable machine of `order`; repeats up to [`ROUNDS`] times.
fn make_on(order: &[Machine], case: &Case, rng: &mut ChaCha8Rng) -> Result<Made, GenerateError> {
    let mut case = case.clone();
    let mut made = generate(&case);
    for trial in 1..ROUNDS * order.len() {
        match made {
            Err(error) if !matches!(error, GenerateError::Model(_)) => {
                if trial % order.len() == 0 {
                    case.seed = rng.random();
                }
                case.machine = order[trial % order.len()];
                made = generate(&case);
            }
            done => return done,
        }
    }
    made
}

#[cfg(test)]
mod tests {
    use super::{Quota, draw_set};
    use crate::kinds::CATALOGUE;
    use std::collections::{BTreeMap, BTreeSet};

    /// Nine rounds of the catalogue hold every kind at every severity and noise level exactly once.
    #[test]
    fn kinds_severities_and_noise_are_dealt_evenly() {
        let quota = Quota { single: 9 * CATALOGUE.len(), ..Quota::default() };
        let cases = draw_set(&quota, 5).expect("cases");
        let mut seen = BTreeMap::new();
        for case in &cases {
            let key =
                (case.effects[0].kind.clone(), case.effects[0].severity.name(), format!("{:?}", case.noise));
            *seen.entry(key).or_insert(0) += 1;
        }
        assert_eq!(seen.len(), quota.single);
        assert!(seen.values().all(|count| *count == 1));
        let machines: BTreeSet<_> = cases.iter().map(|case| case.machine).collect();
        assert!(machines.len() >= 5, "{machines:?}");
    }

    #[test]
    fn the_seed_gives_the_set() {
        let quota = Quota::small(40);
        assert_eq!(quota.cases(), 40);
        assert_eq!(draw_set(&quota, 5).expect("cases"), draw_set(&quota, 5).expect("cases"));
        assert_ne!(draw_set(&quota, 5).expect("cases"), draw_set(&quota, 6).expect("cases"));
        assert_eq!(
            draw_set(&quota, 5).expect("cases").iter().filter(|case| case.hollow).count(),
            quota.negative
        );
    }
}
