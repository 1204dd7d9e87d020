//! Gathers readings, states and loads from the frames of a user protocol.

use std::collections::BTreeMap;

use resonarm_bench::node::WireSpec;
use resonarm_bench::node::mapped::mapping::{
    Lockstep, Mapping, Outgoing, ProtectionCheck, ProtectionFault, ReadingSignal, Said, Source, Trigger, Value,
};
use resonarm_bench::rig::{Load, Readings};
use resonarm_bench::structure::{Channel, Kind, LoadSet, OUTPUTS, States};
use resonarm_protocol::{Frame, FrameFormat, Id};

use super::DISORDER_NS;
use super::index::{Anchor, FrameIndex, Numbering, Placed};
use super::loads::Loads;
use super::rows::{Row, Rows};
use super::wire_import::{Gaps, Missing, WireImport};
use crate::recording::{Clipped, Direction, Record, SampleRecord, StateRecord};
use resonarm_scenario::wire::Quantities;
use resonarm_scenario::{Scenario, ScenarioError};
use resonarm_wire::counter::{CounterFault, Step};

/// A message that the plant sends every sample.
#[derive(Debug)]
struct Reader {
    message: Outgoing,
    name: String,
    protection: ProtectionCheck,
    index: FrameIndex,
}

/// Returns the number of samples for which a sample waits for late frames.
pub(super) fn hold(rate_hz: f64) -> u64 {
    libm::ceil(DISORDER_NS as f64 * 1e-9 * rate_hz) as u64 + 1
}

/// Gathers readings, states and loads frame by frame.
#[derive(Debug)]
pub(super) struct Gatherer {
    ids: BTreeMap<Id, Direction>,
    readers: Vec<Reader>,
    loads: Loads,
    readings: Option<Rows>,
    states: Option<Rows>,
    /// The loads of the records of states.
    taken: LoadSet,
    /// The frame placed last.
    last: Option<Anchor>,
    gaps: Gaps,
    found: WireImport,
}

impl Gatherer {
    /// Makes the gatherer of a scenario; `None` if the scenario has no user protocol.
    pub fn new(scenario: &Scenario) -> Result<Option<Gatherer>, ScenarioError> {
        let (Some(database), Some(WireSpec::Mapped(mapping))) = (scenario.wire_database()?, scenario.wire_spec()?)
        else {
            return Ok(None);
        };
        let rate_hz = scenario.simulation.rate_hz;
        let name = |id| database.message_by_id(id).map_or(String::new(), |message| message.name().to_string());
        let of_sample = mapping.outgoing.iter().filter(|message| is_every_sample(message, &mapping, rate_hz));
        let readers: Vec<Reader> = of_sample
            .enumerate()
            .map(|(order, message)| Reader::new(message, name(message.id), (order, rate_hz)))
            .collect();
        let hold = hold(rate_hz);
        let quantities = Quantities::of_scenario(scenario)?;
        let (readings, missing_readings) = rows(quantities.readings(), &mapping, &readers, hold, Value::Reading);
        let (states, missing_states) = rows(quantities.moving(), &mapping, &readers, hold, Value::State);
        let is_used = |order: usize| {
            let bit = order as u32;
            readings.as_ref().is_some_and(|rows| rows.needs(bit)) || states.as_ref().is_some_and(|rows| rows.needs(bit))
        };
        let is_placed_by_time =
            (0..).zip(&readers).any(|(order, reader)| is_used(order) && reader.index.numbering == Numbering::Time);
        Ok(Some(Gatherer {
            ids: directions(&mapping),
            loads: Loads::new(&mapping, states.is_some(), name),
            readings,
            states,
            taken: quantities.loads(),
            readers,
            last: None,
            gaps: Gaps::default(),
            found: WireImport { missing_readings, missing_states, is_placed_by_time, ..WireImport::default() },
        }))
    }

    /// Returns the direction of frames with an identifier; `None` if the mapping has no message with it.
    pub fn direction(&self, id: Id) -> Option<Direction> {
        self.ids.get(&id).copied()
    }

    /// Processes a frame. Returns its sample, if its readings determine it.
    pub fn add(&mut self, frame: &Frame, time_ns: u64) -> Option<u64> {
        if frame.format() == FrameFormat::Remote {
            return self.now();
        }
        match self.readers.iter().position(|reader| reader.message.id == frame.id()) {
            Some(place) => self.read(place, frame, time_ns).or(self.now()),
            None => {
                let now = self.now();
                self.loads.add(frame, now.unwrap_or(0), &mut self.found);
                now
            }
        }
    }

    /// Returns the newest sample to which a frame was assigned.
    fn now(&self) -> Option<u64> {
        self.last.map(|last| last.sample)
    }

