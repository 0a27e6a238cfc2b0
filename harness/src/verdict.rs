//! Verdict on a run, and the texts for the cause of a stop or a refusal.
//!
//! A run that reached its end is not necessarily sound. It fails if a joint exceeded its speed limit for longer than an impact lasts. It also
//! fails if the tool deviated more than is possible while every joint keeps the tracking limit of `[reflex]`: the sum of the joints' limits
//! times their levers, and the clearances. If that limit is switched off, the arm need not follow its reference, and the verdict ignores its
//! deviation.

use freeplay_arm::Joint;
use freeplay_plant::{Ending, LimitViolation, Plant, RefusedCommand, SPEED_MARGIN, Stop};
use serde_json::{Value, json};

/// Number of consecutive ticks for which a joint may exceed its speed limit: a few more than an impact in a bearing lasts.
const MOST_TICKS_BEYOND: u32 = 5;

/// The verdict on the run of `plant` until its `ending`: "passed", "failed" or "interrupted", and each violated rule.
pub fn verdict(plant: &Plant, ending: Ending) -> (&'static str, Vec<Value>) {
    let mut failures = Vec::new();
    match ending {
        Ending::Braked { tick, reason } => {
            failures.push(json!({ "rule": "stopped", "tick": tick, "reason": reason.name() }));
        }
        Ending::Diverged { tick } => failures.push(json!({ "rule": "diverged", "tick": tick })),
        Ending::Finished | Ending::Interrupted { .. } => {}
    }
    for (joint, used) in plant.arm().joints().iter().zip(plant.joint_use().joints()) {
        if used.ticks_beyond_speed > MOST_TICKS_BEYOND {
            let limit = used.speed.limit.map(|limit| SPEED_MARGIN * limit);
            failures.push(json!({
                "rule": "speed", "joint": joint.name, "value": used.speed.peak, "limit": limit,
                "unit": freeplay_plant::Quantity::Speed.unit(joint.kind), "ticks": used.ticks_beyond_speed,
            }));
        }
    }
    let [norm, ..] = plant.tool_deviation().components();
    let limit = plant.reflex_limits().deviation * 1e3;
    if norm.max > limit {
        failures.push(json!({ "rule": "deviation", "value": norm.max, "limit": limit, "unit": "mm" }));
    }
    let word = match ending {
        _ if !failures.is_empty() => "failed",
        Ending::Interrupted { .. } => "interrupted",
        _ => "passed",
    };
    (word, failures)
}

/// `excess` as `quantity`, `joint`, `value`, `limit` and `unit`; all are null without an excess.
fn limit(excess: Option<LimitViolation>, joints: &[Joint]) -> Value {
    let of = excess.and_then(|excess| Some((excess, joints.get(excess.joint)?)));
    json!({
        "quantity": of.map(|(excess, _)| excess.quantity.name()),
        "joint": of.map(|(_, joint)| &joint.name),
        "value": of.map(|(excess, _)| excess.value),
        "limit": of.map(|(excess, _)| excess.limit),
        "unit": of.map(|(excess, joint)| excess.quantity.unit(joint.kind)),
    })
}

/// `stop` in the format of `summary.json`.
pub fn stopped(stop: &Stop, joints: &[Joint]) -> Value {
    let mut value = limit(stop.excess, joints);
    (value["reason"], value["tick"]) = (json!(stop.reason.name()), json!(stop.tick));
    value
}

/// `refusal` of one of the controllers `names`, in the format of `summary.json`.
pub fn refused(refusal: &RefusedCommand, joints: &[Joint], names: &[String]) -> Value {
    let mut value = limit(refusal.excess, joints);
    (value["reason"], value["tick"]) = (json!(refusal.reason.name()), json!(refusal.tick));
    value["controller"] = json!(names.get(refusal.slot));
    value["takes_over"] = json!(refusal.takes_over);
    value
}

/// A number with four digits for a person.
fn number(value: &Value) -> String {
    let value = value.as_f64().unwrap_or(f64::NAN);
    if value.abs() >= 1e7 {
        return format!("{value:.3e}");
    }
    let size = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    let digits = usize::try_from(3 - size).unwrap_or(0).min(9);
    format!("{value:.digits$}")
}

/// Text on an exceeded limit: "joint_6: speed 11.31 rad/s, limit 11.24 rad/s"; `None` if `value` names no joint.
pub fn limit_words(value: &Value) -> Option<String> {
    let (joint, unit) =
        (value["joint"].as_str()?, value["unit"].as_str()?.replace('*', "·").replace("^2", "²"));
    let quantity = match value["quantity"].as_str()? {
        "tracking" => "distance from its reference".to_owned(),
        "position" if value["reason"] == "position" => "would come to rest at".to_owned(),
        quantity => quantity.replace('_', " "),
    };
    let [found, limit] = ["value", "limit"].map(|key| number(&value[key]));
    Some(format!("{joint}: {quantity} {found} {unit}, limit {limit} {unit}"))
}

/// Text on a violated rule other than a stop of the arm.
pub fn failure_words(failure: &Value) -> Option<String> {
    let [value, limit] = ["value", "limit"].map(|key| number(&failure[key]));
    let unit = failure["unit"].as_str().unwrap_or_default();
    match failure["rule"].as_str()? {
        "speed" => Some(format!(
            "{} was faster than {limit} {unit} for {} ticks in a row, at most {value} {unit}",
            failure["joint"].as_str().unwrap_or("?"),
            failure["ticks"],
        )),
        "deviation" => Some(format!(
            "the tool was {value} {unit} off, more than the {limit} {unit} that joints within their tracking limits and the play can cause"
        )),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{failure_words, limit_words, stopped};
    use freeplay_plant::{LimitViolation, Quantity, Stop, StopReason};
    use serde_json::json;

    #[test]
    fn a_stop_is_told_with_joint_value_limit_and_tick() {
        let arm = freeplay_model::paper_arm().arm;
        let excess = LimitViolation { quantity: Quantity::Speed, joint: 5, value: 11.312_34, limit: 11.235 };
        let stop = Stop { tick: 123, reason: StopReason::Reflex(Quantity::Speed), excess: Some(excess) };
        let value = stopped(&stop, arm.joints());
        let expected = json!({
            "reason": "speed", "quantity": "speed", "joint": "joint_6", "value": 11.312_34, "limit": 11.235,
            "unit": "rad/s", "tick": 123,
        });
        assert_eq!(value, expected);
        assert_eq!(limit_words(&value).as_deref(), Some("joint_6: speed 11.31 rad/s, limit 11.23 rad/s"));
        let silent =
            Stop { reason: StopReason::Rejected(freeplay_plant::Rejection::Missing), excess: None, ..stop };
        let value = stopped(&silent, arm.joints());
        assert_eq!((&value["reason"], &value["joint"]), (&json!("missing"), &json!(null)));
        assert_eq!(limit_words(&value), None);
    }

    #[test]
    fn failures_are_told_in_words() {
        let far = json!({ "rule": "deviation", "value": 1518.0, "limit": 512.3, "unit": "mm" });
        assert!(failure_words(&far).unwrap().contains("1518 mm off, more than the 512.3 mm"));
        assert_eq!(failure_words(&json!({ "rule": "stopped", "tick": 3, "reason": "speed" })), None);
    }
}
