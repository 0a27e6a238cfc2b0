//! A mechanism → MJCF, the format of MuJoCo.
//!
//! Each joint of the arm is a body. The drive of a joint is an actuator with the joint's name. Its control is the torque that the machine
//! measures, or the position command of its servo; its gain, bias and force range are those of measurement, servo and drive. Further
//! elements:
//!
//! - rotor inertia is `armature`, friction `frictionloss`, damping `damping` with a second coefficient for the quadratic part;
//! - a gear is a second joint in the same body, after the motor's: a spring or, with a gap, a joint whose range is the gap and whose limits are
//!   the flanks. MuJoCo's mass matrix needs an inertia on either side: see [`stand_in`];
//! - radial play is two slides across the axis, bounded by a tendon as long as the clearance;
//! - a shaft that two joints share is a tendon with inertia, damping and friction.
//!
//! Friction and limits are constraints that MuJoCo softens. Here they are as hard as a step of the integrator allows: they stop a joint
//! within one step (`solref` of two steps is the shortest that MuJoCo takes).
//!
//! Source: MuJoCo documentation, XML reference and "Computation: Constraint model".

use nalgebra::DMatrix;

use super::inertia::Principal;
use super::mjcf_writer::{Marks, Writer};
use super::names::Names;
use super::parts::{JointParts, Parts};
use super::rotation::quaternion;
use super::xml::{Xml, number, numbers};
use super::{Channel, Element, Exported, Mechanism, mjcf_joint, mjcf_tendon};
use freeplay_arm::{Arm, Workspace, brief, crba};

/// Longest step of the integrator, s: the tick of a plant.
const LONGEST_STEP: f64 = 1e-3;

/// Angle by which a gear may swing in a step, rad: the plant's bound for its sub-steps.
const GREATEST_SWING: f64 = 0.5;

/// Impedance of friction and limits: the largest that MuJoCo accepts.
const IMPEDANCE: f64 = 0.9999;

/// Speed at which friction must have reached its level, rad/s (m/s): a hundredth of a slow motion.
const GREATEST_CREEP: f64 = 1e-3;

/// Inertia that replaces a rotor missing from the model, as a share of the least inertia of the joint: its torque is smaller by the same
/// factor.
const STAND_IN: f64 = 0.01;

/// The MJCF of `mechanism`. Each body has its joint's name with the suffix `_link`; the tool frame is the site `tool0`.
pub fn to_mjcf(mechanism: &Mechanism) -> Exported {
    let mut parts = Parts::of(mechanism, |_| true);
    let mut not_expressed = mechanism.not_expressed.clone();
    not_expressed.extend(
        mechanism
            .elements
            .iter()
            .filter_map(|named| missing(&named.element).map(|why| format!("{}: {why}", named.name))),
    );
    not_expressed.append(&mut parts.not_expressed);
    let step = stand_in(&mut parts, &mechanism.arm, &mut not_expressed);
    carry_friction(&mut parts, &mechanism.arm, step, &mut not_expressed);
    not_expressed.extend(not_expressed_of_bodies(&parts));
    let names = mechanism.arm.joints().iter().map(|joint| joint.name.as_str());
    let mut writer = Writer { xml: Xml::new(), names: Names::of(names), parts: &parts };
    writer.xml.comment(super::heading(&not_expressed).iter().map(String::as_str));
    writer.write(mechanism, step);
    Exported { text: writer.xml.finish(), not_expressed }
}

/// The part of `element` that MJCF cannot express.
fn missing(element: &Element) -> Option<&'static str> {
    match element {
        Element::RadialPlay { .. } => Some(
            "MJCF has no law of the contact; the journal stops within a step and slides without friction",
        ),
        _ => None,
    }
}

