//! Which runs train, which stop the training, and which are only tested on.
//!
//! Nothing is tested on that trained: neither a path (its place, size or sharpness) nor a clearance.

use freeplay_arm::Arm;
use freeplay_path::{PathKind, PathSpec, Size};

/// What is simulated.
#[derive(Clone, Debug)]
pub struct RunSpec {
    /// For people.
    pub name: String,
    /// The reference.
    pub path: PathSpec,
    /// Radial clearance, m.
    pub clearance: f64,
    /// Name of the built-in controller.
    pub controller: &'static str,
}

/// One arm and the joint of it that has play.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The nominal arm.
    pub arm: Arm,
    /// Index of the joint.
    pub joint: usize,
}

/// One line of the list: kind, centre, size, period, blend, clearance in mm.
struct Line(PathKind, [f64; 3], f64, f64, Option<f64>, f64);

const SHARP: PathKind = PathKind::SquareSharp;
const SOFT: PathKind = PathKind::Square;

const TRAINING: [Line; 14] = [
    Line(PathKind::Circle, [0.95, 0.0, 0.95], 0.12, 5.0, None, 0.35),
    Line(PathKind::Lissajous, [0.90, 0.05, 0.90], 0.12, 5.0, None, 0.30),
    Line(PathKind::Lissajous, [1.00, 0.0, 0.95], 0.10, 8.0, None, 0.50),
    Line(SOFT, [0.95, 0.0, 0.90], 0.12, 5.0, Some(0.02), 0.25),
    Line(SOFT, [0.90, 0.0, 1.00], 0.10, 4.0, Some(0.01), 0.50),
    Line(SHARP, [0.90, 0.10, 0.90], 0.10, 5.0, None, 0.30),
    Line(SHARP, [0.95, 0.0, 1.00], 0.12, 7.0, None, 0.50),
    Line(SHARP, [1.00, -0.10, 0.90], 0.10, 4.0, None, 0.70),
    Line(SHARP, [0.95, 0.05, 0.95], 0.13, 9.0, None, 0.25),
    Line(SHARP, [0.95, -0.05, 0.90], 0.11, 5.0, None, 0.15),
    Line(SHARP, [0.90, 0.0, 0.95], 0.12, 8.0, None, 0.15),
    Line(SHARP, [1.00, 0.05, 0.95], 0.10, 6.0, None, 0.30),
    Line(SHARP, [0.90, -0.10, 1.00], 0.13, 6.0, None, 0.50),
    Line(SOFT, [1.00, 0.0, 0.95], 0.11, 5.0, None, 0.15),
];

const VALIDATION: [Line; 2] = [
    Line(SHARP, [0.90, 0.0, 1.00], 0.12, 6.0, None, 0.35),
    Line(PathKind::Lissajous, [0.95, -0.05, 0.90], 0.13, 7.0, None, 0.45),
];

/// Clearances tested on, mm.
const TESTED: [f64; 3] = [0.2, 0.4, 0.6];

fn spec(Line(kind, centre, size, period, blend, clearance): &Line) -> RunSpec {
    let path = PathSpec {
        kind: *kind,
        centre: *centre,
        size: Some(Size::One(*size)),
        period: *period,
        blend: *blend,
        ..PathSpec::default()
    };
    named(path, *clearance)
}

fn named(mut path: PathSpec, clearance: f64) -> RunSpec {
    if path.kind == PathKind::Lissajous
        && let Some(Size::One(size)) = path.size
    {
        path.size = Some(Size::Axes([size, 1.6 * size, 0.3 * size]));
    }
    let [x, y, z] = path.centre;
    let size = match path.size {
        Some(Size::One(size)) => format!(", {size} m"),
        Some(Size::Axes([size, ..])) => format!(", {size} m and so on"),
        None => String::new(),
    };
    let blend = path.blend.map_or_else(String::new, |blend| format!(", blend {blend}"));
    let place = format!(" at ({x}, {y}, {z})");
    RunSpec {
        name: format!("{}{place}{size}{blend}, T = {} s, c = {clearance} mm", path.kind.name(), path.period),
        path,
        clearance: clearance * 1e-3,
        controller: freeplay_controller::quasi_static::QUASI_STATIC,
    }
}

/// The runs that train.
pub fn training() -> Vec<RunSpec> {
    TRAINING.iter().map(spec).collect()
}

/// The runs that stop the training.
pub fn validation() -> Vec<RunSpec> {
    VALIDATION.iter().map(spec).collect()
}

/// The runs that are tested on: the default paths (the sharp one twice around, so that there is a previous lap) and a trained path,
/// with the tested clearances. `quick` takes one lap of the sharp square.
pub fn tests(quick: bool) -> Vec<RunSpec> {
    if quick {
        let path = PathSpec { kind: SHARP, ..PathSpec::default() };
        return vec![named(path, 0.4)];
    }
    let mut specs = Vec::new();
    for kind in [PathKind::Lissajous, SOFT, SHARP] {
        for clearance in TESTED {
            let laps = if kind == SHARP { 2 } else { 1 };
            specs.push(named(PathSpec { kind, laps, ..PathSpec::default() }, clearance));
        }
    }
    for clearance in TESTED {
        specs.push(named(spec(&TRAINING[6]).path, clearance));
    }
    specs
}
