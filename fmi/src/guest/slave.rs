//! The loaded shared library of an FMU, with the C functions of FMI 2.0 and 3.0 for Co-Simulation without events.
//!
//! Loading a third-party library runs its code, and this module relies on its functions to use their pointers correctly. An FMU therefore runs in a
//! process of its own; a crash ends only that process.
#![allow(unsafe_code, reason = "the C interface of FMI: the functions of a library that was loaded")]

use std::ffi::{CString, c_char, c_int, c_void};
use std::path::Path;
use std::sync::Mutex;

use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW, Symbol};

use super::{Guest, GuestError, Version};

/// Statuses up to this one continue: OK and warning.
const WARNING: c_int = 1;

type Component = *mut c_void;
type Transfer2 = unsafe extern "C" fn(Component, *const u32, usize, *mut f64) -> c_int;
type Transfer3 = unsafe extern "C" fn(Component, *const u32, usize, *mut f64, usize) -> c_int;
type Step2 = unsafe extern "C" fn(Component, f64, f64, c_int) -> c_int;
type Step3 =
    unsafe extern "C" fn(Component, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64) -> c_int;
type Plain = unsafe extern "C" fn(Component) -> c_int;
type Free = unsafe extern "C" fn(Component);

type SetUp2 = unsafe extern "C" fn(Component, c_int, f64, f64, c_int, f64) -> c_int;
type Enter3 = unsafe extern "C" fn(Component, bool, f64, f64, bool, f64) -> c_int;
type Log3 = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);
type Instantiate2 = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const Callbacks,
    c_int,
    c_int,
) -> Component;
type Instantiate3 = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    bool,
    bool,
    *const u32,
    usize,
    *mut c_void,
    Log3,
    *const c_void,
) -> Component;

/// The functions that differ between the versions; the common ones are in [`Slave`].
#[derive(Debug)]
enum Calls {
    Two {
        instantiate: Instantiate2,
        set_up: SetUp2,
        enter: Plain,
        get: Transfer2,
        set: Transfer2,
        step: Step2,
    },
    Three {
        instantiate: Instantiate3,
        enter: Enter3,
        get: Transfer3,
        set: Transfer3,
        step: Step3,
    },
}

impl Calls {
    fn of(library: &Library, version: Version) -> Result<Calls, GuestError> {
        Ok(match version {
            Version::Two => Calls::Two {
                instantiate: function(library, "fmi2Instantiate")?,
                set_up: function(library, "fmi2SetupExperiment")?,
                enter: function(library, "fmi2EnterInitializationMode")?,
                get: function(library, "fmi2GetReal")?,
                set: function(library, "fmi2SetReal")?,
                step: function(library, "fmi2DoStep")?,
            },
            Version::Three => Calls::Three {
                instantiate: function(library, "fmi3InstantiateCoSimulation")?,
                enter: function(library, "fmi3EnterInitializationMode")?,
                get: function(library, "fmi3GetFloat64")?,
                set: function(library, "fmi3SetFloat64")?,
                step: function(library, "fmi3DoStep")?,
            },
        })
    }

    /// Creates an instance for Co-Simulation, without events and intermediate variables; null if the FMU refuses. `given` contains name, token and
    /// resources. The FMU may access them and the `callbacks` as long as it lives.
    fn instantiate(&self, given: &[CString; 3], callbacks: &Callbacks) -> Component {
        /// `fmi2CoSimulation`.
        const CO_SIMULATION: c_int = 1;
        let [name, token, resources] = given.each_ref().map(|text| text.as_ptr());
        let (nobody, nothing) = (std::ptr::null_mut(), std::ptr::null());
        // SAFETY: FMI 2.0, fmi2Instantiate, and FMI 3.0, fmi3InstantiateCoSimulation; the caller keeps strings and callbacks as long as the instance.
        unsafe {
            match self {
                Calls::Two { instantiate, .. } => {
                    instantiate(name, CO_SIMULATION, token, resources, callbacks, 0, 0)
                }
                Calls::Three { instantiate, .. } => instantiate(
                    name,
                    token,
                    resources,
                    false,
                    false,
                    false,
                    false,
                    std::ptr::null(),
                    0,
                    nobody,
                    log3,
                    nothing,
                ),
            }
        }
    }

