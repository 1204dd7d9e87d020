//! Ends the program with exit code 3 where the system has no more memory, instead of an abort.

use core::alloc::{GlobalAlloc, Layout};
use std::alloc::System;

/// The system's allocator, which ends the process where it has no memory: by default Rust aborts, which looks like a
/// defect of the program, or like a verdict about its input.
struct OrExit;

#[global_allocator]
static ALLOCATOR: OrExit = OrExit;

/// What is said, which must not take memory.
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

/// The pointer, unless it is null.
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
