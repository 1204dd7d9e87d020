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

    /// Returns the full name of the message type that is written into it.
    pub const fn schema_name(self) -> &'static str {
        self.message_type().name()
    }

    /// Returns the message type that is written into it.
    pub(super) const fn message_type(self) -> MessageType {
        match self {
            Topic::States => MessageType::StepBatch,
            Topic::Samples => MessageType::SampleBatch,
            Topic::State => MessageType::State,
            Topic::Command => MessageType::Command,
            Topic::Sensors => MessageType::Sensors,
            Topic::Frames => MessageType::FrameBatch,
            Topic::Ticks => MessageType::TickBatch,
            Topic::Events => MessageType::Event,
        }
    }
}

/// Type of a message. A topic has messages of one type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageType {
    /// States and loads of consecutive samples.
    StepBatch,
    /// Readings of consecutive samples.
    SampleBatch,
    /// The state at one sample, for plotting.
    State,
    /// The load at one sample, for plotting.
    Command,
    /// The readings at one sample, for plotting.
    Sensors,
    /// Frames on the bus.
    FrameBatch,
    /// Timing of consecutive ticks of the loop.
    TickBatch,
    /// An event of the run, such as a change of state.
    Event,
}

impl MessageType {
    /// All types, in the order of their indices.
    pub const ALL: [MessageType; 8] = [
        MessageType::StepBatch,
        MessageType::SampleBatch,
        MessageType::State,
        MessageType::Command,
        MessageType::Sensors,
        MessageType::FrameBatch,
        MessageType::TickBatch,
        MessageType::Event,
    ];

    /// Returns the topic on which messages of the type are recorded.
    pub const fn topic(self) -> Topic {
        match self {
            MessageType::StepBatch => Topic::States,
            MessageType::SampleBatch => Topic::Samples,
            MessageType::State => Topic::State,
            MessageType::Command => Topic::Command,
            MessageType::Sensors => Topic::Sensors,
            MessageType::FrameBatch => Topic::Frames,
            MessageType::TickBatch => Topic::Ticks,
            MessageType::Event => Topic::Events,
        }
    }

    /// Returns the full name of the protobuf message, with its package.
    pub const fn name(self) -> &'static str {
        match self {
            MessageType::StepBatch => "resonarm.v1.StepBatch",
            MessageType::SampleBatch => "resonarm.v1.SampleBatch",
            MessageType::State => "resonarm.v1.State",
            MessageType::Command => "resonarm.v1.Command",
            MessageType::Sensors => "resonarm.v1.Sensors",
            MessageType::FrameBatch => "resonarm.v1.FrameBatch",
            MessageType::TickBatch => "resonarm.v1.TickBatch",
            MessageType::Event => "resonarm.v1.Event",
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
