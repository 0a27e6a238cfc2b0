//! URDF as found in the field: XML → links and joints. What they make up is worked out in `urdf_tree`.

use std::collections::HashMap;

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};
use roxmltree::{Document, Node, ParsingOptions};

use super::error::{ModelError, Place, shortened};
use super::numbers::{IMPOSSIBLE, NO_REAL_BODY, direction, pose};
use super::urdf_xml::{Reader, Source, children};
use super::{ArmFile, check_extent, urdf_tree};
use crate::joint::{Inertia, JointFriction, JointKind, Limits};

/// Most XML nodes that are read; a robot with meshes by reference has some thousands.
const MAX_NODES: u32 = 2_000_000;

/// A `<link>`.
pub(super) struct Link {
    pub name: String,
    /// `None` where the file has no `<inertial>`.
    pub inertia: Option<Inertia>,
    /// Byte offset in the text.
    pub at: usize,
}

/// What a `<joint>` lets its child do.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Motion {
    Moving(JointKind),
    Fixed,
    /// Moves with another joint; kept at zero.
    Mimic,
}

/// A `<joint>`, with its links by index.
pub(super) struct Joint {
    pub name: String,
    pub motion: Motion,
    pub parent: usize,
    pub child: usize,
    pub placement: Isometry3<f64>,
    pub axis: Unit<Vector3<f64>>,
    pub limits: Limits,
    pub friction: JointFriction,
    /// Byte offset in the text.
    pub at: usize,
}

/// Everything of a `<robot>` that an arm needs.
pub(super) struct Robot<'a> {
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<Joint>,
    pub notes: Vec<String>,
    pub source: Source<'a>,
}

/// Reads a URDF robot from `text`; `origin` names the text in errors.
///
/// The chain that ends in a link (or at a fixed joint) called `tool0` is the arm; without one, the longest chain of moving
/// joints, the first of equals. What hangs on it by fixed joints is lumped into the link that carries it; so is what hangs on it
/// by other moving or mimicking joints, locked at zero and named in [`ArmFile::ignored`]. The base frame is the root link.
///
/// # Errors
/// [`ModelError`] with line, column, value and remedy.
pub fn parse_urdf(text: &str, origin: &str) -> Result<ArmFile, ModelError> {
    check_extent(text, origin)?;
    let source = Source { origin, text };
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document =
        Document::parse_with_options(text, options).map_err(|error| syntax_error(origin, &error))?;
    refuse_xacro(&document, &source)?;
    urdf_tree::arm(Reader { source, notes: Vec::new() }.robot(document.root_element())?)
}

fn syntax_error(origin: &str, error: &roxmltree::Error) -> ModelError {
    let pos = error.pos();
    let at = Place { origin: origin.into(), line: pos.row as usize, column: pos.col as usize };
    match error {
        roxmltree::Error::UnknownNamespace(prefix, _) if prefix == "xacro" => {
            ModelError::Xacro { at, found: "an element `xacro:…`".to_owned() }
        }
        _ => ModelError::Syntax {
            at,
            message: format!(
                "not well-formed XML: {}; correct it, or export the arm again",
                shortened(&error.to_string())
            ),
        },
    }
}

fn refuse_xacro(document: &Document<'_>, source: &Source<'_>) -> Result<(), ModelError> {
    for node in document.descendants().filter(Node::is_element) {
        let at = || source.place(node.range().start);
        if node.tag_name().namespace().is_some_and(|uri| uri.ends_with("/xacro")) {
            return Err(ModelError::Xacro { at: at(), found: format!("<xacro:{}>", node.tag_name().name()) });
        }
        if let Some(attribute) = node.attributes().find(|a| a.value().contains("${")) {
            return Err(ModelError::Xacro { at: at(), found: format!("`{}`", shortened(attribute.value())) });
        }
    }
    Ok(())
}

