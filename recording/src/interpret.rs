//! Finds the contract's names for the columns of a table: from a mapping, from their own names, or by a guess.

use crate::csv_form::Form;
use crate::error::ReadError;
use crate::guess::{Guess, Sample, guess, joints_of};
use crate::mapped::Mapped;
use crate::mapping::Mapping;
use crate::names::{Role, role, shorten};
use crate::place::Place;
use crate::sources::Sources;

/// Prefix of a column name that carries the names of the joints: a CSV has no other place for them. The column has no numbers of its own.
pub(crate) const JOINTS_COLUMN: &str = "joints=";

/// Meaning of the columns of a table.
#[derive(Debug)]
pub(crate) struct Interpreted {
    pub mapped: Mapped,
    /// The joints' names, if they are known.
    pub joints: Vec<String>,
    pub guess: Option<Guess>,
    /// The sources of the columns, if these do not have the contract's names.
    pub sources: Option<Sources>,
}

/// The meaning of the columns `names`; numbers name those of a file without a header (`numbered`).
///
/// # Errors
/// A mapping that does not fit; a file without a header and without a mapping.
pub(crate) fn interpret(
    names: Vec<String>,
    numbered: bool,
    sample: &Sample,
    mapping: Option<&Mapping>,
    form: Option<&Form>,
    place: &Place,
) -> Result<Interpreted, ReadError> {
    let apply = |mapping: &Mapping, names: Vec<String>| mapping.apply(names, numbered, place);
    if let Some(mapping) = mapping {
        let mut mapped = apply(mapping, names.clone())?;
        let sources = Some(mapping.sources(&mapped, &names, form));
        let carried = take_carried(&mut mapped);
        let mut joints = mapping.joints().to_vec();
        if joints.is_empty() && !numbered {
            joints = joints_of(&mapped.positions(), &names, sample);
        }
        if joints.is_empty() {
            joints = carried;
        }
        return Ok(Interpreted { mapped, joints, guess: None, sources });
    }
    if numbered {
        let first = sample.rows.first().and_then(|row| row.first()).map(ToString::to_string);
        let value = form.and_then(|form| form.first.first()).cloned().or(first).unwrap_or_default();
        return Err(ReadError::NoHeader { place: place.clone(), value: shorten(&value) });
    }
    let has = |wanted: Role| names.iter().any(|name| role(name) == Ok(wanted));
    let is_own = has(Role::Time) && has(Role::Joint(crate::names::Group::Position, 0));
    if is_own {
        return Ok(own(names));
    }
    if names.iter().any(|name| name == "state.q[0]") {
        let mapping = Mapping::libfranka();
        let mapped = apply(&mapping, names.clone())?;
        let sources = Some(mapping.sources(&mapped, &names, form));
        return Ok(Interpreted { mapped, joints: Vec::new(), guess: None, sources });
    }
    let file = place.file.file_name().unwrap_or_default().to_string_lossy();
    let Some(guess) = guess(&file, &names, sample, form) else { return Ok(own(names)) };
    let mapping = Mapping::parse(&guess.toml, &place.file)?;
    let (mapped, joints) = (apply(&mapping, names.clone())?, mapping.joints().to_vec());
    let sources = Some(mapping.sources(&mapped, &names, form));
    Ok(Interpreted { mapped, joints, guess: Some(guess), sources })
}

/// Columns with the contract's names, and the joints' names if one of them carries these.
fn own(names: Vec<String>) -> Interpreted {
    let mut mapped = Mapped::own(names);
    let joints = take_carried(&mut mapped);
    Interpreted { mapped, joints, guess: None, sources: None }
}

/// Removes the column whose name carries the joints' names; returns these names, empty without such a column.
fn take_carried(mapped: &mut Mapped) -> Vec<String> {
    let Some(place) = mapped.names.iter().position(|name| name.starts_with(JOINTS_COLUMN)) else {
        return Vec::new();
    };
    let joints = mapped.names[place][JOINTS_COLUMN.len()..].split(';').map(str::to_owned).collect();
    mapped.remove(place);
    joints
}

/// `names` of columns in a valid form: printable, non-empty, and, outside the contract, distinct.
pub(crate) fn tidy(names: &[String]) -> Vec<String> {
    let mut tidy: Vec<String> = Vec::with_capacity(names.len());
    let mut seen = std::collections::HashSet::new();
    for (place, name) in names.iter().enumerate() {
        let clean: String = name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let mut clean = clean.trim().to_owned();
        if clean.is_empty() {
            clean = if place == 0 { "index".to_owned() } else { format!("column {}", place + 1) };
        }
        let is_known = !matches!(role(&clean), Ok(Role::Other));
        let mut unique = clean.clone();
        let mut copy = 1;
        while !is_known && seen.contains(&unique) {
            copy += 1;
            unique = format!("{clean} ({copy})");
        }
        seen.insert(unique.clone());
        tidy.push(unique);
    }
    tidy
}
