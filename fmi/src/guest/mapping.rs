//! Mapping of the variables of an FMU to the signals of a run.

use std::path::{Path, PathBuf};

use freeplay_controller_sdk::Answer;
use freeplay_shm::State;
use freeplay_storage::plain_words;
use serde::Deserialize;
use std::collections::BTreeMap;

use super::{Guest, GuestError};

/// A signal of a run that is an input of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Measured position of a joint, rad (m).
    Position(usize),
    /// Measured velocity of a joint, rad/s (m/s).
    Velocity(usize),
    /// Measured torque of a joint, N·m (N).
    Torque(usize),
    /// Reference position at the instant when the answer takes effect.
    ReferencePosition(usize),
    /// Reference velocity at that instant.
    ReferenceVelocity(usize),
    /// Reference acceleration at that instant.
    ReferenceAcceleration(usize),
    /// Tracked tool: x, y, z, then the quaternion x, y, z, w.
    Tool(usize),
    /// Simulated time, s.
    Time,
}

/// Constructor of the signal of a joint.
type OfJoint = fn(usize) -> Signal;

/// Names of joint signals.
const OF_JOINTS: [(&str, OfJoint); 6] = [
    ("q", Signal::Position),
    ("qd", Signal::Velocity),
    ("tau", Signal::Torque),
    ("q_ref", Signal::ReferencePosition),
    ("qd_ref", Signal::ReferenceVelocity),
    ("qdd_ref", Signal::ReferenceAcceleration),
];

/// Names of the components of the tool's pose.
const TOOL: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];

/// Names of commands, with the order of the derivative of the joint's position in mode driven.
const COMMANDS: [(&str, usize); 5] =
    [("command", 0), ("torque", 0), ("u", 0), ("command_qd", 1), ("command_qdd", 2)];

impl Signal {
    /// The value in `state`; the ticks are `period` s apart.
    pub fn of(self, state: &State, period: f64) -> f64 {
        let reference = &state.reference_next;
        match self {
            Signal::Position(joint) => state.q[joint],
            Signal::Velocity(joint) => state.qd[joint],
            Signal::Torque(joint) => state.tau[joint],
            Signal::ReferencePosition(joint) => reference.q[joint],
            Signal::ReferenceVelocity(joint) => reference.qd[joint],
            Signal::ReferenceAcceleration(joint) => reference.qdd[joint],
            Signal::Tool(place) => state.tool[place],
            Signal::Time => state.tick as f64 * period,
        }
    }

    fn named(name: &str, joints: &[String]) -> Option<Signal> {
        if name == "time" {
            return Some(Signal::Time);
        }
        let tool = name.strip_prefix("tool.").and_then(|part| TOOL.iter().position(|known| *known == part));
        let of_joint =
            || OF_JOINTS.iter().rev().find_map(|(kind, make)| joint_of(name, kind, joints).map(make));
        tool.map(Signal::Tool).or_else(of_joint)
    }
}

/// The joint in `name`, written as `KIND.JOINT`, `KIND_JOINT`, or with its number from 1 as `KIND1`, `KIND_1`, `KIND[1]`.
fn joint_of(name: &str, kind: &str, joints: &[String]) -> Option<usize> {
    let rest = name.strip_prefix(kind)?;
    let word = rest.strip_prefix(['.', '_']).unwrap_or(rest);
    let by_name =
        || (word.len() < rest.len()).then(|| joints.iter().position(|joint| joint == word)).flatten();
    let number = word.strip_prefix('[').and_then(|word| word.strip_suffix(']')).unwrap_or(word);
    let by_number = || {
        number
            .parse::<usize>()
            .ok()
            .filter(|number| (1..=joints.len()).contains(number))
            .map(|number| number - 1)
    };
    by_name().or_else(by_number)
}

/// Inputs and outputs of an FMU in a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    /// Value references of inputs.
    pub input_references: Vec<u32>,
    /// Signals of these inputs.
    pub signals: Vec<Signal>,
    /// Value references of outputs.
    pub output_references: Vec<u32>,
    /// The joints commanded by these outputs, with the order of the derivative: 0 the command itself, 1 its velocity, 2 its acceleration.
    pub commands: Vec<(usize, usize)>,
}

