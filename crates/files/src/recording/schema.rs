//! The topics of a recording and the Protobuf messages in them.

/// Code generated from `proto/*.proto`; `tests/recording/schemas.rs` checks that they agree.
#[allow(missing_docs, clippy::doc_markdown)]
pub mod proto {
    include!(concat!(env!("CARGO_MANIFEST_DIR"), "/proto/resonarm.v1.rs"));
}

/// A topic (MCAP channel) of a recording. Each has one message type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Topic {
    /// `/plant/steps`: states and loads of every sample, in batches.
    States,
    /// `/plant/samples`: readings of every sample, in batches.
    Samples,
    /// `/plant/state`: every n-th state, filtered, for plotting.
    State,
    /// `/plant/command`: every n-th load, filtered, for plotting.
    Command,
    /// `/plant/sensors`: every n-th sample's readings, filtered, for plotting.
    Sensors,
    /// `/can/frames`: every frame on the bus, in batches.
    Frames,
    /// `/timing/ticks`: how punctual the real-time loop was, in batches.
    Ticks,
    /// `/events`: state changes, faults, overruns, losses.
    Events,
}

impl Topic {
    /// All topics, in the order of their indices.
    pub const ALL: [Topic; 8] = [
        Topic::States,
        Topic::Samples,
        Topic::State,
        Topic::Command,
        Topic::Sensors,
        Topic::Frames,
        Topic::Ticks,
        Topic::Events,
    ];

    /// Returns the name of the topic in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Topic::States => "/plant/steps",
            Topic::Samples => "/plant/samples",
            Topic::State => "/plant/state",
            Topic::Command => "/plant/command",
            Topic::Sensors => "/plant/sensors",
            Topic::Frames => "/can/frames",
            Topic::Ticks => "/timing/ticks",
            Topic::Events => "/events",
        }
    }

    /// Returns the full name of the Protobuf message that is written into it, with its package.
    pub const fn schema_name(self) -> &'static str {
        match self {
            Topic::States => "resonarm.v1.StepBatch",
            Topic::Samples => "resonarm.v1.SampleBatch",
            Topic::State => "resonarm.v1.State",
            Topic::Command => "resonarm.v1.Command",
            Topic::Sensors => "resonarm.v1.Sensors",
            Topic::Frames => "resonarm.v1.FrameBatch",
            Topic::Ticks => "resonarm.v1.TickBatch",
            Topic::Events => "resonarm.v1.Event",
        }
    }
}

/// Names of the metadata records of a recording.
pub(super) mod metadata {
    /// Description by the recorder itself: format, time step, interface, build.
    pub const RECORDING: &str = "resonarm.recording";
    /// The key of the version of the format in it.
    pub const FORMAT: &str = "format";
    /// The key of the version of the program in it.
    pub const VERSION: &str = "version";
    /// The start of the run, as soon as it is known; not in runs of simulated time alone.
    pub const START: &str = "resonarm.start";
    /// The key of the start of the run, ns of the UNIX epoch.
    pub const START_UNIX_NS: &str = "start_unix_ns";
    /// The configuration passed to the recorder.
    pub const CONFIGURATION: &str = "resonarm.configuration";
    /// The statistics passed at the end.
    pub const STATISTICS: &str = "resonarm.statistics";
    /// The key of the samples of the run in them.
    pub const SAMPLES: &str = "samples";
    /// Records lost in each channel. This is the last metadata record: a recording without it was not finished.
    pub const LOST: &str = "resonarm.lost";
    /// The source of a recording that is not whole: a repaired file, or the whole of which it is a part.
    pub const RECOVERED: &str = "resonarm.recovered";
}

/// Version of topics, schemas and metadata that is written.
pub(super) const FORMAT: u32 = 5;

/// The key of the time from sample to sample in [`metadata::RECORDING`].
pub(super) const DT_S: &str = "dt_s";

/// The key of the delay of readings in [`metadata::RECORDING`].
pub(super) const READING_DELAY: &str = "reading_delay_samples";

/// The beginning of the name of the library in the head of a recording.
pub(super) const OUR_LIBRARY: &str = "resonarm";

/// Name of the event of a fault; its value is the code.
pub(super) const FAULT_EVENT: &str = "emergency";

/// Name of the event of the partner's emergency; its value is the code.
pub(super) const PARTNER_EVENT: &str = "partner.emergency";

/// Name of the event of a frame under an identifier that only the node sends, of another network.
pub(super) const OTHER_SENDER_EVENT: &str = "frame.other_sender";

/// Name of the event of being armed.
pub(super) const ARMED_EVENT: &str = "state.operational";
