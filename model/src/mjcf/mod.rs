//! MJCF, the format of MuJoCo, as found in the field → links and joints, from which `urdf_tree` selects the arm.
//!
//! Bodies are links, sites are links without mass, and each joint of a body moves a link of its own. The reader uses those parts of
//! `<default>` classes, `<compiler>`, `<option gravity>`, `<frame>` and actuators that an arm has: masses, placements, limits, friction,
//! armature. For a body without `<inertial>`, the density or mass of its shapes counts. A note says that springs, tendons, equalities
//! between joints other than copies, and contacts are not used.
//!
//! Source: MuJoCo documentation, XML reference.

mod actuators;
mod bodies;
mod defaults;
mod equalities;
mod inertials;
mod joints;
mod pose;
mod shapes;

use nalgebra::Vector3;
use roxmltree::{Document, Node};

use crate::arm_file::{ArmFile, Selection};
use crate::error::{ModelError, shortened};
use crate::robot::{Joint, Link, Robot};
use crate::urdf_tree;
use crate::urdf_xml::{Reader, children};
use defaults::Defaults;
use freeplay_arm::Arm;
use pose::Compiler;

/// MuJoCo's default gravity, m/s².
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// True if the root element of `document` is that of MJCF.
pub(super) fn is_mjcf(document: &Document<'_>) -> bool {
    document.root_element().has_tag_name("mujoco")
}

/// The arm of the MJCF `document` that `selection` names.
///
/// # Errors
/// [`ModelError`] with line, column, value and remedy.
pub(super) fn arm(
    document: &Document<'_>,
    reader: Reader<'_>,
    selection: &Selection,
) -> Result<ArmFile, ModelError> {
    let root = document.root_element();
    let mut model = Model::new(root, reader)?;
    model.refuse_parts_of_other_files(root)?;
    let gravity = model.gravity(root)?;
    model.bodies(root)?;
    model.equalities(root)?;
    model.actuators(root)?;
    model.note_unused(root);
    let Model { reader, links, joints, .. } = model;
    let name = root.attribute("model").unwrap_or("MuJoCo Model").to_owned();
    let robot = Robot { name, links, joints, notes: reader.notes, source: reader.source };
    let mut file = urdf_tree::arm(robot, selection)?;
    file.arm = under(&file.arm, gravity);
    Ok(file)
}

/// `arm` under `gravity`; bit by bit the same if `arm` has this gravity already.
fn under(arm: &Arm, gravity: Vector3<f64>) -> Arm {
    if *arm.gravity() == gravity { arm.clone() } else { arm.with_gravity(gravity) }
}

/// The state of the reader.
struct Model<'r, 'd, 'i> {
    reader: Reader<'r>,
    defaults: Defaults<'d, 'i>,
    compiler: Compiler,
    links: Vec<Link>,
    joints: Vec<Joint>,
}

impl<'r, 'd, 'i> Model<'r, 'd, 'i> {
    fn new(root: Node<'d, 'i>, mut reader: Reader<'r>) -> Result<Self, ModelError> {
        let defaults = Defaults::of(root);
        let compiler = Compiler::of(root, &mut reader)?;
        Ok(Model { reader, defaults, compiler, links: Vec::new(), joints: Vec::new() })
    }

    /// Refuses a file with bodies in other files.
    fn refuse_parts_of_other_files(&self, root: Node<'_, '_>) -> Result<(), ModelError> {
        let part =
            root.descendants().find(|node| node.has_tag_name("include") || node.has_tag_name("attach"));
        let Some(part) = part else { return Ok(()) };
        let named = part.attribute("file").or(part.attribute("model")).unwrap_or_default();
        Err(ModelError::Value {
            at: self.reader.place(part),
            what: format!("<{}>", part.tag_name().name()),
            value: shortened(named),
            remedy: "name that file itself, or write one file of all with mujoco.mj_saveLastXML".to_owned(),
        })
    }

    fn gravity(&self, root: Node<'_, '_>) -> Result<Vector3<f64>, ModelError> {
        let mut gravity = GRAVITY;
        for option in children(root, "option") {
            gravity = self.reader.numbers(option, "gravity", "the file")?.unwrap_or(gravity);
        }
        Ok(gravity.into())
    }

    /// Counts the parts of a file that an arm does not use.
    fn note_unused(&mut self, root: Node<'_, '_>) {
        for (section, what) in [("tendon", "<tendon>"), ("equality", "<equality>"), ("contact", "<contact>")]
        {
            let count: usize = children(root, section)
                .flat_map(|section| section.children().filter(Node::is_element))
                .filter(|node| !(section == "equality" && node.has_tag_name("joint")))
                .count();
            if count > 0 {
                self.reader.notes.push(format!("{what} is not used (found {count} times)"));
            }
        }
    }
}
