//! The start of a run, and controllers that connect while it goes on.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam::queue::ArrayQueue;
use freeplay_arm::Workspace;
use freeplay_path::JointPath;
use freeplay_shm::{Backoff, Greeting, MAX_JOINTS, Mode, PlantLink, State, now_ns};

use crate::cause::TickLatencies;
use crate::plant::{Deadlines, PUBLISHED, Plant, PlantConfig, PlantError};
use crate::response_timeouts::ResponseTimeouts;
use crate::{
    AnswerCounts, Applied, Braking, ControllerManager, DeviationStatistics, GateLimits, Hermite, JointUse,
    OperatorRequests, Reflexes, Sensors, Stages, TickRecord,
};

impl Plant {
    /// A plant at the start of `path`; no controller has connected yet.
    ///
    /// # Errors
    /// See [`PlantError`].
    pub fn new(
        config: PlantConfig,
        path: Arc<JointPath>,
        link: PlantLink,
        run: u64,
        queue: Arc<ArrayQueue<TickRecord>>,
    ) -> Result<Self, PlantError> {
        let joints = config.arm.dof();
        if joints > MAX_JOINTS {
            return Err(PlantError::TooManyJoints { joints });
        }
        let period = config.period_ns as f64 * 1e-9;
        let (system, laws) = config.system(&path)?;
        let limits = config.reflex_limits(&path)?;
        let mut state = State::new(run, joints);
        if config.mode == Mode::Servo {
            // The servos hold the joints at the beginning of the path until a command reaches them.
            let [mut v, mut a] = [vec![0.0; joints], vec![0.0; joints]];
            path.at(0.0, &mut state.applied[..joints], &mut v, &mut a);
        }
        Ok(Self {
            nominal: Workspace::new(&config.arm),
            manager: ControllerManager::new(
                &config.controller_set,
                GateLimits::of(&config.arm, config.mode, period, config.hold, &limits.torque_rate),
                run,
                joints,
                period,
            ),
            timeouts: ResponseTimeouts::new(config.controller_set.controllers),
            laws,
            sensors: Sensors::new(&config.sensors, joints, config.seed),
            stages: Stages::new()?,
            deviation: DeviationStatistics::new(DeviationStatistics::START_DURATION),
            joint_use: JointUse::new(&config.arm, period),
            answers: AnswerCounts::default(),
            deadlines: Deadlines::default(),
            applied: Applied::Guided,
            motion: Hermite::new(joints),
            brakes: Braking::new(limits.braking[..joints].to_vec()),
            driven: vec![true; joints],
            torque: vec![0.0; joints],
            state,
            reflexes: Reflexes::new(limits, period),
            measured: vec![[0.0; 3]; joints],
            stopped: None,
            backoff: Backoff::for_this_machine(),
            peak_base_force: 0.0,
            requests: OperatorRequests::default(),
            spoils_next: false,
            marks: 0,
            processes: vec![None; config.controller_set.controllers],
            is_planning: false,
            round_trips: None,
            published: [0; PUBLISHED],
            links: TickLatencies::default(),
            misses: None,
            config,
            system,
            path,
            link,
            run,
            queue,
        })
    }

    /// Accepts controllers until every slot has one; returns their names.
    pub(super) fn await_controllers(
        &mut self,
        stop: &AtomicBool,
        refused: &mut Vec<String>,
    ) -> Result<Option<Vec<String>>, PlantError> {
        let deadline = now_ns() + self.config.patience.as_nanos() as u64;
        let mut names: Vec<Option<String>> = vec![None; self.manager.len()];
        while !stop.load(Ordering::Relaxed) {
            // Checked before the last greeting: a refused controller has ended, too.
            let ended: Vec<usize> =
                (0..names.len()).filter(|&slot| names[slot].is_none() && self.link.has_ended(slot)).collect();
            for greeting in self.link.greet()? {
                match greeting {
                    Greeting::Accepted { slot, name, pid } => {
                        names[slot as usize] = Some(name);
                        self.processes[slot as usize] = Some(pid);
                    }
                    Greeting::Refused { name, verdict, .. } => refused.push(format!("{name}: {verdict:?}")),
                }
            }
            if names.iter().all(Option::is_some) {
                return Ok(Some(names.into_iter().flatten().collect()));
            }
            let ended: Vec<usize> = ended.into_iter().filter(|&slot| names[slot].is_none()).collect();
            if !ended.is_empty() && refused.is_empty() {
                return Err(PlantError::ControllerEnded { slots: ended });
            }
            if now_ns() > deadline || !ended.is_empty() {
                let several = names.len() > 1;
                return Err(PlantError::NoController {
                    missing: (0..names.len()).filter(|&slot| several && names[slot].is_none()).collect(),
                    patience: self.config.patience,
                    refused: std::mem::take(refused),
                });
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(None)
    }

    pub(super) fn note_greetings(&mut self, refused: &mut Vec<String>) -> Result<(), PlantError> {
        for greeting in self.link.greet()? {
            match greeting {
                Greeting::Refused { name, verdict, .. } => refused.push(format!("{name}: {verdict:?}")),
                // A process in the slot of one that has ended. The plant does not replace the only controller of a run.
                Greeting::Accepted { slot, pid, .. } if self.manager.len() > 1 => {
                    self.manager.renew(slot as usize);
                    self.timeouts.renew(slot as usize);
                    if let Some(misses) = &mut self.misses {
                        misses.replace(slot as usize, pid);
                    }
                }
                Greeting::Accepted { .. } => {}
            }
        }
        Ok(())
    }
}
