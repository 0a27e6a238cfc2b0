//! Set-up faults: recordings whose conventions differ from those of their model.
//!
//! They leave the machine as it is. A fault changes the content of the file (units, signs, order, zeros, clocks), or, for gravity and for another arm, the data
//! sheet.

use freeplay_arm::{Arm, JointKind, Workspace, forward_kinematics, gravity_torque, rnea};
use freeplay_model::{ArmFile, parse_toml, to_toml};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

use crate::arms::Machine;
use crate::case::{GenerateError, Made};
use crate::random::{log_uniform, pick, sign, stream, uniform};
use crate::sensors::Samples;

/// The kinds of set-up faults.
pub const SETUP: [&str; 14] = [
    "time_unit",
    "angle_unit",
    "angle_wrap",
    "joint_order",
    "joint_direction",
    "joint_zero",
    "joint_coordinates",
    "torque_sign",
    "torque_unit",
    "gravity_direction",
    "gravity_compensated",
    "clock_offset",
    "frozen_channel",
    "another_arm",
];

/// A recording shows a fault if a posture or a torque changes by more than this share of its own standard deviation.
const SHOWS: f64 = 0.6;
/// A torque depends visibly on the rigid arm if that makes this share of its standard deviation: a tenth of the variance.
const MIN_RIGID_SHARE: f64 = 0.3;
/// A recording also shows a fault if the tool moves by more than this, m.
const SHOWS_AT_TOOL: f64 = 0.03;
/// Attempts to draw a fault before the recording counts as unable to show it.
const DRAWS: usize = 40;

/// One fault of the set-up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetupFault {
    /// One of [`SETUP`].
    pub kind: &'static str,
    /// The joints (from 0) with the fault; empty for a fault of the whole recording.
    pub joints: Vec<usize>,
    /// Its parameters in SI units; their meaning depends on the kind.
    pub values: Vec<f64>,
    /// Further details in words: a torque that flips with its joint, or the late or frozen channels.
    pub detail: String,
}

/// Parts of the recordings and of the data sheet that stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// The torques.
    pub torque: bool,
    /// The tracked tool.
    pub tool: bool,
    /// The friction of the data sheet.
    pub friction: bool,
}

