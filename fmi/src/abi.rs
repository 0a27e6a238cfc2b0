//! The C functions of FMI 3.0 (`fmi3Functions.h`) over an [`Instance`].
//!
//! This module and that of a guest's library are the only places with `unsafe`: an importer passes raw pointers, and FMI defines their targets.
//! Every function checks for null, takes lengths from the importer as FMI requires, catches panics at the border, and reports errors through the
//! importer's callback.
//!
//! As FMI requires, the library exports the functions of Model Exchange, Scheduled Execution, clocks, and types without a variable; they return an
//! error.
#![allow(unsafe_code, reason = "the C interface of FMI: raw pointers come from the importer")]
#![allow(clippy::missing_safety_doc, reason = "FMI 3.0 says what each function may be given")]

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use freeplay_model::parse_toml;

use crate::description::token;
use crate::fault::Fault;
use crate::instance::Instance;
use crate::package::MODEL;
use crate::state::State;
use crate::variables::Value;

/// `fmi3Status`.
type Status = c_int;
const OK: Status = 0;
const ERROR: Status = 3;
const FATAL: Status = 4;

/// `fmi3LogMessageCallback`.
type LogMessage = Option<unsafe extern "C" fn(*mut c_void, Status, *const c_char, *const c_char)>;

/// Target of an `fmi3Instance`.
pub struct Handle {
    instance: Instance,
    environment: *mut c_void,
    log: LogMessage,
}

impl Handle {
    fn say(&self, words: &str) {
        say(self.log, self.environment, words);
    }
}

fn say(log: LogMessage, environment: *mut c_void, words: &str) {
    let text = CString::new(words.replace('\0', " ")).unwrap_or_default();
    if let Some(log) = log {
        // SAFETY: the importer gave the callback and its environment at instantiation; both strings are null-terminated and live during the call.
        unsafe { log(environment, ERROR, c"logStatusError".as_ptr(), text.as_ptr()) };
    }
}

/// Runs `call` on the instance at `pointer`; a fault is logged, a panic is fatal.
fn with(pointer: *mut Handle, call: impl FnOnce(&mut Instance) -> Result<(), Fault>) -> Status {
    // SAFETY: FMI passes the pointer that an instantiation returned, and never after it was freed.
    let Some(handle) = (unsafe { pointer.as_mut() }) else { return ERROR };
    match catch_unwind(AssertUnwindSafe(|| call(&mut handle.instance))) {
        Ok(Ok(())) => OK,
        Ok(Err(fault)) => {
            handle.say(&fault.to_string());
            ERROR
        }
        Err(_) => {
            handle.say("an internal fault; the instance can't be used any more");
            FATAL
        }
    }
}

/// The text at `pointer`; empty for null.
fn text<'a>(pointer: *const c_char) -> std::borrow::Cow<'a, str> {
    if pointer.is_null() {
        return "".into();
    }
    // SAFETY: FMI's strings are null-terminated.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy()
}

/// The `count` values at `pointer`; empty for null.
fn slice<'a, T>(pointer: *const T, count: usize) -> &'a [T] {
    if pointer.is_null() || count == 0 {
        return &[];
    }
    // SAFETY: FMI guarantees `count` values at the pointer.
    unsafe { std::slice::from_raw_parts(pointer, count) }
}

/// The `count` mutable values at `pointer`; empty for null.
fn slice_mut<'a, T>(pointer: *mut T, count: usize) -> &'a mut [T] {
    if pointer.is_null() || count == 0 {
        return &mut [];
    }
    // SAFETY: FMI guarantees room for `count` values, which no other code accesses during the call.
    unsafe { std::slice::from_raw_parts_mut(pointer, count) }
}

/// Writes `value` to `pointer` unless it is null.
fn write<T>(pointer: *mut T, value: T) {
    if !pointer.is_null() {
        // SAFETY: FMI's pointers to results are valid for the call.
        unsafe { pointer.write(value) };
    }
}

/// `fmi3GetVersion`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// `fmi3InstantiateCoSimulation`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    token_given: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    event_mode: bool,
    _early_return: bool,
    _intermediate: *const u32,
    _intermediates: usize,
    environment: *mut c_void,
    log: LogMessage,
    _intermediate_update: *const c_void,
) -> *mut Handle {
    let made = catch_unwind(|| instance(&text(token_given), Path::new(&*text(resources)), event_mode));
    match made.unwrap_or_else(|_| Err("an internal fault".to_owned())) {
        Ok(instance) => Box::into_raw(Box::new(Handle { instance, environment, log })),
        Err(words) => {
            say(log, environment, &words);
            std::ptr::null_mut()
        }
    }
}

