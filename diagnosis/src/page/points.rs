//! The points of a picture: the residual without an effect and with it, over the variable that shows the effect best.

use crate::findings::locate::BINS;
use crate::sorting::sort_rising;
use crate::{Diagnosis, Passage, Trace, Variable};

/// Least gain in the explained share for a variable later in the list to replace an earlier one: a picture does not show a difference of 3 %.
const CLEARLY: f64 = 0.03;
/// Share of the law that a single variable has to explain for drawing both directions as one: the rest, a third of the deviation, does not look like two
/// branches.
const ENOUGH: f64 = 0.9;
/// The quantities over which a law may be drawn. Of two that show it equally clearly, the program takes the first.
const QUANTITIES: [&str; 6] = ["velocity", "load", "position", "acceleration", "way", "time"];

/// One channel of all passages for the picture of one effect. All columns have the same length.
#[derive(Default)]
pub struct Points {
    /// Residual of the model with all findings.
    pub with: Vec<f64>,
    /// Contribution of this effect.
    pub law: Vec<f64>,
    /// True for points that the fit did not use.
    pub held_out: Vec<bool>,
}

impl Points {
    /// The points of the effect number `effect` in `channel`.
    pub fn of(diagnosis: &Diagnosis, effect: usize, channel: &str) -> Self {
        let mut points = Self::default();
        for (passage, trace) in traces(diagnosis, channel) {
            points.push(passage, &trace.after, &law(trace, effect));
        }
        points
    }

    /// Adds a passage.
    pub fn push(&mut self, passage: &Passage, with: &[f64], law: &[f64]) {
        self.with.extend_from_slice(with);
        self.law.extend_from_slice(law);
        self.held_out.extend(std::iter::repeat_n(passage.held_out, with.len()));
    }

    /// The residual without the effect: the partial residual of Larsen & McCleary 1972.
    pub fn without(&self) -> Vec<f64> {
        self.with.iter().zip(&self.law).map(|(with, law)| with + law).collect()
    }
}

/// The channel of every passage.
pub fn traces<'a>(diagnosis: &'a Diagnosis, channel: &str) -> impl Iterator<Item = (&'a Passage, &'a Trace)> {
    let named = channel.to_owned();
    diagnosis.passages.iter().filter_map(move |passage| {
        passage.traces.iter().find(|trace| trace.channel == named).map(|trace| (passage, trace))
    })
}

/// Contribution of an effect to a channel; zeros where it has none.
pub fn law(trace: &Trace, effect: usize) -> Vec<f64> {
    let said = trace.laws.get(effect).filter(|law| !law.is_empty());
    said.cloned().unwrap_or_else(|| vec![0.0; trace.after.len()])
}

/// A variable over all passages.
pub struct Over {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Its values.
    pub x: Vec<f64>,
    /// True where the joint moves forwards, if the picture separates the two directions.
    pub forwards: Option<Vec<bool>>,
}

/// The variable over which `law` shows most clearly, among the time and the variables of `joints`.
pub fn best_plot_variable(diagnosis: &Diagnosis, joints: &[usize], law: &[f64]) -> Option<Over> {
    let first = diagnosis.passages.first()?;
    let wanted = |v: &&Variable| v.joint.is_none_or(|joint| joints.contains(&joint));
    let mut names: Vec<&Variable> = first.variables.iter().filter(wanted).collect();
    names.retain(|variable| QUANTITIES.contains(&variable.quantity));
    names.sort_by_key(|variable| QUANTITIES.iter().position(|known| *known == variable.quantity));
    let whole: Vec<bool> = vec![true; law.len()];
    let tried: Vec<(Over, f64, f64, Vec<bool>)> = names
        .into_iter()
        .map(|variable| {
            let x = column(diagnosis, &variable.name);
            let joint = variable.joint.or_else(|| joints.first().copied());
            let forwards = joint.map_or_else(|| whole.clone(), |joint| forwards(diagnosis, joint));
            let (plain, split) = (explained(&x, law, &whole), explained(&x, law, &forwards));
            let over =
                Over { name: variable.name.clone(), unit: variable.unit.to_owned(), x, forwards: None };
            (over, plain, split, forwards)
        })
        .collect();
    let most = tried.iter().map(|(_, plain, ..)| *plain).fold(0.0, f64::max);
    let most_split = tried.iter().map(|(_, _, split, _)| *split).fold(0.0, f64::max);
    if most >= ENOUGH || most_split < most + CLEARLY {
        return tried.into_iter().find(|(_, plain, ..)| *plain >= most - CLEARLY).map(|(over, ..)| over);
    }
    let chosen = tried.into_iter().find(|(_, _, split, _)| *split >= most_split - CLEARLY);
    chosen.map(|(over, _, _, forwards)| Over { forwards: Some(forwards), ..over })
}

