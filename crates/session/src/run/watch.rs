//! Watching a run: rings between its loops and the watcher.
//!
//! ```text
//! run loop ── Watched::notify ───────► rings of records and commands, of events,   ──► Watcher::take
//!                                      of responses, of states of a test
//!          ── Watched::notify_frame ─► ring of frames ───────────────────────────────►
//!          ◄─ Watched::request ─────── ring of requests ◄───────────────────────────── Watcher::ask
//! ```
//!
//! A slot of a ring is as large as its largest entry, and every entry that a loop writes has to leave the other core's
//! caches. So the few large responses have a separate ring. Events have one, too: samples that come faster than they
//! are taken, as in a run without a pace, crowd out no change of state.
//!
//! The loop's side never waits: an entry that finds a ring full is lost, and counted. The run does not depend on
//! whether it is watched. Frames are passed on only while the watcher wants them.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};

use rtrb::{Consumer, Producer, RingBuffer};

use resonarm_bench::control::{ResponsePoint, SetPoint, StopReason, TestProgress};
use resonarm_bench::rig::Load;
use resonarm_files::recording::slots::{self, Entry, Slot};
use resonarm_files::recording::{Event, FrameRecord, Record};

/// Entries in a loop's ring at most: at 1 kHz two seconds.
const NOTICES: usize = 1 << 13;
/// Responses that wait at most.
const RESPONSES: usize = 1 << 8;
/// Frames that wait at most: two seconds at 1 kHz with four a sample, its command and the plant's three; 1 MiB. They
/// have a separate ring, so that a jammed bus crowds out nothing else.
const FRAMES: usize = 1 << 13;
/// Events that wait at most: 120,000 a second, if they are taken thirty times a second.
const EVENTS: usize = 1 << 12;
/// States of a test that wait at most: six seconds of a sweep.
const TEST_STATES: usize = 1 << 6;
/// Samples between two states of a test in which only times and frequencies have changed.
const TEST_SAMPLES: u64 = 100;
/// Requests that wait to be taken.
const REQUESTS: usize = 64;

/// Notice of a run's loop to its watcher.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a loop must not allocate, so that nothing is boxed")]
pub enum Notice {
    /// A record that is also in the recording: states, readings, ticks, events; frames if they are wanted
    /// ([`Watcher::want_frames`]), those of an exciter as it sees them.
    Record(Record),
    /// Answer of an exciter to a sample, where no plant passes on its state.
    Command(CommandRecord),
    /// A response that the controller has read.
    Response(ResponsePoint),
    /// The set-point that an exciter goes to or holds: at first, and when it changes.
    SetPoint(SetPoint),
    /// State of a vibration test: at first, when its phase or level changes, and every 100 samples.
    Test(TestState),
}

/// State of a vibration or shock test that a controller runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestState {
    /// How far the test is.
    pub progress: TestProgress,
    /// Reason for which the test is stopped, if it is.
    pub stopped: Option<StopReason>,
}

impl TestState {
    /// Whether nothing but times and frequencies differs.
    fn is_like(&self, other: &TestState) -> bool {
        let essential = |state: &TestState| (state.progress.phase, state.progress.level_db, state.stopped);
        essential(self) == essential(other)
    }
}

/// Frequent notices: everything that an exciter reports except records and responses.
#[derive(Clone, Copy, Debug)]
enum Often {
    Command(CommandRecord),
    SetPoint(SetPoint),
}

impl From<Entry<'_, Often>> for Notice {
    fn from(entry: Entry<'_, Often>) -> Notice {
        match entry {
            Entry::Record(record) => Notice::Record(*record),
            Entry::Other(Often::Command(command)) => Notice::Command(command),
            Entry::Other(Often::SetPoint(set_point)) => Notice::SetPoint(set_point),
        }
    }
}

/// The load that an exciter commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandRecord {
    /// Index of the sample that it answers, counted from arming.
    pub sample: u64,
    /// The load, to be held from that sample to the next.
    pub load: Load,
}

/// A request of the watcher to a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Arm the plant, as by a frame of the exciter.
    Arm,
    /// Disarm the plant; of an exciter: disarm the plant and end.
    Disarm,
    /// Reset a plant that has faulted.
    Reset,
    /// Change the excitation to a set-point.
    Set(SetPoint),
}

