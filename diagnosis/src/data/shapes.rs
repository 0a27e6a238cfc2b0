//! Nameless shapes, flexible enough for any law of position, speed, load, acceleration and the distance since the last reversal. They measure how much error
//! can be explained at all, and serve as the black box with which the report compares the findings.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::data::columns::dot;
use crate::data::linearised::LinearisedRecording;
use crate::data::stacked::Data;
use crate::data::tolerance::Nuisance;
use crate::signals::channel::Kind;
use crate::sorting::sort;

/// Knots of the hat functions in position: enough to separate a law with a period of half the range from one without.
const KNOTS: usize = 8;
/// Knots of the hat functions in speed and load: laws of friction have one bend in each direction, which three inner knots resolve.
const SPEED_KNOTS: usize = 5;
/// Knots of the hat functions in time: they resolve events and drifts to a sixteenth of the recording.
const MOMENTS: usize = 16;
/// Trial ridges, as shares of each column's square, in decades. The smallest leaves the shapes almost free, and only bounds them where the motion hardly
/// separates columns. The largest suppresses the shapes.
const RIDGES: [f64; 7] = [1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0];

/// Positions of the knots of a joint's hat functions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Knots {
    position: Vec<f64>,
    load: Vec<f64>,
    speed: Vec<f64>,
    reach: f64,
    /// Places, each with its number and its range of the joint's position.
    places: Vec<(usize, [f64; 2])>,
}

impl Knots {
    /// Knots for every joint of `recording`.
    pub fn of(recording: &LinearisedRecording) -> Vec<Knots> {
        let joints = 0..recording.arm().dof();
        joints
            .map(|joint| {
                let (q, v) = (&recording.motion().q[joint], &recording.motion().v[joint]);
                let speed: Vec<f64> = v.iter().map(|v| v.abs()).collect();
                let position = quantiles(q, KNOTS);
                let reach = position[position.len() - 1] - position[0];
                let load = quantiles(&recording.load()[joint], SPEED_KNOTS);
                let speed = quantiles(&speed, SPEED_KNOTS);
                Knots { load, speed, reach: reach.max(1e-12), position, places: Vec::new() }
            })
            .collect()
    }

    /// Adds shapes that act only at the place with this `number`: where the joint is in this `range` of positions.
    pub fn add_place(&mut self, number: usize, range: [f64; 2]) {
        self.places.push((number, range));
    }
}

/// The shapes of one channel.
pub(crate) struct Shapes {
    columns: Vec<Vec<f64>>,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl Shapes {
    /// The shapes of channel number `channel` of `data`, for a fit to the rows where `mask` is one.
    pub fn new(data: &Data, channel: usize, mask: &[f64], knots: &[Knots]) -> Self {
        let (recording, of_recording) = data.place(channel);
        let of = &data.recordings[recording];
        let mut columns = raw_columns(of, &data.nuisances[recording], of_recording, mask, knots);
        let mut moments = hats(&of.motion().t, &quantiles(&of.motion().t, MOMENTS));
        keep(&mut moments, mask);
        columns.extend(moments);
        normalised(&mut columns);
        Self { factor: factor(gram(&columns), RIDGES[0]), columns }
    }

    /// `residual` minus the fitted shapes.
    pub fn residual(&self, residual: &[f64]) -> Vec<f64> {
        let mut left = residual.to_vec();
        let Some(factor) = &self.factor else { return left };
        let right = DVector::from_iterator(self.columns.len(), self.columns.iter().map(|c| dot(c, residual)));
        for (column, beta) in self.columns.iter().zip(factor.solve(&right).iter()) {
            left.iter_mut().zip(column).for_each(|(left, x)| *left -= beta * x);
        }
        left
    }
}

/// Divides each of `columns` by its norm, and returns the norms.
fn normalised(columns: &mut [Vec<f64>]) -> Vec<f64> {
    let divided = columns.iter_mut().map(|column| {
        let size = dot(column, column).sqrt().max(f64::MIN_POSITIVE);
        column.iter_mut().for_each(|x| *x /= size);
        size
    });
    divided.collect()
}

/// The shapes of channels that measure the same quantity in each recording, with common coefficients for all recordings.
pub(crate) struct CommonShapes {
    channels: Vec<usize>,
    /// Mask of the rows, channel after channel.
    counts: Vec<f64>,
    /// The columns over the same rows, each with norm one.
    columns: Vec<Vec<f64>>,
    /// The original norms of the columns.
    sizes: Vec<f64>,
    /// The number of the only place where a column acts; `None` if it acts everywhere.
    places: Vec<Option<usize>>,
    gram: DMatrix<f64>,
}

impl CommonShapes {
    /// The shapes of `channels`, for a fit to the rows where `masks` is one.
    pub fn new(data: &Data, channels: Vec<usize>, masks: &[Vec<f64>], knots: &[Knots]) -> Self {
        let of_channels: Vec<Vec<Vec<f64>>> =
            channels.iter().map(|&c| Self::of(data, c, &masks[c], knots)).collect();
        let count = of_channels.first().map_or(0, Vec::len);
        let mut columns: Vec<Vec<f64>> = (0..count)
            .map(|k| of_channels.iter().flat_map(|columns| columns[k].iter().copied()).collect())
            .collect();
        let sizes = normalised(&mut columns);
        let counts = channels.iter().flat_map(|&c| masks[c].iter().copied()).collect();
        let of_places = match channels.first().map(|&c| data.kind(c)) {
            Some(Kind::Torque(joint)) => knots[joint].places.iter().map(|(number, _)| *number).collect(),
            _ => Vec::new(),
        };
        let everywhere = count - PER_PLACE * of_places.len();
        let of_places = of_places.into_iter().flat_map(|number| [Some(number); PER_PLACE]);
        let places = std::iter::repeat_n(None, everywhere).chain(of_places).collect();
        Self { gram: gram(&columns), channels, counts, columns, sizes, places }
    }

