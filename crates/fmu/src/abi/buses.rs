//! Binaries and clocks: what FMI-LS-BUS is made of.

use core::ffi::{c_int, c_void};

use super::{on, same_length, slice, slice_mut};
use crate::terminal::Interval;

/// Returns bytes, which stay valid until the next call on the instance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetBinary(
    instance: *mut c_void,
    references: *const u32,
    reference_count: usize,
    sizes: *mut usize,
    values: *mut *const u8,
    count: usize,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3GetBinary", |handle| {
            same_length(reference_count, count)?;
            let sizes = slice_mut("valueSizes", sizes, count)?;
            let values = slice_mut("values", values, count)?;
            let references = slice("valueReferences", references, count)?;
            for ((reference, size), value) in references.iter().zip(sizes).zip(values) {
                let bytes = handle.instance.binary(*reference)?;
                *size = bytes.len();
                *value = bytes.as_ptr();
            }
            Ok(())
        })
    }
}

/// Sets the bytes of binary variables. They are read at once: no pointer of the importer is kept.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetBinary(
    instance: *mut c_void,
    references: *const u32,
    reference_count: usize,
    sizes: *const usize,
    values: *const *const u8,
    count: usize,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3SetBinary", |handle| {
            same_length(reference_count, count)?;
            let sizes = slice("valueSizes", sizes, count)?;
            let values = slice("values", values, count)?;
            let references = slice("valueReferences", references, count)?;
            for ((reference, size), value) in references.iter().zip(sizes).zip(values) {
                handle.instance.set_binary(*reference, slice("a value", *value, *size)?)?;
            }
            Ok(())
        })
    }
}

/// Returns for each of the clocks whether it ticks in this event.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetClock(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut bool,
) -> c_int {
    // SAFETY: as the standard states; what is written is a `bool`.
    unsafe {
        on(instance, "fmi3GetClock", |handle| {
            // Written as bytes: the importer's memory may hold values that no `bool` of Rust may have.
            let values = slice_mut("values", values.cast::<u8>(), count)?;
            for (reference, value) in slice("valueReferences", references, count)?.iter().zip(values) {
                *value = u8::from(handle.instance.clock(*reference)?);
            }
            Ok(())
        })
    }
}

/// Tells the instance which clocks tick in this event.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetClock(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const u8,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3SetClock", |handle| {
            let values = slice("values", values, count)?;
            for (reference, value) in slice("valueReferences", references, count)?.iter().zip(values) {
                handle.instance.set_clock(*reference, *value != 0)?;
            }
            Ok(())
        })
    }
}

/// Returns when countdown clocks tick next.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetIntervalDecimal(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    intervals: *mut f64,
    qualifiers: *mut c_int,
) -> c_int {
    // SAFETY: as the standard states.
    unsafe {
        on(instance, "fmi3GetIntervalDecimal", |handle| {
            let intervals = slice_mut("intervals", intervals, count)?;
            let qualifiers = slice_mut("qualifiers", qualifiers, count)?;
            let references = slice("valueReferences", references, count)?;
            for ((reference, interval), qualifier) in references.iter().zip(intervals).zip(qualifiers) {
                (*interval, *qualifier) = match handle.instance.interval(*reference)? {
                    Interval::Unknown => (0.0, 0),
                    Interval::Unchanged(interval_s) => (interval_s, 1),
                    Interval::Changed(interval_s) => (interval_s, 2),
                };
            }
            Ok(())
        })
    }
}
