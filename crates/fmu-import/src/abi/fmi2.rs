//! FMI 2.0.

use core::ffi::{CStr, c_char, c_int, c_void};
use std::ffi::CString;

use super::{End, Library, Made, Said, Stepped, check, function, text};
use crate::ImportError;

/// `fmi2CoSimulation`.
const CO_SIMULATION: c_int = 1;
/// `fmi2Boolean`.
const FALSE: c_int = 0;
const TRUE: c_int = 1;
/// `fmi2DoStepStatus`, `fmi2LastSuccessfulTime` and `fmi2Terminated` of `fmi2StatusKind`.
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;
/// `fmi2Discard`.
const DISCARD: c_int = 2;

/// `fmi2CallbackFunctions`.
#[repr(C)]
struct Callbacks {
    /// It takes further arguments as `printf` does. They are not read: on Linux, on both machines, those that are
    /// named are where a function without further ones expects them.
    logger: unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char),
    allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free: unsafe extern "C" fn(*mut c_void),
    step_finished: *const c_void,
    environment: *mut c_void,
}

type Instantiate = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const Callbacks,
    c_int,
    c_int,
) -> *mut c_void;
type Setup = unsafe extern "C" fn(*mut c_void, c_int, f64, f64, c_int, f64) -> c_int;
type Plain = unsafe extern "C" fn(*mut c_void) -> c_int;
type Free = unsafe extern "C" fn(*mut c_void);
type SetReal = unsafe extern "C" fn(*mut c_void, *const u32, usize, *const f64) -> c_int;
type GetReal = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut f64) -> c_int;
type DoStep = unsafe extern "C" fn(*mut c_void, f64, f64, c_int) -> c_int;
type GetRealStatus = unsafe extern "C" fn(*mut c_void, c_int, *mut f64) -> c_int;
type GetBooleanStatus = unsafe extern "C" fn(*mut c_void, c_int, *mut c_int) -> c_int;

/// An instance.
pub(crate) struct Fmi2 {
    instance: *mut c_void,
    set: SetReal,
    get: GetReal,
    step: DoStep,
    real_status: GetRealStatus,
    boolean_status: GetBooleanStatus,
    terminate: Plain,
    free: Free,
    said: Box<Said>,
    /// The instance reads them.
    _callbacks: Box<Callbacks>,
    end: End,
    /// Dropped last.
    library: Option<Library>,
}

unsafe extern "C" fn log(
    environment: *mut c_void,
    _instance: *const c_char,
    status: c_int,
    _category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the environment that was given with this function, which lives as long as the instance.
    let said = unsafe { environment.cast::<Said>().as_ref() };
    if let Some(said) = said {
        // SAFETY: a text, as the standard states.
        said.note(status, &unsafe { text(message) });
    }
}

/// The folder as a URI: `file:///…`, of which letters, digits and a few signs stand for themselves (RFC 3986).
fn uri(folder: &CStr) -> CString {
    let mut uri = b"file://".to_vec();
    for byte in folder.to_bytes().strip_suffix(b"/").unwrap_or(folder.to_bytes()) {
        if byte.is_ascii_alphanumeric() || b"/-_.~".contains(byte) {
            uri.push(*byte);
        } else {
            uri.extend(format!("%{byte:02X}").bytes());
        }
    }
    CString::new(uri).unwrap_or_default()
}

impl Fmi2 {
    /// An instance at time 0 of the simulation.
    pub fn new(library: Library, made: &Made<'_>) -> Result<Fmi2, ImportError> {
        let instantiate = function!(library, Instantiate, c"fmi2Instantiate");
        let setup = function!(library, Setup, c"fmi2SetupExperiment");
        let enter = function!(library, Plain, c"fmi2EnterInitializationMode");
        let exit = function!(library, Plain, c"fmi2ExitInitializationMode");
        let set = function!(library, SetReal, c"fmi2SetReal");
        let get = function!(library, GetReal, c"fmi2GetReal");
        let step = function!(library, DoStep, c"fmi2DoStep");
        let real_status = function!(library, GetRealStatus, c"fmi2GetRealStatus");
        let boolean_status = function!(library, GetBooleanStatus, c"fmi2GetBooleanStatus");
        let terminate = function!(library, Plain, c"fmi2Terminate");
        let free = function!(library, Free, c"fmi2FreeInstance");
        let said = Box::new(Said::default());
        let environment = core::ptr::from_ref(&*said).cast_mut().cast();
        let callbacks = Box::new(Callbacks {
            logger: log,
            allocate: libc::calloc,
            free: libc::free,
            step_finished: core::ptr::null(),
            environment,
        });
        let resources = uri(made.resources);
        let (name, token) = (c"structure".as_ptr(), made.token.as_ptr());
        // SAFETY: texts, and functions that live as long as the instance.
        let instance =
            unsafe { instantiate(name, CO_SIMULATION, token, resources.as_ptr(), &raw const *callbacks, FALSE, FALSE) };
        if instance.is_null() {
            return Err(ImportError::Call { call: "fmi2Instantiate", status: "NULL", log: said.last() });
        }
        let mut fmu = Fmi2 {
            instance,
            set,
            get,
            step,
            real_status,
            boolean_status,
            terminate,
            free,
            said,
            _callbacks: callbacks,
            end: End::default(),
            library: Some(library),
        };
        fmu.initialize(made, (setup, enter, exit))?;
        Ok(fmu)
    }

