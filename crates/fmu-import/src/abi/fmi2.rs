//! Binding of the C functions of FMI 2.0 for co-simulation.

use core::ffi::{CStr, c_char, c_int, c_void};
use std::ffi::CString;
use std::sync::Arc;

use super::{Called, Fmi, Free, Handle, InstanceSpec, Library, Plain, Said, StartError, StepOutcome, function, text};
use crate::message::Answers;

/// Value `fmi2CoSimulation` of `fmi2Type`.
const CO_SIMULATION: c_int = 1;
/// Values of `fmi2Boolean`: false here, true in the next constant.
const FALSE: c_int = 0;
const TRUE: c_int = 1;
/// `fmi2DoStepStatus`, `fmi2LastSuccessfulTime` and `fmi2Terminated` of `fmi2StatusKind`.
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;
/// Value `fmi2Discard` of `fmi2Status`: the step was not completed.
const DISCARD: c_int = 2;

/// Struct `fmi2CallbackFunctions` of the standard.
#[repr(C)]
struct Callbacks {
    /// Takes further arguments as `printf` does. They are not read: on x86-64 and AArch64 Linux the named arguments
    /// are where a function without further ones expects them.
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
type SetReal = unsafe extern "C" fn(*mut c_void, *const u32, usize, *const f64) -> c_int;
type GetReal = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut f64) -> c_int;
type DoStep = unsafe extern "C" fn(*mut c_void, f64, f64, c_int) -> c_int;
type GetRealStatus = unsafe extern "C" fn(*mut c_void, c_int, *mut f64) -> c_int;
type GetBooleanStatus = unsafe extern "C" fn(*mut c_void, c_int, *mut c_int) -> c_int;

/// An instance of an FMU for FMI 2.0.
pub(crate) struct Fmi2 {
    /// The first field, so that it is dropped first: until the instance is freed it may use the callbacks.
    handle: Handle,
    _callbacks: Box<Callbacks>,
    setup: Setup,
    enter: Plain,
    exit: Plain,
    set: SetReal,
    get: GetReal,
    step: DoStep,
    real_status: GetRealStatus,
    boolean_status: GetBooleanStatus,
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
    /// Creates an instance; [`begin`](super::begin) starts its simulation.
    pub fn new(library: Library, spec: &InstanceSpec<'_>, answers: Arc<Answers>) -> Result<Fmi2, StartError> {
        let instantiate = function!(library, Instantiate, c"fmi2Instantiate");
        let setup = function!(library, Setup, c"fmi2SetupExperiment");
        let enter = function!(library, Plain, c"fmi2EnterInitializationMode");
        let exit = function!(library, Plain, c"fmi2ExitInitializationMode");
        let set = function!(library, SetReal, c"fmi2SetReal");
        let get = function!(library, GetReal, c"fmi2GetReal");
        let step = function!(library, DoStep, c"fmi2DoStep");
        let real_status = function!(library, GetRealStatus, c"fmi2GetRealStatus");
        let boolean_status = function!(library, GetBooleanStatus, c"fmi2GetBooleanStatus");
        let ends = (function!(library, Plain, c"fmi2Terminate"), function!(library, Free, c"fmi2FreeInstance"));
        let said = Box::new(Said(answers));
        let environment = core::ptr::from_ref(&*said).cast_mut().cast();
        let callbacks = Box::new(Callbacks {
            logger: log,
            allocate: libc::calloc,
            free: libc::free,
            step_finished: core::ptr::null(),
            environment,
        });
        let resources = uri(spec.resources);
        let name = c"structure".as_ptr();
        let token = spec.token.as_ptr();
        // SAFETY: texts, and functions that live as long as the instance.
        let pointer =
            unsafe { instantiate(name, CO_SIMULATION, token, resources.as_ptr(), &raw const *callbacks, FALSE, FALSE) };
        let handle = Handle::new(pointer, "fmi2Instantiate", said, ends, library)?;
        Ok(Fmi2 { handle, _callbacks: callbacks, setup, enter, exit, set, get, step, real_status, boolean_status })
    }
}

impl Fmi for Fmi2 {
    fn set(&mut self, references: &[u32], values: &[f64]) -> Called {
        let count = references.len().min(values.len());
        // SAFETY: an instance, and arrays of one length: FMI 2 has no arrays.
        let status = unsafe { (self.set)(self.handle.pointer, references.as_ptr(), count, values.as_ptr()) };
        self.handle.called("fmi2SetReal", status)
    }

    fn get(&mut self, references: &[u32], values: &mut [f64]) -> Called {
        let count = references.len().min(values.len());
        // SAFETY: as above.
        let status = unsafe { (self.get)(self.handle.pointer, references.as_ptr(), count, values.as_mut_ptr()) };
        self.handle.called("fmi2GetReal", status)
    }

    fn enter_initialization(&mut self) -> Called {
        // SAFETY: an instance, here and below.
        let status = unsafe { (self.setup)(self.handle.pointer, FALSE, 0.0, 0.0, FALSE, 0.0) };
        let called = self.handle.called("fmi2SetupExperiment", status);
        if !called.is_good() {
            return called;
        }
        // SAFETY: as above.
        let status = unsafe { (self.enter)(self.handle.pointer) };
        self.handle.called("fmi2EnterInitializationMode", status)
    }

    fn exit_initialization(&mut self) -> Called {
        // SAFETY: an instance.
        let status = unsafe { (self.exit)(self.handle.pointer) };
        self.handle.called("fmi2ExitInitializationMode", status)
    }

    /// Makes a communication step. If the FMU discards it, asks how far it came.
    fn step(&mut self, from_s: f64, step_s: f64) -> StepOutcome {
        // TRUE: no state from before this point is returned to, so the FMU need not keep one.
        // SAFETY: an instance.
        let status = unsafe { (self.step)(self.handle.pointer, from_s, step_s, TRUE) };
        let called = self.handle.called("fmi2DoStep", status);
        if status != DISCARD {
            return StepOutcome { called, terminates: false, reached_s: None };
        }
        let mut reached_s = f64::NAN;
        let mut terminated = FALSE;
        // SAFETY: an instance, and variables to write to.
        let (time, end) = unsafe {
            (
                (self.real_status)(self.handle.pointer, LAST_SUCCESSFUL_TIME, &mut reached_s),
                (self.boolean_status)(self.handle.pointer, TERMINATED, &mut terminated),
            )
        };
        let terminates = end == 0 && terminated != FALSE;
        StepOutcome { called, terminates, reached_s: (time == 0).then_some(reached_s) }
    }

    fn handle(&mut self) -> &mut Handle {
        &mut self.handle
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