/// Bodies that MuJoCo changes, and inertias that it refuses.
fn not_expressed_of_bodies(parts: &Parts) -> Vec<String> {
    let of = |parts: &JointParts| {
        let name = &parts.joint.name;
        let unread = (parts.servo.is_some() && parts.measured != [1.0, 0.0]).then(|| {
            format!("gain and offset of the torque measurement of {name}, whose control is a position")
        });
        let changed = Principal::of(&parts.joint.inertia).changed.map(|changed| {
            format!("the inertia of the link of {name}: no real body has this inertia; the nearest that MuJoCo accepts differs by {} kg*m^2", brief(changed))
        });
        let negative = (parts.armature < 0.0).then(|| {
            format!("rotor inertia of {name} ({}): MJCF has none below zero", brief(parts.armature))
        });
        changed.into_iter().chain(negative).chain(parts.below_zero()).chain(unread)
    };
    parts.joints.iter().flat_map(of).collect()
}

/// Gives every joint with a gear an inertia on the motor's side, and returns the step that resolves the oscillation of all gears, s.
fn stand_in(parts: &mut Parts, arm: &Arm, not_expressed: &mut Vec<String>) -> f64 {
    if parts.joints.iter().all(|joint| joint.gear.is_none()) {
        return LONGEST_STEP;
    }
    let postures: Vec<Vec<f64>> = (0..4_u8).map(|number| inertias(parts, arm, number)).collect();
    let mut fastest = GREATEST_SWING / LONGEST_STEP;
    for (index, joint) in parts.joints.iter_mut().enumerate() {
        let Some(gear) = &mut joint.gear else { continue };
        let least = postures.iter().map(|felt| felt[index]).fold(f64::INFINITY, f64::min);
        if joint.armature <= 0.0 {
            joint.armature = STAND_IN * least;
            not_expressed.push(format!(
                "the inertia of the motor of {}, which the model lacks: MuJoCo needs one, and the file has {} kg*m^2",
                joint.joint.name, brief(joint.armature)
            ));
        }
        gear.mobility = 1.0 / joint.armature + 1.0 / postures[0][index];
        if gear.gap > 0.0 && gear.compliance > 0.0 && gear.damping == 0.0 {
            gear.damping = 2.0 / (gear.compliance * gear.mobility).sqrt();
            not_expressed.push(format!(
                "the damping of the flanks of {}, which the model lacks: the file has {}, which stops the link on a flank without a bounce",
                joint.joint.name, brief(gear.damping)
            ));
        }
        if gear.compliance > 0.0 {
            fastest = fastest.max(((1.0 / joint.armature + 1.0 / least) / gear.compliance).sqrt());
        }
    }
    LONGEST_STEP / (LONGEST_STEP * fastest / GREATEST_SWING).ceil()
}

/// Raises the inertia of a joint that is too small for its friction to the least that the friction needs in a step of `step` s.
///
/// MuJoCo softens friction by the effective inertia I of the joint: friction reaches its level F at the speed v = h F (1 − d)/(d I), d
/// being the impedance. [`GREATEST_CREEP`] bounds that speed. An added inertia then costs F h (1 − d)/(d v) of torque per acceleration: a
/// ten-thousandth of F per rad/s².
fn carry_friction(parts: &mut Parts, arm: &Arm, step: f64, not_expressed: &mut Vec<String>) {
    let felt = inertias(parts, arm, 0);
    for (joint, felt) in parts.joints.iter_mut().zip(felt) {
        let felt = if joint.gear.is_some() { joint.armature } else { felt };
        let least = joint.friction * step * (1.0 - IMPEDANCE) / (IMPEDANCE * GREATEST_CREEP);
        if least > felt {
            joint.armature = joint.armature.max(0.0) + least - felt;
            not_expressed.push(format!(
                "an additional inertia of {} kg*m^2 on {}: MuJoCo's friction of {} needs it, since the links have too little",
                brief(least - felt),
                joint.joint.name,
                brief(joint.friction)
            ));
        }
    }
}

