//! Variables of residuals: the quantities of the motion on which a residual may depend.

use freeplay_arm::JointKind;
use freeplay_laws::torque_unit;

use crate::data::shapes::way_since_reversal;
use crate::data::stage::Stage;
use crate::report::diagnosis::Variable;
use crate::signals::channel::Kind;

/// The variables that the residual of a channel of this `kind` may depend on. The velocities of the other joints are last.
pub(crate) fn variables(stage: &Stage, kind: Kind) -> Vec<Variable> {
    let joints = 0..stage.arm().dof();
    let mut all = Vec::new();
    match kind {
        Kind::Torque(joint) | Kind::Link(joint) | Kind::Position(joint) => all.extend(of_joint(stage, joint)),
        Kind::Tool(_) => all.extend(joints.clone().flat_map(|joint| of_joint(stage, joint))),
    }
    all.push(time(stage));
    if let Kind::Torque(joint) = kind {
        all.extend(joints.filter(|other| *other != joint).map(|other| velocity(stage, other)));
    }
    all
}

/// The time.
pub(crate) fn time(stage: &Stage) -> Variable {
    let values = stage.motion().t.clone();
    Variable { name: "time".to_owned(), unit: "s", quantity: "time", joint: None, values }
}

/// The variables of `joint`.
pub(crate) fn of_joint(stage: &Stage, joint: usize) -> Vec<Variable> {
    let motion = stage.motion();
    let v = &motion.v[joint];
    let way = way_since_reversal(&stage.whole().q[joint], &stage.whole().v[joint]);
    let new = |quantity, unit, values| variable(stage, joint, quantity, unit, values);
    let kind = stage.arm().joints()[joint].kind;
    let [position, speed, acceleration] = units(kind);
    vec![
        new("direction", "1", v.iter().map(|v| v.signum()).collect()),
        velocity(stage, joint),
        new("speed", speed, v.iter().map(|v| v.abs()).collect()),
        new("position", position, motion.q[joint].clone()),
        new("acceleration", acceleration, motion.a[joint].clone()),
        new("load", torque_unit(kind), stage.load()[joint].clone()),
        Variable {
            name: format!("way of {} since its last reversal", stage.arm().joints()[joint].name),
            ..new("way", position, stage.ground.treatment.keep(&way))
        },
    ]
}

fn velocity(stage: &Stage, joint: usize) -> Variable {
    let [_, unit, _] = units(stage.arm().joints()[joint].kind);
    variable(stage, joint, "velocity", unit, stage.motion().v[joint].clone())
}

/// Units of position, velocity and acceleration of a joint.
fn units(kind: JointKind) -> [&'static str; 3] {
    match kind {
        JointKind::Revolute => ["rad", "rad/s", "rad/s²"],
        JointKind::Prismatic => ["m", "m/s", "m/s²"],
    }
}

fn variable(
    stage: &Stage,
    joint: usize,
    quantity: &'static str,
    unit: &'static str,
    values: Vec<f64>,
) -> Variable {
    let name = format!("{quantity} of {}", stage.arm().joints()[joint].name);
    Variable { name, unit, quantity, joint: Some(joint), values }
}
