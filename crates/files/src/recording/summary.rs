//! A recording's description of itself.

use core::fmt;
use std::collections::BTreeMap;
use std::path::PathBuf;

use resonarm_protocol::EmergencyCode;
use serde::ser::SerializeStruct;

use super::build_info::BuildInfo;
use super::record::FrameRecord;

/// The origin of a recording.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Origin {
    /// Version of topics, schemas and metadata.
    pub format: u32,
    /// Time from one sample to the next, s.
    pub dt_s: f64,
    /// Name of the bus interface.
    pub interface: String,
    /// Time base of the run: simulated time alone, lockstep, or real time.
    pub time: RunTime,
    /// Start of the run, ns of the UNIX epoch; `None` for simulated time alone.
    pub start_unix_ns: Option<u64>,
    /// Interval of the messages in the plotting topics, in samples; 0 is never.
    pub plot_every_samples: u64,
    /// Delay of a reading against its sample, in samples: that of the instruments' converters.
    pub reading_delay_samples: f64,
    /// The build that made the recording.
    pub build: BuildInfo,
}

/// The time base of a run. Log times are simulated time: that of the sample to which a message belongs. Publish times
/// are those of the machine's clock, if the run went by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RunTime {
    /// Only simulated time: log times from 0, publish times equal to them, so that the same run produces identical
    /// bytes.
    Simulated,
    /// Simulated time that waits for a partner: log times from 0, publish times of the UNIX epoch.
    Lockstep,
    /// Simulated time that goes with the machine's clock: log times from the start of the run in the UNIX epoch on,
    /// publish times of the UNIX epoch.
    RealTime,
}

/// Whether a file is whole, and how much of it can be read if not.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case", tag = "state")]
pub enum Integrity {
    /// The whole run is in the file.
    Complete,
    /// The file is whole, but it was recovered from a truncated or damaged one: parts of the run may be missing.
    Unfinished,
    /// Every record of the file is in order, but records are missing or repeated.
    Incomplete {
        /// Description of the missing or repeated records.
        cause: String,
    },
    /// The file ends inside a record: the run was killed, or a copy was cut short.
    Truncated {
        /// Number of bytes that can be read.
        readable_bytes: u64,
        /// Size of the file, bytes.
        file_bytes: u64,
        /// The last sample that can be read, if any.
        last_sample: Option<u64>,
    },
    /// A checksum or a layout is wrong; the records before it can be read.
    Damaged {
        /// Number of bytes that can be read: here the damaged record begins.
        readable_bytes: u64,
        /// Size of the file, bytes.
        file_bytes: u64,
        /// The last sample that can be read, if any.
        last_sample: Option<u64>,
        /// Checksum or layout that is wrong.
        cause: String,
    },
}

impl fmt::Display for Integrity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let last_sample = match self {
            Integrity::Complete => return f.write_str("complete"),
            Integrity::Unfinished => return f.write_str("recovered from a truncated or damaged one"),
            Integrity::Incomplete { cause } => return write!(f, "not whole: {cause}"),
            Integrity::Truncated { readable_bytes, file_bytes, last_sample } => {
                write!(f, "truncated: {readable_bytes} of {file_bytes} bytes can be read")?;
                last_sample
            }
            Integrity::Damaged { readable_bytes, file_bytes, last_sample, cause } => {
                write!(
                    f,
                    "damaged at byte {readable_bytes} of {file_bytes} ({cause}): the records before it can be read"
                )?;
                last_sample
            }
        };
        match last_sample {
            Some(sample) => write!(f, ", up to sample {sample}"),
            None => f.write_str(", which contain no sample"),
        }
    }
}

/// Size, integrity, origin and counts of a recording: see [`Recording::summary`](super::Recording::summary).
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct RecordingSummary {
    /// Path of the recording.
    pub path: PathBuf,
    /// Size of the file, bytes.
    pub file_bytes: u64,
    /// Whether it is whole.
    pub integrity: Integrity,
    /// The origin of the recording.
    pub origin: Origin,
    /// Time from the first sample to the last, s.
    pub duration_s: f64,
    /// First and last sample, if there is any.
    pub samples: Option<(u64, u64)>,
    /// Samples with a reading beyond the range of its sensor.
    pub clipped_samples: u64,
    /// The plant's faults, in order; at most 100.
    pub faults: Vec<RecordedFault>,
    /// Frames under identifiers that only the plant sends, which are not of its network.
    pub other_sender_frames: u64,
    /// Counts of each topic, by its name in the file.
    pub topics: BTreeMap<&'static str, TopicSummary>,
    /// Records lost in each channel; empty if the end of the run is not in the file.
    pub lost: BTreeMap<String, u64>,
    /// The configuration of the run.
    pub configuration: BTreeMap<String, String>,
    /// The statistics of the run; empty if its end is not in the file.
    pub statistics: BTreeMap<String, String>,
}

/// A fault of the plant, as an event states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedFault {
    /// The sample at which it was found.
    pub sample: u64,
    /// Its code, a number of [`EmergencyCode`] if this version knows it.
    pub code: i64,
    /// The code of the exciter's fault, where that is the reason.
    pub partner_code: Option<i64>,
}

