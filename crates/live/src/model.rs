//! The state of the run: kept for later viewers, and sent to those connected.

use std::collections::VecDeque;

use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes};

use super::about::About;
use super::extremes::{Extremes, Stretch};
use super::message::{
    BranchLines, EventLine, NodeStatus, PageMessage, PlayerStatus, ReadPoint, Spectra, Timing, UpdateHead, update,
};
use super::missed::Missed;
use super::rows::{ACCELERATION_C, FORCE, HEAD, Row, Rows, Shown, TORQUE, clipped_bit};
use super::spectrum::Spectrum;
use super::test_panel::TestPanel;
use super::under_test::{Sizes, UnderTest};
use resonarm_bench::control::{ResponsePoint, SetPoint};
use resonarm_files::recording::{Event, Record, RecordedFault, TickRecord};
use resonarm_session::run::{self, CommandRecord};

/// Stretches per second of simulated time.
const STRETCHES_HZ: f64 = 100.0;
/// Length of the past that a new viewer gets, s of simulated time.
pub const SHOWN_S: f64 = 30.0;
/// Most stretches that are kept.
const STRETCHES_KEPT: usize = (SHOWN_S * STRETCHES_HZ) as usize;
/// Most rows in an update; a run faster than the clock sends only the latest whole.
const ROWS_SENT: usize = 256;
/// Most stretches in an update: the latest.
const STRETCHES_SENT: usize = 64;
/// Most events, and most responses, that are kept.
const LINES_KEPT: usize = 500;

/// The state of the run.
pub struct Model {
    /// Description of the run or recording.
    pub(super) about: About,
    pub(super) under_test: UnderTest,
    rows: Rows,
    extremes: Extremes,
    kept: VecDeque<Stretch>,
    new: Vec<Stretch>,
    /// The latest rows, the newest last, and how many of them no update has sent.
    recent: VecDeque<Row>,
    unsent: usize,
    newest: Option<u64>,
    /// Whether the next update sends everything that is kept.
    is_new: bool,
    /// The sample of a recording that is shown.
    shown: Option<u64>,
    spectrum: Spectrum,
    status: NodeStatus,
    events: VecDeque<EventLine>,
    responses: VecDeque<ReadPoint>,
    branch: Option<BranchLines>,
    player: Option<PlayerStatus>,
    /// Set-point of the exciter, if one can be set.
    set_point: Option<SetPoint>,
    ticks: Ticks,
    missed: Missed,
    has_ended: bool,
    /// Messages for all viewers.
    outgoing: Vec<Message>,
}

/// Ticks since the last update.
#[derive(Debug, Default)]
struct Ticks {
    count: u64,
    exec_ns: u64,
    exec_most_ns: u64,
    late_ns: u64,
    late_most_ns: u64,
}

impl Model {
    /// Makes the model of a run without data so far.
    pub fn new(about: About, under_test: UnderTest) -> Model {
        let width = (about.rate_hz / STRETCHES_HZ) as u64;
        Model {
            rows: Rows::new(Shown::new(&under_test.table)),
            extremes: Extremes::new(width),
            kept: VecDeque::new(),
            new: Vec::new(),
            recent: VecDeque::new(),
            unsent: 0,
            newest: None,
            is_new: false,
            shown: None,
            spectrum: Spectrum::new(about.rate_hz, about.modes_hz.last().copied()),
            status: NodeStatus { state: "unknown", fault: None },
            events: VecDeque::new(),
            responses: VecDeque::new(),
            branch: None,
            player: None,
            set_point: None,
            ticks: Ticks::default(),
            missed: Missed::default(),
            has_ended: false,
            outgoing: Vec::new(),
            about,
            under_test,
        }
    }

    /// Adds a notice of the loop to the model.
    pub fn notice(&mut self, notice: &run::Notice) {
        match notice {
            run::Notice::Record(record) => self.record(record),
            run::Notice::Command(CommandRecord { sample, load }) => self.rows.command(*sample, load),
            run::Notice::Response(point) => self.response(point),
            run::Notice::Test(state) => {
                if let Some(test) = &mut self.under_test.test {
                    test.state(*state);
                }
            }
            run::Notice::SetPoint(set_point) => {
                self.send(&PageMessage::SetPoint(set_point));
                self.set_point = Some(*set_point);
            }
        }
    }

