//! A small substitute for the plant: it simulates the arm with play under a controller, tick by tick, in this process. It uses
//! semi-implicit Euler with 20 µs and the contact laws of the plant. It serves tests of controllers only.

use std::path::PathBuf;

use freeplay_arm::{Drive, Workspace, forward_kinematics, hybrid_aba};
use freeplay_controller::{Answer, Controller, RunInfo, Task, TaskMode};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable, Journal, bearing_contact};
use freeplay_model::{ArmFile, EffectTable, paper_arm, to_toml};
use freeplay_path::JointPath;
use freeplay_shm::{Joints, MAX_JOINTS, Mode, Pace, Reference, State};
use nalgebra::Vector3;

pub const RUN: u64 = 4711;
const SUBSTEPS: usize = 50;
/// The deviation is evaluated after this time, s, because the drop of a centred journal cannot be compensated.
pub const AFTER: f64 = 0.5;

/// The paper's arm with the clearances `clearances` (joint, m), as a model file in `folder`.
pub fn model_file(folder: &std::path::Path, clearances: &[(usize, f64)]) -> PathBuf {
    let mut file = paper_arm();
    for &(joint, c) in clearances {
        let mut parameters = toml::Table::new();
        parameters.insert("clearance".to_owned(), c.into());
        let joint = Some(file.arm.joints()[joint].name.clone());
        file.effects.push(EffectTable { kind: Clearance::KIND.to_owned(), joint, parameters, line: 0 });
    }
    let path = folder.join("model.toml");
    std::fs::write(&path, to_toml(&file)).unwrap();
    path
}

/// The plant's description of a run of `task`.
pub fn run_info(task: &Task, joints: usize) -> RunInfo {
    RunInfo {
        joints,
        mode: if task.mode == TaskMode::Torque { Mode::Torque } else { Mode::Driven },
        pace: Pace::Lockstep,
        period_ns: (1e9 / task.rate).round() as u64,
        ticks: 6000,
    }
}

/// One joint with play: its law and the latched impact speed.
struct Bearing {
    clearance: Clearance,
    impact_speed: Option<f64>,
}

/// The simulated true arm.
pub struct Simulation {
    file: ArmFile,
    play: ArmWithPlay,
    workspace: Workspace,
    nominal: Workspace,
    path: JointPath,
    mode: TaskMode,
    period: f64,
    bearings: Vec<Bearing>,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
    drives: Vec<Drive>,
    pub tick: u64,
    in_force: Option<Answer>,
    target: [[Joints; 3]; 2],
}

/// Results of a run.
#[derive(Default)]
pub struct Outcome {
    pub states: Vec<State>,
    pub answers: Vec<Answer>,
    /// Tool minus the perfect arm's tool on the reference, m, tick by tick.
    pub deviation: Vec<Vector3<f64>>,
    period: f64,
}

impl Outcome {
    fn after(&self) -> impl Iterator<Item = &Vector3<f64>> {
        self.deviation.iter().skip((AFTER / self.period) as usize)
    }

    /// RMS of the deviation's norm after [`AFTER`], mm.
    pub fn rms(&self) -> f64 {
        let count = self.after().count() as f64;
        1e3 * (self.after().map(Vector3::norm_squared).sum::<f64>() / count).sqrt()
    }

    /// RMS of the deviation's components after [`AFTER`], mm.
    pub fn rms_axes(&self) -> Vector3<f64> {
        let count = self.after().count() as f64;
        let sum: Vector3<f64> = self.after().map(|d| d.component_mul(d)).sum();
        (sum / count).map(f64::sqrt) * 1e3
    }

    /// Largest norm of the deviation after [`AFTER`], mm.
    pub fn max(&self) -> f64 {
        1e3 * self.after().map(Vector3::norm).fold(0.0, f64::max)
    }
}

