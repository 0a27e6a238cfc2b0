//! The results of a fit for each joint, as effects of the catalogue with intervals, and as tables of an arm file.

use std::collections::BTreeMap;

use freeplay_arm::{Arm, Joint, JointKind, Workspace, crba};
use freeplay_laws::{Kind, kind};
use freeplay_model::{ArmFile, EffectTable};
use freeplay_servo::{Fitted, JointServo, ModelParameter, Sight, Unknown};
use nalgebra::DMatrix;
use toml::{Table, Value};

use crate::candidates::candidate::Untestable;
use crate::data::tolerance::Tolerances;
use crate::report::diagnosis::Parameter;
use crate::statistics::{STRONG, half_width};

/// Distance in standard deviations beyond which a parameter is certain: no error distribution is known so far out, and no words exist for such odds.
pub const CERTAIN: f64 = 1e3;
/// Number of kinds that the search tests at each joint; they share the probability of a false finding: a servo, its delay, its friction and its rotor.
const KINDS: f64 = 4.0;

/// Log-likelihood ratio that a name needs at `joints` joints: odds of 20 to 1 after as many tests.
pub fn named_from(joints: usize) -> f64 {
    STRONG + (KINDS * joints as f64).ln()
}

/// One effect of a joint.
pub struct Finding {
    /// Its kind.
    pub kind: &'static Kind,
    /// Index of the joint.
    pub joint: usize,
    /// Its parameters.
    pub parameters: BTreeMap<String, Parameter>,
    /// The same as a table of an arm file.
    pub table: EffectTable,
    /// True if the data support the effect and it exceeds the tolerance of the model; otherwise it only sets a parameter of the model.
    pub is_named: bool,
    /// A remark on its parameters, one sentence; may be empty.
    pub remark: String,
    /// The parameter and its value in an arm without the effect; none for the servo, without which the position equals the command.
    pub absent: Option<(ModelParameter, f64)>,
}

/// Parameters of a servo itself.
const OF_SERVO: [ModelParameter; 6] = [
    ModelParameter::Stiffness,
    ModelParameter::Lag,
    ModelParameter::Offset,
    ModelParameter::Deadband,
    ModelParameter::TorqueLimit,
    ModelParameter::SpeedLimit,
];

impl Finding {
    /// The model parameters behind this finding.
    pub fn model_parameters(&self) -> impl Iterator<Item = ModelParameter> {
        let one = self.absent.map(|(parameter, _)| parameter);
        let servo = OF_SERVO.into_iter().filter(move |_| one.is_none());
        one.into_iter().chain(servo)
    }
}

/// The parameters of a fit, joint by joint.
pub struct Numbers<'a> {
    /// The given file.
    pub file: &'a ArmFile,
    /// The fit.
    pub fitted: &'a Fitted,
    /// Its unknowns.
    pub unknowns: &'a [Unknown],
    /// Prior information from the recordings on each joint.
    pub sights: &'a [Sight],
    /// Tolerances of the machine about its model.
    pub tolerances: &'a Tolerances,
}

