//! The plant of an arm file, stepped by external torques.

use freeplay_arm::{Arm, Workspace, forward_kinematics};
use freeplay_laws::{Archive, Effects, Readings, SensorLaw};
use freeplay_model::ArmFile;
use freeplay_plant::{Input, Motion, System, SystemError};

use crate::variables::{Quantity, Value, has_servos};

/// Length of a step, s: the tick of a plant.
pub const PERIOD: f64 = 1e-3;

/// Inputs of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stimulus {
    /// Torques of the motors, N·m (N); ignored if the joints have servos.
    pub torque: Vec<f64>,
    /// Commanded positions of the servos, rad (m); without them each servo keeps its last command, initially the position at the start.
    pub command: Option<Vec<f64>>,
    /// True if the brakes hold all joints at their positions.
    pub brakes: bool,
}

impl Stimulus {
    /// Sets the value of an input; other variables have no effect.
    pub(crate) fn set_input(&mut self, quantity: Quantity, value: Value) {
        let joints = self.torque.len();
        match (quantity, value) {
            (Quantity::Torque(joint), Value::Real(torque)) => self.torque[joint] = torque,
            (Quantity::Command(joint), Value::Real(position)) => {
                let rest = || vec![0.0; joints];
                self.command.get_or_insert_with(rest)[joint] = position;
            }
            (Quantity::Brakes, Value::Truth(brakes)) => self.brakes = brakes,
            _ => {}
        }
    }
}

/// Contact of a journal after a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// True if the journal touches its bearing.
    pub touches: bool,
    /// Normal force, N.
    pub force: f64,
}

/// Outputs after a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Readout {
    /// Measured positions, rad (m).
    pub q: Vec<f64>,
    /// Measured velocities, rad/s (m/s).
    pub v: Vec<f64>,
    /// Measured torques, N·m (N).
    pub torque: Vec<f64>,
    /// Tool in the base frame: x, y, z in m, then the quaternion x, y, z, w.
    pub tool: [f64; 7],
    /// Tool position minus that of the arm without effects at the measured positions, m.
    pub deviation: [f64; 3],
    /// Contacts of the journals, in the order of the plays.
    pub contacts: Vec<Contact>,
    /// Kinetic, potential and elastic energy, J.
    pub energy: f64,
}

/// A running machine.
#[derive(Debug)]
pub struct Machine {
    nominal: Arm,
    workspace: Workspace,
    system: System,
    laws: [Vec<Box<dyn SensorLaw>>; 2],
    driven: [Vec<bool>; 2],
    readout: Readout,
    link: Vec<f64>,
}

/// Joints that stand still at these positions.
struct StandingJoints(Vec<f64>);

impl Motion for StandingJoints {
    fn at(&self, _t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        q.copy_from_slice(&self.0);
        v.fill(0.0);
        a.fill(0.0);
    }
}

impl Machine {
    /// Creates the machine of `file` with its journals at rest, its joints at `start` (position and velocity), and `substeps` sub-steps a
    /// step.
    ///
    /// # Errors
    /// [`SystemError`]: a machine that cannot be simulated.
    pub fn new(file: &ArmFile, start: [&[f64]; 2], substeps: u32) -> Result<Machine, SystemError> {
        let effects = Effects::of(file)?;
        let body = effects.changed(&file.arm)?;
        let mut injection = effects.injection();
        let laws = [&mut injection.tool, &mut injection.sensors].map(std::mem::take);
        let has_servos = has_servos(&injection, file.arm.dof());
        let mut system = System::with_effects(&body, injection, &[start[0].to_vec()], PERIOD, substeps)?;
        if has_servos {
            system.close_servos(&body)?;
        }
        system.start(start[0], start[1]);
        let dof = file.arm.dof();
        let blank = || vec![0.0; dof];
        let contacts = vec![Contact::default(); system.bearings().len()];
        let readout = Readout { q: blank(), v: blank(), torque: blank(), contacts, ..Readout::default() };
        let mut machine = Machine {
            workspace: Workspace::new(&file.arm),
            nominal: file.arm.clone(),
            system,
            laws,
            driven: [vec![false; dof], vec![true; dof]],
            readout,
            link: blank(),
        };
        machine.read();
        Ok(machine)
    }

    /// Steps by [`PERIOD`] under `stimulus`.
    ///
    /// # Errors
    /// [`SystemError::NotFinite`]: the integration failed.
    pub fn step(&mut self, stimulus: &Stimulus) -> Result<(), SystemError> {
        let held = stimulus.brakes.then(|| {
            StandingJoints((0..self.nominal.dof()).map(|joint| self.system.joint(joint)[0]).collect())
        });
        let held = held.unwrap_or(StandingJoints(Vec::new()));
        let driven = &self.driven[usize::from(stimulus.brakes)];
        if let Some(command) = &stimulus.command {
            self.system.command_servos(command);
        }
        self.system.tick(&Input { torque: &stimulus.torque, driven, motion: &held })?;
        self.read();
        Ok(())
    }

    /// The outputs after the last step.
    pub fn readout(&self) -> &Readout {
        &self.readout
    }

    /// Simulated time, s.
    pub fn time(&self) -> f64 {
        self.system.time()
    }

    /// Transfers all state variables to or from `archive`: see [`System::transfer_state`].
    pub fn transfer_state(&mut self, archive: &mut Archive) {
        let Machine { nominal: _, workspace: _, system, laws, driven: _, readout, link: _ } = self;
        system.transfer_state(archive);
        laws.iter_mut().flatten().for_each(|law| law.transfer_state(archive));
        let Readout { q, v, torque, tool, deviation, contacts, energy } = readout;
        [q, v, torque].into_iter().for_each(|values| archive.reals(values));
        archive.reals(tool.iter_mut().chain(deviation).chain([energy]));
        for Contact { touches, force } in contacts {
            archive.flag(touches);
            archive.real(force);
        }
    }

    fn read(&mut self) {
        let Readout { q, v, torque, tool, deviation, contacts, energy } = &mut self.readout;
        self.system.encoders(q, v);
        self.system.drive_torque(torque);
        self.system.play().gather(self.system.q(), &mut self.link);
        let pose = self.system.tool();
        let (p, r) = (pose.translation.vector, pose.rotation.coords);
        *tool = [p.x, p.y, p.z, r.x, r.y, r.z, r.w];
        let (place, _) = tool.split_at_mut(3);
        let mut readings = Readings { period: PERIOD, q, v, torque, link: &mut self.link, tool: place };
        self.laws.iter_mut().flatten().for_each(|law| law.read(&mut readings));
        let rigid = forward_kinematics(&self.nominal, &mut self.workspace, q).translation.vector;
        *deviation = [tool[0] - rigid.x, tool[1] - rigid.y, tool[2] - rigid.z];
        for ((contact, bearing), now) in
            contacts.iter_mut().zip(self.system.bearings()).zip(self.system.contacts())
        {
            *contact = Contact { touches: bearing.touching(), force: now.normal };
        }
        *energy = self.system.ledger().total();
    }
}
