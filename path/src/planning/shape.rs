//! The built-in curves of the tool point, in closed form.

use std::f64::consts::TAU;

use nalgebra::Vector3;

/// A point of a curve with its first two time derivatives, in the base frame (m, m/s, m/s²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub position: Vector3<f64>,
    pub velocity: Vector3<f64>,
    pub acceleration: Vector3<f64>,
}

/// A closed curve around `centre`; each lap follows it once.
#[derive(Clone, Debug)]
pub(crate) enum Shape {
    /// `centre + (A₁ cos θ, A₂ sin θ, A₃ sin 2θ)`, θ from 0 to 2π by the quintic time law.
    Lissajous { centre: Vector3<f64>, amplitudes: Vector3<f64> },
    /// Horizontal circle from `centre + (r, 0, 0)`, counter-clockwise seen from above, at constant speed.
    Circle { centre: Vector3<f64>, radius: f64 },
    /// Horizontal square, corners (+h,−h), (+h,+h), (−h,+h), (−h,−h), each side from rest to rest.
    Square { centre: Vector3<f64>, half_side: f64, blend: f64 },
}

/// A side of the square has three pieces: speeding up, constant speed, slowing down.
const PIECES_OF_SIDE: usize = 3;
const CORNERS: [[f64; 2]; 4] = [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]];

impl Shape {
    /// Ends of the smooth pieces of a lap that takes `period` s, from 0 to `period`.
    pub fn breaks(&self, period: f64) -> Vec<f64> {
        let Shape::Square { blend, .. } = self else { return vec![0.0, period] };
        let side = period / 4.0;
        let ends = (0..4).flat_map(|k| {
            let begin = f64::from(k) * side;
            [begin, begin + blend * side, begin + (1.0 - blend) * side]
        });
        ends.chain([period]).collect()
    }

    /// The point at time `t` of a lap that takes `period` s, by the formula of smooth piece `piece`.
    pub fn point(&self, piece: usize, t: f64, period: f64) -> Point {
        match self {
            Shape::Lissajous { centre, amplitudes } => lissajous(centre, amplitudes, t, period),
            Shape::Circle { centre, radius } => circle(centre, *radius, t, period),
            Shape::Square { centre, half_side, blend } => {
                square(centre, *half_side, *blend, piece, t, period)
            }
        }
    }
}

/// The quintic time law `10 s³ − 15 s⁴ + 6 s⁵` and its first two derivatives: from rest to rest on s ∈ [0, 1], with zero acceleration at
/// both ends (minimum jerk; Flash & Hogan 1985, eq. 3).
pub(crate) fn quintic(s: f64) -> [f64; 3] {
    let left = 1.0 - s;
    [s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * s * s * left * left, 60.0 * s * left * (1.0 - 2.0 * s)]
}

fn lissajous(centre: &Vector3<f64>, amplitudes: &Vector3<f64>, t: f64, period: f64) -> Point {
    let [law, rate, rate2] = quintic(t / period);
    let (theta, omega, alpha) = (TAU * law, TAU * rate / period, TAU * rate2 / (period * period));
    let ((sin, cos), (sin2, cos2)) = (theta.sin_cos(), (2.0 * theta).sin_cos());
    let tangent = amplitudes.component_mul(&Vector3::new(-sin, cos, 2.0 * cos2));
    let bend = amplitudes.component_mul(&Vector3::new(-cos, -sin, -4.0 * sin2));
    Point {
        position: centre + amplitudes.component_mul(&Vector3::new(cos, sin, sin2)),
        velocity: tangent * omega,
        acceleration: tangent * alpha + bend * (omega * omega),
    }
}

fn circle(centre: &Vector3<f64>, radius: f64, t: f64, period: f64) -> Point {
    let omega = TAU / period;
    let (sin, cos) = (omega * t).sin_cos();
    Point {
        position: centre + Vector3::new(cos, sin, 0.0) * radius,
        velocity: Vector3::new(-sin, cos, 0.0) * (radius * omega),
        acceleration: Vector3::new(-cos, -sin, 0.0) * (radius * omega * omega),
    }
}

fn square(centre: &Vector3<f64>, half_side: f64, blend: f64, piece: usize, t: f64, period: f64) -> Point {
    let side = period / 4.0;
    let k = (piece / PIECES_OF_SIDE).min(3);
    let corner = |k: usize| Vector3::new(CORNERS[k % 4][0], CORNERS[k % 4][1], 0.0) * half_side;
    let along = corner(k + 1) - corner(k);
    let f = (t - k as f64 * side) / side;
    let [s, rate, rate2] = trapezoid(blend, piece % PIECES_OF_SIDE, f);
    Point {
        position: centre + corner(k) + along * s,
        velocity: along * (rate / side),
        acceleration: along * (rate2 / (side * side)),
    }
}

/// Distance along a side and its first two derivatives, as functions of the share `f` ∈ [0, 1] of the side's time, for a trapezoidal speed
/// with acceleration over the share `b`: `f²/2b`, `f − b/2`, `1 − b − (1−f)²/2b`, each over `1 − b`.
fn trapezoid(b: f64, piece: usize, f: f64) -> [f64; 3] {
    let scale = 1.0 / (1.0 - b);
    let left = 1.0 - f;
    let [s, rate, rate2] = match piece {
        0 => [f * f / (2.0 * b), f / b, 1.0 / b],
        1 => [f - b / 2.0, 1.0, 0.0],
        _ => [1.0 - b - left * left / (2.0 * b), left / b, -1.0 / b],
    };
    [s * scale, rate * scale, rate2 * scale]
}
