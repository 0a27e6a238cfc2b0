//! A recording in memory.

use std::path::PathBuf;

use thiserror::Error;

use crate::names::{Group, ORIENTATION, Role, TOOL, role};
use crate::sources::{Quantity, Sources};

/// Measurements of one arm over one stretch of time. All columns have one value per sample; `t` increases, and it and the positions are finite. Any other value
/// may be NaN, which marks it as missing: for a while, or throughout for a joint that lacks a quantity of other joints. This holds for a recording from
/// [`crate::read`], [`crate::read_from`] or [`Recording::new`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// The file it was read from, for messages.
    pub origin: PathBuf,
    /// Names of the joints in the order of the columns, if the file has names; else empty.
    pub joint_names: Vec<String>,
    /// The mapping that the reader guessed from the column names, as a mapping file; `None` if it did not guess.
    pub guessed: Option<String>,
    /// The sources of its columns, if they were mapped or guessed.
    pub sources: Option<Sources>,
    /// Time, s.
    pub t: Vec<f64>,
    /// Joint position as the robot's own encoder reads it, `[joint][sample]`, rad.
    pub q: Vec<Vec<f64>>,
    /// Joint velocity, `[joint][sample]`, rad/s.
    pub qd: Option<Vec<Vec<f64>>>,
    /// Joint torque as the robot measures it, `[joint][sample]`, N·m.
    pub tau: Option<Vec<Vec<f64>>>,
    /// Commanded joint position, `[joint][sample]`, rad.
    pub q_ref: Option<Vec<Vec<f64>>>,
    /// Link-side encoder per joint, rad; one entry per joint, `None` for a joint without one.
    pub q_link: Vec<Option<Vec<f64>>>,
    /// Position of frame `tool0` in the base frame: x, y, z; m.
    pub tool: Option<[Vec<f64>; 3]>,
    /// Orientation of frame `tool0` in the base frame: qx, qy, qz, qw; as recorded, not normalised.
    pub orientation: Option<[Vec<f64>; 4]>,
    /// Columns outside the contract, in the order of the file: kept, not used. May hold NaN.
    pub others: Vec<(String, Vec<f64>)>,
    /// The recorder's notes on the run (MCAP only): scenario, hashes, versions; sorted by key.
    pub metadata: Vec<(String, String)>,
    /// Marks and faults (MCAP only), in the order of the file.
    pub events: Vec<Event>,
    /// The file breaks off before its end (the recorder was killed, or the disk was full); the samples are complete up to that point.
    pub truncated: bool,
    /// Irregularities that the reader tolerated, one sentence each; to be shown to the user.
    pub notes: Vec<String>,
}

/// An event during a recording.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Event {
    /// Time, s, on the clock of the recording.
    pub t: f64,
    /// Kind, e.g. `mark`, `fault`, `swap`.
    pub kind: String,
    /// Description for people.
    pub text: String,
}

/// The recording lacks columns that a caller needs.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}: no column {columns}; record {what}", origin.display())]
pub struct Absent {
    /// The recording.
    pub origin: PathBuf,
    /// The missing columns.
    pub columns: String,
    /// Their content.
    pub what: &'static str,
}

