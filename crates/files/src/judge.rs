//! Recordings judged by specifications of tests.

use serde::Serialize;
use serde_json::Value;
use thiserror::Error;

use crate::export::RecordingPart;
use crate::recording::Recording;
use crate::signals::{SignalError, Signals};
use resonarm_bench::structure::{Channel, Kind, Point, Quantity};
use resonarm_scenario::Scenario;
use resonarm_specification::verdict::{
    Begin, BeginBy, LevelVerdict, RandomOptions, RandomVerdict, ShockVerdict, SineVerdict, SrsVerdict, Verdict,
    judge_level, judge_random, judge_shock, judge_sine, judge_srs,
};
use resonarm_specification::{Specification, Test, VerdictError};

/// What of a recording is judged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JudgeOptions {
    /// Control channels; empty for those of the specification. A name is that of a channel, of a vector of channels, or a sensor
    /// with an axis, as `c.x`.
    pub channels: Vec<String>,
    /// Channel that gives the phase of a sine, the drive or the force; the control channel itself without it.
    pub reference: Option<String>,
    /// Range of simulated time, s. The test begins at its start, or where the record shows it if no start is given. Of a random
    /// test the longest stretch at full level is judged if neither end is given.
    pub range_s: [Option<f64>; 2],
}

/// A recording with the verdict on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// Verdict: the worse of that on the record and that on its levels, and undecided instead of in if readings are clipped or
    /// no test begins in the record.
    pub verdict: Verdict,
    /// The verdict's parts, by the kind of test.
    pub found: Found,
    /// Where the test begins; `None` if the record does not show it.
    pub begins: Option<TestBegin>,
    /// Names of the control channels.
    pub channels: Vec<String>,
    /// Number of clipped values of all channels.
    pub clipped: usize,
    /// Sample rate of the recording, Hz.
    pub rate_hz: f64,
    /// Judged range of simulated time, s.
    pub range_s: [f64; 2],
    /// Levels of a random test whose longest stretch at full level is judged, or the whole record if there is none; `None` if a
    /// range is given, and if the record is too short.
    pub level: Option<LevelVerdict>,
    /// Values of the first control channel over the range, m/s².
    pub reading: Vec<f64>,
}

impl Judged {
    /// Says whether the recording passes. One that is undecided passes by the user's choice, unless no test begins in it: that
    /// shows a controller that did not run its test, not a record that is too short.
    pub fn passes(&self, passes_undecided: bool) -> bool {
        match self.verdict {
            Verdict::In => true,
            Verdict::Undecided => passes_undecided && self.begins.is_some(),
            Verdict::Out => false,
        }
    }
}

/// Where the test begins in a recording. What a controller does before, such as an identification at low level, is not judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestBegin {
    /// Simulated time at which the test begins, s.
    pub at_s: f64,
    /// What shows that the test begins there.
    pub by: BeginBy,
}

/// Record in which the test does not begin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotBegun {
    /// Undecided: the record shows neither that the test is in nor that it is out.
    pub verdict: Verdict,
    /// Why not, in words: no sweep or no shot is in it.
    pub reason: String,
}

/// What was found, in the figures of the kind of the test.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Found {
    /// Of a random test.
    Random(RandomVerdict),
    /// Of a swept sine.
    Sine(SineVerdict),
    /// Of a classical shock.
    Shock(ShockVerdict),
    /// Of a shock by its response spectrum.
    Srs(SrsVerdict),
    /// Of a sine or a shock that is not in the record.
    NotBegun(NotBegun),
}

impl Found {
    /// Returns the verdict on the record.
    pub const fn verdict(&self) -> Verdict {
        match self {
            Found::Random(found) => found.verdict,
            Found::Sine(found) => found.verdict,
            Found::Shock(found) => found.verdict,
            Found::Srs(found) => found.verdict,
            Found::NotBegun(found) => found.verdict,
        }
    }
}

/// A verdict with what was judged, as `resonarm verdict --json` and Python have it.
#[derive(Clone, Debug, Serialize)]
pub struct Document<'a> {
    /// What was judged: the names of the specification and the recording, and the options.
    pub configuration: Value,
    /// The specification that the record was judged by.
    pub specification: &'a Specification,
    /// Verdict on the recording.
    pub verdict: Verdict,
    /// Number of clipped values of all channels.
    pub clipped: usize,
    /// Simulated time at which the test begins, s; `None` if the record does not show it.
    pub begins_s: Option<f64>,
    /// What shows that the test begins there; `None` if no test begins.
    pub begins_by: Option<BeginBy>,
    /// What the converters read at the highest frequency of the specification, of which the acceleration is 0 dB.
    pub converters: Option<Droop>,
    /// Levels of the record of a random test.
    pub level: Option<&'a LevelVerdict>,
    /// The verdict's parts, by the kind of test.
    pub found: &'a Found,
}

