//! Everything that might be missing: each kind of effect at each place in each shape, as a block of columns.

use freeplay_laws::{CATALOGUE, Kind as EffectKind, LawError, Place, Site, Term};
use toml::Table;

use super::case::Case;
use super::report::Untestable;
use super::system::{Block, Score, System};

/// One effect at one place in one shape.
pub(crate) struct Hypothesis {
    /// Its kind.
    pub kind: &'static EffectKind,
    /// Where; `None`: the arm as a whole.
    pub joint: Option<usize>,
    /// Its shape.
    pub shape: Table,
    /// Its terms, in the order of the block's columns.
    pub terms: Vec<Term>,
    /// Its columns.
    pub block: Block,
}

impl Hypothesis {
    /// Number of coefficients.
    pub fn size(&self) -> usize {
        self.terms.len()
    }

    /// The same effect at the same place.
    pub fn same_effect(&self, other: &Hypothesis) -> bool {
        self.kind.name == other.kind.name && self.joint == other.joint
    }

    /// Whether the coefficients of `score` are physical.
    pub fn is_physical(&self, score: &Score) -> bool {
        self.is_possible(score.beta.as_slice())
    }

    /// Whether these coefficients are physical.
    pub fn is_possible(&self, beta: &[f64]) -> bool {
        self.terms.iter().zip(beta).all(|(term, beta)| *beta >= term.least && *beta <= term.most)
    }

    /// Channels in which it shows.
    pub fn channels(&self) -> impl Iterator<Item = usize> + '_ {
        let channels = self.block.columns.first().map_or(0, Vec::len);
        (0..channels).filter(|&c| self.block.columns.iter().any(|column| column[c].is_some()))
    }
}

/// Where `kind` can sit on an arm.
pub(crate) fn places(kind: &EffectKind, arm: &freeplay_arm::Arm) -> Vec<Option<usize>> {
    match kind.site {
        Site::Arm => vec![None],
        Site::Joint | Site::Revolute => {
            (0..arm.dof()).filter(|&joint| kind.fits(arm.joints().get(joint))).map(Some).collect()
        }
    }
}

/// All hypotheses that the recordings of `case` can show, and those that they can't.
pub(crate) fn hypotheses(case: &Case, system: &System) -> (Vec<Hypothesis>, Vec<Untestable>) {
    let (mut all, mut untestable) = (Vec::new(), Vec::new());
    let arm = case.stages[0].arm();
    for kind in CATALOGUE {
        for joint in places(kind, arm) {
            let missing: Vec<String> = case
                .stages
                .iter()
                .filter_map(|stage| {
                    let place = Place { scene: stage.baseline(kind).scene(), joint };
                    kind.missing(&place, &stage.recorded())
                })
                .collect();
            if missing.len() == case.stages.len() {
                untestable.push(Untestable {
                    kind: kind.name,
                    joint: joint.map(|joint| arm.joints()[joint].name.clone()),
                    because: missing.into_iter().next().unwrap_or_default(),
                });
                continue;
            }
            let shapes = (kind.shapes)(&Place { scene: case.stages[0].baseline(kind).scene(), joint });
            let before = all.len();
            let mut refused = None;
            for shape in shapes {
                match hypothesis(case, system, kind, joint, shape) {
                    Ok(found) => all.extend(found),
                    Err(error) => refused = Some(error.to_string()),
                }
            }
            if all.len() == before {
                untestable.push(Untestable {
                    kind: kind.name,
                    joint: joint.map(|joint| arm.joints()[joint].name.clone()),
                    because: refused.unwrap_or_else(|| "this motion shows nothing of it".to_owned()),
                });
            }
        }
    }
    (all, untestable)
}

/// `kind` at `joint` in `shape`; `None` if it shows in no row that counts.
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
    let by_stage: Vec<_> =
        case.stages.iter().map(|stage| stage.terms(kind, joint, &shape)).collect::<Result<_, _>>()?;
    let terms: Vec<Term> = by_stage[0].iter().map(|(term, _)| term.clone()).collect();
    let columns: Vec<_> = (0..terms.len())
        .map(|index| case.column(by_stage.iter().map(|terms| terms[index].1.clone()).collect()))
        .collect();
    let seen = |column: &super::system::Column| column.iter().flatten().flatten().any(|x| *x != 0.0);
    let finite = |column: &super::system::Column| column.iter().flatten().flatten().all(|x| x.is_finite());
    if terms.is_empty() || !columns.iter().all(|column| seen(column) && finite(column)) {
        return Ok(None);
    }
    Ok(Some(Hypothesis { kind, joint, shape, terms, block: system.block(columns) }))
}
