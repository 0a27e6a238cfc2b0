//! How far a machine may be from its model without that being a finding.

use freeplay_arm::{Joint, JointKind};
use freeplay_laws::{ArmParts, DriveFriction, Kind as EffectKind, Placed, Tolerance};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::stage::{Answer, Stage};
use crate::conventions::Late;
use crate::residual::Kind;

/// Tolerances of the nominal model: half the width within which a machine of that model may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Mass of a link, as a fraction.
    pub mass: f64,
    /// Inertia of a link about its centre of mass, and of a rotor that the model names, as a fraction.
    pub inertia: f64,
    /// Friction that the model names, its laws in the arm file included, as a fraction.
    pub friction: f64,
    /// Zero of an encoder, rad (m for a slide).
    pub zero: f64,
    /// Length between joints, position of the tool, and distance of a link's centre of mass from where it should be, m; along each axis of that 1/√3 as much.
    pub length: f64,
    /// Delay of the torques, of the tracker and of the link encoders against the joint encoders, s.
    pub delay: f64,
    /// Orientation of the tracker's frame, rad.
    pub frame: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self { mass: 0.02, inertia: 0.02, friction: 0.05, zero: 1e-4, length: 1e-4, delay: 6e-4, frame: 1e-4 }
    }
}

impl Tolerances {
    /// Whether an effect of `kind` with these `parameters` is a difference inside the tolerances: no finding. A torque that is held from one sample to the next,
    /// `step` s, is half of that late or early by itself.
    pub(crate) fn hold(&self, kind: &EffectKind, parameters: &toml::Table, step: f64) -> bool {
        let (name, neutral, tolerance) = match kind.tolerance {
            Some(Tolerance::Zero) => ("offset", 0.0, self.zero),
            Some(Tolerance::Length) => ("offset", 0.0, self.length),
            Some(Tolerance::Mass) => ("scale", 1.0, self.mass),
            Some(Tolerance::Delay) => {
                let is_held = parameters.get("channel").and_then(toml::Value::as_str) == Some("torque");
                ("delay", 0.0, self.delay + if is_held { 0.5 * step } else { 0.0 })
            }
            Some(Tolerance::Inertia | Tolerance::Friction) | None => return false,
        };
        parameters.get(name).and_then(toml::Value::as_float).is_some_and(|x| (x - neutral).abs() <= tolerance)
    }
}

/// Standard deviation of a quantity spread evenly over ±1: 1/√3.
pub(crate) fn even() -> f64 {
    1.0 / 3.0_f64.sqrt()
}

/// A nuisance: a direction in which the machine may differ from its model, scaled so that its prior is a normal of variance one.
#[derive(Debug)]
pub(crate) struct Nuisance {
    /// What it is, for people.
    pub name: String,
    /// What one standard deviation of it adds to each channel.
    pub answer: Answer,
    /// Whether it has no prior at all: the zero of a link encoder.
    pub free: bool,
    /// What of the machine it is.
    pub of: Of,
}

/// What of a machine is uncertain. Joints by number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Of {
    /// Mass of a link.
    Mass(usize),
    /// Inertia of a link about its centre of mass.
    Inertia(usize),
    /// Centre of mass of a link, along a direction of its frame.
    Centre(usize, Vector3<f64>),
    /// Inertia of a rotor that the model names.
    Rotor(usize),
    /// Length between a joint and the one before.
    Length(usize),
    /// Length of the tool.
    Tool,
    /// Viscous friction that the model names.
    Viscous(usize),
    /// Coulomb friction that the model names.
    Coulomb(usize),
    /// The strength of a law that the arm file has.
    Law,
    /// Zero of an encoder.
    Zero,
    /// Delay of the torques or of the tracker, and how many seconds one standard deviation of it is.
    Delay(Late, f64),
    /// A property of the measurement other than a delay: the tracker's frame, the zero of a link encoder.
    Measurement,
}

impl Of {
    /// Changes `parts` by so many standard `deviations` of it; what an arm file does not say leaves them as they are.
    pub fn change(self, parts: &mut ArmParts, tolerances: &Tolerances, deviations: f64) {
        let by = |tolerance: f64| even() * tolerance * deviations;
        match self {
            Self::Mass(joint) => parts.joints[joint].inertia.mass *= 1.0 + by(tolerances.mass),
            Self::Inertia(joint) => parts.joints[joint].inertia.about_com *= 1.0 + by(tolerances.inertia),
            Self::Centre(joint, along) => {
                parts.joints[joint].inertia.com += even() * by(tolerances.length) * along
            }
            Self::Rotor(joint) => parts.joints[joint].rotor_inertia *= 1.0 + by(tolerances.inertia),
            Self::Length(joint) => lengthen(&mut parts.joints[joint].placement, by(tolerances.length)),
            Self::Tool => lengthen(&mut parts.tool, by(tolerances.length)),
            Self::Viscous(joint) => parts.joints[joint].friction.viscous *= 1.0 + by(tolerances.friction),
            Self::Coulomb(joint) => parts.joints[joint].friction.coulomb *= 1.0 + by(tolerances.friction),
            Self::Law | Self::Zero | Self::Delay(..) | Self::Measurement => {}
        }
    }
}

