//! The causes that a given model with servos may lack, and the tolerances of its parameters.

use freeplay_model::ArmFile;
use freeplay_servo::{DIFFERENCE_STEP, ModelParameter, Problem, ServoArm, Sight, Unknown, unknowns};

use super::burdens::{Burdened, Rival, burdens, masses, present};
use super::findings::{moved, tolerance};
use super::limits::limits;
use crate::data::tolerance::Tolerances;

/// Trial changes of a parameter, as shares of the standard deviation of its prior: a descent from the given value alone can end in a local minimum.
const SHARES: [f64; 10] = [-0.8, -0.4, -0.2, -0.1, -0.05, 0.05, 0.1, 0.2, 0.4, 0.8];

/// One cause that a given model may lack.
#[derive(Clone, Debug)]
pub struct Change {
    /// Its kind in the catalogue.
    pub kind: &'static str,
    /// Index of its joint; `None` if it is the whole arm's.
    pub joint: Option<usize>,
    /// Its parameters.
    pub unknowns: Vec<Unknown>,
    /// Initial values of its parameters for a fit.
    pub places: Vec<Vec<f64>>,
    /// Log odds of the changed model against the model without the change, all other parameters refitted.
    pub evidence: f64,
    /// Other causes that the recordings don't distinguish from it.
    pub rivals: Vec<Rival>,
}

impl Change {
    /// A change without evidence yet.
    fn new(
        kind: &'static str,
        joint: Option<usize>,
        unknowns: Vec<Unknown>,
        places: Vec<Vec<f64>>,
    ) -> Change {
        Change { kind, joint, unknowns, places, evidence: 0.0, rivals: Vec::new() }
    }

    fn of_joint(kind: &'static str, unknown: Unknown, given: &ServoArm) -> Change {
        let value = unknown.of(given);
        let places = SHARES.map(|share| vec![value + share * unknown.deviation]);
        let places = places.into_iter().filter(|place| place[0] >= unknown.least).collect();
        Change::new(kind, Some(unknown.joint), vec![unknown], places)
    }

    /// A servo of another stiffness and damping: the initial values scale both by the same factor.
    fn of_servo([stiffness, damping]: [Unknown; 2], given: &ServoArm) -> Change {
        let [k, d] = [&stiffness, &damping].map(|unknown| unknown.of(given));
        let place = |share: f64| {
            let log = share * stiffness.deviation;
            vec![k + log, d * log.exp()]
        };
        let places = SHARES.map(place).to_vec();
        Change::new("servo", Some(stiffness.joint), vec![stiffness, damping], places)
    }

    fn of_arm(burden: Burdened, places: Vec<Vec<f64>>) -> Change {
        Change::new(burden.kind, burden.joint, burden.unknowns, places)
    }

    /// `model` with the parameters of the change set to `place`.
    pub fn placed(&self, model: &ServoArm, place: &[f64]) -> ServoArm {
        let mut model = model.clone();
        self.unknowns.iter().zip(place).for_each(|(unknown, x)| unknown.set(&mut model, *x));
        model
    }

    /// The same change for a model whose only joint is this one.
    pub fn of_first_joint(&self) -> Change {
        let first = |unknown: &Unknown| Unknown { joint: 0, ..*unknown };
        Change { unknowns: self.unknowns.iter().map(first).collect(), ..self.clone() }
    }

    /// Returns true if the change has one direction, so that a line search can continue between two neighbouring places. A base inclines in two directions: its
    /// places fill a plane.
    pub fn is_along_a_line(&self) -> bool {
        !self.unknowns.iter().any(|unknown| unknown.parameter == ModelParameter::Roll)
    }

    /// Returns true if the change belongs to the arm (a payload, an inclination, a link's mass), and not to a servo.
    pub fn is_burden(&self) -> bool {
        self.unknowns.iter().any(|unknown| unknown.parameter.is_of_arm())
    }

    /// The change as a burden.
    pub fn burdened(&self) -> Burdened {
        let (unknowns, rivals) = (self.unknowns.clone(), self.rivals.clone());
        Burdened { kind: self.kind, joint: self.joint, unknowns, rivals }
    }

    /// True if this change and `other` free the same unknowns of the model.
    pub fn is_same(&self, other: &Change) -> bool {
        self.unknowns.len() == other.unknowns.len() && self.unknowns.iter().all(|unknown| other.has(unknown))
    }

    /// The parameters that must differ from zero: all but those of a position.
    pub fn present(&self) -> impl Iterator<Item = &Unknown> {
        present(&self.unknowns)
    }

    /// Returns true if the change contains `unknown`.
    pub fn has(&self, unknown: &Unknown) -> bool {
        self.unknowns.iter().any(|one| one.is_same(unknown))
    }
}

/// The given model and its tolerances.
pub struct Given<'a> {
    /// The file of the model.
    pub file: &'a ArmFile,
    /// The model.
    pub model: &'a ServoArm,
    /// Lag, stiffness and encoder step of each joint, as the recordings show them before any fit.
    pub sights: &'a [Sight],
    /// True for each joint whose command moves.
    pub moves: &'a [bool],
    /// Tolerances of the machine about its model.
    pub tolerances: &'a Tolerances,
}