    /// Takes up parameters and inputs, and begins the simulation at 0.
    fn initialize(&mut self, made: &Made<'_>, calls: (Setup, Plain, Plain)) -> Result<(), ImportError> {
        let (setup, enter, exit) = calls;
        for (reference, values) in made.parameters {
            let status = self.set(&[*reference], values);
            check("fmi2SetReal", status, &self.said)?;
        }
        // SAFETY: an instance, here and below.
        let status = unsafe { setup(self.instance, FALSE, 0.0, 0.0, FALSE, 0.0) };
        check("fmi2SetupExperiment", self.end.note(status), &self.said)?;
        // SAFETY: as above.
        let status = unsafe { enter(self.instance) };
        check("fmi2EnterInitializationMode", self.end.note(status), &self.said)?;
        let (references, values) = made.inputs;
        if !references.is_empty() {
            let status = self.set(references, values);
            check("fmi2SetReal", status, &self.said)?;
        }
        // SAFETY: as above.
        let status = unsafe { exit(self.instance) };
        check("fmi2ExitInitializationMode", self.end.note(status), &self.said)?;
        self.end.is_running = true;
        Ok(())
    }

    /// Sets variables.
    pub fn set(&mut self, references: &[u32], values: &[f64]) -> c_int {
        // SAFETY: an instance, and arrays of one length: FMI 2 has no arrays.
        let count = references.len().min(values.len());
        let status = unsafe { (self.set)(self.instance, references.as_ptr(), count, values.as_ptr()) };
        self.end.note(status)
    }

    /// Reads variables.
    pub fn get(&mut self, references: &[u32], values: &mut [f64]) -> c_int {
        let count = references.len().min(values.len());
        // SAFETY: as above.
        let status = unsafe { (self.get)(self.instance, references.as_ptr(), count, values.as_mut_ptr()) };
        self.end.note(status)
    }

    /// A communication step. No state from before it is returned to. One that is discarded says how far it came.
    pub fn step(&mut self, from_s: f64, step_s: f64) -> Stepped {
        // SAFETY: an instance.
        let status = unsafe { (self.step)(self.instance, from_s, step_s, TRUE) };
        let status = self.end.note(status);
        let (mut reached_s, mut terminated) = (f64::NAN, FALSE);
        if status != DISCARD {
            return Stepped { status, terminates: false, reached_s: None };
        }
        // SAFETY: an instance, and variables to write to.
        let (time, end) = unsafe {
            (
                (self.real_status)(self.instance, LAST_SUCCESSFUL_TIME, &mut reached_s),
                (self.boolean_status)(self.instance, TERMINATED, &mut terminated),
            )
        };
        Stepped { status, terminates: end == 0 && terminated != FALSE, reached_s: (time == 0).then_some(reached_s) }
    }

    /// What it has said last.
    pub fn said(&self) -> &Said {
        &self.said
    }
}

impl Drop for Fmi2 {
    fn drop(&mut self) {
        // SAFETY: an instance, which nobody uses any more, in a state in which the calls are allowed.
        unsafe {
            if self.end.may_terminate() {
                (self.terminate)(self.instance);
            }
            if self.end.may_free() {
                (self.free)(self.instance);
            } else {
                core::mem::forget(self.library.take());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_a_uri() {
        assert_eq!(uri(c"/tmp/a b#/"), c"file:///tmp/a%20b%23".to_owned());
    }
}