impl RecordedFault {
    /// Makes a fault, without that of the exciter.
    pub const fn new(sample: u64, code: i64) -> RecordedFault {
        RecordedFault { sample, code, partner_code: None }
    }

    /// Adds the code that the exciter reported at a sample, if that is the reason: the plant faults for the exciter's
    /// fault, or for the commands that it rejected before the exciter gave up.
    pub(super) fn with_partner(self, emergency: Option<(u64, i64)>) -> RecordedFault {
        let is_reason = |at: u64| match self.cause() {
            Some(EmergencyCode::PartnerFault) => true,
            // A timeout has other reasons as well. Only an emergency of the same sample counts as its reason.
            Some(EmergencyCode::CommandTimeout) => at == self.sample,
            _ => false,
        };
        let partner_code = emergency.filter(|(at, _)| is_reason(*at)).map(|(_, code)| code);
        RecordedFault { partner_code, ..self }
    }

    /// Returns the emergency code, if this version knows it.
    pub fn cause(&self) -> Option<EmergencyCode> {
        meaning(self.code)
    }
}

/// Finds the emergency code of a number, among those of this protocol and those of user protocols.
fn meaning(code: i64) -> Option<EmergencyCode> {
    let of_users_protocols = [EmergencyCode::StopRequested];
    let code = u16::try_from(code).ok()?;
    EmergencyCode::from_code(code).or_else(|| of_users_protocols.into_iter().find(|known| *known as u16 == code))
}

impl fmt::Display for RecordedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.cause() {
            Some(cause) => write!(f, "code {} at sample {}: {cause}", self.code, self.sample)?,
            None => write!(f, "code {} at sample {}", self.code, self.sample)?,
        }
        match self.partner_code {
            Some(code) => match meaning(code) {
                Some(cause) => write!(f, "; the exciter reported code {code}: {cause}"),
                None => write!(f, "; the exciter reported code {code}"),
            },
            None => Ok(()),
        }
    }
}

impl serde::Serialize for RecordedFault {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("RecordedFault", 5)?;
        fields.serialize_field("code", &self.code)?;
        fields.serialize_field("name", &self.cause().map(|cause| cause.to_string()))?;
        fields.serialize_field("sample", &self.sample)?;
        fields.serialize_field("partner_code", &self.partner_code)?;
        let partner = self.partner_code.and_then(meaning).map(|cause| cause.to_string());
        fields.serialize_field("partner_name", &partner)?;
        fields.end()
    }
}

/// Counts of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct TopicSummary {
    /// Number of messages; in a batched topic a batch is one.
    pub messages: u64,
    /// Number of records in these messages. The messages for plotting repeat others and count none.
    pub records: u64,
    /// Size of the messages before compression, bytes.
    pub bytes: u64,
    /// Places where samples of a batched topic are missing.
    pub gaps: u64,
    /// Records of samples that a batched topic has already had, or that are behind later ones.
    pub repeated: u64,
}

impl Origin {
    /// Returns the origin of log times: in real time the start of the run, ns of the UNIX epoch, else 0.
    pub fn log_start_ns(&self) -> u64 {
        match self.time {
            RunTime::RealTime => self.start_unix_ns.unwrap_or(0),
            RunTime::Lockstep | RunTime::Simulated => 0,
        }
    }

    /// Returns the time at which a frame was on the bus, ns from the start of the run: in real time by the machine's
    /// clock, else in simulated time, in which the frames of a sample come together.
    pub fn frame_time_ns(&self, frame: &FrameRecord) -> u64 {
        match self.time {
            RunTime::Lockstep => libm::round(frame.sample as f64 * self.dt_s * 1e9) as u64,
            RunTime::RealTime | RunTime::Simulated => frame.time_ns,
        }
    }
}

impl RunTime {
    /// Returns the name, as the metadata of a file have it.
    pub const fn name(self) -> &'static str {
        match self {
            RunTime::Simulated => "simulated",
            RunTime::Lockstep => "lockstep",
            RunTime::RealTime => "real-time",
        }
    }

    /// Returns the time base with a name in a file, if this version knows it.
    pub(super) fn stated(time: &str) -> Option<RunTime> {
        [RunTime::Simulated, RunTime::Lockstep, RunTime::RealTime].into_iter().find(|of| of.name() == time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_repeats_what_the_exciter_said_where_that_is_its_reason() {
        let said = |code, partner| RecordedFault::new(300, code).with_partner(partner).to_string();
        insta::assert_snapshot!(said(4, Some((299, 2))), @"code 4 at sample 300: the partner has faulted or started again; the exciter reported code 2: no sensor data in time");
        insta::assert_snapshot!(said(1, Some((300, 2))), @"code 1 at sample 300: no valid command in time; the exciter reported code 2: no sensor data in time");
        insta::assert_snapshot!(said(4, Some((300, 99))), @"code 4 at sample 300: the partner has faulted or started again; the exciter reported code 99");
        for other in [said(1, Some((299, 2))), said(9, Some((300, 2))), said(4, None)] {
            assert!(!other.contains("exciter said"), "{other}");
        }
    }
}
