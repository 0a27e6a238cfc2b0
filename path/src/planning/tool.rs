//! The tool's path in the base frame, in closed form, with its first two derivatives.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::planning::laps::{Laps, Phase, SNAP};
use crate::planning::shape::{Point, Shape};
use crate::planning::spline::Spline;
use crate::spec::{PathKind, PathSpec};

/// The reference of the tool at one instant, in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolSample {
    /// Pose of frame `tool0`, m.
    pub pose: Isometry3<f64>,
    /// Velocity of the tool point (m/s) over angular velocity (rad/s).
    pub velocity: Vector6<f64>,
    /// Acceleration of the tool point (m/s²) over angular acceleration (rad/s²).
    pub acceleration: Vector6<f64>,
}

/// A Cartesian path: position and orientation of the tool over time.
///
/// It consists of smooth pieces; where two of them meet the acceleration may jump.
#[derive(Clone, Debug)]
pub struct ToolPath {
    curve: Curve,
    rotation: UnitQuaternion<f64>,
    /// Ends of the pieces within a lap, from 0 to the time of a lap, s.
    breaks: Vec<f64>,
    laps: Laps,
}

#[derive(Clone, Debug)]
enum Curve {
    Shape(Shape),
    /// Columns x, y, z of a file.
    Positions(Spline),
    /// Columns x, y, z, qx, qy, qz, qw of a file.
    Poses(Spline),
}

impl ToolPath {
    /// The path of a built-in Cartesian kind; `None` for other kinds (`file`, `joint_sine`).
    ///
    /// `spec` should have passed [`PathSpec::validate`]; with other numbers the samples may not be finite.
    pub fn of(spec: &PathSpec) -> Option<ToolPath> {
        let centre = Vector3::from(spec.centre);
        let shape = match spec.kind {
            PathKind::Lissajous => Shape::Lissajous { centre, amplitudes: Vector3::from(spec.amplitudes()) },
            PathKind::Circle => Shape::Circle { centre, radius: spec.reach() },
            PathKind::Square | PathKind::SquareSharp => {
                Shape::Square { centre, half_side: spec.reach(), blend: spec.blend_or_default() }
            }
            PathKind::File | PathKind::JointSine => return None,
        };
        Some(ToolPath {
            breaks: shape.breaks(spec.period),
            curve: Curve::Shape(shape),
            rotation: rotation(spec),
            laps: Laps { lap: spec.period, count: spec.laps },
        })
    }

    /// The path through rows of a file: columns x, y, z, and qx, qy, qz, qw if `oriented`. The rows contain all laps.
    pub(crate) fn through(spline: Spline, oriented: bool, spec: &PathSpec) -> ToolPath {
        let breaks = spline.times().to_vec();
        let lap = *breaks.last().expect("a spline has knots");
        let curve = if oriented { Curve::Poses(spline) } else { Curve::Positions(spline) };
        ToolPath { curve, rotation: rotation(spec), breaks, laps: Laps { lap, count: 1 } }
    }

    /// Time of the whole motion, s.
    pub fn duration(&self) -> f64 {
        self.laps.duration()
    }

    /// The tool at time `t` in s: at a kink the limit from the right; outside the motion its end points, at rest.
    pub fn at(&self, t: f64) -> ToolSample {
        match self.laps.phase(t) {
            Phase::Before => at_rest(self.on_piece(0, 0.0)),
            Phase::After => at_rest(self.on_piece(self.pieces() - 1, self.laps.lap)),
            Phase::Running(t) => {
                let after = self.breaks.partition_point(|&end| end <= t + SNAP);
                let piece = after.clamp(1, self.pieces()) - 1;
                self.on_piece(piece, t.max(self.breaks[piece]))
            }
        }
    }

    pub(crate) fn laps(&self) -> Laps {
        self.laps
    }

    pub(crate) fn breaks(&self) -> &[f64] {
        &self.breaks
    }

    pub(crate) fn pieces(&self) -> usize {
        self.breaks.len() - 1
    }

    /// The tool at time `t` of a lap, by the formula of smooth piece `piece`; at the ends of the piece this is a one-sided limit.
    pub(crate) fn on_piece(&self, piece: usize, t: f64) -> ToolSample {
        match &self.curve {
            Curve::Shape(shape) => self.with_fixed_rotation(shape.point(piece, t, self.laps.lap)),
            Curve::Positions(spline) => self.with_fixed_rotation(spline_point(spline, piece, t)),
            Curve::Poses(spline) => spline_pose(spline, piece, t),
        }
    }

