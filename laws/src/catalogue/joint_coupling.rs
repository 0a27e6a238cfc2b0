//! Two joints whose gears share a shaft, as the last two axes of many wrists do.
//!
//! Law: a shaft turns at u = q̇ᵢ + s q̇ⱼ, with i the joint of the effect, j = `with` and s = `sign`. Its inertia I \[kg·m²\], viscous
//! friction F_v \[N·m·s/rad\] and Coulomb friction F_c \[N·m\], all ≥ 0, load both joints in addition to the model: X = I u̇ + F_v u + F_c
//! sign(u), τᵢ = X and τⱼ = s X. The torque of each joint thus depends on the motion of the other. The power τᵢ q̇ᵢ + τⱼ q̇ⱼ = X u is never
//! negative except for the inertia's part. This is the form `shaft`. In the form `cross` the joint's own parameters already include its own
//! share of inertia and viscous friction: τᵢ = s (I q̈ⱼ + F_v q̇ⱼ) + F_c sign(u), τⱼ = s (I q̈ᵢ + F_v q̇ᵢ) + s F_c sign(u).
//! Source: Janot, Vandanjon & Gautier 2014, IEEE Trans. Control Syst. Technol. 22:132, §IV (coupled joints 5 and 6 of a Stäubli TX40), who have `cross`.

use freeplay_model::export::Element;
use toml::{Table, Value};

use crate::archive::Archive;
use crate::basis::with;
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::place::{Place, Site};
use crate::scene::Scene;