    /// Starts the initialisation at 0 s.
    fn enter(&self, component: Component) -> Result<(), GuestError> {
        // SAFETY: the component lives, and the calls are in FMI's order.
        unsafe {
            match self {
                Calls::Two { set_up, enter, .. } => {
                    ok("to set up an experiment", set_up(component, 0, 0.0, 0.0, 0, 0.0))?;
                    ok("to begin its initialization", enter(component))
                }
                Calls::Three { enter, .. } => {
                    ok("to begin its initialization", enter(component, false, 0.0, 0.0, false, 0.0))
                }
            }
        }
    }
}

/// `fmi2CallbackFunctions`.
#[repr(C)]
#[derive(Debug)]
struct Callbacks {
    logger: unsafe extern "C" fn(Component, *const c_char, c_int, *const c_char, *const c_char),
    allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free: unsafe extern "C" fn(*mut c_void),
    step_finished: Option<unsafe extern "C" fn(Component, c_int)>,
    environment: *mut c_void,
}

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(pointer: *mut c_void);
}

/// The last message of the FMU; a process has only one FMU.
static SAID: Mutex<String> = Mutex::new(String::new());

fn said() -> String {
    SAID.lock().map(|said| said.clone()).unwrap_or_default()
}

fn keep(message: *const c_char) {
    if message.is_null() {
        return;
    }
    // SAFETY: messages of FMI are null-terminated.
    let text = unsafe { std::ffi::CStr::from_ptr(message) }.to_string_lossy();
    if let Ok(mut said) = SAID.lock() {
        said.clear();
        said.extend(text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(400));
    }
}

/// `fmi2CallbackLogger`: the function ignores the format arguments after the message.
unsafe extern "C" fn log2(
    _: Component,
    _: *const c_char,
    _: c_int,
    _: *const c_char,
    message: *const c_char,
) {
    keep(message);
}

/// `fmi3LogMessageCallback`.
unsafe extern "C" fn log3(_: *mut c_void, _: c_int, _: *const c_char, message: *const c_char) {
    keep(message);
}

/// A running FMU.
#[derive(Debug)]
pub struct Slave {
    component: Component,
    calls: Calls,
    terminate: Plain,
    free_instance: Free,
    /// Strings and callbacks of the FMU, which it may access as long as it lives.
    _given: ([CString; 3], Box<Callbacks>),
    /// The last field, so that the code outlives the instance.
    _library: Library,
}

// SAFETY: one thread at a time uses an FMU, as FMI requires; it may be any thread.
unsafe impl Send for Slave {}

fn ok(call: &'static str, status: c_int) -> Result<(), GuestError> {
    if status <= WARNING { Ok(()) } else { Err(GuestError::Refused { call, status, said: said() }) }
}

/// The function called `name`.
fn function<T: Copy>(library: &Library, name: &str) -> Result<T, GuestError> {
    // SAFETY: the type is that of FMI's header for this name.
    let symbol: Result<Symbol<T>, _> = unsafe { library.get(name.as_bytes()) };
    symbol.map(|symbol| *symbol).map_err(|_| GuestError::Library {
        said: format!("it has no function {name}"),
        remedy: "export the FMU again",
    })
}

/// Error for a library that cannot be loaded. A library made by Python needs symbols of the interpreter and expects its importer to provide them.
fn unusable(error: &libloading::Error) -> GuestError {
    let said = error.to_string();
    let remedy = match said.contains("undefined symbol: _Py") || said.contains("undefined symbol: Py") {
        true => "name Python's own library, such as libpython3.13.so, in FREEPLAY_FMU_PRELOAD",
        false => {
            "export the FMU for this machine, and install the libraries that it needs; FREEPLAY_FMU_PRELOAD names a library to load before it"
        }
    };
    GuestError::Library { said, remedy }
}

/// Loads the library that the user names, if there is one, globally for all later libraries. It stays loaded.
fn preload() -> Result<(), GuestError> {
    let Some(path) = std::env::var_os("FREEPLAY_FMU_PRELOAD") else { return Ok(()) };
    // SAFETY: the user requested to load this library; see the top of this file.
    let library = unsafe { Library::open(Some(&path), RTLD_NOW | RTLD_GLOBAL) };
    std::mem::forget(library.map_err(|error| unusable(&error))?);
    Ok(())
}

