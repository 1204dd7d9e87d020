//! Functions for which this FMU has no use: importers look for all of them.

use core::ffi::{c_int, c_void};

use super::{on, slice};
use crate::fault::WrongCall;

/// Getters and setters of types that no variable has: fine for no variable.
macro_rules! no_variables {
    ($($name:ident)*) => {$(
        /// Behaves as the FMI standard states.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            instance: *mut c_void,
            references: *const u32,
            count: usize,
            _values: *const c_void,
            _value_count: usize,
        ) -> c_int {
            // SAFETY: as the standard states.
            unsafe {
                on(instance, stringify!($name), |handle| match slice("valueReferences", references, count)? {
                    [] => Ok(()),
                    [first, ..] => Err(handle.instance.refused_type(*first)),
                })
            }
        }
    )*};
}

no_variables! {
    fmi3GetFloat32 fmi3GetInt8 fmi3GetUInt8 fmi3GetInt16 fmi3GetUInt16 fmi3GetInt32 fmi3GetUInt32 fmi3GetInt64
    fmi3SetFloat32 fmi3SetInt8 fmi3SetUInt8 fmi3SetInt16 fmi3SetUInt16 fmi3SetInt32 fmi3SetUInt32 fmi3SetInt64
}

/// Functions that the description says are not to be called, with the attribute or the element that says so. Their
/// arguments are not read.
macro_rules! not_offered {
    ($($name:ident($($argument:ty),*): $why:literal;)*) => {$(
        /// Behaves as the FMI standard states.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(instance: *mut c_void $(, _: $argument)*) -> c_int {
            // SAFETY: as the standard states.
            unsafe { on(instance, stringify!($name), |_| Err(WrongCall::NotOffered { why: $why }.into())) }
        }
    )*};
}

/// Pointers and counts that are not read.
type P = *const c_void;
type N = usize;

not_offered! {
    fmi3GetNumberOfVariableDependencies(u32, P): "providesPerElementDependencies is false";
    fmi3GetVariableDependencies(u32, P, P, P, P, N): "providesPerElementDependencies is false";
    fmi3GetDirectionalDerivative(P, N, P, N, P, N, P, N): "providesDirectionalDerivatives is false";
    fmi3GetAdjointDerivative(P, N, P, N, P, N, P, N): "providesAdjointDerivatives is false";
    fmi3EnterConfigurationMode(): "there are no structural parameters";
    fmi3ExitConfigurationMode(): "there are no structural parameters";
    fmi3GetIntervalFraction(P, N, P, P, P): "supportsFraction is false";
    fmi3GetShiftDecimal(P, N, P): "no clock has a shift";
    fmi3GetShiftFraction(P, N, P, P): "no clock has a shift";
    fmi3SetIntervalDecimal(P, N, P): "no clock has an interval that is set";
    fmi3SetIntervalFraction(P, N, P, P): "no clock has an interval that is set";
    fmi3SetShiftDecimal(P, N, P): "no clock has a shift";
    fmi3SetShiftFraction(P, N, P, P): "no clock has a shift";
    fmi3EnterContinuousTimeMode(): "the FMU supports co-simulation only";
    fmi3CompletedIntegratorStep(bool, P, P): "the FMU supports co-simulation only";
    fmi3SetTime(f64): "the FMU supports co-simulation only";
    fmi3SetContinuousStates(P, N): "the FMU supports co-simulation only";
    fmi3GetContinuousStateDerivatives(P, N): "the FMU supports co-simulation only";
    fmi3GetEventIndicators(P, N): "the FMU supports co-simulation only";
    fmi3GetContinuousStates(P, N): "the FMU supports co-simulation only";
    fmi3GetNominalsOfContinuousStates(P, N): "the FMU supports co-simulation only";
    fmi3GetNumberOfEventIndicators(P): "the FMU supports co-simulation only";
    fmi3GetNumberOfContinuousStates(P): "the FMU supports co-simulation only";
    fmi3GetOutputDerivatives(P, N, P, P, N): "maxOutputDerivativeOrder is 0";
    fmi3ActivateModelPartition(u32, f64): "the FMU supports co-simulation only";
}