    /// Adds a record of the run to the model.
    pub fn record<Name: AsRef<str>>(&mut self, record: &Record<Name>) {
        match record {
            Record::State(state) => self.rows.state(state),
            Record::Sample(readings) => self.rows.readings(readings),
            Record::Tick(tick) => {
                self.ticks.add(tick);
                self.missed.tick(tick);
            }
            Record::Event(event) => self.event(event),
            Record::Frame(_) => {}
        }
    }

    fn event<Name: AsRef<str>>(&mut self, event: &Event<Name>) {
        let Event { sample, name, value, .. } = event;
        let name = name.as_ref();
        self.missed.event(*sample, name);
        let text = (name == "emergency").then(|| RecordedFault::new(*sample, *value).to_string());
        let status = match name {
            "state.boot_up" => Some(("boot-up", None)),
            "state.pre_operational" => Some(("pre-operational", None)),
            "state.operational" => Some(("operational", None)),
            // The emergency comes before the state that it causes, so its text is taken over. No other state keeps a
            // fault.
            "state.fault" => Some(("fault", self.status.fault.take())),
            "emergency" => Some((self.status.state, text.clone())),
            _ => None,
        };
        if let Some((state, fault)) = status {
            self.status = NodeStatus { state, fault };
            let status = self.status.clone();
            self.send(&PageMessage::State(&status));
        }
        let line = EventLine { time_s: self.time_s(*sample), name: name.to_owned(), value: *value, text };
        self.send(&PageMessage::Event(&line));
        keep(&mut self.events, line);
    }

    /// Sends a response that was read to the viewers, and keeps it for later ones.
    pub fn response(&mut self, point: &ResponsePoint) {
        let Sizes { amplitude, clipped } = self.under_test.sizes(point);
        let read = ReadPoint {
            frequency_hz: point.frequency_hz,
            amplitude,
            load: point.load,
            lag_deg: point.lag_rad.map(f64::to_degrees),
            settled: point.settled,
            clipped,
        };
        self.send(&PageMessage::Response(&read));
        keep(&mut self.responses, read);
    }

    /// The lowest and the highest frequency of the responses, Hz.
    pub fn response_range_hz(&self) -> Option<(f64, f64)> {
        self.responses
            .iter()
            .map(|point| (point.frequency_hz, point.frequency_hz))
            .reduce(|(low, high), (hz, _)| (low.min(hz), high.max(hz)))
    }

    /// Sends the computed branch to the viewers, and keeps it in place of the one before.
    pub fn branch(&mut self, branch: BranchLines) {
        self.send(&PageMessage::Branch(&branch));
        self.branch = Some(branch);
    }

    /// Drops everything but the branch: another series begins.
    pub fn restart(&mut self) {
        self.rows.restart();
        self.under_test.test.iter_mut().for_each(TestPanel::restart);
        self.newest = None;
        self.forget();
        self.kept.clear();
        self.new.clear();
        self.events.clear();
        self.responses.clear();
        self.ticks = Ticks::default();
        self.missed = Missed::default();
        self.status = NodeStatus { state: "unknown", fault: None };
        self.is_new = true;
        self.send(&PageMessage::Restarted);
    }

    /// Sets the sample of a recording that is shown: no more data come for it and those before it.
    pub fn shown(&mut self, sample: u64) {
        self.shown = Some(sample);
        self.rows.settle(sample);
    }

    /// Sends the position in a recording to the viewers, and keeps it for later ones.
    pub fn player(&mut self, player: PlayerStatus) {
        self.send(&PageMessage::Player(&player));
        self.player = Some(player);
    }

    /// No more data come.
    pub fn end(&mut self) {
        if !core::mem::replace(&mut self.has_ended, true) {
            // Why a test was stopped is known only now.
            let test = self.test();
            self.outgoing.extend(test);
            self.send(&PageMessage::Ended);
        }
    }

    fn time_s(&self, sample: u64) -> f64 {
        sample as f64 / self.about.rate_hz
    }

    fn send(&mut self, message: &PageMessage) {
        self.outgoing.extend(text(message));
    }

