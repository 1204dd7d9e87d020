//! The guard of tests that take no memory, and the test that it bites: without that, the others could pass with a guard
//! that guards nothing.

use std::process::Command;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};

#[global_allocator]
static GUARD: AllocDisabler = AllocDisabler;

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
