//! The C interface of FMI 3.0.2: all 75 functions, of which those that this FMU has no use for say so.
//!
//! A pointer is read as the standard says that the importer gives it: an instance from an instantiation, arrays of the
//! stated lengths, texts that end with NUL. NULL is refused. A panic does not leave the library: the call returns
//! `fmi3Fatal`.

#![allow(unsafe_code, reason = "a C interface: its functions have stated names, and read and write through pointers")]
#![allow(non_snake_case, reason = "the names of the standard")]
#![allow(clippy::missing_safety_doc, reason = "the standard states it: FMI 3.0.2, section 2.2")]

mod buses;
mod lifecycle;
mod refused;
mod states;
mod values;

use core::ffi::{CStr, c_char, c_int, c_void};
use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::fault::{Fault, WrongCall};
use crate::instance::Instance;

/// Status `fmi3OK`: the call succeeded.
const OK: c_int = 0;
/// `fmi3Error`: the call failed; the instance can be reset.
const ERROR: c_int = 3;
/// `fmi3Fatal`: the instance can't be used any more.
const FATAL: c_int = 4;

/// Type `fmi3LogMessageCallback` of the standard.
type LogMessage = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// Callback of the importer to which messages are logged.
#[derive(Clone, Copy)]
struct Log {
    environment: *mut c_void,
    message: Option<LogMessage>,
}

impl Log {
    /// Logs a failure, whatever `loggingOn` says.
    fn error(self, status: c_int, call: &str, fault: &Fault) {
        let Some(message) = self.message else { return };
        // A message has no NUL inside but by a name that the importer gave.
        let text = CString::new(fault.in_call(call).replace('\0', " ")).unwrap_or_default();
        let category = if status == FATAL { c"logStatusFatal" } else { c"logStatusError" };
        // SAFETY: the importer's callback, with texts that live during the call.
        unsafe { message(self.environment, status, category.as_ptr(), text.as_ptr()) }
    }
}

/// Data that an `fmi3Instance` points at.
struct Handle {
    instance: Instance,
    log: Log,
    /// Texts and bytes that the importer has until the next call.
    texts: Vec<CString>,
}

/// Does `work` on an instance, and returns its status; a failure is logged.
///
/// # Safety
/// `instance` is NULL or from an instantiation, not freed, and used by no other thread now.
unsafe fn on(instance: *mut c_void, call: &str, work: impl FnOnce(&mut Handle) -> Result<(), Fault>) -> c_int {
    // SAFETY: as stated.
    let Some(handle) = (unsafe { instance.cast::<Handle>().as_mut() }) else { return ERROR };
    let log = handle.log;
    let (status, fault) = match catch_unwind(AssertUnwindSafe(|| work(handle))) {
        Ok(Ok(())) => return OK,
        Ok(Err(fault)) => (ERROR, fault),
        Err(panic) => (FATAL, Fault::Panic(reason(&*panic))),
    };
    // SAFETY: as above; the work has ended.
    if let Some(handle) = unsafe { instance.cast::<Handle>().as_mut() } {
        handle.instance.fail();
    }
    log.error(status, call, &fault);
    status
}

/// Returns the message of a panic.
fn reason(panic: &(dyn core::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_string());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| String::from("a panic without a message"))
}

/// The elements at `pointer`.
///
/// # Safety
/// `pointer` is NULL or points at `length` elements that live and are not written for as long as the result is used.
unsafe fn slice<'a, T>(what: &'static str, pointer: *const T, length: usize) -> Result<&'a [T], Fault> {
    match (pointer.is_null(), length) {
        // Importers pass NULL for an array without elements, and a slice may not begin at NULL.
        (_, 0) => Ok(&[]),
        (true, _) => Err(WrongCall::Null { what }.into()),
        // SAFETY: as stated.
        (false, _) => Ok(unsafe { core::slice::from_raw_parts(pointer, length) }),
    }
}

/// The same to write.
///
/// # Safety
/// As [`slice`], and nothing else reads or writes them.
unsafe fn slice_mut<'a, T>(what: &'static str, pointer: *mut T, length: usize) -> Result<&'a mut [T], Fault> {
    match (pointer.is_null(), length) {
        (_, 0) => Ok(&mut []),
        (true, _) => Err(WrongCall::Null { what }.into()),
        // SAFETY: as stated.
        (false, _) => Ok(unsafe { core::slice::from_raw_parts_mut(pointer, length) }),
    }
}

/// Refuses another number of values than of references: every variable is a scalar.
fn same_length(references: usize, values: usize) -> Result<(), Fault> {
    if references == values { Ok(()) } else { Err(WrongCall::Lengths { references, values }.into()) }
}

/// The text at `pointer`.
///
/// # Safety
/// `pointer` is NULL or points at a text that ends with NUL and lives for as long as the result is used.
unsafe fn text<'a>(what: &'static str, pointer: *const c_char) -> Result<&'a str, Fault> {
    if pointer.is_null() {
        return Err(WrongCall::Null { what }.into());
    }
    // SAFETY: as stated.
    let text = unsafe { CStr::from_ptr(pointer) };
    Ok(text.to_str().map_err(|_| WrongCall::NotUtf8 { what })?)
}

/// Writes through a pointer that the importer gave for a result, unless it is NULL.
///
/// # Safety
/// `pointer` is NULL or may be written.
unsafe fn give<T>(pointer: *mut T, value: T) {
    if !pointer.is_null() {
        // SAFETY: as stated.
        unsafe { pointer.write(value) };
    }
}
