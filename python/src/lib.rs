//! The extension module `resonarm._resonarm`, on which the Python package `resonarm` is built.
//!
//! Public names and documentation for users are in the package, `python/resonarm`. Long calls release the
//! interpreter's lock. Arrays are passed as rows of words (`rows`), errors as exceptions of a fitting type (`errors`).

mod basins;
mod bus;
mod continuation;
mod controller;
mod errors;
mod forced;
mod judge;
mod log;
mod logging;
mod modes;
mod own_structure;
mod plant;
mod protocol;
mod recording;
mod rows;
mod scenario;
mod session;
mod spectra;
mod structure;
mod values;
mod watch;

use pyo3::prelude::*;

/// Makes the extension module, with all its classes and functions.
#[pymodule]
fn _resonarm(module: &Bound<'_, PyModule>) -> PyResult<()> {
    logging::begin();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("ResonarmError", module.py().get_type::<errors::ResonarmError>())?;
    module.add_function(wrap_pyfunction!(errors::printable_text, module)?)?;
    module.add_class::<modes::Mode>()?;
    module.add_function(wrap_pyfunction!(modes::presets, module)?)?;
    module.add_function(wrap_pyfunction!(modes::step_rate_hz, module)?)?;
    module.add_class::<structure::Assembly>()?;
    module.add_function(wrap_pyfunction!(structure::modes_of_matrices, module)?)?;
    module.add_function(wrap_pyfunction!(structure::modes_of_structure, module)?)?;
    module.add_function(wrap_pyfunction!(basins::ensemble, module)?)?;
    module.add_class::<basins::Attractors>()?;
    module.add_class::<continuation::TracedBranch>()?;
    module.add_class::<continuation::Traced>()?;
    module.add_function(wrap_pyfunction!(continuation::trace_branch, module)?)?;
    module.add_class::<scenario::Scenario>()?;
    module.add_class::<plant::Plant>()?;
    module.add_class::<plant::Measurement>()?;
    module.add_class::<recording::Recording>()?;
    module.add_class::<recording::Reader>()?;
    module.add_function(wrap_pyfunction!(recording::arm_channels, module)?)?;
    module.add_function(wrap_pyfunction!(recording::known_vectors, module)?)?;
    module.add_function(wrap_pyfunction!(recording::overrun_causes, module)?)?;
    module.add_function(wrap_pyfunction!(spectra::densities, module)?)?;
    module.add_function(wrap_pyfunction!(spectra::frequency_responses, module)?)?;
    module.add_function(wrap_pyfunction!(spectra::shock_responses, module)?)?;
    module.add_function(wrap_pyfunction!(judge::judge, module)?)?;
    module.add_class::<log::LogWriter>()?;
    module.add_function(wrap_pyfunction!(log::import_log, module)?)?;
    module.add_class::<protocol::Network>()?;
    module.add_class::<protocol::Encoder>()?;
    module.add_class::<protocol::Decoder>()?;
    module.add_class::<bus::Hub>()?;
    module.add_class::<bus::BusEnd>()?;
    module.add_class::<session::NodeRun>()?;
    module.add_function(wrap_pyfunction!(session::run_both, module)?)?;
    Ok(())
}
