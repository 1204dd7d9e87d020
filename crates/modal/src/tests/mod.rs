#[path = "../../examples/scatter/closed_form.rs"]
mod closed_form;
mod fit;
mod generator;
mod levels;
mod reference;
mod scatter;
mod spectra;
mod surveys;

use nalgebra::Complex;
use serde_json::Value;

/// The numbers of an array of an oracle.
fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// The complex numbers of an array of pairs of an oracle.
fn complex(value: &Value) -> Vec<Complex<f64>> {
    value.as_array().unwrap().iter().map(|pair| Complex::new(numbers(pair)[0], numbers(pair)[1])).collect()
}
