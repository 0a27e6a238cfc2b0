//! Twins: recordings of a machine that is its model inside the tolerances, moved the same way and measured as badly. What
//! they leave is the noise floor; what a hypothesis finds in them, it finds in nothing.

use freeplay_arm::Arm;
use freeplay_laws::{ArmParts, DriveFriction, rigid_torques, tool_positions};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::case::Case;
use super::columns::subtract;
use super::noise::{Noise, normal, normals};
use super::stage::Stage;
use super::tolerance::{EVEN, Of, Tolerances};
use crate::filter::derivatives;
use crate::residual::Kind;

/// What one twin of all recordings leaves, by channel: measured minus model, as [`Case::target`] has it.
pub(crate) fn twin(case: &Case, tolerances: &Tolerances, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let drawn = Drawn::new(case.stages[0].arm(), tolerances, &mut rng);
    // What no change of the arm makes is linear: friction, delays, the tracker.
    let linear: Vec<f64> =
        case.nuisances[0].iter().map(|n| if n.free { 0.0 } else { within(&mut rng) }).collect();
    let mut target = Vec::new();
    for (stage, nuisances) in case.stages.iter().zip(&case.nuisances) {
        let mut left = drawn.left(stage, &mut rng);
        for (nuisance, amount) in nuisances.iter().zip(&linear) {
            if !nuisance.of.is_rigid() && nuisance.of != Of::Zero {
                subtract(&mut left, &nuisance.answer, -amount);
            }
        }
        target.extend(left);
    }
    for (target, kept) in target.iter_mut().zip(&case.kept) {
        target.iter_mut().zip(kept).for_each(|(x, kept)| *x *= kept);
    }
    for (target, doubt) in target.iter_mut().zip(&case.doubt) {
        doubted(target, doubt, &mut rng);
    }
    target
}

/// Adds to `target` what a perfect model may be off, of which `doubt` is the most: some share of it, the same until it has fallen and rises
/// again, as at the next reversal.
fn doubted(target: &mut [f64], doubt: &[f64], rng: &mut ChaCha8Rng) {
    let (mut share, mut was_falling) = (even(rng), false);
    for (row, target) in target.iter_mut().enumerate() {
        let before = doubt[row.saturating_sub(1)];
        if was_falling && doubt[row] > before {
            share = even(rng);
        }
        was_falling = doubt[row] < before || was_falling && doubt[row] == before;
        *target += share * doubt[row];
    }
}

/// A number of the prior's spread: half of the machines anywhere inside their tolerance, half nearer its middle.
fn within(rng: &mut ChaCha8Rng) -> f64 {
    if rng.next_u32().is_multiple_of(2) {
        3_f64.sqrt() * even(rng)
    } else {
        0.87 * normal(rng).clamp(-2.0, 2.0)
    }
}

/// A number spread evenly over ±1.
fn even(rng: &mut ChaCha8Rng) -> f64 {
    2.0 * f64::from(rng.next_u32()) / f64::from(u32::MAX) - 1.0
}

/// A machine drawn inside the tolerances.
struct Drawn {
    arm: Arm,
    zeros: Vec<f64>,
}

impl Drawn {
    fn new(nominal: &Arm, tolerances: &Tolerances, rng: &mut ChaCha8Rng) -> Self {
        let mut parts = ArmParts::of(nominal);
        for joint in &mut parts.joints {
            joint.inertia.mass *= 1.0 + EVEN * tolerances.mass * within(rng);
            joint.inertia.about_com *= 1.0 + EVEN * tolerances.inertia * within(rng);
            joint.inertia.com += Vector3::from_fn(|_, _| EVEN * EVEN * tolerances.length * within(rng));
            joint.rotor_inertia *= 1.0 + EVEN * tolerances.inertia * within(rng);
            lengthen(&mut joint.placement.translation.vector, EVEN * tolerances.length * within(rng));
        }
        lengthen(&mut parts.tool.translation.vector, EVEN * tolerances.length * within(rng));
        let zeros = (0..nominal.dof()).map(|_| EVEN * tolerances.zero * within(rng)).collect();
        Self { arm: parts.into_arm(nominal.name()).unwrap_or_else(|_| nominal.clone()), zeros }
    }