    fn of(data: &Data, channel: usize, mask: &[f64], knots: &[Knots]) -> Vec<Vec<f64>> {
        let (recording, of_recording) = data.place(channel);
        let of = &data.recordings[recording];
        let mut columns = raw_columns(of, &[], of_recording, mask, knots);
        if let Kind::Torque(joint) = of.channels[of_recording].kind {
            let mut at_places = of_places(of, joint, &knots[joint]);
            keep(&mut at_places, mask);
            columns.extend(at_places);
        }
        columns
    }

    /// Log of the probability of `residual` under the shapes that act everywhere and those of `places`, up to a constant that is the same for any residual.
    pub fn evidence(&self, residual: &[Vec<f64>], places: &[usize]) -> f64 {
        self.most_probable(residual, places).evidence
    }

    /// The prediction of the shapes that act everywhere, by channel and row. Their coefficients are fitted to `residual`, with the prior size of shapes that
    /// makes its rows most probable.
    pub fn prediction(&self, data: &Data, residual: &[Vec<f64>], knots: &[Knots]) -> Vec<(usize, Vec<f64>)> {
        let beta = self.most_probable(residual, &[]).beta;
        let of_channel = |&c: &usize| {
            let mut said = vec![0.0; data.counts[c].len()];
            let columns = Self::of(data, c, &data.counts[c], knots);
            for ((column, size), beta) in columns.iter().zip(&self.sizes).zip(beta.iter()) {
                said.iter_mut().zip(column).for_each(|(said, x)| *said += beta / size * x);
            }
            (c, said)
        };
        self.channels.iter().map(of_channel).collect()
    }

