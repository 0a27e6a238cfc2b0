//! The remainder in a recording: the tracked tool minus the model's prediction for the commanded motion.

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

/// Observation of one motion, evenly sampled.
pub struct Observed<'a> {
    /// The nominal arm, which planned the reference; deviations are relative to it. A diagnosis may have changed the arm of the model within its
    /// tolerances.
    pub nominal: &'a Arm,
    /// The reference motion, without corrections.
    pub reference: &'a Trajectory,
    /// Commanded encoder positions, without the shifts by encoders and transmissions, `[joint][point]`, rad (m).
    pub sent: &'a [Vec<f64>],
    /// Deviation of the tool that the controller predicted and compensated, base frame, m; empty if it compensated nothing. A compensating controller
    /// also corrects the shifts of encoders and transmissions.
    pub taken_out: &'a [Vector3<f64>],
    /// Measured tool positions, `[axis][point]`, base frame, m.
    pub tool: &'a [Vec<f64>; 3],
}

/// Residual of `model` in the tool's position, point by point, base frame, m: the measured tool minus the tool of the model along `observed`. The
/// physics is that of the compensation, with the journals smoothed over the same span.
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
    // Beyond either end the motion rests for half the span.
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
