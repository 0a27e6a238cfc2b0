//! URDF as found in the field: XML → links and joints. `urdf_tree` builds the arm from them.

use std::collections::HashMap;

use nalgebra::Isometry3;
use roxmltree::{Document, Node};

use crate::arm_file::{ArmFile, Selection};
use crate::error::{ModelError, shortened};
use crate::numbers::pose;
use crate::prefixes::{Declared, MAX_ATTRIBUTES, crowded_tag, options};
use crate::robot::{Joint, Link, Robot};
use crate::text::check_extent;
use crate::urdf_xml::{Reader, Source, children};
use crate::{mjcf, urdf_tree};
use freeplay_arm::Place;

/// Reads a URDF robot from `text`; `origin` names the text in errors. The arm is the default choice: see [`parse_urdf_selected`].
///
/// # Errors
/// [`ModelError`] with line, column, value and remedy.
pub fn parse_urdf(text: &str, origin: &str) -> Result<ArmFile, ModelError> {
    parse_urdf_selected(text, origin, &Selection::default())
}

/// Reads a URDF robot, or an MJCF model, from `text`; `origin` names the text in errors.
///
/// A robot is a tree, and the arm is one chain of it: see [`Selection`]. All other joints stay fixed, at zero or in the middle of a range
/// without zero, and their links are a load of the link that carries them. The base frame is the root link. The first entry of
/// [`ArmFile::ignored`] describes the choice.
///
/// # Errors
/// [`ModelError`] with line, column, value and remedy.
pub fn parse_urdf_selected(text: &str, origin: &str, selection: &Selection) -> Result<ArmFile, ModelError> {
    check_extent(text, origin)?;
    if let Some(at) = crowded_tag(text) {
        let message = format!("an element with more than {MAX_ATTRIBUTES} attributes; is the file damaged?");
        return Err(ModelError::Syntax { at: Place::in_text(origin, text, at), message });
    }
    let declared = Declared::new(text).map_err(|error| syntax_error(origin, &error))?;
    let source = Source { origin, text, inserted: declared.inserted };
    let document = Document::parse_with_options(&declared.text, options())
        .map_err(|error| syntax_error(origin, &error))?;
    refuse_xacro(&document, &source)?;
    let undeclared =
        declared.prefixes.iter().map(|prefix| format!("the XML prefix `{prefix}` is not declared"));
    let reader = Reader { source, notes: undeclared.collect() };
    if mjcf::is_mjcf(&document) {
        return mjcf::arm(&document, reader, selection);
    }
    urdf_tree::arm(reader.robot(document.root_element())?, selection)
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
                remedy: "a URDF file holds one <robot>, an MJCF file one <mujoco>".to_owned(),
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
            let inertial = self.first(node, "inertial", &format!("link `{name}`"));
            let inertial = inertial.map(|inertial| self.inertial(inertial, &name));
            let has_shape = ["visual", "collision"].iter().any(|tag| children(node, tag).next().is_some());
            links.push(Link { name, inertial, has_shape, at: node.range().start });
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
        let before = self.notes.len();
        let parent = self.link_of(node, "parent", links, &owner)?;
        let child = self.link_of(node, "child", links, &owner)?;
        let motion = self.motion(node, &owner)?;
        let placement = self.origin(node, &owner);
        let details = self.details(node, motion, &owner);
        let (notes, at) = (self.notes.split_off(before), node.range().start);
        Ok(Joint { name, motion, parent, child, placement, details, notes, at })
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

    pub fn origin(&mut self, node: Node<'_, '_>, owner: &str) -> Result<Isometry3<f64>, ModelError> {
        let Some(node) = self.first(node, "origin", owner) else { return Ok(Isometry3::identity()) };
        let xyz = self.numbers(node, "xyz", owner)?.unwrap_or_default();
        let rpy = self.numbers(node, "rpy", owner)?.unwrap_or_default();
        Ok(pose(xyz, rpy))
    }

    /// Counts the elements that an arm does not use, apart from visual ones.
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
