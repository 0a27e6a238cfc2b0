//! An instance of the FMU: its mode, values, steps and states.
//!
//! A state consists of the values of all parameters and inputs and the state variables of the machine; see [`State`].

use freeplay_laws::Archive;
use freeplay_model::{ArmFile, to_toml};
use freeplay_plant::SystemError;

use crate::description::token;
use crate::fault::Fault;
use crate::machine::{Machine, PERIOD, Stimulus};
use crate::state::State;
use crate::variables::{Causality, Quantity, Value, Variables};

/// The modes of FMI for Co-Simulation without events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Instantiated,
    Initialization,
    Step,
    Terminated,
}

/// An instance.
#[derive(Debug)]
pub struct Instance {
    file: ArmFile,
    variables: Variables,
    mode: Mode,
    /// Values of parameters and inputs, by value reference.
    values: Vec<Value>,
    /// Time of the importer at the start, s.
    start: f64,
    /// Number of steps since then.
    steps: u64,
    /// The inputs among the values.
    stimulus: Stimulus,
    /// Built on demand; `None` after a parameter was set.
    machine: Option<Machine>,
    /// The instantiation token of the FMU.
    token: String,
}

impl Instance {
    /// Creates an instance of the arm of `file`.
    ///
    /// # Errors
    /// [`Fault::Machine`]: unusable effects.
    pub fn new(file: ArmFile) -> Result<Instance, Fault> {
        let variables = Variables::of(&file).map_err(SystemError::Law)?;
        let token = token(&to_toml(&file));
        let stimulus = Stimulus { torque: vec![0.0; file.arm.dof()], ..Stimulus::default() };
        let (mode, values) = (Mode::Instantiated, Vec::new());
        let mut instance =
            Instance { file, variables, mode, values, start: 0.0, steps: 0, stimulus, machine: None, token };
        instance.reset();
        Ok(instance)
    }

    /// The variables, by value reference.
    pub fn variables(&self) -> &Variables {
        &self.variables
    }

    fn allow(&self, call: &'static str, modes: &[Mode]) -> Result<(), Fault> {
        let mode = match self.mode {
            Mode::Instantiated => "before the initialization",
            Mode::Initialization => "during the initialization",
            Mode::Step => "in step mode",
            Mode::Terminated => "after the end",
        };
        if modes.contains(&self.mode) { Ok(()) } else { Err(Fault::Mode { call, mode }) }
    }

    /// Starts the initialisation at the importer's time `start`, s.
    ///
    /// # Errors
    /// [`Fault::Mode`].
    pub fn enter_initialization(&mut self, start: f64) -> Result<(), Fault> {
        self.allow("fmi3EnterInitializationMode", &[Mode::Instantiated])?;
        (self.mode, self.start) = (Mode::Initialization, start);
        Ok(())
    }

    /// Ends the initialisation; the machine can then step.
    ///
    /// # Errors
    /// [`Fault::Mode`], or a machine that cannot be built.
    pub fn exit_initialization(&mut self) -> Result<(), Fault> {
        self.allow("fmi3ExitInitializationMode", &[Mode::Initialization])?;
        self.machine()?;
        self.mode = Mode::Step;
        Ok(())
    }

    /// Ends the simulation; values stay readable.
    ///
    /// # Errors
    /// [`Fault::Mode`].
    pub fn terminate(&mut self) -> Result<(), Fault> {
        self.allow("fmi3Terminate", &[Mode::Step])?;
        self.mode = Mode::Terminated;
        Ok(())
    }

    /// Resets the instance to its initial state.
    pub fn reset(&mut self) {
        self.values = self.variables.0.iter().map(|variable| variable.start).collect();
        (self.mode, self.start, self.steps, self.machine) = (Mode::Instantiated, 0.0, 0, None);
        self.take_inputs(false);
    }

    /// The importer's time, s.
    pub fn time(&self) -> f64 {
        self.start + self.steps as f64 * PERIOD
    }

