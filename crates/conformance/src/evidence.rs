//! The recording of a run of cases: every frame, and where each case begins and ends.

use std::path::PathBuf;

use super::case::Case;
use super::finding::{Finding, Verdict};
use crate::settings::Settings;
use resonarm_bus::Received;
use resonarm_files::recording::{
    Channel, Configuration, Direction, Event, Existing, FrameRecord, Options, Record, Recorder, RecordingError, Summary,
};
use resonarm_protocol::{Frame, Network, Node, dbc};
use resonarm_realtime::{Clock, SystemClock};

/// The unit of the recording's sample count, ns: the cases have no sample rate.
const SAMPLE_NS: u64 = 1_000_000;

/// Records that wait for the writer: some seconds of a full bus.
const CAPACITY: usize = 1 << 15;

/// Describes, for a recording of cases on Resonarm's protocol, how they were run.
pub fn configuration(tested: Node, network: Network, settings: Settings) -> Configuration {
    let stated = |limit: Option<f64>| limit.map_or(String::from("none"), |limit| limit.to_string());
    Configuration::new()
        .with("conformance", tested)
        .with("base", network.base())
        .with("plant_id", network.node_id(Node::Plant))
        .with("exciter_id", network.node_id(Node::Exciter))
        .with("profile", network.profile().name())
        .with("protocol_dbc_crc32", format!("{:08x}", dbc::hash(network.profile())))
        .with("seed", settings.seed)
        .with("force_n", settings.force_n)
        .with("beyond_n", stated(settings.beyond_n))
        .with("beyond_n_per_s", stated(settings.beyond_n_per_s))
        .with("beyond_travel_n", stated(settings.beyond_travel_n))
}

/// Records what a [`BusWire`](super::BusWire) sends and receives, as the plant sees it.
#[derive(Debug)]
pub struct Evidence {
    recorder: Recorder,
    channel: Channel,
    tested: Node,
    start_ns: u64,
    cases: i64,
    verdicts: Vec<(&'static str, String)>,
}

impl Evidence {
    /// Creates the file, with the settings needed to run the cases about this node again: [`configuration`], or
    /// [`UserWire::configuration`](super::UserWire::configuration).
    ///
    /// # Errors
    /// [`RecordingError`] if the file exists or can't be created.
    pub fn create(
        path: PathBuf,
        existing: Existing,
        interface: &str,
        (tested, configuration): (Node, &Configuration),
    ) -> Result<Evidence, RecordingError> {
        let options =
            Options::real_time(SAMPLE_NS as f64 * 1e-9, interface, SystemClock.epoch_unix_ns(), SystemClock::elapsed);
        let recorder = Recorder::create(path, configuration, Options { existing, ..options })?;
        let mut channel = recorder.channel("conformance", CAPACITY)?;
        let start_ns = SystemClock.now_ns();
        channel.begin(start_ns);
        Ok(Evidence { recorder, channel, tested, start_ns, cases: 0, verdicts: Vec::new() })
    }

    /// A frame that the tester sent.
    pub(super) fn sent(&mut self, frame: &Frame) {
        self.frame(self.tested.partner(), Received { frame: *frame, timestamp_ns: None });
    }

    /// A frame that the tester received.
    pub(super) fn received(&mut self, received: Received) {
        self.frame(self.tested, received);
    }

    fn frame(&mut self, sender: Node, Received { frame, timestamp_ns }: Received) {
        let direction = match sender {
            Node::Plant => Direction::Sent,
            Node::Exciter => Direction::Received,
        };
        let (sample, time_ns) = self.now();
        let record = FrameRecord { sample, direction, time_ns, bus_timestamp_ns: timestamp_ns, frame };
        // Lost records are counted in the file.
        self.channel.push(&Record::Frame(record));
    }

    /// Records the beginning of a case: an event of its name, with its number, from 1.
    pub(super) fn begin<S>(&mut self, case: &Case<S>) {
        self.cases += 1;
        self.event(case.id);
    }

    /// Records its end: an event of its verdict, with the same number.
    pub(super) fn end<S>(&mut self, case: &Case<S>, finding: &Finding) {
        let (event, verdict) = match &finding.verdict {
            Verdict::Passed => ("verdict.passed", String::from("passed")),
            Verdict::Failed(reason) => ("verdict.failed", format!("failed: {reason}")),
            Verdict::Inconclusive(reason) => ("verdict.inconclusive", format!("inconclusive: {reason}")),
            Verdict::Skipped(reason) => ("verdict.skipped", format!("skipped: {reason}")),
        };
        self.event(event);
        self.verdicts.push((case.id, verdict));
    }

    fn event(&mut self, name: &'static str) {
        let (sample, time_ns) = self.now();
        self.channel.push(&Record::Event(Event { sample, time_ns, name, value: self.cases }));
    }

    fn now(&self) -> (u64, u64) {
        let time_ns = SystemClock.now_ns() - self.start_ns;
        (time_ns / SAMPLE_NS, time_ns)
    }

    /// Closes the file, with the verdicts and their reasons.
    ///
    /// # Errors
    /// [`RecordingError`] if it could not be written.
    pub fn finish(self) -> Result<Summary, RecordingError> {
        self.recorder.finish(&self.verdicts)
    }
}
