//! Values of Python as TOML, and documents of the library as values of Python.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString};
use serde::Serialize;

use crate::errors;

/// A table of TOML. A key whose value is `None` is left out.
pub fn table(dict: &Bound<'_, PyDict>) -> PyResult<toml::Table> {
    let mut table = toml::Table::new();
    for (key, value) in dict {
        if !value.is_none() {
            table.insert(key.extract()?, toml_value(&value)?);
        }
    }
    Ok(table)
}

fn toml_value(value: &Bound<'_, PyAny>) -> PyResult<toml::Value> {
    if value.is_instance_of::<PyBool>() {
        Ok(toml::Value::Boolean(value.extract()?))
    } else if value.is_instance_of::<PyInt>() {
        Ok(toml::Value::Integer(value.extract()?))
    } else if value.is_instance_of::<PyString>() {
        Ok(toml::Value::String(value.extract()?))
    } else if let Ok(dict) = value.cast::<PyDict>() {
        Ok(toml::Value::Table(table(dict)?))
    } else if value.is_instance_of::<PyFloat>() || value.hasattr("__float__")? {
        Ok(toml::Value::Float(value.extract()?))
    } else if let Ok(items) = value.try_iter() {
        Ok(toml::Value::Array(items.map(|item| toml_value(&item?)).collect::<PyResult<_>>()?))
    } else {
        Err(PyTypeError::new_err(format!("{value:?} has no form in TOML: give numbers, texts, lists or dictionaries")))
    }
}

/// A document as dictionaries, lists and numbers, as it stands in JSON.
pub fn document<'py>(py: Python<'py>, document: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(document).map_err(errors::failed)?;
    py.import("json")?.call_method1("loads", (text,))
}
