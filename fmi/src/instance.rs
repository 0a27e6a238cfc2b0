//! An instance of the FMU: its mode, its values, its steps and its states.
//!
//! A state is the parameters and everything that was put into the machine since the start. The machine is deterministic, so that this is all
//! there is to know of it, to the last bit, memories of frictions and sensors included. A state is put back by playing it again; of one that
//! continues where the machine is, only the rest is played.

use std::sync::Arc;

use freeplay_arm::ArmFile;
use freeplay_plant::SystemError;
use thiserror::Error;

use crate::machine::{Machine, PERIOD, Stimulus};
use crate::variables::{Causality, Quantity, Value, Variables};

/// Why a call is refused.
#[derive(Debug, Error)]
pub enum Fault {
    /// A call in a mode in which FMI does not allow it.
    #[error("{call} is not allowed {mode}")]
    Mode {
        /// The call.
        call: &'static str,
        /// The mode, in words.
        mode: &'static str,
    },
    /// A value reference that no variable of this type has.
    #[error("no variable of this type has the value reference {0}")]
    Reference(u32),
    /// A variable that can't be set, or not now.
    #[error("`{0}` can't be set now: inputs are set before a step, parameters before the start")]
    ReadOnly(String),
    /// A value out of its range.
    #[error("`{name}` = {value} is out of range; it must be {least:e} to {most:e}")]
    Range {
        /// The variable.
        name: String,
        /// Its value.
        value: f64,
        /// Least value.
        least: f64,
        /// Greatest value.
        most: f64,
    },
    /// A step that the fixed step does not fit into.
    #[error("a step of {0} s: the communication step must be a whole multiple of 0.001 s")]
    Step(f64),
    /// A step from another time than the machine's.
    #[error("a step from {asked} s, but the machine is at {now} s")]
    Time {
        /// The time asked for.
        asked: f64,
        /// The machine's.
        now: f64,
    },
    /// A serialised state that is none of this FMU.
    #[error("the bytes are no state of this FMU")]
    State,
    /// The machine can't be built or stepped.
    #[error(transparent)]
    Machine(#[from] SystemError),
}

/// The modes of FMI that a Co-Simulation without events has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Instantiated,
    Initialization,
    Step,
    Terminated,
}

/// A state of an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    mode: u8,
    start: f64,
    values: Vec<Value>,
    /// What was put into each step.
    played: Arc<Vec<Stimulus>>,
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
    played: Arc<Vec<Stimulus>>,
    /// Built when it is asked for; none after a parameter was set.
    machine: Option<Machine>,
}

impl Instance {
    /// An instance of the arm of `file`.
    ///
    /// # Errors
    /// [`Fault::Machine`]: effects that can't be taken.
    pub fn new(file: ArmFile) -> Result<Instance, Fault> {
        let variables = Variables::of(&file).map_err(SystemError::Law)?;
        let values = variables.0.iter().map(|variable| variable.start).collect();
        let mode = Mode::Instantiated;
        Ok(Instance { file, variables, mode, values, start: 0.0, played: Arc::default(), machine: None })
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

    /// Begins the initialization at the importer's time `start`, s.
    ///
    /// # Errors
    /// [`Fault::Mode`].
    pub fn enter_initialization(&mut self, start: f64) -> Result<(), Fault> {
        self.allow("fmi3EnterInitializationMode", &[Mode::Instantiated])?;
        (self.mode, self.start) = (Mode::Initialization, start);
        Ok(())
    }

    /// Ends the initialization: from here on the machine steps.
    ///
    /// # Errors
    /// [`Fault::Mode`], or a machine that can't be.
    pub fn exit_initialization(&mut self) -> Result<(), Fault> {
        self.allow("fmi3ExitInitializationMode", &[Mode::Initialization])?;
        self.machine()?;
        self.mode = Mode::Step;
        Ok(())
    }

    /// Ends the simulation; values can still be read.
    ///
    /// # Errors
    /// [`Fault::Mode`].
    pub fn terminate(&mut self) -> Result<(), Fault> {
        self.allow("fmi3Terminate", &[Mode::Step])?;
        self.mode = Mode::Terminated;
        Ok(())
    }

    /// Everything as it was when the instance was made.
    pub fn reset(&mut self) {
        self.values = self.variables.0.iter().map(|variable| variable.start).collect();
        (self.mode, self.start, self.played, self.machine) = (Mode::Instantiated, 0.0, Arc::default(), None);
    }

    /// The importer's time, s.
    pub fn time(&self) -> f64 {
        self.start + self.played.len() as f64 * PERIOD
    }

    /// The value of the variable `reference`.
    ///
    /// # Errors
    /// [`Fault::Reference`], or a machine that can't be.
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
        Ok(())
    }

    /// Steps from the time `from` by `step`, s, a whole multiple of [`PERIOD`].
    ///
    /// # Errors
    /// [`Fault::Mode`], [`Fault::Time`], [`Fault::Step`], or a motion that can't be integrated.
    pub fn step(&mut self, from: f64, step: f64) -> Result<(), Fault> {
        /// Share of a step by which an importer's sums of steps may be off.
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
        let stimulus = self.stimulus();
        for _ in 0..ticks as u64 {
            self.machine()?.step(&stimulus)?;
            Arc::make_mut(&mut self.played).push(stimulus.clone());
        }
        Ok(())
    }

