//! `<compiler>`, and the positions and orientations that depend on it.

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::Node;

use crate::error::{ModelError, shortened};
use crate::numbers::direction;
use crate::urdf_xml::{Reader, children};

/// The units and conventions of the numbers in a file, from its `<compiler>`.
pub(super) struct Compiler {
    /// One unit of an angle, rad.
    pub angle: f64,
    /// Axes of Euler angles in their order; capitals mean fixed axes.
    euler: String,
    /// True if a range alone makes a limit.
    pub autolimits: bool,
    /// Use of shapes instead of an `<inertial>`: always (`true`), never (`false`), or if there is none (`None`).
    pub inertia_from_shapes: Option<bool>,
}

impl Compiler {
    /// The compiler settings of the file with this root element; later elements override earlier ones.
    pub fn of(root: Node<'_, '_>, reader: &mut Reader<'_>) -> Result<Compiler, ModelError> {
        let last = |name: &str| {
            children(root, "compiler").filter_map(|compiler| compiler.attribute_node(name)).last()
        };
        if let Some(coordinate) = last("coordinate").filter(|coordinate| coordinate.value() == "global") {
            let remedy = "write the model anew with coordinate=\"local\"".to_owned();
            return Err(reader.value_error(coordinate, "<compiler coordinate>".to_owned(), remedy));
        }
        let euler = last("eulerseq").map_or("xyz", |sequence| sequence.value());
        if let Some(attribute) =
            last("eulerseq").filter(|_| euler.len() != 3 || !euler.chars().all(|c| "xyzXYZ".contains(c)))
        {
            let remedy = "write three of x, y, z, X, Y, Z".to_owned();
            return Err(reader.value_error(attribute, "<compiler eulerseq>".to_owned(), remedy));
        }
        for name in ["settotalmass", "balanceinertia", "boundmass", "boundinertia"] {
            if last(name).is_some_and(|attribute| !["false", "0", "-1"].contains(&attribute.value())) {
                reader
                    .notes
                    .push(format!("<compiler {name}> is not used: masses and inertias are as they stand"));
            }
        }
        let from_shapes = last("inertiafromgeom").map(|attribute| attribute.value());
        Ok(Compiler {
            angle: if last("angle").is_some_and(|angle| angle.value() == "radian") {
                1.0
            } else {
                1.0_f64.to_radians()
            },
            euler: euler.to_owned(),
            autolimits: last("autolimits").is_none_or(|autolimits| autolimits.value() != "false"),
            inertia_from_shapes: from_shapes.and_then(|word| word.parse().ok()),
        })
    }

    /// The pose that `node` gives by `pos` and one of the attributes for an orientation.
    pub fn pose(
        &self,
        reader: &Reader<'_>,
        node: Node<'_, '_>,
        owner: &str,
    ) -> Result<Isometry3<f64>, ModelError> {
        let position: [f64; 3] = reader.numbers(node, "pos", owner)?.unwrap_or_default();
        let turn = self.turn(reader, node, owner)?;
        Ok(Isometry3::from_parts(Translation3::from(Vector3::from(position)), turn))
    }

    fn turn(
        &self,
        reader: &Reader<'_>,
        node: Node<'_, '_>,
        owner: &str,
    ) -> Result<UnitQuaternion<f64>, ModelError> {
        let unusable = |name: &str, remedy: &str| {
            let at = reader.place(node);
            let value = shortened(node.attribute(name).unwrap_or_default());
            ModelError::Value { at, what: format!("{owner}: {name}"), value, remedy: remedy.to_owned() }
        };
        if let Some([w, x, y, z]) = reader.numbers(node, "quat", owner)? {
            let quaternion = Quaternion::new(w, x, y, z);
            let norm = quaternion.norm();
            return match norm > 0.0 && norm.is_finite() {
                // A quaternion written with all its digits stays unchanged.
                true if (norm - 1.0).abs() < 1e-15 => Ok(UnitQuaternion::new_unchecked(quaternion)),
                true => Ok(UnitQuaternion::new_normalize(quaternion)),
                false => Err(unusable("quat", "write four numbers that are not all zero")),
            };
        }
        if let Some([x, y, z, angle]) = reader.numbers(node, "axisangle", owner)? {
            let axis =
                direction([x, y, z]).ok_or_else(|| unusable("axisangle", "an axis needs a direction"))?;
            return Ok(UnitQuaternion::from_axis_angle(&axis, angle * self.angle));
        }
        if let Some(angles) = reader.numbers::<3>(node, "euler", owner)? {
            return Ok(self.euler_turn(angles));
        }
        if let Some([ax, ay, az, bx, by, bz]) = reader.numbers(node, "xyaxes", owner)? {
            let (x, y) = (Vector3::new(ax, ay, az), Vector3::new(bx, by, bz));
            return axes(x, y).ok_or_else(|| unusable("xyaxes", "the two axes must not be parallel"));
        }
        if let Some(z) = reader.numbers::<3>(node, "zaxis", owner)? {
            let z = direction(z).ok_or_else(|| unusable("zaxis", "an axis needs a direction"))?;
            return Ok(from_z(&z));
        }
        Ok(UnitQuaternion::identity())
    }

    fn euler_turn(&self, angles: [f64; 3]) -> UnitQuaternion<f64> {
        let mut turn = UnitQuaternion::identity();
        for (letter, angle) in self.euler.chars().zip(angles) {
            let axis = match letter.to_ascii_lowercase() {
                'x' => Vector3::x_axis(),
                'y' => Vector3::y_axis(),
                _ => Vector3::z_axis(),
            };
            let step = UnitQuaternion::from_axis_angle(&axis, angle * self.angle);
            turn = if letter.is_ascii_lowercase() { turn * step } else { step * turn };
        }
        turn
    }
}

/// The frame whose x axis is along `x` and whose y axis is `y` made orthogonal to it.
fn axes(x: Vector3<f64>, y: Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let x = x.try_normalize(0.0)?;
    let y = (y - x * x.dot(&y)).try_normalize(1e-12)?;
    let matrix = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix)))
}

/// The smallest rotation that turns z to `z`.
pub(super) fn from_z(z: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between_axis(&Vector3::z_axis(), z)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
}