fn string(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

impl Slave {
    /// Creates the FMU `guest` from its library `path` and its resources in `resources`, initialised and ready to step from 0 s.
    pub(super) fn start(guest: &Guest, path: &Path, resources: &Path) -> Result<Slave, GuestError> {
        preload()?;
        // SAFETY: the user requested to run this library; see the top of this file. Its symbols are resolved at once, so that a missing one is an error
        // here instead of a crash at the first call.
        let library = unsafe { Library::open(Some(path), RTLD_NOW) };
        let library = library.map_err(|error| unusable(&error))?;
        let (prefix, resources) = match guest.version {
            Version::Two => ("fmi2", format!("file://{}", resources.display())),
            Version::Three => ("fmi3", format!("{}/", resources.display())),
        };
        let calls = Calls::of(&library, guest.version)?;
        let plain = |name: &str| function::<Plain>(&library, &format!("{prefix}{name}"));
        let (exit, terminate) = (plain("ExitInitializationMode")?, plain("Terminate")?);
        let free_instance = function(&library, &format!("{prefix}FreeInstance"))?;
        let given = ["controller", guest.token.as_str(), resources.as_str()].map(string);
        let callbacks = Box::new(Callbacks {
            logger: log2,
            allocate: calloc,
            free,
            step_finished: None,
            environment: std::ptr::null_mut(),
        });
        let component = calls.instantiate(&given, &callbacks);
        if component.is_null() {
            return Err(GuestError::Refused { call: "its instantiation", status: 3, said: said() });
        }
        let _given = (given, callbacks);
        let slave = Slave { component, calls, terminate, free_instance, _given, _library: library };
        slave.calls.enter(component)?;
        // SAFETY: the component lives, and is in its initialisation mode.
        ok("to end its initialization", unsafe { exit(component) })?;
        Ok(slave)
    }

    /// Sets the inputs `references` to `values`.
    ///
    /// # Errors
    /// [`GuestError::Refused`]
    pub fn set(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), GuestError> {
        let (count, values) = (references.len().min(values.len()), values.as_mut_ptr());
        // SAFETY: both lists contain `count` elements.
        let status = unsafe {
            match self.calls {
                Calls::Two { set, .. } => set(self.component, references.as_ptr(), count, values),
                Calls::Three { set, .. } => set(self.component, references.as_ptr(), count, values, count),
            }
        };
        ok("to take its inputs", status)
    }

    /// Reads the outputs `references` into `values`.
    ///
    /// # Errors
    /// [`GuestError::Refused`]
    pub fn get(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), GuestError> {
        let (count, values) = (references.len().min(values.len()), values.as_mut_ptr());
        // SAFETY: both lists contain `count` elements.
        let status = unsafe {
            match self.calls {
                Calls::Two { get, .. } => get(self.component, references.as_ptr(), count, values),
                Calls::Three { get, .. } => get(self.component, references.as_ptr(), count, values, count),
            }
        };
        ok("to give its outputs", status)
    }

    /// Steps from the time `from` by `step`, s.
    ///
    /// # Errors
    /// [`GuestError::Refused`]
    pub fn step(&mut self, from: f64, step: f64) -> Result<(), GuestError> {
        let (mut event, mut end, mut early, mut last) = (false, false, false, 0.0);
        // SAFETY: the component lives, and the results are valid targets.
        let status = unsafe {
            match self.calls {
                Calls::Two { step: go, .. } => go(self.component, from, step, 1),
                Calls::Three { step: go, .. } => go(
                    self.component,
                    from,
                    step,
                    true,
                    &raw mut event,
                    &raw mut end,
                    &raw mut early,
                    &raw mut last,
                ),
            }
        };
        ok("its step", if early || end { 2 } else { status })
    }
}

impl Drop for Slave {
    fn drop(&mut self) {
        // SAFETY: the component lives until here, and is freed once.
        unsafe {
            (self.terminate)(self.component);
            (self.free_instance)(self.component);
        }
    }
}
