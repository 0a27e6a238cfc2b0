//! The TOML arm file: text → arm and effects.

use std::path::Path;

use freeplay_storage::plain_words;
use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use toml::Spanned;

use crate::arm_file::{ArmFile, EffectTable, Selection};
use crate::error::{ModelError, shortened};
use crate::load::load_selected;
use crate::numbers::{IMPOSSIBLE, NO_REAL_BODY, direction, rotation};
use crate::plausible;
use crate::plausible::Body;
use crate::text::check_extent;
use crate::toml_tables::{ArmTable, FrameTable, InertiaTable, JointTable, KindName, LimitsTable};
use crate::urdf_tree::{GRAVITY, lacking};
use freeplay_arm::{
    Arm, ArmError, Fitness, Inertia, Joint, JointFriction, JointKind, JointSource, Limits, Place, Shortfall,
};

/// Reads the arm file `text`. `path` names the file in errors; a relative `urdf` in the file starts from the folder of `path`.
///
/// ```toml
/// name = "arm"                      # optional with a URDF
/// gravity = [0, 0, -9.81]           # optional, m/s² in the base frame
/// urdf = "arm.urdf"                 # beside this file; [[joint]] tables then change its joints; or the joints from the base outwards:
/// tip = "tool0"                     # with a URDF: the link at the end of the arm
///
/// [[joint]]
/// name = "joint_1"
/// type = "revolute"                 # or "prismatic"
/// axis = [0, 0, 1]                  # in the joint frame
/// origin = { xyz = [0, 0, 0.3], rpy = [0, 0, 0] }   # in the frame of the link before; or quaternion = [x, y, z, w]
/// mass = 2.0                        # kg; without it the link is massless
/// com = [0.1, 0, 0]                 # m, in the link frame
/// inertia = { ixx = 0.1, iyy = 0.1, izz = 0.1, ixy = 0, ixz = 0, iyz = 0 }   # kg·m² about the centre of mass, along the link frame
/// limits = { lower = -1, upper = 1, velocity = 2, acceleration = 10, effort = 50 }   # infinite where missing
/// damping = 0.1                     # N·m·s/rad or N·s/m
/// friction = 0.5                    # N·m or N
/// rotor_inertia = 0.2               # of the motor through its gear, on the joint's side, kg·m² or kg
///
/// [tool]                            # tool0 in the frame of the last link
/// xyz = [0.1, 0, 0]
///
/// [[effect]]                        # physics beyond the rigid body
/// kind = "coulomb_friction"
/// joint = "joint_1"
/// coulomb = 3.0
/// ```
///
/// # Errors
/// [`ModelError`] with line, column, value and remedy; unknown keys are errors.
pub fn parse_toml(text: &str, path: &Path) -> Result<ArmFile, ModelError> {
    parse(text, path, &Selection::default())
}

/// Parses an arm file with the chain of its URDF that `selection` names; the tip of `selection` overrides that of the file.
pub(super) fn parse(text: &str, path: &Path, selection: &Selection) -> Result<ArmFile, ModelError> {
    let origin = path.display().to_string();
    check_extent(text, &origin)?;
    let table: ArmTable = toml::from_str(text).map_err(|error| syntax_error(&origin, text, &error))?;
    let reader = Reader { origin: &origin, text };
    let effects = reader.effects(&table.effect)?;
    let (arm, ignored) = reader.arm(&table, path, selection)?;
    for effect in &effects {
        reader.check_effect_joint(effect, &arm)?;
    }
    Ok(ArmFile { arm, effects, ignored })
}

/// A parser error with its place, and the line and the caret from the parser below the message.
fn syntax_error(origin: &str, text: &str, error: &toml::de::Error) -> ModelError {
    let at = Place::in_text(origin, text, error.span().map_or(0, |span| span.start));
    let mut message = plain_words(error.message());
    let drawn = error.to_string();
    for line in drawn.lines().skip(1).take_while(|line| line.contains('|') && line.len() <= LONGEST_LINE) {
        message.push('\n');
        message.push_str(line);
    }
    ModelError::Syntax { at, message }
}

/// Longest line of a file that an error repeats.
const LONGEST_LINE: usize = 400;

struct Reader<'a> {
    origin: &'a str,
    text: &'a str,
}

