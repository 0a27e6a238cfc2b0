//! `<geom>`: the inertia of shapes of uniform density.
//!
//! Source: the moments of solids by integration, as in any handbook; a capsule is a cylinder with two hemispheres.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Matrix3, Translation3, Vector3};
use roxmltree::Node;

use super::Model;
use super::pose::from_z;
use crate::error::ModelError;
use crate::numbers::{direction, parse_number};
use crate::urdf_xml::children;
use freeplay_arm::Inertia;

/// Default density of shapes, kg/m³.
const DENSITY: f64 = 1000.0;

/// A shape about its own centre.
struct Solid {
    /// m³.
    volume: f64,
    /// Moments per mass, m².
    moments: Vector3<f64>,
}

impl Solid {
    /// The solid of this `kind` with these sizes; `None` for a kind without an inertia here, such as a mesh.
    fn of(kind: &str, size: &[f64]) -> Option<Solid> {
        let (volume, moments) = match (kind, size) {
            ("sphere", [r, ..]) => (4.0 / 3.0 * PI * r.powi(3), Vector3::repeat(0.4 * r * r)),
            ("box", [x, y, z, ..]) => {
                let squares = Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y);
                (8.0 * x * y * z, squares / 3.0)
            }
            ("ellipsoid", [x, y, z, ..]) => {
                let squares = Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y);
                (4.0 / 3.0 * PI * x * y * z, squares / 5.0)
            }
            ("cylinder", [r, half, ..]) => {
                let across = 0.25 * r * r + half * half / 3.0;
                (2.0 * PI * r * r * half, Vector3::new(across, across, 0.5 * r * r))
            }
            ("capsule", [r, half, ..]) => return Some(capsule(*r, *half)),
            _ => return None,
        };
        Some(Solid { volume, moments })
    }
}

fn capsule(r: f64, half: f64) -> Solid {
    let (rod, balls) = (2.0 * PI * r * r * half, 4.0 / 3.0 * PI * r.powi(3));
    let volume = rod + balls;
    // The centre of a hemisphere is 3r/8 from its plane; both hemispheres together are a sphere about that plane.
    let of_balls = 0.4 * r * r + half * half + 0.75 * half * r;
    let across = rod * (0.25 * r * r + half * half / 3.0) + balls * of_balls;
    let along = rod * 0.5 * r * r + balls * 0.4 * r * r;
    Solid { volume, moments: Vector3::new(across, across, along) / volume }
}

impl<'d, 'i> Model<'_, 'd, 'i> {
    /// The inertia of all shapes of the body `node` called `name`; `None` if no shape counts.
    pub(super) fn shapes(
        &mut self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        name: &str,
    ) -> Result<Option<Inertia>, ModelError> {
        let owner = format!("body `{name}`: a geom");
        let mut sum: Option<Inertia> = None;
        let mut open: Vec<(Node<'d, 'i>, Isometry3<f64>)> = vec![(node, Isometry3::identity())];
        let mut unknown = 0;
        while let Some((around, frame)) = open.pop() {
            for inner in children(around, "frame") {
                open.push((inner, frame * self.compiler.pose(&self.reader, inner, &owner)?));
            }
            for geom in children(around, "geom") {
                match self.shape(geom, childclass, &owner)? {
                    Some((inertia, pose)) => {
                        let before = sum.unwrap_or_else(Inertia::zero);
                        sum = Some(before.joined_with(&inertia, &(frame * pose)));
                    }
                    None => {
                        unknown +=
                            usize::from(self.geom_number(geom, childclass, "mass", &owner)? != Some(0.0))
                    }
                }
            }
        }
        if unknown > 0 {
            self.reader.notes.push(format!(
                "body `{name}` has no <inertial>, and {unknown} of its shapes, such as meshes, contribute no mass; write an <inertial> with mujoco.mj_saveLastXML"
            ));
        }
        Ok(sum)
    }

    fn geom_number(
        &self,
        geom: Node<'d, 'i>,
        childclass: Option<&'d str>,
        name: &str,
        owner: &str,
    ) -> Result<Option<f64>, ModelError> {
        self.one(geom, childclass, name, owner)
    }

    /// The inertia of one shape in its frame, and that frame in its body.
    fn shape(
        &self,
        geom: Node<'d, 'i>,
        childclass: Option<&'d str>,
        owner: &str,
    ) -> Result<Option<(Inertia, Isometry3<f64>)>, ModelError> {
        let kind = match self.defaults.attribute(geom, childclass, "type") {
            Some(kind) => kind.value(),
            None if self.defaults.attribute(geom, childclass, "mesh").is_some() => "mesh",
            None => "sphere",
        };
        let mut size = self.sizes(geom, childclass, owner)?;
        let pose = match self.defaults.holder(geom, childclass, "fromto") {
            Some(said) => {
                let [ax, ay, az, bx, by, bz] =
                    self.reader.numbers(said, "fromto", owner)?.unwrap_or_default();
                let (a, b) = (Vector3::new(ax, ay, az), Vector3::new(bx, by, bz));
                // MuJoCo's z points from the second end to the first; the shape is symmetric.
                let half = 0.5 * (a - b).norm();
                match kind {
                    "box" | "ellipsoid" if !size.is_empty() => size = vec![size[0], size[0], half],
                    _ => size.insert(size.len().min(1), half),
                }
                let turn = direction((a - b).into()).map(|z| from_z(&z)).unwrap_or_default();
                Isometry3::from_parts(Translation3::from(0.5 * (a + b)), turn)
            }
            None => self.compiler.pose(&self.reader, geom, owner)?,
        };
        let Some(solid) = Solid::of(kind, &size) else { return Ok(None) };
        let density = self.geom_number(geom, childclass, "density", owner)?.unwrap_or(DENSITY);
        let mass = self.geom_number(geom, childclass, "mass", owner)?.unwrap_or(density * solid.volume);
        let about_com = Matrix3::from_diagonal(&(solid.moments * mass));
        Ok(Some((Inertia { mass, com: Vector3::zeros(), about_com }, pose)))
    }

    fn sizes(
        &self,
        geom: Node<'d, 'i>,
        childclass: Option<&'d str>,
        owner: &str,
    ) -> Result<Vec<f64>, ModelError> {
        let Some(attribute) = self.defaults.attribute(geom, childclass, "size") else {
            return Ok(Vec::new());
        };
        let number = |word: &str| {
            parse_number(word)
                .map_err(|remedy| self.reader.value_error(attribute, format!("{owner}: size"), remedy))
        };
        attribute.value().split_whitespace().map(number).collect()
    }
}
