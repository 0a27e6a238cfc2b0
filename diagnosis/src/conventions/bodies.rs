//! Joint torques by body: the contribution of each link, and of a load at the tool, to the torque of every joint, split into a part due to motion and a part
//! due to each component of gravity (Newton–Euler in world axes, Featherstone 2008, §5.3; all parts are linear in masses and in gravity).

use freeplay_arm::{Arm, Inertia, JointKind};
use nalgebra::{Matrix3, Unit, UnitQuaternion, Vector3};

/// Inertial parameters of a link, in which torques are linear: mass, three first moments and six numbers of inertia (Atkeson, An & Hollerbach 1986).
pub(super) const PARAMETERS: usize = 10;

/// An inertia with 1 kg·m² in element `number` of xx, yy, zz, xy, xz, yz.
fn unit_inertia(number: usize) -> Matrix3<f64> {
    let (i, k) = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)][number];
    let mut unit = Matrix3::zeros();
    (unit[(i, k)], unit[(k, i)]) = (1.0, 1.0);
    unit
}

/// A torque as the part due to motion, N·m (N), and the parts due to gravity per m/s² along each axis of the base.
#[derive(Clone, Copy, Default)]
pub(super) struct Parts {
    pub inertial: f64,
    pub gravity: [f64; 3],
}

/// Pose and motion of a link; world axes.
#[derive(Clone)]
struct Link {
    kind: JointKind,
    rotation: Matrix3<f64>,
    place: Vector3<f64>,
    axis: Vector3<f64>,
    /// Angular velocity and acceleration, and acceleration of the origin.
    omega: Vector3<f64>,
    alpha: Vector3<f64>,
    linear: Vector3<f64>,
}

/// Inertial forces of a body about the origin of its link, and its gravity load: mass, and first moment about that origin.
struct Needs {
    force: Vector3<f64>,
    moment: Vector3<f64>,
    mass: f64,
    first: Vector3<f64>,
}

/// The links of an arm in one posture and motion.
pub(super) struct Bodies<'a> {
    arm: &'a Arm,
    links: Vec<Link>,
}

impl<'a> Bodies<'a> {
    /// The links in the posture `q` with the velocities `v` and accelerations `a`, one element a joint.
    pub fn new(
        arm: &'a Arm,
        q: impl Fn(usize) -> f64,
        v: impl Fn(usize) -> f64,
        a: impl Fn(usize) -> f64,
    ) -> Self {
        let still = Vector3::zeros();
        let mut last = Link {
            kind: JointKind::Revolute,
            rotation: Matrix3::identity(),
            place: still,
            axis: still,
            omega: still,
            alpha: still,
            linear: still,
        };
        let mut links = Vec::with_capacity(arm.dof());
        for (k, joint) in arm.joints().iter().enumerate() {
            let placed = last.rotation * joint.placement.rotation.to_rotation_matrix().matrix();
            let axis = placed * joint.axis.into_inner();
            let slide = if joint.kind == JointKind::Prismatic { axis * q(k) } else { still };
            let lever = last.rotation * joint.placement.translation.vector + slide;
            let carried =
                last.linear + last.alpha.cross(&lever) + last.omega.cross(&last.omega.cross(&lever));
            let link = match joint.kind {
                JointKind::Revolute => {
                    let turn = UnitQuaternion::from_axis_angle(&Unit::new_unchecked(*joint.axis), q(k));
                    Link {
                        kind: joint.kind,
                        rotation: placed * turn.to_rotation_matrix().matrix(),
                        place: last.place + lever,
                        axis,
                        omega: last.omega + axis * v(k),
                        alpha: last.alpha + axis * a(k) + last.omega.cross(&axis) * v(k),
                        linear: carried,
                    }
                }
                JointKind::Prismatic => Link {
                    kind: joint.kind,
                    rotation: placed,
                    place: last.place + lever,
                    axis,
                    omega: last.omega,
                    alpha: last.alpha,
                    linear: carried + axis * a(k) + last.omega.cross(&axis) * (2.0 * v(k)),
                },
            };
            last = link.clone();
            links.push(link);
        }
        Self { arm, links }
    }

