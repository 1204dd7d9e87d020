//! With the feature `python-can`, lets the programs find the Python library they are linked with, wherever that is.

fn main() {
    #[cfg(feature = "python-can")]
    pyo3_build_config::add_libpython_rpath_link_args();
    println!("cargo:rerun-if-changed=build.rs");
}
