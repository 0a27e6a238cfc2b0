//! Variables of residuals: the quantities of the motion on which a residual may depend.

use freeplay_arm::JointKind;
use freeplay_laws::torque_unit;

use crate::data::linearised::LinearisedRecording;
use crate::data::shapes::way_since_reversal;
use crate::report::diagnosis::Variable;
use crate::signals::channel::Kind;

/// The variables that the residual of a channel of this `kind` may depend on. The velocities of the other joints are last.
pub(crate) fn variables(recording: &LinearisedRecording, kind: Kind) -> Vec<Variable> {
    let joints = 0..recording.arm().dof();
    let mut all = Vec::new();
    match kind {
        Kind::Torque(joint) | Kind::Link(joint) | Kind::Position(joint) => {
            all.extend(of_joint(recording, joint))
        }
        Kind::Tool(_) => all.extend(joints.clone().flat_map(|joint| of_joint(recording, joint))),
    }
    all.push(time(recording));
    if let Kind::Torque(joint) = kind {
        all.extend(joints.filter(|other| *other != joint).map(|other| velocity(recording, other)));
    }
    all
}

/// The time.
pub(crate) fn time(recording: &LinearisedRecording) -> Variable {
    let values = recording.motion().t.clone();
    Variable { name: "time".to_owned(), unit: "s", quantity: "time", joint: None, values }
}

/// The variables of `joint`.
pub(crate) fn of_joint(recording: &LinearisedRecording, joint: usize) -> Vec<Variable> {
    let motion = recording.motion();
    let v = &motion.v[joint];
    let way = way_since_reversal(&recording.whole().q[joint], &recording.whole().v[joint]);
    let new = |quantity, unit, values| variable(recording, joint, quantity, unit, values);
    let kind = recording.arm().joints()[joint].kind;
    let [position, speed, acceleration] = units(kind);
    vec![
        new("direction", "1", v.iter().map(|v| v.signum()).collect()),
        velocity(recording, joint),
        new("speed", speed, v.iter().map(|v| v.abs()).collect()),
        new("position", position, motion.q[joint].clone()),
        new("acceleration", acceleration, motion.a[joint].clone()),
        new("load", torque_unit(kind), recording.load()[joint].clone()),
        Variable {
            name: format!("way of {} since its last reversal", recording.arm().joints()[joint].name),
            ..new("way", position, recording.prepared.treatment.keep(&way))
        },
    ]
}

fn velocity(recording: &LinearisedRecording, joint: usize) -> Variable {
    let [_, unit, _] = units(recording.arm().joints()[joint].kind);
    variable(recording, joint, "velocity", unit, recording.motion().v[joint].clone())
}

/// Units of position, velocity and acceleration of a joint.
fn units(kind: JointKind) -> [&'static str; 3] {
    match kind {
        JointKind::Revolute => ["rad", "rad/s", "rad/s²"],
        JointKind::Prismatic => ["m", "m/s", "m/s²"],
    }
}

fn variable(
    recording: &LinearisedRecording,
    joint: usize,
    quantity: &'static str,
    unit: &'static str,
    values: Vec<f64>,
) -> Variable {
    let name = format!("{quantity} of {}", recording.arm().joints()[joint].name);
    Variable { name, unit, quantity, joint: Some(joint), values }
}