impl Reader<'_> {
    fn arm(
        &self,
        table: &ArmTable,
        path: &Path,
        selection: &Selection,
    ) -> Result<(Arm, Vec<String>), ModelError> {
        let (base, mut ignored) = match &table.urdf {
            Some(urdf) => {
                self.refuse_whole_joints(table)?;
                let file = self.urdf(table, urdf, path, selection)?;
                (Some(file.arm), file.ignored)
            }
            None => {
                self.refuse_tip(table, selection)?;
                (None, Vec::new())
            }
        };
        let gravity = match &table.gravity {
            Some(gravity) => Vector3::from(self.finite(gravity, "gravity")?),
            None => GRAVITY,
        };
        let tool = match (&table.tool, &base) {
            (Some(tool), _) => self.frame(tool, "tool")?,
            (None, Some(base)) => *base.tool(),
            (None, None) => Isometry3::identity(),
        };
        let joints = match &base {
            Some(base) => self.changed(base, &table.joint)?,
            None => table.joint.iter().map(|joint| self.joint(joint)).collect::<Result<_, _>>()?,
        };
        let name = table.name.as_deref().or(base.as_ref().map(Arm::name)).unwrap_or("arm");
        let impossible =
            joints.iter().filter(|joint| base.is_none() && joint.inertia.triangle_excess() > IMPOSSIBLE);
        let notes = impossible.map(|joint| format!("joint `{}`: {NO_REAL_BODY}", joint.name));
        ignored.extend(notes);
        let fitness = base.as_ref().map_or_else(|| self.fitness(table), |base| base.fitness().clone());
        let lacked = base.as_ref().and_then(lacking);
        let arm = Arm::derived(name, joints, tool, gravity, &fitness)
            .map_err(|source| self.arm_error(table, source))?;
        // This file may supply what its URDF lacks.
        let lacks = lacking(&arm);
        ignored.retain(|note| lacks.is_some() || Some(note) != lacked.as_ref());
        if base.is_none() {
            ignored.extend(lacks);
            ignored.extend(plausible::notes(&arm, &self.bodies(table, &arm), &self.sources(table)));
        }
        Ok((arm, ignored))
    }

    /// Defects of an arm with inline joints, besides those of its joints.
    fn fitness(&self, table: &ArmTable) -> Fitness {
        let has_mass = |joint: &Spanned<JointTable>| {
            let JointTable { mass, inertia, .. } = joint.get_ref();
            let tensor = inertia.as_ref().map(|inertia| inertia.get_ref());
            mass.as_ref().is_some_and(|mass| *mass.get_ref() > 0.0)
                || tensor.is_some_and(|tensor| tensor.ixx + tensor.iyy + tensor.izz > 0.0)
        };
        let has_rotor = |joint: &Spanned<JointTable>| joint.get_ref().rotor_inertia.is_some();
        let massless = !table.joint.iter().any(|joint| has_mass(joint) || has_rotor(joint));
        let shortfall = massless.then(|| Shortfall::NoMasses { at: Place::start(self.origin) });
        Fitness::of_file(self.sources(table), shortfall)
    }

    fn sources(&self, table: &ArmTable) -> Vec<JointSource> {
        let of = |joint: &Spanned<JointTable>| {
            let name = joint.get_ref().name.clone();
            JointSource { joint: name.clone(), link: name, at: self.place(joint) }
        };
        table.joint.iter().map(of).collect()
    }

    fn bodies(&self, table: &ArmTable, arm: &Arm) -> Vec<Body> {
        let of = |(spanned, joint): (&Spanned<JointTable>, &Joint)| Body {
            name: format!("joint `{}` (line {})", joint.name, self.place(spanned).line),
            inertia: joint.inertia,
        };
        table.joint.iter().zip(arm.joints()).map(of).collect()
    }

    /// Inline joints have no links to choose from.
    fn refuse_tip(&self, table: &ArmTable, selection: &Selection) -> Result<(), ModelError> {
        let (at, tip) = match (&table.tip, &selection.tip) {
            (_, Some(tip)) => (Place::start(self.origin), tip),
            (Some(tip), None) => (self.place(tip), tip.get_ref()),
            (None, None) => return Ok(()),
        };
        Err(ModelError::Value {
            at,
            what: "tip".to_owned(),
            value: shortened(tip),
            remedy:
                "a tip is a link of a `urdf`; an arm of [[joint]] tables ends with its last joint and [tool]"
                    .to_owned(),
        })
    }

    /// The URDF defines the placement of a joint already, so that a table beside it must not.
    fn refuse_whole_joints(&self, table: &ArmTable) -> Result<(), ModelError> {
        let is_whole =
            |table: &JointTable| table.r#type.is_some() || table.axis.is_some() || table.origin.is_some();
        let Some(spanned) = table.joint.iter().find(|spanned| is_whole(spanned.get_ref())) else {
            return Ok(());
        };
        let remedy = "give either `urdf` or [[joint]] tables with type, axis and origin; beside `urdf` a [[joint]] changes mass, com, \
                      inertia, limits, damping, friction and rotor_inertia";
        Err(self.value(spanned, "an inline joint beside `urdf`", &spanned.get_ref().name, remedy))
    }

    /// The joints of `base`, changed by `tables`.
    fn changed(&self, base: &Arm, tables: &[Spanned<JointTable>]) -> Result<Vec<Joint>, ModelError> {
        let mut joints = base.joints().to_vec();
        for spanned in tables {
            let table = spanned.get_ref();
            let Some(joint) = joints.iter_mut().find(|joint| joint.name == table.name) else {
                let known: Vec<&str> = base.joints().iter().map(|joint| joint.name.as_str()).collect();
                let remedy = format!("the arm has {}", known.join(", "));
                return Err(self.value(spanned, "a [[joint]] beside `urdf`", &table.name, &remedy));
            };
            self.change(joint, table)?;
        }
        Ok(joints)
    }

    fn change(&self, joint: &mut Joint, table: &JointTable) -> Result<(), ModelError> {
        let of = |what: &str| format!("joint `{}`: {what}", table.name);
        let number = |given: &Option<Spanned<f64>>, what: &str, old: &mut f64| {
            if given.is_some() {
                *old = self.not_negative(given.as_ref(), &of(what))?;
            }
            Ok::<(), ModelError>(())
        };
        number(&table.damping, "damping", &mut joint.friction.viscous)?;
        number(&table.friction, "friction", &mut joint.friction.coulomb)?;
        number(&table.rotor_inertia, "rotor_inertia", &mut joint.rotor_inertia)?;
        number(&table.mass, "mass", &mut joint.inertia.mass)?;
        let given = self.inertia(table, &of)?;
        if table.com.is_some() {
            joint.inertia.com = given.com;
        }
        if table.inertia.is_some() {
            joint.inertia.about_com = given.about_com;
        }
        if let Some(limits) = &table.limits {
            joint.limits = self.limits(limits, &of("limits"))?;
        }
        Ok(())
    }

    fn urdf(
        &self,
        table: &ArmTable,
        urdf: &Spanned<String>,
        path: &Path,
        selection: &Selection,
    ) -> Result<ArmFile, ModelError> {
        let file = path.parent().unwrap_or(Path::new("")).join(urdf.get_ref());
        let extension = file.extension().map(|extension| extension.to_ascii_lowercase());
        // An arm file based on another arm file could refer to itself.
        if !extension.is_some_and(|extension| ["urdf", "xml", "mjcf"].iter().any(|known| extension == *known))
        {
            return Err(self.value(urdf, "urdf", urdf.get_ref(), "name a .urdf, .xml or .mjcf file"));
        }
        let tip = selection.tip.clone().or_else(|| table.tip.as_ref().map(|tip| tip.get_ref().clone()));
        let selection = Selection { tip, ..selection.clone() };
        load_selected(&file, &selection).map_err(|error| match error {
            ModelError::Read { source, .. } => {
                let remedy = format!("looked for at {}: {source}", shortened(&file.display().to_string()));
                self.value(urdf, "urdf", urdf.get_ref(), &remedy)
            }
            other => other,
        })
    }

    fn joint(&self, spanned: &Spanned<JointTable>) -> Result<Joint, ModelError> {
        let table = spanned.get_ref();
        let of = |what: &str| format!("joint `{}`: {what}", table.name);
        let given =
            table.axis.as_ref().ok_or_else(|| self.missing(spanned, &of("axis"), "axis = [0, 0, 1]"))?;
        let axis = self.finite(given, &of("axis"))?;
        let axis = direction(axis).ok_or_else(|| {
            self.value(given, &of("axis"), &format!("{axis:?}"), "an axis needs a direction")
        })?;
        let placement = match &table.origin {
            Some(origin) => self.frame(origin, &of("origin"))?,
            None => Isometry3::identity(),
        };
        let kind = match table.r#type {
            Some(KindName::Revolute) => JointKind::Revolute,
            Some(KindName::Prismatic) => JointKind::Prismatic,
            None => return Err(self.missing(spanned, &of("type"), "type = \"revolute\"")),
        };
        let friction = JointFriction {
            viscous: self.not_negative(table.damping.as_ref(), &of("damping"))?,
            coulomb: self.not_negative(table.friction.as_ref(), &of("friction"))?,
        };
        let limits = match &table.limits {
            Some(limits) => self.limits(limits, &of("limits"))?,
            None => Limits::NONE,
        };
        let inertia = self.inertia(table, &of)?;
        let rotor_inertia = self.not_negative(table.rotor_inertia.as_ref(), &of("rotor_inertia"))?;
        let name = table.name.clone();
        Ok(Joint { name, kind, axis, placement, limits, friction, rotor_inertia, inertia })
    }

    fn inertia(&self, table: &JointTable, of: &dyn Fn(&str) -> String) -> Result<Inertia, ModelError> {
        let mass = self.not_negative(table.mass.as_ref(), &of("mass"))?;
        let com = match &table.com {
            Some(com) => Vector3::from(self.finite(com, &of("com"))?),
            None => Vector3::zeros(),
        };
        let mut inertia = Inertia { mass, com, about_com: Matrix3::zeros() };
        if let Some(spanned) = &table.inertia {
            let &InertiaTable { ixx, iyy, izz, ixy, ixz, iyz } = spanned.get_ref();
            inertia.about_com = Matrix3::new(ixx, ixy, ixz, ixy, iyy, iyz, ixz, iyz, izz);
            if let Some(problem) = inertia.tensor_problem() {
                let found = format!("ixx={ixx} iyy={iyy} izz={izz} ixy={ixy} ixz={ixz} iyz={iyz}");
                return Err(self.value(spanned, &of("inertia"), &found, &problem));
            }
        }
        Ok(inertia)
    }

    fn limits(&self, table: &LimitsTable, of: &str) -> Result<Limits, ModelError> {
        let bound = |spanned: &Option<Spanned<f64>>, name: &str| match spanned {
            Some(value) if value.get_ref().is_nan() || *value.get_ref() <= 0.0 => {
                let found = value.get_ref().to_string();
                Err(self.value(
                    value,
                    &format!("{of}: {name}"),
                    &found,
                    "it must be positive; leave it out for none",
                ))
            }
            Some(value) => Ok(*value.get_ref()),
            None => Ok(f64::INFINITY),
        };
        let lower = table.lower.as_ref().map_or(f64::NEG_INFINITY, |v| *v.get_ref());
        let upper = table.upper.as_ref().map_or(f64::INFINITY, |v| *v.get_ref());
        if let Some(value) = table.lower.as_ref().or(table.upper.as_ref())
            && (lower > upper || lower.is_nan() || upper.is_nan())
        {
            let remedy = "two numbers are needed, lower ≤ upper";
            return Err(self.value(value, of, &format!("lower = {lower}, upper = {upper}"), remedy));
        }
        Ok(Limits {
            lower,
            upper,
            velocity: bound(&table.velocity, "velocity")?,
            acceleration: bound(&table.acceleration, "acceleration")?,
            effort: bound(&table.effort, "effort")?,
        })
    }

    fn frame(&self, spanned: &Spanned<FrameTable>, what: &str) -> Result<Isometry3<f64>, ModelError> {
        let table = spanned.get_ref();
        let xyz = table.xyz.unwrap_or_default();
        let numbers = xyz.iter().chain(table.rpy.iter().flatten()).chain(table.quaternion.iter().flatten());
        if let Some(bad) = numbers.into_iter().find(|x| !x.is_finite()) {
            return Err(self.value(spanned, what, &bad.to_string(), "write finite numbers"));
        }
        let turn = match (table.rpy, table.quaternion) {
            (Some(_), Some(_)) => {
                return Err(self.value(spanned, what, "rpy and quaternion", "give one of the two"));
            }
            (Some(rpy), None) => rotation(rpy),
            (None, None) => UnitQuaternion::identity(),
            (None, Some([x, y, z, w])) => {
                let quaternion = Quaternion::new(w, x, y, z);
                if (quaternion.norm() - 1.0).abs() > 1e-6 {
                    let found = format!("a quaternion of length {}", quaternion.norm());
                    return Err(self.value(
                        spanned,
                        what,
                        &found,
                        "its length must be 1, in the order x, y, z, w",
                    ));
                }
                // A quaternion written with all digits stays unchanged, bit by bit.
                if (quaternion.norm_squared() - 1.0).abs() < 1e-14 {
                    UnitQuaternion::new_unchecked(quaternion)
                } else {
                    UnitQuaternion::new_normalize(quaternion)
                }
            }
        };
        Ok(Isometry3::from_parts(Translation3::new(xyz[0], xyz[1], xyz[2]), turn))
    }

    fn effects(&self, tables: &[Spanned<toml::Table>]) -> Result<Vec<EffectTable>, ModelError> {
        tables.iter().map(|spanned| self.effect(spanned)).collect()
    }

    fn effect(&self, spanned: &Spanned<toml::Table>) -> Result<EffectTable, ModelError> {
        let mut parameters = spanned.get_ref().clone();
        let mut text = |key: &str| match parameters.remove(key) {
            Some(toml::Value::String(text)) => Ok(Some(text)),
            Some(other) => {
                Err(self.value(spanned, &format!("effect: {key}"), &other.to_string(), "write a string"))
            }
            None => Ok(None),
        };
        let kind = text("kind")?.ok_or_else(|| ModelError::Missing {
            at: self.place(spanned),
            what: "effect: kind".to_owned(),
            remedy: "write kind = \"…\" in the [[effect]]".to_owned(),
        })?;
        let joint = text("joint")?;
        Ok(EffectTable { kind, joint, parameters, line: self.place(spanned).line })
    }

    fn check_effect_joint(&self, effect: &EffectTable, arm: &Arm) -> Result<(), ModelError> {
        let Some(joint) = &effect.joint else { return Ok(()) };
        if arm.joint_index(joint).is_some() {
            return Ok(());
        }
        let known: Vec<_> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
        Err(ModelError::Value {
            at: Place { line: effect.line, ..Place::start(self.origin) },
            what: format!("effect `{}`: joint", effect.kind),
            value: joint.clone(),
            remedy: format!("the arm has {}", known.join(", ")),
        })
    }

    fn finite(&self, spanned: &Spanned<[f64; 3]>, what: &str) -> Result<[f64; 3], ModelError> {
        let values = *spanned.get_ref();
        match values.iter().find(|x| !x.is_finite()) {
            Some(bad) => Err(self.value(spanned, what, &bad.to_string(), "write finite numbers")),
            None => Ok(values),
        }
    }

    fn not_negative(&self, spanned: Option<&Spanned<f64>>, what: &str) -> Result<f64, ModelError> {
        let Some(spanned) = spanned else { return Ok(0.0) };
        let value = *spanned.get_ref();
        if value >= 0.0 && value.is_finite() {
            return Ok(value);
        }
        Err(self.value(spanned, what, &value.to_string(), "it must be finite and not negative"))
    }

    fn missing<T>(&self, at: &Spanned<T>, what: &str, example: &str) -> ModelError {
        let remedy = format!("write {example}, or name a `urdf` that has the joint");
        ModelError::Missing { at: self.place(at), what: what.to_owned(), remedy }
    }

    fn value<T>(&self, at: &Spanned<T>, what: &str, value: &str, remedy: &str) -> ModelError {
        ModelError::Value {
            at: self.place(at),
            what: what.to_owned(),
            value: shortened(value),
            remedy: remedy.to_owned(),
        }
    }

    fn place<T>(&self, spanned: &Spanned<T>) -> Place {
        Place::in_text(self.origin, self.text, spanned.span().start)
    }

    fn arm_error(&self, table: &ArmTable, source: ArmError) -> ModelError {
        let joint =
            source.joint().and_then(|name| table.joint.iter().find(|joint| joint.get_ref().name == name));
        let at = joint.map_or_else(|| Place::start(self.origin), |joint| self.place(joint));
        ModelError::Arm { at, source: Box::new(source) }
    }
}
