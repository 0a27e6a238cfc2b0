//! The inertia of a body: `<inertial>`, else its shapes.

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use super::Model;
use crate::error::ModelError;
use crate::numbers::{IMPOSSIBLE, NO_REAL_BODY};
use crate::urdf_inertial::Inertial;
use crate::urdf_xml::children;
use freeplay_arm::Inertia;

impl<'d, 'i> Model<'_, 'd, 'i> {
    /// The inertia of the body `node` called `name`; `None` if it has neither an `<inertial>` nor a shape that counts.
    pub(super) fn body_inertial(
        &mut self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        name: &str,
    ) -> Result<Option<Inertial>, ModelError> {
        let said =
            children(node, "inertial").next().filter(|_| self.compiler.inertia_from_shapes != Some(true));
        if let Some(said) = said {
            return self.said_inertial(said, name).map(Some);
        }
        if self.compiler.inertia_from_shapes == Some(false) {
            return Ok(None);
        }
        let before = self.reader.notes.len();
        let inertia = self.shapes(node, childclass, name)?;
        let notes = self.reader.notes.split_off(before);
        Ok(inertia.map(|inertia| Inertial { inertia, impossible: None, notes }))
    }

    fn said_inertial(&mut self, node: Node<'d, 'i>, name: &str) -> Result<Inertial, ModelError> {
        let owner = format!("body `{name}`");
        let pose = self.compiler.pose(&self.reader, node, &owner)?;
        let missing = |what: &str, example: &str| ModelError::Missing {
            at: self.reader.place(node),
            what: format!("{owner}: <inertial {what}>"),
            remedy: format!("write {example}"),
        };
        let mass = self.reader.not_negative(node, "mass", &owner)?;
        let mass = mass.ok_or_else(|| missing("mass", "mass=\"…\" in <inertial>"))?;
        let tensor = match self.reader.numbers::<3>(node, "diaginertia", &owner)? {
            Some(moments) => Matrix3::from_diagonal(&Vector3::from(moments)),
            None => {
                let full = self.reader.numbers(node, "fullinertia", &owner)?;
                let [xx, yy, zz, xy, xz, yz] =
                    full.ok_or_else(|| missing("diaginertia", "diaginertia or fullinertia in <inertial>"))?;
                Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
            }
        };
        let mut body = Inertia { mass, com: Vector3::zeros(), about_com: tensor };
        let impossible = self.reader.impossible(node, name, &body);
        let mut notes = Vec::new();
        if impossible.is_some() {
            body.about_com = Matrix3::zeros();
        } else if body.triangle_excess() > IMPOSSIBLE {
            notes.push(format!("{owner}: {NO_REAL_BODY}"));
        }
        Ok(Inertial { inertia: Inertia::zero().joined_with(&body, &pose), impossible, notes })
    }
}