fn instance(token_given: &str, resources: &Path, event_mode: bool) -> Result<Instance, String> {
    if event_mode {
        return Err("this FMU has no event mode and no early return: instantiate it without them".to_owned());
    }
    let path = resources.join(MODEL);
    let model = freeplay_storage::read_text(&path).map_err(|error| error.to_string())?;
    if token_given != token(&model) {
        return Err("the instantiation token is not that of this FMU: description, library and resources belong to different ones".to_owned());
    }
    let file = parse_toml(&model, &path).map_err(|error| error.to_string())?;
    Instance::new(file).map_err(|error| error.to_string())
}

/// `fmi3FreeInstance`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(handle: *mut Handle) {
    if !handle.is_null() {
        // SAFETY: the pointer comes from an instantiation, and the importer frees it once.
        drop(unsafe { Box::from_raw(handle) });
    }
}

/// `fmi3SetDebugLogging`: errors are always logged.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3SetDebugLogging(
    handle: *mut Handle,
    _on: bool,
    _count: usize,
    _categories: *const *const c_char,
) -> Status {
    with(handle, |_| Ok(()))
}

/// `fmi3EnterInitializationMode`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3EnterInitializationMode(
    handle: *mut Handle,
    _has_tolerance: bool,
    _tolerance: f64,
    start: f64,
    _has_stop: bool,
    _stop: f64,
) -> Status {
    with(handle, |instance| instance.enter_initialization(start))
}

/// `fmi3ExitInitializationMode`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3ExitInitializationMode(handle: *mut Handle) -> Status {
    with(handle, Instance::exit_initialization)
}

/// `fmi3Terminate`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3Terminate(handle: *mut Handle) -> Status {
    with(handle, Instance::terminate)
}

/// `fmi3Reset`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3Reset(handle: *mut Handle) -> Status {
    with(handle, |instance| {
        instance.reset();
        Ok(())
    })
}

/// `fmi3DoStep`: a step is complete or not made at all; there is no early return.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3DoStep(
    handle: *mut Handle,
    from: f64,
    step: f64,
    _no_state_before: bool,
    event: *mut bool,
    terminate: *mut bool,
    early_return: *mut bool,
    last: *mut f64,
) -> Status {
    [event, terminate, early_return].into_iter().for_each(|flag| write(flag, false));
    with(handle, |instance| {
        let stepped = instance.step(from, step);
        write(last, instance.time());
        stepped
    })
}

/// Gets values of one type.
fn get<T>(
    handle: *mut Handle,
    references: *const u32,
    [number, room]: [usize; 2],
    values: *mut T,
    take: impl Fn(Value) -> Option<T>,
) -> Status {
    let (references, values) = (slice(references, number), slice_mut(values, room));
    with(handle, |instance| {
        for (place, &reference) in references.iter().enumerate() {
            let value = take(instance.get(reference)?).ok_or(Fault::Reference(reference))?;
            *values.get_mut(place).ok_or(Fault::Reference(reference))? = value;
        }
        Ok(())
    })
}

/// Sets values of one type.
fn set<T: Copy>(
    handle: *mut Handle,
    references: *const u32,
    [number, given]: [usize; 2],
    values: *const T,
    make: impl Fn(T) -> Value,
) -> Status {
    let (references, values) = (slice(references, number), slice(values, given));
    with(handle, |instance| {
        for (place, &reference) in references.iter().enumerate() {
            let value = values.get(place).ok_or(Fault::Reference(reference))?;
            instance.set(reference, make(*value))?;
        }
        Ok(())
    })
}

/// Exports getter and setter of a type used by variables.
macro_rules! typed {
    ($get:ident, $set:ident, $type:ty, $variant:ident) => {
        #[doc = stringify!($get)]
        #[unsafe(no_mangle)]
        pub extern "C" fn $get(
            handle: *mut Handle,
            references: *const u32,
            number: usize,
            values: *mut $type,
            room: usize,
        ) -> Status {
            get(handle, references, [number, room], values, |value| match value {
                Value::$variant(value) => Some(value),
                _ => None,
            })
        }

        #[doc = stringify!($set)]
        #[unsafe(no_mangle)]
        pub extern "C" fn $set(
            handle: *mut Handle,
            references: *const u32,
            number: usize,
            values: *const $type,
            given: usize,
        ) -> Status {
            set(handle, references, [number, given], values, Value::$variant)
        }
    };
}

typed!(fmi3GetFloat64, fmi3SetFloat64, f64, Real);
typed!(fmi3GetInt32, fmi3SetInt32, i32, Whole);
typed!(fmi3GetBoolean, fmi3SetBoolean, bool, Truth);

/// `fmi3GetFMUState`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetFMUState(handle: *mut Handle, state: *mut *mut State) -> Status {
    with(handle, |instance| {
        // SAFETY: FMI passes null, or a state of this FMU to overwrite.
        match unsafe { state.as_ref().and_then(|kept| kept.as_mut()) } {
            Some(kept) => *kept = instance.fmu_state(),
            None => write(state, Box::into_raw(Box::new(instance.fmu_state()))),
        }
        Ok(())
    })
}

