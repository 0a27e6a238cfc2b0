//! The part of a scenario's path along which its weights act.

use std::path::Path;

use freeplay_controller::compensation::Motion;
use freeplay_controller::narx_qp::NARX_QP;
use freeplay_controller::remainder::Usage;
use freeplay_controller::{Remainder, WeightFile};
use freeplay_model::ArmFile;
use serde_json::{Value, json};

use crate::scenario::Scenario;
use crate::setup::{Setup, load_model};
use crate::weights::of;

/// The reach of the weights of `scenario` along its path for the controller `controller`: the share of the path inside the trained region, and the
/// greatest output of the network there. Null for a controller without weights.
pub fn reach(scenario: &Scenario, setup: &Setup, controller: &str) -> Value {
    let Ok(Some(name)) = of(scenario) else { return Value::Null };
    if controller != NARX_QP {
        return Value::Null;
    }
    let Ok(file) = WeightFile::load(Path::new(&name)) else { return Value::Null };
    let model = scenario.controller.model.as_deref().map_or_else(|| Ok(setup.truth.clone()), load_model);
    let usage = model.ok().and_then(|model| usage(&file, &model, setup));
    let Some(usage) = usage else { return Value::Null };
    let share = |count: u64| count as f64 / usage.instants.max(1) as f64;
    json!({
        "weights": name, "proved": file.receipt.proved,
        "inside": share(usage.inside), "outside": share(usage.outside),
        "trust": usage.trust / usage.instants.max(1) as f64, "greatest_mm": usage.greatest * 1e3,
    })
}

fn usage(file: &WeightFile, model: &ArmFile, setup: &Setup) -> Option<Usage> {
    let period = setup.plant.period_ns as f64 * 1e-9;
    let effects = freeplay_laws::Effects::of(model).ok()?;
    let arm = effects.changed(&model.arm).ok()?;
    let mut remainder = Remainder::new(file, &arm, period).ok()?;
    let blank = vec![0.0; arm.dof()];
    let [mut q, mut v, mut a] = [blank.clone(), blank.clone(), blank];
    for tick in 0..setup.plant.ticks {
        setup.path.at(tick as f64 * period, &mut q, &mut v, &mut a);
        remainder.at(tick, Motion { q: &q, v: &v, a: &a });
    }
    Some(remainder.usage())
}
