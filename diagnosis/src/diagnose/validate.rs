//! Cross-validation inside the data of the fit: an effect has to say something of stretches of motion that its coefficients were not
//! fitted to. A wrong law fitted to the leavings of another seldom does.
//!
//! Source: Stone 1974, J. Roy. Stat. Soc. B 36:111; in blocks, since neighbouring samples are alike (Burman, Chow & Nolan 1994). A part
//! is every fifth block of each recording: a contiguous fifth may well be all there is of some position.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::bounded::bounded;
use super::columns::dot;
use super::search::Search;
use super::show::rms;

/// From so many recordings on, a part is a recording: another motion is a harder test than another stretch of the same.
const LEAST_RECORDINGS: usize = 3;
/// Number of parts, each of which is predicted from the others.
const PARTS: usize = 5;
/// Blocks of a recording for each part.
const BLOCKS: usize = 4;
/// An effect that acts to this share in one part alone can't be judged by the others: a push, a drift that is over.
const LOCAL: f64 = 0.7;
/// Share of an effect's own weight that a channel must carry to count as one in which it shows.
const SHOWS: f64 = 0.1;

/// Share of the rows up to which an effect is local in time, and the least share of the squares there that it has to take away.
const BRIEF: f64 = 0.4;
const STRONG: f64 = 0.5;

/// While what happens in one recording alone acts, it leaves no more than this share of the squares: nothing refutes it elsewhere.
const PLAIN: f64 = 0.25;

/// Whether the effect number `index`, if it acts for a short time only, explains most of what is missing then: any leavings can be
/// had a little smaller by a push at the right moment. `None` if a fit is singular.
pub(crate) fn is_brief_and_weak(search: &Search, index: usize) -> Option<bool> {
    let acts = Acting::of(search, index)?;
    Some(acts.share < BRIEF && acts.left > 1.0 - STRONG)
}

/// Whether the effect number `index` explains nearly all that is missing while it acts. `None` if a fit is singular.
pub(crate) fn is_plain(search: &Search, index: usize) -> Option<bool> {
    Some(Acting::of(search, index)?.left < PLAIN)
}

/// An effect while it acts.
struct Acting {
    /// Share of the rows of its channels in which it says anything.
    share: f64,
    /// Share of the weighed squares there that it leaves.
    left: f64,
}

impl Acting {
    /// Of the effect number `index`; `None` if a fit is singular.
    fn of(search: &Search, index: usize) -> Option<Self> {
        let (system, named) = (&search.system, search.named(index));
        let with = system.residual(&system.fit(&search.active(None))?);
        let without = system.residual(&system.fit(&search.active(Some(index)))?);
        let (mut acts, mut all, mut before, mut after) = (0.0, 0.0, 0.0, 0.0);
        for channel in named.channels() {
            for row in 0..with[channel].len() {
                all += 1.0;
                let said =
                    |column: &super::columns::Column| column[channel].as_ref().map_or(0.0, |part| part[row]);
                if named.block.columns.iter().any(|column| said(column) != 0.0) {
                    acts += 1.0;
                    before += system.weights[channel] * without[channel][row].powi(2);
                    after += system.weights[channel] * with[channel][row].powi(2);
                }
            }
        }
        Some(Self { share: acts / all, left: after / before })
    }
}

/// A channel that is less than this many times above the noise floor may hold nothing but noise: twins stay below 1.2.
const ABOVE_FLOOR: f64 = 1.3;

/// Whether there is more than noise to explain in any channel in which the effect number `index` shows. `None` if the fit is singular.
pub(crate) fn is_above_the_floor(search: &Search, index: usize) -> Option<bool> {
    let without = search.system.residual(&search.system.fit(&search.active(Some(index)))?);
    let above = |c: usize| rms(&without[c], &search.case.kept[c]) > ABOVE_FLOOR * search.null.floor[c];
    Some(search.named(index).channels().any(above))
}