/// The two forms of the law.
const FORMS: &[&str] = &["shaft", "cross"];
/// Number of axes of a wrist, whose motor shafts run through one another.
const WRIST: usize = 3;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "joint_coupling",
    title: "coupling of two joints",
    words: "a gear coupling with {with}",
    site: Site::Joint,
    parameters: &[
        Parameter { name: "with", meaning: "the other joint", range: Range::OtherJoint },
        Parameter::number("inertia", "inertia of the shaft", "kg*m^2", [0.0, 1e6]).or(0.0),
        Parameter::number("viscous", "viscous friction of the shaft", "N*m*s/rad", [0.0, 1e6]).or(0.0),
        Parameter::number("coulomb", "Coulomb friction of the shaft", "N*m", [0.0, 1e6]).or(0.0),
        Parameter::number("sign", "turns of the shaft for one turn of the other joint", "1", [-1e3, 1e3])
            .or(1.0)
            .choice(),
        Parameter {
            name: "form",
            meaning: "load of a joint by the shaft's inertia and viscous friction: from the motion of both joints, or from that of the other joint only",
            range: Range::Word(FORMS),
        },
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "τᵢ = X, τⱼ = s X, X = I u̇ + F_v u + F_c sign(u), u = q̇ᵢ + s q̇ⱼ; in the form cross without each joint's own share of I u̇ + F_v u",
    source: "Janot, Vandanjon & Gautier 2014, §IV",
    signature: "the residual of one joint follows the speed and acceleration of another, and vice versa",
    confounders: &[
        ("coulomb_friction", "follows the joint's own direction"),
        ("viscous_friction", "follows the joint's own speed"),
        ("rotor_inertia", "follows the joint's own acceleration"),
        ("load_dependent_friction", "follows the load"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Motion],
    terms: Terms::NON_NEGATIVE,
    shapes: partners,
    build: |values| {
        Ok(Box::new(JointCoupling {
            joints: [values.joint()?, values.other_joint("with")?],
            sign: values.number("sign")?,
            is_shaft: values.word("form")? == FORMS[0],
            inertia: values.number("inertia")?,
            viscous: values.number("viscous")?,
            coulomb: values.number("coulomb")?,
            direction: 0.0,
        }))
    },
};

/// The previous joint, and in a wrist any previous joint, if they move; for equal and opposite rotation, in both forms. With s = ±1 the law
/// is symmetric in the two joints, so that the search tries each pair once, at its outer joint.
fn partners(place: &Place) -> Vec<Table> {
    let joints = place.scene.arm.joints().iter().enumerate();
    let moving = |joint: usize| place.scene.motion.v[joint].iter().any(|v| v.abs() > 1e-6);
    let wrist = place.scene.arm.dof().saturating_sub(WRIST);
    let near = |joint: usize| {
        place.joint.is_some_and(|own| joint + 1 == own || joint < own && joint >= wrist && wrist > 0)
    };
    let others = joints.filter(|(joint, _)| near(*joint) && moving(*joint));
    let shape = |name: &str, sign: f64, form: &str| {
        let mut shape = with(&Table::new(), [("sign", sign)]);
        shape.insert("with".to_owned(), Value::from(name));
        shape.insert("form".to_owned(), Value::from(form));
        shape
    };
    let ways = FORMS.iter().flat_map(|form| [1.0, -1.0].map(|sign| (sign, *form)));
    others.flat_map(|(_, joint)| ways.clone().map(|(sign, form)| shape(&joint.name, sign, form))).collect()
}

#[derive(Clone, Copy, Debug)]
struct JointCoupling {
    joints: [usize; 2],
    sign: f64,
    is_shaft: bool,
    inertia: f64,
    viscous: f64,
    coulomb: f64,
    /// The share of its dry friction that acts on the shaft in a simulation, −1 to 1.
    direction: f64,
}

impl JointCoupling {
    /// Share of the inertia and the viscous friction in the load by a joint's own motion.
    fn own(&self) -> f64 {
        if self.is_shaft { 1.0 } else { 0.0 }
    }
}

impl Effect for JointCoupling {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let [own, other] = self.joints;
        let motion = scene.motion;
        for point in 0..motion.len() {
            let [v, a] = [&motion.v, &motion.a].map(|x| [x[own][point], self.sign * x[other][point]]);
            let u = v[0] + v[1];
            let dry = if u == 0.0 { 0.0 } else { self.coulomb * u.signum() };
            let load = |mine: usize, theirs: usize| {
                let (v, a) = (v[theirs] + self.own() * v[mine], a[theirs] + self.own() * a[mine]);
                self.inertia * a + self.viscous * v + dry
            };
            torque[own][point] += load(0, 1);
            torque[other][point] += self.sign * load(1, 0);
        }
    }

    fn inject(&self, injection: &mut Injection) {
        let [own, other] = self.joints;
        if self.is_shaft {
            injection.rotors.extend([(own, self.inertia), (other, self.sign * self.sign * self.inertia)]);
        }
        injection.drives.push(Box::new(*self));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::Shaft {
            joints: self.joints,
            ratio: self.sign,
            inertia: self.inertia,
            viscous: self.viscous,
            coulomb: self.coulomb,
            own_shares_named: !self.is_shaft,
        });
        ExportCoverage::Whole
    }
}

impl DriveLaw for JointCoupling {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        let [own, other] = self.joints;
        let v = [now.v[own], self.sign * now.v[other]];
        let end = v[0] + v[1] + 0.5 * now.step * (now.a[own] + self.sign * now.a[other]);
        // The mobility of the shaft is greatest where both joints yield to it together.
        let yielding =
            now.stopping[own].sqrt().recip() + self.sign.abs() * now.stopping[other].sqrt().recip();
        if self.coulomb > 0.0 {
            self.direction = (self.direction + end / (yielding.powi(2) * self.coulomb)).clamp(-1.0, 1.0);
        }
        let dry = self.coulomb * self.direction;
        let load = |mine: usize, theirs: usize| self.viscous * (v[theirs] + self.own() * v[mine]) + dry;
        // The rotors, or the joint's own parameters, contain the joint's own share of the inertia. The term of the other joint's
        // acceleration is one sub-step old, and smaller than those shares, so that it converges.
        let across = self.sign * self.inertia;
        torque[own] -= load(0, 1) + across * now.a[other];
        torque[other] -= self.sign * load(1, 0) + across * now.a[own];
    }

    fn restart(&mut self) {
        self.direction = 0.0;
    }

    fn transfer_state(&mut self, archive: &mut Archive) {
        archive.real(&mut self.direction);
    }
}
