//! The film of a run: the arm from the side with its deviation magnified, and each journal in its bearing.

use freeplay_arm::{Arm, Workspace, forward_kinematics};
use freeplay_plant::IMPACT_LIMIT;
use freeplay_recording::Recording;
use freeplay_report::{Film, Moving, Scene};

use crate::columns::{path_columns, play_column};

/// One run in the film.
pub struct FilmedRun<'a> {
    /// Name of the run.
    pub name: &'a str,
    /// Recording of all its ticks.
    pub recording: &'a Recording,
}

/// Time between two frames while the contact does not change, s.
const CALM: f64 = 0.008;
/// Largest number of frames.
const MOST_FRAMES: usize = 3000;
/// Share of the picture for the greatest deviation.
const DEVIATION_SHARE: f64 = 0.12;
/// Number of earlier frames in the trail of a journal.
const TRAIL: usize = 40;
/// States of a journal, by the duration of its contact so far.
const STATES: [&str; 3] = ["free flight", "impact", "in contact"];

/// The film of `runs` of `arm`. Its journal `play`, of radial clearance `clearance` m, belongs to the joint with index `joint`.
/// Returns `None` if the recordings lack the necessary columns.
pub fn film(arm: &Arm, runs: &[FilmedRun], play: &str, joint: usize, clearance: f64) -> Option<Film> {
    let frames = frames(runs, play)?;
    let times: Vec<f64> = frames.iter().map(|&row| runs[0].recording.t[row]).collect();
    let (side, magnified) = side_view(arm, runs, joint, &frames)?;
    let mut film =
        Film::new(format!("The arm from the side and the journal of {play}, played over time"), times)
            .scene(side);
    for run in runs {
        film = film.scene(bearing(run, play, clearance, &frames)?);
    }
    // The first frame shows the drop of the centred journal, where most happens.
    film.first = frames.len().min(TRAIL).saturating_sub(1);
    film.caption = format!(
        "Pale: the desired arm. Coloured: the same arm, shifted from {play} on by {magnified} times the tool's deviation. The journal's centre moves \
         within the dashed circle, the clearance; on this circle, the two surfaces touch. While a journal flies or strikes, each tick is a frame; \
         while it rests, there is one frame every {:.0} ms.",
        CALM * 1e3
    );
    Some(film)
}

/// The rows of the frames: all ticks around flights and impacts, otherwise one every [`CALM`] seconds.
fn frames(runs: &[FilmedRun], play: &str) -> Option<Vec<usize>> {
    let rows = runs.iter().map(|run| run.recording.len()).min()?;
    let t = &runs.first()?.recording.t;
    let contact: Vec<&[f64]> = runs
        .iter()
        .map(|run| run.recording.column(&play_column(play, "contact_time")))
        .collect::<Option<_>>()?;
    let is_busy = |row: usize| contact.iter().any(|time| time[row] < IMPACT_LIMIT);
    let mut last = f64::NEG_INFINITY;
    let mut frames: Vec<usize> = (0..rows)
        .filter(|&row| {
            let is_frame = is_busy(row) || t[row] >= last + CALM;
            last = if is_frame { t[row] } else { last };
            is_frame
        })
        .collect();
    let every = frames.len().div_ceil(MOST_FRAMES).max(1);
    frames = frames.into_iter().step_by(every).collect();
    (!frames.is_empty()).then_some(frames)
}

