//! With the feature `python-can`, lets the programs find the Python library they are linked with, wherever that is.
//! Programs for tests are linked for a fixed address.

use std::env;

fn main() {
    #[cfg(feature = "python-can")]
    pyo3_build_config::add_libpython_rpath_link_args();
    // Tests start the program thousands of times. One that can be anywhere has 95,000 addresses to set at every start.
    let is = |name, value| env::var(name).is_ok_and(|found| found == value);
    if is("PROFILE", "debug") && is("CARGO_CFG_TARGET_OS", "linux") && is("CARGO_CFG_TARGET_ENV", "gnu") {
        println!("cargo:rustc-link-arg-bins=-no-pie");
    }
    println!("cargo:rerun-if-changed=build.rs");
}
