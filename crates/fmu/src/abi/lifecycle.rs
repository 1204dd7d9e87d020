//! Functions for the life of an instance: version, instantiation, the states of FMI, steps.

use core::ffi::{c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use super::{ERROR, FATAL, Handle, Log, LogMessage, OK, give, on, reason, text};
use crate::fault::{Fault, WrongCall};
use crate::instance::Instance;

/// Returns the version of FMI.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// Errors are logged in any case, and there is nothing else to log.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetDebugLogging(
    instance: *mut c_void,
    _logging_on: bool,
    _categories: usize,
    _names: *const *const c_char,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe { on(instance, "fmi3SetDebugLogging", |_| Ok(())) }
}

/// Makes an instance; NULL if it can't be made, with the reason in the log.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    token: *const c_char,
    resource_path: *const c_char,
    _visible: bool,
    _logging_on: bool,
    event_mode_used: bool,
    _early_return_allowed: bool,
    _required_intermediate: *const u32,
    _required_intermediate_count: usize,
    environment: *mut c_void,
    log_message: Option<LogMessage>,
    _intermediate_update: *const c_void,
) -> *mut c_void {
    let log = Log { environment, message: log_message };
    let make = || {
        if resource_path.is_null() {
            return Err(Fault::NoResources);
        }
        // SAFETY: texts, as the standard states.
        let (token, folder) = unsafe { (text("instantiationToken", token)?, text("resourcePath", resource_path)?) };
        Instance::new(Path::new(folder), token, event_mode_used)
    };
    let (status, fault) = match catch_unwind(AssertUnwindSafe(make)) {
        Ok(Ok(instance)) => return Box::into_raw(Box::new(Handle { instance, log, texts: Vec::new() })).cast(),
        Ok(Err(fault)) => (ERROR, fault),
        Err(panic) => (FATAL, Fault::Panic(reason(&*panic))),
    };
    log.error(status, "fmi3InstantiateCoSimulation", &fault);
    core::ptr::null_mut()
}

/// Returns NULL: the FMU does not support model exchange.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateModelExchange(
    _name: *const c_char,
    _token: *const c_char,
    _resource_path: *const c_char,
    _visible: bool,
    _logging_on: bool,
    environment: *mut c_void,
    log_message: Option<LogMessage>,
) -> *mut c_void {
    refuse(Log { environment, message: log_message }, "fmi3InstantiateModelExchange")
}

/// Returns NULL: the FMU does not support scheduled execution.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateScheduledExecution(
    _name: *const c_char,
    _token: *const c_char,
    _resource_path: *const c_char,
    _visible: bool,
    _logging_on: bool,
    environment: *mut c_void,
    log_message: Option<LogMessage>,
    _clock_update: *const c_void,
    _lock_preemption: *const c_void,
    _unlock_preemption: *const c_void,
) -> *mut c_void {
    refuse(Log { environment, message: log_message }, "fmi3InstantiateScheduledExecution")
}

fn refuse(log: Log, call: &str) -> *mut c_void {
    log.error(ERROR, call, &WrongCall::NotCoSimulation.into());
    core::ptr::null_mut()
}

/// Frees an instance; a recording ends.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(instance: *mut c_void) {
    if !instance.is_null() {
        // SAFETY: as the standard states, it is from an instantiation and not used again.
        let handle = unsafe { Box::from_raw(instance.cast::<Handle>()) };
        // There is nobody left to hear of a panic.
        let _ended = catch_unwind(AssertUnwindSafe(move || drop(handle)));
    }
}

/// Enters initialization mode at the given start time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: *mut c_void,
    _tolerance_defined: bool,
    _tolerance: f64,
    start_s: f64,
    _stop_time_defined: bool,
    _stop_s: f64,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe { on(instance, "fmi3EnterInitializationMode", |handle| handle.instance.enter_initialization(start_s)) }
}

/// Calls that change the state of an instance and take nothing else.
macro_rules! states {
    ($($name:ident does $method:ident;)*) => {$(
        /// Behaves as the FMI standard states.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(instance: *mut c_void) -> c_int {
            // SAFETY: as the standard states.
            unsafe { on(instance, stringify!($name), |handle| handle.instance.$method()) }
        }
    )*};
}

states! {
    fmi3ExitInitializationMode does exit_initialization;
    fmi3EnterEventMode does enter_event;
    fmi3EnterStepMode does enter_step;
    fmi3Terminate does terminate;
    fmi3Reset does reset;
    fmi3EvaluateDiscreteStates does evaluate_discrete_states;
}

/// Ends an iteration of event mode.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3UpdateDiscreteStates(
    instance: *mut c_void,
    need_update: *mut bool,
    terminate: *mut bool,
    nominals_changed: *mut bool,
    values_changed: *mut bool,
    next_event_defined: *mut bool,
    next_event_s: *mut f64,
) -> c_int {
    let mut again = false;
    // SAFETY: as the standard states.
    unsafe {
        let status = on(instance, "fmi3UpdateDiscreteStates", |handle| {
            again = handle.instance.update_discrete_states()?;
            Ok(())
        });
        // Written after an error, too, so that no result is left undefined.
        give(need_update, again);
        [terminate, nominals_changed, values_changed, next_event_defined]
            .into_iter()
            .for_each(|flag| give(flag, false));
        give(next_event_s, 0.0);
        status
    }
}

/// Simulates a step, always to its end: there is no early return.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DoStep(
    instance: *mut c_void,
    from_s: f64,
    length_s: f64,
    _no_state_before: bool,
    event_handling_needed: *mut bool,
    terminate: *mut bool,
    early_return: *mut bool,
    last_successful_s: *mut f64,
) -> c_int {
    let mut event = false;
    let mut reached_s = from_s;
    // SAFETY: as the standard states.
    unsafe {
        let status = on(instance, "fmi3DoStep", |handle| {
            event = handle.instance.step(from_s, length_s)?;
            reached_s = handle.instance.time_s();
            Ok(())
        });
        give(event_handling_needed, event && status == OK);
        give(terminate, false);
        give(early_return, false);
        give(last_successful_s, reached_s);
        status
    }
}
