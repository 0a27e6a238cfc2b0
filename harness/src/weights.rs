//! The weight file that the controllers of a scenario are given.

use std::path::{Path, PathBuf};

use freeplay_controller::narx_qp::NARX_QP;
use freeplay_controller::task::PAPER_MODEL;
use freeplay_terminal::exit::Failure;
use serde_json::{Value, json};

use crate::scenario::{Drive, NO_WEIGHTS, Scenario};

/// Where the weights of the model `model` stand if nobody says where: `found/model.toml` has `found/model.weights.json`.
pub fn beside(model: &Path) -> PathBuf {
    model.with_extension("weights.json")
}

/// The weight file of `scenario`: the one that it names, else, in mode torque, the one beside the controllers' model. None if there is none.
///
/// What a torque without a name does to the tool depends on who moves the joints, and it is learned and proved in mode torque: elsewhere weights
/// beside the model are left alone ([`left_alone`]), and weights that a scenario names are refused by the controller.
///
/// # Errors
/// A path that has no absolute one.
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

/// The weight file beside the controllers' model, if there is one.
fn beside_model(scenario: &Scenario) -> Option<PathBuf> {
    let model = scenario.controller.model.as_ref().filter(|model| *model != PAPER_MODEL)?;
    Some(beside(Path::new(model))).filter(|found| found.is_file())
}

/// What to say of weights beside the model that `scenario` does not use, because it is not of mode torque.
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
        "{} is not used: it was learned in mode torque, and this run is of mode {mode}; physics alone compensates",
        found.display()
    ))
}

/// What a run says of the weights that its controller used, in one line; none for one that used none.
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
