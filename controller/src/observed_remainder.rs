//! What a recording says of the remainder: the tracked tool less what the model says of the motion that was sent.

use freeplay_arm::{Arm, Workspace, forward_kinematics};
use freeplay_laws::{ArmWithPlay, Trajectory};
use nalgebra::Vector3;

use crate::centred_average::CentredAverage;
use crate::compensation::Motion;
use crate::deviation::QuasiStatic;
use crate::geometry::Geometry;
use crate::known_effects::KnownEffects;
use crate::model::Model;
use crate::not_ready::NotReady;
use crate::tracking::TrackingOptions;

/// What was observed of one motion, evenly sampled.
pub struct Observed<'a> {
    /// The arm from which deviations are counted: the one that planned the reference. A diagnosis may have moved the model's own within its tolerances.
    pub nominal: &'a Arm,
    /// The reference motion, without corrections.
    pub reference: &'a Trajectory,
    /// Where the encoders were sent but for what follows, `[joint][point]`, rad (m).
    pub sent: &'a [Vec<f64>],
    /// What the controller expected of the tool's deviation and took out, base frame, m; empty if it took nothing out. Such a controller also makes
    /// up for what encoders and transmissions shift.
    pub taken_out: &'a [Vector3<f64>],
    /// Where the tool was, `[axis][point]`, base frame, m.
    pub tool: &'a [Vec<f64>; 3],
}

/// What `model` leaves of the tool's deviation, point by point, base frame, m: the tool less where the model has it with its joints sent along
/// `observed`. It is the same physics as the compensation's, with the journals smoothed over the same span.
///
/// # Errors
/// A model whose arm with play cannot be built.
pub fn remainder(model: &Model, observed: &Observed<'_>, period: f64) -> Result<Vec<Vector3<f64>>, NotReady> {
    let Observed { nominal, reference, sent, taken_out, tool } = observed;
    let points = reference.len();
    let journals = journals(model, reference, period)?;
    let known = if taken_out.is_empty() {
        KnownEffects::of_motion(&model.arm, &model.effects, reference, period)?
    } else {
        None
    };
    let mut statics = QuasiStatic::new(&ArmWithPlay::new(&model.arm, &model.clearances)?, period);
    let mut geometry = Geometry::between(&model.nominal, &model.arm);
    let mut workspace = Workspace::new(nominal);
    let mut q = vec![0.0; model.arm.dof()];
    let mut left = Vec::with_capacity(points);
    for point in 0..points {
        q.iter_mut().zip(&reference.q).for_each(|(q, column)| *q = column[point]);
        let mut deviation = statics.deviation_with(&q, &journals[point]);
        deviation += geometry.as_mut().map_or_else(Vector3::zeros, |other| other.deviation(&q));
        q.iter_mut().zip(*sent).for_each(|(q, column)| *q = column[point]);
        if let Some(shift) = known.as_ref().map(|known| known.shift_at(point)) {
            q.iter_mut().zip(shift).for_each(|(q, shift)| *q -= shift);
        }
        let taken_out = taken_out.get(point).copied().unwrap_or_default();
        let sent = forward_kinematics(nominal, &mut workspace, &q).translation.vector - taken_out;
        let expected = sent + deviation;
        left.push(Vector3::new(tool[0][point], tool[1][point], tool[2][point]) - expected);
    }
    Ok(left)
}

/// The smoothed displacements of the journals, point by point, m.
fn journals(model: &Model, motion: &Trajectory, period: f64) -> Result<Vec<Vec<f64>>, NotReady> {
    let (points, joints) = (motion.len(), model.arm.dof());
    let mut statics = QuasiStatic::new(&ArmWithPlay::new(&model.arm, &model.clearances)?, period);
    let half = ((TrackingOptions::default().average / period - 1.0) / 2.0).round().max(0.0) as usize;
    let width = 2 * model.clearances.len();
    let mut preview = CentredAverage::new(half, width);
    let (mut q, mut v, mut a) = (vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]);
    let mut mean = vec![0.0; width];
    let mut smoothed = Vec::with_capacity(points);
    // The ends stand still for the half of the span that is beyond them.
    for instant in 0..points + 2 * half {
        let point = instant.saturating_sub(half).min(points - 1);
        motion.at(point, &mut q, &mut v, &mut a);
        statics.advance(Motion { q: &q, v: &v, a: &a });
        preview.push(statics.displacements());
        if instant >= 2 * half {
            preview.mean(&mut mean);
            smoothed.push(mean.clone());
        }
    }
    Ok(smoothed)
}