impl Recording {
    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.q.len()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// True without samples; never so for a recording from a file.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Time from the first sample to the last, s.
    pub fn duration(&self) -> f64 {
        match (self.t.first(), self.t.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// The median time step, s; 0 for less than two samples.
    pub fn median_step(&self) -> f64 {
        let mut steps: Vec<f64> = self.t.windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() {
            return 0.0;
        }
        let middle = steps.len() / 2;
        *steps.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Samples per second, from the median step, Hz; 0 for less than two samples.
    pub fn rate_hz(&self) -> f64 {
        let step = self.median_step();
        if step > 0.0 { 1.0 / step } else { 0.0 }
    }

    /// Measured torques, `[joint][sample]`, N·m.
    ///
    /// # Errors
    /// The recording has no `tau` columns.
    pub fn torques(&self) -> Result<&[Vec<f64>], Absent> {
        self.tau.as_deref().ok_or_else(|| self.absent(Group::Torque, "the measured joint torques, N·m"))
    }

    /// Measured velocities, `[joint][sample]`, rad/s.
    ///
    /// # Errors
    /// The recording has no `qd` columns.
    pub fn velocities(&self) -> Result<&[Vec<f64>], Absent> {
        self.qd.as_deref().ok_or_else(|| self.absent(Group::Velocity, "the joint velocities, rad/s"))
    }

    /// Commanded positions, `[joint][sample]`, rad.
    ///
    /// # Errors
    /// The recording has no `q_ref` columns.
    pub fn references(&self) -> Result<&[Vec<f64>], Absent> {
        self.q_ref
            .as_deref()
            .ok_or_else(|| self.absent(Group::Reference, "the commanded joint positions, rad"))
    }

    /// Tracked tool positions, `[axis][sample]`, m.
    ///
    /// # Errors
    /// The recording has no `x`, `y`, `z` columns.
    pub fn tool_positions(&self) -> Result<&[Vec<f64>; 3], Absent> {
        self.tool.as_ref().ok_or_else(|| Absent {
            origin: self.origin.clone(),
            columns: TOOL.join(", "),
            what: "the tool's position with a tracker, m",
        })
    }

    fn absent(&self, group: Group, what: &'static str) -> Absent {
        let last = self.joints().saturating_sub(1);
        let columns = format!("{}…{}", group.column(0), group.column(last));
        Absent { origin: self.origin.clone(), columns, what }
    }

    /// A column by its name in the contract, or by its own name if it is another.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        // A joint quantity without a position is among `others`, under its own name.
        let other = || self.others.iter().find(|(known, _)| known == name).map(|(_, values)| values);
        self.of_role(role(name).unwrap_or(Role::Other)).or_else(other).map(Vec::as_slice)
    }

    /// The column that has this meaning.
    fn of_role(&self, role: Role) -> Option<&Vec<f64>> {
        match role {
            Role::Time => Some(&self.t),
            Role::Joint(Group::Position, joint) => self.q.get(joint),
            Role::Joint(Group::Velocity, joint) => self.qd.as_ref()?.get(joint),
            Role::Joint(Group::Torque, joint) => self.tau.as_ref()?.get(joint),
            Role::Joint(Group::Reference, joint) => self.q_ref.as_ref()?.get(joint),
            Role::Joint(Group::Link, joint) => self.q_link.get(joint)?.as_ref(),
            Role::Tool(axis) => self.tool.as_ref()?.get(axis),
            Role::Orientation(part) => self.orientation.as_ref()?.get(part),
            Role::Other => None,
        }
    }

    /// The names of all columns in the order of the contract, others last: the order in which
    /// [`crate::export`] writes them.
    pub fn columns(&self) -> Vec<String> {
        self.named().map(|(name, _)| name).collect()
    }

    /// Sample `index` in the order of [`Recording::columns`]; panics if there is no such sample.
    pub fn row(&self, index: usize) -> Vec<f64> {
        self.named().map(|(_, values)| values[index]).collect()
    }

    /// All columns with their names, in the order of the contract.
    pub fn named(&self) -> impl Iterator<Item = (String, &[f64])> {
        let time = std::iter::once(("t".to_string(), self.t.as_slice()));
        let joints = Group::ALL.into_iter().flat_map(|group| self.group(group));
        let tool = self.tool.iter().flatten().zip(TOOL);
        let orientation = self.orientation.iter().flatten().zip(ORIENTATION);
        let tool = tool.chain(orientation).map(|(values, name)| (name.to_string(), values.as_slice()));
        let others = self.others.iter().map(|(name, values)| (name.clone(), values.as_slice()));
        time.chain(joints).chain(tool).chain(others)
    }

    /// The columns of one group that exist, with their names.
    pub(crate) fn group(&self, group: Group) -> Vec<(String, &[f64])> {
        let whole = match group {
            Group::Position => Some(&self.q),
            Group::Velocity => self.qd.as_ref(),
            Group::Torque => self.tau.as_ref(),
            Group::Reference => self.q_ref.as_ref(),
            Group::Link => None,
        };
        let whole = whole.into_iter().flatten().map(Some);
        let link = self.q_link.iter().map(Option::as_ref).filter(|_| group == Group::Link);
        let joints = whole.chain(link).enumerate();
        joints.filter_map(|(j, values)| Some((group.column(j), values?.as_slice()))).collect()
    }
}

impl Sources {
    /// The sources of `recording`: those of its file, or its own columns if these have the contract's names.
    pub fn of(recording: &Recording) -> Self {
        recording.sources.clone().unwrap_or_else(|| Self::own(recording))
    }

    fn own(recording: &Recording) -> Self {
        let joints = recording.joints();
        let of = |group: Group| (0..joints).map(|joint| group.column(joint)).collect::<Vec<String>>();
        let mut quantities = vec![Quantity::unscaled("t", vec!["t".to_owned()])];
        let groups = [
            (Group::Position, true),
            (Group::Velocity, recording.qd.is_some()),
            (Group::Torque, recording.tau.is_some()),
            (Group::Reference, recording.q_ref.is_some()),
        ];
        for (group, _) in groups.into_iter().filter(|(_, is_there)| *is_there) {
            quantities.push(Quantity::unscaled(group.prefix(), of(group)));
        }
        if recording.q_link.iter().any(Option::is_some) {
            let there = |(column, link): (String, &Option<Vec<f64>>)| {
                link.as_ref().map_or_else(String::new, |_| column)
            };
            let columns = of(Group::Link).into_iter().zip(&recording.q_link).map(there).collect();
            quantities.push(Quantity::unscaled(Group::Link.prefix(), columns));
        }
        let named = |names: &[&str]| names.iter().map(ToString::to_string).collect();
        if recording.tool.is_some() {
            quantities.push(Quantity::unscaled("tool", named(&TOOL)));
        }
        if recording.orientation.is_some() {
            quantities.push(Quantity::unscaled("orientation", named(&ORIENTATION)));
        }
        Self { quantities, ..Self::default() }
    }
}