impl Simulation {
    /// The paper's arm with the clearances `clearances` (joint, m) on the path of `task`.
    pub fn new(task: &Task, clearances: &[(usize, f64)]) -> Simulation {
        let mut file = paper_arm();
        if let Some(gravity) = task.gravity {
            file.arm = file.arm.with_gravity(gravity.into());
        }
        let clearances: Vec<_> = clearances
            .iter()
            .map(|&(joint, c)| (joint, Clearance::new(&ClearanceTable::new(c)).unwrap()))
            .collect();
        let play = ArmWithPlay::new(&file.arm, &clearances).unwrap();
        let (n, m) = (file.arm.dof(), play.arm().dof());
        let path = JointPath::plan(&file.arm, &task.path, task.rate).unwrap();
        let mut simulation = Simulation {
            workspace: Workspace::new(play.arm()),
            nominal: Workspace::new(&file.arm),
            path,
            mode: task.mode,
            period: task.period(),
            bearings: clearances
                .iter()
                .map(|&(_, clearance)| Bearing { clearance, impact_speed: None })
                .collect(),
            q: vec![0.0; m],
            v: vec![0.0; m],
            a: vec![0.0; m],
            tau: vec![0.0; m],
            drives: vec![Drive::Torque(0.0); m],
            tick: 0,
            in_force: None,
            target: Default::default(),
            play,
            file,
        };
        let start = simulation.reference(0.0);
        simulation.play.spread(&start.q[..n], &mut simulation.q);
        simulation.play.spread(&start.qd[..n], &mut simulation.v);
        simulation
    }

    pub fn joints(&self) -> usize {
        self.file.arm.dof()
    }

    fn reference(&self, tick: f64) -> Reference {
        let mut reference = Reference::REST;
        self.path.at(tick * self.period, &mut reference.q, &mut reference.qd, &mut reference.qdd);
        reference
    }

    /// The state of this tick; the tool is tracked.
    pub fn state(&mut self) -> State {
        let n = self.joints();
        let mut state = State::new(RUN, n);
        state.tick = self.tick;
        state.mode = if self.mode == TaskMode::Torque { Mode::Torque } else { Mode::Driven }.code();
        self.play.gather(&self.q, &mut state.q[..n]);
        self.play.gather(&self.v, &mut state.qd[..n]);
        state.applied = self.in_force.map_or([0.0; MAX_JOINTS], |answer| answer.value);
        state.reference = self.reference(self.tick as f64);
        state.reference_next = self.reference((self.tick + self.mode.lead()) as f64);
        let tool = forward_kinematics(self.play.arm(), &mut self.workspace, &self.q);
        state.tool[..3].copy_from_slice(tool.translation.vector.as_slice());
        state.tool[3..].copy_from_slice(tool.rotation.coords.as_slice());
        state.flags = State::FLAG_TOOL_TRACKED;
        state
    }

    /// The tool's distance from the perfect arm's tool on the reference, m.
    pub fn deviation(&mut self) -> Vector3<f64> {
        let n = self.joints();
        let reference = self.reference(self.tick as f64);
        let wanted = forward_kinematics(&self.file.arm, &mut self.nominal, &reference.q[..n]);
        let tool = forward_kinematics(self.play.arm(), &mut self.workspace, &self.q);
        tool.translation.vector - wanted.translation.vector
    }

    /// Integrates one tick under the command in force; `answer`, to this tick's state, is in force from the next.
    pub fn step(&mut self, answer: Answer) {
        let guided = self.in_force.is_none();
        let n = self.joints();
        if guided || self.mode == TaskMode::Driven {
            let mut from = [[0.0; MAX_JOINTS]; 3];
            for (row, values) in from.iter_mut().zip([&self.q, &self.v, &self.a]) {
                self.play.gather(values, &mut row[..n]);
            }
            let to = match &self.in_force {
                None => self.reference((self.tick + 1) as f64),
                Some(answer) => Reference { q: answer.value, qd: answer.velocity, qdd: answer.acceleration },
            };
            if guided {
                let start = self.reference(0.0);
                from = [start.q, start.qd, start.qdd];
            }
            self.target = [from, [to.q, to.qd, to.qdd]];
        }
        for substep in 0..SUBSTEPS {
            self.substep(substep, guided);
        }
        self.in_force = Some(answer);
        self.tick += 1;
    }