/// `made` with the `kept` parts, and with a fault of each of `kinds`, drawn from `seed`; `None` if its motion shows no fault of some kind.
///
/// # Errors
/// A data sheet that does not parse; the sheets are this program's own.
pub fn with_setup_faults(
    made: &Made,
    kinds: &[&'static str],
    kept: Kept,
    seed: u64,
) -> Result<Option<(Made, Vec<SetupFault>)>, GenerateError> {
    let mut rng = stream(seed, "set-up");
    let mut made = made.clone();
    let mut sheet = parse_toml(&made.model, Path::new("model.toml"))?.arm;
    if !kept.friction {
        sheet = without_friction(&sheet);
    }
    for samples in [&mut made.recording, &mut made.second] {
        keep(samples, kept);
    }
    // Torques without gravity contain no information on its direction.
    if kinds.contains(&"gravity_direction") && kinds.contains(&"gravity_compensated") {
        return Ok(None);
    }
    // If the torques lack gravity, the remaining torque has to show the fault.
    let (mut weightless, mut remaining) = (sheet.clone(), made.recording.clone());
    if kinds.contains(&"gravity_compensated") {
        compensate(&sheet, &mut remaining);
        weightless = sheet.clone().with_gravity(Vector3::zeros());
    }
    let mut faults: Vec<SetupFault> = Vec::new();
    for kind in kinds {
        let (judged, seen) = match *kind {
            "gravity_compensated" => (&sheet, &made.recording),
            _ => (&weightless, &remaining),
        };
        let taken: Vec<usize> = faults.iter().flat_map(|fault| fault.joints.clone()).collect();
        let drawn = (0..DRAWS).find_map(|_| {
            let fault = draw(kind, &sheet, &made.recording, &mut rng)?;
            let is_free = fault.joints.iter().all(|joint| !taken.contains(joint));
            (is_free && !is_another_kind(&fault, &sheet, &made.recording) && shows(&fault, judged, seen))
                .then_some(fault)
        });
        let Some(fault) = drawn else { return Ok(None) };
        faults.push(fault);
    }
    // Faults that need the true positions are applied before others change them.
    let order = |fault: &SetupFault| SETUP.iter().rev().position(|kind| *kind == fault.kind);
    faults.sort_by_key(order);
    for fault in &faults {
        for samples in [&mut made.recording, &mut made.second] {
            apply(fault, &sheet, samples);
        }
    }
    for fault in &faults {
        sheet = on_sheet(fault, sheet)?;
    }
    made.model = to_toml(&ArmFile { arm: sheet, effects: Vec::new(), ignored: Vec::new() });
    Ok(Some((made, faults)))
}

fn without_friction(sheet: &Arm) -> Arm {
    let mut joints = sheet.joints().to_vec();
    joints.iter_mut().for_each(|joint| joint.friction = freeplay_arm::JointFriction::default());
    Arm::new(sheet.name(), joints, *sheet.tool(), *sheet.gravity()).unwrap_or_else(|_| sheet.clone())
}

fn keep(samples: &mut Samples, kept: Kept) {
    let is_kept = |name: &str| {
        (kept.torque || !name.starts_with("tau")) && (kept.tool || !matches!(name, "x" | "y" | "z"))
    };
    let all: Vec<bool> = samples.names.iter().map(|name| is_kept(name)).collect();
    let mut each = all.iter();
    samples.names.retain(|_| *each.next().unwrap_or(&true));
    let mut each = all.iter();
    samples.columns.retain(|_| *each.next().unwrap_or(&true));
}

/// A fault of `kind`; `None` if the arm or the recording does not admit one.
fn draw(kind: &str, sheet: &Arm, samples: &Samples, rng: &mut ChaCha8Rng) -> Option<SetupFault> {
    let n = sheet.dof();
    let all: Vec<usize> = (0..n).collect();
    let joint = pick(rng, &all);
    let is_revolute = sheet.joints()[joint].kind == JointKind::Revolute;
    let kind = *SETUP.iter().find(|known| **known == kind)?;
    let fault = |joints: Vec<usize>, values: Vec<f64>, detail: &str| {
        Some(SetupFault { kind, joints, values, detail: detail.to_owned() })
    };
    let (torque, tool) = (has(samples, "tau1"), has(samples, "x"));
    match kind {
        "time_unit" => fault(vec![], vec![1e3], ""),
        "angle_unit" => fault(vec![], vec![180.0 / PI], ""),
        "angle_wrap" if is_revolute => fault(vec![joint], vec![TAU], ""),
        "joint_order" if n > 1 => {
            let other = (joint + 1 + (uniform(rng, 0.0, 1.0) * (n - 1) as f64) as usize) % n;
            let is_same = sheet.joints()[joint].kind == sheet.joints()[other].kind;
            (joint != other && is_same).then_some(())?;
            fault(vec![joint.min(other), joint.max(other)], vec![], "")
        }
        "joint_direction" => {
            let with = if torque && uniform(rng, 0.0, 1.0) < 0.4 { "alone" } else { "with torque" };
            fault(vec![joint], vec![-1.0], with)
        }
        "joint_zero" if is_revolute => {
            let usual = [FRAC_PI_2, -FRAC_PI_2, PI];
            let zero = if uniform(rng, 0.0, 1.0) < 0.7 {
                pick(rng, &usual)
            } else {
                sign(rng) * uniform(rng, 0.5, 2.6)
            };
            fault(vec![joint], vec![zero], "")
        }
        "joint_coordinates" if n > 1 && joint > 0 && is_revolute => {
            (sheet.joints()[joint - 1].kind == JointKind::Revolute).then_some(())?;
            fault(vec![joint], vec![sign(rng)], "")
        }
        "torque_sign" if torque => {
            let joints = if uniform(rng, 0.0, 1.0) < 0.4 { all } else { vec![joint] };
            fault(joints, vec![-1.0], "")
        }
        "torque_unit" if torque => {
            let (joints, values) = scales(n, joint, rng);
            fault(joints, values, "")
        }
        "gravity_direction" if torque => {
            let down = pick(rng, &[Vector3::z(), Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y()]);
            let free =
                Vector3::new(uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0));
            let down = if uniform(rng, 0.0, 1.0) < 0.7 { down } else { free.normalize() };
            let size = sheet.gravity().norm();
            (down * size).iter().all(|x| x.is_finite()).then_some(())?;
            ((down * size).angle(sheet.gravity()) > 0.7).then_some(())?;
            fault(vec![], (down * size).as_slice().to_vec(), "")
        }
        "gravity_compensated" if torque => fault(vec![], vec![], ""),
        "clock_offset" if torque || tool => {
            let late = match (torque, tool) {
                (true, true) => pick(rng, &["tau", "tool"]),
                (true, false) => "tau",
                _ => "tool",
            };
            // Delays of less than 48 ms are effects of the catalogue; these are longer by more than the error of any fit.
            fault(vec![], vec![sign(rng) * log_uniform(rng, 0.06, 0.4)], late)
        }
        "frozen_channel" => fault(vec![joint], vec![], if torque { pick(rng, &["tau", "q"]) } else { "q" }),
        "another_arm" if another(sheet).is_some() => fault(vec![], vec![], ""),
        _ => None,
    }
}

