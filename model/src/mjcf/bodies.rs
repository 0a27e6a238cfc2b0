//! `<worldbody>`: bodies, frames and sites as links with joints between them.

use nalgebra::{Isometry3, Translation3, Vector3};
use roxmltree::Node;

use super::Model;
use crate::error::ModelError;
use crate::robot::{Joint, Link};
use crate::urdf_joint::{Details, Motion};
use crate::urdf_xml::children;

/// Pending elements of a body or a frame.
struct Inside<'d, 'i> {
    node: Node<'d, 'i>,
    /// The link to which they are fixed, and the pose of their frame in its frame.
    link: usize,
    pose: Isometry3<f64>,
    childclass: Option<&'d str>,
}

impl<'d, 'i> Model<'_, 'd, 'i> {
    /// Reads all bodies.
    pub(super) fn bodies(&mut self, root: Node<'d, 'i>) -> Result<(), ModelError> {
        let world = self.link("world", root);
        let inside = |node: Node<'d, 'i>| Inside {
            node,
            link: world,
            pose: Isometry3::identity(),
            childclass: node.attribute("childclass"),
        };
        let mut open: Vec<Inside<'d, 'i>> = children(root, "worldbody").map(inside).collect();
        open.reverse();
        while let Some(inside) = open.pop() {
            let mut found = self.contents(&inside)?;
            // The stack returns the last element first.
            found.reverse();
            open.append(&mut found);
        }
        Ok(())
    }

    /// Adds a link without mass.
    fn link(&mut self, name: &str, node: Node<'_, '_>) -> usize {
        let (name, at) = (name.to_owned(), node.range().start);
        self.links.push(Link { name, inertial: None, has_shape: false, at });
        self.links.len() - 1
    }

    /// Reads the sites and bodies in `inside`; returns their contents, which are still pending.
    fn contents(&mut self, inside: &Inside<'d, 'i>) -> Result<Vec<Inside<'d, 'i>>, ModelError> {
        let mut found = Vec::new();
        for node in inside.node.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "body" => found.push(self.body(node, inside)?),
                "frame" => {
                    let pose = self.compiler.pose(&self.reader, node, "a <frame>")?;
                    let childclass = node.attribute("childclass").or(inside.childclass);
                    found.push(Inside { node, link: inside.link, pose: inside.pose * pose, childclass });
                }
                "site" => self.site(node, inside)?,
                "replicate" | "composite" | "flexcomp" => {
                    let tag = node.tag_name().name();
                    self.reader.notes.push(format!("<{tag}> is not used"));
                }
                _ => {}
            }
        }
        Ok(found)
    }

    fn site(&mut self, node: Node<'d, 'i>, inside: &Inside<'d, 'i>) -> Result<(), ModelError> {
        let Some(name) = node.attribute("name") else { return Ok(()) };
        let pose = self.compiler.pose(&self.reader, node, &format!("site `{name}`"))?;
        let child = self.link(name, node);
        self.fix(node, &format!("site {name}"), [inside.link, child], inside.pose * pose);
        Ok(())
    }

    /// Adds a fixed joint between two links.
    fn fix(&mut self, node: Node<'_, '_>, name: &str, [parent, child]: [usize; 2], pose: Isometry3<f64>) {
        self.joints.push(Joint {
            name: name.to_owned(),
            motion: Motion::Fixed,
            parent,
            child,
            placement: Ok(pose),
            details: Ok(Details::none()),
            notes: Vec::new(),
            at: node.range().start,
        });
    }

    /// Adds the links and joints of the body `node`, and returns its contents.
    fn body(&mut self, node: Node<'d, 'i>, around: &Inside<'d, 'i>) -> Result<Inside<'d, 'i>, ModelError> {
        let name = node.attribute("name").map_or_else(|| format!("body_{}", self.links.len()), str::to_owned);
        let owner = format!("body `{name}`");
        let childclass = node.attribute("childclass").or(around.childclass);
        let pose = self.compiler.pose(&self.reader, node, &owner)?;
        let mut link = around.link;
        let mut frame = around.pose * pose;
        let joints: Vec<Node<'d, 'i>> = node
            .children()
            .filter(|child| child.has_tag_name("joint") || child.has_tag_name("freejoint"))
            .collect();
        for joint in &joints {
            let anchor = self.anchor(*joint, childclass, &owner)?;
            let child = self.link(&format!("{name} behind a joint"), node);
            let placement = frame * Isometry3::from(Translation3::from(anchor));
            self.joint(*joint, childclass, [link, child], placement)?;
            link = child;
            frame = Isometry3::from(Translation3::from(-anchor));
        }
        // The link behind the last joint is the body itself if both frames are the same.
        if joints.is_empty() || frame != Isometry3::identity() {
            let child = self.link(&name, node);
            self.fix(node, &name, [link, child], frame);
            (link, frame) = (child, Isometry3::identity());
        } else {
            self.links[link].name.clone_from(&name);
        }
        self.links[link].has_shape = children(node, "geom").next().is_some();
        self.links[link].inertial = self.body_inertial(node, childclass, &name).transpose();
        Ok(Inside { node, link, pose: frame, childclass })
    }

    /// The position of a joint in its body.
    fn anchor(
        &self,
        joint: Node<'d, 'i>,
        childclass: Option<&'d str>,
        owner: &str,
    ) -> Result<Vector3<f64>, ModelError> {
        let Some(said) = self.defaults.holder(joint, childclass, "pos") else { return Ok(Vector3::zeros()) };
        let at: [f64; 3] = self.reader.numbers(said, "pos", owner)?.unwrap_or_default();
        Ok(at.into())
    }
}
