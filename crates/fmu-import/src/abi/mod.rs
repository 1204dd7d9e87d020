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
            let reason = unsafe { libc::dlerror() };
            // SAFETY: as above.
            let reason = if reason.is_null() { "".into() } else { unsafe { CStr::from_ptr(reason) }.to_string_lossy() };
            return Err(ImportError::Load { reason: reason.into_owned() });
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

    /// The last message.
    pub fn last(&self) -> Option<String> {
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

/// What a step came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stepped {
    pub status: c_int,
    /// Whether it asks to end the simulation.
    pub terminates: bool,
    /// The time up to which it came, if it says so, s.
    pub reached_s: Option<f64>,
}

/// What is made of an instance.
#[derive(Debug)]
pub(crate) struct Made<'a> {
    pub token: &'a CStr,
    /// The folder of its resources, with a separator at the end.
    pub resources: &'a CStr,
    /// The values of parameters.
    pub parameters: &'a [(u32, Vec<f64>)],
    /// The inputs with their values at the start.
    pub inputs: (&'a [u32], &'a [f64]),
}

/// The name of a status: those of both standards have the same numbers.
pub(crate) fn status_name(status: c_int) -> &'static str {
    match status {
        0 => "OK",
        1 => "Warning",
        2 => "Discard",
        3 => "Error",
        4 => "Fatal",
        5 => "Pending",
        _ => "a status that FMI does not have",
    }
}

/// Whether a call succeeded: OK or Warning.
pub(crate) fn is_good(status: c_int) -> bool {
    matches!(status, 0 | 1)
}

/// The error of a call before the simulation, unless it succeeded.
fn check(call: &'static str, status: c_int, said: &Said) -> Result<(), ImportError> {
    if is_good(status) {
        Ok(())
    } else {
        Err(ImportError::Call { call, status: status_name(status), log: said.last() })
    }
}

/// Which calls are still allowed to end an instance.
#[derive(Debug, Default)]
struct End {
    /// Whether the simulation has begun.
    is_running: bool,
    /// The worst status so far.
    worst: c_int,
}

impl End {
    /// `fmi2Error` and `fmi3Error`.
    const ERROR: c_int = 3;
    /// `fmi2Fatal` and `fmi3Fatal`.
    const FATAL: c_int = 4;

    fn note(&mut self, status: c_int) -> c_int {
        self.worst = self.worst.max(status);
        status
    }

    /// After an error an instance can be freed alone.
    fn may_terminate(&self) -> bool {
        self.is_running && self.worst < End::ERROR
    }

    /// After a fatal error no function may be called any more, so that its memory is lost.
    fn may_free(&self) -> bool {
        self.worst < End::FATAL
    }
}
