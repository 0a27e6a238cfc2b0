//! Compares the plant as an FMU, through the C functions of the library in its archive, with the same plant called directly: the same torques, in
//! alternation, in one process. Goal: 0.9 of the direct speed. The benchmark compares the outputs bit by bit.

use std::path::Path;
use std::time::Instant;

use freeplay_arm::{Workspace, rnea};
use freeplay_fmi::guest::{Opened, Slave};
use freeplay_fmi::{Instance, Machine, PERIOD, Stimulus, Value, write_fmu};
use freeplay_model::{ArmFile, paper_arm, parse_toml, to_toml};
use hdrhistogram::Histogram;
use rustix::time::{ClockId, clock_gettime};

/// Number of steps of a turn.
const TURN: usize = 500;

/// Arms with step times from about a microsecond upwards, each with the number of measured turns.
const ARMS: [(&str, &str, usize); 3] = [
    ("rigid", "", 200),
    (
        "friction and an elastic gear",
        "[[effect]]\nkind = \"coulomb_friction\"\njoint = \"joint_3\"\ncoulomb = 4.0\n\
         [[effect]]\nkind = \"joint_elasticity\"\njoint = \"joint_2\"\nstiffness = 2e5\ndamping = 60.0\n",
        200,
    ),
    ("play", "[[effect]]\nkind = \"joint_clearance\"\njoint = \"joint_5\"\nclearance = 0.0006\n", 40),
];

fn main() {
    let host = freeplay_shm::Machine::read();
    println!("machine: {}, {} cores, {}", host.cpu, host.cores, host.kernel);
    for (name, effects, turns) in ARMS {
        let text = to_toml(&paper_arm()) + "\n" + effects;
        let file = parse_toml(&text, Path::new("arm.toml")).expect("an arm");
        compare(name, &file, turns);
    }
}

/// A machine at rest with the number of sub-steps of its FMU.
fn machine(file: &ArmFile) -> Machine {
    let instance = Instance::new(file.clone()).expect("an instance");
    let variables = &instance.variables().0;
    let substeps = variables.iter().find(|variable| variable.name == "substeps").expect("a variable").start;
    let Value::Whole(substeps) = substeps else { panic!("a whole number") };
    let rest = vec![0.0; file.arm.dof()];
    Machine::new(file, [&rest, &rest], substeps.unsigned_abs()).expect("a machine")
}

/// The torques of a computed-torque law that oscillates all joints, one stimulus a step.
fn stimuli(file: &ArmFile, steps: usize) -> Vec<Stimulus> {
    let (arm, mut machine) = (&file.arm, machine(file));
    let (mut workspace, mut stimulus) = (Workspace::new(arm), Stimulus::default());
    let step = |step: usize| {
        let read = machine.readout();
        let target = |joint: usize| 0.3 * (2.0 * step as f64 * PERIOD + joint as f64).sin();
        let law = |joint: usize| 100.0 * (target(joint) - read.q[joint]) - 20.0 * read.v[joint];
        let a: Vec<f64> = (0..arm.dof()).map(law).collect();
        stimulus.torque.resize(arm.dof(), 0.0);
        rnea(arm, &mut workspace, &read.q, &read.v, &a, &mut stimulus.torque);
        machine.step(&stimulus).expect("finite");
        stimulus.clone()
    };
    (0..steps).map(step).collect()
}

/// CPU time of this thread, s, which excludes other load on the machine.
fn core_time() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

/// Measurement of one way to step the plant: its times a step, ns, and the total CPU time, s.
struct Way {
    steps: Histogram<u64>,
    whole: f64,
}

impl Way {
    fn new() -> Way {
        Way { steps: Histogram::new(3).expect("three digits are possible"), whole: 0.0 }
    }

    /// Steps by each of `stimuli`, and writes the outputs after each step to `rows`.
    fn turn(
        &mut self,
        stimuli: &[Stimulus],
        rows: &mut [Vec<f64>],
        mut step: impl FnMut(&Stimulus, &mut [f64]),
    ) {
        let begin = core_time();
        for (stimulus, row) in stimuli.iter().zip(rows) {
            let start = Instant::now();
            step(stimulus, row);
            self.steps.record(start.elapsed().as_nanos() as u64).expect("the histogram resizes itself");
        }
        self.whole += core_time() - begin;
    }

    fn print(&self, name: &str) {
        let us = |quantile| self.us(quantile);
        println!(
            "  {name:<8} p50 {:>8.3}  p99 {:>8.3} us a step, {:>7.3} s of the core in all",
            us(0.5),
            us(0.99),
            self.whole
        );
    }

    fn us(&self, quantile: f64) -> f64 {
        self.steps.value_at_quantile(quantile) as f64 * 1e-3
    }
}

fn compare(name: &str, file: &ArmFile, turns: usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let archive = folder.path().join("arm.fmu");
    write_fmu(file, &std::env::current_exe().expect("a path"), &archive).expect("an FMU");
    let opened = Opened::new(&archive).expect("it is read back");
    let references =
        |list: &[(String, u32)]| list.iter().map(|(_, reference)| *reference).collect::<Vec<_>>();
    let (inputs, outputs) = (references(&opened.guest.inputs), references(&opened.guest.outputs));
    let mut slave = opened.start().expect("it starts");
    let mut machine = machine(file);
    let stimuli = stimuli(file, turns * TURN);
    let mut rows = [(); 2].map(|()| vec![vec![0.0; outputs.len()]; TURN]);
    let (mut direct, mut fmu) = (Way::new(), Way::new());
    for (turn, stimuli) in stimuli.chunks(TURN).enumerate() {
        direct.turn(stimuli, &mut rows[0], |stimulus, row| {
            machine.step(stimulus).expect("finite");
            read(&machine, row);
        });
        let mut tick = turn * TURN;
        fmu.turn(stimuli, &mut rows[1], |stimulus, row| {
            step(&mut slave, tick, stimulus, [&inputs, &outputs], row);
            tick += 1;
        });
        let bits = |rows: &[Vec<f64>]| rows.iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&rows[0]), bits(&rows[1]), "turn {turn}");
    }
    println!("{name}, {} steps, {} outputs, all bits the same", turns * TURN, outputs.len());
    direct.print("direct");
    fmu.print("FMU");
    let of = |quantile| direct.us(quantile) / fmu.us(quantile);
    let (p50, whole) = (of(0.5), direct.whole / fmu.whole);
    println!("  speed of the FMU as a share of the direct: p50 {p50:.3}, in all {whole:.3} (goal 0.9)");
}

/// Writes the outputs of the machine in the order of the FMU.
fn read(machine: &Machine, row: &mut [f64]) {
    let read = machine.readout();
    let joints = (0..read.q.len()).flat_map(|joint| [read.q[joint], read.v[joint], read.torque[joint]]);
    let contacts = read.contacts.iter().map(|contact| contact.force);
    let values = joints.chain(read.tool).chain(read.deviation).chain(contacts).chain([read.energy]);
    row.iter_mut().zip(values).for_each(|(row, value)| *row = value);
}

fn step(
    slave: &mut Slave,
    tick: usize,
    stimulus: &Stimulus,
    [inputs, outputs]: [&[u32]; 2],
    row: &mut [f64],
) {
    slave.set(inputs, &mut stimulus.torque.clone()).expect("inputs");
    slave.step(tick as f64 * PERIOD, PERIOD).expect("a step");
    slave.get(outputs, row).expect("outputs");
}