/// What converters read of a sine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Droop {
    /// Frequency of the sine, Hz.
    pub frequency_hz: f64,
    /// Reading over the acceleration, dB.
    pub gain_db: f64,
}

impl<'a> Document<'a> {
    /// Makes the document of a judged recording. `names` are entries of the configuration beside those of the verdict itself.
    pub fn new(
        mut names: serde_json::Map<String, Value>,
        specification: &'a Specification,
        recording: &Recording,
        judged: &'a Judged,
    ) -> Document<'a> {
        names.insert(String::from("channels"), judged.channels.clone().into());
        names.insert(String::from("from_s"), judged.range_s[0].into());
        names.insert(String::from("to_s"), judged.range_s[1].into());
        names.insert(String::from("rate_hz"), judged.rate_hz.into());
        Document {
            configuration: Value::Object(names),
            specification,
            verdict: judged.verdict,
            clipped: judged.clipped,
            begins_s: judged.begins.map(|begins| begins.at_s),
            begins_by: judged.begins.map(|begins| begins.by),
            converters: droop(recording, specification, judged.rate_hz),
            level: judged.level.as_ref(),
            found: &judged.found,
        }
    }
}

/// Returns what the converters of a recording read at the highest frequency of a specification; `None` if the recording has no
/// scenario, or the specification no band.
fn droop(recording: &Recording, specification: &Specification, rate_hz: f64) -> Option<Droop> {
    let scenario = Scenario::from_configuration(recording.configuration()).ok()?;
    let [_, frequency_hz] = specification.test.band_hz()?;
    let gain = scenario.rig.converter.gain(frequency_hz / rate_hz);
    Some(Droop { frequency_hz, gain_db: 20.0 * libm::log10(gain) })
}