    /// Takes the rows that are complete.
    fn gather(&mut self) {
        while let Some((sample, row)) = self.rows.pop() {
            if self.rows.take_restarted() {
                // An exciter counts from each arming.
                self.under_test.test.iter_mut().for_each(TestPanel::restart);
                self.forget();
                self.kept.clear();
                self.new.clear();
                self.send(&PageMessage::Restarted);
            } else if self.newest.is_some_and(|newest| newest + 1 != sample) {
                self.forget();
            }
            self.newest = Some(sample);
            self.under_test.test.iter_mut().for_each(|test| test.push(&row.numbers));
            if let Some(stretch) = self.extremes.push(sample, &row) {
                self.new.push(stretch.clone());
                self.kept.push_back(stretch);
            }
            self.recent.push_back(row);
            self.unsent += 1;
        }
        trim(&mut self.kept, STRETCHES_KEPT);
        // A spectrum needs the latest rows also after they were sent.
        trim(&mut self.recent, self.spectrum.length().max(ROWS_SENT));
        // After a restart the page has dropped all it had. Otherwise a run that is faster than the clock would fill
        // the updates.
        let (stretches, rows) = match core::mem::take(&mut self.is_new) {
            true => (STRETCHES_KEPT, self.recent.len()),
            false => (STRETCHES_SENT, ROWS_SENT.min(self.recent.len())),
        };
        self.new.drain(..self.new.len().saturating_sub(stretches));
        self.unsent = self.unsent.min(rows);
    }

    /// Samples are missing: the next do not follow the latest rows.
    fn forget(&mut self) {
        self.under_test.test.iter_mut().for_each(TestPanel::interrupt);
        self.recent.clear();
        self.unsent = 0;
        self.extremes.restart();
    }

    /// The messages to every viewer since the last call: `lost` by the loop, `lost_updates` by viewers.
    pub fn take(&mut self, lost: u64, lost_updates: u64, viewers: usize) -> Vec<Message> {
        self.gather();
        let stretches = core::mem::take(&mut self.new);
        let rows: Vec<Row> = self.recent.iter().skip(self.recent.len() - self.unsent).cloned().collect();
        self.unsent = 0;
        let timing = self.ticks.take(self.about.rate_hz);
        let head = UpdateHead { timing, lost, lost_updates, viewers, ..self.head(&stretches, &rows) };
        let mut messages = core::mem::take(&mut self.outgoing);
        messages.extend(binary(&head, &stretches, &rows));
        messages
    }

    /// The head of an update with these stretches and rows, the latest.
    fn head(&self, stretches: &[Stretch], rows: &[Row]) -> UpdateHead {
        let sample = self.newest.unwrap_or(0);
        UpdateHead {
            sample,
            time_s: self.time_s(self.shown.unwrap_or(sample)),
            stretches: stretches.iter().map(|stretch| stretch.first).collect(),
            width: self.extremes.width,
            // A gap empties the latest rows, so they are contiguous up to the newest sample.
            first: (sample + 1).saturating_sub(rows.len() as u64),
            rows: rows.len(),
            stretches_clipped: stretches.iter().map(|stretch| stretch.clipped).collect(),
            rows_clipped: rows.iter().map(|row| row.clipped).collect(),
            timing: None,
            overruns: self.missed.deadlines,
            overrun_causes: self.missed.in_words(),
            lost: 0,
            lost_updates: 0,
            viewers: 0,
        }
    }

    /// How far a vibration test is, and what it has reached, if one is controlled.
    pub fn test(&mut self) -> Option<Message> {
        let status = self.under_test.test.as_mut()?.status();
        text(&PageMessage::Test(&status))
    }

