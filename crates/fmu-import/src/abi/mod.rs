//! The C interfaces of FMUs: their libraries and the functions that a structure needs.
//!
//! A function is called as the standard says: an instance that its library made, arrays of the stated lengths, texts
//! that end with NUL. What a library does with them can't be checked.

#![allow(unsafe_code, reason = "functions of a C interface, looked up by name in a library that is loaded")]

mod fmi2;
mod fmi3;

use core::ffi::{CStr, c_int, c_void};
use std::ffi::CString;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

pub(crate) use fmi2::Fmi2;
pub(crate) use fmi3::Fmi3;

use crate::{ImportError, float_mode};

/// A loaded library.
pub(crate) struct Library {
    handle: *mut c_void,
}

impl Library {
    /// Loads a library, with all that it needs.
    pub fn load(path: &Path) -> Result<Library, ImportError> {
        let name = CString::new(path.as_os_str().as_encoded_bytes());
        let name = name.map_err(|_| ImportError::Load { reason: "its path has a NUL".into() })?;
        // SAFETY: a text; the code that runs is the user's choice.
        let handle = float_mode::kept("loading the library", || unsafe {
            libc::dlopen(name.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL)
        })?;
        if handle.is_null() {
            // SAFETY: the text of the failed call above, on this thread.
            let reason = unsafe { text(libc::dlerror()) }.into_owned();
            return Err(ImportError::Load { reason });
        }
        Ok(Library { handle })
    }

    /// The address of a function.
    fn address(&self, name: &'static CStr) -> Result<*mut c_void, ImportError> {
        // SAFETY: a library that is loaded, and a text.
        let address = unsafe { libc::dlsym(self.handle, name.as_ptr()) };
        if address.is_null() {
            return Err(ImportError::Function { name: name.to_str().unwrap_or_default() });
        }
        Ok(address)
    }
}

impl Drop for Library {
    fn drop(&mut self) {
        // SAFETY: it was loaded, and nothing of it is used any more.
        unsafe { libc::dlclose(self.handle) };
    }
}

/// A function of a library by its name, of the type that is expected.
macro_rules! function {
    ($library:expr, $kind:ty, $name:literal) => {
        // SAFETY: the standard states the type of the function with this name.
        unsafe { core::mem::transmute::<*mut core::ffi::c_void, $kind>($library.address($name)?) }
    };
}
pub(crate) use function;

/// What an instance has said last, where its calls of the log end.
#[derive(Debug, Default)]
pub(crate) struct Said(Mutex<Option<String>>);

impl Said {
    /// Notes a message, of a status as the standards number them, 1 a warning and from 2 on errors.
    fn note(&self, status: c_int, text: &str) {
        let text = text.trim();
        match status {
            i32::MIN..=0 => tracing::debug!("the FMU says: {text}"),
            1 => tracing::warn!("the FMU says: {text}"),
            _ => tracing::error!("the FMU says: {text}"),
        }
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(text.to_owned());
    }

    /// The last message, once.
    fn take(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// A text of a library; empty if there is none.
///
/// # Safety
/// NULL, or a text that ends with NUL.
unsafe fn text<'a>(text: *const core::ffi::c_char) -> std::borrow::Cow<'a, str> {
    // SAFETY: as the caller states.
    if text.is_null() { "".into() } else { unsafe { CStr::from_ptr(text) }.to_string_lossy() }
}

/// With what an instance is made, and begins.
#[derive(Debug)]
pub(crate) struct InstanceSpec<'a> {
    pub token: &'a CStr,
    /// The folder of its resources, with a separator at the end.
    pub resources: &'a CStr,
    /// The values of parameters.
    pub parameters: &'a [(u32, Vec<f64>)],
    /// The inputs with their values at the start.
    pub inputs: (&'a [u32], &'a [f64]),
}

/// A function that was called, and the status that it returned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Called {
    pub function: &'static str,
    status: c_int,
}

impl Called {
    /// Whether it succeeded: OK or Warning.
    pub fn is_good(self) -> bool {
        matches!(self.status, 0 | 1)
    }

