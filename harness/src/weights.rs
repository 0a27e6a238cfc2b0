//! The weight file of a scenario's controllers.

use std::path::{Path, PathBuf};

use freeplay_controller::narx_qp::NARX_QP;
use freeplay_controller::task::PAPER_MODEL;
use freeplay_terminal::exit::Failure;
use serde_json::{Value, json};

use crate::scenario::{Drive, NO_WEIGHTS, Scenario};

/// Default path of the weights of the model `model`: for `found/model.toml` it is `found/model.weights.json`.
pub fn beside(model: &Path) -> PathBuf {
    model.with_extension("weights.json")
}

/// The weight file of `scenario`: the named one, or else, in mode torque, the one next to the controllers' model. Returns `None` if there is
/// none.
///
/// The effect of an unmodelled torque on the tool depends on the mode, and the weights are trained and proved in mode torque. In other modes the
/// program ignores weights next to the model ([`left_alone`]), and the controller refuses weights that a scenario names.
///
/// # Errors
/// A path that cannot be made absolute.
pub fn of(scenario: &Scenario) -> Result<Option<String>, Failure> {
    let absolute = |path: &Path| {
        let path = std::path::absolute(path).map_err(Failure::input)?;
        Ok(Some(path.display().to_string()))
    };
    match (&scenario.controller.weights, &scenario.controller.model) {
        (Some(named), _) if named == NO_WEIGHTS => Ok(None),
        (Some(named), _) => absolute(Path::new(named)),
        (None, _) if scenario.mode != Drive::Torque => Ok(None),
        (None, _) => beside_model(scenario).map_or(Ok(None), |found| absolute(&found)),
    }
}

/// The weight file next to the controllers' model, if there is one.
fn beside_model(scenario: &Scenario) -> Option<PathBuf> {
    let model = scenario.controller.model.as_ref().filter(|model| *model != PAPER_MODEL)?;
    Some(beside(Path::new(model))).filter(|found| found.is_file())
}

/// Note on weights next to the model that `scenario` ignores, because its mode is not torque.
pub fn left_alone(scenario: &Scenario) -> Option<String> {
    let mode = match scenario.mode {
        Drive::Torque => return None,
        Drive::Driven => "driven",
        Drive::Servo => "servo",
    };
    let mut controllers = scenario.controllers.iter().chain(&scenario.standby);
    if scenario.controller.weights.is_some() || !controllers.any(|controller| controller == NARX_QP) {
        return None;
    }
    let found = beside_model(scenario)?;
    Some(format!(
        "{} is not used: it was learned in mode torque, but this run has mode {mode}; the physics alone compensates",
        found.display()
    ))
}

/// One line on the weights that the controller of a run used; `None` without weights.
pub fn words(learned: &Value) -> Option<String> {
    let number = |key: &str| learned[key].as_f64();
    let (inside, outside) = (number("inside")?, number("outside")?);
    if learned["proved"] != json!(true) {
        return None;
    }
    Some(format!(
        "the network moves the tool by up to {:.3} mm; {:.0} % of the path lie inside its trained region, {:.0} % so far outside that it does not act there",
        number("greatest_mm")?,
        1e2 * inside,
        1e2 * outside
    ))
}