    /// The coefficients for `residual` of the columns that act everywhere, then of those of `places`. The ridge makes the rows most probable (MacKay 1992,
    /// Neural Comput. 4:415), with the noise integrated out.
    fn most_probable(&self, residual: &[Vec<f64>], places: &[usize]) -> Probable {
        let acts = |column: &usize| self.places[*column].is_none_or(|place| places.contains(&place));
        let acting: Vec<usize> = (0..self.columns.len()).filter(acts).collect();
        let rows = self.channels.iter().flat_map(|&c| residual[c].iter());
        let target: Vec<f64> = rows.zip(&self.counts).map(|(x, counts)| x * counts).collect();
        let right =
            DVector::from_iterator(acting.len(), acting.iter().map(|&k| dot(&self.columns[k], &target)));
        let gram = DMatrix::from_fn(acting.len(), acting.len(), |i, j| self.gram[(acting[i], acting[j])]);
        let (square, rows) = (dot(&target, &target), self.counts.iter().sum::<f64>());
        let with = |ridge: f64| {
            let factor = factor(gram.clone(), ridge)?;
            let beta = factor.solve(&right);
            let left = (square - right.dot(&beta)).max(f64::MIN_POSITIVE);
            let volume: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
            let evidence = 0.5 * acting.len() as f64 * ridge.ln() - volume - 0.5 * rows * left.ln();
            Some(Probable { beta, evidence })
        };
        let none = Probable {
            beta: DVector::zeros(acting.len()),
            evidence: -0.5 * rows * square.max(f64::MIN_POSITIVE).ln(),
        };
        let best = RIDGES.into_iter().filter_map(with).max_by(|a, b| a.evidence.total_cmp(&b.evidence));
        best.unwrap_or(none)
    }
}

/// Coefficients, and the log of the probability of the fitted rows.
struct Probable {
    beta: DVector<f64>,
    evidence: f64,
}

/// Inner products of all pairs of `columns`.
fn gram(columns: &[Vec<f64>]) -> DMatrix<f64> {
    let mut gram = DMatrix::zeros(columns.len(), columns.len());
    for (i, one) in columns.iter().enumerate() {
        for (j, other) in columns[..=i].iter().enumerate() {
            let product = dot(one, other);
            (gram[(i, j)], gram[(j, i)]) = (product, product);
        }
    }
    gram
}

fn factor(mut gram: DMatrix<f64>, ridge: f64) -> Option<Cholesky<f64, Dyn>> {
    (0..gram.nrows()).for_each(|k| gram[(k, k)] += ridge);
    Cholesky::new(gram)
}

/// The columns of a channel, with the rows without weight set to zero: the same number and order on every recording of an arm.
fn raw_columns(
    recording: &LinearisedRecording,
    nuisances: &[Nuisance],
    channel: usize,
    kept: &[f64],
    knots: &[Knots],
) -> Vec<Vec<f64>> {
    let mut columns = match recording.channels[channel].kind {
        Kind::Torque(joint) => of_torque(recording, joint, &knots[joint]),
        Kind::Tool(axis) => of_tool(recording, axis),
        Kind::Link(joint) | Kind::Position(joint) => {
            of_joint(recording, joint, &vec![1.0; recording.motion().len()])
        }
    };
    let nothing = || vec![0.0; recording.motion().len()];
    columns.extend(nuisances.iter().map(|nuisance| nuisance.answer[channel].clone().unwrap_or_else(nothing)));
    keep(&mut columns, kept);
    columns
}

/// Sets the rows of `columns` outside the mask `kept` to zero.
fn keep(columns: &mut [Vec<f64>], kept: &[f64]) {
    for column in columns {
        column.iter_mut().zip(kept).for_each(|(x, kept)| *x *= kept);
    }
}

/// Columns of a torque: position, speed, load, acceleration, reversals, and the other joints' speeds.
fn of_torque(recording: &LinearisedRecording, joint: usize, knots: &Knots) -> Vec<Vec<f64>> {
    let motion = recording.motion();
    let v = &recording.whole().v[joint];
    let mut columns = hats(&motion.q[joint], &knots.position);
    columns.extend(hats(&recording.load()[joint], &knots.load));
    let speeds: Vec<f64> = v.iter().map(|v| v.abs()).collect();
    let sign: Vec<f64> = v.iter().map(|v| v.signum()).collect();
    let mut with_sign = |shape: &[f64]| columns.push(recording.treated(&product(shape, &sign)));
    hats(&speeds, &knots.speed).iter().for_each(|hat| with_sign(hat));
    with_sign(&recording.whole_load()[joint].iter().map(|load| load.abs()).collect::<Vec<_>>());
    let way = way_since_reversal(&recording.whole().q[joint], v);
    for scale in [0.003, 0.03] {
        with_sign(&way.iter().map(|way| (-way / (scale * knots.reach)).exp()).collect::<Vec<_>>());
    }
    columns.push(motion.a[joint].clone());
    columns.extend(motion.v.iter().cloned());
    columns
}

/// Columns of each place: a hat at either end of its range, and both multiplied by the sign of the speed.
const PER_PLACE: usize = 4;

/// For each place of `joint`, hat functions at the two ends of its range, alone and multiplied by the sign of the joint's speed.
fn of_places(recording: &LinearisedRecording, joint: usize, knots: &Knots) -> Vec<Vec<f64>> {
    let sign: Vec<f64> = recording.whole().v[joint].iter().map(|v| v.signum()).collect();
    let of_place = |&(_, [least, most]): &(usize, [f64; 2])| {
        let wide = (most - least).max(f64::MIN_POSITIVE);
        let hats = hats(&recording.whole().q[joint], &[least - wide, least, most, most + wide]);
        let [_, first, last, _] = <[Vec<f64>; PER_PLACE]>::try_from(hats).unwrap_or_default();
        let signed = [product(&first, &sign), product(&last, &sign)];
        [first, last].into_iter().chain(signed).map(|shape| recording.treated(&shape)).collect::<Vec<_>>()
    };
    knots.places.iter().flat_map(of_place).collect()
}

fn product(one: &[f64], other: &[f64]) -> Vec<f64> {
    one.iter().zip(other).map(|(one, other)| one * other).collect()
}

/// Columns of the tool: offsets of every joint, mapped to the tool.
fn of_tool(recording: &LinearisedRecording, axis: usize) -> Vec<Vec<f64>> {
    let points = recording.motion().len();
    let mut columns = vec![vec![1.0; points]];
    for joint in 0..recording.arm().dof() {
        let mut shift = vec![vec![0.0; points]; recording.arm().dof()];
        shift[joint].fill(1e-4);
        let answer = recording.rigid_answer(recording.arm(), Some(&shift));
        let seen = recording.channels.iter().position(|channel| channel.kind == Kind::Tool(axis));
        if let Some(lever) = seen.and_then(|seen| answer[seen].clone()) {
            columns.extend(of_joint(recording, joint, &lever));
        }
    }
    columns
}

/// Columns of a joint, each times `lever`: constant, position, load, sign of the load, speed and sign of the speed.
fn of_joint(recording: &LinearisedRecording, joint: usize, lever: &[f64]) -> Vec<Vec<f64>> {
    let (q, v) = (&recording.motion().q[joint], &recording.motion().v[joint]);
    let load = &recording.load()[joint];
    let sign: Vec<f64> = recording.whole().v[joint].iter().map(|v| v.signum()).collect();
    let pull: Vec<f64> = recording.whole_load()[joint].iter().map(|load| load.signum()).collect();
    let shapes = [
        vec![1.0; q.len()],
        q.iter().map(|q| q.sin()).collect(),
        q.iter().map(|q| q.cos()).collect(),
        load.clone(),
        v.clone(),
        recording.treated(&sign),
        recording.treated(&pull),
    ];
    shapes.iter().map(|shape| shape.iter().zip(lever).map(|(shape, lever)| shape * lever).collect()).collect()
}

/// Distance travelled since the last change of direction, on all grid points.
pub(crate) fn way_since_reversal(q: &[f64], v: &[f64]) -> Vec<f64> {
    let (mut turned_at, mut last) = (q.first().copied().unwrap_or(0.0), 0.0);
    q.iter()
        .zip(v)
        .map(|(&q, &v)| {
            if v * last < 0.0 {
                turned_at = q;
            }
            if v != 0.0 {
                last = v;
            }
            (q - turned_at).abs()
        })
        .collect()
}

/// `count` quantiles of `x`, without those that are nearly the same.
fn quantiles(x: &[f64], count: usize) -> Vec<f64> {
    let mut sorted = x.to_vec();
    sort(&mut sorted);
    if sorted.is_empty() {
        return vec![0.0];
    }
    let reach = sorted[sorted.len() - 1] - sorted[0];
    let mut knots: Vec<f64> = (0..count).map(|k| sorted[k * (sorted.len() - 1) / (count - 1)]).collect();
    knots.dedup_by(|a, b| *a - *b <= 1e-3 * reach);
    knots
}

/// Hat functions on `knots`: they add up to one everywhere; the outermost are constant beyond their knots.
fn hats(x: &[f64], knots: &[f64]) -> Vec<Vec<f64>> {
    let hat = |k: usize, x: f64| {
        let up = k.checked_sub(1).map_or(1.0, |j| (x - knots[j]) / (knots[k] - knots[j]));
        let down = knots.get(k + 1).map_or(1.0, |next| (next - x) / (next - knots[k]));
        up.min(down).clamp(0.0, 1.0)
    };
    (0..knots.len()).map(|k| x.iter().map(|&x| hat(k, x)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::{hats, quantiles, way_since_reversal};

    #[test]
    fn hats_add_up_to_one() {
        let x: Vec<f64> = (0..500).map(|k| (0.037 * f64::from(k)).sin() * 3.0).collect();
        let hats = hats(&x, &quantiles(&x, 7));
        assert!(hats.len() > 4);
        let worst = (0..x.len())
            .map(|k| (hats.iter().map(|hat| hat[k]).sum::<f64>() - 1.0).abs())
            .fold(0.0, f64::max);
        println!("off by {worst:.1e}");
        assert!(worst < 1e-12);
        assert!(hats.iter().flatten().all(|h| (0.0..=1.0).contains(h)));
    }

    #[test]
    fn the_way_begins_anew_at_each_reversal() {
        let q = [0.0, 1.0, 2.0, 1.5, 0.5, 1.0];
        let v = [1.0, 1.0, 1.0, -1.0, -1.0, 1.0];
        assert_eq!(way_since_reversal(&q, &v), [0.0, 1.0, 2.0, 0.0, 1.0, 0.0]);
    }
}