    /// Position of the tool, m.
    pub fn tool(&self) -> Vector3<f64> {
        let Some(last) = self.links.last() else { return Vector3::zeros() };
        last.place + last.rotation * self.arm.tool().translation.vector
    }

    /// The contribution of link `body` to the torque of each joint. The function calls `add(joint, parts)` for the joints that carry the link.
    pub fn link(&self, body: usize, add: impl FnMut(usize, Parts)) {
        self.torques(body, &self.links[body].needs(&self.arm.joints()[body].inertia), add);
    }

    /// The contribution of a load on the last link: 1 kg at the tool, then 1 kg·m of first moment along each axis of that link.
    pub fn load(&self, number: usize, add: impl FnMut(usize, Parts)) {
        let Some(last) = self.links.last() else { return };
        let needs = match number {
            0 => {
                let com = self.arm.tool().translation.vector;
                last.needs(&Inertia { mass: 1.0, com, about_com: Matrix3::zeros() })
            }
            axis => last.needs_of_moment(last.rotation.column(axis - 1).into_owned()),
        };
        self.torques(self.links.len() - 1, &needs, add);
    }

    /// The contribution of inertial parameter `number` of link `body`: 1 kg at its origin, 1 kg·m of first moment along each of its axes, 1 kg·m² of inertia
    /// about its origin (xx, yy, zz, xy, xz, yz).
    pub fn parameter(&self, body: usize, number: usize, add: impl FnMut(usize, Parts)) {
        let link = &self.links[body];
        let needs = match number {
            0 => Needs { force: link.linear, moment: Vector3::zeros(), mass: 1.0, first: Vector3::zeros() },
            1..=3 => link.needs_of_moment(link.rotation.column(number - 1).into_owned()),
            _ => link.needs_of_inertia(&unit_inertia(number - 4)),
        };
        self.torques(body, &needs, add);
    }

    fn torques(&self, body: usize, needs: &Needs, mut add: impl FnMut(usize, Parts)) {
        let place = self.links[body].place;
        for (joint, link) in self.links[..=body].iter().enumerate() {
            let lever = place - link.place;
            let (inertial, pulled) = match link.kind {
                JointKind::Revolute => (
                    link.axis.dot(&(needs.moment + lever.cross(&needs.force))),
                    link.axis.cross(&(needs.first + lever * needs.mass)),
                ),
                JointKind::Prismatic => (link.axis.dot(&needs.force), link.axis * needs.mass),
            };
            add(joint, Parts { inertial, gravity: [-pulled.x, -pulled.y, -pulled.z] });
        }
    }
}

impl Link {
    fn needs(&self, inertia: &Inertia) -> Needs {
        let first = self.rotation * (inertia.com * inertia.mass);
        let of_moment = self.needs_of_moment(first);
        let spin = self.needs_of_inertia(&inertia.about_com).moment;
        let com = self.rotation * inertia.com;
        Needs {
            force: of_moment.force + self.linear * inertia.mass,
            // The acceleration of the first moment itself, and the rotation about the centre of mass.
            moment: of_moment.moment + com.cross(&of_moment.force) + spin,
            mass: inertia.mass,
            first,
        }
    }

    /// Inertial forces of an inertia without mass, in the link's axes.
    fn needs_of_inertia(&self, inertia: &Matrix3<f64>) -> Needs {
        let omega = self.rotation.tr_mul(&self.omega);
        let spin = inertia * self.rotation.tr_mul(&self.alpha) + omega.cross(&(inertia * omega));
        Needs { force: Vector3::zeros(), moment: self.rotation * spin, mass: 0.0, first: Vector3::zeros() }
    }