    fn substep(&mut self, substep: usize, guided: bool) {
        let h = self.period / SUBSTEPS as f64;
        let prescribed = guided || self.mode == TaskMode::Driven;
        for joint in 0..self.joints() {
            let at = self.play.joint(joint);
            self.drives[at] = if prescribed {
                let [q, v, a] = self.along(joint, substep as f64 / SUBSTEPS as f64);
                (self.q[at], self.v[at]) = (q, v);
                Drive::Acceleration(a)
            } else {
                Drive::Torque(self.in_force.map_or(0.0, |answer| answer.value[joint]))
            };
        }
        self.contacts();
        hybrid_aba(
            self.play.arm(),
            &mut self.workspace,
            &self.q,
            &self.v,
            &self.drives,
            &mut self.a,
            &mut self.tau,
        );
        for ((q, v), a) in self.q.iter_mut().zip(&mut self.v).zip(&self.a) {
            *v += a * h;
            *q += *v * h;
        }
        if prescribed && substep + 1 == SUBSTEPS {
            for joint in 0..self.joints() {
                let at = self.play.joint(joint);
                [self.q[at], self.v[at], self.a[at]] = self.along(joint, 1.0);
            }
        }
    }

    fn contacts(&mut self) {
        for (play, bearing) in self.play.plays().iter().zip(&mut self.bearings) {
            let journal = Journal {
                offset: play.slides.map(|slide| self.q[slide]),
                velocity: play.slides.map(|slide| self.v[slide]),
                turning: self.v[play.turn],
            };
            let approach = journal.approach(&bearing.clearance);
            if approach.penetration <= 0.0 {
                bearing.impact_speed = None;
            }
            let speed = if approach.penetration > 0.0 {
                *bearing.impact_speed.get_or_insert(approach.rate)
            } else {
                0.0
            };
            let contact = bearing_contact(&bearing.clearance, &approach, speed);
            for (slide, force) in play.slides.into_iter().zip(contact.force) {
                self.drives[slide] = Drive::Torque(force);
            }
            if let Drive::Torque(torque) = &mut self.drives[play.turn] {
                *torque += contact.moment;
            }
        }
    }

    /// The quintic from the start to the end of this tick.
    fn along(&self, joint: usize, s: f64) -> [f64; 3] {
        let h = self.period;
        let at = |end: usize, order: usize| self.target[end][order][joint];
        let (c0, c1, c2) = (at(0, 0), at(0, 1) * h, 0.5 * at(0, 2) * h * h);
        let d0 = at(1, 0) - c0 - c1 - c2;
        let d1 = at(1, 1) * h - c1 - 2.0 * c2;
        let d2 = at(1, 2) * h * h - 2.0 * c2;
        let c = [
            c0,
            c1,
            c2,
            10.0 * d0 - 4.0 * d1 + 0.5 * d2,
            -15.0 * d0 + 7.0 * d1 - d2,
            6.0 * d0 - 3.0 * d1 + 0.5 * d2,
        ];
        let horner = |weights: [f64; 6]| (0..6).rev().fold(0.0, |sum, i| sum * s + weights[i] * c[i]);
        let slope = |i: usize| i as f64;
        let q = horner([1.0; 6]);
        let v = (1..6).rev().fold(0.0, |sum, i| sum * s + slope(i) * c[i]);
        let a = (2..6).rev().fold(0.0, |sum, i| sum * s + slope(i) * slope(i - 1) * c[i]);
        [q, v / h, a / (h * h)]
    }
}

/// Runs `controller` on `task` against an arm with `clearances` (joint, m) for `ticks`.
pub fn run(controller: &mut dyn Controller, task: &Task, clearances: &[(usize, f64)], ticks: u64) -> Outcome {
    let mut simulation = Simulation::new(task, clearances);
    controller.start(task, &run_info(task, simulation.joints())).unwrap();
    let mut outcome = Outcome { period: task.period(), ..Outcome::default() };
    for _ in 0..ticks {
        let state = simulation.state();
        let mut answer = Answer::BLANK;
        controller.answer(&state, &mut answer);
        outcome.deviation.push(simulation.deviation());
        outcome.states.push(state);
        outcome.answers.push(answer);
        simulation.step(answer);
    }
    outcome
}
