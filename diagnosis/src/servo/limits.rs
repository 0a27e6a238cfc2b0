//! Limits and dead bands of servos: tested one by one, since a fit that starts without them has no gradient towards them.

use freeplay_servo::{Fitted, ModelParameter, Noise, Problem, ServoArm, Sight, Unknown};

use crate::statistics::STRONG;

/// Initial values of a limit, as shares of the greatest torque and speed of a model without it: a fit moves the limit from there, as long as some rows are
/// beyond it.
const TRIED: [f64; 4] = [0.4, 0.6, 0.75, 0.9];
/// Initial values of a dead band, as shares of the error: a fit moves it from there, as long as some rows are inside.
const BANDS: [f64; 2] = [0.1, 0.3];
/// Rows over which a speed is measured: the noise of a difference falls with their number, and three rows are short against any motion.
const SPAN: usize = 3;

/// One more parameter for the model, at its best value.
struct Candidate {
    unknown: Unknown,
    value: f64,
    gain: f64,
    /// Greatest measured speed of the joint, rad/s: a limit of speed shows where it is reached.
    fastest: f64,
}

/// Adds limits and dead bands to `fitted` as long as both the fit part and the choice part gain. The unknowns grow with them.
pub fn add_limits(
    [fit, choice]: [&Problem; 2],
    sights: &[Sight],
    unknowns: &mut Vec<Unknown>,
    mut fitted: Fitted,
    progress: &mut dyn FnMut(&str),
) -> Fitted {
    let price = STRONG + (3.0 * sights.len() as f64).ln();
    // More than one limit per joint would leave no rows for fitting its servo.
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
            || best.unknown.parameter != ModelParameter::SpeedLimit;
        if !is_reached
            || lost(choice, &with.model, &fitted.noise) >= lost(choice, &fitted.model, &fitted.noise)
        {
            break;
        }
        (fitted, *unknowns) = (with, more);
    }
    fitted
}

/// Loss of log-likelihood of `model` in `problem` under `noise`.
pub fn lost(problem: &Problem, model: &ServoArm, noise: &Noise) -> f64 {
    problem.losses(&problem.residuals(model), noise).iter().sum()
}

/// The limit with the largest gain at its initial values; all other parameters stay fixed.
fn best(problem: &Problem, sights: &[Sight], unknowns: &[Unknown], fitted: &Fitted) -> Option<Candidate> {
    let before = lost(problem, &fitted.model, &fitted.noise);
    let is_new = |limit: &&Limit| !unknowns.iter().any(|one| one.is_same(&limit.unknown));
    let limits = limits(problem, sights, &fitted.model);
    let candidates = limits.iter().filter(is_new).flat_map(|limit| {
        limit.places.iter().map(|value| {
            let mut model = fitted.model.clone();
            limit.unknown.set(&mut model, *value);
            let gain = before - lost(problem, &model, &fitted.noise);
            let unknown = Unknown { expected: *value, ..limit.unknown };
            Candidate { unknown, value: *value, gain, fastest: limit.fastest }
        })
    });
    candidates.max_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// A possible limit or dead band of a joint.
pub struct Limit {
    /// Its parameter.
    pub unknown: Unknown,
    /// Its initial values.
    pub places: Vec<f64>,
    /// Greatest measured speed of the joint, rad/s (m/s).
    pub fastest: f64,
}

/// All possible limits and dead bands of the joints of `model`.
pub fn limits(problem: &Problem, sights: &[Sight], model: &ServoArm) -> Vec<Limit> {
    let most = greatest(problem, model);
    let of_joint = |(joint, sight): (usize, &Sight)| {
        let [error, fastest] = most[joint];
        let limit = move |parameter, places: Vec<f64>, deviation: f64| Limit {
            unknown: Unknown {
                joint,
                parameter,
                expected: places[places.len() / 2],
                deviation,
                step: 0.03 * deviation,
                is_torque: false,
                least: parameter.least(),
            },
            places: places.into_iter().filter(|value| value.is_finite()).collect(),
            fastest,
        };
        [
            limit(ModelParameter::TorqueLimit, TRIED.map(|share| (share * error).ln()).to_vec(), 1.0),
            limit(ModelParameter::SpeedLimit, TRIED.map(|share| (share * fastest).ln()).to_vec(), 1.0),
            limit(ModelParameter::Deadband, BANDS.map(|share| share * sight.error).to_vec(), sight.error),
        ]
    };
    sights.iter().enumerate().flat_map(of_joint).collect()
}

/// Greatest torque of each servo over its stiffness in the simulation, rad, and greatest measured speed, rad/s.
fn greatest(problem: &Problem, model: &ServoArm) -> Vec<[f64; 2]> {
    let mut most = vec![[0.0_f64; 2]; model.joints.len()];
    let residuals = problem.residuals(model);
    for ((index, rows), residual) in problem.windows.iter().zip(&residuals) {
        let track = &problem.tracks[*index];
        let t = &track.stamps;
        for (joint, (most, servo)) in most.iter_mut().zip(&model.joints).enumerate() {
            let q = &track.measured[joint];
            let r: Vec<f64> = residual.iter().skip(joint).step_by(model.joints.len()).copied().collect();
            let simulated = |row: usize| q[row] - r[row - rows.start];
            for row in rows.clone().skip(SPAN) {
                let before = row - SPAN;
                let [now, then] = [row, before].map(simulated);
                if (now - then).is_finite() {
                    let speed = (now - then) / (t[row] - t[before]);
                    let error = track.commands[joint].at(servo, t[row]) - now;
                    most[0] = most[0].max(servo.torque(error, speed).abs() / servo.stiffness);
                    most[1] = most[1].max((q[row] - q[before]).abs() / (t[row] - t[before]));
                }
            }
        }
    }
    most
}