    /// The value of the variable `reference`.
    ///
    /// # Errors
    /// [`Fault::Reference`], or a machine that cannot be built.
    pub fn get(&mut self, reference: u32) -> Result<Value, Fault> {
        let index = reference as usize;
        let variable = self.variables.0.get(index).ok_or(Fault::Reference(reference))?;
        let (causality, quantity) = (variable.causality, variable.quantity);
        if matches!(causality, Causality::Parameter | Causality::Input) {
            return Ok(self.values[index]);
        }
        let time = self.time();
        let read = self.machine()?.readout();
        let real = match quantity {
            Quantity::Time => time,
            Quantity::Position(joint) => read.q[joint],
            Quantity::Velocity(joint) => read.v[joint],
            Quantity::Measured(joint) => read.torque[joint],
            Quantity::Tool(place) => read.tool[place],
            Quantity::Deviation(axis) => read.deviation[axis],
            Quantity::ContactForce(play) => read.contacts[play].force,
            Quantity::ContactMode(play) => return Ok(Value::Whole(i32::from(read.contacts[play].touches))),
            Quantity::Energy => read.energy,
            _ => return Err(Fault::Reference(reference)),
        };
        Ok(Value::Real(real))
    }

    /// Sets the variable `reference`.
    ///
    /// # Errors
    /// [`Fault::Reference`], [`Fault::ReadOnly`] or [`Fault::Range`].
    pub fn set(&mut self, reference: u32, value: Value) -> Result<(), Fault> {
        let index = reference as usize;
        let variable = self.variables.0.get(index).ok_or(Fault::Reference(reference))?;
        if std::mem::discriminant(&variable.start) != std::mem::discriminant(&value) {
            return Err(Fault::Reference(reference));
        }
        let is_early = matches!(self.mode, Mode::Instantiated | Mode::Initialization);
        match variable.causality {
            Causality::Parameter if is_early => {}
            Causality::Input if self.mode != Mode::Terminated => {}
            _ => return Err(Fault::ReadOnly(variable.name.clone())),
        }
        let number = match value {
            Value::Real(number) => number,
            Value::Whole(number) => f64::from(number),
            Value::Truth(_) => 0.0,
        };
        let [least, most] = variable.bounds;
        if !(number.is_finite() && (least..=most).contains(&number) || matches!(value, Value::Truth(_))) {
            return Err(Fault::Range { name: variable.name.clone(), value: number, least, most });
        }
        if variable.causality == Causality::Parameter {
            self.machine = None;
        }
        self.values[index] = value;
        self.stimulus.set_input(variable.quantity, value);
        Ok(())
    }

    /// Steps from the time `from` by `step`, s, a whole multiple of [`PERIOD`].
    ///
    /// # Errors
    /// [`Fault::Mode`], [`Fault::Time`], [`Fault::Step`], or a failed integration.
    pub fn step(&mut self, from: f64, step: f64) -> Result<(), Fault> {
        /// Permitted rounding error of an importer's sum of steps, as a share of a step.
        const ROUNDING: f64 = 1e-3;
        self.allow("fmi3DoStep", &[Mode::Step])?;
        let now = self.time();
        let is_here = (from - now).abs() < ROUNDING * PERIOD * (1.0 + now.abs() * 1e-6 / PERIOD);
        if !is_here {
            return Err(Fault::Time { asked: from, now });
        }
        let ticks = (step / PERIOD).round();
        if !(ticks >= 1.0 && (step - ticks * PERIOD).abs() < ROUNDING * PERIOD) {
            return Err(Fault::Step(step));
        }
        let machine = built(&mut self.machine, &self.file, &self.variables, &self.values)?;
        for _ in 0..ticks as u64 {
            machine.step(&self.stimulus)?;
            self.steps += 1;
        }
        Ok(())
    }

    /// Copies the inputs from the values. Servos without a command hold the initial position, whatever the values.
    fn take_inputs(&mut self, is_commanded: bool) {
        let variables = self.variables.0.iter().zip(&self.values);
        variables.for_each(|(variable, value)| self.stimulus.set_input(variable.quantity, *value));
        if !is_commanded {
            self.stimulus.command = None;
        }
    }

    /// The machine, built if it is missing.
    fn machine(&mut self) -> Result<&mut Machine, Fault> {
        built(&mut self.machine, &self.file, &self.variables, &self.values)
    }