    fn read(&mut self, place: usize, frame: &Frame, time_ns: u64) -> Option<u64> {
        let reader = &mut self.readers[place];
        let (step, raw) = match reader.check(frame) {
            Ok(found) => found,
            Err(Unusable::Repeated) => {
                self.found.repeated_frames += 1;
                return None;
            }
            Err(Unusable::Wrong) => {
                *self.found.refused_frames.entry(reader.name.clone()).or_default() += 1;
                return None;
            }
        };
        if let Some(Step::Lost { frames }) = step {
            self.found.lost_frames += frames;
        }
        let sample = match reader.index.place(raw, step, time_ns, self.last) {
            Placed::At(sample) => sample,
            Placed::Repeated | Placed::Before => {
                self.found.repeated_frames += 1;
                return None;
            }
        };
        // An older frame must not move the newest sample back.
        if self.last.is_none_or(|last| sample >= last.sample) {
            self.last = reader.index.last;
        }
        let payload = frame.data();
        let message = place as u32;
        let signals = &reader.message.signals;
        if let Some(rows) = self.readings.as_mut().filter(|rows| rows.needs(message)) {
            rows.add(sample, message, |row| signals.iter().for_each(|signal| write_reading(signal, payload, row)));
        }
        if let Some(rows) = self.states.as_mut().filter(|rows| rows.needs(message)) {
            rows.add(sample, message, |row| signals.iter().for_each(|signal| write_state(signal, payload, row)));
        }
        Some(sample)
    }

    /// Returns the next record; `is_end` after the last frame.
    pub fn next(&mut self, is_end: bool) -> Option<Record> {
        if let Some((sample, row)) = self.readings.as_mut().and_then(|rows| rows.next(is_end)) {
            self.found.samples += 1;
            self.gaps.count(sample, &mut self.found);
            return Some(Record::Sample(sample_record(sample, &row)));
        }
        let (sample, row) = self.states.as_mut()?.next(is_end)?;
        self.found.states += 1;
        // Readings and states share most of their samples; a gap is counted once.
        if self.readings.is_none() {
            self.gaps.count(sample, &mut self.found);
        }
        Some(Record::State(state_record(sample, &row, (self.loads.changes.at(sample), self.taken))))
    }

    /// Returns the data gathered from all frames.
    pub fn finish(self) -> WireImport {
        let mut found = self.found;
        if let Some(rows) = self.readings.or(self.states) {
            found.incomplete_samples = rows.incomplete;
            found.repeated_frames += rows.too_late;
        }
        found
    }
}

impl Reader {
    fn new(message: &Outgoing, name: String, (order, rate_hz): (usize, f64)) -> Reader {
        // An index is the better number: it goes round later than a counter, and names the sample itself.
        let of_signal = message.signals.iter().find_map(|signal| match signal.source {
            Source::Sample { modulus } if modulus >= 2.0 => Some(Numbering::Sample(modulus as u64)),
            _ => None,
        });
        let of_counter = message.protection.counter.as_ref().map(|counter| Numbering::Counter(counter.values()));
        let numbering = of_signal.or(of_counter).unwrap_or(Numbering::Time);
        let protection = ProtectionCheck::new(message.form(), &message.protection);
        Reader { message: message.clone(), name, protection, index: FrameIndex::new(order, numbering, rate_hz) }
    }

    /// Returns how the counter follows, and the number of the frame.
    fn check(&mut self, frame: &Frame) -> Result<(Option<Step>, Option<u64>), Unusable> {
        let step = self.protection.step(frame).map_err(|fault| match fault {
            ProtectionFault::Counter(CounterFault::Repeated { .. }) => Unusable::Repeated,
            _ => Unusable::Wrong,
        })?;
        Ok((step, self.number(frame.data()).ok_or(Unusable::Wrong)?))
    }

    /// Returns the number of a frame, if its message has one; `None` if the payload ends before a signal, or a signal
    /// is not a number.
    fn number(&self, payload: &[u8]) -> Option<Option<u64>> {
        let mut index = None;
        for ReadingSignal { signal, source } in &self.message.signals {
            if let (Some(value), Source::Sample { .. }) = (signal.read(payload).ok()?, source) {
                index = (value >= 0.0).then(|| libm::rint(value) as u64);
            }
        }
        Some(match self.index.numbering {
            Numbering::Sample(_) => Some(index?),
            Numbering::Counter(_) => Some(self.message.protection.counter.as_ref()?.read(payload)?),
            Numbering::Time => None,
        })
    }
}

/// Reason for which a frame of readings can't be used.
enum Unusable {
    /// Its counter is that of the frame before.
    Repeated,
    /// Its checksum, counter or length is wrong, or a signal is no number.
    Wrong,
}