/// The joints with another torque unit, and the recorded value per N·m (N).
fn scales(n: usize, joint: usize, rng: &mut ChaCha8Rng) -> (Vec<usize>, Vec<f64>) {
    let all: Vec<usize> = (0..n).collect();
    match pick(rng, &[0, 1, 2, 3, 4]) {
        // Newton millimetres.
        0 => (all, vec![1e3; n]),
        // Amperes behind gears.
        1 => (all, (0..n).map(|_| 1.0 / log_uniform(rng, 3.0, 15.0)).collect()),
        // The motor's side of the gears.
        2 => (all, (0..n).map(|_| 1.0 / pick(rng, &[50.0, 80.0, 100.0, 101.0, 121.0, 160.0])).collect()),
        // Large drives: feedback that is not divided.
        3 => {
            let some: Vec<usize> = (0..n.div_ceil(2)).collect();
            let factors = vec![4.0; some.len()];
            (some, factors)
        }
        // Counts, or a wrong constant, at one joint.
        _ => {
            let factor = log_uniform(rng, 3.0, 300.0);
            (vec![joint], vec![if uniform(rng, 0.0, 1.0) < 0.5 { factor } else { 1.0 / factor }])
        }
    }
}

fn has(samples: &Samples, name: &str) -> bool {
    samples.names.iter().any(|known| known == name)
}

fn column<'s>(samples: &'s mut Samples, name: &str) -> Option<&'s mut Vec<f64>> {
    let place = samples.names.iter().position(|known| known == name)?;
    samples.columns.get_mut(place)
}

fn read(samples: &Samples, prefix: &str, joints: usize) -> Option<Vec<Vec<f64>>> {
    let one = |joint: usize| {
        let name = format!("{prefix}{}", joint + 1);
        let place = samples.names.iter().position(|known| *known == name)?;
        samples.columns.get(place).cloned()
    };
    (0..joints).map(one).collect()
}

/// Rows at which the torques are computed.
struct Rows {
    at: Vec<usize>,
    /// Rows on each side over which positions are differentiated.
    reach: usize,
    /// Time that these rows cover, s.
    width: f64,
}

