//! The variables of an FMU, which depend on its arm file alone.

use freeplay_arm::{Joint, JointKind};
use freeplay_laws::{Absent, Effects, Injection, Kind, LawError, Range, kind};
use freeplay_model::ArmFile;

/// Access of an importer to a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Set before the start.
    Parameter,
    /// Set before each step.
    Input,
    /// Read after each step.
    Output,
    /// Time.
    Independent,
}

/// Value of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// `fmi3Float64`.
    Real(f64),
    /// `fmi3Int32`.
    Whole(i32),
    /// `fmi3Boolean`.
    Truth(bool),
}

/// The quantity of a variable. Joints and effects are indices in the arm file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// Simulated time.
    Time,
    /// Initial position of a joint.
    StartPosition(usize),
    /// Initial velocity of a joint.
    StartVelocity(usize),
    /// Sub-steps of a step.
    Substeps,
    /// A parameter of an effect, and for a vector the component.
    Effect(usize, &'static str, Option<usize>),
    /// Torque of a joint's motor.
    Torque(usize),
    /// Commanded position of a joint's servo.
    Command(usize),
    /// Switch of the brakes, which hold all joints.
    Brakes,
    /// Position of a joint by its encoder.
    Position(usize),
    /// Velocity of a joint by its encoder.
    Velocity(usize),
    /// Torque of a joint as measured by its drive.
    Measured(usize),
    /// Position of the tool, and then its orientation as a quaternion x, y, z, w.
    Tool(usize),
    /// Tool position minus that of the arm without effects at the same joint positions.
    Deviation(usize),
    /// Contact of the journal of a play: 0 free flight, 1 contact.
    ContactMode(usize),
    /// Normal force on the journal of a play.
    ContactForce(usize),
    /// Kinetic, potential and elastic energy.
    Energy,
}

/// A variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name, unique in the FMU.
    pub name: String,
    /// Description.
    pub description: String,
    /// Unit; empty for none.
    pub unit: String,
    /// Access of an importer.
    pub causality: Causality,
    /// Least and greatest value; infinite without a limit.
    pub bounds: [f64; 2],
    /// Initial value; for outputs only its type is used.
    pub start: Value,
    /// The quantity.
    pub quantity: Quantity,
}

/// All variables; the value reference of a variable is its index.
#[derive(Clone, Debug)]
pub struct Variables(pub Vec<Variable>);

impl Variables {
    /// The variables of `file`.
    ///
    /// # Errors
    /// [`LawError`]: an unusable effect.
    pub fn of(file: &ArmFile) -> Result<Variables, LawError> {
        let effects = Effects::of(file)?;
        let mut variables = Variables(Vec::new());
        variables.add("time", "time", "s", Causality::Independent, Quantity::Time);
        variables.add_parameters(file);
        let has_servos = has_servos(&effects.injection(), file.arm.dof());
        for (index, joint) in file.arm.joints().iter().enumerate() {
            let name = &joint.name;
            let (name, words, unit, quantity) = if has_servos {
                let words = format!("commanded position of the servo of {name}");
                (format!("position.{name}"), words, units(joint)[0], Quantity::Command(index))
            } else {
                let words = format!("torque of the motor of {name}");
                (format!("torque.{name}"), words, torque(joint), Quantity::Torque(index))
            };
            variables.add(&name, &words, unit, Causality::Input, quantity);
        }
        let words = "the brakes hold all joints where they are during the step";
        variables.add("brakes", words, "", Causality::Input, Quantity::Brakes);
        variables.last(|last| last.start = Value::Truth(false));
        variables.add_outputs(file, &effects);
        Ok(variables)
    }

    fn add(&mut self, name: &str, words: &str, unit: &str, causality: Causality, quantity: Quantity) {
        let mut name = name.to_owned();
        while self.0.iter().any(|other| other.name == name) {
            name.push('_');
        }
        self.0.push(Variable {
            name,
            description: words.to_owned(),
            unit: unit.to_owned(),
            causality,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            start: Value::Real(0.0),
            quantity,
        });
    }

    fn last(&mut self, change: impl FnOnce(&mut Variable)) {
        if let Some(last) = self.0.last_mut() {
            change(last);
        }
    }