/// The side view of the arm along a horizontal line, and the magnification of its deviation.
fn side_view(arm: &Arm, runs: &[FilmedRun], joint: usize, frames: &[usize]) -> Option<(Scene, f64)> {
    let mut workspace = Workspace::new(arm);
    let desired: Vec<Vec<[f64; 3]>> = frames
        .iter()
        .map(|&row| skeleton(arm, &mut workspace, runs[0].recording, row))
        .collect::<Option<_>>()?;
    let deviations: Vec<[&[f64]; 3]> =
        runs.iter().map(|run| deviation(run.recording)).collect::<Option<_>>()?;
    // The view is perpendicular to the main direction of the tool.
    let sum = |axis: usize| desired.iter().filter_map(|points| Some(points.last()?[axis])).sum::<f64>();
    let length = sum(0).hypot(sum(1)).max(f64::MIN_POSITIVE);
    let ahead = [sum(0) / length, sum(1) / length];
    let flat = |[x, y, z]: [f64; 3]| [x * ahead[0] + y * ahead[1], z];

    let plain: Vec<Vec<[f64; 2]>> =
        desired.iter().map(|points| points.iter().map(|&point| flat(point)).collect()).collect();
    let (x, y) = (extent(&plain, 0), extent(&plain, 1));
    let size = (x[1] - x[0]).max(y[1] - y[0]);
    let greatest = frames
        .iter()
        .flat_map(|&row| deviations.iter().map(move |axes| flat(axes.map(|axis| axis[row]))))
        .map(|[x, y]| x.hypot(y))
        .fold(0.0, f64::max);
    let magnified = round_down(DEVIATION_SHARE * size / greatest.max(f64::MIN_POSITIVE));
    let room = |[low, high]: [f64; 2]| [low - 0.15 * size, high + 0.15 * size];
    let mut scene = Scene {
        title: format!("From the side, deviation {magnified} ×"),
        x: room(x),
        y: room(y),
        ..Scene::default()
    };
    scene.moving.push(Moving { frames: plain.clone(), ..Moving::default() });
    for (run, axes) in runs.iter().zip(&deviations) {
        let shifted = frames.iter().zip(&plain).map(|(&row, points)| {
            let shift = flat(axes.map(|axis| axis[row] * magnified));
            let moved = |(place, &[x, y]): (usize, &[f64; 2])| {
                // Point 0 is the base, point k the origin of the link that joint number k - 1 moves.
                if place > joint { [x + shift[0], y + shift[1]] } else { [x, y] }
            };
            points.iter().enumerate().map(moved).collect()
        });
        scene.moving.push(Moving { name: run.name.to_owned(), frames: shifted.collect(), trail: 0 });
    }
    Some((scene, magnified))
}

/// Desired positions at `row` of the base, of the origins of all links and of the tool, m.
fn skeleton(
    arm: &Arm,
    workspace: &mut Workspace,
    recording: &Recording,
    row: usize,
) -> Option<Vec<[f64; 3]>> {
    let q: Vec<f64> = path_columns(recording)?.iter().map(|column| column[row]).collect();
    let tool = forward_kinematics(arm, workspace, &q).translation.vector;
    let links = (0..arm.dof()).map(|joint| workspace.link_pose(joint).translation.vector.into());
    Some(std::iter::once([0.0; 3]).chain(links).chain([tool.into()]).collect())
}

fn deviation(recording: &Recording) -> Option<[&[f64]; 3]> {
    Some([
        recording.column("deviation_x")?,
        recording.column("deviation_y")?,
        recording.column("deviation_z")?,
    ])
}

/// The journal of `run` in its bearing, mm.
fn bearing(run: &FilmedRun, play: &str, clearance: f64, frames: &[usize]) -> Option<Scene> {
    let column = |quantity: &str| run.recording.column(&play_column(play, quantity));
    let (first, second, contact) = (column("play_1")?, column("play_2")?, column("contact_time")?);
    let radius = clearance * 1e3;
    let circle = (0..72).map(|step| f64::from(step) * std::f64::consts::TAU / 72.0);
    let circle = circle.map(|angle| [radius * angle.cos(), radius * angle.sin()]).collect();
    let state = |&row: &usize| match contact[row] {
        time if time <= 0.0 => 0,
        time if time < IMPACT_LIMIT => 1,
        _ => 2,
    };
    let centres = frames.iter().map(|&row| vec![[first[row] * 1e3, second[row] * 1e3]]).collect();
    let view = [-1.15 * radius, 1.15 * radius];
    Some(Scene {
        title: format!("{}: journal in its bearing, {radius:.2} mm of clearance", run.name),
        x: view,
        y: view,
        still: vec![
            (circle, true),
            (vec![[-0.04 * radius, 0.0], [0.04 * radius, 0.0]], false),
            (vec![[0.0, -0.04 * radius], [0.0, 0.04 * radius]], false),
        ],
        moving: vec![Moving { name: run.name.to_owned(), frames: centres, trail: TRAIL }],
        states: STATES.map(str::to_owned).to_vec(),
        state: frames.iter().map(state).collect(),
    })
}

fn extent(frames: &[Vec<[f64; 2]>], axis: usize) -> [f64; 2] {
    let values = || frames.iter().flatten().map(|point| point[axis]);
    [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
}

/// The greatest of 1, 2 and 5 times a power of ten that is not above `value`.
fn round_down(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|&round| round <= value * (1.0 + 1e-9))
        .unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::round_down;

    #[test]
    fn a_magnification_is_a_round_number() {
        for (value, round) in [(1.0, 1.0), (4.9, 2.0), (5.0, 5.0), (99.0, 50.0), (234.0, 200.0), (0.3, 0.2)] {
            assert!((round_down(value) - round).abs() < 1e-12, "{value} became {}", round_down(value));
        }
    }
}
