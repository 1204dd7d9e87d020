//! Binaries and clocks: what FMI-LS-BUS is made of.

use core::ffi::{c_int, c_void};

use super::{on, slice, slice_mut};
use crate::Fault;
use crate::terminal::Interval;

fn same_length(call: &'static str, references: usize, values: usize) -> Result<(), Fault> {
    if references == values { Ok(()) } else { Err(Fault::Lengths { call, references, values }) }
}

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
    const CALL: &str = "fmi3GetBinary";
    // SAFETY: as the standard states.
    unsafe {
        on(instance, CALL, |handle| {
            same_length(CALL, reference_count, count)?;
            let sizes = slice_mut(CALL, "valueSizes", sizes, count)?;
            let values = slice_mut(CALL, "values", values, count)?;
            let references = slice(CALL, "valueReferences", references, count)?;
            for ((reference, size), value) in references.iter().zip(sizes).zip(values) {
                let bytes = handle.instance.binary(CALL, *reference)?;
                (*size, *value) = (bytes.len(), bytes.as_ptr());
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
    const CALL: &str = "fmi3SetBinary";
    // SAFETY: as the standard states.
    unsafe {
        on(instance, CALL, |handle| {
            same_length(CALL, reference_count, count)?;
            let sizes = slice(CALL, "valueSizes", sizes, count)?;
            let values = slice(CALL, "values", values, count)?;
            let references = slice(CALL, "valueReferences", references, count)?;
            for ((reference, size), value) in references.iter().zip(sizes).zip(values) {
                handle.instance.set_binary(CALL, *reference, slice(CALL, "a value", *value, *size)?)?;
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
    const CALL: &str = "fmi3GetClock";
    // SAFETY: as the standard states; what is written is a `bool`.
    unsafe {
        on(instance, CALL, |handle| {
            // Written as bytes: the importer's memory may hold values that no `bool` of Rust may have.
            let values = slice_mut(CALL, "values", values.cast::<u8>(), count)?;
            for (reference, value) in slice(CALL, "valueReferences", references, count)?.iter().zip(values) {
                *value = u8::from(handle.instance.clock(CALL, *reference)?);
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
    const CALL: &str = "fmi3SetClock";
    // SAFETY: as the standard states.
    unsafe {
        on(instance, CALL, |handle| {
            let values = slice(CALL, "values", values, count)?;
            for (reference, value) in slice(CALL, "valueReferences", references, count)?.iter().zip(values) {
                handle.instance.set_clock(CALL, *reference, *value != 0)?;
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
    const CALL: &str = "fmi3GetIntervalDecimal";
    // SAFETY: as the standard states.
    unsafe {
        on(instance, CALL, |handle| {
            let intervals = slice_mut(CALL, "intervals", intervals, count)?;
            let qualifiers = slice_mut(CALL, "qualifiers", qualifiers, count)?;
            let references = slice(CALL, "valueReferences", references, count)?;
            for ((reference, interval), qualifier) in references.iter().zip(intervals).zip(qualifiers) {
                (*interval, *qualifier) = match handle.instance.interval(CALL, *reference)? {
                    Interval::Unknown => (0.0, 0),
                    Interval::Unchanged(interval_s) => (interval_s, 1),
                    Interval::Changed(interval_s) => (interval_s, 2),
                };
            }
            Ok(())
        })
    }
}
