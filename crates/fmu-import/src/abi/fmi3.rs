//! Binding of the C functions of FMI 3.0 for co-simulation.

use core::ffi::{c_char, c_int, c_void};
use std::sync::Arc;

use super::{Called, Fmi, Free, Handle, InstanceSpec, Library, Plain, Said, StartError, StepOutcome, function, text};
use crate::message::Answers;

type Instantiate = unsafe extern "C" fn(
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
    LogMessage,
    *const c_void,
) -> *mut c_void;
type LogMessage = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);
type EnterInitialization = unsafe extern "C" fn(*mut c_void, bool, f64, f64, bool, f64) -> c_int;
type SetFloat64 = unsafe extern "C" fn(*mut c_void, *const u32, usize, *const f64, usize) -> c_int;
type GetFloat64 = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut f64, usize) -> c_int;
type DoStep = unsafe extern "C" fn(*mut c_void, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64) -> c_int;

/// An instance of an FMU for FMI 3.0.
pub(crate) struct Fmi3 {
    handle: Handle,
    enter: EnterInitialization,
    exit: Plain,
    set: SetFloat64,
    get: GetFloat64,
    step: DoStep,
}

unsafe extern "C" fn log(environment: *mut c_void, status: c_int, _category: *const c_char, message: *const c_char) {
    // SAFETY: the environment that was given with this function, which lives as long as the instance.
    let said = unsafe { environment.cast::<Said>().as_ref() };
    if let Some(said) = said {
        // SAFETY: a text, as the standard states.
        said.note(status, &unsafe { text(message) });
    }
}

impl Fmi3 {
    /// Creates an instance; [`begin`](super::begin) starts its simulation. Event mode and early return are not used:
    /// the FMU handles its events itself and completes each step.
    pub fn new(library: Library, spec: &InstanceSpec<'_>, answers: Arc<Answers>) -> Result<Fmi3, StartError> {
        let instantiate = function!(library, Instantiate, c"fmi3InstantiateCoSimulation");
        let enter = function!(library, EnterInitialization, c"fmi3EnterInitializationMode");
        let exit = function!(library, Plain, c"fmi3ExitInitializationMode");
        let set = function!(library, SetFloat64, c"fmi3SetFloat64");
        let get = function!(library, GetFloat64, c"fmi3GetFloat64");
        let step = function!(library, DoStep, c"fmi3DoStep");
        let ends = (function!(library, Plain, c"fmi3Terminate"), function!(library, Free, c"fmi3FreeInstance"));
        let said = Box::new(Said(answers));
        let environment = core::ptr::from_ref(&*said).cast_mut().cast();
        // SAFETY: texts, no intermediate variables, and what `log` expects.
        let pointer = unsafe {
            instantiate(
                c"structure".as_ptr(),
                spec.token.as_ptr(),
                spec.resources.as_ptr(),
                // visible, loggingOn, eventModeUsed and earlyReturnAllowed.
                false,
                false,
                false,
                false,
                core::ptr::null(),
                0,
                environment,
                log,
                core::ptr::null(),
            )
        };
        let handle = Handle::new(pointer, "fmi3InstantiateCoSimulation", said, ends, library)?;
        Ok(Fmi3 { handle, enter, exit, set, get, step })
    }
}

impl Fmi for Fmi3 {
    fn set(&mut self, references: &[u32], values: &[f64]) -> Called {
        let names = references.as_ptr();
        let count = references.len();
        // SAFETY: an instance, and arrays of the stated lengths.
        let status = unsafe { (self.set)(self.handle.pointer, names, count, values.as_ptr(), values.len()) };
        self.handle.called("fmi3SetFloat64", status)
    }

    fn get(&mut self, references: &[u32], values: &mut [f64]) -> Called {
        let names = references.as_ptr();
        let count = references.len();
        // SAFETY: as above.
        let status = unsafe { (self.get)(self.handle.pointer, names, count, values.as_mut_ptr(), values.len()) };
        self.handle.called("fmi3GetFloat64", status)
    }

    fn enter_initialization(&mut self) -> Called {
        // SAFETY: an instance.
        let status = unsafe { (self.enter)(self.handle.pointer, false, 0.0, 0.0, false, 0.0) };
        self.handle.called("fmi3EnterInitializationMode", status)
    }

    fn exit_initialization(&mut self) -> Called {
        // SAFETY: an instance.
        let status = unsafe { (self.exit)(self.handle.pointer) };
        self.handle.called("fmi3ExitInitializationMode", status)
    }

    fn step(&mut self, from_s: f64, step_s: f64) -> StepOutcome {
        let mut event = false;
        let mut terminates = false;
        let mut early = false;
        let mut reached_s = f64::NAN;
        let pointer = self.handle.pointer;
        // SAFETY: an instance, and four variables to write to.
        let status = unsafe {
            (self.step)(pointer, from_s, step_s, true, &mut event, &mut terminates, &mut early, &mut reached_s)
        };
        StepOutcome { called: self.handle.called("fmi3DoStep", status), terminates, reached_s: Some(reached_s) }
    }

    fn handle(&mut self) -> &mut Handle {
        &mut self.handle
    }
}
