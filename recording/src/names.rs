//! The column names of a recording: the names of the contract, and the valid sets of them.

use std::collections::HashSet;

use thiserror::Error;

/// A quantity measured once per joint: its columns carry the joint's number, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Group {
    /// `q1`…: position as the robot's own encoder reads it, through the gear ratio; rad.
    Position,
    /// `qd1`…: velocity; rad/s.
    Velocity,
    /// `tau1`…: torque as the robot measures it; N·m.
    Torque,
    /// `q_ref1`…: commanded position; rad.
    Reference,
    /// `q_link1`…: link-side encoder; rad.
    Link,
}

impl Group {
    /// Every group, in the order of the contract.
    pub const ALL: [Group; 5] =
        [Group::Position, Group::Velocity, Group::Torque, Group::Reference, Group::Link];

    /// The part of the column's name before the joint's number.
    pub fn prefix(self) -> &'static str {
        match self {
            Group::Position => "q",
            Group::Velocity => "qd",
            Group::Torque => "tau",
            Group::Reference => "q_ref",
            Group::Link => "q_link",
        }
    }

    /// The column of joint `joint`, counted from 0: `Group::Torque.column(2)` is `tau3`.
    pub fn column(self, joint: usize) -> String {
        format!("{}{}", self.prefix(), joint + 1)
    }
}

/// The tool's position of frame `tool0` in the base frame, m.
pub(crate) const TOOL: [&str; 3] = ["x", "y", "z"];
/// The tool's orientation in the base frame, a unit quaternion.
pub(crate) const ORIENTATION: [&str; 4] = ["qx", "qy", "qz", "qw"];

/// Meaning of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Role {
    /// `t`, s.
    Time,
    /// A quantity of one joint, counted from 0.
    Joint(Group, usize),
    /// A coordinate of the tool: 0 is x.
    Tool(usize),
    /// A component of the tool's quaternion: 0 is x, 3 is w.
    Orientation(usize),
    /// Not in the contract: kept, not used.
    Other,
}

/// Fault in a set of column names.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ColumnError {
    /// A required column is missing.
    #[error("column {column} is missing{hint}; found: {found}")]
    Missing {
        /// The missing column.
        column: String,
        /// A column that looks like the missing one under another name, and the remedy.
        hint: String,
        /// The columns of the file, shortened.
        found: String,
    },
    /// The number of joints differs from that of the arm.
    #[error(
        "expected {expected} joint(s) ({}), found {found} ({}): is this a recording of this arm?",
        span(*expected),
        span(*found)
    )]
    JointCount {
        /// Joints of the arm.
        expected: usize,
        /// Joints of the recording.
        found: usize,
    },
    /// Joints counted from 0.
    #[error(
        "column {column}: joints are counted from 1; rename {prefix}0, {prefix}1… to {prefix}1, {prefix}2…"
    )]
    CountedFromZero {
        /// The column.
        column: String,
        /// Its name without the number.
        prefix: &'static str,
    },
    /// The same name twice.
    #[error("column {column} occurs twice; rename or remove one of them")]
    Duplicate {
        /// The name.
        column: String,
    },
    /// A column without a name.
    #[error(
        "column number {number} has no name; name it or remove it (a comma at the end of the header makes one)"
    )]
    Unnamed {
        /// Its position, counted from 1.
        number: usize,
    },
    /// A name that writing and reading would change.
    #[error(
        "column number {number} is named {name:?}; remove the control characters and the spaces around the name"
    )]
    Unprintable {
        /// Its position, counted from 1.
        number: usize,
        /// The name.
        name: String,
    },
}

/// The meaning of `name`; a joint's number 0 is an error, since it would shift every joint by one.
pub(crate) fn role(name: &str) -> Result<Role, ColumnError> {
    if name == "t" {
        return Ok(Role::Time);
    }
    if let Some(i) = TOOL.iter().position(|n| *n == name) {
        return Ok(Role::Tool(i));
    }
    if let Some(i) = ORIENTATION.iter().position(|n| *n == name) {
        return Ok(Role::Orientation(i));
    }
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let Some(group) = Group::ALL.into_iter().find(|g| g.prefix() == stem) else { return Ok(Role::Other) };
    match name[stem.len()..].parse::<usize>() {
        Ok(0) => Err(ColumnError::CountedFromZero { column: name.into(), prefix: group.prefix() }),
        Ok(number) if !name[stem.len()..].starts_with('0') => Ok(Role::Joint(group, number - 1)),
        _ => Ok(Role::Other),
    }
}

/// The columns of a recording with their meaning.
#[derive(Debug, Clone)]
pub(crate) struct Roles {
    /// One per column, in the order of the columns.
    pub roles: Vec<Role>,
    /// Number of joints.
    pub joints: usize,
    /// Unused columns with names of the contract, one sentence each.
    pub notes: Vec<String>,
}