/// Inner products of one part in one channel.
struct Piece {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
}

/// The parts of the data of a fit, in inner products of the nuisances and of all effects that were taken in.
pub(crate) struct Validation {
    /// `[part][channel]`.
    pieces: Vec<Vec<Piece>>,
    /// Normal matrix and right side of all parts but one, priors included.
    others: Vec<(DMatrix<f64>, DVector<f64>)>,
    weights: Vec<f64>,
    limits: Vec<[f64; 2]>,
    /// Places of the columns of each effect.
    effects: Vec<Vec<usize>>,
    /// Squares that the columns of each effect leave in each part and channel, weighed: `[effect][part][channel]`.
    said: Vec<Vec<Vec<f64>>>,
    errors: Vec<f64>,
}

impl Validation {
    /// Predicts every part from the others; `None` if a fit is singular.
    pub fn of(search: &Search) -> Option<Self> {
        let active = search.active(None);
        let fit = search.system.fit(&active)?;
        let place = |column: &usize| active.iter().position(|a| a == column);
        let effects: Vec<Vec<usize>> =
            search.chosen.iter().map(|chosen| chosen.columns.iter().filter_map(place).collect()).collect();
        let pieces = pieces(search, &active);
        let weights = search.system.weights.clone();
        let square = |effect: &Vec<usize>, piece: &Piece| -> f64 {
            let pairs = effect.iter().flat_map(|&i| effect.iter().map(move |&j| (i, j)));
            pairs.map(|(i, j)| fit.eta[i] * piece.gram[(i, j)] * fit.eta[j]).sum()
        };
        let said = effects
            .iter()
            .map(|effect| {
                let of_part = |part: &Vec<Piece>| {
                    part.iter().zip(&weights).map(|(piece, weight)| weight * square(effect, piece)).collect()
                };
                pieces.iter().map(of_part).collect()
            })
            .collect();
        let precision: Vec<f64> = active.iter().map(|&a| search.system.precision[a]).collect();
        let others = (0..pieces.len()).map(|part| without(part, &pieces, &weights, &precision)).collect();
        let limits = search.system.limits(&active);
        let mut validation = Self { pieces, others, weights, limits, effects, said, errors: Vec::new() };
        validation.errors = validation.errors_without(None)?;
        Some(validation)
    }

    /// Squares that are left in each channel when every part is predicted from the others, without the effect number `left_out`.
    fn errors_without(&self, left_out: Option<usize>) -> Option<Vec<f64>> {
        let out: &[usize] = left_out.map_or(&[], |index| &self.effects[index]);
        let all = self.limits.len();
        let kept: Vec<usize> = (0..all).filter(|k| !out.contains(k)).collect();
        let limits: Vec<[f64; 2]> = kept.iter().map(|&k| self.limits[k]).collect();
        let mut errors = vec![0.0; self.weights.len()];
        for (part, (normal, right)) in self.pieces.iter().zip(&self.others) {
            let normal = normal.select_rows(&kept).select_columns(&kept);
            let eta = bounded(&normal, &right.select_rows(&kept), &limits)?.eta;
            let mut whole = DVector::zeros(all);
            kept.iter().zip(&eta).for_each(|(&k, eta)| whole[k] = *eta);
            for (error, piece) in errors.iter_mut().zip(part) {
                let right = piece.right.select_rows(&kept);
                let said = (&piece.gram * &whole).select_rows(&kept);
                *error += (piece.square - 2.0 * eta.dot(&right) + eta.dot(&said)).max(0.0);
            }
        }
        Some(errors)
    }