/// Says whether a message is sent every sample: by the samples, or by a clock of their rate.
fn is_every_sample(message: &Outgoing, mapping: &Mapping, rate_hz: f64) -> bool {
    match message.trigger {
        Trigger::Every(samples) => samples == 1,
        Trigger::Period(period_ns) => (period_ns as f64 * 1e-9 * rate_hz - 1.0).abs() < 1e-6,
        Trigger::Sync => mapping.lockstep == Lockstep::Sync,
        Trigger::Request => false,
    }
}

/// Returns rows of `channels`, if the messages of every sample carry all of them, and the missing channels.
fn rows(
    channels: &[Channel],
    mapping: &Mapping,
    readers: &[Reader],
    hold: u64,
    value: fn(usize) -> Value,
) -> (Option<Rows>, Vec<Missing>) {
    let carries = |message: &Outgoing, of: Value| {
        message.signals.iter().any(|signal| matches!(signal.source, Source::Value { value, .. } if value == of))
    };
    // A message without a bit of its own is not marked: more messages than bits are refused below.
    let bit = |order: usize| 1_u64.checked_shl(order as u32).unwrap_or(0);
    let mut needed = 0;
    let mut missing = Vec::new();
    for (place, channel) in channels.iter().enumerate() {
        match readers.iter().position(|reader| carries(&reader.message, value(place))) {
            Some(order) => needed |= bit(order),
            None => {
                let is_carried = mapping.outgoing.iter().any(|message| carries(message, value(place)));
                missing.push(Missing { channel: channel.name, is_carried });
            }
        }
        let clips = readers.iter().position(|reader| carries(&reader.message, Value::Clipped(place)));
        if let (Some(order), Kind::Reading { .. }) = (clips, channel.kind) {
            needed |= bit(order);
        }
    }
    // Beyond as many messages as there are bits.
    let is_possible = missing.is_empty() && readers.len() <= 64;
    (is_possible.then(|| Rows::new(channels.len(), needed, hold)), missing)
}

fn directions(mapping: &Mapping) -> BTreeMap<Id, Direction> {
    let incoming = mapping.incoming.iter().map(|message| (message.id, Direction::Received));
    incoming.chain(mapping.outgoing.iter().map(|message| (message.id, Direction::Sent))).collect()
}

/// Writes a reading in its SI unit, and whether it is beyond its range: if a mark says so, or at the limit of its
/// signal, to which a plant clips it.
fn write_reading(of: &ReadingSignal, payload: &[u8], row: &mut Row) {
    let (place, is_clipped) = match of.reading(payload) {
        Ok(Some(Said::Value { place, value, is_at_end })) => {
            let Some(to) = row.values.get_mut(place) else { return };
            *to = value;
            (place, is_at_end)
        }
        Ok(Some(Said::Clipped { place, is_clipped })) if place < row.values.len() => (place, is_clipped),
        Ok(_) | Err(_) => return,
    };
    row.clipped |= u32::from(is_clipped) << place;
}

fn write_state(of: &ReadingSignal, payload: &[u8], row: &mut Row) {
    let (Ok(Some(got)), Source::Value { value: Value::State(place), scale, offset }) =
        (of.signal.read(payload), &of.source)
    else {
        return;
    };
    if let Some(state) = row.values.get_mut(*place) {
        *state = (got - offset) / scale;
    }
}

/// Returns the states of a sample, with the load from it on, of a plant that accepts these loads.
pub(super) fn state_record(sample: u64, row: &Row, (load, taken): (Load, LoadSet)) -> StateRecord {
    let count = row.values.len();
    let states = States::written(count, count, |numbers| numbers.copy_from_slice(&row.values));
    StateRecord { sample, states, load, taken, is_end: false }
}

fn sample_record(sample: u64, row: &Row) -> SampleRecord {
    // A mapping counts the force of the head first, and a recording has it last.
    let (of_every_rig, more) = row.values.split_at(OUTPUTS.len());
    let pair = |place: usize| [of_every_rig[place], of_every_rig[place + 1]];
    let is_clipped = |place: usize| [row.clipped >> place & 1 == 1, row.clipped >> (place + 1) & 1 == 1];
    SampleRecord {
        sample,
        head_force_n: pair(0),
        acceleration_b_m_s2: pair(2),
        acceleration_c_m_s2: pair(4),
        clipped: Clipped { head_force: is_clipped(0), acceleration_b: is_clipped(2), acceleration_c: is_clipped(4) },
        more: Readings::new(more, row.clipped >> OUTPUTS.len()).unwrap_or_default(),
    }
}

#[cfg(test)]
#[path = "wire_tests.rs"]
mod tests;
