//! The state on which a branch starts: numbers, or a state in a file of results or in a recording.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::failure::Failure;
use crate::numbers;
use crate::recordings;
use resonarm_numeric::number::short;

/// Share of the load's size around a time of a recording that must be the sine of the excitation.
const PURE: f64 = 0.9;
/// What the states in files are called in messages.
const PLACES: &str = "points/17 of a document of continue, sweeps/0/points/3 of sweep, motions/0 of basins, or a time in \
                      seconds of a recording";

/// A state at phase 0 of the load.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum StateFlag {
    /// Coordinates, rates, and possibly the states of elements.
    Numbers(Vec<f64>),
    /// A file, and where in it the state is.
    File(PathBuf, String),
}

impl StateFlag {
    pub fn parse(text: &str) -> Result<StateFlag, String> {
        let listed: Result<Vec<f64>, _> = text.split(',').map(numbers::finite).collect();
        // The last colon: the path before it may have others.
        match (listed, text.rsplit_once(':')) {
            (Ok(listed), _) => Ok(StateFlag::Numbers(listed)),
            (Err(_), Some((path, place))) if !path.is_empty() => Ok(StateFlag::File(path.into(), place.to_owned())),
            _ => Err(format!("it must be numbers, as 0.01,0,0.3,0, or FILE:PLACE, with PLACE {PLACES}")),
        }
    }

    /// Returns the file that is read, if there is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            StateFlag::Numbers(_) => None,
            StateFlag::File(path, _) => Some(path),
        }
    }

    /// Returns the state at phase 0 of a load of a frequency.
    pub fn state(&self, frequency_hz: f64) -> Result<Vec<f64>, Failure> {
        match self {
            StateFlag::Numbers(listed) => Ok(listed.clone()),
            StateFlag::File(path, place) if path.extension().is_some_and(|extension| extension == "mcap") => {
                let time_s = numbers::finite(place).map_err(|error| {
                    Failure::usage(format!("--from-state {}:{place}: the time in seconds: {error}", path.display()))
                })?;
                of_recording(path, time_s, frequency_hz)
            }
            StateFlag::File(path, place) => of_document(path, place),
        }
    }
}

/// Reads the state at a place of a document: a list of numbers, or what has one as `state` or the first of its `section`.
fn of_document(path: &Path, place: &str) -> Result<Vec<f64>, Failure> {
    let refused = |why: String| Failure::usage(format!("--from-state {}:{place}: {why}", path.display()));
    let text = fs::read_to_string(path).map_err(|error| refused(format!("the file can't be read: {error}")))?;
    let document: Value =
        serde_json::from_str(&text).map_err(|error| refused(format!("the file is no JSON document: {error}")))?;
    let mut at = &document;
    let mut walked = String::from("the document");
    // An empty place is the whole document, and a slash too many changes nothing.
    for step in place.split('/').filter(|step| !step.is_empty()) {
        let next = match at {
            Value::Array(list) => step.parse::<usize>().ok().and_then(|index| list.get(index)),
            other => other.get(step),
        };
        let known = match at {
            Value::Array(list) => format!("entries 0 to {}", list.len().saturating_sub(1)),
            Value::Object(keys) => format!("the keys {}", keys.keys().cloned().collect::<Vec<_>>().join(", ")),
            _ => String::from("no parts"),
        };
        at = next.ok_or_else(|| refused(format!("{walked} has {known}, and no `{step}`")))?;
        walked = format!("`{step}`");
    }
    let state = at.get("state").or_else(|| at.get("section")?.get(0)).unwrap_or(at);
    let numbers = state.as_array().and_then(|list| list.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>());
    numbers.ok_or_else(|| refused(format!("no state is there; give {PLACES}")))
}

/// Reads the state of a recording at the first phase 0 of the load from a time on: coordinates and rates, in between two
/// samples in proportion to time.
///
/// A load that is held from sample to sample is a sine that lags by half a sample.
fn of_recording(path: &Path, time_s: f64, frequency_hz: f64) -> Result<Vec<f64>, Failure> {
    let recording = recordings::open(path)?;
    let refused = |why: String| Failure::usage(format!("--from-state {}:{}: {why}", path.display(), short(&time_s)));
    let period_s = 1.0 / recording.scenario()?.simulation.rate_hz;
    // Two periods of the load: phase 0 is in the first, and another sample follows it.
    let first = (time_s / period_s).round();
    let count = (2.0 / (frequency_hz * period_s)).ceil();
    let mut records = Vec::new();
    for record in recording.states()? {
        let record = record?;
        let after = record.sample as f64 - first;
        // The state at the end of a run has no load.
        if after >= 0.0 && !record.is_end {
            records.push(record);
        }
        if after >= count {
            break;
        }
    }
    if (records.len() as f64) < count {
        let hz = short(&frequency_hz);
        return Err(refused(format!("the recording must go on for two periods of {hz} Hz from there")));
    }
    let omega = core::f64::consts::TAU * frequency_hz;
    let phase = |index: usize| libm::sincos(omega * index as f64 * period_s);
    let parts = records[0].load.parts().len();
    // A, B of A sin Ωt + B cos Ωt of each part by least squares, and the mean square of the part. The samples need not fill
    // whole periods, so that sine and cosine are not quite orthogonal.
    let component = |part: usize| {
        let [mut ss, mut sc, mut cc, mut by_sine, mut by_cosine, mut square] = [0.0; 6];
        for (index, record) in records.iter().enumerate() {
            let (s, c) = phase(index);
            let load = record.load.parts()[part];
            ss += s * s;
            sc += s * c;
            cc += c * c;
            by_sine += load * s;
            by_cosine += load * c;
            square += load * load;
        }
        let determinant = ss * cc - sc * sc;
        let sine = (cc * by_sine - sc * by_cosine) / determinant;
        let cosine = (ss * by_cosine - sc * by_sine) / determinant;
        (sine, cosine, square / records.len() as f64)
    };
    let largest = (0..parts).map(component).max_by(|a, b| a.2.total_cmp(&b.2));
    let Some((sine, cosine, square)) = largest.filter(|(.., square)| *square > 0.0) else {
        return Err(refused(String::from("no load acts there")));
    };
    // A sine of the amplitude √(A² + B²) has half of its square as its mean square.
    if 0.5 * (sine * sine + cosine * cosine) < PURE * PURE * square {
        return Err(refused(format!("the load there is no sine of {} Hz", short(&frequency_hz))));
    }
    // Phase 0 where Ωt + φ is a multiple of 2π, half a sample later.
    let lead = libm::atan2(cosine, sine).rem_euclid(core::f64::consts::TAU);
    let place = (core::f64::consts::TAU - lead) / (omega * period_s) + 0.5;
    let before = place.floor() as usize;
    let share = place.fract();
    // Phase 0 is in the first of two periods, so the limit matters only with fewer than two samples in one.
    let [from, to] = [before, before + 1].map(|index| records[index.min(records.len() - 1)].states.moving());
    Ok(from.iter().zip(to).map(|(from, to)| from + share * (to - from)).collect())
}
