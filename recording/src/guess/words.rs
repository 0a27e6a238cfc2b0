//! The words in usual names of columns, and the meaning of a name with them.

use crate::units::{Unit, without_unit};

const POSITION: [&str; 16] = [
    "q",
    "qpos",
    "pos",
    "position",
    "positions",
    "posn",
    "jpos",
    "angle",
    "angles",
    "ang",
    "theta",
    "qj",
    "winkel",
    "lage",
    "rotation",
    "degrees",
];
const VELOCITY: [&str; 12] =
    ["qd", "dq", "vel", "vels", "velocity", "velocities", "speed", "speeds", "qdot", "qvel", "omega", "jvel"];
const TORQUE: [&str; 12] = [
    "tau",
    "torque",
    "torques",
    "trq",
    "effort",
    "efforts",
    "eff",
    "moment",
    "moments",
    "drehmoment",
    "jtrq",
    "tq",
];
const CURRENT: [&str; 6] = ["current", "currents", "curr", "cur", "strom", "amps"];
const REFERENCE: [&str; 20] = [
    "ref",
    "reference",
    "references",
    "target",
    "targets",
    "desired",
    "des",
    "cmd",
    "command",
    "commands",
    "commanded",
    "setpoint",
    "setpoints",
    "goal",
    "sp",
    "set",
    "soll",
    "demand",
    "action",
    "nominal",
];
const MEASURED: [&str; 10] =
    ["actual", "act", "measured", "meas", "msr", "feedback", "fb", "ist", "present", "observed"];
/// The link side, in the name of a position.
const LINK: [&str; 3] = ["link", "links", "secondary"];
/// Words without information on the joint.
const NEUTRAL: [&str; 24] = [
    "joint",
    "joints",
    "jnt",
    "state",
    "states",
    "observation",
    "obs",
    "field",
    "data",
    "value",
    "values",
    "msg",
    "robot",
    "motor",
    "axis",
    "ax",
    "sensor",
    "enc",
    "encoder",
    "dynamic",
    "input",
    "output",
    "signal",
    "channel",
];
/// Words of quantities that a recording does not use.
const OTHER: [&str; 44] = [
    "error",
    "err",
    "errors",
    "temp",
    "temperature",
    "temperatures",
    "voltage",
    "ext",
    "external",
    "acc",
    "accel",
    "acceleration",
    "accelerations",
    "qdd",
    "ddq",
    "ddtheta",
    "dtheta",
    "jerk",
    "mode",
    "status",
    "limit",
    "limits",
    "min",
    "max",
    "tcp",
    "pose",
    "tool",
    "cartesian",
    "wrench",
    "dtau",
    "hat",
    "gravity",
    "std",
    "var",
    "power",
    "energy",
    "seq",
    "episode",
    "frame",
    "task",
    "window",
    "covariance",
    "control",
    "images",
];

/// Meaning of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Quantity {
    Position,
    Velocity,
    Torque,
    Current,
    Reference,
    Link,
}

/// Content of the name of one column.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    /// Its index in the file.
    pub place: usize,
    pub quantity: Quantity,
    /// Certainty of the meaning, 1 to 3.
    pub strength: u8,
    pub is_measured: bool,
    /// The part that distinguishes its joint: a number, or words.
    pub joint: Vec<String>,
    /// The other words, which are the same for the columns of other joints.
    pub family: Vec<String>,
    pub unit: Option<Unit>,
}

impl Column {
    /// The meaning of the column number `place` named `name`; `None` if it is not a quantity of a joint.
    pub fn of(place: usize, name: &str) -> Option<Self> {
        let (stem, unit) = without_unit(name);
        let mut words = words(stem);
        let mut unit = unit.and_then(Unit::of);
        // `q1_deg` has a unit, but `a`, `m` and `s` at the end of a name are no units.
        if unit.is_none()
            && let Some(last) = words.last().filter(|last| last.len() > 1 && words.len() > 1)
        {
            unit = Unit::of(last);
            words.truncate(words.len() - usize::from(unit.is_some()));
        }
        let has = |of: &[&str]| words.iter().any(|word| of.contains(&word.as_str()));
        if has(&OTHER) || unit == Some(Unit::Other) {
            return None;
        }
        let (quantity, strength) = quantity(&words, unit)?;
        let is_word = |word: &str| {
            [&POSITION[..], &VELOCITY, &TORQUE, &CURRENT, &REFERENCE, &MEASURED, &NEUTRAL]
                .iter()
                .any(|of| of.contains(&word))
        };
        let (family, mut joint): (Vec<String>, Vec<String>) = words.iter().cloned().partition(|word| {
            is_word(word)
                || (word == "d" && is_desired(&words))
                || (quantity == Quantity::Link && LINK.contains(&word.as_str()))
        });
        let mut family = family;
        // An index in a list, `log.pos[0]`: the rest is the name of the list.
        if let Some((_, place)) = stem.strip_suffix(']').and_then(|stem| stem.rsplit_once('['))
            && place.parse::<u64>().is_ok()
        {
            joint.pop();
            family.append(&mut joint);
            joint.push(place.to_owned());
        }
        let is_number = |word: &String| word.bytes().all(|c| c.is_ascii_digit());
        if joint.iter().any(is_number) && joint.iter().all(|word| is_number(word) || word.len() == 1) {
            // `J1`, `tau_J[0]`: the letter stands for the quantity or for "joint".
            let number = joint.iter().rfind(|word| is_number(word)).cloned();
            joint = number.into_iter().collect();
        }
        let is_measured = has(&MEASURED);
        Some(Self { place, quantity, strength, is_measured, joint, family, unit })
    }

