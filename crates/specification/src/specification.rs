//! Specifications: a test with its sources, control channels and limits.

use alloc::string::String;
use alloc::vec::Vec;

use serde::Serialize;

use crate::error::{SpecificationError, idle, missing};
use crate::file::{Control, Kind, LimitsSection, SpecificationFile, any_positive, checked};
use crate::profile::Profile;
use crate::random::RandomTest;
use crate::shock::ShockTest;
use crate::sine::SineTest;
use crate::srs::SrsTest;

/// A specification of a vibration or shock test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Specification {
    /// Name, if it has one.
    pub name: Option<String>,
    /// Sources, such as standards with edition and paragraph, each with what the specification is to it: normative, approximate
    /// or indicative.
    pub sources: Vec<String>,
    /// The test: random, swept sine, shock or response spectrum.
    pub test: Test,
    /// The channels that are controlled, and how they are averaged.
    pub control: Control,
    /// Limits of the drive and of responses.
    pub limits: Limits,
}

/// Kind of a test, with what is specified.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Test {
    /// A random test, by its acceleration spectral density.
    Random(RandomTest),
    /// A swept sine, by its levels over frequency.
    Sine(SineTest),
    /// A classical shock, by its pulse.
    Shock(ShockTest),
    /// A shock by its response spectrum.
    Srs(SrsTest),
}

impl Test {
    /// Returns the kind in a word.
    pub const fn kind(&self) -> &'static str {
        match self {
            Test::Random(_) => "random",
            Test::Sine(_) => "sine",
            Test::Shock(_) => "shock",
            Test::Srs(_) => "srs",
        }
    }

    /// Returns the lowest and the highest frequency, Hz; `None` of a classical shock, which has no band of its own.
    pub fn band_hz(&self) -> Option<[f64; 2]> {
        match self {
            Test::Random(test) => Some(test.profile.band_hz()),
            Test::Sine(test) => Some(test.band_hz()),
            Test::Shock(_) => None,
            Test::Srs(test) => Some(test.profile.band_hz()),
        }
    }
}

/// Limits of the drive and of responses.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Limits {
    /// Largest force, N, if it is stated.
    pub drive_peak_n: Option<f64>,
    /// Largest peak of the drive in rms, if it is stated.
    pub sigma: Option<f64>,
    /// Longest time after which a controller must notice a lost channel, ms, if it is stated.
    pub loss_ms: Option<f64>,
    /// Largest rms of the drive while the loop is checked, N, if it is stated.
    pub gain_check_n: Option<f64>,
    /// Limits of other responses, at which the test is notched.
    pub response: Vec<ResponseLimit>,
}

/// Limit of the response at a channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResponseLimit {
    /// Name of the channel.
    pub channel: String,
    /// Limit: of a random test (m/s²)²/Hz, of a sine m/s².
    pub profile: Profile,
}

impl Specification {
    /// Checks a file. `read` returns the text of a file of breakpoints or of a pulse by its name, or says why it can't.
    ///
    /// # Errors
    /// [`SpecificationError`] names the first value that can't be, with its place.
    pub fn new(
        file: &SpecificationFile,
        mut read: impl FnMut(&str) -> Result<String, String>,
    ) -> Result<Specification, SpecificationError> {
        let read = &mut read;
        let test = match file.spec.kind {
            Kind::Random => {
                let section = file.random.as_ref().ok_or(missing("random", None, "the kind of the test is random"))?;
                Test::Random(RandomTest::new(section, file.schedule.as_ref(), read)?)
            }
            Kind::Sine => {
                let section = file.sine.as_ref().ok_or(missing("sine", None, "the kind of the test is sine"))?;
                Test::Sine(SineTest::new(section, file.dwell.as_ref())?)
            }
            Kind::Shock => match (&file.shock, &file.srs) {
                (Some(section), None) => Test::Shock(ShockTest::new(section, read)?),
                (None, Some(section)) => Test::Srs(SrsTest::new(section, read)?),
                (None, None) => return Err(missing("shock", None, "a shock has this section, or [srs] in its place")),
                (Some(_), Some(_)) => return Err(idle("srs", None, "the shock is stated by [shock]: leave one out")),
            },
        };
        // A section that nothing reads is an error: whoever wrote it would not notice that it has no effect.
        for (section, is_given, is_used) in [
            ("random", file.random.is_some(), file.spec.kind == Kind::Random),
            ("schedule", file.schedule.is_some(), file.spec.kind == Kind::Random),
            ("sine", file.sine.is_some(), file.spec.kind == Kind::Sine),
            ("dwell", file.dwell.is_some(), file.spec.kind == Kind::Sine),
            ("shock", file.shock.is_some(), file.spec.kind == Kind::Shock),
            ("srs", file.srs.is_some(), file.spec.kind == Kind::Shock),
        ] {
            if is_given && !is_used {
                return Err(idle(section, None, "the test is of another kind"));
            }
        }
        Ok(Specification {
            name: file.spec.name.clone(),
            sources: file.spec.sources.clone(),
            limits: limits(&file.limits, &test)?,
            control: file.control.clone(),
            test,
        })
    }
}

fn limits(section: &LimitsSection, test: &Test) -> Result<Limits, SpecificationError> {
    const SECTION: &str = "limits";
    let response = |entry: &crate::file::ResponseEntry| {
        let profile = match test {
            Test::Random(test) => test.limit(&entry.breakpoints)?,
            Test::Sine(_) => SineTest::limit(&entry.breakpoints)?,
            Test::Shock(_) | Test::Srs(_) => {
                return Err(idle("limits.response", None, "a shock can't be notched: only random tests and sines can"));
            }
        };
        Ok(ResponseLimit { channel: entry.channel.clone(), profile })
    };
    Ok(Limits {
        drive_peak_n: any_positive(SECTION, "drive_peak_n", section.drive_peak_n)?,
        sigma: section
            .sigma
            .map(|sigma| checked(SECTION, "sigma", sigma, |sigma| sigma >= 1.0, "at least 1"))
            .transpose()?,
        loss_ms: any_positive(SECTION, "loss_ms", section.loss_ms)?,
        gain_check_n: any_positive(SECTION, "gain_check_n", section.gain_check_n)?,
        response: section.response.iter().map(response).collect::<Result<_, _>>()?,
    })
}