/// The end of the bus whose run is watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The plant's end of the bus.
    Plant,
    /// The exciter's end, in a run that has no plant.
    Exciter,
    /// The exciter's end, in a run in which the plant passes on the samples.
    ExciterBesidePlant,
    /// No loop, but the thread beside the plant's that checks which threads use its core. It reports missed deadlines,
    /// which are events, and accepts no requests.
    CoreWatch,
}

impl End {
    /// Returns the largest number of entries in its ring, and of frames: of two loops on one bus the plant's passes
    /// them on.
    const fn capacities(self) -> (usize, usize) {
        match self {
            End::Plant | End::Exciter => (NOTICES, FRAMES),
            End::ExciterBesidePlant => (NOTICES, 0),
            End::CoreWatch => (0, 0),
        }
    }
}

/// The connection that a session needs to be watched: each of its runs opens new rings.
#[derive(Clone, Debug)]
pub struct Watch {
    opened: mpsc::Sender<Opened>,
    shared: Arc<Shared>,
}

/// State that both ends share.
#[derive(Debug, Default)]
struct Shared {
    lost: AtomicU64,
    wants_frames: AtomicBool,
}

#[derive(Debug)]
struct Opened {
    end: End,
    often: Consumer<Slot<Often>>,
    events: Consumer<Event>,
    responses: Consumer<ResponsePoint>,
    tests: Consumer<TestState>,
    frames: Consumer<FrameRecord>,
    requests: Producer<Request>,
}

impl Opened {
    /// Says whether the loop has ended and all its notices were taken.
    fn is_over(&self) -> bool {
        // The order matters: if the loop has ended, all its notices are in the rings by now.
        self.often.is_abandoned()
            && self.often.is_empty()
            && self.events.is_empty()
            && self.responses.is_empty()
            && self.tests.is_empty()
            && self.frames.is_empty()
    }
}

/// A loop's end of its rings.
#[derive(Debug)]
pub struct Watched {
    /// The end of the bus to which this loop belongs.
    pub(super) end: End,
    often: Producer<Slot<Often>>,
    events: Producer<Event>,
    responses: Producer<ResponsePoint>,
    tests: Producer<TestState>,
    frames: Producer<FrameRecord>,
    requests: Consumer<Request>,
    /// The set-point passed on last.
    set_point: Option<SetPoint>,
    /// State of a test passed on last, with its sample.
    test: Option<(u64, TestState)>,
    shared: Arc<Shared>,
}

/// The watcher's end of the channels to a run.
#[derive(Debug)]
pub struct Watcher {
    opening: mpsc::Receiver<Opened>,
    open: Vec<Opened>,
    shared: Arc<Shared>,
}

/// Error of a request that was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotAsked {
    /// No running loop could accept the request.
    #[error("no loop of this program can accept the request: it has not started, or has ended")]
    Nobody,
    /// The ring of requests is full.
    #[error("the loop accepts no requests at the moment; try again")]
    Busy,
}

/// Makes both ends: one for [`Session::watched`](super::Session::watched), one for the watcher.
pub fn watch() -> (Watch, Watcher) {
    let (opened, opening) = mpsc::channel();
    let shared = Arc::<Shared>::default();
    (Watch { opened, shared: Arc::clone(&shared) }, Watcher { opening, open: Vec::new(), shared })
}

impl Watch {
    /// Opens the rings of a loop, before it begins.
    pub fn open(&self, end: End) -> Watched {
        let (often, frames) = end.capacities();
        let (events, event_reader) = RingBuffer::new(EVENTS);
        let (often, often_reader) = RingBuffer::new(often);
        let (frames, frame_reader) = RingBuffer::new(frames);
        let (responses, response_reader) = RingBuffer::new(RESPONSES);
        let (tests, test_reader) = RingBuffer::new(TEST_STATES);
        let (writer, requests) = RingBuffer::new(REQUESTS);
        let opened = Opened {
            end,
            often: often_reader,
            events: event_reader,
            responses: response_reader,
            tests: test_reader,
            frames: frame_reader,
            requests: writer,
        };
        // If the watcher is gone, notices are lost, and counted.
        let _nobody = self.opened.send(opened);
        Watched {
            end,
            often,
            events,
            responses,
            tests,
            frames,
            requests,
            set_point: None,
            test: None,
            shared: Arc::clone(&self.shared),
        }
    }
}