impl Numbers<'_> {
    /// Index of the unknown `parameter` of `joint`.
    pub fn index(&self, joint: usize, parameter: ModelParameter) -> Option<usize> {
        self.unknowns.iter().position(|one| one.joint == joint && one.parameter == parameter)
    }

    fn of(&self, joint: usize, parameter: ModelParameter) -> Option<(f64, f64)> {
        self.index(joint, parameter).map(|at| self.fitted.values[at])
    }

    /// Distance between unknown number `index` and the value `old` of a model within `tolerances`, in standard deviations.
    pub fn distance(&self, index: usize, old: f64, tolerances: &Tolerances) -> f64 {
        let (value, deviation) = self.fitted.values[index];
        let parameter = self.unknowns[index].parameter;
        let tolerance = match parameter {
            // The inertia that the joint moves has the same tolerance, and the same accelerations determine it.
            ModelParameter::Rotor => {
                tolerance(parameter, old.abs() + self.moved(self.unknowns[index].joint), tolerances)
            }
            ModelParameter::Payload => self.payload_tolerance(value, tolerances),
            _ => tolerance(parameter, old, tolerances),
        };
        (value - old).abs() / deviation.hypot(tolerance)
    }

    /// Standard deviation of a payload of `mass` kg due to the mass tolerances, kg: the recordings weigh the payload and the last link together, and the model
    /// knows the mass of that link within `tolerances`.
    pub fn payload_tolerance(&self, mass: f64, tolerances: &Tolerances) -> f64 {
        let last = self.file.arm.joints().last().map_or(0.0, |joint| joint.inertia.mass);
        tolerances.mass * (mass.abs() + last)
    }

    /// Inertia that `joint` moves with all joints at zero, over the stiffness of its servo, s².
    fn moved(&self, joint: usize) -> f64 {
        moved(&self.fitted.model.arm)[joint] / self.servo(joint).stiffness
    }

    /// Standard deviations from zero that a name needs: ½ z² is the log-likelihood ratio.
    pub fn named_from(&self) -> f64 {
        (2.0 * named_from(self.file.arm.dof())).sqrt()
    }

    fn joint(&self, joint: usize) -> &Joint {
        &self.file.arm.joints()[joint]
    }

    fn servo(&self, joint: usize) -> &JointServo {
        &self.fitted.model.joints[joint]
    }

    /// Deviation of the logarithm of the stiffness of `joint`: a load determines the stiffness, and the model knows the load as well as its masses.
    fn stiffness_deviation(&self, joint: usize) -> f64 {
        let of_fit =
            self.of(joint, ModelParameter::Stiffness).map_or(f64::INFINITY, |(_, deviation)| deviation);
        of_fit.hypot(self.tolerances.mass)
    }

    /// True if the load on `joint` changes enough for the recordings to fix its stiffness in N·m/rad. Otherwise the interval of the stiffness spans from half to double its
    /// value, and the report gives ratios to it.
    pub fn is_known(&self, joint: usize) -> bool {
        self.sights[joint].stiffness.is_some()
            && self.stiffness_deviation(joint) < std::f64::consts::LN_2 / half_width()
    }

    /// The findings of all joints that move.
    pub fn findings(&self, moves: &[bool]) -> Vec<Finding> {
        let of_joint = |joint: usize| {
            let mut findings = vec![self.servo_of(joint)];
            findings.extend(self.friction(joint, ModelParameter::Coulomb, "coulomb_friction", "coulomb"));
            findings.extend(self.friction(joint, ModelParameter::Stiction, "stribeck_friction", "extra"));
            findings.extend(self.friction(joint, ModelParameter::Rotor, "rotor_inertia", "inertia"));
            findings.extend(self.delay(joint));
            findings
        };
        (0..moves.len()).filter(|joint| moves[*joint]).flat_map(of_joint).collect()
    }

    fn servo_of(&self, joint: usize) -> Finding {
        let servo = self.servo(joint);
        let of_log = self.stiffness_deviation(joint);
        let is_known = self.is_known(joint);
        let mut numbers =
            vec![("stiffness", servo.stiffness, is_known.then(|| around_log(servo.stiffness, of_log)))];
        // The viscous friction of the joint is in the model already.
        let viscous = self.joint(joint).friction.viscous;
        let interval = self.absolute(joint, ModelParameter::Lag).map(|ends| ends.map(|end| end - viscous));
        numbers.push(("damping", (servo.damping - viscous).max(0.0), interval));
        if let Some((_, deviation)) = self.of(joint, ModelParameter::Deadband) {
            numbers.push(("deadband", servo.deadband, Some(around(servo.deadband, deviation))));
        }
        if let Some((_, deviation)) = self.of(joint, ModelParameter::TorqueLimit) {
            let deviation = deviation.hypot(of_log);
            let interval = is_known.then(|| around_log(servo.torque_limit, deviation));
            numbers.push(("torque_limit", servo.torque_limit, interval));
        }
        if let Some((_, deviation)) = self.of(joint, ModelParameter::SpeedLimit) {
            numbers.push(("speed_limit", servo.speed_limit, Some(around_log(servo.speed_limit, deviation))));
        }
        if let Some((offset, deviation)) = self.of(joint, ModelParameter::Offset) {
            numbers.push(("offset", offset, Some(around(offset, deviation))));
        }
        let lag = self.of(joint, ModelParameter::Lag).unwrap_or_default();
        let name = &self.joint(joint).name;
        let (lag_ms, half_ms) = (lag.0 * 1e3, half_width() * lag.1 * 1e3);
        let remark = if is_known {
            let droop = distance(self.joint(joint).kind, 1.0 / servo.stiffness, None);
            let unit = if self.joint(joint).kind == JointKind::Revolute { "N·m" } else { "N" };
            format!(
                "In motion, {name} lags by {lag_ms:.0} ± {half_ms:.0} ms, in addition to the delay of its commands. A load of 1 {unit} makes it droop by {droop}."
            )
        } else {
            format!(
                "In motion, {name} lags by {lag_ms:.0} ± {half_ms:.0} ms. No load identifies its stiffness: only ratios to it are known, and the values in N·m depend on an assumed stiffness."
            )
        };
        self.finding("servo", joint, numbers, remark)
    }

    /// Interval of `ratio` times stiffness, if the stiffness is known.
    fn absolute(&self, joint: usize, parameter: ModelParameter) -> Option<[f64; 2]> {
        let (ratio, deviation) = self.of(joint, parameter)?;
        let stiffness = self.servo(joint).stiffness;
        let spread = (deviation * stiffness).hypot(ratio * stiffness * self.stiffness_deviation(joint));
        self.is_known(joint).then(|| around(ratio * stiffness, spread))
    }

    /// A friction, fitted as a ratio to the stiffness, if the data support it.
    fn friction(
        &self,
        joint: usize,
        parameter: ModelParameter,
        name: &'static str,
        number: &'static str,
    ) -> Option<Finding> {
        let (ratio, deviation) = self.of(joint, parameter)?;
        let servo = self.servo(joint);
        let nominal =
            if parameter == ModelParameter::Coulomb { self.joint(joint).friction.coulomb } else { 0.0 };
        // The friction of the model is in N·m: without a load that determines the stiffness, its ratio to the stiffness is not known.
        let expected = nominal / servo.stiffness;
        let of_model = |share: f64| if expected > 0.0 { expected * share } else { 0.0 };
        let of_nominal = of_model(self.tolerances.friction.hypot(self.stiffness_deviation(joint)));
        let deviations = (ratio - expected).abs() / deviation.hypot(of_nominal);
        let is_named = deviations > self.named_from();
        if !is_named && nominal == 0.0 {
            return None;
        }
        let value = ratio * servo.stiffness - nominal;
        let interval = self.absolute(joint, parameter).map(|interval| interval.map(|end| end - nominal));
        let mut numbers = vec![(number, value, interval)];
        if parameter == ModelParameter::Stiction {
            numbers.push(("velocity", servo.stribeck_velocity, None));
        }
        let joint_name = &self.joint(joint).name;
        let remark = match parameter {
            ModelParameter::Coulomb | ModelParameter::Stiction => {
                let what = if parameter == ModelParameter::Coulomb { "It holds" } else { "At rest it holds" };
                let off = distance(self.joint(joint).kind, ratio, Some(half_width() * deviation));
                format!("{what} {joint_name} up to {off} away from its servo's position.")
            }
            _ => String::new(),
        };
        let finding = self.finding(name, joint, numbers, remark);
        Some(Finding { is_named, absent: Some((parameter, expected)), ..finding })
    }

    fn delay(&self, joint: usize) -> Option<Finding> {
        let (delay, deviation) = self.of(joint, ModelParameter::Delay)?;
        (delay > self.named_from() * deviation).then(|| {
            let interval = around(delay, deviation.hypot(self.tolerances.delay));
            let numbers = vec![("delay", delay, Some(interval))];
            let finding = self.finding("command_delay", joint, numbers, String::new());
            Finding { absent: Some((ModelParameter::Delay, 0.0)), ..finding }
        })
    }

    fn finding(
        &self,
        name: &'static str,
        joint: usize,
        numbers: Vec<(&'static str, f64, Option<[f64; 2]>)>,
        remark: String,
    ) -> Finding {
        let kind = known(name);
        let at = self.joint(joint);
        let table: Table =
            numbers.iter().map(|(name, value, _)| ((*name).to_owned(), Value::Float(*value))).collect();
        let parameter = |(name, value, ci95): (&'static str, f64, Option<[f64; 2]>)| {
            let unit = kind.unit(name, Some(at)).to_owned();
            (name.to_owned(), Parameter { value: Value::Float(value), unit, ci95 })
        };
        Finding {
            kind,
            joint,
            parameters: numbers.into_iter().map(parameter).collect(),
            table: EffectTable {
                kind: name.to_owned(),
                joint: Some(at.name.clone()),
                parameters: table,
                line: 0,
            },
            is_named: true,
            remark,
            absent: None,
        }
    }

    /// Untestable effects of the joints: all effects of joints at rest, and stiffnesses without a load.
    pub fn untestable(&self, moves: &[bool]) -> Vec<Untestable> {
        let lack = |joint: usize| {
            let name = &self.joint(joint).name;
            if !moves[joint] {
                return Some(format!("{name} is never commanded to move"));
            }
            (!self.is_known(joint)).then(|| {
                format!(
                    "the load on {name} does not change: only ratios to its servo's stiffness can be identified, not values in N·m"
                )
            })
        };
        let of_joint = |joint: usize| {
            lack(joint).map(|because| Untestable {
                kind: "servo",
                joint: Some(self.joint(joint).name.clone()),
                because,
            })
        };
        let mut all: Vec<Untestable> = (0..moves.len()).filter_map(of_joint).collect();
        let arm = [
            (
                "viscous_friction",
                "commanded and measured positions alone can't separate viscous friction from the servo's own damping: `damping` contains both",
            ),
            (
                "payload",
                "without torques, only the dependence of droop on the pose separates a payload far out on the last link from softer servos; the last joint alone does not",
            ),
            (
                "joint_elasticity",
                "elasticity behind the encoder shows only in the tool or in the link's encoder",
            ),
            (
                "backlash",
                "play behind the encoder shows only in the tool, in the link's encoder, or through the weight of the links on given servos",
            ),
        ];
        all.extend(arm.map(|(kind, because)| Untestable { kind, joint: None, because: because.to_owned() }));
        all
    }
}

