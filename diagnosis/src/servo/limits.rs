//! Limits and dead bands of servos: weighed one by one, as a fit that begins without them can't feel them.

use freeplay_servo::{Fitted, ModelParameter, Noise, Problem, ServoArm, Sight, Unknown};

use crate::statistics::STRONG;

/// Shares of the greatest torque and speed of a model without the limit at which one is tried: a fit moves it from there, as long as some rows are beyond it.
const TRIED: [f64; 4] = [0.4, 0.6, 0.75, 0.9];
/// Shares of the error at which a dead band is tried: a fit moves it from there, as long as some rows are inside.
const BANDS: [f64; 2] = [0.1, 0.3];
/// Rows over which a speed is measured: the noise of a difference falls with them, and three are short against any motion.
const SPAN: usize = 3;

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
    let price = STRONG + (3.0 * sights.len() as f64).ln();
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

/// Log-likelihood that `model` loses in `problem` under `noise`.
pub fn lost(problem: &Problem, model: &ServoArm, noise: &Noise) -> f64 {
    problem.losses(&problem.residuals(model), noise).iter().sum()
}

/// The limit that gains most where it is tried; all other numbers stand.
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

/// A limit or dead band that a joint may have.
pub struct Limit {
    /// Its number.
    pub unknown: Unknown,
    /// Where it may be.
    pub places: Vec<f64>,
    /// Greatest speed at which the joint was measured, rad/s (m/s).
    pub fastest: f64,
}

/// All limits and dead bands that the joints of `model` may have.
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

/// Greatest torque of each servo over its stiffness, rad, in the simulation, and greatest speed that was measured, rad/s.
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