impl Watched {
    /// Passes on `notice`, or counts it as lost. Never blocks, locks or allocates: for the real-time loop.
    #[inline]
    pub fn notify(&mut self, notice: Notice) {
        let is_queued = match notice {
            Notice::Record(Record::Event(event)) => self.events.push(event).is_ok(),
            Notice::Record(record) => slots::push(&mut self.often, &record),
            Notice::Command(command) => slots::push_other(&mut self.often, Often::Command(command)),
            Notice::Response(response) => self.responses.push(response).is_ok(),
            Notice::SetPoint(set_point) => slots::push_other(&mut self.often, Often::SetPoint(set_point)),
            Notice::Test(state) => self.tests.push(state).is_ok(),
        };
        if !is_queued {
            self.lose();
        }
    }

    /// Passes on the set-point of a controller, if it takes one and it has changed. Never blocks, locks or allocates.
    pub fn notify_set_point(&mut self, set_point: Option<SetPoint>) {
        if let Some(changed) = set_point.filter(|_| set_point != self.set_point) {
            self.set_point = set_point;
            self.notify(Notice::SetPoint(changed));
        }
    }

    /// Passes on the state of a test at a sample, if there is one and it has changed; of times and frequencies alone, every 100
    /// samples, and only while half of the ring is free, so that they crowd out no phase and no reason of a stop. Never blocks,
    /// locks or allocates.
    pub fn notify_test(&mut self, sample: u64, state: Option<TestState>) {
        let Some(state) = state else { return };
        if let Some((last, known)) = self.test.filter(|(_, known)| known.is_like(&state)) {
            let is_due = known != state && sample.wrapping_sub(last) >= TEST_SAMPLES;
            if !is_due || self.tests.slots() <= TEST_STATES / 2 {
                return;
            }
        }
        self.test = Some((sample, state));
        self.notify(Notice::Test(state));
    }

    fn lose(&self) {
        self.shared.lost.fetch_add(1, Ordering::Relaxed);
    }

    /// Says whether frames are wanted. Never blocks, locks or allocates.
    pub fn wants_frames(&self) -> bool {
        self.end.capacities().1 > 0 && self.shared.wants_frames.load(Ordering::Relaxed)
    }

    /// Passes on the frame that `make` returns, or counts it as lost, if frames are wanted of this loop. Never blocks,
    /// locks or allocates.
    pub fn notify_frame(&mut self, make: impl FnOnce() -> FrameRecord) {
        if self.wants_frames() && self.frames.push(make()).is_err() {
            self.lose();
        }
    }

    /// Returns the next request, if there is one. Never blocks, locks or allocates.
    pub fn request(&mut self) -> Option<Request> {
        self.requests.pop().ok()
    }
}

impl Watcher {
    /// Hands over the notices since the last call, at most `most` of each loop, oldest first; then events, responses, states of
    /// a test and frames likewise.
    pub fn take(&mut self, most: usize, mut hand: impl FnMut(End, &Notice)) {
        self.open.extend(self.opening.try_iter());
        for Opened { end, often, events, responses, tests, frames, .. } in &mut self.open {
            // Counted before the first is taken, so that a loop as fast as this one can't keep the others waiting.
            for _ in 0..most.min(often.slots()) {
                if slots::pop(often, |entry| hand(*end, &Notice::from(entry))).is_none() {
                    break;
                }
            }
            drain(events, most, |event| hand(*end, &Notice::Record(Record::Event(*event))));
            drain(responses, most, |response| hand(*end, &Notice::Response(*response)));
            drain(tests, most, |state| hand(*end, &Notice::Test(*state)));
            drain(frames, most, |frame| hand(*end, &Notice::Record(Record::Frame(*frame))));
        }
        self.open.retain(|opened| !opened.is_over());
    }

    /// Returns the number of loops whose rings are open, as of the last check.
    #[cfg(test)]
    pub(super) fn loops(&self) -> usize {
        self.open.len()
    }

    /// Returns the number of notices and frames that were lost because a ring was full.
    pub fn lost(&self) -> u64 {
        self.shared.lost.load(Ordering::Relaxed)
    }

