//! Which runs train, which stop the training, and which are only tested on.
//!
//! Nothing is tested on that trained: neither a path (its place, size or sharpness) nor a clearance.

use std::fmt::Write as _;
use std::path::Path;

use freeplay_arm::Arm;
use freeplay_path::{PathKind, PathSpec, Size};
use freeplay_terminal::exit::Failure;

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

/// Runs on which the network has to prove better than the twin alone before narx-qp believes it.
const PROOF: [Line; 4] = [
    Line(SHARP, [0.92, 0.03, 0.93], 0.11, 5.0, None, 0.18),
    Line(SHARP, [0.97, -0.04, 0.97], 0.12, 7.0, None, 0.45),
    Line(SOFT, [0.93, 0.02, 0.95], 0.12, 6.0, Some(0.02), 0.55),
    Line(PathKind::Lissajous, [0.97, 0.03, 0.92], 0.11, 6.0, None, 0.25),
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

/// The runs on which the network proves itself, or not.
pub fn proof() -> Vec<RunSpec> {
    PROOF.iter().map(spec).collect()
}

/// The runs that are tested on: the default paths (the sharp one twice around, so that there is a previous lap), a trained path with the
/// tested clearances, and shapes of which none trained: a triangle with sharp corners, written to `folder`, and joints that swing each with
/// a frequency of its own. `quick` takes one lap of the sharp square.
///
/// # Errors
/// A file that cannot be written.
pub fn tests(quick: bool, folder: &Path) -> Result<Vec<RunSpec>, Failure> {
    if quick {
        let path = PathSpec { kind: SHARP, ..PathSpec::default() };
        return Ok(vec![named(path, 0.4)]);
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
    let file = folder.join("triangle.csv");
    freeplay_terminal::files::write(&file, &triangle())?;
    for clearance in TESTED {
        let path = PathSpec { kind: PathKind::File, file: Some(file.clone()), ..PathSpec::default() };
        let name =
            format!("sharp triangle, a shape that did not train, T = {} s, c = {clearance} mm", path.period);
        specs.push(RunSpec { name, ..named(path, clearance) });
    }
    let swinging = named(PathSpec { kind: PathKind::JointSine, ..PathSpec::default() }, TESTED[1]);
    let name = format!("joint_sine, a shape that did not train, T = 6 s, c = {} mm", TESTED[1]);
    specs.push(RunSpec { name, ..swinging });
    Ok(specs)
}

/// A horizontal equilateral triangle about the default centre, 0.15 m from there to its corners, each side from rest to rest in 2 s with
/// the sharp square's share of it for speeding up and for braking: rows of a path file, 1 kHz.
fn triangle() -> String {
    const SIDE: usize = 2000;
    const BLEND: f64 = 0.004;
    let corner = |index: usize| {
        let angle = std::f64::consts::TAU * (index % 3) as f64 / 3.0;
        [0.95 + 0.15 * angle.cos(), 0.15 * angle.sin()]
    };
    let share = |f: f64| {
        let ramp = |f: f64| f * f / (2.0 * BLEND) / (1.0 - BLEND);
        if f < BLEND {
            ramp(f)
        } else if f > 1.0 - BLEND {
            1.0 - ramp(1.0 - f)
        } else {
            (f - BLEND / 2.0) / (1.0 - BLEND)
        }
    };
    let mut rows = String::from("t,x,y,z\n");
    for tick in 0..=3 * SIDE {
        let side = (tick / SIDE).min(2);
        let along = share((tick - side * SIDE) as f64 / SIDE as f64);
        let ([x, y], [to_x, to_y]) = (corner(side), corner(side + 1));
        let _ = writeln!(
            rows,
            "{},{},{},0.95",
            tick as f64 / 1e3,
            x + along * (to_x - x),
            y + along * (to_y - y)
        );
    }
    rows
}