    fn with_fixed_rotation(&self, point: Point) -> ToolSample {
        let zero = Vector3::zeros();
        ToolSample {
            pose: Isometry3::from_parts(Translation3::from(point.position), self.rotation),
            velocity: stack(point.velocity, zero),
            acceleration: stack(point.acceleration, zero),
        }
    }
}

fn rotation(spec: &PathSpec) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = spec.rpy;
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

fn at_rest(sample: ToolSample) -> ToolSample {
    ToolSample { velocity: Vector6::zeros(), acceleration: Vector6::zeros(), ..sample }
}

fn stack(linear: Vector3<f64>, angular: Vector3<f64>) -> Vector6<f64> {
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

fn spline_point(spline: &Spline, piece: usize, t: f64) -> Point {
    let [x, y, z] = [0, 1, 2].map(|column| spline.evaluate(piece, column, t));
    Point {
        position: Vector3::new(x[0], y[0], z[0]),
        velocity: Vector3::new(x[1], y[1], z[1]),
        acceleration: Vector3::new(x[2], y[2], z[2]),
    }
}

/// Position and orientation from splined components. With `c(t)` the splined quaternion and `Q = c / |c|`, `ω = 2 Im(ċ c*) / |c|²`, and
/// `ω̇` is its time derivative (from `Q̇ = ½ ω Q`, Diebel 2006, eq. 155).
fn spline_pose(spline: &Spline, piece: usize, t: f64) -> ToolSample {
    let point = spline_point(spline, piece, t);
    let columns = [3, 4, 5, 6].map(|column| spline.evaluate(piece, column, t));
    let [c, rate, rate2] = [0, 1, 2]
        .map(|k| nalgebra::Quaternion::new(columns[3][k], columns[0][k], columns[1][k], columns[2][k]));
    let squared = c.norm_squared();
    let omega = (rate * c.conjugate()).imag() * (2.0 / squared);
    // d/dt(ċ c*) = c̈ c* + ċ ċ*; the second term is real.
    let alpha = (rate2 * c.conjugate()).imag() * (2.0 / squared) - omega * (2.0 * c.dot(&rate) / squared);
    ToolSample {
        pose: Isometry3::from_parts(Translation3::from(point.position), UnitQuaternion::from_quaternion(c)),
        velocity: stack(point.velocity, omega),
        acceleration: stack(point.acceleration, alpha),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::{ToolPath, ToolSample};
    use crate::planning::spline::{Ends, Spline};
    use crate::spec::PathSpec;

    /// Seven rows of a tool that turns and moves.
    fn turning() -> ToolPath {
        let times: Vec<f64> = (0..7).map(|k| 0.3 * f64::from(k)).collect();
        let rows = times.iter().flat_map(|&t| {
            let q = UnitQuaternion::from_euler_angles(0.4 * t, (1.1 * t).sin(), 0.7 * t * t).into_inner();
            [t, t * t, (2.0 * t).cos(), q.i, q.j, q.k, q.w]
        });
        let spline = Spline::through(7, times.clone(), rows.collect(), Ends::Natural);
        ToolPath::through(spline, true, &PathSpec::default())
    }

    /// Largest difference between angular velocity and acceleration of the path and central differences of step h.
    fn error_of_differences(path: &ToolPath, h: f64) -> f64 {
        let angular = |s: &ToolSample| -> Vector3<f64> { s.velocity.fixed_rows::<3>(3).into_owned() };
        let times = (1..30).map(|k| 0.06 * f64::from(k) + 0.013).filter(|t| *t < 1.75);
        times.fold(0.0, |worst: f64, t| {
            let (before, now, after) = (path.at(t - h), path.at(t), path.at(t + h));
            let turn = (after.pose.rotation * before.pose.rotation.inverse()).scaled_axis() / (2.0 * h);
            let rate = (angular(&after) - angular(&before)) / (2.0 * h);
            let alpha: Vector3<f64> = now.acceleration.fixed_rows::<3>(3).into_owned();
            assert!(angular(&now).norm() > 0.1 && alpha.norm() > 0.01, "a tool at rest would test nothing");
            worst.max((turn - angular(&now)).amax()).max((rate - alpha).amax())
        })
    }

    #[test]
    fn angular_velocity_and_acceleration_are_the_derivatives_of_the_orientation() {
        let path = turning();
        let errors = [4e-3, 2e-3, 1e-3].map(|h| error_of_differences(&path, h));
        println!("errors of central differences, step 4, 2, 1 ms: {errors:?}; expected to fall fourfold");
        assert!(errors[0] > 1e-6, "the coarse difference must err, or nothing is tested");
        for pair in errors.windows(2) {
            assert!((pair[0] / pair[1] - 4.0).abs() < 0.5);
        }
    }
}