    /// Sets whether the loops pass on their frames from now on. At first they don't.
    pub fn want_frames(&self, wanted: bool) {
        self.shared.wants_frames.store(wanted, Ordering::Relaxed);
    }

    /// Passes a request to the right loop: a set-point goes to the exciter, and to the plant beside it, which records
    /// it; everything else to the plant, or to an exciter alone.
    ///
    /// # Errors
    /// [`NotAsked`] if there is no such loop, or it does not accept requests.
    pub fn ask(&mut self, request: Request) -> Result<(), NotAsked> {
        self.open.extend(self.opening.try_iter());
        let wanted = |end: End| match request {
            Request::Set(_) => end != End::CoreWatch,
            // With both in one process the plant is asked: an exciter beside it learns of the disarm from the bus.
            Request::Disarm => matches!(end, End::Plant | End::Exciter),
            Request::Arm | Request::Reset => end == End::Plant,
        };
        let mut asked = Err(NotAsked::Nobody);
        for opened in self.open.iter_mut().filter(|opened| wanted(opened.end) && !opened.requests.is_abandoned()) {
            // An error after the first loop took the request is still an error: the caller asks again, and a
            // set-point that comes twice is the same.
            opened.requests.push(request).map_err(|_full| NotAsked::Busy)?;
            asked = Ok(());
        }
        asked
    }
}