/// The variable called `name`, over all passages.
pub fn column(diagnosis: &Diagnosis, name: &str) -> Vec<f64> {
    let of = |passage: &Passage| {
        let found = passage.variables.iter().find(|variable| variable.name == name);
        found.map_or_else(|| vec![f64::NAN; passage.motion.len()], |variable| variable.values.clone())
    };
    diagnosis.passages.iter().flat_map(of).collect()
}

/// True where `joint` moves forwards, over all passages.
pub fn forwards(diagnosis: &Diagnosis, joint: usize) -> Vec<bool> {
    let passages = diagnosis.passages.iter();
    passages.flat_map(|passage| passage.motion.v[joint].iter().map(|v| *v >= 0.0)).collect()
}

/// Share of the variance of `y` that means over bins of `x` explain, separately for the two groups; 1 if y is constant.
fn explained(x: &[f64], y: &[f64], group: &[bool]) -> f64 {
    let seen = |k: &usize| x[*k].is_finite() && y[*k].is_finite();
    let counted: Vec<usize> = (0..x.len().min(y.len())).filter(seen).collect();
    let mean = counted.iter().map(|&k| y[k]).sum::<f64>() / counted.len().max(1) as f64;
    let all: f64 = counted.iter().map(|&k| (y[k] - mean).powi(2)).sum();
    let square: f64 = counted.iter().map(|&k| y[k].powi(2)).sum();
    if all <= 1e-9 * square {
        return 1.0;
    }
    let mut between = 0.0;
    for side in [false, true] {
        let mut order: Vec<usize> = counted.iter().copied().filter(|&k| group[k] == side).collect();
        sort_rising(&mut order, |&k| x[k]);
        for bin in order.chunks(order.len().div_ceil(BINS).max(1)) {
            let of_bin = bin.iter().map(|&k| y[k]).sum::<f64>() / bin.len() as f64;
            between += bin.len() as f64 * (of_bin - mean).powi(2);
        }
    }
    between / all
}

/// The law as a line over x: its means over up to `bins` bins of equal count.
pub fn line(x: &[f64], law: &[f64], which: impl Fn(usize) -> bool, bins: usize) -> (Vec<f64>, Vec<f64>) {
    let seen = |k: &usize| x[*k].is_finite() && law[*k].is_finite() && which(*k);
    let mut order: Vec<usize> = (0..x.len().min(law.len())).filter(seen).collect();
    sort_rising(&mut order, |&k| x[k]);
    let mean = |bin: &[usize], column: &[f64]| bin.iter().map(|&k| column[k]).sum::<f64>() / bin.len() as f64;
    let chunks = order.chunks(order.len().div_ceil(bins).max(1));
    chunks.map(|bin| (mean(bin, x), mean(bin, law))).unzip()
}

#[cfg(test)]
mod tests {
    use super::{explained, line};

    /// v alone explains y = sign(v); y = |x| sign(v) also needs the direction.
    #[test]
    fn a_law_is_plain_over_its_own_variable_only() {
        let t: Vec<f64> = (0..20_000).map(|k| f64::from(k) * 0.1).collect();
        let v: Vec<f64> = t.iter().map(|t| t.cos()).collect();
        let load: Vec<f64> = t.iter().map(|t| (0.37 * t).sin()).collect();
        let whole = vec![true; t.len()];
        let forwards: Vec<bool> = v.iter().map(|v| *v >= 0.0).collect();
        let dry: Vec<f64> = v.iter().map(|v| v.signum()).collect();
        let butterfly: Vec<f64> = load.iter().zip(&v).map(|(load, v)| load.abs() * v.signum()).collect();
        let found = [
            explained(&v, &dry, &whole),
            explained(&load, &dry, &whole),
            explained(&load, &butterfly, &whole),
            explained(&load, &butterfly, &forwards),
        ];
        println!("{found:?}");
        assert!(found[0] > 0.9 && found[1] < 0.3 && found[2] < 0.3 && found[3] > 0.95);
    }

    #[test]
    fn the_line_of_a_law_lies_on_it() {
        let x: Vec<f64> = (0..1000).map(|k| f64::from(k * 617 % 1000) / 1000.0).collect();
        let y: Vec<f64> = x.iter().map(|x| 3.0 * x).collect();
        let (at, mean) = line(&x, &y, |_| true, 40);
        assert_eq!(at.len(), 40);
        assert!(at.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(at.iter().zip(&mean).all(|(x, y)| (y - 3.0 * x).abs() < 1e-12));
    }
}