    fn add_parameters(&mut self, file: &ArmFile) {
        let parameter = Causality::Parameter;
        for (index, joint) in file.arm.joints().iter().enumerate() {
            let [q, v] = units(joint);
            let name = &joint.name;
            self.add(
                &format!("start.q.{name}"),
                &format!("position of {name} at the start"),
                q,
                parameter,
                Quantity::StartPosition(index),
            );
            self.add(
                &format!("start.qd.{name}"),
                &format!("velocity of {name} at the start"),
                v,
                parameter,
                Quantity::StartVelocity(index),
            );
        }
        self.add(
            "substeps",
            "sub-steps of the integrator in a step of 1 ms",
            "",
            parameter,
            Quantity::Substeps,
        );
        self.last(|last| (last.start, last.bounds) = (Value::Whole(50), [1.0, 1e5]));
        for (index, effect) in file.effects.iter().enumerate() {
            if let Some(kind) = kind(&effect.kind) {
                let joint = effect.joint.as_ref().and_then(|name| file.arm.joint_index(name));
                self.add_effect(
                    index,
                    kind,
                    joint.map(|joint| &file.arm.joints()[joint]),
                    &effect.parameters,
                );
            }
        }
    }

    /// Adds every parameter of an effect that the file gives or that has a default.
    fn add_effect(&mut self, index: usize, kind: &'static Kind, joint: Option<&Joint>, given: &toml::Table) {
        let place = joint.map_or_else(String::new, |joint| format!(".{}", joint.name));
        for parameter in kind.parameters {
            let name = format!("{}{place}.{}", kind.name, parameter.name);
            let said = given.get(parameter.name);
            let words = format!("{}: {}", kind.title, parameter.meaning);
            let unit = kind.unit(parameter.name, joint);
            match parameter.range {
                Range::Number { least, most, absent, .. } => {
                    let default = if let Absent::Is(value) = absent { Some(value) } else { None };
                    let Some(value) = said.and_then(number).or(default) else { continue };
                    self.add(
                        &name,
                        &words,
                        unit,
                        Causality::Parameter,
                        Quantity::Effect(index, parameter.name, None),
                    );
                    self.last(|last| (last.start, last.bounds) = (Value::Real(value), [least, most]));
                }
                Range::Vector { absent, .. } => {
                    let default = if let Absent::Is(value) = absent { Some(value) } else { None };
                    let said: Option<[f64; 3]> = said.and_then(|value| value.clone().try_into().ok());
                    let Some(vector) = said.or(default) else { continue };
                    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                        let quantity = Quantity::Effect(index, parameter.name, Some(axis));
                        self.add(&format!("{name}.{letter}"), &words, unit, Causality::Parameter, quantity);
                        self.last(|last| last.start = Value::Real(vector[axis]));
                    }
                }
                Range::OtherJoint | Range::Word(_) | Range::Table => {}
            }
        }
    }

    fn add_outputs(&mut self, file: &ArmFile, effects: &Effects) {
        let output = Causality::Output;
        for (index, joint) in file.arm.joints().iter().enumerate() {
            let ([q, v], name) = (units(joint), &joint.name);
            self.add(
                &format!("q.{name}"),
                &format!("measured position of {name}"),
                q,
                output,
                Quantity::Position(index),
            );
            self.add(
                &format!("qd.{name}"),
                &format!("measured velocity of {name}"),
                v,
                output,
                Quantity::Velocity(index),
            );
            self.add(
                &format!("tau.{name}"),
                &format!("measured torque of {name}"),
                torque(joint),
                output,
                Quantity::Measured(index),
            );
        }
        for (place, letter) in ["x", "y", "z", "qx", "qy", "qz", "qw"].into_iter().enumerate() {
            let (unit, words) = if place < 3 { ("m", "tool position") } else { ("1", "tool orientation") };
            self.add(&format!("tool.{letter}"), words, unit, output, Quantity::Tool(place));
        }
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            let words = "tool position minus that of the arm without effects at the same joint positions";
            self.add(&format!("deviation.{letter}"), words, "m", output, Quantity::Deviation(axis));
        }
        for (play, (joint, _)) in effects.clearances.iter().enumerate() {
            let name = &file.arm.joints()[*joint].name;
            self.add(
                &format!("contact.{name}.mode"),
                "0: the journal flies, 1: it touches",
                "",
                output,
                Quantity::ContactMode(play),
            );
            self.last(|last| last.start = Value::Whole(0));
            self.add(
                &format!("contact.{name}.force"),
                "normal force on the journal",
                "N",
                output,
                Quantity::ContactForce(play),
            );
        }
        self.add("energy", "kinetic, potential and elastic energy", "J", output, Quantity::Energy);
    }
}

/// Returns true if each of `joints` joints has a position servo. The inputs of the machine are then positions, otherwise torques.
pub(crate) fn has_servos(injection: &Injection, joints: usize) -> bool {
    (0..joints).all(|joint| injection.servos.iter().any(|(at, _)| *at == joint))
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

fn units(joint: &Joint) -> [&'static str; 2] {
    match joint.kind {
        JointKind::Revolute => ["rad", "rad/s"],
        JointKind::Prismatic => ["m", "m/s"],
    }
}

fn torque(joint: &Joint) -> &'static str {
    match joint.kind {
        JointKind::Revolute => "N*m",
        JointKind::Prismatic => "N",
    }
}
