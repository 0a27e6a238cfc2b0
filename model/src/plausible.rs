//! Implausible masses, lengths and limits, detected by laws of nature and by comparison with each other: mass with inertia, inertia with
//! the arm's size, speed with length. No check assumes a usual weight or size.

use nalgebra::Vector3;

use crate::names::counted;
use freeplay_arm::{Arm, Inertia, JointKind, JointSource, Purpose, Workspace, brief, gravity_torque};

/// Density of osmium, the densest of all materials, kg/m³ (Arblaster 1989, Platinum Metals Rev. 33:14).
const DENSEST: f64 = 22_590.0;
/// Speed of sound in air at 20 °C, m/s: no arm moves faster.
const SOUND: f64 = 343.0;
/// A length in mm is a thousand times one in m; half of that on a logarithmic scale is the threshold between the two.
const HALF_OF_MILLI: f64 = 31.622_776_601_683_793;
/// Postures of the check that an arm can hold its own weight.
const POSTURES: u8 = 16;

/// A mass of the file.
pub(super) struct Body {
    /// Name of the body, with its line in the file.
    pub name: String,
    pub inertia: Inertia,
}

impl Body {
    /// Radius of gyration, m: root of ∫r² dm over the mass, about the centre.
    fn gyration(&self) -> f64 {
        (0.5 * self.inertia.about_com.trace() / self.inertia.mass).sqrt()
    }

    /// Density of the body over that of the densest material, by its radius of gyration: of all bodies of a mass and a density a ball has
    /// the least ∫r² dm, 3/5 m R².
    fn density(&self) -> f64 {
        let ball = (3.0 * self.inertia.mass / (4.0 * std::f64::consts::PI * DENSEST)).cbrt();
        (0.6_f64.sqrt() * ball / self.gyration()).powi(3)
    }
}

/// A sentence for each kind of implausible number.
pub(super) fn notes(arm: &Arm, bodies: &[Body], sources: &[JointSource]) -> Vec<String> {
    let solid: Vec<&Body> = bodies
        .iter()
        .filter(|body| body.inertia.mass > 0.0 && body.inertia.about_com.trace() > 0.0)
        .collect();
    let size = extent(arm);
    let mut notes = Vec::new();
    notes.extend(dense(&solid));
    notes.extend(wide(&solid, size));
    notes.extend(long(&solid, size));
    notes.extend(fast(arm, sources));
    notes.extend(stuck(arm, sources));
    notes.extend(weak(arm, sources));
    notes
}

/// Length of the arm from its first joint to the tool or to its farthest mass, m.
fn extent(arm: &Arm) -> f64 {
    beyond(arm, 0)
}

/// Length of the arm from joint number `first` on, m.
fn beyond(arm: &Arm, first: usize) -> f64 {
    let mut way = 0.0;
    let mut farthest = 0.0_f64;
    for (index, joint) in arm.joints().iter().enumerate().skip(first) {
        if index > first {
            way += joint.placement.translation.vector.norm();
        }
        let stroke = joint.limits.upper - joint.limits.lower;
        if joint.kind == JointKind::Prismatic && stroke.is_finite() {
            way += stroke;
        }
        farthest = farthest.max(way + joint.inertia.com.norm());
    }
    farthest.max(way + arm.tool().translation.vector.norm())
}

/// One sentence for all of `found`.
fn sentence(found: Vec<(&str, String)>, remedy: &str) -> Option<String> {
    let ((name, what), rest) = found.split_first()?;
    let more = if rest.is_empty() { String::new() } else { format!(" (and {} more)", rest.len()) };
    Some(format!("{name}: {what}{more}{remedy}"))
}

fn dense(bodies: &[&Body]) -> Option<String> {
    let odd = bodies.iter().filter(|body| body.density() > 1.0).map(|body| {
        let (mass, density) = (brief(body.inertia.mass), body.density());
        (
            body.name.as_str(),
            format!("{mass} kg with its inertia is {density:.1e} times as dense as the densest metal"),
        )
    });
    sentence(odd.collect(), ": are mass and inertia in kg and kg·m²?")
}

fn wide(bodies: &[&Body], size: f64) -> Option<String> {
    let odd = bodies.iter().filter(|body| size > 0.0 && body.gyration() > size).map(|body| {
        let radius = body.gyration();
        (
            body.name.as_str(),
            format!(
                "its inertia is that of {} kg {radius:.2} m away, and the arm is {size:.2} m long",
                brief(body.inertia.mass)
            ),
        )
    });
    sentence(odd.collect(), ": are inertias in kg·m²?")
}

