//! From a specification to the table of the joints' motion.

use std::path::Path;

use freeplay_arm::Arm;

use crate::planning::error::{HIGHEST_RATE, PathError};
use crate::planning::file::{Content, Rows};
use crate::planning::laps::Laps;
use crate::planning::nodes::{Grid, Nodes};
use crate::planning::path_tracking::{FEWEST_JOINTS, Lost, Tracker};
use crate::planning::sine::{self, Swing};
use crate::planning::spline::{Ends, Spline};
use crate::planning::start::{explain, start_posture};
use crate::planning::table::JointPath;
use crate::planning::tool::ToolPath;
use crate::spec::{PathKind, PathSpec, Size, check_duration};

/// Sampling rate of the sharp square's joint path, Hz.
const SHARP_RATE: f64 = 4000.0;
/// Most samples of a lap of the sharp square.
const MOST_SAMPLES: f64 = 240_000.0;
/// Least number of intervals of a smooth piece of a built-in path.
const FEWEST_INTERVALS: f64 = 8.0;

impl JointPath {
    /// Plans the joints' motion along `spec` for ticks of `rate_hz`.
    ///
    /// Arms of six joints and more follow position and orientation of the tool, arms of three to five its position. The branch is that of
    /// `spec.start`; without it, the branch of the solution found from the middle of the joints' ranges, or else the branch farthest from
    /// the limits. Nodes lie at a quarter of a tick, closer for short laps, and at 1/240 000 of a lap that is longer than 60 000 ticks. The
    /// table stores a lap once if it brings the arm back to its first posture; otherwise (redundant arms, endless rotation) it contains
    /// every lap.
    ///
    /// # Errors
    /// [`PathError`] with the time, the point, the joint and the remedy.
    pub fn plan(arm: &Arm, spec: &PathSpec, rate_hz: f64) -> Result<JointPath, PathError> {
        if !(rate_hz > 0.0 && rate_hz <= HIGHEST_RATE) {
            return Err(PathError::Rate { value: rate_hz });
        }
        spec.validate()?;
        if let Some(start) = &spec.start
            && start.len() != arm.dof()
        {
            return Err(PathError::StartLength { found: start.len(), expected: arm.dof() });
        }
        if let (PathKind::File, Some(file)) = (spec.kind, &spec.file) {
            return plan_file(arm, spec, file, rate_hz);
        }
        match ToolPath::of(spec) {
            Some(path) => {
                let grid = Grid::new(rate_hz, spec.period, FEWEST_INTERVALS);
                let exact = follow(arm, spec.start.as_deref(), &path, grid, rate_hz)?;
                match spec.kind {
                    PathKind::SquareSharp => {
                        sampled(arm, &exact, Grid::new(rate_hz, spec.period, 1.0), rate_hz)
                    }
                    _ => Ok(exact),
                }
            }
            None => swing(arm, spec, rate_hz),
        }
    }
}

fn plan_file(arm: &Arm, spec: &PathSpec, file: &Path, rate: f64) -> Result<JointPath, PathError> {
    let mut rows = Rows::read(file, arm.dof(), spec.laps)?;
    check_duration(spec.laps, rows.span())?;
    rows.repeat(spec.laps)?;
    let spline = Spline::through(
        rows.names.len(),
        rows.times.clone(),
        std::mem::take(&mut rows.values),
        Ends::Natural,
    );
    let grid = Grid::new(rate, rows.span(), 1.0);
    let planned = match rows.content {
        Content::Joints => tabulate(arm, &spline, grid, rate, 1),
        Content::Positions | Content::Poses => {
            let path = ToolPath::through(spline, rows.content == Content::Poses, spec);
            follow(arm, spec.start.as_deref(), &path, grid, rate)
        }
    };
    planned.map_err(|error| error.in_rows(&rows))
}

/// A joint path through rows of joint positions.
fn tabulate(arm: &Arm, spline: &Spline, grid: Grid, rate: f64, laps: u32) -> Result<JointPath, PathError> {
    let knots = spline.times();
    let mut nodes = Nodes::new(arm);
    for (piece, ends) in knots.windows(2).enumerate() {
        fill(&mut nodes, grid.times(ends[0], ends[1]), |joint, t| spline.evaluate(piece, joint, t))?;
    }
    let lap = knots[knots.len() - 1];
    Ok(nodes.into_path(rate, Laps { lap, count: laps }))
}

