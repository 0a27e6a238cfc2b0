//! Limits and dead bands of servos: weighed one by one, as a fit that begins without them can't feel them.

use freeplay_servo::{Fitted, Noise, Problem, Quantity, ServoArm, Sight, Unknown};

/// Shares of the greatest torque and speed of a model without the limit at which one is tried.
const TRIED: [f64; 4] = [0.4, 0.6, 0.75, 0.9];
/// Shares of the error at which a dead band is tried.
const BANDS: [f64; 2] = [0.1, 0.3];
/// Log odds beyond which a limit is believed: 20 to 1, after the price of its number and of the joints where it was looked for.
const BELIEVED: f64 = 3.0;

/// One more number for the model, where it is best.
struct Candidate {
    unknown: Unknown,
    value: f64,
    gain: f64,
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
    while let Some(best) = best(fit, sights, unknowns, &fitted) {
        if best.gain < price {
            break;
        }
        progress("fitting the servos with one more limit");
        let mut more = unknowns.clone();
        more.push(best.unknown);
        let mut model = fitted.model.clone();
        best.unknown.set(&mut model, best.value);
        let with = fit.fit(&model, &more, &mut |_, _| ());
        if lost(choice, &with.model, &fitted.noise) >= lost(choice, &fitted.model, &fitted.noise) {
            break;
        }
        (fitted, *unknowns) = (with, more);
    }
    fitted
}

fn lost(problem: &Problem, model: &ServoArm, noise: &Noise) -> f64 {
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
                candidates.push(Candidate { unknown, value, gain });
            }
        }
    }
    candidates.into_iter().max_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// Greatest error of the set-point, rad, and greatest speed of the command, rad/s, of each joint.
fn greatest(problem: &Problem, model: &ServoArm) -> Vec<[f64; 2]> {
    let mut most = vec![[0.0_f64; 2]; model.joints.len()];
    let residuals = problem.residuals(model);
    for ((index, rows), residual) in problem.windows.iter().zip(&residuals) {
        let track = &problem.tracks[*index];
        for (joint, most) in most.iter_mut().enumerate() {
            let r = residual.iter().skip(joint).step_by(model.joints.len());
            for (row, r) in rows.clone().zip(r).skip(1).filter(|(_, r)| r.is_finite()) {
                let command = |row: usize| track.commands[joint].held(track.stamps[row]);
                let simulated = track.measured[joint][row] - r;
                let speed =
                    (command(row) - command(row - 1)).abs() / (track.stamps[row] - track.stamps[row - 1]);
                most[0] = most[0].max((command(row) - simulated).abs());
                most[1] = most[1].max(speed);
            }
        }
    }
    most
}
