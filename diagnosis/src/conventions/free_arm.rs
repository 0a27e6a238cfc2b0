//! Links of any inertia: the fit of an arm with the model's joints and other links.
//!
//! Torques are linear in the ten inertial parameters of each link (Atkeson, An & Hollerbach 1986), so the fit is one step of least squares under a Gaussian
//! prior, and its evidence has a closed form (Laplace): the log-likelihood of the fit, minus ½ ln|I + S| of the information S in units of the prior, minus half
//! the square of the parameters in these units.

use freeplay_arm::Arm;
use nalgebra::{DMatrix, DVector};

use super::along::{Along, dot, weighed};
use super::bodies::PARAMETERS;
use super::normal::{Channel, Cleared};
use crate::statistics::TURNS;

/// A torque channel.
pub(super) struct Target<'t> {
    pub joint: usize,
    /// The target values, row by row.
    pub column: Vec<f64>,
    /// Ratio of the recorded unit to N·m.
    pub scale: f64,
    /// Columns of the joint alone; the flag is true for a coefficient that can't be negative.
    pub own: Vec<(&'t [f64], bool)>,
    /// Floor of the squared residual times the number of rows: the fit ignores smaller residuals.
    pub floor: f64,
    /// Number of independent rows.
    pub independent: f64,
}

/// The fitted links.
pub(super) struct FreeArm {
    /// Residual sum of squares of each channel.
    pub left: Vec<f64>,
    /// Price of the parameters, a natural logarithm.
    pub price: f64,
}

/// Approximate size of the inertial parameters of each link of `arm`: its mass, times its length to the powers zero, one and two.
pub(super) fn sizes(arm: &Arm) -> Vec<f64> {
    let joints = arm.joints();
    let of = |k: usize| {
        let inertia = &joints[k].inertia;
        let next =
            joints.get(k + 1).map_or(arm.tool().translation.vector, |next| next.placement.translation.vector);
        let turns = (inertia.about_com.diagonal().max() / inertia.mass.max(f64::MIN_POSITIVE)).sqrt();
        let length = next.norm().max(inertia.com.norm()).max(turns);
        (0..PARAMETERS).map(move |number| match number {
            0 => inertia.mass,
            1..=3 => inertia.mass * length,
            _ => inertia.mass * length * length,
        })
    };
    (0..joints.len()).flat_map(of).collect()
}

/// Fit of parameters with the standard deviations `prior` about zero to `targets`; `None` if there is nothing to fit.
pub(super) fn fitted(
    along: &Along,
    arm: &Arm,
    weights: &[f64; 4],
    targets: &[Target],
    prior: &[f64],
) -> Option<FreeArm> {
    let columns = along.by_parameter(arm);
    let channels: Vec<Channel> = targets.iter().map(|target| target.channel(&columns, weights)).collect();
    let cleared: Vec<Cleared> = channels.iter().map(Cleared::of).collect();
    let count = prior.len();
    let mut beta = vec![0.0; count];
    let mut price = 0.0;
    for _ in 0..TURNS {
        let (mut normal, mut right) = (DMatrix::<f64>::identity(count, count), DVector::zeros(count));
        for ((cleared, channel), target) in cleared.iter().zip(&channels).zip(targets) {
            let weight = target.independent / (cleared.residual_square(&beta) + channel.floor);
            for i in 0..count {
                right[i] += weight * prior[i] * cleared.right[i];
                for k in 0..count {
                    normal[(i, k)] += weight * prior[i] * prior[k] * cleared.normal[(i, k)];
                }
            }
        }
        let factor = normal.cholesky()?;
        let solved = factor.solve(&right);
        beta = solved.iter().zip(prior).map(|(x, prior)| x * prior).collect();
        let determinant: f64 = factor.l().diagonal().iter().map(|x| x.ln()).sum();
        price = determinant + 0.5 * solved.norm_squared();
    }
    let left = channels.iter().map(|channel| channel.own(&beta).0).collect();
    Some(FreeArm { left, price })
}

impl Target<'_> {
    fn channel(&self, columns: &[Vec<[Vec<f64>; 4]>], weights: &[f64; 4]) -> Channel {
        let shared = columns.iter().map(|by_joint| {
            let parts = by_joint[self.joint].each_ref().map(Vec::as_slice);
            weighed(parts, &weights.map(|weight| weight * self.scale))
        });
        let all: Vec<Vec<f64>> = self.own.iter().map(|(column, _)| column.to_vec()).chain(shared).collect();
        let mut normal =
            DMatrix::from_fn(all.len(), all.len(), |i, k| if i <= k { dot(&all[i], &all[k]) } else { 0.0 });
        normal.fill_lower_triangle_with_upper_triangle();
        Channel {
            normal,
            right: DVector::from_iterator(all.len(), all.iter().map(|column| dot(column, &self.column))),
            square: dot(&self.column, &self.column),
            is_positive: self.own.iter().map(|(_, positive)| *positive).collect(),
            floor: self.floor,
        }
    }
}