/// Inertia that each joint of `arm` moves with all joints at zero, kg·m² (kg).
pub fn moved(arm: &Arm) -> Vec<f64> {
    let mut mass = DMatrix::zeros(arm.dof(), arm.dof());
    crba(arm, &mut Workspace::new(arm), &vec![0.0; arm.dof()], &mut mass);
    mass.diagonal().iter().copied().collect()
}

/// Tolerance of `parameter` on a machine of a model with the given `value`.
pub fn tolerance(parameter: ModelParameter, value: f64, tolerances: &Tolerances) -> f64 {
    match parameter {
        // Logarithms.
        ModelParameter::Stiffness | ModelParameter::TorqueLimit | ModelParameter::SpeedLimit => {
            tolerances.friction
        }
        ModelParameter::Lag
        | ModelParameter::Coulomb
        | ModelParameter::Stiction
        | ModelParameter::Deadband => tolerances.friction * value.abs(),
        ModelParameter::Rotor => tolerances.inertia * value.abs(),
        ModelParameter::Delay => tolerances.delay,
        ModelParameter::Offset | ModelParameter::Zero => tolerances.zero,
        ModelParameter::LinkMass => tolerances.mass,
        _ => 0.0,
    }
}

/// A distance of a joint of `kind`, rad (m), with the half-width of its interval: `37.2 ± 1.3 mrad (2.1°)`, or in mm.
pub fn distance(kind: JointKind, value: f64, half: Option<f64>) -> String {
    let (unit, degrees) = match kind {
        JointKind::Revolute => ("mrad", format!(" ({:.1}°)", value.to_degrees())),
        JointKind::Prismatic => ("mm", String::new()),
    };
    let half = half.map_or_else(String::new, |half| format!(" ± {:.1}", half * 1e3));
    format!("{:.1}{half} {unit}{degrees}", value * 1e3)
}

/// The entry called `name`.
pub fn known(name: &str) -> &'static Kind {
    kind(name).unwrap_or(freeplay_laws::COMMANDED[0])
}

pub fn around(value: f64, deviation: f64) -> [f64; 2] {
    [value - half_width() * deviation, value + half_width() * deviation]
}

fn around_log(value: f64, deviation: f64) -> [f64; 2] {
    [value * (-half_width() * deviation).exp(), value * (half_width() * deviation).exp()]
}
