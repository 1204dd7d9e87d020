//! Scenarios as Python's classes and functions.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use resonarm::scenario::{self, ScenarioError};

use crate::errors;
use crate::values;

/// The scenario of `resonarm.Scenario`.
#[pyclass(frozen, subclass, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Scenario {
    pub inner: scenario::Scenario,
    /// The folder to which the path of a load file is relative.
    folder: PathBuf,
    /// The file that it was read from.
    file: Option<PathBuf>,
}

impl Scenario {
    /// The files that it was read from, which no recording may replace.
    pub fn files(&self) -> Vec<PathBuf> {
        self.file.as_deref().map_or(Vec::new(), scenario::Scenario::files)
    }
}

#[pymethods]
impl Scenario {
    /// Reads a text, or a file.
    #[new]
    #[pyo3(signature = (text = "", *, path = None, folder = None))]
    fn new(text: &str, path: Option<PathBuf>, folder: Option<PathBuf>) -> PyResult<Scenario> {
        let scenario = match path {
            Some(path) if text.is_empty() => Scenario {
                inner: scenario::Scenario::read(&path).map_err(errors::scenario)?,
                folder: path.parent().unwrap_or(Path::new("")).to_path_buf(),
                file: Some(path),
            },
            // With a text, the path says only which file the values are from.
            file => {
                let folder = folder.unwrap_or_default();
                let mut inner = scenario::Scenario::parse(text, "the scenario").map_err(errors::scenario)?;
                inner.read_files(&folder).map_err(errors::scenario)?;
                Scenario { inner, folder, file }
            }
        };
        for warning in scenario.inner.structure.warnings() {
            tracing::warn!("structure: {warning}");
        }
        Ok(scenario)
    }

    /// A scenario of the same class with other values: keys of a section, or the section removed where it is `None`. A
    /// `structure` with its `kind`, as that of `Chain.section`, is whole: nothing of the one before stays.
    #[pyo3(signature = (**sections))]
    fn replace<'py>(slf: &Bound<'py, Self>, sections: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        let this = slf.get();
        let mut whole = this.table()?;
        for (name, values) in sections.into_iter().flatten() {
            let name: String = name.extract()?;
            if values.is_none() {
                whole.remove(&name);
                continue;
            }
            let Ok(values) = values.cast::<PyDict>() else {
                let message =
                    format!("`{name}` is {values:?}: a section of a scenario is a dictionary of its keys, or None");
                return Err(errors::value(message));
            };
            let given = values::table(&name, values)?;
            // Keys of the structure before would be refused as those of another kind.
            if name == "structure" && given.contains_key("kind") {
                whole.insert(name, toml::Value::Table(given));
                continue;
            }
            let section = whole.entry(name).or_insert_with(|| toml::Value::Table(toml::Table::new()));
            let Some(section) = section.as_table_mut() else { continue };
            for (key, value) in values {
                if value.is_none() {
                    section.remove(&key.extract::<String>()?);
                }
            }
            // After the removals, as a table without the keys that are `None`.
            section.extend(given);
        }
        let keywords = PyDict::new(slf.py());
        keywords.set_item("folder", &this.folder)?;
        keywords.set_item("path", &this.file)?;
        let class: Bound<'py, PyType> = slf.get_type();
        class.call((whole.to_string(),), Some(&keywords))
    }

    /// The scenario as TOML, with every default written out.
    fn to_toml(&self) -> PyResult<String> {
        self.inner.to_toml().map_err(errors::scenario)
    }

    /// All sections and their values.
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::document(py, &self.inner)
    }

    /// The arguments that make the same scenario again.
    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((String,), Bound<'py, PyDict>)> {
        let keywords = PyDict::new(py);
        keywords.set_item("folder", &self.folder)?;
        Ok(((self.table()?.to_string(),), keywords))
    }
}

impl Scenario {
    fn table(&self) -> PyResult<toml::Table> {
        let table = toml::Table::try_from(&self.inner);
        table.map_err(|error| errors::scenario(ScenarioError::Write { reason: error.to_string() }))
    }
}