    /// Share of the error that the effect number `index` takes away where it shows; `None` if it can't be judged.
    pub fn gain(&self, index: usize) -> Option<f64> {
        let by_part: Vec<f64> = self.said[index].iter().map(|part| part.iter().sum()).collect();
        let all: f64 = by_part.iter().sum();
        if by_part.iter().any(|part| *part > LOCAL * all) {
            return None;
        }
        let by_channel: Vec<f64> =
            (0..self.weights.len()).map(|c| self.said[index].iter().map(|part| part[c]).sum()).collect();
        let strongest = by_channel.iter().copied().fold(0.0, f64::max);
        let without = self.errors_without(Some(index))?;
        let over = |errors: &[f64]| -> f64 {
            let channels = (0..errors.len()).filter(|&c| by_channel[c] > SHOWS * strongest);
            channels.map(|c| self.weights[c] * errors[c]).sum()
        };
        let before = over(&without);
        (before > 0.0).then(|| 1.0 - (over(&self.errors) / before).sqrt())
    }

    /// Sum of the logarithms of the errors of all channels: the same change of any channel counts the same.
    pub fn size(&self) -> f64 {
        self.errors.iter().filter(|error| **error > 0.0).map(|error| 0.5 * error.ln()).sum()
    }
}

/// Normal matrix and right side of all `pieces` but those of the part number `part`, with the `precision` of the columns' priors.
fn without(
    part: usize,
    pieces: &[Vec<Piece>],
    weights: &[f64],
    precision: &[f64],
) -> (DMatrix<f64>, DVector<f64>) {
    let n = precision.len();
    let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    let others = pieces.iter().enumerate().filter(|(other, _)| *other != part);
    for (piece, weight) in others.flat_map(|(_, pieces)| pieces.iter().zip(weights)) {
        normal.zip_apply(&piece.gram, |sum, product| *sum += weight * product);
        right.axpy(*weight, &piece.right, 1.0);
    }
    for (i, precision) in precision.iter().enumerate() {
        normal[(i, i)] = normal[(i, i)] * (1.0 + 1e-9) + precision + f64::MIN_POSITIVE;
    }
    (normal, right)
}

/// Whether a part is a recording: there are enough of them, and nothing is fitted to each by itself.
fn is_by_recording(search: &Search) -> bool {
    let mut nuisances = search.case.nuisances.iter().flatten();
    search.case.stages.len() >= LEAST_RECORDINGS && !nuisances.any(|nuisance| nuisance.free)
}

/// Inner products of the columns `active` by part and channel.
fn pieces(search: &Search, active: &[usize]) -> Vec<Vec<Piece>> {
    let system = &search.system;
    let n = active.len();
    let by_recording = is_by_recording(search);
    let parts = if by_recording { search.case.stages.len() } else { PARTS };
    let piece = |part: usize, channel: usize| {
        let rows = system.target[channel].len();
        let ranges: Vec<Range<usize>> = if by_recording {
            (search.case.place(channel).0 == part).then_some(0..rows).into_iter().collect()
        } else {
            let blocks = PARTS * BLOCKS;
            let of_part = (0..blocks).filter(|block| block % PARTS == part);
            of_part.map(|block| block * rows / blocks..(block + 1) * rows / blocks).collect()
        };
        let pick = |column: &[f64]| -> Vec<f64> {
            ranges.iter().flat_map(|range| column[range.clone()].iter().copied()).collect()
        };
        let y = pick(&system.target[channel]);
        let columns: Vec<Option<Vec<f64>>> =
            active.iter().map(|&a| system.base[a][channel].as_ref().map(|x| pick(x))).collect();
        let (mut gram, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (i, left) in columns.iter().enumerate() {
            let Some(left) = left else { continue };
            right[i] = dot(left, &y);
            for (j, other) in columns.iter().enumerate().take(i + 1) {
                let Some(other) = other else { continue };
                gram[(i, j)] = dot(left, other);
                gram[(j, i)] = gram[(i, j)];
            }
        }
        Piece { gram, right, square: dot(&y, &y) }
    };
    (0..parts).map(|part| (0..system.target.len()).map(|channel| piece(part, channel)).collect()).collect()
}