impl Rows {
    /// Takes one row in fifty; 0.05 s on each side smooth the encoder quantisation.
    fn new(t: &[f64]) -> Self {
        let step = (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64;
        let reach = (0.05 / step).round().max(1.0) as usize;
        let at = (reach..t.len().saturating_sub(reach)).step_by(50).collect();
        Self { at, reach, width: reach as f64 * step }
    }

    fn of(&self, column: &[f64]) -> Vec<f64> {
        self.at.iter().map(|&row| column[row]).collect()
    }

    /// Torques of the rigid arm of `sheet` along the positions `q`, and its tool positions.
    fn rigid(&self, sheet: &Arm, q: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let n = sheet.dof();
        let mut ws = Workspace::new(sheet);
        let (mut torques, mut tool) = (vec![Vec::new(); n], vec![Vec::new(); 3]);
        let (reach, width) = (self.reach, self.width);
        let mut torque = vec![0.0; n];
        for &row in &self.at {
            let of = |number: &dyn Fn(&[f64]) -> f64| q.iter().map(|q| number(q)).collect::<Vec<f64>>();
            let here = of(&|q| q[row]);
            let speed = of(&|q| (q[row + reach] - q[row - reach]) / (2.0 * width));
            let acceleration = of(&|q| (q[row + reach] - 2.0 * q[row] + q[row - reach]) / (width * width));
            rnea(sheet, &mut ws, &here, &speed, &acceleration, &mut torque);
            torques.iter_mut().zip(&torque).for_each(|(column, x)| column.push(*x));
            let place = forward_kinematics(sheet, &mut ws, &here).translation.vector;
            tool.iter_mut().zip(place.iter()).for_each(|(column, x)| column.push(*x));
        }
        (torques, tool)
    }
}

fn deviation(column: &[f64]) -> f64 {
    let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
    (column.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / column.len().max(1) as f64).sqrt()
}

/// True if an analyst could detect `fault` in `samples`: it changes a recorded torque, relative to that of the rigid arm of `sheet`, or the recorded tool
/// position, by enough.
fn shows(fault: &SetupFault, sheet: &Arm, samples: &Samples) -> bool {
    let n = sheet.dof();
    let (Some(q), torque) = (read(samples, "q", n), read(samples, "tau", n)) else { return false };
    let mut faulty = samples.clone();
    apply(fault, sheet, &mut faulty);
    let (Some(other), seen) = (read(&faulty, "q", n), read(&faulty, "tau", n)) else { return false };
    let rows = Rows::new(&samples.t);
    let (rigid, tool) = rows.rigid(sheet, &q);
    let changed = |a: &[f64], b: &[f64]| deviation(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>());
    let moves = |joint: usize| deviation(&q[joint]) > 0.05;
    // Requires that the joint's torque depends on the arm, not on its friction alone.
    let speaks = |joint: usize| {
        let torque = torque.as_ref().map(|torque| rows.of(&torque[joint]));
        torque.is_some_and(|torque| deviation(&rigid[joint]) > MIN_RIGID_SHARE * deviation(&torque))
    };
    match fault.kind {
        "time_unit" | "another_arm" => true,
        "angle_unit" => q.iter().any(|q| deviation(q) > 0.15),
        "angle_wrap" => fault.joints.iter().all(|&joint| moves(joint)),
        "frozen_channel" => fault.joints.iter().all(|&joint| moves(joint)),
        "torque_sign" | "torque_unit" => fault.joints.iter().all(|&joint| speaks(joint)),
        "gravity_direction" | "gravity_compensated" => {
            let Some(torque) = &torque else { return false };
            let (moved, _) = rows.rigid(&sheet.clone().with_gravity(Vector3::zeros()), &q);
            (0..n).any(|joint| {
                changed(&rigid[joint], &moved[joint]) > 0.5 * deviation(&rows.of(&torque[joint]))
            })
        }
        "clock_offset" => {
            q.iter().any(|q| deviation(q) > 0.1) && (fault.detail == "tool" || (0..n).any(speaks))
        }
        _ => {
            let (torques, at) = rows.rigid(sheet, &other);
            let at_tool =
                has(samples, "x") && tool.iter().zip(&at).any(|(a, b)| changed(a, b) > SHOWS_AT_TOOL);
            let (Some(torque), Some(seen)) = (&torque, seen) else { return at_tool };
            let in_torque = (0..n).any(|joint| {
                let (before, after) = (rows.of(&torque[joint]), rows.of(&seen[joint]));
                let size = deviation(&before);
                let left = changed(&before, &rigid[joint]);
                changed(&after, &torques[joint]) > left + SHOWS * size && speaks(joint)
            });
            at_tool || in_torque
        }
    }
}

/// Writes the fault into `samples`.
fn apply(fault: &SetupFault, sheet: &Arm, samples: &mut Samples) {
    let n = sheet.dof();
    let value = fault.values.first().copied().unwrap_or(0.0);
    let positions = ["q", "q_ref", "q_link"];
    let each = |samples: &mut Samples, prefixes: &[&str], joint: usize, change: &dyn Fn(f64) -> f64| {
        for prefix in prefixes {
            let column = column(samples, &format!("{prefix}{}", joint + 1));
            column.into_iter().flatten().for_each(|x| *x = change(*x));
        }
    };
    match fault.kind {
        "time_unit" => samples.t.iter_mut().for_each(|t| *t *= value),
        "angle_unit" => {
            for joint in 0..n {
                let unit = if sheet.joints()[joint].kind == JointKind::Revolute { value } else { 1e3 };
                each(samples, &positions, joint, &|x| x * unit);
            }
        }
        "angle_wrap" => wrap(samples, fault.joints[0]),
        "joint_order" => {
            let (a, b) = (fault.joints[0] + 1, fault.joints[1] + 1);
            for prefix in ["q", "q_ref", "q_link", "tau"] {
                let place = |k: usize| samples.names.iter().position(|name| *name == format!("{prefix}{k}"));
                if let (Some(a), Some(b)) = (place(a), place(b)) {
                    samples.columns.swap(a, b);
                }
            }
        }
        "joint_direction" => {
            each(samples, &positions, fault.joints[0], &|x| -x);
            if fault.detail == "with torque" {
                each(samples, &["tau"], fault.joints[0], &|x| -x);
            }
        }
        "joint_zero" => each(samples, &positions, fault.joints[0], &|x| x + value),
        "joint_coordinates" => relative(samples, fault.joints[0], value, &positions),
        "torque_sign" | "torque_unit" => {
            for (k, &joint) in fault.joints.iter().enumerate() {
                let factor = fault.values.get(k).copied().unwrap_or(value);
                each(samples, &["tau"], joint, &|x| x * factor);
            }
        }
        "gravity_compensated" => compensate(sheet, samples),
        "clock_offset" => late(samples, &fault.detail, value),
        "frozen_channel" => {
            let name = format!("{}{}", fault.detail, fault.joints[0] + 1);
            if let Some(column) = column(samples, &name) {
                let still = if fault.detail == "tau" { 0.0 } else { column[0] };
                column.fill(still);
            }
        }
        _ => {}
    }
}

/// Wraps the positions of `joint` to one turn, whose ends lie where this joint passes; some controllers report positions like this.
fn wrap(samples: &mut Samples, joint: usize) {
    let Some(q) = column(samples, &format!("q{}", joint + 1)) else { return };
    let (least, most) =
        q.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| (least.min(*x), most.max(*x)));
    let end = 0.5 * (least + most);
    q.iter_mut().for_each(|x| *x -= if *x > end { TAU } else { 0.0 });
}