    /// Its joint's number, if its name has no other words for the joint.
    pub fn number(&self) -> Option<u64> {
        match self.joint.as_slice() {
            [only] => only.parse().ok(),
            _ => None,
        }
    }
}

/// True if a `d` among `words` means "desired", as in `q_d`.
fn is_desired(words: &[String]) -> bool {
    words
        .windows(2)
        .any(|pair| pair[1] == "d" && ["q", "dq", "tau", "j", "theta"].contains(&pair[0].as_str()))
}

/// The quantity of `words` and the unit behind them, and its certainty.
fn quantity(words: &[String], unit: Option<Unit>) -> Option<(Quantity, u8)> {
    let has = |of: &[&str]| words.iter().any(|word| of.contains(&word.as_str()));
    let is_reference = has(&REFERENCE) || is_desired(words);
    let base = if has(&VELOCITY) {
        (Quantity::Velocity, 3)
    } else if has(&TORQUE) {
        (Quantity::Torque, 3)
    } else if has(&POSITION) {
        (Quantity::Position, if has(&["theta"]) { 2 } else { 3 })
    } else if has(&CURRENT) {
        (Quantity::Current, 3)
    } else if let Some(unit) = unit {
        match unit {
            Unit::Position(_) => (Quantity::Position, 2),
            Unit::Velocity(_) => (Quantity::Velocity, 2),
            Unit::Torque(_) => (Quantity::Torque, 2),
            Unit::Current(_) => (Quantity::Current, 2),
            Unit::Time(_) | Unit::Other => return None,
        }
    } else if has(&["action"]) || (has(&["observation", "obs"]) && has(&["state"])) {
        (Quantity::Position, 2)
    } else if is_numbered_joint(words) {
        (Quantity::Position, 1)
    } else {
        return None;
    };
    match base {
        (Quantity::Position, strength) if is_reference => Some((Quantity::Reference, strength)),
        _ if is_reference => None,
        (Quantity::Position, strength) if has(&LINK) && strength > 2 => Some((Quantity::Link, strength)),
        base => Some(base),
    }
}

/// True for `joint_1`, `J1`, `axis 1`, `A1`: a joint's number without further words.
fn is_numbered_joint(words: &[String]) -> bool {
    match words {
        [word, number] => {
            ["joint", "j", "axis", "ax", "a", "jnt"].contains(&word.as_str()) && number.parse::<u8>().is_ok()
        }
        _ => false,
    }
}

/// The words of a name in lower case: split at other characters, between letters and digits, and before capitals.
pub(crate) fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for c in name.chars() {
        let begins = !before.is_alphanumeric()
            || before.is_numeric() != c.is_numeric()
            || (before.is_lowercase() && c.is_uppercase());
        if c.is_alphanumeric() {
            match words.last_mut().filter(|_| !begins) {
                Some(word) => word.extend(c.to_lowercase()),
                None => words.push(c.to_lowercase().collect()),
            }
        }
        before = c;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::{Column, Quantity, words};

    #[test]
    fn names_are_parted_into_words() {
        assert_eq!(words("/joint_states/position[0]"), ["joint", "states", "position", "0"]);
        assert_eq!(words("shoulderPanPos1"), ["shoulder", "pan", "pos", "1"]);
    }

    #[test]
    fn names_of_many_houses_are_understood() {
        use Quantity::{Current, Link, Position, Reference, Torque, Velocity};
        let cases: [(&str, Quantity, &[&str]); 17] = [
            ("q1 [deg]", Position, &["1"]),
            ("J1 (°)", Position, &["1"]),
            ("actual_q_0", Position, &["0"]),
            ("target_q_0", Reference, &["0"]),
            ("actual_qd_5", Velocity, &["5"]),
            ("actual_current_2", Current, &["2"]),
            ("tau_1 (Nm)", Torque, &["1"]),
            ("shoulder_pan_joint_pos", Position, &["shoulder", "pan"]),
            ("/joint_states/elbow/position", Position, &["elbow"]),
            ("/joint_states/wrist_1_joint/effort", Torque, &["wrist", "1"]),
            ("field.position0", Position, &["0"]),
            ("action.gripper.pos", Reference, &["gripper"]),
            ("observation.state[3]", Position, &["3"]),
            ("state.q_d[2]", Reference, &["2"]),
            ("I2 [A]", Current, &["2"]),
            ("log.pos[4]", Position, &["4"]),
            ("q_link4", Link, &["4"]),
        ];
        for (name, quantity, joint) in cases {
            let column = Column::of(0, name).expect(name);
            assert_eq!(
                (column.quantity, column.joint.as_slice()),
                (quantity, joint.map_strings().as_slice()),
                "{name}"
            );
        }
        for name in ["actual_TCP_pose_0", "target_qd_1", "joint_temperatures_0", "mode", "tau_ext_1", "time"]
        {
            assert_eq!(Column::of(0, name), None, "{name}");
        }
    }

    trait MapStrings {
        fn map_strings(&self) -> Vec<String>;
    }

    impl MapStrings for &[&str] {
        fn map_strings(&self) -> Vec<String> {
            self.iter().map(ToString::to_string).collect()
        }
    }
}
