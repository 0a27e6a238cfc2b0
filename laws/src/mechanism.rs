//! An arm file as a mechanism: its effects as elements that are common to the formats of other tools.

use freeplay_model::ArmFile;
use freeplay_model::export::{Mechanism, Named};

use crate::effect::ExportCoverage;
use crate::{Effects, Kind, LawError, Parameter, Placed, Range};

/// The mechanism of `file`: the arm with the effects that change it, and the elements of the others.
///
/// # Errors
/// See [`LawError`]: an effect that is invalid, or that makes the arm impossible.
pub fn mechanism(file: &ArmFile) -> Result<Mechanism, LawError> {
    let effects = Effects::of(file)?;
    let arm = effects.changed(&file.arm)?;
    let mut mechanism = Mechanism { arm, elements: Vec::new(), not_expressed: Vec::new() };
    for placed in &effects.placed {
        let (name, mut elements) = (name(placed, file), Vec::new());
        match placed.effect.export_elements(&mut elements) {
            ExportCoverage::Whole => {}
            ExportCoverage::But(part) => mechanism.not_expressed.push(format!("{name}: {part}")),
            ExportCoverage::Not => {
                mechanism.not_expressed.push(nothing(&name, placed.kind, reason(placed.kind)))
            }
            ExportCoverage::Never(why) => mechanism.not_expressed.push(nothing(&name, placed.kind, why)),
        }
        mechanism.elements.extend(elements.into_iter().map(|element| Named { name: name.clone(), element }));
    }
    Ok(mechanism)
}

/// The line for an effect of `kind` that a file omits, with the reason `why`.
fn nothing(name: &str, kind: &Kind, why: &str) -> String {
    format!("{name}: {} ({why})", kind.equation)
}

/// The reason why no format of other tools can express the effects of `kind`.
fn reason(kind: &Kind) -> &'static str {
    let is_of_time = |parameter: &Parameter| {
        matches!(parameter.range, Range::Number { unit: "s", .. })
            && ["start", "time", "time_constant"].contains(&parameter.name)
    };
    match kind.parameters.iter().any(is_of_time) {
        true => "the effect depends on time, and a file of a model has no clock",
        false => "other tools have no such law",
    }
}

/// `coulomb_friction at joint_3`.
fn name(placed: &Placed, file: &ArmFile) -> String {
    let kind = placed.kind.name;
    placed
        .joint
        .map_or_else(|| kind.to_owned(), |joint| format!("{kind} at {}", file.arm.joints()[joint].name))
}
