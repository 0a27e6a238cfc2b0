//! The built-in curves against their definitions and against finite differences of themselves.

use std::f64::consts::TAU;

use freeplay_path::{PathKind, PathSpec, Size, ToolPath};
use nalgebra::{Vector3, Vector6};

const CURVES: [PathKind; 4] =
    [PathKind::Lissajous, PathKind::Circle, PathKind::Square, PathKind::SquareSharp];

fn path(kind: PathKind, period: f64) -> ToolPath {
    ToolPath::of(&PathSpec { kind, period, ..PathSpec::default() }).expect("a Cartesian kind")
}

fn linear(x: &Vector6<f64>) -> Vector3<f64> {
    x.fixed_rows::<3>(0).into_owned()
}

fn position(path: &ToolPath, t: f64) -> Vector3<f64> {
    path.at(t).pose.translation.vector
}

/// Largest error of central differences of position and velocity, relative to the largest velocity and acceleration,
/// at times that stay inside smooth pieces.
fn error_of_differences(path: &ToolPath, h: f64) -> f64 {
    // Kinks of the squares lie at fractions 0, b and 1 - b of a side: these stay clear of them for any b.
    let fractions = [0.0013, 0.002, 0.0027, 0.3, 0.41, 0.5, 0.7, 0.9973, 0.998];
    let times = (0..4).flat_map(|side| fractions.map(|f| (f64::from(side) + f) * path.duration() / 4.0));
    let (mut worst, mut scale) = ([0.0_f64; 2], [0.0_f64; 2]);
    for t in times {
        let (before, now, after) = (path.at(t - h), path.at(t), path.at(t + h));
        let speed = (after.pose.translation.vector - before.pose.translation.vector) / (2.0 * h);
        let bend = (linear(&after.velocity) - linear(&before.velocity)) / (2.0 * h);
        worst[0] = worst[0].max((speed - linear(&now.velocity)).amax());
        worst[1] = worst[1].max((bend - linear(&now.acceleration)).amax());
        scale = [scale[0].max(now.velocity.amax()), scale[1].max(now.acceleration.amax())];
    }
    assert!(scale.iter().all(|s| *s > 0.1), "a path at rest would test nothing");
    (worst[0] / scale[0]).max(worst[1] / scale[1])
}

#[test]
fn velocity_and_acceleration_are_the_derivatives_of_position() {
    for kind in CURVES {
        let path = path(kind, 6.0);
        let (coarse, fine) = (error_of_differences(&path, 1.6e-3), error_of_differences(&path, 4e-4));
        println!("{kind:?}: central differences err by {coarse:.1e} (1.6 ms) and {fine:.1e} (0.4 ms)");
        match kind {
            // Parabolas and lines: central differences are exact.
            PathKind::Square | PathKind::SquareSharp => assert!(coarse < 1e-11 && fine < 1e-11),
            _ => assert!(coarse > 1e-8 && (coarse / fine - 16.0).abs() < 1.0, "order 2: sixteenfold"),
        }
    }
}

#[test]
fn the_smooth_path_is_the_one_of_its_definition() {
    let path = path(PathKind::Lissajous, 6.0);
    let mut worst = 0.0_f64;
    for s in [0.0, 0.1, 0.37, 0.5, 0.83, 1.0_f64] {
        let theta = TAU * (10.0 * s.powi(3) - 15.0 * s.powi(4) + 6.0 * s.powi(5));
        let expected = [0.95 + 0.15 * theta.cos(), 0.25 * theta.sin(), 0.95 + 0.05 * (2.0 * theta).sin()];
        worst = worst.max((position(&path, 6.0 * s) - Vector3::from(expected)).amax());
    }
    println!("worst error {worst:.1e} m, allowed 1e-14");
    assert!(worst < 1e-14);
    let tool_x = path.at(1.0).pose.rotation * Vector3::x();
    assert!((tool_x + Vector3::z()).amax() < 1e-15, "the tool points down: {tool_x}");
}

#[test]
fn the_circle_starts_abruptly_and_keeps_its_speed() {
    let spec =
        PathSpec { kind: PathKind::Circle, size: Some(Size::One(0.2)), laps: 2, ..PathSpec::default() };
    let path = ToolPath::of(&spec).expect("a Cartesian kind");
    assert_eq!(path.duration(), 12.0);
    let speed = TAU * 0.2 / 6.0;
    for t in [0.0, 1.7, 6.0, 9.1, 12.0] {
        let now = path.at(t);
        assert!((linear(&now.velocity).norm() - speed).abs() < 1e-15);
        assert!((linear(&now.acceleration).norm() - speed * speed / 0.2).abs() < 1e-15);
        assert_eq!(now.pose.translation.z, 0.95);
    }
    assert_eq!(path.at(-1e-6).velocity.norm(), 0.0, "at rest before the start");
    assert_eq!(path.at(12.1).velocity.norm(), 0.0, "at rest after the end");
}

#[test]
fn the_squares_pass_their_corners_at_the_quarters_and_turn_there() {
    let corners = [[0.15, -0.15], [0.15, 0.15], [-0.15, 0.15], [-0.15, -0.15], [0.15, -0.15]];
    for (kind, b) in [(PathKind::Square, 0.04), (PathKind::SquareSharp, 0.004)] {
        for period in [6.0, 12.0] {
            let (path, side) = (path(kind, period), period / 4.0);
            let (speed, jolt) = (0.3 / side / (1.0 - b), 0.3 / (side * side) / (b * (1.0 - b)));
            for (k, [x, y]) in corners.into_iter().enumerate() {
                let now = path.at(k as f64 * side);
                let expected = Vector3::new(0.95 + x, y, 0.95);
                assert!((now.pose.translation.vector - expected).amax() < 1e-15);
                assert!(linear(&now.velocity).amax() < 1e-15);
                assert!((linear(&now.acceleration).amax() / jolt - 1.0).abs() < 1e-12);
            }
            // Acceleration ends at b, deceleration begins at 1 - b; both times count to the piece on the right.
            for (f, speed, jolt) in [(b, speed, 0.0), (0.5, speed, 0.0), (1.0 - b, speed, -jolt)] {
                let now = path.at((1.0 + f) * side);
                assert!(
                    (now.velocity.x + speed).abs() < 1e-12
                        && (now.acceleration.x + jolt).abs() < 1e-9 * speed
                );
            }
            println!("{kind:?} T = {period} s: speed {speed:.4} m/s, corner acceleration {jolt:.3} m/s²");
        }
    }
}

#[test]
fn position_and_velocity_pass_every_kink_and_seam_without_a_jump() {
    for kind in CURVES {
        let spec = PathSpec { kind, laps: 2, ..PathSpec::default() };
        let path = ToolPath::of(&spec).expect("a Cartesian kind");
        let mut worst = 0.0_f64;
        for k in 0..8 {
            for f in [0.0, 0.004, 0.04, 0.96, 0.996] {
                let t = (f64::from(k) + f) * 1.5;
                if t == 0.0 {
                    continue;
                }
                let (left, right) = (path.at(t - 2e-9), path.at(t + 2e-9));
                let moved = linear(&right.velocity) * 4e-9;
                let turned = (linear(&right.acceleration) + linear(&left.acceleration)) * 2e-9;
                let jump = right.pose.translation.vector - left.pose.translation.vector - moved;
                let jerk = linear(&right.velocity) - linear(&left.velocity) - turned;
                worst = worst.max(jump.amax()).max(jerk.amax());
            }
        }
        println!("{kind:?}: worst jump {worst:.1e} m or m/s, allowed 1e-12");
        assert!(worst < 1e-12);
    }
}
