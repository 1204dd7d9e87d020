//! How this thread rounds: the control bits of its floating-point unit.
//!
//! A library that is linked with `-ffast-math` sets, when it is loaded, that tiny numbers become zero (FTZ, DAZ), for
//! the whole thread. Everything that is computed on it has other bits from then on.

#![allow(unsafe_code, reason = "the control register is read and written by instructions of the machine")]

use core::arch::asm;

use crate::ImportError;

/// The control bits: of MXCSR all but the flags of exceptions that have been, of FPCR all.
pub(crate) fn control() -> u64 {
    #[cfg(target_arch = "x86_64")]
    {
        let mut bits: u32 = 0;
        // SAFETY: it writes the register to the variable.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut bits, options(nostack, preserves_flags)) };
        u64::from(bits & !0x3F)
    }
    #[cfg(target_arch = "aarch64")]
    {
        let bits: u64;
        // SAFETY: it reads the register.
        unsafe { asm!("mrs {}, fpcr", out(reg) bits, options(nomem, nostack, preserves_flags)) };
        bits
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    0
}

/// Sets the control bits.
fn set(bits: u64) {
    #[cfg(target_arch = "x86_64")]
    {
        let bits = bits as u32;
        // SAFETY: they are bits that the register had before.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const bits, options(nostack, preserves_flags)) };
    }
    #[cfg(target_arch = "aarch64")]
    // SAFETY: as above.
    unsafe {
        asm!("msr fpcr, {}", in(reg) bits, options(nostack, preserves_flags));
    }
}

/// What `call` made, unless it changed the control bits, which are then set back.
pub(crate) fn kept<T>(name: &'static str, call: impl FnOnce() -> T) -> Result<T, ImportError> {
    let before = control();
    let made = call();
    let after = control();
    if after == before {
        return Ok(made);
    }
    set(before);
    Err(ImportError::FloatMode { call: name, before, after })
}

/// Whether the control bits are `before`; they are in any case then.
pub(crate) fn is_kept(before: u64) -> bool {
    let is_kept = control() == before;
    if !is_kept {
        set(before);
    }
    is_kept
}
