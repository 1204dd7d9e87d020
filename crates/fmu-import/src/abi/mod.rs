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
use std::sync::Arc;

pub(crate) use fmi2::Fmi2;
pub(crate) use fmi3::Fmi3;

use crate::message::{Answer, Answers};

/// Why the simulation of an FMU can't begin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum StartError {
    /// The library can't be loaded: what the loader says.
    Load(String),
    /// The library lacks a function.
    Function(&'static str),
    /// A function returned this status; `None` for an instance that is NULL.
    Status { function: &'static str, status: Option<c_int> },
}

impl StartError {
    /// The error of a call that failed.
    pub fn of(called: Called) -> StartError {
        StartError::Status { function: called.function, status: Some(called.status) }
    }
}

/// A shared library loaded by `dlopen`.
pub(crate) struct Library {
    handle: *mut c_void,
}

impl Library {
    /// Loads a library, with all that it needs.
    pub fn load(path: &Path) -> Result<Library, StartError> {
        let name = CString::new(path.as_os_str().as_encoded_bytes());
        let name = name.map_err(|_| StartError::Load("its path has a NUL".into()))?;
        // SAFETY: a text; the code that runs is the user's choice, and has this process for itself.
        let handle = unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
        if handle.is_null() {
            // SAFETY: the text of the failed call above, on this thread.
            let reason = unsafe { text(libc::dlerror()) }.into_owned();
            return Err(StartError::Load(reason));
        }
        Ok(Library { handle })
    }

    /// The address of a function.
    fn address(&self, name: &'static CStr) -> Result<*mut c_void, StartError> {
        // SAFETY: a library that is loaded, and a text.
        let address = unsafe { libc::dlsym(self.handle, name.as_ptr()) };
        if address.is_null() {
            return Err(StartError::Function(name.to_str().unwrap_or_default()));
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

/// Passes on what an instance says, from any of its threads.
#[derive(Debug)]
pub(crate) struct Said(Arc<Answers>);

impl Said {
    /// Passes on a message, of a status as the standards number them, 1 a warning and from 2 on errors.
    fn note(&self, status: c_int, text: &str) {
        // Nobody listens if the pipe is closed: the next request finds that out.
        let _closed = self.0.send(&Answer::Says { status, text: text.trim().to_owned() }, &[]);
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

/// What an instance is created with, and the values with which its simulation begins.
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
    pub status: c_int,
}

impl Called {
    /// Whether it succeeded: OK or Warning.
    pub fn is_good(self) -> bool {
        matches!(self.status, 0 | 1)
    }
}

/// Outcome of a communication step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepOutcome {
    pub called: Called,
    /// Whether the FMU asks to end the simulation.
    pub terminates: bool,
    /// Time that the FMU says it has reached, s; `None` if it does not say.
    pub reached_s: Option<f64>,
}

/// An instance of FMI 2.0 or 3.0.
pub(crate) trait Fmi {
    /// Sets variables; arrays have several values.
    fn set(&mut self, references: &[u32], values: &[f64]) -> Called;

    /// Reads variables; arrays have several values.
    fn get(&mut self, references: &[u32], values: &mut [f64]) -> Called;

    /// Enters initialization mode, for a simulation that begins at time 0.
    fn enter_initialization(&mut self) -> Called;

    /// Leaves initialization mode, after which the FMU can be stepped.
    fn exit_initialization(&mut self) -> Called;

    /// Makes a communication step of `step_s` from `from_s` on, s. No state from before it is returned to.
    fn step(&mut self, from_s: f64, step_s: f64) -> StepOutcome;

    /// The part that both versions share: pointer, messages and statuses.
    fn handle(&mut self) -> &mut Handle;
}

/// The error of a call before the simulation, unless it succeeded.
fn check(called: Called) -> Result<(), StartError> {
    if called.is_good() { Ok(()) } else { Err(StartError::of(called)) }
}

/// Sets parameters and inputs, and begins the simulation at time 0.
pub(crate) fn begin(fmu: &mut dyn Fmi, spec: &InstanceSpec<'_>) -> Result<(), StartError> {
    // Parameters come before initialization mode, in which the FMU computes its start from them.
    for (reference, values) in spec.parameters {
        let called = fmu.set(&[*reference], values);
        check(called)?;
    }
    let called = fmu.enter_initialization();
    check(called)?;
    let (references, values) = spec.inputs;
    if !references.is_empty() {
        let called = fmu.set(references, values);
        check(called)?;
    }
    let called = fmu.exit_initialization();
    check(called)?;
    fmu.handle().is_running = true;
    Ok(())
}

type Plain = unsafe extern "C" fn(*mut c_void) -> c_int;
type Free = unsafe extern "C" fn(*mut c_void);

/// What instances of both versions have: the pointer, what passes on their messages, and how they end.
pub(crate) struct Handle {
    pointer: *mut c_void,
    /// Kept here because the instance has its address, as the environment of its messages.
    _said: Box<Said>,
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

    /// Wraps the instance that `instantiate` returned, unless it is NULL.
    fn new(
        pointer: *mut c_void,
        instantiate: &'static str,
        said: Box<Said>,
        (terminate, free): (Plain, Free),
        library: Library,
    ) -> Result<Handle, StartError> {
        if pointer.is_null() {
            return Err(StartError::Status { function: instantiate, status: None });
        }
        Ok(Handle { pointer, _said: said, is_running: false, worst: 0, terminate, free, library: Some(library) })
    }

    /// Notes what a function returned.
    fn called(&mut self, function: &'static str, status: c_int) -> Called {
        self.worst = self.worst.max(status);
        Called { function, status }
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
                // Unloading would run code of a library of which nothing may be called any more.
                core::mem::forget(self.library.take());
            }
        }
    }
}