    /// The current state.
    pub fn fmu_state(&mut self) -> State {
        let machine = self.machine.as_mut().map(|machine| {
            let mut words = Vec::new();
            machine.transfer_state(&mut Archive::save(&mut words));
            words
        });
        State {
            token: self.token.clone(),
            mode: self.mode as u8,
            start: self.start,
            steps: self.steps,
            is_commanded: self.stimulus.command.is_some(),
            values: self.values.clone(),
            machine,
        }
    }

    /// Parses a state of this FMU from the `bytes` of [`State::to_bytes`].
    ///
    /// # Errors
    /// [`Fault::NoState`], [`Fault::Foreign`] or [`Fault::Damaged`].
    pub fn state_of(&self, bytes: &[u8]) -> Result<State, Fault> {
        State::from_bytes(bytes, &self.token)
    }

    /// Restores `state`.
    ///
    /// # Errors
    /// [`Fault::Foreign`] for a state of another FMU, which changes nothing; [`Fault::Damaged`], or a machine that cannot be built, after which the instance
    /// is reset.
    pub fn restore(&mut self, state: &State) -> Result<(), Fault> {
        if state.token != self.token {
            return Err(Fault::Foreign);
        }
        let restored = self.put_back(state);
        if restored.is_err() {
            self.reset();
        }
        restored
    }

    fn put_back(&mut self, state: &State) -> Result<(), Fault> {
        let modes = [Mode::Instantiated, Mode::Initialization, Mode::Step, Mode::Terminated];
        let mode = *modes.get(usize::from(state.mode)).ok_or(Fault::Damaged)?;
        if state.values.len() != self.values.len() {
            return Err(Fault::Damaged);
        }
        let is_parameter = |index: &usize| self.variables.0[*index].causality == Causality::Parameter;
        let is_same_machine = (0..self.values.len())
            .filter(is_parameter)
            .all(|index| self.values[index] == state.values[index]);
        (self.mode, self.start, self.steps) = (mode, state.start, state.steps);
        self.values.clone_from(&state.values);
        self.take_inputs(state.is_commanded);
        if !is_same_machine || state.machine.is_none() {
            self.machine = None;
        }
        let Some(words) = &state.machine else { return Ok(()) };
        let mut archive = Archive::restore(words);
        self.machine()?.transfer_state(&mut archive);
        if archive.is_complete() { Ok(()) } else { Err(Fault::Damaged) }
    }
}

/// The machine in `machine`, built if it is missing.
fn built<'a>(
    machine: &'a mut Option<Machine>,
    file: &ArmFile,
    variables: &Variables,
    values: &[Value],
) -> Result<&'a mut Machine, Fault> {
    Ok(match machine {
        Some(machine) => machine,
        machine => machine.insert(build(file, variables, values)?),
    })
}

/// Builds the machine of the arm of `file` with the parameters among `values`.
fn build(file: &ArmFile, variables: &Variables, values: &[Value]) -> Result<Machine, Fault> {
    let dof = file.arm.dof();
    let (mut file, mut q, mut v, mut substeps) = (file.clone(), vec![0.0; dof], vec![0.0; dof], 1);
    for (variable, value) in variables.0.iter().zip(values) {
        match (variable.quantity, *value) {
            (Quantity::StartPosition(joint), Value::Real(value)) => q[joint] = value,
            (Quantity::StartVelocity(joint), Value::Real(value)) => v[joint] = value,
            (Quantity::Substeps, Value::Whole(value)) => substeps = value.unsigned_abs(),
            (Quantity::Effect(effect, name, axis), Value::Real(value))
                if Value::Real(value) != variable.start =>
            {
                put(&mut file.effects[effect].parameters, name, axis, value);
            }
            _ => {}
        }
    }
    Ok(Machine::new(&file, [&q, &v], substeps)?)
}

/// Writes a number into a table of parameters, or into a component of a vector in it.
fn put(table: &mut toml::Table, name: &str, axis: Option<usize>, value: f64) {
    let Some(axis) = axis else {
        table.insert(name.to_owned(), value.into());
        return;
    };
    let zero = || toml::Value::Array(vec![0.0.into(); 3]);
    if let Some(component) = table.entry(name).or_insert_with(zero).get_mut(axis) {
        *component = value.into();
    }
}
