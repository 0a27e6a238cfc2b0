//! The elements of a mechanism, summed by joint.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::{Channel, Element, Mechanism};
use freeplay_arm::{Joint, JointKind, brief};

/// One joint with its elements.
#[derive(Clone, Debug)]
pub(super) struct JointParts {
    /// The joint, placed so that its zero is the zero of its encoder's reading.
    pub joint: Joint,
    /// Inertia on the joint's own row, kg·m² (kg).
    pub armature: f64,
    /// Linear and quadratic damping.
    pub damping: [f64; 2],
    /// Coulomb friction.
    pub friction: f64,
    /// Constant torque of the drive, independent of the motion.
    pub constant: f64,
    /// The spring across the joint.
    pub spring: Option<Spring>,
    /// The elastic gear.
    pub gear: Option<Gear>,
    /// Radial clearance, m.
    pub play: Option<f64>,
    /// True over measured torque, and the measured torque at zero true torque.
    pub measured: [f64; 2],
    /// Least and greatest true torque of the drive.
    pub torque: [f64; 2],
    /// The servo of the position loop, if commands are positions.
    pub servo: Option<Servo>,
    /// Time from a command to its effect, s.
    pub command_delay: f64,
}

/// A position servo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Servo {
    pub stiffness: f64,
    pub damping: f64,
    pub offset: f64,
}

/// A spring across a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spring {
    pub stiffness: f64,
    pub rest: f64,
}

/// All gears of a joint in series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gear {
    /// Angle per torque, 0 for rigid flanks.
    pub compliance: f64,
    pub damping: f64,
    pub gap: f64,
    pub friction: f64,
    /// Relative acceleration of motor and link per torque between them with all joints at zero, 1/(kg·m²) (1/kg).
    pub mobility: f64,
}

/// A shaft that two joints share.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shaft {
    pub joints: [usize; 2],
    pub ratio: f64,
    pub inertia: f64,
    pub viscous: f64,
    pub coulomb: f64,
}

/// All parts of a mechanism.
#[derive(Clone, Debug)]
pub(super) struct Parts {
    pub joints: Vec<JointParts>,
    pub shafts: Vec<Shaft>,
    pub delays: Vec<(Channel, f64)>,
    /// Elements that the exported file cannot express, in words.
    pub not_expressed: Vec<String>,
}

impl Parts {
    /// The parts of the elements of `mechanism` that `takes` selects.
    pub fn of(mechanism: &Mechanism, takes: impl Fn(&Element) -> bool) -> Parts {
        let joints = mechanism.arm.joints().iter().map(JointParts::of).collect();
        let mut parts = Parts { joints, shafts: Vec::new(), delays: Vec::new(), not_expressed: Vec::new() };
        let mut shafts = Vec::new();
        for named in mechanism.elements.iter().filter(|named| takes(&named.element)) {
            match named.element {
                Element::Shaft { own_shares_named, joints, ratio, inertia, viscous, coulomb } => {
                    let shaft = Shaft { joints, ratio, inertia, viscous, coulomb };
                    shafts.push((&named.name, own_shares_named, shaft));
                }
                Element::Delay { channel, delay } => parts.delays.push((channel, delay)),
                element => parts.add(element),
            }
        }
        for (name, own_shares_named, mut shaft) in shafts {
            if own_shares_named {
                for lost in parts.give_shares(&mut shaft) {
                    parts.not_expressed.push(format!(
                        "{name}: its {lost} across the joints; the shaft adds {lost} to each joint, too, and the joints' own {lost} is less than that share"
                    ));
                }
            }
            if [shaft.inertia, shaft.viscous, shaft.coulomb].iter().any(|part| *part != 0.0) {
                parts.shafts.push(shaft);
            }
        }
        parts
    }

    fn add(&mut self, element: Element) {
        match element {
            Element::RotorInertia { joint, inertia } => self.joints[joint].armature += inertia,
            Element::Damping { joint, linear, quadratic } => {
                let damping = &mut self.joints[joint].damping;
                *damping = [damping[0] + linear, damping[1] + quadratic];
            }
            Element::DryFriction { joint, level } => self.joints[joint].friction += level,
            Element::ConstantTorque { joint, torque } => self.joints[joint].constant += torque,
            Element::Spring { joint, stiffness, rest } => self.joints[joint].add_spring(stiffness, rest),
            Element::Gear { joint, stiffness, damping, gap, friction } => {
                let compliance = stiffness.map_or(0.0, |stiffness| 1.0 / stiffness);
                self.joints[joint].add_gear(Gear { compliance, damping, gap, friction, mobility: 0.0 });
            }
            Element::RadialPlay { joint, clearance } => self.joints[joint].play = Some(clearance),
            Element::TorqueGain { joint, gain } => {
                let [before, offset] = self.joints[joint].measured;
                self.joints[joint].measured = [before * gain, offset / gain];
            }
            Element::TorqueOffset { joint, offset } => self.joints[joint].measured[1] += offset,
            Element::TorqueLimit { joint, limit } => self.joints[joint].limit(limit),
            Element::Stop { joint, lower, upper } => {
                let limits = &mut self.joints[joint].joint.limits;
                (limits.lower, limits.upper) = (limits.lower.max(lower), limits.upper.min(upper));
            }
            Element::EncoderZero { joint, offset } => self.joints[joint].turn_back(offset),
            Element::Servo { joint, stiffness, damping, offset, limit } => {
                let parts = &mut self.joints[joint];
                parts.servo = Some(Servo { stiffness, damping, offset });
                parts.torque = [parts.torque[0].max(-limit), parts.torque[1].min(limit)];
            }
            Element::CommandDelay { joint, delay } => self.joints[joint].command_delay += delay,
            Element::Shaft { .. } | Element::Delay { .. } => {}
        }
    }