/// The effective inertia of each joint beyond its motor with all others free, 1/(M⁻¹)ⱼⱼ, in posture `number`, kg·m² (kg). In posture 0 all
/// joints are at zero. A motor behind a gear does not count.
fn inertias(parts: &Parts, arm: &Arm, number: u8) -> Vec<f64> {
    let dof = arm.dof();
    let (mut ws, mut mass) = (Workspace::new(arm), DMatrix::zeros(dof, dof));
    let q: Vec<f64> = (1..=dof).map(|i| (1.3 * i as f64 * f64::from(number)).sin()).collect();
    crba(arm, &mut ws, &q, &mut mass);
    for (index, (joint, parts)) in arm.joints().iter().zip(&parts.joints).enumerate() {
        let rotor = if parts.gear.is_some() { 0.0 } else { parts.armature.max(0.0) };
        mass[(index, index)] += rotor - joint.rotor_inertia;
    }
    let inverse = mass.clone().cholesky().map(|free| free.inverse());
    let felt = |joint| match &inverse {
        Some(inverse) => 1.0 / inverse[(joint, joint)],
        // For a link without an inertia of its own, the diagonal element replaces the effective inertia.
        None => mass[(joint, joint)].max(f64::MIN_POSITIVE),
    };
    (0..dof).map(felt).collect()
}

impl Writer<'_> {
    fn write(&mut self, mechanism: &Mechanism, step: f64) {
        let arm = &mechanism.arm;
        self.xml.start("mujoco", &[("model", arm.name().to_owned())]);
        let compiler = [("angle", "radian"), ("autolimits", "true"), ("inertiafromgeom", "false")];
        self.xml.empty("compiler", &compiler.map(|(name, value)| (name, value.to_owned())));
        self.xml.empty(
            "option",
            &[
                ("timestep", number(step)),
                ("gravity", numbers(arm.gravity().as_slice())),
                ("integrator", "implicitfast".to_owned()),
            ],
        );
        self.write_defaults(step);
        let mut marks = Marks::default();
        self.xml.start("worldbody", &[]);
        for (index, joint) in self.parts.joints.iter().enumerate() {
            self.write_body(index, joint, &mut marks);
        }
        let pose = arm.tool();
        let tool = self.names.take("tool0");
        self.xml.empty("site", &[("name", tool.clone()), pos(pose), quat(pose)]);
        self.parts.joints.iter().for_each(|_| self.xml.end());
        self.xml.end();
        mjcf_tendon::write(self, &marks);
        self.write_actuators(step);
        self.write_sensors(&tool, step);
    }

    /// Writes defaults: constraints that stop a motion within one step.
    fn write_defaults(&mut self, step: f64) {
        let reference = numbers(&[2.0 * step, 1.0]);
        let impedance = numbers(&[IMPEDANCE, IMPEDANCE, 1e-3, 0.5, 2.0]);
        self.xml.start("default", &[]);
        for tag in ["joint", "tendon"] {
            self.xml.empty(
                tag,
                &[
                    ("solreflimit", reference.clone()),
                    ("solimplimit", impedance.clone()),
                    ("solreffriction", reference.clone()),
                    ("solimpfriction", impedance.clone()),
                ],
            );
        }
        // Shapes are visual only; they take no part in contacts.
        self.xml.empty(
            "geom",
            &[("contype", "0".to_owned()), ("conaffinity", "0".to_owned()), ("group", "1".to_owned())],
        );
        self.xml.end();
    }

    /// The beginning of the body that joint number `index` moves: its joints, its inertia and its shape.
    fn write_body(&mut self, index: usize, parts: &JointParts, marks: &mut Marks) {
        let joint = &parts.joint;
        if parts.play.is_some() {
            let bearing = self.names.take(&format!("{}_bearing", joint.name));
            self.xml.empty("site", &[("name", bearing.clone()), pos(&joint.placement)]);
            marks.bearings.insert(index, bearing);
        }
        let body = self.names.take(&format!("{}_link", joint.name));
        self.xml.start("body", &[("name", body), pos(&joint.placement), quat(&joint.placement)]);
        mjcf_joint::write(self, index, parts, marks);
        self.write_inertial(parts);
        if parts.play.is_some() {
            let journal = self.names.take(&format!("{}_journal", joint.name));
            self.xml.empty("site", &[("name", journal.clone())]);
            marks.journals.insert(index, journal);
        }
        let next = self.parts.joints.get(index + 1).map(|next| next.joint.placement.translation.vector);
        if let Some(way) = next.filter(|way| way.norm() > 1e-3) {
            let size = number(0.1 * way.norm());
            let ends = format!("0 0 0 {}", numbers(way.as_slice()));
            self.xml.empty("geom", &[("type", "capsule".to_owned()), ("size", size), ("fromto", ends)]);
        }
    }

    fn write_inertial(&mut self, parts: &JointParts) {
        let joint = &parts.joint;
        let mut principal = Principal::of(&joint.inertia);
        if parts.gear.is_some() {
            principal.turn();
        }
        self.xml.empty(
            "inertial",
            &[
                ("pos", numbers(joint.inertia.com.as_slice())),
                ("quat", numbers(&quaternion(&principal.axes))),
                ("mass", number(principal.mass)),
                ("diaginertia", numbers(principal.moments.as_slice())),
            ],
        );
    }

    /// One actuator for each joint.
    fn write_actuators(&mut self, step: f64) {
        self.xml.start("actuator", &[]);
        for parts in &self.parts.joints {
            let name = parts.joint.name.clone();
            let mut attributes = vec![("name", name.clone()), ("joint", name)];
            let law = affine(parts);
            let is_plain = law == [1.0, 0.0, 0.0, 0.0];
            if !is_plain {
                attributes.extend([
                    ("gaintype", "fixed".to_owned()),
                    ("gainprm", number(law[0])),
                    ("biastype", "affine".to_owned()),
                    ("biasprm", numbers(&law[1..])),
                ]);
            }
            let range = parts.torque.map(|torque| torque - parts.constant);
            if range.iter().all(|torque| torque.is_finite()) {
                attributes.push(("forcerange", numbers(&range)));
            }
            attributes.extend(late(parts.command_delay, step));
            self.xml.empty(if is_plain { "motor" } else { "general" }, &attributes);
        }
        self.xml.end();
    }

    /// The sensors of the machine, each with the delay of its channel.
    fn write_sensors(&mut self, tool: &str, step: f64) {
        self.xml.start("sensor", &[]);
        let late = |channel: Channel| {
            let delays = self.parts.delays.iter().filter(|(of, _)| *of == channel);
            late(delays.map(|(_, delay)| delay).sum(), step)
        };
        for joint in self.parts.joints.iter().map(|parts| &parts.joint.name) {
            let sensors = [
                ("jointpos", "q", Channel::Motor),
                ("jointvel", "qd", Channel::Motor),
                ("jointactuatorfrc", "tau", Channel::Torque),
            ];
            for (tag, prefix, channel) in sensors {
                let mut attributes = vec![("name", format!("{prefix}_{joint}")), ("joint", joint.clone())];
                attributes.extend(late(channel));
                self.xml.empty(tag, &attributes);
            }
        }
        let mut attributes =
            vec![("name", "tool".to_owned()), ("objtype", "site".to_owned()), ("objname", tool.to_owned())];
        attributes.extend(late(Channel::Tool));
        self.xml.empty("framepos", &attributes);
        self.xml.end();
    }
}