fn relative(samples: &mut Samples, joint: usize, factor: f64, prefixes: &[&str]) {
    for prefix in prefixes {
        let before = column(samples, &format!("{prefix}{joint}")).cloned();
        let this = column(samples, &format!("{prefix}{}", joint + 1));
        if let (Some(before), Some(this)) = (before, this) {
            this.iter_mut().zip(&before).for_each(|(x, before)| *x += factor * before);
        }
    }
}

fn compensate(sheet: &Arm, samples: &mut Samples) {
    let n = sheet.dof();
    let (Some(q), mut ws) = (read(samples, "q", n), Workspace::new(sheet)) else { return };
    let (mut here, mut held) = (vec![0.0; n], vec![0.0; n]);
    for row in 0..samples.t.len() {
        here.iter_mut().zip(&q).for_each(|(here, column)| *here = column[row]);
        gravity_torque(sheet, &mut ws, &here, &mut held);
        for (joint, held) in held.iter().enumerate() {
            if let Some(tau) = column(samples, &format!("tau{}", joint + 1)) {
                tau[row] -= held;
            }
        }
    }
}

/// Delays the columns of a group by `delay` s.
fn late(samples: &mut Samples, group: &str, delay: f64) {
    let Samples { t, names, columns } = samples;
    for (name, column) in names.iter().zip(columns) {
        let is_late =
            if group == "tau" { name.starts_with("tau") } else { matches!(name.as_str(), "x" | "y" | "z") };
        if !is_late {
            continue;
        }
        let at = |time: f64| {
            let above = t.partition_point(|t| *t <= time).clamp(1, t.len() - 1);
            let u = ((time - t[above - 1]) / (t[above] - t[above - 1])).clamp(0.0, 1.0);
            column[above - 1] + u * (column[above] - column[above - 1])
        };
        *column = t.iter().map(|time| at(time - delay)).collect();
    }
}

