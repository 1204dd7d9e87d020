//! States that the importer holds.

use core::ffi::{c_int, c_void};

use super::{on, slice, slice_mut};
use crate::fault::{Fault, WrongCall};
use crate::instance::SavedInstance;

/// The state at a pointer of the importer.
///
/// # Safety
/// `state` is NULL or from [`fmi3GetFMUState`] or [`fmi3DeserializeFMUState`], and not freed.
unsafe fn saved<'a>(state: *mut c_void) -> Result<&'a mut SavedInstance, Fault> {
    // SAFETY: as stated.
    unsafe { state.cast::<SavedInstance>().as_mut() }.ok_or(WrongCall::Null { what: "the state" }.into())
}

/// Gives a state to the importer: in place of the one that it holds, or a new one.
///
/// # Safety
/// `to` is NULL or points at NULL or at a state as above.
unsafe fn hand_out(to: *mut *mut c_void, state: SavedInstance) -> Result<(), Fault> {
    // SAFETY: as stated.
    unsafe {
        let place = to.as_mut().ok_or(WrongCall::Null { what: "the place for the state" })?;
        match place.cast::<SavedInstance>().as_mut() {
            // The importer asks for the state to be kept in place of an older one, whose memory is used again.
            Some(old) => *old = state,
            None => *place = Box::into_raw(Box::new(state)).cast(),
        }
    }
    Ok(())
}

/// Saves the state of the instance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFMUState(instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: as the standard states.
    unsafe { on(instance, "fmi3GetFMUState", |handle| hand_out(state, handle.instance.save()?)) }
}

/// Returns the instance to a saved state.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetFMUState(instance: *mut c_void, state: *mut c_void) -> c_int {
    // SAFETY: as the standard states.
    unsafe { on(instance, "fmi3SetFMUState", |handle| handle.instance.restore(saved(state)?)) }
}

/// Frees a saved state and sets its pointer to NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeFMUState(instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: as the standard states; a state is freed once, as its pointer becomes NULL.
    unsafe {
        on(instance, "fmi3FreeFMUState", |_| {
            if let Some(place) = state.as_mut()
                && !place.is_null()
            {
                drop(Box::from_raw(place.cast::<SavedInstance>()));
                *place = core::ptr::null_mut();
            }
            Ok(())
        })
    }
}

/// Returns the length of a saved state as bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SerializedFMUStateSize(
    instance: *mut c_void,
    state: *mut c_void,
    size: *mut usize,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3SerializedFMUStateSize", |handle| {
            let size = size.as_mut().ok_or(WrongCall::Null { what: "size" })?;
            *size = handle.instance.serialize(saved(state)?)?.len();
            Ok(())
        })
    }
}

/// Writes a saved state as bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SerializeFMUState(
    instance: *mut c_void,
    state: *mut c_void,
    bytes: *mut u8,
    size: usize,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3SerializeFMUState", |handle| {
            let written = handle.instance.serialize(saved(state)?)?;
            if written.len() != size {
                return Err(WrongCall::SavedLength { got: size, expected: written.len() }.into());
            }
            slice_mut("serializedState", bytes, size)?.copy_from_slice(&written);
            Ok(())
        })
    }
}

/// Reads a saved state from bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DeserializeFMUState(
    instance: *mut c_void,
    bytes: *const u8,
    size: usize,
    state: *mut *mut c_void,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3DeserializeFMUState", |handle| {
            let read = handle.instance.deserialize(slice("serializedState", bytes, size)?)?;
            hand_out(state, read)
        })
    }
}
