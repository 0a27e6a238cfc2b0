//! The data of the pictures: every recording, point by point, inside and outside the fit.

use freeplay_laws::Trajectory;

use crate::data::parts::{Part, file_name};
use crate::data::stacked::Data;
use crate::findings::variables::{of_joint, time};
use crate::report::diagnosis::{Passage, Trace};

/// Residuals of every row under different models.
pub(crate) struct Remains {
    /// The model as given.
    pub before: Vec<Vec<f64>>,
    /// The model with its parameters tuned within their tolerances.
    pub retuned: Vec<Vec<f64>>,
    /// The model as given with all findings together, as an arm file has them.
    pub as_given: Vec<Vec<f64>>,
    /// The tuned model with all findings.
    pub after: Vec<Vec<f64>>,
    /// The tuned model with nameless shapes in place of the findings.
    pub nameless: Vec<Vec<f64>>,
}

/// The drawn values of every row, by channel.
pub(crate) struct Columns<'c> {
    /// Residuals under these models.
    pub remains: &'c Remains,
    /// Contribution of each finding, `[finding][channel]`.
    pub laws: Vec<Vec<Vec<f64>>>,
}

/// All passages: the fit and choice part of each recording, then the test part.
pub(crate) fn passages(data: &Data, columns: &Columns) -> Vec<Passage> {
    let sides = [(&[Part::Fit, Part::Choice][..], false), (&[Part::Test][..], true)];
    let mut all = Vec::new();
    for (parts, held_out) in sides {
        for index in 0..data.recordings.len() {
            let rows: Vec<usize> =
                (0..data.parts[index].len()).filter(|&row| parts.contains(&data.parts[index][row])).collect();
            if !rows.is_empty() {
                all.push(passage(data, columns, index, &rows, held_out));
            }
        }
    }
    all
}

/// The `rows` of recording number `index`.
fn passage(data: &Data, columns: &Columns, index: usize, rows: &[usize], held_out: bool) -> Passage {
    let recording = &data.recordings[index];
    let picked = |column: &[f64]| -> Vec<f64> { rows.iter().map(|&row| column[row]).collect() };
    let mut variables = vec![time(recording)];
    variables.extend((0..recording.arm().dof()).flat_map(|joint| of_joint(recording, joint)));
    for variable in &mut variables {
        variable.values = picked(&variable.values);
    }
    let traces = recording.channels.iter().enumerate().map(|(c, channel)| {
        let at = index * data.channels_per_recording() + c;
        let counted = |column: &[f64]| -> Vec<f64> {
            let counts = &data.counts[at];
            rows.iter().map(|&row| if counts[row] > 0.0 { column[row] } else { f64::NAN }).collect()
        };
        let law = |said: &Vec<Vec<f64>>| {
            if said[at].iter().any(|x| *x != 0.0) { counted(&said[at]) } else { Vec::new() }
        };
        Trace {
            channel: channel.name.clone(),
            unit: channel.unit,
            measured: picked(&channel.measured),
            before: counted(&columns.remains.before[at]),
            retuned: counted(&columns.remains.retuned[at]),
            after: counted(&columns.remains.after[at]),
            unnamed: counted(&columns.remains.nameless[at]),
            laws: columns.laws.iter().map(law).collect(),
        }
    });
    Passage {
        recording: file_name(recording),
        held_out,
        traces: traces.collect(),
        motion: part_of(recording.motion(), rows),
        variables,
    }
}

/// The `rows` of `motion`, with one stretch for each run of adjacent rows.
fn part_of(motion: &Trajectory, rows: &[usize]) -> Trajectory {
    let picked = |column: &Vec<f64>| -> Vec<f64> { rows.iter().map(|&row| column[row]).collect() };
    let columns = |all: &[Vec<f64>]| all.iter().map(picked).collect();
    let is_new = |row: usize| motion.stretches.iter().any(|stretch| stretch.start == row);
    let (mut stretches, mut begin) = (Vec::new(), 0);
    for at in 1..=rows.len() {
        if at == rows.len() || rows[at] != rows[at - 1] + 1 || is_new(rows[at]) {
            stretches.push(begin..at);
            begin = at;
        }
    }
    Trajectory {
        t: picked(&motion.t),
        q: columns(&motion.q),
        v: columns(&motion.v),
        a: columns(&motion.a),
        stretches,
    }
}
