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

use pyo3::pymodule;

/// Makes the extension module, with all its classes and functions.
#[pymodule]
mod _resonarm {
    use super::logging;
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::{
        basins::{Attractors, ensemble},
        bus::{BusEnd, Hub},
        continuation::{Traced, TracedBranch, trace_branch},
        errors::{ResonarmError, printable_text},
        judge::judge,
        log::{LogWriter, import_log},
        modes::{Mode, presets, step_rate_hz},
        plant::{Measurement, Plant},
        protocol::{Decoder, Encoder, Network},
        recording::{Reader, Recording, known_vectors, overrun_causes},
        scenario::Scenario,
        session::{NodeRun, run_both},
        spectra::{densities, frequency_responses, shock_responses},
        structure::{Assembly, modes_of_matrices, modes_of_structure},
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Before any call: the library may warn of a scenario as soon as it reads one.
        logging::begin();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
