//! Columns of the recordings of `freeplay run`, and the states reconstructed from them.
//!
//! The contract's columns come first. Further columns contain everything needed to replay a controller bit for bit, and the true values that the controller
//! did not see.

use freeplay_plant::{Applied, ReferenceDivergence, TickRecord};
use freeplay_recording::{ColumnError, Group, Layout, Recording};
use freeplay_shm::{Joints, MAX_JOINTS, MAX_SLOTS, Mode, State};

/// Joint arrays of State and Command beyond the contract's columns: name and accessor.
type JointColumn = (&'static str, fn(&TickRecord) -> &Joints);

const JOINT_COLUMNS: [JointColumn; 9] = [
    ("applied", |r| &r.state.applied),
    ("qd_ref", |r| &r.state.reference.qd),
    ("qdd_ref", |r| &r.state.reference.qdd),
    ("q_next", |r| &r.state.reference_next.q),
    ("qd_next", |r| &r.state.reference_next.qd),
    ("qdd_next", |r| &r.state.reference_next.qdd),
    ("command", |r| r.command.as_ref().map_or(&NO_ANSWER, |c| &c.value)),
    ("command_qd", |r| r.command.as_ref().map_or(&NO_ANSWER, |c| &c.velocity)),
    ("command_qdd", |r| r.command.as_ref().map_or(&NO_ANSWER, |c| &c.acceleration)),
];

/// Position on the path, if `q_ref` contains the commands of servos.
const PATH_COLUMN: &str = "q_path";

const NO_ANSWER: Joints = [f64::NAN; MAX_JOINTS];

/// Scalars of a tick beyond the contract's columns.
type TickColumn = (&'static str, fn(&TickRecord) -> f64);

const TICK_COLUMNS: [TickColumn; 15] = [
    ("tick", |r| r.state.tick as f64),
    ("flags", |r| f64::from(r.state.flags)),
    ("in_force", |r| in_force(r.applied)),
    ("rejected", |r| r.rejection.map_or(0.0, |reason| f64::from(reason as u8 + 1))),
    ("deviation_x", |r| r.deviation[0]),
    ("deviation_y", |r| r.deviation[1]),
    ("deviation_z", |r| r.deviation[2]),
    ("predicted_x", |r| predicted(r, 0)),
    ("predicted_y", |r| predicted(r, 1)),
    ("predicted_z", |r| predicted(r, 2)),
    ("base_force", |r| r.peak_base_force),
    ("predict_us", |r| r.command.as_ref().map_or(f64::NAN, |c| c.predict_ns as f64 * 1e-3)),
    ("in_charge", |r| f64::from(r.state.active_slot())),
    ("marks", |r| f64::from(r.marks)),
    ("qp_us", |r| r.command.as_ref().map_or(f64::NAN, |c| c.qp_ns as f64 * 1e-3)),
];

/// Quantities of one joint's bearing.
const PLAY_COLUMNS: [&str; 4] = ["play_1", "play_2", "normal_force", "contact_time"];

fn in_force(applied: Applied) -> f64 {
    match applied {
        Applied::Guided => 0.0,
        Applied::Command => 1.0,
        Applied::Hold => 2.0,
        Applied::Brake => 3.0,
    }
}

fn predicted(record: &TickRecord, axis: usize) -> f64 {
    record.command.as_ref().map_or(f64::NAN, |command| command.deviation[axis])
}

/// The columns of one run's recording.
#[derive(Clone, Debug)]
pub struct RunColumns {
    joints: usize,
    tracked: bool,
    links: bool,
    standbys: usize,
    period: f64,
    plays: Vec<String>,
    commanded: bool,
}

impl RunColumns {
    /// Columns for `joints` joints; those named in `plays` have play. `tracked` means that the tool is measured.
    pub fn new(joints: usize, plays: Vec<String>, tracked: bool, period: f64) -> Self {
        Self { joints, tracked, links: false, standbys: 0, period, plays, commanded: false }
    }

    /// Adds the positions of the links if `links` is true, for transmissions that separate a link from its motor.
    pub fn with_links(self, links: bool) -> Self {
        Self { links, ..self }
    }

    /// Adds the commands of the servos as `q_ref1`… if `commanded` is true (mode servo). The reference path of the controller is then in `q_path_1`….
    pub fn with_commands(self, commanded: bool) -> Self {
        Self { commanded, ..self }
    }

    /// Adds the differences between the commands of so many standbys and those of the first controller.
    pub fn with_standbys(self, standbys: usize) -> Self {
        Self { standbys, ..self }
    }

    /// The layout of the recording.
    ///
    /// # Errors
    /// [`ColumnError`] if a joint's name clashes with a column of the contract.
    pub fn layout(&self) -> Result<Layout, ColumnError> {
        let path = self.commanded.then_some(PATH_COLUMN);
        let joint = JOINT_COLUMNS.iter().map(|(name, _)| *name).chain(path);
        let joint = joint.flat_map(|name| (1..=self.joints).map(move |j| format!("{name}_{j}")));
        let tick = TICK_COLUMNS.iter().map(|(name, _)| (*name).to_owned());
        let plays =
            self.plays.iter().flat_map(|play| PLAY_COLUMNS.iter().map(move |name| play_column(play, name)));
        let standbys = (1..=self.standbys)
            .flat_map(|slot| (1..=self.joints).map(move |joint| difference_column(slot, joint)));
        let others: Vec<String> = tick.chain(joint).chain(plays).chain(standbys).collect();
        let others: Vec<&str> = others.iter().map(String::as_str).collect();
        let groups = [Group::Position, Group::Velocity, Group::Torque, Group::Reference, Group::Link];
        let groups = if self.links { &groups[..] } else { &groups[..4] };
        Layout::of(self.joints, groups, self.tracked, &others)
    }

    /// Writes the row of `record` into `row`, in the layout's order.
    pub fn fill(&self, record: &TickRecord, row: &mut Vec<f64>) {
        let state = &record.state;
        row.clear();
        row.push(state.tick as f64 * self.period);
        let reference = if self.commanded { &state.applied } else { &state.reference.q };
        for values in [&state.q, &state.qd, &state.tau, reference] {
            row.extend_from_slice(&values[..self.joints]);
        }
        if self.links {
            row.extend_from_slice(&record.link[..self.joints]);
        }
        if self.tracked {
            row.extend_from_slice(&state.tool);
        }
        row.extend(TICK_COLUMNS.iter().map(|(_, value)| value(record)));
        for (_, values) in JOINT_COLUMNS {
            row.extend_from_slice(&values(record)[..self.joints]);
        }
        if self.commanded {
            row.extend_from_slice(&state.reference.q[..self.joints]);
        }
        for play in &record.plays[..self.plays.len()] {
            row.extend([play.offset[0], play.offset[1], play.peak_normal_force, play.episode]);
        }
        for difference in &record.differences[..self.standbys] {
            row.extend_from_slice(&difference[..self.joints]);
        }
    }
}

/// Name of a bearing's column.
pub fn play_column(joint: &str, quantity: &str) -> String {
    format!("{joint}_{quantity}")
}

/// Name of the column with the command of the controller in `slot` for `joint`, counted from 1, minus that of slot 0.
fn difference_column(slot: usize, joint: usize) -> String {
    format!("difference_{slot}_{joint}")
}

/// Position of each joint on the reference path of the controllers.
pub fn path_columns(recording: &Recording) -> Option<Vec<&[f64]>> {
    let named = |joint| recording.column(&format!("{PATH_COLUMN}_{joint}"));
    let of_servos: Option<Vec<&[f64]>> = (1..=recording.joints()).map(named).collect();
    of_servos.or_else(|| Some(recording.q_ref.as_ref()?.iter().map(Vec::as_slice).collect()))
}

/// The differences between the controllers of a recorded run; `None` if it had no standby.
pub fn reference_divergence(recording: &Recording) -> Option<ReferenceDivergence> {
    let of_slot = |slot: usize| {
        let columns: Option<Vec<&[f64]>> =
            (1..=recording.joints()).map(|joint| recording.column(&difference_column(slot, joint))).collect();
        let columns = columns?;
        let at = |tick: usize| std::array::from_fn(|joint| columns.get(joint).map_or(0.0, |all| all[tick]));
        Some((0..recording.len()).map(at).collect::<Vec<Joints>>())
    };
    let courses: Vec<Vec<Joints>> = (1..MAX_SLOTS).map_while(of_slot).collect();
    (!courses.is_empty()).then(|| ReferenceDivergence::new(courses))
}

/// The State of row `index` of a recorded run, as published except for its wall-clock times; `None` if columns of a recorded run are missing.
pub fn state_at(recording: &Recording, index: usize, run: u64, mode: Mode, period_ns: u64) -> Option<State> {
    let joints = recording.joints();
    let mut state = State::new(run, joints);
    let joint_values = |name: &str, into: &mut Joints| -> Option<()> {
        for (joint, value) in into.iter_mut().enumerate().take(joints) {
            *value = recording.column(&format!("{name}{}", joint + 1))?[index];
        }
        Some(())
    };
    let reference = if mode == Mode::Servo { format!("{PATH_COLUMN}_") } else { "q_ref".to_owned() };
    joint_values("q", &mut state.q)?;
    joint_values("qd", &mut state.qd)?;
    joint_values("tau", &mut state.tau)?;
    joint_values("applied_", &mut state.applied)?;
    joint_values(&reference, &mut state.reference.q)?;
    joint_values("qd_ref_", &mut state.reference.qd)?;
    joint_values("qdd_ref_", &mut state.reference.qdd)?;
    joint_values("q_next_", &mut state.reference_next.q)?;
    joint_values("qd_next_", &mut state.reference_next.qd)?;
    joint_values("qdd_next_", &mut state.reference_next.qdd)?;
    state.tick = recording.column("tick")?[index] as u64;
    state.flags = recording.column("flags")?[index] as u32;
    state.mode = mode.code();
    state.scheduled_ns = state.tick * period_ns;
    if let (Some(tool), Some(orientation)) = (&recording.tool, &recording.orientation) {
        for (value, column) in state.tool.iter_mut().zip(tool.iter().chain(orientation)) {
            *value = column[index];
        }
    }
    Some(state)
}