/// The data sheet of another machine with as many joints.
fn another(sheet: &Arm) -> Option<Arm> {
    let others = Machine::ALL.into_iter().filter(|machine| machine.name() != sheet.name());
    others.filter_map(|machine| machine.data_sheet().ok()).find(|other| other.dof() == sheet.dof())
}

/// True if the torques equal those of another fault to the last digit: the zero of the first joint and a base turned about its axis; on a single axis, the
/// signs of torque and position; the signs of two joints that hang in a plane.
fn is_another_kind(fault: &SetupFault, sheet: &Arm, samples: &Samples) -> bool {
    if has(samples, "x") {
        return false;
    }
    let first = &sheet.joints()[0];
    match fault.kind {
        "joint_zero" => fault.joints == [0],
        "gravity_direction" => {
            let axis = first.placement.rotation * first.axis.into_inner();
            let along = (Vector3::from_column_slice(&fault.values) - sheet.gravity()).dot(&axis);
            along.abs() < 1e-6 * sheet.gravity().norm()
        }
        "joint_direction" if sheet.dof() == 2 && fault.detail == "with torque" => is_mirrored(sheet, samples),
        "torque_sign" | "joint_direction" => sheet.dof() == 1,
        _ => false,
    }
}

/// True if reversing all signs leaves the torques of the arm unchanged, as in a mirror. With two joints in a plane that hang straight down at their zeros,
/// reversing one joint then equals reversing the other.
fn is_mirrored(sheet: &Arm, samples: &Samples) -> bool {
    let Some(q) = read(samples, "q", sheet.dof()) else { return false };
    let turned: Vec<Vec<f64>> = q.iter().map(|column| column.iter().map(|x| -x).collect()).collect();
    let rows = Rows::new(&samples.t);
    let (held, mirrored) = (rows.rigid(sheet, &q).0, rows.rigid(sheet, &turned).0);
    let all = || held.iter().flatten().zip(mirrored.iter().flatten());
    let size = all().fold(0.0_f64, |most, (held, _)| most.max(held.abs()));
    all().all(|(held, mirrored)| (held + mirrored).abs() <= 1e-6 * size)
}

/// The data sheet beside the recording. The machine has the gravity of its data sheet; the file states another one.
fn on_sheet(fault: &SetupFault, sheet: Arm) -> Result<Arm, GenerateError> {
    match fault.kind {
        "gravity_direction" => Ok(sheet.with_gravity(Vector3::from_column_slice(&fault.values))),
        "another_arm" => Ok(another(&sheet).unwrap_or(sheet)),
        _ => Ok(sheet),
    }
}
