//! Decides if a recording can distinguish an effect from a simpler one at all, and which effects are equivalent.
//!
//! A gap that is never crossed is an offset; a joint that is always bent the same way is one too. A journal that always rests on one side is a longer link. An
//! oil film that leaves its journal at the wall makes a dry bearing. Friction at low speed is invisible if the joint passes that speed at once. Such a case has
//! no answer: it is made anew with another motion or machine.

use std::f64::consts::TAU;

use freeplay_arm::{Arm, Joint, JointKind};
use nalgebra::Vector3;
use serde::Serialize;

use crate::calibrate::{Floor, Residual};
use crate::machine::Trace;
use crate::physics::{Effect, Physics};

/// Least share of the time that a gap is open to each side.
const EACH_SIDE: f64 = 0.08;
/// Least number of crossings of a gap.
const CROSSINGS: usize = 3;
/// Most crossings in a second: a gear that clatters faster than any motion reverses belongs to a servo that has lost its damping.
const CLATTER: f64 = 5.0;
/// Least share of the time in slow motion, for an effect at low speed.
const SLOW: f64 = 0.04;
/// Rows of a trace from one check of a gap or a speed to the next.
const LOOK: usize = 8;
/// Least standard deviation of a deflection, as a share of its root mean square.
const VARIED: f64 = 0.3;
/// A journal beyond this share of the clearance is at its wall; and the least share of the time that it floats.
const AT_WALL: f64 = 0.9;
const AFLOAT: f64 = 0.1;
/// Least range of a joint in periods of a position-dependent effect.
const PERIODS: f64 = 1.0;
/// Approximate ratio of a joint's range to the standard deviation of its position.
const RANGE: f64 = 3.4;

/// An equivalent effect: another name that explains a recording as well.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Equivalent {
    /// Kinds that together are the same.
    pub kinds: Vec<&'static str>,
    /// Name of the joint.
    pub joint: Option<String>,
    /// Why.
    pub why: &'static str,
}

/// True if the motion shows the particular features of the effect; `with` and `without` are the residuals, `trace` is that of the machine with the effect.
pub(crate) fn is_distinct(
    effect: &Effect,
    trace: &Trace,
    with: &Residual,
    without: &Residual,
    floor: &Floor,
) -> bool {
    let Some(joint) = effect.joint else { return true };
    // A gap knocks at each crossing; that does not count as shaking.
    let springs = matches!(effect.physics, Physics::JointElasticity { .. } | Physics::LinkFlexure { .. });
    if springs && with.shakes(floor) {
        return false;
    }
    let range = RANGE * floor.way[joint];
    match effect.physics {
        Physics::Backlash { gap, .. } => is_crossed(&leads(trace, joint), gap, LOOK as f64 * trace.step),
        Physics::StribeckFriction { velocity, .. } => moves_slowly(trace, joint, velocity),
        Physics::JointElasticity { .. } => {
            varied(leads(trace, joint).into_iter().map(|lead| [lead, 0.0, 0.0]))
        }
        Physics::LubricatedClearance { clearance, .. } => {
            varied(with.tool_shift(without)) && floats(with.tool_shift(without), clearance)
        }
        Physics::JointClearance { .. } | Physics::LinkFlexure { .. } => varied(with.tool_shift(without)),
        Physics::PositionDependentFriction { periods, .. } | Physics::TorqueRipple { periods, .. } => {
            periods * range >= PERIODS * TAU
        }
        // Less than a third of a turn of a sine is a line.
        Physics::EncoderEccentricity { .. } => range >= TAU / 3.0,
        _ => true,
    }
}

/// True if the motion without any effect could show one of `kind` at `joint`: a gap needs a load that reverses, a position-dependent effect needs range. This
/// check is cheaper than a trial run.
pub(crate) fn can_be_distinct(kind: &str, joint: usize, floor: &Floor) -> bool {
    match kind {
        "backlash" => floor.reversal[joint] >= 1.5 * EACH_SIDE,
        "encoder_eccentricity" => RANGE * floor.way[joint] >= TAU / 3.0,
        _ => true,
    }
}

/// Lead of the motor over its link, rad, along a trace.
fn leads(trace: &Trace, joint: usize) -> Vec<f64> {
    (0..trace.len()).step_by(LOOK).map(|row| trace.motor(row)[joint] - trace.link(row)[joint]).collect()
}