impl Roles {
    /// Assigns a meaning to each of `names`; `expected` is the number of joints of the arm, if it is known.
    pub fn new(names: &[String], expected: Option<usize>) -> Result<Self, ColumnError> {
        check_spelling(names)?;
        let mut roles = names.iter().map(|name| role(name)).collect::<Result<Vec<_>, _>>()?;
        let present: HashSet<Role> = roles.iter().copied().collect();
        if !present.contains(&Role::Time) {
            return Err(missing("t", names));
        }
        let joints = count_joints(&present, names)?;
        if let Some(expected) = expected.filter(|e| *e != joints) {
            return Err(ColumnError::JointCount { expected, found: joints });
        }
        let notes = set_aside_without_position(&mut roles, joints);
        Ok(Roles { roles, joints, notes })
    }
}

/// Checks that every name is present, printable and unique.
fn check_spelling(names: &[String]) -> Result<(), ColumnError> {
    let mut seen = HashSet::new();
    for (i, name) in names.iter().enumerate() {
        if name.trim().is_empty() {
            return Err(ColumnError::Unnamed { number: i + 1 });
        }
        if name.trim() != name || name.chars().any(char::is_control) {
            return Err(ColumnError::Unprintable { number: i + 1, name: shorten(name) });
        }
        if !seen.insert(name.as_str()) {
            return Err(ColumnError::Duplicate { column: shorten(name) });
        }
    }
    Ok(())
}

/// The number of joints: q1, q2, … without a gap.
fn count_joints(present: &HashSet<Role>, names: &[String]) -> Result<usize, ColumnError> {
    let positions = present.iter().filter(|r| matches!(r, Role::Joint(Group::Position, _))).count();
    let gap = (0..positions.max(1)).find(|j| !present.contains(&Role::Joint(Group::Position, *j)));
    match gap {
        Some(joint) => Err(missing(&Group::Position.column(joint), names)),
        None => Ok(positions),
    }
}

/// Turns joint quantities without a position into other columns; returns a note for each.
fn set_aside_without_position(roles: &mut [Role], joints: usize) -> Vec<String> {
    let mut columns = Vec::new();
    for role in roles.iter_mut() {
        if let Role::Joint(group, joint) = *role
            && joint >= joints
        {
            columns.push(group.column(joint));
            *role = Role::Other;
        }
    }
    if columns.is_empty() {
        return Vec::new();
    }
    vec![format!("not used: {}, since the positions end at q{joints}", list(&columns))]
}

/// The position columns of so many joints: `q1…q6`, or `q1`.
fn span(joints: usize) -> String {
    if joints == 1 { "q1".into() } else { format!("q1…q{joints}") }
}

/// The error for a missing `column`, with the one of `names` that may be meant.
fn missing(column: &str, names: &[String]) -> ColumnError {
    let similar = names.iter().find(|name| {
        let name = name.to_lowercase();
        name == column || (column == "t" && name.starts_with("time"))
    });
    let hint = match similar {
        Some(name) => format!(" (rename {} to {column})", shorten(name)),
        None if column == "t" => " (add the time of each row, s)".into(),
        None => format!(" (add the position of joint {}, rad)", column.trim_start_matches('q')),
    };
    ColumnError::Missing { column: column.into(), hint, found: list(names) }
}

/// The first names of a list, and the number of further ones.
pub(crate) fn list(names: &[String]) -> String {
    const SHOWN: usize = 12;
    if names.is_empty() {
        return "none".into();
    }
    let shown = names.iter().take(SHOWN).map(|n| shorten(n)).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

/// A text shortened for an error message: at most 40 characters, on one line.
pub(crate) fn shorten(text: &str) -> String {
    const SHOWN: usize = 40;
    let mut short: String = text.chars().take(SHOWN).map(|c| if c.is_control() { '�' } else { c }).collect();
    if text.chars().nth(SHOWN).is_some() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::{ColumnError, Group, Role, Roles, role};

    fn roles(header: &str) -> Result<Roles, ColumnError> {
        Roles::new(&header.split(',').map(String::from).collect::<Vec<_>>(), None)
    }

    #[test]
    fn names_near_the_contract_stay_outside_it() {
        for name in
            ["qd_link1", "qd_ref1", "tau_cmd1", "q", "q01", "Q1", "q1x", "qq1", "q99999999999999999999999"]
        {
            assert_eq!(role(name), Ok(Role::Other), "{name}");
        }
        assert_eq!(role("q_link3"), Ok(Role::Joint(Group::Link, 2)));
        assert_eq!(role("qx"), Ok(Role::Orientation(0)));
    }

    #[test]
    fn a_huge_joint_number_is_a_gap_not_a_loop() {
        let error = roles("t,q1,q18446744073709551615").expect_err("a gap");
        assert!(matches!(error, ColumnError::Missing { column, .. } if column == "q2"));
    }

    #[test]
    fn every_group_but_the_positions_may_be_partial() {
        for header in ["t,q1,q2,q_link2", "t,q1,q2,qd1", "t,q1,q2,tau2", "t,q1,q2,x,y", "t,q1,q2,qx"] {
            assert_eq!(roles(header).expect(header).joints, 2);
        }
        let roles = roles("t,q1,tau3").expect("the torque is set aside");
        assert_eq!(roles.roles[2], Role::Other);
        assert!(roles.notes[0].contains("tau3") && roles.notes[0].contains("end at q1"), "{:?}", roles.notes);
    }
}
