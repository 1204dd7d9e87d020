//! A controller written in Python.

use std::sync::{Arc, PoisonError};

use pyo3::prelude::*;
use resonarm::control::{Answer, Controller, Length, LoadKind, ResponsePoint};
use resonarm::rig;
use resonarm::rig::Load;

use crate::errors::{self, Raised};
use crate::plant::Measurement;
use crate::values;

/// Called with each sample: returns two components of a load, or `None` when the work is done.
#[derive(Debug)]
pub struct PyController {
    call: Py<PyAny>,
    kind: LoadKind,
    raised: Raised,
}

/// Parses `force` or `torque`.
pub fn load_kind(name: &str) -> PyResult<LoadKind> {
    match name {
        "force" => Ok(LoadKind::Force),
        "torque" => Ok(LoadKind::Torque),
        _ => Err(errors::value(format!("load is `{name}`: it must be force or torque"))),
    }
}

/// The two components that a controller returned for a sample.
fn load(answer: &Bound<'_, PyAny>, sample: u64) -> PyResult<[f64; 2]> {
    values::two_or_more(answer, |returned| {
        format!(
            "the controller returned {returned} for sample {sample}: expected a load, two finite numbers, or None to end the work"
        )
    })
}

impl PyController {
    /// A controller that stores an exception of `call` in `raised`.
    pub fn new(call: &Py<PyAny>, kind: LoadKind, raised: &Raised) -> PyController {
        let call = Python::attach(|py| call.clone_ref(py));
        PyController { call, kind, raised: Arc::clone(raised) }
    }

    /// The result, or the end of the work after an exception.
    fn keep<T>(&self, result: PyResult<T>) -> Option<T> {
        result.map_err(|error| *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error)).ok()
    }
}

impl Controller for PyController {
    fn load_kind(&self) -> LoadKind {
        self.kind
    }

    fn restart(&mut self) {
        // The method is optional: a plain function has none.
        let restarted = Python::attach(|py| match self.call.bind(py).getattr_opt("restart")? {
            Some(restart) => restart.call0().map(drop),
            None => Ok(()),
        });
        self.keep(restarted);
    }

    fn answer(&mut self, sample: &rig::Measurement) -> Answer {
        let answered = Python::attach(|py| {
            let answer = self.call.bind(py).call1((Measurement::from(*sample),))?;
            if answer.is_none() { Ok(None) } else { load(&answer, sample.sample).map(Some) }
        });
        match (self.keep(answered).flatten(), self.kind) {
            (None, _) => Answer::Finished,
            (Some([x, y]), LoadKind::Force) => Answer::Hold(Load::force_n(x, y)),
            (Some([first, second]), LoadKind::Torque) => Answer::Hold(Load::torque_nm(first, second)),
        }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Unknown
    }
}