/// Compares the arm with rods: a rod of length l has a radius of gyration of l/√12.
fn long(bodies: &[&Body], size: f64) -> Option<String> {
    let spanned: f64 = bodies.iter().map(|body| 12.0_f64.sqrt() * body.gyration()).sum();
    (spanned > 0.0 && size > HALF_OF_MILLI * spanned).then(|| {
        let count = counted(bodies.len(), "link");
        format!("the arm is {size:.1} m long, but the inertias of its {count} are those of bodies of {spanned:.3} m in all: are lengths in m?")
    })
}

fn at(sources: &[JointSource], index: usize, arm: &Arm) -> String {
    let line = sources.get(index).map_or_else(String::new, |origin| format!(" (line {})", origin.at.line));
    format!("joint `{}`{line}", arm.joints()[index].name)
}

fn fast(arm: &Arm, sources: &[JointSource]) -> Option<String> {
    let odd = (0..arm.dof()).filter_map(|index| {
        let joint = &arm.joints()[index];
        let (lever, unit) = match joint.kind {
            JointKind::Revolute => (beyond(arm, index), "rad/s"),
            JointKind::Prismatic => (1.0, "m/s"),
        };
        let speed = joint.limits.velocity * lever;
        (speed.is_finite() && speed > SOUND).then(|| {
            let limit = brief(joint.limits.velocity);
            (
                at(sources, index, arm),
                format!(
                    "at its velocity limit of {limit} {unit} the arm is faster than sound ({speed:.0} m/s)"
                ),
            )
        })
    });
    let odd: Vec<(String, String)> = odd.collect();
    sentence(odd.iter().map(|(name, what)| (name.as_str(), what.clone())).collect(), ": is the limit meant?")
}

fn stuck(arm: &Arm, sources: &[JointSource]) -> Option<String> {
    let odd = arm.joints().iter().enumerate().filter(|(_, joint)| joint.limits.lower == joint.limits.upper);
    let odd: Vec<(String, String)> = odd
        .map(|(index, joint)| {
            (
                at(sources, index, arm),
                format!("its range is 0: lower = upper = {}", brief(joint.limits.lower)),
            )
        })
        .collect();
    sentence(
        odd.iter().map(|(name, what)| (name.as_str(), what.clone())).collect(),
        ", so that it can't move",
    )
}

/// Joints that can't hold the arm's own weight.
fn weak(arm: &Arm, sources: &[JointSource]) -> Option<String> {
    if arm.require(Purpose::Torque).is_err() || *arm.gravity() == Vector3::zeros() {
        return None;
    }
    let mut ws = Workspace::new(arm);
    let mut most = vec![0.0_f64; arm.dof()];
    let mut tau = vec![0.0; arm.dof()];
    for posture in 0..POSTURES {
        let q: Vec<f64> = arm
            .joints()
            .iter()
            .enumerate()
            .map(|(index, joint)| {
                let share = 0.5 + 0.5 * (f64::from(posture) * (1.3 + 0.7 * index as f64)).sin();
                let range = joint.limits.upper - joint.limits.lower;
                if range.is_finite() {
                    joint.limits.lower + share * range
                } else {
                    (share - 0.5) * std::f64::consts::TAU
                }
            })
            .collect();
        gravity_torque(arm, &mut ws, &q, &mut tau);
        for (most, tau) in most.iter_mut().zip(&tau) {
            *most = most.max(tau.abs());
        }
    }
    let odd = arm.joints().iter().enumerate().filter(|(index, joint)| most[*index] > joint.limits.effort);
    let odd: Vec<(String, String)> = odd.map(|(index, joint)| {
        let unit = if joint.kind == JointKind::Revolute { "N·m" } else { "N" };
        let [weight, limit] = [most[index], joint.limits.effort].map(brief);
        (at(sources, index, arm), format!("the arm's own weight loads it with up to {weight} {unit}, but its effort limit is {limit} {unit}"))
    }).collect();
    sentence(
        odd.iter().map(|(name, what)| (name.as_str(), what.clone())).collect(),
        ": are mass, lengths and limit meant?",
    )
}
