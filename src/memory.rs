//! Ends the program with exit code 3 where the system has no more memory, instead of an abort or a panic.
//!
//! Rust's own allocations end in [`OrExit`]. C code that gets no memory aborts (glibc, which registers destructors of a
//! thread) or makes a crate panic (zstd-safe): [`exit_where_memory_is_missing`] tells these apart from defects of the
//! program by asking the system for memory.

use core::alloc::{GlobalAlloc, Layout};
use core::ptr::null_mut;
use std::alloc::System;
use std::panic;

/// The system's allocator, which ends the process where it has no memory: by default Rust aborts, which looks like a
/// defect of the program, or like a verdict about its input.
struct OrExit;

#[global_allocator]
static ALLOCATOR: OrExit = OrExit;

/// The last message: a constant, since formatting one would take memory.
const MESSAGE: &[u8] = b"resonarm: not enough memory: allow more (ulimit -v), or end other programs\n";

#[allow(unsafe_code, reason = "an allocator is unsafe to implement")]
// SAFETY: every call is passed on to the system's allocator unchanged; a null pointer never comes back.
unsafe impl GlobalAlloc for OrExit {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`, which is that of `System`.
        or_exit(unsafe { System.alloc(layout) })
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer is from `System`, with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as for `alloc`.
        or_exit(unsafe { System.alloc_zeroed(layout) })
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the pointer is from `System`, with this layout.
        or_exit(unsafe { System.realloc(pointer, layout, size) })
    }
}

/// Returns the pointer; ends the process if it is null.
#[inline]
fn or_exit(pointer: *mut u8) -> *mut u8 {
    if pointer.is_null() {
        exit();
    }
    pointer
}

#[cold]
#[allow(unsafe_code, reason = "the standard library's way to exit runs handlers, which may take memory")]
fn exit() -> ! {
    // SAFETY: the message is as long as stated, and both calls may be made at any time (signal-safety(7)).
    unsafe {
        libc::write(libc::STDERR_FILENO, MESSAGE.as_ptr().cast(), MESSAGE.len());
        libc::_exit(3)
    }
}

/// More bytes than C code allocates at once here: a context of Zstandard takes some 150 KiB.
const PROBE: usize = 1 << 20;

/// Ends a panic or an abort with exit code 3 if the system has no memory left. Call it first of all.
#[allow(unsafe_code, reason = "the standard library handles no signals")]
pub(crate) fn exit_where_memory_is_missing() {
    let report = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if is_missing() {
            exit();
        }
        // Only with memory left: a crate that panics over a failed allocation, such as zstd-safe, is no defect to
        // report.
        report(info);
    }));
    let handler: extern "C" fn(libc::c_int) = aborted;
    // SAFETY: the handler makes signal-safe calls only (signal-safety(7); mmap is a system call without any state of the
    // C library). With SA_RESETHAND a second abort, which follows if the handler returns, ends the program.
    unsafe {
        let mut action: libc::sigaction = core::mem::zeroed();
        action.sa_sigaction = handler as libc::sighandler_t;
        action.sa_flags = libc::SA_RESETHAND;
        libc::sigaction(libc::SIGABRT, &raw const action, null_mut());
    }
}

extern "C" fn aborted(_signal: libc::c_int) {
    if is_missing() {
        exit();
    }
}

/// Says whether the system refuses memory.
#[allow(unsafe_code, reason = "the allocator would end the program")]
fn is_missing() -> bool {
    // SAFETY: a new private mapping, which nothing else knows, is unmapped again.
    unsafe {
        let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS;
        let mapping = libc::mmap(null_mut(), PROBE, libc::PROT_READ | libc::PROT_WRITE, flags, -1, 0);
        mapping == libc::MAP_FAILED || libc::munmap(mapping, PROBE) != 0
    }
}