type Attribute = (&'static str, String);

/// Gain, and bias by position and velocity, of the actuator of a joint. Without a servo the control is the measured torque m, and the joint
/// gets gain·(m − offset) − constant; with a servo the control is the commanded position.
fn affine(parts: &JointParts) -> [f64; 4] {
    match parts.servo {
        Some(servo) => [
            servo.stiffness,
            servo.stiffness * servo.offset - parts.constant,
            -servo.stiffness,
            -servo.damping,
        ],
        None => {
            let [gain, offset] = parts.measured;
            [gain, -offset * gain - parts.constant, 0.0, 0.0]
        }
    }
}

/// The attributes of a channel with a delay of `delay` s, which must store as many samples.
fn late(delay: f64, step: f64) -> Vec<Attribute> {
    let samples = (delay / step).ceil() + 2.0;
    let attributes =
        [("delay", number(delay)), ("nsample", number(samples)), ("interp", "linear".to_owned())];
    if delay > 0.0 { attributes.to_vec() } else { Vec::new() }
}

fn pos(pose: &nalgebra::Isometry3<f64>) -> Attribute {
    ("pos", numbers(pose.translation.vector.as_slice()))
}

fn quat(pose: &nalgebra::Isometry3<f64>) -> Attribute {
    ("quat", numbers(&quaternion(&pose.rotation)))
}
