//! The topics of a recording and the Protobuf messages in them.

/// Generated from `proto/*.proto`; `tests/recording/schemas.rs` holds it to them.
#[allow(missing_docs, clippy::doc_markdown)]
pub(super) mod proto {
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
    /// `/can/frames`: every frame on the bus.
    Frames,
    /// `/timing/ticks`: how punctual the real-time loop was, in batches.
    Ticks,
    /// `/events`: state changes, faults, overruns, losses.
    Events,
}

impl Topic {
    /// All topics; the index of each is its place here.
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

    /// Name of the topic in the file.
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

    /// Full name of its message type.
    pub const fn schema_name(self) -> &'static str {
        match self {
            Topic::States => "resonarm.v1.StepBatch",
            Topic::Samples => "resonarm.v1.SampleBatch",
            Topic::State => "resonarm.v1.State",
            Topic::Command => "resonarm.v1.Command",
            Topic::Sensors => "resonarm.v1.Sensors",
            Topic::Frames => "resonarm.v1.CanFrame",
            Topic::Ticks => "resonarm.v1.TickBatch",
            Topic::Events => "resonarm.v1.Event",
        }
    }

    /// Its schema: a serialised `google.protobuf.FileDescriptorSet`, as MCAP wants it.
    pub(super) const fn descriptor(self) -> &'static [u8] {
        match self {
            Topic::States => include_bytes!("../../proto/descriptors/step_batch.bin"),
            Topic::Samples => include_bytes!("../../proto/descriptors/sample_batch.bin"),
            Topic::State => include_bytes!("../../proto/descriptors/state.bin"),
            Topic::Command => include_bytes!("../../proto/descriptors/command.bin"),
            Topic::Sensors => include_bytes!("../../proto/descriptors/sensors.bin"),
            Topic::Frames => include_bytes!("../../proto/descriptors/can_frame.bin"),
            Topic::Ticks => include_bytes!("../../proto/descriptors/tick_batch.bin"),
            Topic::Events => include_bytes!("../../proto/descriptors/event.bin"),
        }
    }
}

/// Names of the metadata records of a recording.
pub(super) mod metadata {
    /// What the recorder itself knows: format, time step, interface, build.
    pub const RECORDING: &str = "resonarm.recording";
    /// When the run began, as soon as it has: not in runs of simulated time alone, nor in format 1.
    pub const START: &str = "resonarm.start";
    /// The key of the start of the run, ns of the UNIX epoch.
    pub const START_UNIX_NS: &str = "start_unix_ns";
    /// The configuration handed in.
    pub const CONFIGURATION: &str = "resonarm.configuration";
    /// The statistics handed in at the end.
    pub const STATISTICS: &str = "resonarm.statistics";
    /// Records lost in each channel. Last of all: a recording without it was not finished.
    pub const LOST: &str = "resonarm.lost";
    /// What was mended in a recovered recording.
    pub const RECOVERED: &str = "resonarm.recovered";
}

/// Version of topics, schemas and metadata that is written.
pub(super) const FORMAT: &str = "2";

/// Versions that are read. 1 has no column of clipped readings and no mark at the end of a run; its plotting topics are
/// not filtered, its publish times are the log times, and the log times of frames and events are when they were
/// handled.
pub(super) const FORMATS_READ: [&str; 2] = ["1", "2"];

/// The key of the time from sample to sample in [`metadata::RECORDING`].
pub(super) const DT_S: &str = "dt_s";

/// How the name of the library begins in the head of a recording.
pub(super) const OUR_LIBRARY: &str = "resonarm";

/// Name of the event of a fault; its value is the code.
pub(super) const FAULT_EVENT: &str = "emergency";
