//! The nuisances of a recording: each permitted difference between machine and model, as a column of the channels.

use freeplay_arm::{Joint, JointKind};
use freeplay_laws::{ArmParts, DriveFriction, Placed, Tolerance};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::conventions::{Late, zero_unsure};
use crate::data::columns::Answer;
use crate::data::linearised::LinearisedRecording;
use crate::data::tolerance::{Nuisance, Of, Tolerances, even};
use crate::signals::channel::Kind;

/// All nuisances of `recording`, the same in number and order for every recording of an arm. The zeros of the joints `fitted_zeros` are uncertain.
pub(crate) fn nuisances(
    recording: &LinearisedRecording,
    tolerances: &Tolerances,
    fitted_zeros: &[usize],
) -> Vec<Nuisance> {
    let mut all = of_links(recording, tolerances, fitted_zeros);
    all.extend(of_friction(recording, tolerances));
    all.extend(of_laws(recording, tolerances));
    all.extend(of_zeros(recording, tolerances));
    // An arm that can't exist gets the sensors of the model's arm.
    let let_through = recording.let_through().unwrap_or_default();
    for nuisance in &mut all {
        nuisance.answer = recording.as_recorded(std::mem::take(&mut nuisance.answer), &let_through);
    }
    // These belong to the readings.
    all.extend(of_delays(recording, tolerances));
    all.extend(of_tracker(recording, tolerances));
    all
}

/// Masses, centres of mass, inertias and lengths, and the zeros of joints that the test of conventions fitted without the missing effects. These effects act
/// on the changed arm, too: a payload may be heavier than the links behind such a joint.
fn of_links(
    recording: &LinearisedRecording,
    tolerances: &Tolerances,
    fitted_zeros: &[usize],
) -> Vec<Nuisance> {
    let nominal = recording.arm();
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
    for &joint in fitted_zeros {
        let of = Of::FittedZero(joint, even() * zero_unsure());
        vary(format!("fitted zero of {}", nominal.joints()[joint].name), of);
    }
    let answers = recording.answers_of(&arms);
    let one = |((name, of), answer)| Nuisance { name, answer, free: false, of };
    varied.into_iter().zip(answers).map(one).collect()
}

/// Directions in which the centre of mass of the link of `joint` affects the torque of that joint: the two across its axis; none for a prismatic joint, where
/// an offset belongs to the link before.
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

/// The friction of the model.
fn of_friction(recording: &LinearisedRecording, tolerances: &Tolerances) -> Vec<Nuisance> {
    let mut all = Vec::new();
    for (index, joint) in recording.arm().joints().iter().enumerate() {
        let nominal = DriveFriction::nominal(joint.friction);
        let scale = even() * tolerances.friction;
        if nominal.viscous > 0.0 {
            let column: Vec<f64> =
                recording.motion().v[index].iter().map(|v| scale * nominal.viscous * v).collect();
            let name = format!("viscous friction of {}", joint.name);
            all.push(on_torque(recording, index, name, &column, Of::Viscous(index)));
        }
        if nominal.coulomb > 0.0 {
            let jump = DriveFriction { viscous: 0.0, ..nominal };
            let column: Vec<f64> =
                recording.whole().v[index].iter().map(|v| scale * jump.resisting(*v)).collect();
            let column = recording.treated(&column);
            let name = format!("Coulomb friction of {}", joint.name);
            all.push(on_torque(recording, index, name, &column, Of::Coulomb(index)));
        }
    }
    all
}

fn on_torque(
    recording: &LinearisedRecording,
    index: usize,
    name: String,
    column: &[f64],
    of: Of,
) -> Nuisance {
    let answer = recording.by_channel(|kind| (kind == Kind::Torque(index)).then(|| column.to_vec()));
    Nuisance { name, answer, free: false, of }
}

/// The strength of the laws in the arm file; their changes of the arm are in the arm's own parameters.
fn of_laws(recording: &LinearisedRecording, tolerances: &Tolerances) -> Vec<Nuisance> {
    let tolerance = |placed: &Placed| match placed.kind.tolerance? {
        Tolerance::Friction => Some(tolerances.friction),
        Tolerance::Inertia => Some(tolerances.inertia),
        // The changes of the arm by these laws are in its own parameters.
        Tolerance::Mass | Tolerance::Zero | Tolerance::Length | Tolerance::Delay => None,
    };
    let mut all = Vec::new();
    for placed in recording.known() {
        let Some(tolerance) = tolerance(placed) else { continue };
        // The law once more, times its relative tolerance.
        let Ok(mut answer) = recording.answer(placed) else { continue };
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
fn of_zeros(recording: &LinearisedRecording, tolerances: &Tolerances) -> Vec<Nuisance> {
    let points = recording.motion().len();
    let joints = recording.arm().joints().iter().enumerate();
    joints
        .map(|(index, joint)| {
            let mut shift = vec![vec![0.0; points]; recording.arm().dof()];
            shift[index].fill(even() * tolerances.zero);
            let name = format!("encoder zero of {}", joint.name);
            let answer = recording.rigid_answer(recording.arm(), Some(&shift));
            Nuisance { name, answer, free: false, of: Of::Zero }
        })
        .collect()
}

/// Delays between the channels. A torque that is held from one sample to the next is already late or early by half a sample.
fn of_delays(recording: &LinearisedRecording, tolerances: &Tolerances) -> Vec<Nuisance> {
    let held = 0.5 / recording.prepared.treatment.rate_hz();
    let late = |kinds: fn(Kind) -> bool, seconds: f64, name: &str, of: Of| {
        let answer = recording.channels.iter().map(|channel| {
            kinds(channel.kind).then(|| {
                let rate = recording.rate_of_change(channel.kind);
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

/// The tracker's frame, and the zeros of link encoders, which nobody aligns with the motors'.
fn of_tracker(recording: &LinearisedRecording, tolerances: &Tolerances) -> Vec<Nuisance> {
    let tool = |kind| matches!(kind, Kind::Tool(_));
    let model: Vec<&Vec<f64>> =
        recording.channels.iter().filter(|c| tool(c.kind)).map(|c| &c.model).collect();
    let mut all = Vec::new();
    if let [x, y, z] = model.as_slice() {
        let mut vary = |name: &str, pose: Isometry3<f64>| {
            let moved: Vec<Vector3<f64>> = (0..x.len())
                .map(|k| {
                    let at = nalgebra::Point3::new(x[k], y[k], z[k]);
                    pose * at - at
                })
                .collect();
            let answer = recording.by_channel(|kind| match kind {
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
    for (index, channel) in recording.channels.iter().enumerate() {
        if let Kind::Link(_) = channel.kind {
            let mut answer: Answer = vec![None; recording.channels.len()];
            answer[index] = Some(vec![1e-3; recording.motion().len()]);
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
