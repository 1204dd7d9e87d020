//! Natural modes, and the names that calls take.

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use resonarm::integrate::Scheme;
use resonarm::scenario::SimulationSection;
use resonarm::structure::Preset;

use crate::errors;

/// A natural mode of a structure.
#[pyclass(frozen, eq, module = "resonarm._resonarm")]
#[derive(Debug, PartialEq)]
pub struct Mode {
    /// Natural frequency of the undamped structure, Hz.
    #[pyo3(get)]
    frequency_hz: f64,
    /// Damping ratio of the mode's pole λ, −Re λ/|λ|, dimensionless.
    #[pyo3(get)]
    damping_ratio: f64,
    /// Shape in the coordinates, normalised to the mass matrix.
    shape: Vec<f64>,
}

#[pymethods]
impl Mode {
    #[new]
    pub fn new(frequency_hz: f64, damping_ratio: f64, shape: Vec<f64>) -> Mode {
        Mode { frequency_hz, damping_ratio, shape }
    }

    /// Shape in the coordinates, normalised to the mass matrix.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.shape)
    }

    fn __getnewargs__<'py>(&self, py: Python<'py>) -> PyResult<(f64, f64, Bound<'py, PyTuple>)> {
        Ok((self.frequency_hz, self.damping_ratio, self.shape(py)?))
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        self.__getnewargs__(py)?.into_pyobject(py)?.hash()
    }

    fn __repr__(&self) -> String {
        let Mode { frequency_hz, damping_ratio, shape } = self;
        let shape: Vec<String> = shape.iter().map(|entry| format!("{entry:.4}")).collect();
        // Python writes a tuple of one element with a comma.
        let (shape, comma) = (shape.join(", "), if shape.len() == 1 { "," } else { "" });
        format!("Mode(frequency_hz={frequency_hz:.4}, damping_ratio={damping_ratio:.3e}, shape=({shape}{comma}))")
    }
}

/// The names of the presets.
#[pyfunction]
pub fn presets() -> Vec<&'static str> {
    Preset::ALL.map(Preset::name).to_vec()
}

/// The scheme of this name, or the default one.
pub fn scheme(name: Option<&str>) -> PyResult<Scheme> {
    name.map_or(Ok(Scheme::default()), str::parse).map_err(errors::value)
}

/// Steps a second of a scheme, Hz, at the sample rate of a scenario that states none.
#[pyfunction]
#[pyo3(signature = (name = None))]
pub fn step_rate_hz(name: Option<&str>) -> PyResult<f64> {
    Ok(SimulationSection { scheme: scheme(name)?, ..SimulationSection::default() }.step_rate_hz())
}
