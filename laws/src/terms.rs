//! The usual decompositions of an effect into terms.

use toml::Table;

use crate::basis::{Term, with};
use crate::kind::{Kind, Terms};
use crate::parameter::{Parameter, Range, Role};
use crate::place::Place;

impl Terms {
    /// The parameters of [`Role::Linear`] are the coefficients themselves, and the effect is proportional to each.
    pub const LINEAR: Terms = Terms { list: plain_terms, compose: plain_compose };

    /// The same for a sum with optional parts: no part is negative.
    pub const NON_NEGATIVE: Terms = Terms {
        list: |kind, place, shape| plain_terms(kind, place, shape).into_iter().map(Term::clamped).collect(),
        compose: plain_compose,
    };

    /// The same for an extra in addition to the arm file: the sum with the joint's friction must not be negative.
    pub const EXTRA_COULOMB: Terms = Terms {
        list: |kind, place, shape| {
            let named = place.joint().map_or(0.0, |joint| joint.friction.coulomb);
            bounded_below(plain_terms(kind, place, shape), -named)
        },
        compose: plain_compose,
    };

    /// The same for viscous friction.
    pub const EXTRA_VISCOUS: Terms = Terms {
        list: |kind, place, shape| {
            let named = place.joint().map_or(0.0, |joint| joint.friction.viscous);
            bounded_below(plain_terms(kind, place, shape), -named)
        },
        compose: plain_compose,
    };
}

fn bounded_below(mut terms: Vec<Term>, least: f64) -> Vec<Term> {
    for term in &mut terms {
        (term.least, term.held) = (term.least.max(least), least < 0.0);
    }
    terms
}

/// The parameters that are coefficients.
fn linear(kind: &Kind) -> impl Iterator<Item = (&'static Parameter, [f64; 2])> + '_ {
    kind.parameters.iter().filter_map(|parameter| match parameter.range {
        Range::Number { least, most, role: Role::Linear, .. } => Some((parameter, [least, most])),
        _ => None,
    })
}

fn plain_terms(kind: &Kind, place: &Place, shape: &Table) -> Vec<Term> {
    let unit = |name: &str| kind.unit(name, place.joint());
    let term = |(index, (parameter, range)): (usize, (&'static Parameter, [f64; 2]))| {
        // The largest power of ten up to 1 in the range.
        let step = 10_f64.powf(range[1].min(1.0).log10().floor());
        let coefficients: Vec<f64> =
            (0..linear(kind).count()).map(|i| if i == index { step } else { 0.0 }).collect();
        let plus = plain_compose(kind, shape, &coefficients);
        Term::new(parameter.name, unit(parameter.name), range, plus).stepped(step)
    };
    linear(kind).enumerate().map(term).collect()
}

fn plain_compose(kind: &Kind, shape: &Table, coefficients: &[f64]) -> Table {
    let values = linear(kind).zip(coefficients).map(|((parameter, _), &value)| (parameter.name, value));
    with(shape, values)
}