/// True if a gap is crossed in both directions and no servo clatters in it; `leads` are `step` s apart.
fn is_crossed(leads: &[f64], gap: f64, step: f64) -> bool {
    let side = |lead: &f64| i8::from(*lead > 0.4 * gap) - i8::from(*lead < -0.4 * gap);
    let sides: Vec<i8> = leads.iter().map(side).filter(|side| *side != 0).collect();
    let share =
        |wanted: i8| sides.iter().filter(|s| **s == wanted).count() as f64 / leads.len().max(1) as f64;
    let crossings = sides.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let most = CLATTER * step * leads.len() as f64;
    share(1) >= EACH_SIDE && share(-1) >= EACH_SIDE && crossings >= CROSSINGS && crossings as f64 <= most
}

/// True if the motor of `joint` moves at less than twice `velocity`, without standing, for more than an instant at each reversal.
fn moves_slowly(trace: &Trace, joint: usize, velocity: f64) -> bool {
    let step = LOOK as f64 * trace.step;
    let places: Vec<f64> = (0..trace.len()).step_by(LOOK).map(|row| trace.motor(row)[joint]).collect();
    let speeds = places.windows(2).map(|pair| (pair[1] - pair[0]).abs() / step);
    let slow = speeds.filter(|speed| (0.02 * velocity..2.0 * velocity).contains(speed)).count();
    slow as f64 >= SLOW * places.len() as f64
}

/// True if a film of oil keeps its journal away from the wall at `clearance` for long enough; the tool moves with the journal.
fn floats(shifts: impl Iterator<Item = [f64; 3]>, clearance: f64) -> bool {
    let at_wall = |shift: [f64; 3]| shift.iter().map(|x| x * x).sum::<f64>().sqrt() > AT_WALL * clearance;
    let (mut afloat, mut all) = (0, 0);
    for shift in shifts {
        afloat += usize::from(!at_wall(shift));
        all += 1;
    }
    afloat as f64 >= AFLOAT * all as f64
}

fn varied(shifts: impl Iterator<Item = [f64; 3]>) -> bool {
    let (mut sum, mut squares, mut count) = ([0.0; 3], 0.0, 0.0);
    for shift in shifts {
        sum.iter_mut().zip(shift).for_each(|(sum, x)| *sum += x);
        squares += shift.iter().map(|x| x * x).sum::<f64>();
        count += 1.0;
    }
    let mean: f64 = sum.iter().map(|s| (s / count) * (s / count)).sum();
    squares > 0.0 && (1.0 - mean * count / squares).max(0.0).sqrt() >= VARIED
}