    /// Subtracts the shares of `shaft` from the joints' own parameters. If a joint has less of a parameter than its share, the shaft loses the parameter instead; the
    /// function returns the names of the lost parameters.
    fn give_shares(&mut self, shaft: &mut Shaft) -> Vec<&'static str> {
        let square = shaft.ratio * shaft.ratio;
        let left = |own: [f64; 2], part: f64| {
            let left = [own[0] - part, own[1] - square * part];
            (part == 0.0 || left.iter().all(|left| *left >= 0.0)).then_some(left)
        };
        let joints = shaft.joints;
        let mut lost = Vec::new();
        match left(joints.map(|joint| self.joints[joint].armature), shaft.inertia) {
            Some(left) => {
                joints.iter().zip(left).for_each(|(&joint, left)| self.joints[joint].armature = left)
            }
            None => {
                shaft.inertia = 0.0;
                lost.push("inertia");
            }
        }
        match left(joints.map(|joint| self.joints[joint].damping[0]), shaft.viscous) {
            Some(left) => {
                joints.iter().zip(left).for_each(|(&joint, left)| self.joints[joint].damping[0] = left)
            }
            None => {
                shaft.viscous = 0.0;
                lost.push("viscous friction");
            }
        }
        lost
    }
}

impl JointParts {
    fn of(joint: &Joint) -> JointParts {
        let effort = joint.limits.effort;
        JointParts {
            joint: joint.clone(),
            armature: joint.rotor_inertia,
            damping: [joint.friction.viscous, 0.0],
            friction: joint.friction.coulomb,
            constant: 0.0,
            spring: None,
            gear: None,
            play: None,
            measured: [1.0, 0.0],
            torque: [-effort, effort],
            servo: None,
            command_delay: 0.0,
        }
    }

    /// Negative damping and friction, which no tool accepts, in words.
    pub fn below_zero(&self) -> Vec<String> {
        let [linear, quadratic] = self.damping;
        let parts = [
            ("damping", linear),
            ("quadratic damping", quadratic),
            ("Coulomb friction", self.friction),
            ("stiffness of the spring", self.spring.map_or(0.0, |spring| spring.stiffness)),
        ];
        let name = &self.joint.name;
        let words =
            |(words, value)| format!("{words} of {name} ({}): the format has none below zero", brief(value));
        parts.into_iter().filter(|(_, value)| *value < 0.0).map(words).collect()
    }

    fn add_spring(&mut self, stiffness: f64, rest: f64) {
        let before = self.spring.unwrap_or(Spring { stiffness: 0.0, rest: 0.0 });
        let sum = before.stiffness + stiffness;
        if sum != 0.0 {
            let rest = (before.stiffness * before.rest + stiffness * rest) / sum;
            self.spring = Some(Spring { stiffness: sum, rest });
        }
    }

    /// Adds a gear in series: compliances and gaps add up. Two dampings combine in series; a single one stays.
    fn add_gear(&mut self, gear: Gear) {
        let Some(before) = self.gear else {
            self.gear = Some(gear);
            return;
        };
        let damping = match before.damping > 0.0 && gear.damping > 0.0 {
            true => before.damping * gear.damping / (before.damping + gear.damping),
            false => before.damping.max(gear.damping),
        };
        self.gear = Some(Gear {
            compliance: before.compliance + gear.compliance,
            damping,
            gap: before.gap + gear.gap,
            friction: before.friction + gear.friction,
            mobility: 0.0,
        });
    }

    /// Limits the measured torque at this point of the chain.
    fn limit(&mut self, limit: f64) {
        let [gain, offset] = self.measured;
        let [least, most] = [-limit, limit].map(|measured| (measured - offset) * gain);
        self.torque = [self.torque[0].max(least), self.torque[1].min(most)];
    }

    /// Places the joint so that its zero is the zero of its encoder's reading.
    fn turn_back(&mut self, offset: f64) {
        let axis = self.joint.axis;
        self.joint.placement *= match self.joint.kind {
            JointKind::Revolute => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&axis, -offset),
            ),
            JointKind::Prismatic => Isometry3::from(Translation3::from(axis.into_inner() * -offset)),
        };
    }
}
