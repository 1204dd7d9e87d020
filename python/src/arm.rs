//! The arm: parameters, modes, frequency responses, and its motion under a sine.

use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict, PyTuple};
use resonarm::analysis::{self, Drive, FrequencyResponse, Quantity, Response};
use resonarm::arm::{self, Load, Preset, Sine, State};
use resonarm::integrate::{Integrator, Scheme};
use resonarm::plant::PlantSpecError;
use resonarm::scenario::{ArmSection, Scenario, SimulationSection};

use crate::errors;
use crate::rows::{Rows, numbers};
use crate::values;

/// The arm of `resonarm.Arm`.
#[pyclass(frozen, subclass, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Arm {
    pub inner: arm::Arm,
    section: ArmSection,
}

/// A natural mode of the linearised arm, or of another structure.
#[pyclass(frozen, eq, module = "resonarm._resonarm")]
#[derive(Debug, PartialEq)]
pub struct Mode {
    /// Natural frequency of the undamped structure, Hz.
    frequency_hz: f64,
    /// Damping ratio.
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

    /// Natural frequency of the undamped structure, Hz.
    #[getter]
    fn frequency_hz(&self) -> f64 {
        self.frequency_hz
    }

    /// Damping ratio.
    #[getter]
    fn damping_ratio(&self) -> f64 {
        self.damping_ratio
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
        let (shape, comma) = (shape.join(", "), if shape.len() == 1 { "," } else { "" });
        format!("Mode(frequency_hz={frequency_hz:.4}, damping_ratio={damping_ratio:.3e}, shape=({shape}{comma}))")
    }
}

/// The names of the presets.
#[pyfunction]
pub fn presets() -> Vec<&'static str> {
    Preset::ALL.map(Preset::name).to_vec()
}

/// Steps between two looks for signals: some 20 ms of work.
pub const STEPS_A_LOOK: u64 = 1 << 15;

#[pymethods]
impl Arm {
    #[new]
    #[pyo3(signature = (preset = "irb1600-fitted", *, beta1_deg = 0.0, beta2_deg = 60.0, parameters = None))]
    fn new(preset: &str, beta1_deg: f64, beta2_deg: f64, parameters: Option<&Bound<'_, PyDict>>) -> PyResult<Arm> {
        let parameters = parameters.map(|given| values::table("parameters", given)).transpose()?.unwrap_or_default();
        let section =
            ArmSection { preset: preset.to_owned(), beta1_deg, beta2_deg, parameters, ..ArmSection::default() };
        let scenario = Scenario { arm: section, ..Scenario::default() };
        Ok(Arm { inner: scenario.build_arm().map_err(errors::scenario)?, section: scenario.arm })
    }

    /// The name of the preset.
    #[getter]
    fn preset(&self) -> &str {
        &self.section.preset
    }

    /// β1, degrees.
    #[getter]
    fn beta1_deg(&self) -> f64 {
        self.section.beta1_deg
    }

    /// β2, degrees.
    #[getter]
    fn beta2_deg(&self) -> f64 {
        self.section.beta2_deg
    }

    /// All parameters by name, in SI units.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::document(py, self.inner.parameters())
    }

    /// The parameters that differ from the preset's.
    #[getter]
    fn own_parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::document(py, &self.section.parameters)
    }

    /// The arguments that make the same arm again.
    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((String,), Bound<'py, PyDict>)> {
        let keywords = PyDict::new(py);
        keywords.set_item("beta1_deg", self.section.beta1_deg)?;
        keywords.set_item("beta2_deg", self.section.beta2_deg)?;
        keywords.set_item("parameters", self.own_parameters(py)?)?;
        Ok(((self.section.preset.clone(),), keywords))
    }

    /// Both natural modes, the lower first.
    fn modes(&self) -> Vec<Mode> {
        let mode = |mode: analysis::Mode| Mode::new(mode.frequency_hz, mode.damping_ratio, mode.shape.into());
        analysis::modes(&self.inner).map(mode).into()
    }

    /// Complex responses at these frequencies, Hz, given as the bytes of an array.
    fn frf_at<'py>(
        &self,
        py: Python<'py>,
        frequency_hz: &[u8],
        terms: (String, String, String),
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let (drive, response, quantity) = terms;
        let drive: Drive = drive.parse().map_err(errors::value)?;
        let response: Response = response.parse().map_err(errors::value)?;
        let quantity: Quantity = quantity.parse().map_err(errors::value)?;
        let mut rows = Rows::default();
        py.detach(|| {
            let arm = FrequencyResponse::new(&self.inner);
            numbers(frequency_hz).into_iter().try_for_each(|hz| {
                let found = arm.at(quantity, drive, response, hz)?;
                rows.numbers(&[found.re, found.im]);
                Ok(())
            })
        })
        .map_err(errors::frf)?;
        rows.into_bytes(py)
    }

    /// Rows of t, α and α̇ from `initial` on under a sine. `stepping` is a scheme and the steps a second, `length` the
    /// number of steps and the number from row to row; the end has a row, too.
    fn motion<'py>(
        &self,
        py: Python<'py>,
        initial: [f64; 4],
        sine: SineParts,
        stepping: (Option<String>, f64),
        length: (u64, u64),
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let sine = sine.sine();
        let ((scheme, rate_hz), (steps, every)) = (stepping, length);
        let scheme = self::scheme(scheme.as_deref())?;
        let integrator = Integrator::new(scheme, rate_hz, &self.inner).map_err(errors::value)?;
        let mut state = state(&initial);
        if !state.is_finite() {
            return Err(errors::value(PlantSpecError::Initial(initial.to_vec())));
        }
        let mut rows = Rows::default();
        push(&mut rows, 0.0, &state);
        let mut step = 0;
        while step < steps {
            let until = steps.min(step + STEPS_A_LOOK);
            py.detach(|| {
                for k in step..until {
                    state = integrator.step(&self.inner, k as f64 / rate_hz, &state, &sine).map_err(errors::failed)?;
                    if (k + 1) % every == 0 || k + 1 == steps {
                        push(&mut rows, (k + 1) as f64 / rate_hz, &state);
                    }
                }
                Ok::<_, PyErr>(())
            })?;
            py.check_signals()?;
            step = until;
        }
        rows.into_bytes(py)
    }
}

/// A sine of Python: torques at the joints, N·m, and forces at the tip, N, at its peak; its frequency, Hz.
#[derive(Clone, Copy, Debug, FromPyObject)]
pub struct SineParts([f64; 2], [f64; 2], f64);

impl SineParts {
    /// The same for the library.
    pub fn sine(self) -> Sine {
        let SineParts(torque_nm, force_n, frequency_hz) = self;
        Sine { amplitude: Load { torque_nm: torque_nm.into(), force_n: force_n.into() }, frequency_hz }
    }
}

/// The state of α1, α2, α̇1, α̇2.
pub fn state(numbers: &[f64; 4]) -> State {
    let [x1, x2, v1, v2] = *numbers;
    State::new([x1, x2], [v1, v2])
}

/// A row of t, α and α̇.
pub fn push(rows: &mut Rows, t_s: f64, state: &State) {
    let (x, v) = (&state.alpha_rad, &state.alpha_dot_rad_s);
    rows.numbers(&[t_s, x.x, x.y, v.x, v.y]);
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
