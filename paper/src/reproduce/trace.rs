//! Results of a run: its motion tick by tick, and its figures.

use freeplay_controller::QuasiStatic;
use freeplay_controller::compensation::Motion;
use freeplay_plant::{ContactTally, Deviation, DeviationStatistics, Ledger};
use freeplay_terminal::exit::Failure;
use serde::Serialize;

use super::case::Case;
use super::peaks::{self, Peak};
use crate::simulation::{Simulation, TICK};

/// The columns of a run, one value a tick.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Deviation of the tool along x, y and z, mm.
    pub deviation: [Vec<f64>; 3],
    /// The quasi-static prediction of the deviation for the reference motion, mm.
    pub predicted: [Vec<f64>; 3],
    /// The desired tool position, m.
    pub path: [Vec<f64>; 3],
    /// Torque of each joint's motor, N·m.
    pub torque: [Vec<f64>; 6],
    /// Greatest force of joint 1 during the tick, N.
    pub base_force: Vec<f64>,
    /// Greatest normal force in joint 5 during the tick, N.
    pub normal_force: Vec<f64>,
}

impl Trace {
    /// Number of ticks.
    pub fn ticks(&self) -> usize {
        self.base_force.len()
    }

    /// The times, s.
    pub fn times(&self) -> Vec<f64> {
        (0..self.ticks()).map(|tick| tick as f64 * TICK).collect()
    }
}

/// Torque of one joint's motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TorqueFigures {
    /// Greatest magnitude at a tick, N·m.
    pub peak: f64,
    /// Root mean square, N·m.
    pub rms: f64,
}

/// Figures of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figures {
    /// The deviation's norm, x, y and z.
    pub deviation: [Deviation; 4],
    /// Shares of the journal's time by state of contact; `None` for a perfect joint.
    pub contact: Option<ContactTally>,
    /// Greatest force of joint 1, N.
    pub peak_base: f64,
    /// Greatest normal force after the start, N.
    pub peak_normal_after_start: f64,
    /// Peaks of the normal force.
    pub peaks: Vec<Peak>,
    /// Torque of each motor.
    pub torque: [TorqueFigures; 6],
    /// Work of the motors on the motion, without the work that they took back, J.
    pub work: f64,
    /// Energy that the friction in the bearing fed into the motion, summed over the ticks in which it did, J.
    pub friction_fed: f64,
    /// The energies at the end.
    pub ledger: Ledger,
}

/// A run with its motion.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The simulated case.
    pub case: Case,
    /// Its figures.
    pub figures: Figures,
    /// Its motion; empty if only the numbers are needed.
    pub trace: Trace,
}

/// All runs.
#[derive(Clone, Debug, Default)]
pub struct Runs(pub Vec<Outcome>);

impl Runs {
    /// The run of `case`, if it was made.
    pub fn get(&self, case: &Case) -> Option<&Outcome> {
        self.0.iter().find(|outcome| outcome.case == *case)
    }
}

/// Simulates `case`.
///
/// # Errors
/// A motion that can't be integrated.
pub fn simulate(case: &Case) -> Result<Outcome, Failure> {
    let mut run = Simulation::new(&case.scene())?;
    let mut statistics = DeviationStatistics::new(DeviationStatistics::START_DURATION);
    let mut physics = QuasiStatic::new(run.system().play(), TICK);
    let mut trace = Trace::default();
    let (mut work, mut friction_fed) = (0.0, 0.0);
    let ticks = (run.duration() / TICK).round() as u64;
    for tick in 0..=ticks {
        let deviation = run.deviation();
        statistics.add(tick as f64 * TICK, &deviation);
        let path = run.desired_tool();
        let [q, v, a] = run.desired();
        physics.advance(Motion { q, v, a });
        let predicted = physics.deviation(q);
        work += power(&run) * TICK;
        trace.keep(&mut run, [deviation * 1e3, predicted * 1e3, path]);
        if tick < ticks {
            let lost = run.system().ledger().contact_friction;
            run.tick().map_err(|error| Failure::internal(format!("{}: {error}", case.situation())))?;
            friction_fed += (lost - run.system().ledger().contact_friction).max(0.0);
        }
    }
    let figures = Figures {
        deviation: statistics.components(),
        contact: run.system().tallies().next(),
        peak_base: trace.base_force.iter().copied().fold(0.0, f64::max),
        peak_normal_after_start: after_start(&trace.normal_force),
        peaks: peaks::peaks(&trace.normal_force, peaks::threshold(case.gravity)),
        torque: std::array::from_fn(|joint| TorqueFigures::of(&trace.torque[joint])),
        work,
        friction_fed,
        ledger: *run.system().ledger(),
    };
    let trace = if case.nudge == 0.0 { trace } else { Trace::default() };
    Ok(Outcome { case: *case, figures, trace })
}

/// Mechanical power of the motors at this moment, W; zero while they brake.
fn power(run: &Simulation) -> f64 {
    let (system, play) = (run.system(), run.system().play());
    let torques = system.motor_torque().iter().enumerate();
    torques.map(|(joint, torque)| (torque * system.v()[play.joint(joint)]).max(0.0)).sum()
}

fn after_start(force: &[f64]) -> f64 {
    let start = (DeviationStatistics::START_DURATION / TICK).round() as usize;
    force.iter().skip(start).copied().fold(0.0, f64::max)
}

impl TorqueFigures {
    fn of(torque: &[f64]) -> Self {
        let squares: f64 = torque.iter().map(|value| value * value).sum();
        Self {
            peak: torque.iter().fold(0.0, |most, value| value.abs().max(most)),
            rms: (squares / torque.len().max(1) as f64).sqrt(),
        }
    }
}

impl Trace {
    /// Records the present tick: deviation, prediction, path, and the measurements of the system.
    fn keep(&mut self, run: &mut Simulation, vectors: [nalgebra::Vector3<f64>; 3]) {
        for (columns, vector) in
            [&mut self.deviation, &mut self.predicted, &mut self.path].into_iter().zip(vectors)
        {
            columns.iter_mut().zip(vector.iter()).for_each(|(column, value)| column.push(*value));
        }
        let system = run.system_mut();
        for (column, torque) in self.torque.iter_mut().zip(system.motor_torque()) {
            column.push(*torque);
        }
        self.base_force.push(system.take_peaks().base_force);
        let force = if system.bearings().is_empty() { 0.0 } else { system.bearing_mut(0).take_peak() };
        self.normal_force.push(force);
        // There is no measurement before the first tick; the one during it is the nearest.
        if self.ticks() == 2 {
            self.base_force[0] = self.base_force[1];
            self.torque.iter_mut().for_each(|column| column[0] = column[1]);
        }
    }
}