/// The mapping file: names of variables, and of signals of a run.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Table {
    inputs: BTreeMap<String, String>,
    outputs: BTreeMap<String, String>,
}

impl Mapping {
    /// The path of the mapping file of the FMU `fmu`: next to it, with `.toml` appended to its name.
    pub fn file(fmu: &Path) -> PathBuf {
        let mut name = fmu.as_os_str().to_owned();
        name.push(".toml");
        PathBuf::from(name)
    }

    /// Maps the variables of `guest` in the FMU `fmu` for an arm with these `joints`.
    ///
    /// # Errors
    /// A variable without a signal, a joint without a command, or an unreadable mapping file.
    pub fn of(guest: &Guest, fmu: &Path, joints: &[String]) -> Result<Mapping, GuestError> {
        let file = Mapping::file(fmu);
        let table = if file.is_file() { Table::read(&file)? } else { Table::default() };
        let mut mapping = Mapping::default();
        for (name, reference) in &guest.inputs {
            let said = table.inputs.get(name).unwrap_or(name);
            if said.is_empty() {
                continue;
            }
            let signal =
                Signal::named(said, joints).ok_or_else(|| unknown("input", name, "q", joints, &file))?;
            mapping.input_references.push(*reference);
            mapping.signals.push(signal);
        }
        for (name, reference) in &guest.outputs {
            let said = table.outputs.get(name).unwrap_or(name);
            // An output that is not a command is ignored.
            let command = |(kind, order): &(&str, usize)| Some((joint_of(said, kind, joints)?, *order));
            let Some(command) = COMMANDS.iter().find_map(command) else {
                if table.outputs.get(name).is_some_and(|said| !said.is_empty()) {
                    return Err(unknown("output", name, "command", joints, &file));
                }
                continue;
            };
            mapping.output_references.push(*reference);
            mapping.commands.push(command);
        }
        match (0..joints.len()).find(|joint| !mapping.commands.contains(&(*joint, 0))) {
            Some(joint) => Err(GuestError::NoCommand { joint: joints[joint].clone(), file }),
            None => Ok(mapping),
        }
    }

    /// Writes the values of outputs into the `answer` to `state`. Velocities and accelerations without an output are those of the reference.
    pub fn answer(&self, state: &State, values: &[f64], answer: &mut Answer) {
        let reference = &state.reference_next;
        (answer.velocity, answer.acceleration) = (reference.qd, reference.qdd);
        for (&(joint, order), value) in self.commands.iter().zip(values) {
            let place = [&mut answer.value, &mut answer.velocity, &mut answer.acceleration];
            if let Some(values) = place.into_iter().nth(order) {
                values[joint] = *value;
            }
        }
    }
}

impl Table {
    fn read(file: &Path) -> Result<Table, GuestError> {
        let text = freeplay_storage::read_text(file)?;
        toml::from_str(&text).map_err(|error| GuestError::Mapping {
            file: file.to_path_buf(),
            what: plain_words(&error.to_string()),
        })
    }
}

fn unknown(role: &'static str, name: &str, kind: &str, joints: &[String], file: &Path) -> GuestError {
    let joint = joints.first().map_or("1", String::as_str);
    GuestError::Unknown {
        role,
        name: name.to_owned(),
        example: format!("{kind}.{joint}"),
        file: file.to_path_buf(),
    }
}

#[cfg(test)]
mod tests {
    use super::{Signal, joint_of};

    #[test]
    fn a_joint_is_named_by_name_or_number() {
        let joints = ["base", "q_1", "elbow"].map(str::to_owned);
        for (name, signal) in [
            ("q.elbow", Signal::Position(2)),
            ("q3", Signal::Position(2)),
            ("qd_1", Signal::Velocity(0)),
            ("qdd_ref[2]", Signal::ReferenceAcceleration(1)),
            ("q_ref.base", Signal::ReferencePosition(0)),
            ("tool.qw", Signal::Tool(6)),
            ("time", Signal::Time),
        ] {
            assert_eq!(Signal::named(name, &joints), Some(signal), "{name}");
        }
        for name in ["q4", "q0", "qelbow", "q", "speed1", "tool.w"] {
            assert_eq!(Signal::named(name, &joints), None, "{name}");
        }
        assert_eq!(joint_of("command.q_1", "command", &joints), Some(1));
    }
}