impl<'a> Reader<'a> {
    fn robot(mut self, robot: Node<'_, '_>) -> Result<Robot<'a>, ModelError> {
        if robot.tag_name().name() != "robot" {
            return Err(ModelError::Value {
                at: self.place(robot),
                what: "the root element".to_owned(),
                value: shortened(robot.tag_name().name()),
                remedy: "a URDF file holds one <robot>".to_owned(),
            });
        }
        let name = robot.attribute("name").unwrap_or("robot").to_owned();
        let links = self.links(robot)?;
        let joints = self.joints(robot, &links)?;
        self.note_unused(robot);
        Ok(Robot { name, links, joints, notes: self.notes, source: self.source })
    }

    fn links(&mut self, robot: Node<'_, '_>) -> Result<Vec<Link>, ModelError> {
        let mut links = Vec::new();
        for node in children(robot, "link") {
            let name = self.required(node, "name", "a link")?.value().to_owned();
            let owner = format!("link `{name}`");
            let inertia = match self.first(node, "inertial", &owner) {
                Some(inertial) => Some(self.inertial(inertial, &owner)?),
                None => None,
            };
            links.push(Link { name, inertia, at: node.range().start });
        }
        Ok(links)
    }

    fn joints(&mut self, robot: Node<'_, '_>, links: &[Link]) -> Result<Vec<Joint>, ModelError> {
        let index = self.index(links.iter().map(|link| (link.name.as_str(), link.at)), "link")?;
        let joints =
            children(robot, "joint").map(|node| self.joint(node, &index)).collect::<Result<Vec<_>, _>>()?;
        self.index(joints.iter().map(|joint| (joint.name.as_str(), joint.at)), "joint")?;
        Ok(joints)
    }

    /// Position by name; a second use of a name is an error.
    fn index<'n>(
        &self,
        names: impl Iterator<Item = (&'n str, usize)>,
        what: &'static str,
    ) -> Result<HashMap<&'n str, usize>, ModelError> {
        let mut index = HashMap::new();
        for (i, (name, at)) in names.enumerate() {
            if index.insert(name, i).is_some() {
                return Err(ModelError::Duplicate { at: self.source.place(at), what, name: name.to_owned() });
            }
        }
        Ok(index)
    }

    fn joint(&mut self, node: Node<'_, '_>, links: &HashMap<&str, usize>) -> Result<Joint, ModelError> {
        let name = self.required(node, "name", "a joint")?.value().to_owned();
        let owner = format!("joint `{name}`");
        let parent = self.link_of(node, "parent", links, &owner)?;
        let child = self.link_of(node, "child", links, &owner)?;
        let motion = self.motion(node, &owner)?;
        let placement = self.origin(node, &owner)?;
        let (axis, limits, friction) = if matches!(motion, Motion::Moving(_)) {
            (self.axis(node, &owner)?, self.limits(node, &owner)?, self.friction(node, &owner)?)
        } else {
            (Vector3::x_axis(), Limits::NONE, JointFriction::default())
        };
        Ok(Joint { name, motion, parent, child, placement, axis, limits, friction, at: node.range().start })
    }

    fn motion(&self, node: Node<'_, '_>, owner: &str) -> Result<Motion, ModelError> {
        let kind = self.required(node, "type", owner)?;
        let mimics = children(node, "mimic").next().is_some();
        let remedy = match kind.value() {
            "revolute" | "continuous" | "prismatic" if mimics => return Ok(Motion::Mimic),
            "revolute" | "continuous" => return Ok(Motion::Moving(JointKind::Revolute)),
            "prismatic" => return Ok(Motion::Moving(JointKind::Prismatic)),
            "fixed" => return Ok(Motion::Fixed),
            "floating" | "planar" => {
                "an arm has one motion per joint on a fixed base: make it fixed, or write it as single joints"
            }
            _ => "write revolute, continuous, prismatic or fixed",
        };
        Err(self.value_error(kind, format!("{owner}: type"), remedy.to_owned()))
    }

    fn link_of(
        &self,
        joint: Node<'_, '_>,
        tag: &str,
        links: &HashMap<&str, usize>,
        owner: &str,
    ) -> Result<usize, ModelError> {
        let node = children(joint, tag).next().ok_or_else(|| ModelError::Missing {
            at: self.place(joint),
            what: format!("{owner}: <{tag}>"),
            remedy: format!("write <{tag} link=\"…\"/>"),
        })?;
        let name = self.required(node, "link", owner)?;
        links.get(name.value()).copied().ok_or_else(|| {
            let remedy =
                "there is no link of that name in the file: correct the name or add the link".to_owned();
            self.value_error(name, format!("{owner}: {tag} link"), remedy)
        })
    }

    fn axis(&mut self, joint: Node<'_, '_>, owner: &str) -> Result<Unit<Vector3<f64>>, ModelError> {
        let Some(node) = self.first(joint, "axis", owner) else { return Ok(Vector3::x_axis()) };
        let Some(xyz) = self.numbers::<3>(node, "xyz", owner)? else { return Ok(Vector3::x_axis()) };
        direction(xyz).ok_or_else(|| {
            let attribute = node.attribute_node("xyz").expect("it has just been read");
            self.value_error(
                attribute,
                format!("{owner}: <axis xyz>"),
                "an axis needs a direction".to_owned(),
            )
        })
    }

    fn limits(&mut self, joint: Node<'_, '_>, owner: &str) -> Result<Limits, ModelError> {
        let Some(node) = self.first(joint, "limit", owner) else { return Ok(Limits::NONE) };
        let velocity = self.bound(node, "velocity", owner)?;
        let acceleration = self.bound(node, "acceleration", owner)?;
        let effort = self.bound(node, "effort", owner)?;
        let mut lower = self.number(node, "lower", owner)?.unwrap_or(f64::NEG_INFINITY);
        let mut upper = self.number(node, "upper", owner)?.unwrap_or(f64::INFINITY);
        if joint.attribute("type") == Some("continuous") {
            (lower, upper) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        if lower > upper {
            let attribute = node.attribute_node("lower").expect("a limit above another one is given");
            let remedy = format!("it must not be above upper, which is `{upper}`");
            return Err(self.value_error(attribute, format!("{owner}: <limit lower>"), remedy));
        }
        if lower == 0.0 && upper == 0.0 {
            self.notes.push(format!("{owner}: position limits 0 and 0 are read as none"));
            (lower, upper) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        Ok(Limits { lower, upper, velocity, acceleration, effort })
    }

    /// A limit on a magnitude. Exporters write 0 where they know nothing, and a joint that may not move is none.
    fn bound(&mut self, limit: Node<'_, '_>, name: &str, owner: &str) -> Result<f64, ModelError> {
        let value = self.not_negative(limit, name, owner)?;
        if value == Some(0.0) {
            self.notes.push(format!("{owner}: {name} limit 0 is read as none"));
        }
        Ok(value.filter(|&v| v > 0.0).unwrap_or(f64::INFINITY))
    }

    fn friction(&mut self, joint: Node<'_, '_>, owner: &str) -> Result<JointFriction, ModelError> {
        let Some(node) = self.first(joint, "dynamics", owner) else { return Ok(JointFriction::default()) };
        Ok(JointFriction {
            viscous: self.not_negative(node, "damping", owner)?.unwrap_or(0.0),
            coulomb: self.not_negative(node, "friction", owner)?.unwrap_or(0.0),
        })
    }

    fn inertial(&mut self, node: Node<'_, '_>, owner: &str) -> Result<Inertia, ModelError> {
        let pose = self.origin(node, owner)?;
        let missing = |reader: &Self, what: &str, example: &str| ModelError::Missing {
            at: reader.place(node),
            what: format!("{owner}: {what}"),
            remedy: format!("write {example} inside <inertial>"),
        };
        let mass = match self.first(node, "mass", owner) {
            Some(mass) => self.not_negative(mass, "value", owner)?,
            None => None,
        };
        let mass = mass.ok_or_else(|| missing(self, "<mass value>", "<mass value=\"…\"/>"))?;
        let Some(tensor) = self.first(node, "inertia", owner) else {
            self.notes.push(format!("{owner} has no <inertia>: counted as a point mass"));
            return Ok(Inertia { mass, com: pose.translation.vector, about_com: Matrix3::zeros() });
        };
        let mut diagonal = [0.0; 3];
        for (value, name) in diagonal.iter_mut().zip(["ixx", "iyy", "izz"]) {
            *value = self.number(tensor, name, owner)?.ok_or_else(|| {
                missing(self, &format!("<inertia {name}>"), &format!("{name}=\"…\" in <inertia>"))
            })?;
        }
        let [xx, yy, zz] = diagonal;
        let xy = self.number(tensor, "ixy", owner)?.unwrap_or(0.0);
        let xz = self.number(tensor, "ixz", owner)?.unwrap_or(0.0);
        let yz = self.number(tensor, "iyz", owner)?.unwrap_or(0.0);
        let body = Inertia {
            mass,
            com: Vector3::zeros(),
            about_com: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        };
        if let Some(problem) = body.tensor_problem() {
            return Err(ModelError::Value {
                at: self.place(tensor),
                what: format!("{owner}: <inertia>"),
                value: format!("ixx={xx} iyy={yy} izz={zz} ixy={xy} ixz={xz} iyz={yz}"),
                remedy: problem,
            });
        }
        if body.triangle_excess() > IMPOSSIBLE {
            self.notes.push(format!("{owner}: {NO_REAL_BODY}"));
        }
        Ok(Inertia::zero().joined_with(&body, &pose))
    }

    fn origin(&mut self, node: Node<'_, '_>, owner: &str) -> Result<Isometry3<f64>, ModelError> {
        let Some(node) = self.first(node, "origin", owner) else { return Ok(Isometry3::identity()) };
        let xyz = self.numbers(node, "xyz", owner)?.unwrap_or_default();
        let rpy = self.numbers(node, "rpy", owner)?.unwrap_or_default();
        Ok(pose(xyz, rpy))
    }

    /// Counts the elements that an arm has no use for, apart from looks.
    fn note_unused(&mut self, robot: Node<'_, '_>) {
        let mut counts: Vec<(&str, usize)> = Vec::new();
        for node in robot.children().filter(Node::is_element) {
            let tag = node.tag_name().name();
            if matches!(tag, "link" | "joint" | "material") {
                continue;
            }
            match counts.iter_mut().find(|(known, _)| *known == tag) {
                Some((_, count)) => *count += 1,
                None => counts.push((tag, 1)),
            }
        }
        self.notes.extend(
            counts.into_iter().map(|(tag, count)| format!("<{tag}> is not used (found {count} times)")),
        );
    }
}