/// `fmi3SetFMUState`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3SetFMUState(handle: *mut Handle, state: *const State) -> Status {
    // SAFETY: FMI passes a state created by this library.
    with(handle, |instance| instance.restore(unsafe { state.as_ref() }.ok_or(Fault::NoState)?))
}

/// `fmi3FreeFMUState`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeFMUState(_handle: *mut Handle, state: *mut *mut State) -> Status {
    // SAFETY: the inner pointer is null or a state created by this library, and freed once.
    unsafe {
        if let Some(kept) = state.as_mut().filter(|kept| !kept.is_null()) {
            drop(Box::from_raw(*kept));
            *kept = std::ptr::null_mut();
        }
    }
    OK
}

/// `fmi3SerializedFMUStateSize`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3SerializedFMUStateSize(
    handle: *mut Handle,
    state: *const State,
    size: *mut usize,
) -> Status {
    // SAFETY: FMI passes a state created by this library.
    with(handle, |_| {
        write(size, unsafe { state.as_ref() }.ok_or(Fault::NoState)?.size());
        Ok(())
    })
}

/// `fmi3SerializeFMUState`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3SerializeFMUState(
    handle: *mut Handle,
    state: *const State,
    bytes: *mut u8,
    size: usize,
) -> Status {
    // SAFETY: FMI passes a state created by this library.
    with(handle, |_| {
        let made = unsafe { state.as_ref() }.ok_or(Fault::NoState)?.to_bytes();
        slice_mut(bytes, size).get_mut(..made.len()).ok_or(Fault::NoState)?.copy_from_slice(&made);
        Ok(())
    })
}

/// `fmi3DeserializeFMUState`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3DeserializeFMUState(
    handle: *mut Handle,
    bytes: *const u8,
    size: usize,
    state: *mut *mut State,
) -> Status {
    with(handle, |instance| {
        let made = instance.state_of(slice(bytes, size))?;
        // SAFETY: FMI passes null, or a state of this FMU to overwrite.
        match unsafe { state.as_ref().and_then(|kept| kept.as_mut()) } {
            Some(kept) => *kept = made,
            None => write(state, Box::into_raw(Box::new(made))),
        }
        Ok(())
    })
}

/// Exports functions that this FMU does not support: other kinds of FMUs, clocks, derivatives, configuration, and types without a variable. They
/// use only their first argument and therefore declare no other.
macro_rules! refused {
    ($($name:ident)*) => { $(
        #[doc = concat!("`", stringify!($name), "`: refused, since this FMU has nothing of the sort.")]
        #[unsafe(no_mangle)]
        pub extern "C" fn $name(handle: *mut Handle) -> Status {
            // SAFETY: FMI passes a pointer of an instantiation, or null.
            if let Some(handle) = unsafe { handle.as_ref() } {
                handle.say(concat!(stringify!($name), " is not supported: modelDescription.xml names nothing that needs it"));
            }
            ERROR
        }
    )* };
}

refused! {
    fmi3GetFloat32 fmi3GetInt8 fmi3GetUInt8 fmi3GetInt16 fmi3GetUInt16 fmi3GetUInt32 fmi3GetInt64 fmi3GetUInt64 fmi3GetString fmi3GetBinary fmi3GetClock
    fmi3SetFloat32 fmi3SetInt8 fmi3SetUInt8 fmi3SetInt16 fmi3SetUInt16 fmi3SetUInt32 fmi3SetInt64 fmi3SetUInt64 fmi3SetString fmi3SetBinary fmi3SetClock
    fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies fmi3GetDirectionalDerivative fmi3GetAdjointDerivative
    fmi3EnterConfigurationMode fmi3ExitConfigurationMode fmi3EnterEventMode fmi3EnterStepMode
    fmi3GetIntervalDecimal fmi3GetIntervalFraction fmi3GetShiftDecimal fmi3GetShiftFraction
    fmi3SetIntervalDecimal fmi3SetIntervalFraction fmi3SetShiftDecimal fmi3SetShiftFraction
    fmi3EvaluateDiscreteStates fmi3UpdateDiscreteStates fmi3GetOutputDerivatives fmi3ActivateModelPartition
    fmi3EnterContinuousTimeMode fmi3CompletedIntegratorStep fmi3SetTime fmi3SetContinuousStates fmi3GetContinuousStateDerivatives
    fmi3GetEventIndicators fmi3GetContinuousStates fmi3GetNominalsOfContinuousStates fmi3GetNumberOfEventIndicators fmi3GetNumberOfContinuousStates
}

/// Exports instantiation functions of the other kinds of FMUs.
macro_rules! no_instance {
    ($($name:ident)*) => { $(
        #[doc = concat!("`", stringify!($name), "`: null, since this FMU is one for Co-Simulation.")]
        #[unsafe(no_mangle)]
        pub extern "C" fn $name() -> *mut Handle {
            std::ptr::null_mut()
        }
    )* };
}

no_instance! { fmi3InstantiateModelExchange fmi3InstantiateScheduledExecution }