    /// Inertial forces of a first moment `first` without mass.
    fn needs_of_moment(&self, first: Vector3<f64>) -> Needs {
        Needs {
            force: self.alpha.cross(&first) + self.omega.cross(&self.omega.cross(&first)),
            moment: first.cross(&self.linear),
            mass: 0.0,
            first,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use freeplay_arm::{Workspace, rnea};
    use freeplay_model::paper_arm;
    use nalgebra::{Matrix3, Vector3};

    use super::{Bodies, Parts};

    /// The bodies' torques add up to those of the recursive algorithm, and a load to those of an arm with this load.
    #[test]
    fn bodies_add_up_to_the_arm() {
        let standing = paper_arm().arm;
        let gravity = Vector3::new(1.0, -2.0, -9.0);
        let arm = standing.with_gravity(gravity);
        let n = arm.dof();
        let at = |by: f64| (0..n).map(|k| (by + 1.7 * k as f64).sin()).collect::<Vec<f64>>();
        let (q, v, a) = (at(0.3), at(1.1), at(2.9));
        let bodies = Bodies::new(&arm, |k| q[k], |k| v[k], |k| a[k]);
        let whole = |parts: &Parts| {
            parts.inertial + parts.gravity.iter().zip(gravity.iter()).map(|(x, g)| x * g).sum::<f64>()
        };
        let mut sum: Vec<f64> =
            arm.joints().iter().zip(&a).map(|(joint, a)| joint.rotor_inertia * a).collect();
        (0..n).for_each(|body| bodies.link(body, |joint, parts| sum[joint] += whole(&parts)));
        let (mut ws, mut expected) = (Workspace::new(&arm), vec![0.0; n]);
        rnea(&arm, &mut ws, &q, &v, &a, &mut expected);
        let size = expected.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        for (sum, expected) in sum.iter().zip(&expected) {
            println!("{sum} {expected}");
            assert!((sum - expected).abs() < 1e-12 * size);
        }

        let mut joints = arm.joints().to_vec();
        let (mass, com) = (2.0, Vector3::new(0.1, -0.2, 0.05));
        let load = freeplay_arm::Inertia {
            mass,
            com: arm.tool().translation.vector,
            about_com: nalgebra::Matrix3::zeros(),
        };
        joints[n - 1].inertia = joints[n - 1].inertia.joined_with(&load, &nalgebra::Isometry3::identity());
        let loaded = freeplay_arm::Arm::new("loaded", joints, *arm.tool(), gravity).unwrap();
        rnea(&loaded, &mut ws, &q, &v, &a, &mut expected);
        bodies.load(0, |joint, parts| sum[joint] += mass * whole(&parts));
        for (sum, expected) in sum.iter().zip(&expected) {
            assert!((sum - expected).abs() < 1e-12 * size);
        }
        // The ten parameters of each link, with the inertia about its origin, describe the link fully.
        let mut by_parameter: Vec<f64> =
            arm.joints().iter().zip(&a).map(|(joint, a)| joint.rotor_inertia * a).collect();
        for (body, joint) in arm.joints().iter().enumerate() {
            let inertia = &joint.inertia;
            let (c, m) = (inertia.com, inertia.mass);
            let about = inertia.about_com + (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * m;
            let first = c * m;
            let six = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|place| about[place]);
            let values = [m, first.x, first.y, first.z].into_iter().chain(six);
            for (number, value) in values.enumerate() {
                bodies.parameter(body, number, |joint, parts| by_parameter[joint] += value * whole(&parts));
            }
        }
        rnea(&arm, &mut ws, &q, &v, &a, &mut expected);
        for (sum, expected) in by_parameter.iter().zip(&expected) {
            assert!((sum - expected).abs() < 1e-11 * size, "{sum} is not {expected}");
        }
        // A first moment is linear: those along the three axes add up to that along their sum, with gravity acting on it as on a lever.
        let mut held = vec![0.0; n];
        (1..=3).for_each(|axis| {
            bodies.load(axis, |joint, parts| held[joint] += com[axis - 1] * parts.gravity[2])
        });
        assert!(held.iter().any(|x| x.abs() > 1e-3));
    }
}