    /// Measured minus model: the drawn machine on the recorded motion, measured with noise, against the model on the motion
    /// that its encoders read.
    fn left(&self, stage: &Stage, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let motion = stage.motion();
        let points = motion.len();
        let shift: Vec<Vec<f64>> = self.zeros.iter().map(|zero| vec![*zero; points]).collect();
        let true_torque = rigid_torques(&self.arm, motion, Some(&shift));
        let moved: Vec<Vec<f64>> =
            motion.q.iter().zip(&self.zeros).map(|(q, zero)| q.iter().map(|q| q + zero).collect()).collect();
        let true_tool = tool_positions(&self.arm, &moved);
        let (read, jumps) = misread(stage, rng);
        let (model_torque, model_tool) =
            (rigid_torques(stage.arm(), &read, None), tool_positions(stage.arm(), &read.q));
        let mut left = Vec::new();
        for (channel, noise) in stage.channels.iter().zip(&stage.ground.noises.channels) {
            let mut rest = stage.treated(&match channel.kind {
                Kind::Link(joint) | Kind::Position(joint) => misreading(rng, &stage.whole().q[joint], noise),
                Kind::Torque(_) | Kind::Tool(_) => normals(rng, stage.whole().len(), noise.deviation),
            });
            let mut add = |truth: &[f64], model: &[f64]| {
                rest.iter_mut().zip(truth.iter().zip(model)).for_each(|(rest, (t, m))| *rest += t - m);
            };
            match channel.kind {
                Kind::Torque(joint) => {
                    add(&true_torque[joint], &model_torque[joint]);
                    let viscous = stage.arm().joints()[joint].friction.viscous;
                    let scaled = |v: &[f64]| v.iter().map(|v| viscous * v).collect::<Vec<_>>();
                    add(&scaled(&motion.v[joint]), &scaled(&read.v[joint]));
                    if let Some(jump) = &jumps[joint] {
                        add(&vec![0.0; points], jump);
                    }
                }
                Kind::Tool(axis) => add(&true_tool[axis], &model_tool[axis]),
                Kind::Link(joint) | Kind::Position(joint) => add(&motion.q[joint], &read.q[joint]),
            }
            left.push(rest);
        }
        left
    }
}

/// The motion as noisy encoders read it, and how much more dry friction the model then sees, by joint.
fn misread(stage: &Stage, rng: &mut ChaCha8Rng) -> (freeplay_laws::Trajectory, Vec<Option<Vec<f64>>>) {
    let (mut read, whole) = (stage.motion().clone(), stage.whole());
    let treatment = &stage.ground.treatment;
    let mut jumps = Vec::new();
    for (joint, noise) in stage.ground.noises.positions.iter().enumerate() {
        let error = treatment.low_pass(&misreading(rng, &whole.q[joint], noise));
        let (mut rate, mut second) = (Vec::new(), Vec::new());
        for stretch in &whole.stretches {
            let (v, a) = derivatives(&error[stretch.clone()], whole.step(stretch));
            rate.extend(v);
            second.extend(a);
        }
        let into = |column: &mut Vec<f64>, error: &[f64]| {
            column.iter_mut().zip(treatment.keep(error)).for_each(|(x, e)| *x += e);
        };
        into(&mut read.q[joint], &error);
        into(&mut read.v[joint], &rate);
        into(&mut read.a[joint], &second);
        let nominal = DriveFriction::nominal(stage.arm().joints()[joint].friction);
        jumps.push((nominal.coulomb > 0.0).then(|| {
            let jump = DriveFriction { viscous: 0.0, ..nominal };
            let more =
                whole.v[joint].iter().zip(&rate).map(|(v, e)| jump.resisting(v + e) - jump.resisting(*v));
            stage.treated(&more.collect::<Vec<_>>())
        }));
    }
    (read, jumps)
}

/// What an encoder reads of `position` too much: its noise, and its rounding, which is no noise where the joint hardly moves.
fn misreading(rng: &mut ChaCha8Rng, position: &[f64], noise: &Noise) -> Vec<f64> {
    let step = noise.step;
    if step <= 0.0 {
        return normals(rng, position.len(), noise.deviation);
    }
    let beside_rounding = (noise.deviation.powi(2) - step * step / 12.0).max(0.0).sqrt();
    let zero = 0.5 * step * even(rng);
    let errors = normals(rng, position.len(), beside_rounding);
    let read = |(position, error): (&f64, f64)| {
        let place = (position + zero + error) / step;
        place.round() * step - position - zero
    };
    position.iter().zip(errors).map(read).collect()
}

fn lengthen(way: &mut Vector3<f64>, amount: f64) {
    if let Some(direction) = way.try_normalize(1e-6) {
        *way += direction * amount;
    }
}
