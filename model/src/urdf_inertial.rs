//! `<inertial>` of a link.

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use crate::error::ModelError;
use crate::numbers::{IMPOSSIBLE, NO_REAL_BODY};
use crate::urdf_xml::Reader;
use freeplay_arm::{Inertia, Shortfall};

/// Smallest radius of gyration of a possible inertia, m: the radius of an atom.
const SMALLEST: f64 = 1e-10;

/// The mass of a link.
pub(super) struct Inertial {
    /// In the link frame; without its tensor if that is impossible.
    pub inertia: Inertia,
    /// The reason why the tensor is impossible.
    pub impossible: Option<Shortfall>,
    /// Notes on the mass for the user.
    pub notes: Vec<String>,
}

impl Reader<'_> {
    /// The `<inertial>` in `node` of the link called `name`.
    pub fn inertial(&mut self, node: Node<'_, '_>, name: &str) -> Result<Inertial, ModelError> {
        let before = self.notes.len();
        let owner = format!("link `{name}`");
        let pose = self.origin(node, &owner)?;
        let mass = match self.first(node, "mass", &owner) {
            Some(mass) => self.not_negative(mass, "value", &owner)?,
            None => None,
        };
        let mass = mass.ok_or_else(|| self.lacks(node, &owner, "<mass value>", "<mass value=\"…\"/>"))?;
        let mut impossible = None;
        let inertia = match self.first(node, "inertia", &owner) {
            None => {
                self.notes.push(format!("{owner} has no <inertia>: counted as a point mass"));
                Inertia { mass, com: pose.translation.vector, about_com: Matrix3::zeros() }
            }
            Some(tensor) => {
                let mut body =
                    Inertia { mass, com: Vector3::zeros(), about_com: self.tensor(tensor, &owner)? };
                if body.about_com.amax() < mass * SMALLEST * SMALLEST {
                    body.about_com = Matrix3::zeros();
                }
                impossible = self.impossible(tensor, name, &body);
                if impossible.is_some() {
                    body.about_com = Matrix3::zeros();
                } else if body.triangle_excess() > IMPOSSIBLE {
                    self.notes.push(format!("{owner}: {NO_REAL_BODY}"));
                }
                Inertia::zero().joined_with(&body, &pose)
            }
        };
        Ok(Inertial { inertia, impossible, notes: self.notes.split_off(before) })
    }

    fn lacks(&self, node: Node<'_, '_>, owner: &str, what: &str, example: &str) -> ModelError {
        ModelError::Missing {
            at: self.place(node),
            what: format!("{owner}: {what}"),
            remedy: format!("write {example} inside <inertial>"),
        }
    }

    fn tensor(&self, node: Node<'_, '_>, owner: &str) -> Result<Matrix3<f64>, ModelError> {
        let mut diagonal = [0.0; 3];
        for (value, name) in diagonal.iter_mut().zip(["ixx", "iyy", "izz"]) {
            *value = self.number(node, name, owner)?.ok_or_else(|| {
                self.lacks(node, owner, &format!("<inertia {name}>"), &format!("{name}=\"…\" in <inertia>"))
            })?;
        }
        let [xx, yy, zz] = diagonal;
        let xy = self.number(node, "ixy", owner)?.unwrap_or(0.0);
        let xz = self.number(node, "ixz", owner)?.unwrap_or(0.0);
        let yz = self.number(node, "iyz", owner)?.unwrap_or(0.0);
        Ok(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz))
    }

    /// The reason why the tensor of `body`, the inertia of `link` in `node`, is impossible.
    pub fn impossible(&self, node: Node<'_, '_>, link: &str, body: &Inertia) -> Option<Shortfall> {
        let problem = body.tensor_problem()?;
        let m = &body.about_com;
        let value =
            format!("ixx={} iyy={} izz={} ixy={} ixz={} iyz={}", m.m11, m.m22, m.m33, m.m12, m.m13, m.m23);
        Some(Shortfall::ImpossibleInertia { at: self.place(node), link: link.to_owned(), value, problem })
    }
}