    /// Spectra of the latest samples, if there are enough.
    pub fn spectra(&self) -> Option<Message> {
        if self.recent.len() < self.spectrum.length() {
            return None;
        }
        let skipped = self.recent.len() - self.spectrum.length();
        let recent = || self.recent.iter().skip(skipped);
        let of = |place: usize| self.spectrum.amplitudes(recent().map(|row| row.numbers[place]));
        let has = |place: usize| recent().map(|row| row.numbers[place]).any(|value| value != 0.0 && !value.is_nan());
        // What was measured, if anything was; else what was commanded. Numbers that are all 0 or unknown say nothing.
        let force = [HEAD, FORCE, TORQUE].into_iter().find(|place| has(*place) || has(*place + 1)).unwrap_or(HEAD);
        let [c_x, c_y] = [ACCELERATION_C, ACCELERATION_C + 1];
        let shown = [force, force + 1, c_x, c_y].into_iter().filter_map(clipped_bit).sum::<u32>();
        let force = [of(force), of(force + 1)];
        let acceleration_c = [of(c_x), of(c_y)];
        let [x, y] = &acceleration_c;
        // One peak for both axes, so that it does not depend on the direction of the motion.
        let both: Vec<f32> = x.iter().zip(y).map(|(x, y)| x.hypot(*y)).collect();
        let peak_hz = self.spectrum.peak_hz(&both);
        let line_hz = self.spectrum.line_hz;
        let clipped = recent().fold(0, |bits, row| bits | row.clipped) & shown;
        text(&PageMessage::Spectrum(&Spectra { line_hz, force, acceleration_c, clipped, peak_hz }))
    }

    /// The first messages to a new viewer: everything that is kept.
    pub fn introduction(&self, lost: u64) -> Vec<Message> {
        let messages = [PageMessage::About(&self.about), PageMessage::State(&self.status)].into_iter();
        let messages = messages
            .chain(self.branch.as_ref().map(PageMessage::Branch))
            .chain(self.player.as_ref().map(PageMessage::Player));
        let messages = messages
            .chain(self.set_point.as_ref().map(PageMessage::SetPoint))
            .chain(self.events.iter().map(PageMessage::Event))
            .chain(self.responses.iter().map(PageMessage::Response));
        let messages = messages.chain(self.has_ended.then_some(PageMessage::Ended));
        let mut messages: Vec<Message> = messages.filter_map(|message| text(&message)).collect();
        let stretches: Vec<Stretch> = self.kept.iter().cloned().collect();
        let rows: Vec<Row> = self.recent.iter().cloned().collect();
        messages.extend(binary(&UpdateHead { lost, ..self.head(&stretches, &rows) }, &stretches, &rows));
        messages
    }
}

impl Ticks {
    fn add(&mut self, tick: &TickRecord) {
        self.count += 1;
        self.exec_ns = self.exec_ns.saturating_add(tick.exec_ns);
        self.late_ns = self.late_ns.saturating_add(tick.wakeup_ns);
        self.exec_most_ns = self.exec_most_ns.max(tick.exec_ns);
        self.late_most_ns = self.late_most_ns.max(tick.wakeup_ns);
    }

    /// The figures since the last call, at `rate_hz` samples a second; `None` if there was no tick.
    fn take(&mut self, rate_hz: f64) -> Option<Timing> {
        // Without a tick the means are NaN. They are not returned then.
        let count = self.count as f64;
        let timing = Timing {
            load: self.exec_ns as f64 * 1e-9 * rate_hz / count,
            load_most: self.exec_most_ns as f64 * 1e-9 * rate_hz,
            late_us: self.late_ns as f64 * 1e-3 / count,
            late_most_us: self.late_most_ns as f64 * 1e-3,
        };
        let has_ticks = self.count > 0;
        *self = Ticks::default();
        has_ticks.then_some(timing)
    }
}

fn trim<T>(kept: &mut VecDeque<T>, most: usize) {
    kept.drain(..kept.len().saturating_sub(most));
}

fn keep<T>(kept: &mut VecDeque<T>, one: T) {
    kept.push_back(one);
    trim(kept, LINES_KEPT);
}

/// A message as text. Every one of them can be written as JSON.
pub fn text(message: &PageMessage) -> Option<Message> {
    let json = serde_json::to_string(message).inspect_err(|error| tracing::error!("live view: {error}")).ok()?;
    Some(Message::Text(Utf8Bytes::from(json)))
}

fn binary(head: &UpdateHead, stretches: &[Stretch], rows: &[Row]) -> Option<Message> {
    let bytes = update(head, stretches, rows).inspect_err(|error| tracing::error!("live view: {error}")).ok()?;
    Some(Message::Binary(Bytes::from(bytes)))
}