/// Reason why a recording can't be judged.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum JudgeError {
    /// The channels can't be read.
    #[error(transparent)]
    Signals(#[from] SignalError),
    /// The record does not suit the specification.
    #[error(transparent)]
    Record(#[from] VerdictError),
    /// No control channel is named.
    #[error("the control channel is missing: name it, here or in `control.channels` of the specification; the recording has {}", known.join(", "))]
    NoChannel {
        /// Accelerations of the recording.
        known: Vec<String>,
    },
    /// A channel is not an acceleration.
    #[error("{name} is in {unit}: a specification is about accelerations, m/s²")]
    NotAcceleration {
        /// Name of the channel.
        name: String,
        /// Unit of the channel.
        unit: &'static str,
    },
    /// Several control channels are named for a test with one.
    #[error("a sine or a shock has one control channel, got {got}: name one, as {first}")]
    SeveralChannels {
        /// Number of channels that were named.
        got: usize,
        /// Name of the first one.
        first: String,
    },
    /// The reference of a sine is a vector.
    #[error("the reference {got} is a vector: name one of its components, as {first}")]
    Vector {
        /// Name that was given.
        got: String,
        /// Name of the first component.
        first: String,
    },
    /// A reference is named for a test without a phase.
    #[error("a reference gives the phase of a sine: leave it out for other tests")]
    Reference,
}

/// Judges a recording by a specification.
///
/// # Errors
/// [`JudgeError`] if the channels can't be read, or the record does not suit the specification.
pub fn judge(
    specification: &Specification,
    recording: &Recording,
    options: &JudgeOptions,
) -> Result<Judged, JudgeError> {
    let test = &specification.test;
    let limits = &specification.limits;
    if options.reference.is_some() && !matches!(test, Test::Sine(_)) {
        return Err(JudgeError::Reference);
    }
    // The channels of the specification hold for its own bench, and the recording may be of another, so that the
    // options come first.
    let named = if options.channels.is_empty() { &specification.control.channels } else { &options.channels };
    if named.is_empty() {
        let known = accelerations(recording).map(|channel| channel.name.to_string()).collect();
        return Err(JudgeError::NoChannel { known });
    }
    let responses = limits.response.iter().map(|limit| &limit.channel);
    let names: Vec<String> = named.iter().chain(responses).map(|name| channel_name(recording, name)).collect();
    let signals = Signals::read(recording, &names, options.range_s)?;
    if let Some(channel) = signals.channels.iter().find(|channel| channel.quantity != Quantity::Acceleration) {
        let name = channel.name.to_string();
        let unit = channel.quantity.unit();
        return Err(JudgeError::NotAcceleration { name, unit });
    }
    // A vector stands for several control channels; those of the limits come last.
    let controls = signals.channels.len().saturating_sub(limits.response.len());
    let channels: Vec<String> = signals.channels[..controls].iter().map(|channel| channel.name.to_string()).collect();
    if controls > 1 && !matches!(test, Test::Random(_)) {
        return Err(JudgeError::SeveralChannels { got: controls, first: channels[0].clone() });
    }
    let rate_hz = signals.rate_hz;
    let level = match (test, options.range_s) {
        (Test::Random(test), [None, None]) => {
            signals.values.first().and_then(|control| judge_level(test, rate_hz, control))
        }
        _ => None,
    };
    let range = level.as_ref().and_then(|level| level.longest.clone()).unwrap_or(0..signals.count());
    let values: Vec<&[f64]> = signals.values.iter().map(|values| &values[range.clone()]).collect();
    let (control, responses) = values.split_at(controls);
    let reading = control.first().copied().unwrap_or_default();
    let begin = if options.range_s[0].is_some() { Begin::Start } else { Begin::Searched };
    let judged = match test {
        Test::Random(test) => {
            let options = RandomOptions { control, responses, average: specification.control.average };
            judge_random(test, limits, rate_hz, &options).map(Found::Random)
        }
        Test::Sine(test) => {
            let reference = options.reference.as_ref().map(|name| reference(recording, name, options.range_s));
            let reference = reference.transpose()?;
            judge_sine(test, limits, rate_hz, reading, reference.as_deref(), responses, begin).map(Found::Sine)
        }
        Test::Shock(test) => judge_shock(test, rate_hz, reading, begin).map(Found::Shock),
        Test::Srs(test) => judge_srs(test, rate_hz, reading).map(Found::Srs),
    };
    let found = match judged {
        Err(error @ (VerdictError::NoSweep { .. } | VerdictError::NoShot { .. })) => {
            Found::NotBegun(NotBegun { verdict: Verdict::Undecided, reason: error.to_string() })
        }
        judged => judged?,
    };
    let clipped = signals.clipped.iter().sum();
    let at = |sample: usize| signals.start_s + sample as f64 / rate_hz;
    let range_s = [at(range.start), at(range.end)];
    let is_at_level = level.as_ref().is_some_and(|level| level.longest.is_some());
    let after_s = match &found {
        Found::NotBegun(_) => None,
        // A range that is given begins with the test.
        _ if begin == Begin::Start => Some(0.0),
        Found::Random(_) => (options.range_s[1].is_some() || is_at_level).then_some(0.0),
        Found::Sine(found) => Some(found.begins_s),
        Found::Shock(found) => Some(found.begins_s),
        Found::Srs(found) => found.shots.iter().find(|shot| shot.is_full).map(|shot| shot.t_s),
    };
    // What is beyond a sensor's range is not in the record, so it can't prove that the test is in; nor can a test that never
    // begins.
    let least = if clipped > 0 || after_s.is_none() { Verdict::Undecided } else { Verdict::In };
    // Verdicts ascend from in to out, so that the larger one is the worse.
    let verdict = level.iter().map(|level| level.verdict).fold(found.verdict().max(least), Verdict::max);
    let is_given = begin == Begin::Start || (matches!(test, Test::Random(_)) && options.range_s[1].is_some());
    let by = if is_given { BeginBy::Given } else { BeginBy::of(test) };
    Ok(Judged {
        verdict,
        begins: after_s.map(|after_s| TestBegin { at_s: range_s[0] + after_s, by }),
        channels,
        clipped,
        rate_hz,
        range_s,
        level,
        reading: reading.to_vec(),
        found,
    })
}

/// Reads the channel that gives the phase of a sine.
fn reference(recording: &Recording, name: &str, range_s: [Option<f64>; 2]) -> Result<Vec<f64>, JudgeError> {
    let name = channel_name(recording, name);
    let signals = Signals::read(recording, &[&name], range_s)?;
    if signals.channels.len() > 1 {
        return Err(JudgeError::Vector { got: name, first: signals.channels[0].name.to_string() });
    }
    Ok(signals.values.into_iter().next().unwrap_or_default())
}

/// Returns the accelerations that the sensors of a recording read.
fn accelerations(recording: &Recording) -> impl Iterator<Item = &Channel> {
    let is_wanted =
        |channel: &&Channel| matches!(channel.kind, Kind::Reading { .. }) && channel.quantity == Quantity::Acceleration;
    recording.channels().of(RecordingPart::Samples.topic()).iter().filter(is_wanted)
}

/// Returns the name of a channel in a recording: that of a reading for a sensor and an axis, as `c.x`, and any other as it is.
pub fn channel_name(recording: &Recording, name: &str) -> String {
    let sensor = |channel: &Channel| match channel.point {
        Point::Joint2B => String::from("b"),
        Point::TipC => String::from("c"),
        Point::Sensor { name, .. } => name.to_string(),
        _ => String::new(),
    };
    let found = name.split_once('.').and_then(|(of, axis)| {
        accelerations(recording).find(|channel| sensor(channel) == of && channel.axis.name() == axis)
    });
    found.map_or_else(|| name.to_owned(), |channel| channel.name.to_string())
}