impl Given<'_> {
    /// All parameters of the joints without a known value, in N·m.
    fn broad(&self) -> Vec<Unknown> {
        let all = unknowns(self.sights, self.model, self.tolerances.zero).into_iter();
        let moving = all.filter(|unknown| self.moves[unknown.joint]);
        moving.map(|unknown| unknown.in_torque(self.model.joints[unknown.joint].stiffness)).collect()
    }

    /// All parameters of the model, with their tolerances.
    pub fn known(&self) -> Vec<Unknown> {
        let moved = moved(&self.model.arm);
        let about = |unknown: Unknown| {
            let value = unknown.of(self.model);
            let (of, least) = match unknown.parameter {
                // The inertia that the joint moves has the same tolerance, and may be less than that of the model.
                ModelParameter::Rotor => (value + moved[unknown.joint], f64::NEG_INFINITY),
                _ => (value, unknown.least),
            };
            let tolerance = tolerance(unknown.parameter, of, self.tolerances);
            // Rounding adds to the distance between the zeros of commands and encoder.
            let deviation =
                if unknown.parameter == ModelParameter::Offset { unknown.deviation } else { tolerance };
            Unknown { expected: value, deviation, least, ..unknown }
        };
        let all = self.broad().into_iter().chain(self.limits()).map(about);
        all.filter(|unknown| unknown.deviation > 0.0).chain(masses(self.file, self.tolerances)).collect()
    }

    /// The limits in the model.
    fn limits(&self) -> Vec<Unknown> {
        let of_joint = |joint: usize| {
            let limit = move |parameter, deviation: f64| Unknown {
                joint,
                parameter,
                expected: 0.0,
                deviation,
                step: DIFFERENCE_STEP * deviation,
                is_torque: true,
                least: parameter.least(),
            };
            let servo = &self.model.joints[joint];
            let torque = servo.torque_limit.is_finite().then(|| limit(ModelParameter::TorqueLimit, 1.0));
            let speed = servo.speed_limit.is_finite().then(|| limit(ModelParameter::SpeedLimit, 1.0));
            let band = (servo.deadband > 0.0).then(|| limit(ModelParameter::Deadband, servo.deadband));
            [torque, speed, band].into_iter().flatten()
        };
        (0..self.moves.len()).filter(|joint| self.moves[*joint]).flat_map(of_joint).collect()
    }

    /// A common delay of the commands of all joints, as on one line; `None` if a single joint moves. Each joint keeps a delay of its own.
    fn late_line(&self, broad: &[Unknown]) -> Option<Change> {
        let unknowns: Vec<Unknown> =
            broad.iter().filter(|one| one.parameter == ModelParameter::Delay).copied().collect();
        let first = unknowns.first().filter(|_| unknowns.len() > 1)?;
        let place = |share: f64| {
            let late =
                |unknown: &Unknown| (unknown.of(self.model) + share * first.deviation).max(unknown.least);
            unknowns.iter().map(late).collect()
        };
        let places = SHARES.map(place).to_vec();
        Some(Change::new("command_delay", None, unknowns, places))
    }

    /// All changes that the search can test.
    pub fn candidates(&self, fit: &Problem) -> Vec<Change> {
        let broad = self.broad();
        let of = |joint: usize, parameter: ModelParameter| {
            broad.iter().find(|one| one.joint == joint && one.parameter == parameter).copied()
        };
        let single = [
            (ModelParameter::Coulomb, "coulomb_friction"),
            (ModelParameter::Stiction, "stribeck_friction"),
            (ModelParameter::Rotor, "rotor_inertia"),
            (ModelParameter::Delay, "command_delay"),
        ];
        let of_joint = |joint: usize| {
            let servo = of(joint, ModelParameter::Stiffness).zip(of(joint, ModelParameter::Lag));
            let servo = servo.map(|(k, d)| Change::of_servo([k, d], self.model));
            let single =
                single.iter().filter_map(move |(parameter, kind)| Some((of(joint, *parameter)?, *kind)));
            let single = single.map(|(unknown, kind)| Change::of_joint(kind, unknown, self.model));
            servo.into_iter().chain(single).collect::<Vec<_>>()
        };
        let joints = (0..self.moves.len()).flat_map(of_joint).chain(self.late_line(&broad));
        let limits = limits(fit, self.sights, self.model).into_iter();
        let limits = limits.filter(|limit| self.moves[limit.unknown.joint]).map(|limit| {
            let joint = limit.unknown.joint;
            let unknown = limit.unknown.in_torque(self.model.joints[joint].stiffness);
            let shift = unknown.expected - limit.unknown.expected;
            let places = limit.places.into_iter().map(|x| vec![x + shift]).collect();
            Change::new("servo", Some(joint), vec![unknown], places)
        });
        let arm = burdens(self.file).into_iter().map(|(burden, places)| Change::of_arm(burden, places));
        joints.chain(limits).chain(arm).collect()
    }
}
