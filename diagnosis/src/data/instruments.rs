//! Errors due to the instruments alone: simulated recordings of the model's own machine on the same motion, with the same measurement noise.

use freeplay_laws::{DriveFriction, Trajectory, rigid_torques, tool_positions};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::data::linearised::LinearisedRecording;
use crate::data::noise::Noise;
use crate::random::normals;
use crate::signals::channel::Kind;
use crate::signals::filter::derivatives;
use crate::statistics::difference;

/// Measured minus model of `recording`: the machine on the recorded motion, measured with noise, against the model on the motion of its noisy encoders.
pub(crate) fn simulated_instrument_residual(
    recording: &LinearisedRecording,
    rng: &mut ChaCha8Rng,
) -> Vec<Vec<f64>> {
    let motion = recording.motion();
    let (torque, tool) =
        (rigid_torques(recording.arm(), motion, None), tool_positions(recording.arm(), &motion.q));
    let (read, jumps) = simulated_readings(recording, rng);
    let (read_torque, read_tool) =
        (rigid_torques(recording.arm(), &read, None), tool_positions(recording.arm(), &read.q));
    let mut residual = Vec::new();
    for (channel, noise) in recording.channels.iter().zip(&recording.prepared.noises.channels) {
        let mut rest = recording.treated(&match channel.kind {
            Kind::Link(joint) | Kind::Position(joint) => {
                simulated_error(rng, &recording.whole().q[joint], noise)
            }
            Kind::Torque(_) | Kind::Tool(_) => normals(rng, recording.whole().len(), noise.deviation),
        });
        let mut add = |truth: &[f64], model: &[f64]| {
            rest.iter_mut().zip(truth.iter().zip(model)).for_each(|(rest, (t, m))| *rest += t - m);
        };
        match channel.kind {
            Kind::Torque(joint) => {
                add(&torque[joint], &read_torque[joint]);
                let viscous = recording.arm().joints()[joint].friction.viscous;
                let scaled = |v: &[f64]| v.iter().map(|v| viscous * v).collect::<Vec<_>>();
                add(&scaled(&motion.v[joint]), &scaled(&read.v[joint]));
                if let Some(jump) = &jumps[joint] {
                    add(&vec![0.0; jump.len()], jump);
                }
            }
            Kind::Tool(axis) => add(&tool[axis], &read_tool[axis]),
            Kind::Link(joint) | Kind::Position(joint) => add(&motion.q[joint], &read.q[joint]),
        }
        residual.push(rest);
    }
    residual
}

/// Errors due to noise and rounding in the rows of `recording`, in the torque of `joint` without its friction. The torque has this `noise`; `seed` sets the random
/// numbers.
pub(crate) fn rigid_torque_error(
    recording: &LinearisedRecording,
    joint: usize,
    noise: &Noise,
    seed: u64,
) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (read, _) = simulated_readings(recording, &mut rng);
    let [truth, read] =
        [recording.motion(), &read].map(|motion| rigid_torques(recording.arm(), motion, None));
    let mut error = recording.treated(&normals(&mut rng, recording.whole().len(), noise.deviation));
    let torques = truth[joint].iter().zip(&read[joint]);
    error.iter_mut().zip(torques).for_each(|(error, (truth, read))| *error += truth - read);
    error
}

/// The motion from noisy encoders, and the resulting error of the model's dry friction, by joint.
fn simulated_readings(
    recording: &LinearisedRecording,
    rng: &mut ChaCha8Rng,
) -> (Trajectory, Vec<Option<Vec<f64>>>) {
    let (mut read, whole) = (recording.motion().clone(), recording.whole());
    let wrong = simulated_motion(recording, rng);
    let mut jumps = Vec::new();
    for joint in 0..recording.arm().dof() {
        let into = |column: &mut Vec<f64>, wrong: &[f64], right: &[f64]| {
            let error = difference(wrong, right);
            column.iter_mut().zip(recording.prepared.treatment.keep(&error)).for_each(|(x, e)| *x += e);
        };
        into(&mut read.q[joint], &wrong.q[joint], &whole.q[joint]);
        into(&mut read.v[joint], &wrong.v[joint], &whole.v[joint]);
        into(&mut read.a[joint], &wrong.a[joint], &whole.a[joint]);
        let nominal = DriveFriction::nominal(recording.arm().joints()[joint].friction);
        jumps.push((nominal.coulomb > 0.0).then(|| {
            let jump = DriveFriction { viscous: 0.0, ..nominal };
            let speeds = wrong.v[joint].iter().zip(&whole.v[joint]);
            let more = speeds.map(|(wrong, right)| jump.resisting(*wrong) - jump.resisting(*right));
            recording.treated(&more.collect::<Vec<_>>())
        }));
    }
    (read, jumps)
}

/// The motion from noisy encoders, on all grid points.
pub(crate) fn simulated_motion(recording: &LinearisedRecording, rng: &mut ChaCha8Rng) -> Trajectory {
    let (mut read, whole) = (recording.whole().clone(), recording.whole());
    for (joint, noise) in recording.prepared.noises.positions.iter().enumerate() {
        let error = recording.prepared.treatment.low_pass(&simulated_error(rng, &whole.q[joint], noise));
        for stretch in &whole.stretches {
            let error = &error[stretch.clone()];
            let (v, a) = derivatives(error, whole.step(stretch));
            let into = |column: &mut Vec<f64>, error: &[f64]| {
                column[stretch.clone()].iter_mut().zip(error).for_each(|(x, e)| *x += e);
            };
            into(&mut read.q[joint], error);
            into(&mut read.v[joint], &v);
            into(&mut read.a[joint], &a);
        }
    }
    read
}

/// Error of an encoder at `position`: its noise, and its rounding, which is not random where the joint hardly moves.
fn simulated_error(rng: &mut ChaCha8Rng, position: &[f64], noise: &Noise) -> Vec<f64> {
    let step = noise.step;
    if step <= 0.0 {
        return normals(rng, position.len(), noise.deviation);
    }
    let beside_rounding = (noise.deviation.powi(2) - step * step / 12.0).max(0.0).sqrt();
    let zero = 0.5 * step * (2.0 * f64::from(rng.next_u32()) / f64::from(u32::MAX) - 1.0);
    let errors = normals(rng, position.len(), beside_rounding);
    let read = |(position, error): (&f64, f64)| {
        let place = (position + zero + error) / step;
        place.round() * step - position - zero
    };
    position.iter().zip(errors).map(read).collect()
}