    /// The name of its status: those of both standards have the same numbers.
    pub fn status(self) -> &'static str {
        match self.status {
            0 => "OK",
            1 => "Warning",
            2 => "Discard",
            3 => "Error",
            4 => "Fatal",
            5 => "Pending",
            _ => "a status that FMI does not have",
        }
    }
}

/// What a communication step came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepOutcome {
    pub called: Called,
    /// Whether it asks to end the simulation.
    pub terminates: bool,
    /// The time up to which it came, if it says so, s.
    pub reached_s: Option<f64>,
}

/// An instance of either version.
pub(crate) trait Fmi {
    /// Sets variables; arrays have several values.
    fn set(&mut self, references: &[u32], values: &[f64]) -> Called;

    /// Reads variables; arrays have several values.
    fn get(&mut self, references: &[u32], values: &mut [f64]) -> Called;

    /// Begins the initialization, at time 0.
    fn enter_initialization(&mut self) -> Called;

    /// Ends the initialization.
    fn exit_initialization(&mut self) -> Called;

    /// A communication step. No state from before it is returned to.
    fn step(&mut self, from_s: f64, step_s: f64) -> StepOutcome;

    /// What both versions have.
    fn handle(&mut self) -> &mut Handle;
}

/// Takes up parameters and inputs, and begins the simulation at 0.
pub(crate) fn begin(fmu: &mut dyn Fmi, spec: &InstanceSpec<'_>) -> Result<(), ImportError> {
    for (reference, values) in spec.parameters {
        let called = fmu.set(&[*reference], values);
        fmu.handle().check(called)?;
    }
    let called = fmu.enter_initialization();
    fmu.handle().check(called)?;
    let (references, values) = spec.inputs;
    if !references.is_empty() {
        let called = fmu.set(references, values);
        fmu.handle().check(called)?;
    }
    let called = fmu.exit_initialization();
    fmu.handle().check(called)?;
    fmu.handle().is_running = true;
    Ok(())
}

type Plain = unsafe extern "C" fn(*mut c_void) -> c_int;
type Free = unsafe extern "C" fn(*mut c_void);

/// What instances of both versions have: the pointer, the last message, and how they end.
pub(crate) struct Handle {
    pointer: *mut c_void,
    said: Box<Said>,
    /// Whether the simulation has begun.
    is_running: bool,
    /// The worst status so far.
    worst: c_int,
    terminate: Plain,
    free: Free,
    library: Option<Library>,
}

impl Handle {
    /// `fmi2Error` and `fmi3Error`: such an instance can be freed alone.
    const ERROR: c_int = 3;
    /// `fmi2Fatal` and `fmi3Fatal`: no function may be called any more, so that its memory is lost.
    const FATAL: c_int = 4;

    /// That of the instance that `instantiate` returned, unless it is NULL.
    fn new(
        pointer: *mut c_void,
        instantiate: &'static str,
        said: Box<Said>,
        (terminate, free): (Plain, Free),
        library: Library,
    ) -> Result<Handle, ImportError> {
        if pointer.is_null() {
            return Err(ImportError::Call { call: instantiate, status: "NULL", log: said.take() });
        }
        Ok(Handle { pointer, said, is_running: false, worst: 0, terminate, free, library: Some(library) })
    }

    /// Notes what a function returned.
    fn called(&mut self, function: &'static str, status: c_int) -> Called {
        self.worst = self.worst.max(status);
        Called { function, status }
    }

    /// The error of a call before the simulation, unless it succeeded.
    fn check(&self, called: Called) -> Result<(), ImportError> {
        if called.is_good() {
            return Ok(());
        }
        Err(ImportError::Call { call: called.function, status: called.status(), log: self.last_message() })
    }

    /// Its last message, once.
    pub fn last_message(&self) -> Option<String> {
        self.said.take()
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: an instance, which nobody uses any more, in a state in which the calls are allowed.
        unsafe {
            if self.is_running && self.worst < Handle::ERROR {
                (self.terminate)(self.pointer);
            }
            if self.worst < Handle::FATAL {
                (self.free)(self.pointer);
            } else {
                core::mem::forget(self.library.take());
            }
        }
    }
}
