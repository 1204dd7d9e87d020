//! Recordings judged by specifications of tests.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use resonarm::judge::{Document, JudgeError, JudgeOptions};
use resonarm::scenario::specification;
use resonarm::specification::{PRESETS, Specification};
use serde_json::{Map, json};

use crate::recording::Recording;
use crate::{errors, values};

/// Reads a specification: a file, or a preset if no file has its name.
fn read(name: &Path) -> PyResult<Specification> {
    let preset = PRESETS.into_iter().find(|preset| name.as_os_str() == preset.name);
    // A file goes before a preset of its name, a dangling link included: its error is better than another
    // specification.
    match preset.filter(|_| name.symlink_metadata().is_err()) {
        Some(preset) => specification::parse(preset.text, preset.name, Path::new("")),
        None => specification::read(name),
    }
    .map_err(errors::value)
}

fn error(error: JudgeError) -> PyErr {
    match error {
        JudgeError::Signals(error) => errors::signals(error),
        error => errors::value(error),
    }
}

/// Judges channels of a recording, by default those of the specification, over a range of simulated time, s. The document is that
/// of `resonarm verdict --json`.
#[pyfunction]
pub fn judge<'py>(
    py: Python<'py>,
    recording: &Recording,
    specification: PathBuf,
    channels: Vec<String>,
    reference: Option<String>,
    range_s: [Option<f64>; 2],
) -> PyResult<Bound<'py, PyAny>> {
    let mut names = Map::new();
    names.insert(String::from("specification"), json!(specification.to_string_lossy()));
    names.insert(String::from("recording"), json!(recording.inner.path().to_string_lossy()));
    names.insert(String::from("reference"), json!(reference));
    let options = JudgeOptions { channels, reference, range_s };
    let (specification, judged) = py.detach(|| {
        let specification = read(&specification)?;
        let judged = resonarm::judge::judge(&specification, &recording.inner, &options).map_err(error)?;
        Ok::<_, PyErr>((specification, judged))
    })?;
    values::document(py, &Document::new(names, &specification, &recording.inner, &judged))
}