/// All nuisances of `stage`, the same in number and order for every recording of an arm.
pub(crate) fn nuisances(stage: &Stage, tolerances: &Tolerances) -> Vec<Nuisance> {
    let mut all = of_links(stage, tolerances);
    all.extend(of_friction(stage, tolerances));
    all.extend(of_laws(stage, tolerances));
    all.extend(of_zeros(stage, tolerances));
    all.extend(of_delays(stage, tolerances));
    all.extend(of_tracker(stage, tolerances));
    // An arm that can't exist lets through what the arm of the model does.
    let let_through = stage.let_through().unwrap_or_default();
    for nuisance in &mut all {
        for (answer, share) in nuisance.answer.iter_mut().zip(&let_through) {
            let both = answer.iter_mut().flatten().zip(share.iter().flatten());
            both.for_each(|(x, share)| *x *= share);
        }
    }
    all
}

/// Masses, centres of mass, inertias and lengths.
fn of_links(stage: &Stage, tolerances: &Tolerances) -> Vec<Nuisance> {
    let nominal = stage.arm();
    let (mut varied, mut arms) = (Vec::new(), Vec::new());
    let mut vary = |name: String, of: Of| {
        let mut parts = ArmParts::of(nominal);
        of.change(&mut parts, tolerances, 1.0);
        if let Ok(arm) = parts.into_arm(nominal.name()) {
            varied.push((name, of));
            arms.push(arm);
        }
    };
    for (index, joint) in nominal.joints().iter().enumerate() {
        let name = &joint.name;
        vary(format!("mass of link {name}"), Of::Mass(index));
        vary(format!("inertia of link {name}"), Of::Inertia(index));
        vary(format!("length before {name}"), Of::Length(index));
        if joint.rotor_inertia > 0.0 {
            vary(format!("rotor of {name}"), Of::Rotor(index));
        }
        if joint.inertia.mass > 0.0 {
            across(joint)
                .into_iter()
                .for_each(|along| vary(format!("centre of mass of link {name}"), Of::Centre(index, along)));
        }
    }
    vary("length of the tool".to_owned(), Of::Tool);
    let answers = stage.answers_of(&arms);
    let one = |((name, of), answer)| Nuisance { name, answer, free: false, of };
    varied.into_iter().zip(answers).map(one).collect()
}

/// Directions in which the centre of mass of the link of `joint` shows: along the axis, and where the joint slides, it is the link before that has
/// it elsewhere.
fn across(joint: &Joint) -> Vec<Vector3<f64>> {
    match joint.kind {
        JointKind::Prismatic => Vec::new(),
        JointKind::Revolute => {
            let axis = joint.axis.into_inner();
            let across = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
            vec![across, axis.cross(&across)]
        }
    }
}

/// Adds `amount` to the length of a way that has one.
fn lengthen(way: &mut Isometry3<f64>, amount: f64) {
    if let Some(direction) = way.translation.vector.try_normalize(1e-6) {
        way.translation.vector += direction * amount;
    }
}

/// The friction that the model names.
fn of_friction(stage: &Stage, tolerances: &Tolerances) -> Vec<Nuisance> {
    let mut all = Vec::new();
    for (index, joint) in stage.arm().joints().iter().enumerate() {
        let nominal = DriveFriction::nominal(joint.friction);
        let scale = even() * tolerances.friction;
        if nominal.viscous > 0.0 {
            let column: Vec<f64> =
                stage.motion().v[index].iter().map(|v| scale * nominal.viscous * v).collect();
            let name = format!("viscous friction of {}", joint.name);
            all.push(on_torque(stage, index, name, &column, Of::Viscous(index)));
        }
        if nominal.coulomb > 0.0 {
            let jump = DriveFriction { viscous: 0.0, ..nominal };
            let column: Vec<f64> =
                stage.whole().v[index].iter().map(|v| scale * jump.resisting(*v)).collect();
            let column = stage.treated(&column);
            let name = format!("Coulomb friction of {}", joint.name);
            all.push(on_torque(stage, index, name, &column, Of::Coulomb(index)));
        }
    }
    all
}

fn on_torque(stage: &Stage, index: usize, name: String, column: &[f64], of: Of) -> Nuisance {
    let answer = stage.by_channel(|kind| (kind == Kind::Torque(index)).then(|| column.to_vec()));
    Nuisance { name, answer, free: false, of }
}