/// Hands over the entries of a ring, at most `most`.
fn drain<T>(ring: &mut Consumer<T>, most: usize, hand: impl FnMut(&T)) {
    if let Ok(chunk) = ring.read_chunk(ring.slots().min(most)) {
        let (first, second) = chunk.as_slices();
        first.iter().chain(second).for_each(hand);
        chunk.commit_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_bench::control::TestPhase;
    use resonarm_files::recording::TickRecord;

    fn tick(sample: u64) -> Notice {
        Notice::Record(Record::Tick(TickRecord { sample, wakeup_ns: 0, exec_ns: 0, overruns: 0, cause: None }))
    }

    /// The page of a demo without a pace showed its plant as armed when it had ended: its last event was lost.
    #[test]
    fn samples_crowd_out_no_event() {
        let (watch, mut watcher) = watch();
        let mut watched = watch.open(End::Plant);
        (0..=NOTICES as u64).for_each(|sample| watched.notify(tick(sample)));
        let event =
            Notice::Record(Record::Event(Event { sample: 9000, time_ns: 0, name: "state.pre_operational", value: 0 }));
        watched.notify(event);
        let mut last = None;
        watcher.take(usize::MAX, |_, notice| last = Some(*notice));
        assert_eq!((last, watcher.lost()), (Some(event), 1));
    }

    /// A page that takes nothing for a while still learns why a test was stopped.
    #[test]
    fn the_times_of_a_test_crowd_out_no_reason_of_a_stop() {
        let (watch, mut watcher) = watch();
        let mut watched = watch.open(End::Exciter);
        let at = |full_level_s: f64, stopped: Option<StopReason>| {
            let progress =
                TestProgress { phase: TestPhase::Level, level_db: Some(0.0), full_level_s, frequency_hz: None };
            Some(TestState { progress, stopped })
        };
        for sample in 0..100_000 {
            watched.notify_test(sample, at(sample as f64 * 1e-3, None));
        }
        let stopped = at(100.0, Some(StopReason::SamplesLost { samples: 7 }));
        watched.notify_test(100_000, stopped);
        let mut taken = Vec::new();
        watcher.take(usize::MAX, |_, notice| taken.push(*notice));
        assert_eq!(taken.last(), stopped.map(Notice::Test).as_ref());
        assert_eq!((taken.len(), watcher.lost()), (TEST_STATES / 2 + 1, 0));
    }

    #[test]
    fn a_full_ring_loses_and_counts_and_never_waits() {
        let (watch, mut watcher) = watch();
        let mut watched = watch.open(End::Plant);
        (0..NOTICES as u64 + 100).for_each(|sample| watched.notify(tick(sample)));
        assert_eq!(watcher.lost(), 100);
        let mut taken = Vec::new();
        watcher.take(usize::MAX, |end, notice| taken.push((end, *notice)));
        assert!(taken.iter().copied().eq((0..NOTICES as u64).map(|sample| (End::Plant, tick(sample)))));
        watched.notify(tick(7));
        drop(watched);
        taken.clear();
        watcher.take(usize::MAX, |end, notice| taken.push((end, *notice)));
        assert_eq!(taken, [(End::Plant, tick(7))], "the notices of an ended loop are still there");
        assert!(watcher.open.is_empty());
    }

    #[test]
    fn frames_are_passed_on_as_long_as_they_are_wanted() {
        let (watch, mut watcher) = watch();
        let mut watched = watch.open(End::Plant);
        let frame = resonarm_protocol::Frame::classic(resonarm_protocol::Id::Standard(0x203), &[1, 2]).unwrap();
        let record = |sample| FrameRecord {
            sample,
            direction: resonarm_files::recording::Direction::Sent,
            time_ns: 0,
            bus_timestamp_ns: None,
            frame,
        };
        for (sample, wanted) in [(0, None), (1, Some(true)), (2, None), (3, Some(false))] {
            wanted.into_iter().for_each(|wanted| watcher.want_frames(wanted));
            watched.notify_frame(|| record(sample));
        }
        let mut taken = Vec::new();
        watcher.take(usize::MAX, |_, notice| taken.push(*notice));
        assert_eq!(taken, [1, 2].map(|sample| Notice::Record(Record::Frame(record(sample)))));
    }

    #[test]
    fn a_slot_is_as_small_as_documented() {
        assert!(FRAMES * size_of::<FrameRecord>() <= 1 << 20, "{}", size_of::<FrameRecord>());
        assert!(size_of::<Slot<Often>>() <= size_of::<FrameRecord>() + 16, "{}", size_of::<Slot<Often>>());
        assert!(2 * size_of::<Slot<Often>>() <= size_of::<ResponsePoint>(), "{}", size_of::<ResponsePoint>());
    }

    #[test]
    fn responses_have_a_separate_ring() {
        let harmonics = [[resonarm_bench::excitation::Phasor::default(); 3]; 6];
        let response = |load| Notice::Response(ResponsePoint::of_harmonics(20.0, load, &harmonics));
        let (watch, mut watcher) = watch();
        let mut watched = watch.open(End::ExciterBesidePlant);
        (0..NOTICES as u64).for_each(|sample| watched.notify(tick(sample)));
        (0..=RESPONSES).for_each(|n| watched.notify(response(n as f64)));
        assert_eq!(watcher.lost(), 1, "the one for which there is no room beside a full ring of records");
        drop(watched);
        let mut taken = Vec::new();
        watcher.take(1, |_, notice| taken.push(*notice));
        assert_eq!(taken, [tick(0), response(0.0)]);
        while !watcher.open.is_empty() {
            watcher.take(usize::MAX, |_, notice| taken.push(*notice));
        }
        assert_eq!(taken.len(), NOTICES + RESPONSES);
        assert_eq!(taken.last(), Some(&response((RESPONSES - 1) as f64)));
    }

    #[test]
    fn requests_reach_the_loops_that_they_are_for() {
        let set = Request::Set(SetPoint { load: 1.0, frequency_hz: 20.0, phase_deg: 0.0 });
        let (watch, mut watcher) = watch();
        assert_eq!(watcher.ask(Request::Arm), Err(NotAsked::Nobody));
        let mut plant = watch.open(End::Plant);
        let mut exciter = watch.open(End::ExciterBesidePlant);
        let mut beside = watch.open(End::CoreWatch);
        for request in [Request::Arm, set, Request::Disarm, Request::Reset] {
            assert_eq!(watcher.ask(request), Ok(()));
        }
        let asked = |watched: &mut Watched| core::iter::from_fn(|| watched.request()).collect::<Vec<_>>();
        assert_eq!(asked(&mut plant), [Request::Arm, set, Request::Disarm, Request::Reset]);
        assert_eq!(asked(&mut exciter), [set]);
        assert_eq!(asked(&mut beside), []);
        (0..REQUESTS).for_each(|_| assert_eq!(watcher.ask(Request::Arm), Ok(())));
        assert_eq!(watcher.ask(Request::Arm), Err(NotAsked::Busy));
        drop(plant);
        assert_eq!(watcher.ask(Request::Arm), Err(NotAsked::Nobody));
    }
}
