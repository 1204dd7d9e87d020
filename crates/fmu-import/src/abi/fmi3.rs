//! FMI 3.0.

use core::ffi::{c_char, c_int, c_void};

use super::{End, Library, Made, Said, Stepped, check, function, text};
use crate::ImportError;

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
type Plain = unsafe extern "C" fn(*mut c_void) -> c_int;
type Free = unsafe extern "C" fn(*mut c_void);
type SetFloat64 = unsafe extern "C" fn(*mut c_void, *const u32, usize, *const f64, usize) -> c_int;
type GetFloat64 = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut f64, usize) -> c_int;
type DoStep = unsafe extern "C" fn(*mut c_void, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64) -> c_int;

/// An instance.
pub(crate) struct Fmi3 {
    instance: *mut c_void,
    set: SetFloat64,
    get: GetFloat64,
    step: DoStep,
    terminate: Plain,
    free: Free,
    said: Box<Said>,
    end: End,
    /// Dropped last.
    library: Option<Library>,
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
    /// An instance at time 0 of the simulation. It handles its events itself: event mode is not asked for, nor that it
    /// may return early.
    pub fn new(library: Library, made: &Made<'_>) -> Result<Fmi3, ImportError> {
        let instantiate = function!(library, Instantiate, c"fmi3InstantiateCoSimulation");
        let enter = function!(library, EnterInitialization, c"fmi3EnterInitializationMode");
        let exit = function!(library, Plain, c"fmi3ExitInitializationMode");
        let set = function!(library, SetFloat64, c"fmi3SetFloat64");
        let get = function!(library, GetFloat64, c"fmi3GetFloat64");
        let step = function!(library, DoStep, c"fmi3DoStep");
        let terminate = function!(library, Plain, c"fmi3Terminate");
        let free = function!(library, Free, c"fmi3FreeInstance");
        let said = Box::new(Said::default());
        let environment = core::ptr::from_ref(&*said).cast_mut().cast();
        // SAFETY: texts, no intermediate variables, and what `log` expects.
        let instance = unsafe {
            instantiate(
                c"structure".as_ptr(),
                made.token.as_ptr(),
                made.resources.as_ptr(),
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
        let call = "fmi3InstantiateCoSimulation";
        if instance.is_null() {
            return Err(ImportError::Call { call, status: "NULL", log: said.last() });
        }
        let mut fmu =
            Fmi3 { instance, set, get, step, terminate, free, said, end: End::default(), library: Some(library) };
        fmu.initialize(made, enter, exit)?;
        Ok(fmu)
    }

    /// Takes up parameters and inputs, and begins the simulation at 0.
    fn initialize(&mut self, made: &Made<'_>, enter: EnterInitialization, exit: Plain) -> Result<(), ImportError> {
        for (reference, values) in made.parameters {
            let status = self.set(&[*reference], values);
            check("fmi3SetFloat64", status, &self.said)?;
        }
        // SAFETY: an instance, here and below.
        let status = unsafe { enter(self.instance, false, 0.0, 0.0, false, 0.0) };
        check("fmi3EnterInitializationMode", self.end.note(status), &self.said)?;
        let (references, values) = made.inputs;
        if !references.is_empty() {
            let status = self.set(references, values);
            check("fmi3SetFloat64", status, &self.said)?;
        }
        // SAFETY: as above.
        let status = unsafe { exit(self.instance) };
        check("fmi3ExitInitializationMode", self.end.note(status), &self.said)?;
        self.end.is_running = true;
        Ok(())
    }

    /// Sets variables; arrays have several values.
    pub fn set(&mut self, references: &[u32], values: &[f64]) -> c_int {
        // SAFETY: an instance, and arrays of the stated lengths.
        let status =
            unsafe { (self.set)(self.instance, references.as_ptr(), references.len(), values.as_ptr(), values.len()) };
        self.end.note(status)
    }

    /// Reads variables; arrays have several values.
    pub fn get(&mut self, references: &[u32], values: &mut [f64]) -> c_int {
        // SAFETY: as above.
        let status = unsafe {
            (self.get)(self.instance, references.as_ptr(), references.len(), values.as_mut_ptr(), values.len())
        };
        self.end.note(status)
    }

    /// A communication step. No state from before it is returned to.
    pub fn step(&mut self, from_s: f64, step_s: f64) -> Stepped {
        let (mut event, mut terminates, mut early, mut reached_s) = (false, false, false, f64::NAN);
        // SAFETY: an instance, and four variables to write to.
        let status = unsafe {
            (self.step)(self.instance, from_s, step_s, true, &mut event, &mut terminates, &mut early, &mut reached_s)
        };
        Stepped { status: self.end.note(status), terminates, reached_s: Some(reached_s) }
    }

    /// What it has said last.
    pub fn said(&self) -> &Said {
        &self.said
    }
}

impl Drop for Fmi3 {
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
