//! C functions that get and set the values of variables.

use core::ffi::{c_char, c_int, c_void};
use std::ffi::CString;

use super::{on, same_length, slice, slice_mut, text};
use crate::instance::Value;

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
            // SAFETY: as the standard states.
            unsafe {
                on(instance, stringify!($get), |handle| {
                    same_length(reference_count, count)?;
                    let values = slice_mut("values", values, count)?;
                    for (reference, value) in slice("valueReferences", references, count)?.iter().zip(values) {
                        *value = $to(handle.instance.$method(*reference)?);
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
            // SAFETY: as the standard states.
            unsafe {
                on(instance, stringify!($set), |handle| {
                    same_length(reference_count, count)?;
                    let values = slice("values", values, count)?;
                    for (reference, value) in slice("valueReferences", references, count)?.iter().zip(values) {
                        handle.instance.set(*reference, Value::$variant($from(*value)))?;
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
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3GetString", |handle| {
            same_length(reference_count, count)?;
            let values = slice_mut("values", values, count)?;
            handle.texts.clear();
            for (reference, value) in slice("valueReferences", references, count)?.iter().zip(values) {
                // Texts come through fmi3SetString and have no NUL inside.
                let text = CString::new(handle.instance.string(*reference)?).unwrap_or_default();
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
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3SetString", |handle| {
            same_length(reference_count, count)?;
            let values = slice("values", values, count)?;
            for (reference, value) in slice("valueReferences", references, count)?.iter().zip(values) {
                handle.instance.set_string(*reference, text("a value", *value)?)?;
            }
            Ok(())
        })
    }
}