/// Other names for `effect` in `arm`.
pub(crate) fn equivalents(effect: &Effect, arm: &Arm) -> Vec<Equivalent> {
    let joint = effect.joint.map(|joint| arm.joints()[joint].name.clone());
    let same = |kinds: &[&'static str], joint, why| vec![Equivalent { kinds: kinds.to_vec(), joint, why }];
    let (first, last) = (arm.joints()[0].name.clone(), arm.joints()[arm.dof() - 1].name.clone());
    match (&effect.physics, effect.joint) {
        (Physics::AsymmetricFriction { .. }, _) => {
            same(&["coulomb_friction", "torque_offset"], joint, "while the joint moves the two are one class")
        }
        (Physics::TorqueOffset { .. }, _) => {
            same(&["asymmetric_friction"], joint, "while the joint moves the two are one class")
        }
        (Physics::JointCoupling { with, sign, .. }, _) if sign.abs() == 1.0 => same(
            &["joint_coupling"],
            Some(with.clone()),
            "the shaft turns with both joints: the law is the same seen from either",
        ),
        (Physics::Payload { .. }, _) if arm.dof() == 1 => {
            same(&["link_mass"], Some(last), "one axis feels nothing but mass")
        }
        (Physics::EncoderOffset { .. }, Some(0)) if slides_along_its_way(arm) => {
            same(&["link_length"], Some(first), "a slide that starts further on is a longer link")
        }
        (Physics::LinkLength { .. }, Some(0)) if slides_along_its_way(arm) => {
            same(&["encoder_offset"], Some(first), "a slide that starts further on is a longer link")
        }
        (Physics::LinkLength { .. }, Some(joint)) => as_long(arm, joint)
            .into_iter()
            .map(|other| Equivalent {
                kinds: vec!["link_length"],
                joint: Some(arm.joints()[other].name.clone()),
                why: "a joint that turns about the way does not part what is before it from what is behind",
            })
            .collect(),
        (Physics::LinkMass { .. }, Some(0)) if turns_upright(arm) => same(
            &["rotor_inertia"],
            Some(first),
            "a link on an upright axis is felt as inertia about it alone",
        ),
        (Physics::RotorInertia { .. }, Some(0)) if turns_upright(arm) => {
            same(&["link_mass"], Some(first), "a link on an upright axis is felt as inertia about it alone")
        }
        (Physics::LinkMass { .. }, Some(joint)) if joint + 1 == arm.dof() => {
            same(&["payload"], None, "a payload at the link's centre of mass is a heavier link")
        }
        // Laws beyond the catalogue have a name of their own.
        (Physics::LoadDrop { .. }, _) => {
            same(&["load_change"], None, "a load that drops is a load that changes")
        }
        (Physics::MountResonance { .. }, _) => {
            same(&["mount_compliance"], None, "what resonates is the compliance of the mount")
        }
        _ => Vec::new(),
    }
}

/// True if the first joint turns about the direction of gravity.
fn turns_upright(arm: &Arm) -> bool {
    let joint = &arm.joints()[0];
    let axis = joint.placement.rotation * joint.axis.into_inner();
    joint.kind == JointKind::Revolute && is_along(&axis, arm.gravity())
}

/// The other links whose length has the same direction as that of the link moved by `joint`, so that any of them may be the longer one: all joints between them
/// turn about that direction, or slide.
fn as_long(arm: &Arm, joint: usize) -> Vec<usize> {
    let joints = arm.joints();
    let keeps = |joint: &Joint, way: &Vector3<f64>| {
        joint.kind == JointKind::Prismatic || is_along(joint.axis.as_ref(), way)
    };
    let (mut others, mut here) = (Vec::new(), way(arm, joint));
    for other in (1..=joint).rev() {
        if !keeps(&joints[other], &here) {
            break;
        }
        here = joints[other].placement.rotation * here;
        others.push(other - 1);
    }
    let mut here = way(arm, joint);
    for (other, next) in joints.iter().enumerate().skip(joint + 1) {
        here = next.placement.rotation.inverse() * here;
        if !keeps(next, &here) {
            break;
        }
        others.push(other);
    }
    others
}

/// From `joint` to the next one, from the last to the tool, in the frame of its link, m.
fn way(arm: &Arm, joint: usize) -> Vector3<f64> {
    arm.joints().get(joint + 1).map_or(arm.tool(), |next| &next.placement).translation.vector
}

/// True if `axis` has the direction of `way`, or the opposite one.
fn is_along(axis: &Vector3<f64>, way: &Vector3<f64>) -> bool {
    axis.cross(way).norm() < 1e-6 * way.norm()
}

/// True if the first joint slides in the direction of the next one (of the tool).
fn slides_along_its_way(arm: &Arm) -> bool {
    let joint = &arm.joints()[0];
    joint.kind == JointKind::Prismatic && is_along(joint.axis.as_ref(), &way(arm, 0))
}

#[cfg(test)]
mod tests {
    use super::{as_long, floats, is_crossed, varied};
    use crate::Machine;

    #[test]
    fn a_gap_has_to_be_crossed() {
        let wave = |offset: f64| {
            (0..1000).map(|k| 0.6e-3 * (f64::from(k) * 0.05).sin() + offset).collect::<Vec<_>>()
        };
        assert!(is_crossed(&wave(0.0), 1e-3, 0.01));
        assert!(!is_crossed(&wave(0.0), 1e-3, 0.001), "a gear that clatters");
        assert!(!is_crossed(&wave(0.5e-3), 1e-3, 0.01));
        assert!(!is_crossed(&[0.0; 100], 1e-3, 0.01));
    }

    /// The forearm of the seven-axis arm turns about its own length; the length of the upper arm has no equivalent.
    #[test]
    fn a_length_is_the_same_across_a_joint_that_turns_about_it() {
        let arm = Machine::Seven.data_sheet().expect("a data sheet");
        let of = |joint| as_long(&arm, joint);
        println!("{:?}", (0..arm.dof()).map(of).collect::<Vec<_>>());
        assert_eq!((of(3), of(4)), (vec![4], vec![3]));
        let arm = Machine::Two.data_sheet().expect("a data sheet");
        assert!((0..2).all(|joint| as_long(&arm, joint).is_empty()));
    }

    #[test]
    fn a_journal_at_the_wall_does_not_float() {
        let circle = |share: f64| {
            (0..1000).map(move |k| {
                let radius = if f64::from(k) < share * 1000.0 { 0.5e-3 } else { 0.97e-3 };
                [radius * f64::from(k).cos(), 0.0, radius * f64::from(k).sin()]
            })
        };
        assert!(!floats(circle(0.05), 1e-3) && floats(circle(0.2), 1e-3));
    }

    #[test]
    fn a_constant_shift_is_not_varied() {
        let shift =
            |swing: f64| (0..1000).map(move |k| [1.0 + swing * (f64::from(k) * 0.05).sin(), 0.2, 0.0]);
        assert!(!varied(shift(0.1)) && varied(shift(1.0)));
    }
}
