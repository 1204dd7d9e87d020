//! Converts values of Python to TOML, and documents of the library to values of Python.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString};
use serde::Serialize;

use crate::errors;

/// A table of TOML, with its name for messages. A key whose value is `None` is left out.
pub fn table(name: &str, dict: &Bound<'_, PyDict>) -> PyResult<toml::Table> {
    let mut table = toml::Table::new();
    for (key, value) in dict {
        if !value.is_none() {
            let key: String = key.extract()?;
            let value = toml_value(&format!("{name}.{key}"), &value)?;
            table.insert(key, value);
        }
    }
    Ok(table)
}

fn toml_value(name: &str, value: &Bound<'_, PyAny>) -> PyResult<toml::Value> {
    // A truth value of Python is an integer, too, so it is asked for first.
    if value.is_instance_of::<PyBool>() {
        Ok(toml::Value::Boolean(value.extract()?))
    } else if value.is_instance_of::<PyInt>() {
        Ok(toml::Value::Integer(value.extract()?))
    } else if value.is_instance_of::<PyString>() {
        Ok(toml::Value::String(value.extract()?))
    } else if value.hasattr("tolist")? && !value.is_instance_of::<PyFloat>() {
        toml_value(name, &value.call_method0("tolist")?) // of NumPy
    } else if let Ok(dict) = value.cast::<PyDict>() {
        Ok(toml::Value::Table(table(name, dict)?))
    } else if value.is_instance_of::<PyFloat>() || value.hasattr("__float__")? {
        match value.extract::<f64>()? {
            // TOML can write `nan`, but no value of a scenario may be it. Here the message can name the argument.
            number if number.is_nan() => Err(errors::value(format!("{name} is NaN: it must be a number"))),
            number => Ok(toml::Value::Float(number)),
        }
    } else if let Ok(items) = value.try_iter() {
        Ok(toml::Value::Array(items.map(|item| toml_value(name, &item?)).collect::<PyResult<_>>()?))
    } else {
        Err(PyTypeError::new_err(format!(
            "{value:?} can't be written in TOML: give numbers, texts, lists or dictionaries"
        )))
    }
}

/// Two to `MOST` finite numbers, and zeros for those that are not given. `message` describes an invalid argument, given
/// as Python writes it: a `ValueError`, or a `TypeError` if it has no numbers.
pub fn two_or_more<const MOST: usize>(
    given: &Bound<'_, PyAny>,
    message: impl Fn(&str) -> String,
) -> PyResult<[f64; MOST]> {
    let padded = |numbers: &[f64]| core::array::from_fn(|place| numbers.get(place).copied().unwrap_or(0.0));
    // The usual arguments need no list.
    if let Ok((first, second)) = given.extract::<(f64, f64)>()
        && first.is_finite()
        && second.is_finite()
    {
        return Ok(padded(&[first, second]));
    }
    let refused = |kind: fn(String) -> PyErr| {
        let text = given.repr().map_or_else(|_| String::from("what has no repr()"), |text| text.to_string());
        kind(message(&text))
    };
    let wrong_type = |_error: PyErr| refused(PyTypeError::new_err);
    let items = given.try_iter().map_err(wrong_type)?.collect::<PyResult<Vec<_>>>()?;
    let numbers = items.iter().map(|item| item.extract().map_err(wrong_type)).collect::<PyResult<Vec<f64>>>()?;
    let fits = (2..=MOST).contains(&numbers.len()) && numbers.iter().all(|number| number.is_finite());
    if fits { Ok(padded(&numbers)) } else { Err(refused(errors::value)) }
}

/// A document as dictionaries, lists and numbers, as in JSON.
pub fn document<'py>(py: Python<'py>, document: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(document).map_err(errors::failed)?;
    py.import("json")?.call_method1("loads", (text,))
}
