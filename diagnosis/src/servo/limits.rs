//! Limits and dead bands of servos: weighed one by one, as a fit that begins without them can't feel them.

use freeplay_servo::{Fitted, Noise, Problem, Quantity, ServoArm, Sight, Unknown};

/// Shares of the greatest torque and speed of a model without the limit at which one is tried.
const TRIED: [f64; 4] = [0.4, 0.6, 0.75, 0.9];
/// Shares of the error at which a dead band is tried.
const BANDS: [f64; 2] = [0.1, 0.3];
/// Rows over which a speed is measured.
const SPAN: usize = 3;
/// Log odds beyond which a limit is believed: 20 to 1, after the price of its number and of the joints where it was looked for.
pub(super) const BELIEVED: f64 = 3.0;

/// One more number for the model, where it is best.
struct Candidate {
    unknown: Unknown,
    value: f64,
    gain: f64,
    /// Greatest speed at which the joint was measured, rad/s: a limit of speed shows where it is reached.
    fastest: f64,
}

/// Adds limits and dead bands to `fitted` as long as the fit part gains by them and the choice part does, too. The unknowns grow with them.
pub fn add_limits(
    [fit, choice]: [&Problem; 2],
    sights: &[Sight],
    unknowns: &mut Vec<Unknown>,
    mut fitted: Fitted,
    progress: &mut dyn FnMut(&str),
) -> Fitted {
    let price = BELIEVED + (3.0 * sights.len() as f64).ln();
    // More than one limit a joint would leave nothing of its servo to fit.
    for _ in 0..sights.len() {
        let best = best(fit, sights, unknowns, &fitted);
        let Some(best) = best.filter(|best| best.gain >= price) else { break };
        let mut more = unknowns.clone();
        more.push(best.unknown);
        let mut model = fitted.model.clone();
        best.unknown.set(&mut model, best.value);
        let with = fit.fit(&model, &more, &mut |step, _| {
            progress(&format!("fitting the servos with one more limit, step {step}"));
        });
        let is_reached = with.model.joints[best.unknown.joint].speed_limit <= best.fastest
            || best.unknown.quantity != Quantity::SpeedLimit;
        if !is_reached
            || lost(choice, &with.model, &fitted.noise) >= lost(choice, &fitted.model, &fitted.noise)
        {
            break;
        }
        (fitted, *unknowns) = (with, more);
    }
    fitted
}

/// Log-likelihood that `model` loses in `problem` under `noise`.
pub fn lost(problem: &Problem, model: &ServoArm, noise: &Noise) -> f64 {
    problem.losses(&problem.residuals(model), noise).iter().sum()
}

/// The limit that gains most where it is tried; all other numbers stand.
fn best(problem: &Problem, sights: &[Sight], unknowns: &[Unknown], fitted: &Fitted) -> Option<Candidate> {
    let before = lost(problem, &fitted.model, &fitted.noise);
    let has = |joint: usize, quantity: Quantity| {
        unknowns.iter().any(|unknown| unknown.joint == joint && unknown.quantity == quantity)
    };
    let most = greatest(problem, &fitted.model);
    let mut candidates = Vec::new();
    for (joint, sight) in sights.iter().enumerate() {
        let tried = [
            (Quantity::TorqueLimit, TRIED.map(|share| (share * most[joint][0]).ln()).to_vec(), 1.0),
            (Quantity::SpeedLimit, TRIED.map(|share| (share * most[joint][1]).ln()).to_vec(), 1.0),
            (Quantity::Deadband, BANDS.map(|share| share * sight.error).to_vec(), sight.error),
        ];
        for (quantity, values, deviation) in tried {
            for value in values.into_iter().filter(|value| value.is_finite() && !has(joint, quantity)) {
                let unknown = Unknown { joint, quantity, expected: value, deviation, step: 0.03 * deviation };
                let mut model = fitted.model.clone();
                unknown.set(&mut model, value);
                let gain = before - lost(problem, &model, &fitted.noise);
                candidates.push(Candidate { unknown, value, gain, fastest: most[joint][1] });
            }
        }
    }
    candidates.into_iter().max_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// Greatest error of the set-point, rad, and greatest speed that was measured, rad/s, of each joint.
fn greatest(problem: &Problem, model: &ServoArm) -> Vec<[f64; 2]> {
    let mut most = vec![[0.0_f64; 2]; model.joints.len()];
    let residuals = problem.residuals(model);
    for ((index, rows), residual) in problem.windows.iter().zip(&residuals) {
        let track = &problem.tracks[*index];
        for (joint, most) in most.iter_mut().enumerate() {
            let r = residual.iter().skip(joint).step_by(model.joints.len());
            for (row, r) in rows.clone().zip(r).skip(SPAN).filter(|(_, r)| r.is_finite()) {
                let (q, t) = (&track.measured[joint], &track.stamps);
                most[0] = most[0].max((track.commands[joint].held(t[row]) - (q[row] - r)).abs());
                let speed = (q[row] - q[row - SPAN]).abs() / (t[row] - t[row - SPAN]);
                most[1] = most[1].max(speed);
            }
        }
    }
    most
}
