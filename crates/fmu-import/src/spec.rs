//! Specification of an imported FMU: which of its variables the plant sets and reads.

use std::collections::BTreeMap;

use resonarm_bench::rig::{InstrumentName, SensorSpec};

use serde::{Deserialize, Serialize};

/// When within a hold outputs are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ReadAt {
    /// After each communication step: the instruments have the motion in the middle of the hold.
    #[default]
    Middle,
    /// At its end: the FMU has sampled its motion itself. The hold is one communication step.
    End,
}

/// The variables of a degree of freedom: of a point along an axis in m, m/s, m/s² and N, of a joint or a mode the
/// coordinate and its rate.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutputsOf {
    /// Variable of the displacement from rest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub displacement: Option<String>,
    /// Variable of the velocity, the rate of `displacement`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity: Option<String>,
    /// Variable with the acceleration, the rate of `velocity`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration: Option<String>,
    /// Variable with the force in the impedance head, of an FMU that samples it itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force: Option<String>,
}

/// The value of a parameter: a number, or those of an array in the order of its memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Numbers {
    /// The value of a scalar.
    One(f64),
    /// The elements of an array.
    Many(Vec<f64>),
}

impl Numbers {
    /// Returns the numbers; a scalar is a slice of one.
    pub fn as_slice(&self) -> &[f64] {
        match self {
            Numbers::One(number) => core::slice::from_ref(number),
            Numbers::Many(numbers) => numbers,
        }
    }
}

/// What is wanted of an FMU. Degrees of freedom are points along an axis, `tip.x`, joints, `joint1`, and modes,
/// `mode1`; an element of an array variable is `name[2]`, counted from 1 in the order of its memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spec {
    /// The variables that take loads, by degree of freedom.
    pub inputs: BTreeMap<String, String>,
    /// The variables that are read, by degree of freedom.
    pub outputs: BTreeMap<String, OutputsOf>,
    /// Values of parameters, in the units of the FMU.
    pub parameters: BTreeMap<String, Numbers>,
    /// When outputs are read.
    pub read: ReadAt,
    /// The point of the exciter; without it `tip`.
    pub exciter: Option<String>,
    /// The point of accelerometer B; without it `joint2` if it is read, else the exciter's.
    pub accelerometer_b: Option<String>,
    /// The point of accelerometer C; without it the exciter's.
    pub accelerometer_c: Option<String>,
    /// The sensors beside B and C.
    pub sensors: BTreeMap<InstrumentName, SensorSpec>,
    /// From sample to sample, s.
    pub sample_s: f64,
    /// Communication steps a sample.
    pub steps_per_sample: u32,
    /// Whether the converters have a filter, which needs velocities.
    pub is_filtered: bool,
    /// Whether commands are refused beyond a travel, which needs displacements.
    pub limits_travel: bool,
}
