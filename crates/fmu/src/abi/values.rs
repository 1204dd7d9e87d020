//! C functions that get and set the values of variables.

use core::ffi::{c_char, c_int, c_void};
use std::ffi::CString;

use super::{on, slice, slice_mut, text};
use crate::Fault;
use crate::instance::Value;

/// Refuses another number of values than of references: every variable is a scalar.
fn same_length(call: &'static str, references: usize, values: usize) -> Result<(), Fault> {
    if references == values { Ok(()) } else { Err(Fault::Lengths { call, references, values }) }
}

/// The functions of a type that is a number: its getter, its setter, its type in C and the method and variant here.
macro_rules! numbers {
    ($($get:ident, $set:ident: $type:ty, $method:ident, $variant:ident, $to:expr, $from:expr;)*) => {$(
        /// Behaves as the FMI standard states.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $get(
            instance: *mut c_void,
            references: *const u32,
            reference_count: usize,
            values: *mut $type,
            count: usize,
        ) -> c_int {
            const CALL: &str = stringify!($get);
            // SAFETY: as the standard states.
            unsafe {
                on(instance, CALL, |handle| {
                    same_length(CALL, reference_count, count)?;
                    let values = slice_mut(CALL, "values", values, count)?;
                    for (reference, value) in slice(CALL, "valueReferences", references, count)?.iter().zip(values) {
                        *value = $to(handle.instance.$method(CALL, *reference)?);
                    }
                    Ok(())
                })
            }
        }

        /// Behaves as the FMI standard states.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set(
            instance: *mut c_void,
            references: *const u32,
            reference_count: usize,
            values: *const $type,
            count: usize,
        ) -> c_int {
            const CALL: &str = stringify!($set);
            // SAFETY: as the standard states.
            unsafe {
                on(instance, CALL, |handle| {
                    same_length(CALL, reference_count, count)?;
                    let values = slice(CALL, "values", values, count)?;
                    for (reference, value) in slice(CALL, "valueReferences", references, count)?.iter().zip(values) {
                        handle.instance.set(CALL, *reference, Value::$variant($from(*value)))?;
                    }
                    Ok(())
                })
            }
        }
    )*};
}

// A `bool` of C that is neither 0 nor 1 must not be read as one of Rust.
numbers! {
    fmi3GetFloat64, fmi3SetFloat64: f64, float64, Float64, core::convert::identity, core::convert::identity;
    fmi3GetUInt64, fmi3SetUInt64: u64, uint64, UInt64, core::convert::identity, core::convert::identity;
    fmi3GetBoolean, fmi3SetBoolean: u8, boolean, Boolean, u8::from, |value: u8| value != 0;
}

/// Returns texts, which stay valid until the next call on the instance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetString(
    instance: *mut c_void,
    references: *const u32,
    reference_count: usize,
    values: *mut *const c_char,
    count: usize,
) -> c_int {
    const CALL: &str = "fmi3GetString";
    // SAFETY: as the standard states.
    unsafe {
        on(instance, CALL, |handle| {
            same_length(CALL, reference_count, count)?;
            let values = slice_mut(CALL, "values", values, count)?;
            handle.texts.clear();
            for (reference, value) in slice(CALL, "valueReferences", references, count)?.iter().zip(values) {
                // Texts come through fmi3SetString and have no NUL inside.
                let text = CString::new(handle.instance.string(CALL, *reference)?).unwrap_or_default();
                *value = text.as_ptr();
                handle.texts.push(text);
            }
            Ok(())
        })
    }
}

/// Sets variables of the type String.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetString(
    instance: *mut c_void,
    references: *const u32,
    reference_count: usize,
    values: *const *const c_char,
    count: usize,
) -> c_int {
    const CALL: &str = "fmi3SetString";
    // SAFETY: as the standard states.
    unsafe {
        on(instance, CALL, |handle| {
            same_length(CALL, reference_count, count)?;
            let values = slice(CALL, "values", values, count)?;
            for (reference, value) in slice(CALL, "valueReferences", references, count)?.iter().zip(values) {
                handle.instance.set_string(CALL, *reference, text(CALL, "a value", *value)?)?;
            }
            Ok(())
        })
    }
}