/// The strength of the laws that the arm file has; what they change of the arm is in its own numbers.
fn of_laws(stage: &Stage, tolerances: &Tolerances) -> Vec<Nuisance> {
    let tolerance = |placed: &Placed| match placed.kind.tolerance? {
        Tolerance::Friction => Some(tolerances.friction),
        Tolerance::Inertia => Some(tolerances.inertia),
        // What these change of the arm is in its own numbers.
        Tolerance::Mass | Tolerance::Zero | Tolerance::Length | Tolerance::Delay => None,
    };
    let mut all = Vec::new();
    for placed in stage.known() {
        let Some(tolerance) = tolerance(placed) else { continue };
        // As much of it once more, but for the share.
        let Ok(mut answer) = stage.answer(placed) else { continue };
        answer.iter_mut().flatten().flatten().for_each(|x| *x *= even() * tolerance);
        all.push(Nuisance {
            name: format!("{} in the arm file", placed.kind.title),
            answer,
            free: false,
            of: Of::Law,
        });
    }
    all
}

/// Zeros of the encoders.
fn of_zeros(stage: &Stage, tolerances: &Tolerances) -> Vec<Nuisance> {
    let points = stage.motion().len();
    let joints = stage.arm().joints().iter().enumerate();
    joints
        .map(|(index, joint)| {
            let mut shift = vec![vec![0.0; points]; stage.arm().dof()];
            shift[index].fill(even() * tolerances.zero);
            let name = format!("encoder zero of {}", joint.name);
            let answer = stage.rigid_answer(stage.arm(), Some(&shift));
            Nuisance { name, answer, free: false, of: Of::Zero }
        })
        .collect()
}

/// Delays between the channels. A torque that is held from one sample to the next is half a sample late or early by itself.
fn of_delays(stage: &Stage, tolerances: &Tolerances) -> Vec<Nuisance> {
    let held = 0.5 / stage.ground.treatment.rate_hz();
    let late = |kinds: fn(Kind) -> bool, seconds: f64, name: &str, of: Of| {
        let answer = stage.channels.iter().map(|channel| {
            kinds(channel.kind).then(|| {
                let rate = stage.rate_of_change(channel.kind);
                rate.iter().map(|rate| -seconds * rate).collect()
            })
        });
        Nuisance { name: name.to_owned(), answer: answer.collect(), free: false, of }
    };
    let delay = even() * tolerances.delay;
    let torques = delay.hypot(even() * held);
    vec![
        late(
            |kind| matches!(kind, Kind::Torque(_)),
            torques,
            "delay of the torques",
            Of::Delay(Late::Torque, torques),
        ),
        late(
            |kind| matches!(kind, Kind::Tool(_)),
            delay,
            "delay of the tracker",
            Of::Delay(Late::Tool, delay),
        ),
        late(|kind| matches!(kind, Kind::Link(_)), delay, "delay of the link encoders", Of::Measurement),
    ]
}

/// The tracker's frame, and the zeros of link encoders, which nobody sets against the motors'.
fn of_tracker(stage: &Stage, tolerances: &Tolerances) -> Vec<Nuisance> {
    let tool = |kind| matches!(kind, Kind::Tool(_));
    let model: Vec<&Vec<f64>> = stage.channels.iter().filter(|c| tool(c.kind)).map(|c| &c.model).collect();
    let mut all = Vec::new();
    if let [x, y, z] = model.as_slice() {
        let mut vary = |name: &str, pose: Isometry3<f64>| {
            let moved: Vec<Vector3<f64>> = (0..x.len())
                .map(|k| {
                    let at = nalgebra::Point3::new(x[k], y[k], z[k]);
                    pose * at - at
                })
                .collect();
            let answer = stage.by_channel(|kind| match kind {
                Kind::Tool(axis) => Some(moved.iter().map(|moved| moved[axis]).collect()),
                _ => None,
            });
            all.push(Nuisance { name: name.to_owned(), answer, free: false, of: Of::Measurement });
        };
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let mut way = Vector3::zeros();
            way[axis] = even() * tolerances.length;
            vary(&format!("tracker along {name}"), Translation3::from(way).into());
            way[axis] = even() * tolerances.frame;
            let turned = UnitQuaternion::from_scaled_axis(way);
            vary(&format!("tracker about {name}"), Isometry3::from_parts(Translation3::identity(), turned));
        }
    }
    for (index, channel) in stage.channels.iter().enumerate() {
        if let Kind::Link(_) = channel.kind {
            let mut answer: Answer = vec![None; stage.channels.len()];
            answer[index] = Some(vec![1e-3; stage.motion().len()]);
            all.push(Nuisance {
                name: format!("zero of {}", channel.name),
                answer,
                free: true,
                of: Of::Measurement,
            });
        }
    }
    all
}
