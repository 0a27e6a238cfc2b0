//! Feedback gains for an arm without chosen ones, found by trial.
//!
//! While its journal flies, a light link effectively gets a feedback gain several times higher (decisions/0018, 0048). Whether the
//! journal then comes to rest depends on arm, posture and play, and no formula of the arm's inertia predicts it. The program therefore
//! simulates the scenario's own plant briefly under `computed-torque`, whose feedback all built-in controllers share. It starts with the
//! usual natural frequency, halves it after each failed trial, and keeps the first value with which every journal rests.

use freeplay_controller::computed_torque::COMPUTED_TORQUE;
use freeplay_controller::task::PAPER_MODEL;
use freeplay_controller::{Answer, Gains, RunInfo, Task, built_in};
use freeplay_model::to_toml;
use freeplay_path::JointPath;
use freeplay_plant::{Input, PlantConfig, System};
use freeplay_shm::{CommandStatus, Mode, Pace, Reference, State};

use crate::scenario::{Drive, Scenario};
use crate::setup::Setup;
use crate::terminal_summary::BOUNCING_SHARE;
use freeplay_terminal::exit::Failure;

/// Excluded time for the drop of a centred journal, s.
const DROP: f64 = 0.5;
/// Evaluated time after it, s.
const JUDGED: f64 = 1.0;
/// Largest number of halvings of the natural frequency; a lower one would hardly hold the arm.
const HALVINGS: u32 = 5;

/// Sets the feedback of `scenario` to one with which its journals rest, if nobody has chosen a feedback and the arm is not the paper's.
/// Returns the result as one sentence, or `None` if the usual feedback suffices or there is no play.
///
/// # Errors
/// An unwritable file of the trial.
pub fn settle(scenario: &mut Scenario) -> Result<Option<String>, Failure> {
    if scenario.has_gains || scenario.model == PAPER_MODEL || scenario.mode != Drive::Torque {
        return Ok(None);
    }
    // The set-up of the run reports errors of the scenario.
    let Ok(setup) = Setup::new(scenario) else { return Ok(None) };
    if setup.plays().is_empty() {
        return Ok(None);
    }
    let folder = tempfile::tempdir().map_err(Failure::internal)?;
    let usual = scenario.controller.gains;
    let first = flying(scenario, &setup, usual, folder.path())?;
    let Err(why) = first else { return Ok(None) };
    let halved =
        |times| Gains { natural_frequency: usual.natural_frequency / f64::from(2_u32.pow(times)), ..usual };
    for gains in (1..=HALVINGS).map(halved) {
        if flying(scenario, &setup, gains, folder.path())?.is_ok() {
            scenario.controller.gains = gains;
            return Ok(Some(format!(
                "feedback: a trial chose controller.gains.natural_frequency = {} rad/s; with the default {} rad/s {why}",
                gains.natural_frequency, usual.natural_frequency
            )));
        }
    }
    Ok(Some(format!(
        "feedback: with controller.gains.natural_frequency = {} rad/s {why}, and no softer feedback down to {} rad/s helped in a trial: try a smaller clearance, another posture (path.start) or more substeps",
        usual.natural_frequency,
        halved(HALVINGS).natural_frequency
    )))
}

/// Simulates `scenario` briefly with `gains`. Returns an error text unless every journal rests.
fn flying(
    scenario: &Scenario,
    setup: &Setup,
    gains: Gains,
    folder: &std::path::Path,
) -> Result<Result<(), String>, Failure> {
    let model = folder.join("model.toml");
    freeplay_terminal::files::write(&model, &to_toml(&setup.truth))?;
    let task = Task {
        model: model.display().to_string(),
        gravity: Some((*setup.arm().gravity()).into()),
        rate: scenario.rate,
        path: scenario.path.clone(),
        gains,
        ..Task::default()
    };
    let (system, _) = setup.plant.system(&setup.path).map_err(Failure::input)?;
    let mut trial = Trial { plant: &setup.plant, path: &setup.path, system };
    Ok(trial.play(&task))
}

/// One trial.
struct Trial<'a> {
    plant: &'a PlantConfig,
    path: &'a JointPath,
    system: System,
}

impl Trial<'_> {
    fn play(&mut self, task: &Task) -> Result<(), String> {
        let (n, period) = (self.plant.arm.dof(), self.plant.period_ns as f64 * 1e-9);
        let ticks_of = |seconds: f64| (seconds / period).round() as u64;
        let (judged_from, ticks) = (ticks_of(DROP), ticks_of(DROP + JUDGED).min(self.plant.ticks));
        let mut controller =
            built_in(COMPUTED_TORQUE).ok_or_else(|| "no controller can be tried".to_owned())?;
        let run = RunInfo {
            joints: n,
            mode: Mode::Torque,
            pace: Pace::Lockstep,
            period_ns: self.plant.period_ns,
            ticks,
        };
        controller.start(task, &run).map_err(|error| error.to_string())?;
        let mut state = State::new(1, n);
        state.reference_next = self.reference(0.0);
        self.system.start(&state.reference_next.q[..n], &state.reference_next.qd[..n]);
        let mut before: Vec<f64> = Vec::new();
        for tick in 0..ticks {
            if tick == judged_from {
                before = self.system.tallies().map(|tally| tally.free).collect();
            }
            self.observe(tick, period, &mut state);
            let mut answer = Answer::BLANK;
            controller.answer(&state, &mut answer);
            let limits = self.plant.arm.joints().iter().map(|joint| joint.limits.effort);
            let too_much = answer.value[..n].iter().zip(limits).any(|(torque, limit)| torque.abs() > limit);
            if answer.status == CommandStatus::NoAnswer || too_much {
                return Err(format!("the torques exceed their limits at tick {tick}"));
            }
            let driven = vec![tick == 0; n];
            let input = Input { torque: &state.applied[..n], driven: &driven, motion: self.path };
            self.system.tick(&input).map_err(|_| format!("the motion diverges at tick {tick}"))?;
            state.applied = answer.value;
        }
        self.judge(&before, ticks.saturating_sub(judged_from) as f64 * period)
    }

    /// Checks that the journals rest during the last `seconds`; `before` are their flight times until then.
    fn judge(&self, before: &[f64], seconds: f64) -> Result<(), String> {
        let flown = self.system.tallies().map(|tally| tally.free).zip(before);
        let shares = flown.map(|(after, before)| (after - before) / seconds);
        let most = shares.enumerate().max_by(|(_, one), (_, other)| one.total_cmp(other));
        match most.filter(|(_, share)| *share > BOUNCING_SHARE) {
            Some((play, share)) => {
                let joint = self.system.play().plays()[play].joint;
                let name = &self.plant.arm.joints()[joint].name;
                Err(format!("the journal of {name} flies for {:.0} % of the time", 100.0 * share))
            }
            None => Ok(()),
        }
    }

    fn reference(&self, time: f64) -> Reference {
        let n = self.plant.arm.dof();
        let mut reference = Reference::REST;
        self.path.at(time, &mut reference.q[..n], &mut reference.qd[..n], &mut reference.qdd[..n]);
        reference
    }

    /// Updates `state` for `tick`, as the plant does with ideal sensors.
    fn observe(&self, tick: u64, period: f64, state: &mut State) {
        let n = self.plant.arm.dof();
        state.tick = tick;
        self.system.encoders(&mut state.q[..n], &mut state.qd[..n]);
        state.tau[..n].copy_from_slice(self.system.motor_torque());
        state.reference = self.reference(tick as f64 * period);
        state.reference_next = self.reference((tick + 1) as f64 * period);
    }
}