    /// The inputs as they stand.
    fn stimulus(&self) -> Stimulus {
        let mut stimulus = Stimulus { torque: vec![0.0; self.file.arm.dof()], brakes: false };
        for (variable, value) in self.variables.0.iter().zip(&self.values) {
            match (variable.quantity, value) {
                (Quantity::Torque(joint), Value::Real(torque)) => stimulus.torque[joint] = *torque,
                (Quantity::Brakes, Value::Truth(brakes)) => stimulus.brakes = *brakes,
                _ => {}
            }
        }
        stimulus
    }

    /// The machine, built and played up to now if it is not there.
    fn machine(&mut self) -> Result<&mut Machine, Fault> {
        let machine = match self.machine.take() {
            Some(machine) => machine,
            None => self.build()?,
        };
        Ok(self.machine.insert(machine))
    }

    fn build(&self) -> Result<Machine, Fault> {
        let dof = self.file.arm.dof();
        let (mut file, mut q, mut v, mut substeps) = (self.file.clone(), vec![0.0; dof], vec![0.0; dof], 1);
        for (variable, value) in self.variables.0.iter().zip(&self.values) {
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
        let mut machine = Machine::new(&file, [&q, &v], substeps)?;
        for stimulus in self.played.iter() {
            machine.step(stimulus)?;
        }
        Ok(machine)
    }

    /// The state now.
    pub fn state(&self) -> State {
        State {
            mode: self.mode as u8,
            start: self.start,
            values: self.values.clone(),
            played: Arc::clone(&self.played),
        }
    }

    /// Puts `state` back.
    ///
    /// # Errors
    /// [`Fault::State`] for one of another FMU, or a machine that can't be.
    pub fn restore(&mut self, state: &State) -> Result<(), Fault> {
        let modes = [Mode::Instantiated, Mode::Initialization, Mode::Step, Mode::Terminated];
        let mode = *modes.get(usize::from(state.mode)).ok_or(Fault::State)?;
        if state.values.len() != self.values.len() {
            return Err(Fault::State);
        }
        let is_parameter = |index: &usize| self.variables.0[*index].causality == Causality::Parameter;
        let same = (0..self.values.len())
            .filter(is_parameter)
            .all(|index| self.values[index] == state.values[index]);
        let continues = same && state.played.starts_with(&self.played);
        let before = self.played.len();
        (self.mode, self.start) = (mode, state.start);
        self.values.clone_from(&state.values);
        self.played = Arc::clone(&state.played);
        if !continues {
            self.machine = None;
        } else if let Some(machine) = &mut self.machine {
            for stimulus in &self.played[before..] {
                machine.step(stimulus)?;
            }
        }
        Ok(())
    }
}

/// Puts a number into a table of parameters, or into a component of a vector of it.
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

/// First bytes of a serialised state.
const MAGIC: &[u8; 8] = b"fpstate1";

impl State {
    /// The state as bytes, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        let mut put = |word: u64| bytes.extend_from_slice(&word.to_le_bytes());
        let joints = self.played.first().map_or(0, |first| first.torque.len());
        put(u64::from(self.mode));
        put(self.start.to_bits());
        [self.values.len(), self.played.len(), joints].into_iter().for_each(|count| put(count as u64));
        for value in &self.values {
            let (kind, word) = match value {
                Value::Real(number) => (0, number.to_bits()),
                Value::Whole(number) => (1, u64::from(number.cast_unsigned())),
                Value::Truth(truth) => (2, u64::from(*truth)),
            };
            [kind, word].into_iter().for_each(&mut put);
        }
        for stimulus in self.played.iter() {
            put(u64::from(stimulus.brakes));
            stimulus.torque.iter().for_each(|torque| put(torque.to_bits()));
        }
        bytes
    }

    /// The state of [`State::to_bytes`].
    ///
    /// # Errors
    /// [`Fault::State`] for other bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<State, Fault> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(Fault::State)?;
        let (chunks, left) = rest.as_chunks::<8>();
        let mut words = chunks.iter().map(|chunk| u64::from_le_bytes(*chunk));
        let mut next = || words.next().ok_or(Fault::State);
        let (mode, start) = (u8::try_from(next()?).map_err(|_| Fault::State)?, f64::from_bits(next()?));
        let [values, played, joints] = [next()?, next()?, next()?].map(|count| count as usize);
        let expected = played.checked_mul(joints + 1).and_then(|all| all.checked_add(values.checked_mul(2)?));
        if !left.is_empty() || expected != Some(chunks.len().saturating_sub(5)) {
            return Err(Fault::State);
        }
        let value = |(kind, word): (u64, u64)| match kind {
            0 => Ok(Value::Real(f64::from_bits(word))),
            1 => u32::try_from(word).map(|word| Value::Whole(word.cast_signed())).map_err(|_| Fault::State),
            2 => Ok(Value::Truth(word == 1)),
            _ => Err(Fault::State),
        };
        let values = (0..values).map(|_| value((next()?, next()?))).collect::<Result<_, _>>()?;
        let mut stimulus = || {
            let brakes = next()? == 1;
            let torque = (0..joints).map(|_| next().map(f64::from_bits)).collect::<Result<_, _>>()?;
            Ok::<_, Fault>(Stimulus { torque, brakes })
        };
        let played = (0..played).map(|_| stimulus()).collect::<Result<Vec<_>, _>>()?;
        Ok(State { mode, start, values, played: Arc::new(played) })
    }
}
