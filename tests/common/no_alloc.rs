//! The guard of tests that take no memory, and the test that it bites: without that, the others could pass with a guard
//! that guards nothing.

use std::alloc::{GlobalAlloc, Layout};
use std::cell::Cell;
use std::process::Command;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};

#[global_allocator]
static GUARD: Guard = Guard;

/// Counts for each thread, for work that no closure holds; the rest is the guard's.
struct Guard;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    // At its end a thread has no count any more.
    _ = COUNT.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: what is asked for is handed on as it is; counting takes no memory.
#[allow(unsafe_code, reason = "an allocator is unsafe to implement")]
unsafe impl GlobalAlloc for Guard {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as the caller promises.
        unsafe { AllocDisabler.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        count();
        // SAFETY: as the caller promises.
        unsafe { AllocDisabler.dealloc(memory, layout) }
    }
}

/// How often the calling thread has taken memory or given it back.
#[allow(dead_code, reason = "not every test binary has work that no closure holds")]
pub fn taken_or_given() -> u64 {
    COUNT.with(Cell::get)
}

#[test]
fn the_count_counts() {
    let before = taken_or_given();
    drop(std::hint::black_box(vec![0_u8; 64]));
    // Once for taking the memory, once for giving it back.
    assert_eq!(taken_or_given() - before, 2);
}

/// In a child process, which the guard must abort.
#[test]
fn the_guard_bites() {
    const CHILD: &str = "RESONARM_TEST_ALLOCATE";
    if std::env::var_os(CHILD).is_some() {
        assert_no_alloc(|| drop(std::hint::black_box(vec![0_u8; 64])));
        return;
    }
    let mut child = Command::new(std::env::current_exe().unwrap());
    let output = child.args(["--exact", "no_alloc::the_guard_bites"]).env(CHILD, "1").output().unwrap();
    assert!(!output.status.success());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("memory allocation of 64 bytes failed"), "{said}");
}