/// The sharp square by its definition: the cubic spline through the joints' positions at 4 kHz. It rounds the jumps of the acceleration
/// over a sample or two and overshoots them by a few percent, as a sampled reference does.
fn sampled(arm: &Arm, exact: &JointPath, grid: Grid, rate: f64) -> Result<JointPath, PathError> {
    let laps = exact.laps();
    let samples = (laps.lap * SHARP_RATE).round().clamp(4.0, MOST_SAMPLES);
    let times: Vec<f64> = (0..=samples as u64).map(|k| k as f64 * laps.lap / samples).collect();
    let dof = arm.dof();
    let [mut q, mut v, mut a] = [0, 1, 2].map(|_| vec![0.0; dof]);
    let mut values = Vec::with_capacity(times.len() * dof);
    for &t in &times[..times.len() - 1] {
        exact.at(t, &mut q, &mut v, &mut a);
        values.extend_from_slice(&q);
    }
    // The last sample belongs to this lap, not to the next.
    values.extend_from_slice(exact.lap_end());
    let spline = Spline::through(dof, times, values, Ends::NotAKnot);
    tabulate(arm, &spline, grid, rate, laps.count)
}

/// A sine motion of every joint.
fn swing(arm: &Arm, spec: &PathSpec, rate: f64) -> Result<JointPath, PathError> {
    let amplitude = match spec.size {
        Some(Size::One(amplitude)) => Some(amplitude),
        Some(Size::Axes(_)) | None => None,
    };
    let middle = |index: usize| spec.start.as_ref().map(|start| start[index]);
    let joints = arm.joints().iter().enumerate();
    let swings: Vec<Swing> =
        joints.map(|(i, joint)| Swing::of(joint, i, spec.period, middle(i), amplitude)).collect();
    let grid = Grid::new(rate, spec.period, FEWEST_INTERVALS);
    let mut nodes = Nodes::new(arm);
    for ends in sine::breaks(spec.period).windows(2) {
        fill(&mut nodes, grid.times(ends[0], ends[1]), |joint, t| swings[joint].at(t))?;
    }
    Ok(nodes.into_path(rate, Laps { lap: spec.period, count: spec.laps }))
}

/// Adds a node for each time; `joint_at` gives position, velocity and acceleration of one joint.
fn fill(
    nodes: &mut Nodes<'_>,
    times: impl Iterator<Item = f64>,
    joint_at: impl Fn(usize, f64) -> [f64; 3],
) -> Result<(), PathError> {
    let dof = nodes.dof();
    let [mut q, mut v, mut a] = [0, 1, 2].map(|_| vec![0.0; dof]);
    for t in times {
        for joint in 0..dof {
            [q[joint], v[joint], a[joint]] = joint_at(joint, t);
        }
        nodes.push(t, &q, &v, &a)?;
    }
    Ok(())
}

/// A joint path along a path of the tool.
fn follow(
    arm: &Arm,
    start: Option<&[f64]>,
    path: &ToolPath,
    grid: Grid,
    rate: f64,
) -> Result<JointPath, PathError> {
    if arm.dof() < FEWEST_JOINTS {
        return Err(PathError::TooFewJoints { joints: arm.dof() });
    }
    let posture = start_posture(arm, &path.on_piece(0, 0.0).pose, start)?;
    let mut tracker = Tracker::new(arm, &posture);
    let mut nodes = Nodes::new(arm);
    let laps = path.laps();
    for lap in 0..laps.count {
        follow_lap(&mut tracker, path, f64::from(lap) * laps.lap, grid, &mut nodes)?;
        if lap == 0 && nodes.closed() {
            return Ok(nodes.into_path(rate, laps));
        }
    }
    Ok(nodes.into_path(rate, Laps { lap: laps.duration(), count: 1 }))
}

/// Follows one lap from time `offset` on.
fn follow_lap(
    tracker: &mut Tracker<'_>,
    path: &ToolPath,
    offset: f64,
    grid: Grid,
    nodes: &mut Nodes<'_>,
) -> Result<(), PathError> {
    for (piece, ends) in path.breaks().windows(2).enumerate() {
        let mut previous = None;
        for t in grid.times(ends[0], ends[1]) {
            let target = path.on_piece(piece, t);
            let arrived = match previous.replace(t) {
                None => tracker.place(&target),
                Some(before) => tracker.step(&target, t - before),
            };
            let time = offset + t;
            arrived.map_err(|lost| match lost {
                Lost::Point => explain(tracker.arm(), tracker.q.as_slice(), time, &target.pose),
                Lost::Velocity => {
                    PathError::Singular { time, position: target.pose.translation.vector.into() }
                }
            })?;
            nodes.push(time, tracker.q.as_slice(), tracker.v.as_slice(), tracker.a.as_slice())?;
        }
    }
    Ok(())
}
