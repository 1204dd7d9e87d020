//! The C interfaces of FMUs: their libraries and the functions that a structure needs.
//!
//! A function is called as the standard says: an instance that its library made, arrays of the stated lengths, texts
//! that end with NUL. What a library does with them can't be checked.

#![allow(unsafe_code, reason = "functions of a C interface, looked up by name in a library that is loaded")]

mod fmi2;
mod fmi3;

use core::ffi::{CStr, c_char, c_int, c_void};
use core::fmt::Display;
use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;

pub(crate) use fmi2::Fmi2;
pub(crate) use fmi3::Fmi3;

use crate::mapping::Mapping;
use crate::message::{Answer, Answers, Stepped};

/// Why the simulation of an FMU can't begin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum StartError {
    /// What is wrong with the library: it can't be loaded, or lacks a function.
    Library(String),
    /// A function returned this status; `None` for an instance that is NULL.
    Refused { function: String, status: Option<i32> },
}

impl StartError {
    /// The error of a library that can't be loaded.
    pub fn unloadable(reason: impl Display) -> StartError {
        StartError::Library(format!("can't be loaded: {reason}"))
    }
}

/// A shared library loaded by `dlopen`.
pub(crate) struct Library {
    handle: *mut c_void,
}

impl Library {
    /// Loads a library, with all that it needs.
    pub fn load(path: &Path) -> Result<Library, StartError> {
        // As bytes: a path of Linux need not be UTF-8.
        let name = CString::new(path.as_os_str().as_encoded_bytes());
        let name = name.map_err(|_| StartError::unloadable("its path has a NUL"))?;
        // RTLD_NOW makes a missing symbol an error of loading, and not a crash in a later call. RTLD_LOCAL keeps the symbols
        // of the FMU from resolving those of libraries that are loaded later.
        // SAFETY: a text; the code that runs is the user's choice, and has this process for itself.
        let handle = unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
        if handle.is_null() {
            // SAFETY: the text of the failed call above, on this thread.
            let reason = unsafe { text(libc::dlerror()) };
            return Err(StartError::unloadable(reason));
        }
        Ok(Library { handle })
    }

    /// The address of a function.
    fn address(&self, name: &'static CStr) -> Result<*mut c_void, StartError> {
        // SAFETY: a library that is loaded, and a text.
        let address = unsafe { libc::dlsym(self.handle, name.as_ptr()) };
        if address.is_null() {
            return Err(StartError::Library(format!("has no function `{}`", name.to_string_lossy())));
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

/// Passes on what an instance says, from any of its threads, with a status as the standards number them: 1 is a warning,
/// from 2 on they are errors.
///
/// # Safety
/// `environment` is what [`Handle::environment`] gave to an instance that lives, or NULL; `message` is as for [`text`].
unsafe fn pass_on(environment: *mut c_void, status: c_int, message: *const c_char) {
    // SAFETY: as the caller states.
    let (answers, text) = unsafe { (environment.cast::<Answers>().as_ref(), text(message)) };
    if let Some(answers) = answers {
        // Nobody listens if the pipe is closed: the next request finds that out.
        let _closed = answers.send(&Answer::Says { status, text: text.trim().to_owned() }, &[]);
    }
}

/// A text of a library; empty if there is none.
///
/// # Safety
/// NULL, or a text that ends with NUL.
unsafe fn text<'a>(text: *const c_char) -> std::borrow::Cow<'a, str> {
    // SAFETY: as the caller states.
    if text.is_null() { "".into() } else { unsafe { CStr::from_ptr(text) }.to_string_lossy() }
}

/// Whether a call with this status succeeded: OK or Warning, which both standards number alike.
pub(crate) fn is_good(status: i32) -> bool {
    matches!(status, 0 | 1)
}

/// A function that was called, and the status that it returned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Called {
    pub function: &'static str,
    pub status: c_int,
}

impl Called {
    /// Whether it succeeded.
    pub fn is_good(self) -> bool {
        is_good(self.status)
    }

    /// The error of a call before the simulation, unless it succeeded.
    pub fn checked(self) -> Result<(), StartError> {
        let Called { function, status } = self;
        if is_good(status) {
            Ok(())
        } else {
            Err(StartError::Refused { function: function.into(), status: Some(status) })
        }
    }
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
    fn step(&mut self, from_s: f64, step_s: f64) -> Stepped;

    /// The part that both versions share: pointer, messages and statuses.
    fn handle(&mut self) -> &mut Handle;
}

/// Sets parameters and inputs, and begins the simulation at time 0.
pub(crate) fn begin(fmu: &mut dyn Fmi, mapping: &Mapping) -> Result<(), StartError> {
    // Parameters come before initialization mode, in which the FMU computes its start from them.
    for (reference, values) in &mapping.parameters {
        fmu.set(&[*reference], values).checked()?;
    }
    fmu.enter_initialization().checked()?;
    // The outputs at time 0 follow from these inputs, which are those of a plant without load.
    if !mapping.set.references.is_empty() {
        fmu.set(&mapping.set.references, &mapping.set_at_rest()).checked()?;
    }
    fmu.exit_initialization().checked()?;
    fmu.handle().is_running = true;
    Ok(())
}

type Plain = unsafe extern "C" fn(*mut c_void) -> c_int;
type Free = unsafe extern "C" fn(*mut c_void);

/// What instances of both versions have: the pointer, what passes on their messages, and how they end.
pub(crate) struct Handle {
    pointer: *mut c_void,
    /// Kept here because the instance has its address, as the environment of its messages.
    _answers: Arc<Answers>,
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
        answers: Arc<Answers>,
        (terminate, free): (Plain, Free),
        library: Library,
    ) -> Result<Handle, StartError> {
        if pointer.is_null() {
            return Err(StartError::Refused { function: instantiate.into(), status: None });
        }
        Ok(Handle { pointer, _answers: answers, is_running: false, worst: 0, terminate, free, library: Some(library) })
    }

    /// The environment with which an instance passes on its messages.
    fn environment(answers: &Arc<Answers>) -> *mut c_void {
        Arc::as_ptr(answers).cast_mut().cast()
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
            // An instance that has returned an error can only be freed, and one whose simulation has not begun has
            // nothing to terminate.
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
