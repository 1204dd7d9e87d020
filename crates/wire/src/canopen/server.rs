//! A node: what it does with frames, and the frames that it sends.

use alloc::vec::Vec;

use super::dictionary::{Address, Dictionary, TEXT_MAX_BYTES, Value, at};
use super::pdo::{self, PDOS, Pdo, RECEIVE, TRANSMIT};
use super::sdo::{SDO_BYTES, SdoServer, Step};
use super::{
    Abort, EMERGENCY_BASE, HEARTBEAT_BASE, NMT_ID, NmtCommand, NmtState, SDO_ANSWER_BASE, SDO_REQUEST_BASE, SYNC_ID,
};
use resonarm_protocol::{Frame, FrameFormat, Id};

/// Frames that wait, beside PDOs.
const WAITING: usize = 16;
/// The address of the heartbeat's period, ms.
const HEARTBEAT_PERIOD: Address = at(0x1017, 0);

/// What the values of a node stand for.
pub trait Device {
    /// A master writes a value, by SDO or PDO. It is stored after this.
    ///
    /// # Errors
    /// [`Abort`]: the value is not stored.
    fn write(&mut self, address: Address, value: Value) -> Result<(), Abort>;
}

/// What a frame was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handled {
    /// Not for this node.
    Foreign,
    /// An SDO, a PDO, a request for one.
    Taken,
    /// SYNC: PDOs that waited for it have acted. Call [`Server::release`] when those that it asks for may be sent.
    Sync,
    /// Network management: the node's communication is in its new state.
    Nmt(NmtCommand),
    /// Of this node's identifiers, with too few bytes.
    Short,
    /// With an identifier that only this node sends.
    OtherSender,
}

/// What is sent of a PDO.
#[derive(Clone, Copy, Debug, Default)]
struct Transmit {
    /// A frame waits.
    waits: bool,
    /// SYNC asked for it.
    is_owed: bool,
    /// SYNCs since it was asked for last.
    syncs: u8,
    /// A sample came since it was asked for last.
    has_event: bool,
    queued_ns: Option<u64>,
    due_ns: u64,
}

/// A node with its object dictionary.
#[derive(Clone, Debug)]
pub struct Server {
    node_id: u8,
    dictionary: Dictionary,
    state: NmtState,
    sdo: SdoServer,
    /// Received PDOs that wait for SYNC.
    received: [Option<([u8; 8], usize)>; PDOS as usize],
    transmit: [Transmit; PDOS as usize],
    waiting: Vec<Frame>,
    heartbeat_due_ns: u64,
    unsent: u64,
}

impl Server {
    /// A node of this id, 1 to 127, before its boot-up.
    pub fn new(node_id: u8, dictionary: Dictionary) -> Server {
        Server {
            node_id,
            dictionary,
            state: NmtState::Initialising,
            sdo: SdoServer::new(),
            received: [None; PDOS as usize],
            transmit: [Transmit::default(); PDOS as usize],
            waiting: Vec::with_capacity(WAITING),
            heartbeat_due_ns: 0,
            unsent: 0,
        }
    }

    /// Its node id.
    pub fn node_id(&self) -> u8 {
        self.node_id
    }

    /// The state of its communication.
    pub fn state(&self) -> NmtState {
        self.state
    }

    /// Its object dictionary.
    pub fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// Sets a value of the node's own, the nearest that its type can represent.
    pub fn set(&mut self, address: Address, number: f64) {
        self.dictionary.set(address, number);
    }

    /// Frames never sent, as newer ones replaced them or too many waited.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }

    /// Sends the boot-up message, and is pre-operational.
    pub fn boot(&mut self, now_ns: u64) {
        self.push(HEARTBEAT_BASE, &[NmtState::Initialising.byte()]);
        self.state = NmtState::Initialising;
        self.enter(NmtState::PreOperational);
        self.heartbeat_due_ns = now_ns.saturating_add(self.heartbeat_ns());
    }

    /// Handles a frame.
    pub fn handle_frame(&mut self, now_ns: u64, frame: &Frame, device: &mut impl Device) -> Handled {
        let Id::Standard(id) = frame.id() else { return Handled::Foreign };
        let is_remote = frame.format() == FrameFormat::Remote;
        if !is_remote && frame.format() != FrameFormat::Classic || self.state == NmtState::Initialising {
            return Handled::Foreign;
        }
        let own = u16::from(self.node_id);
        match id {
            NMT_ID if !is_remote => self.handle_nmt(now_ns, frame.data()),
            SYNC_ID if !is_remote && self.state == NmtState::Stopped => Handled::Foreign,
            SYNC_ID if !is_remote => self.synchronise(device),
            id if id == SDO_REQUEST_BASE + own && !is_remote => self.handle_sdo(frame.data(), device),
            id if [EMERGENCY_BASE, SDO_ANSWER_BASE, HEARTBEAT_BASE].iter().any(|base| base + own == id) => {
                if is_remote { Handled::Foreign } else { Handled::OtherSender }
            }
            id => self.handle_pdo(now_ns, id, frame, device),
        }
    }

    fn handle_nmt(&mut self, now_ns: u64, data: &[u8]) -> Handled {
        let &[byte, node, ..] = data else { return Handled::Foreign };
        let command = NmtCommand::of(byte).filter(|_| node == 0 || node == self.node_id);
        let Some(command) = command else { return Handled::Foreign };
        match command {
            NmtCommand::Start => self.enter(NmtState::Operational),
            NmtCommand::Stop => self.enter(NmtState::Stopped),
            NmtCommand::PreOperational => self.enter(NmtState::PreOperational),
            NmtCommand::ResetNode | NmtCommand::ResetCommunication => {
                let is_all = command == NmtCommand::ResetNode;
                self.dictionary.reset(0x1000..=if is_all { u16::MAX } else { 0x1FFF });
                self.sdo = SdoServer::new();
                self.boot(now_ns);
            }
        }
        Handled::Nmt(command)
    }

    fn enter(&mut self, state: NmtState) {
        if state != self.state {
            self.received = [None; PDOS as usize];
            self.transmit = [Transmit::default(); PDOS as usize];
        }
        self.state = state;
    }

    fn handle_sdo(&mut self, data: &[u8], device: &mut impl Device) -> Handled {
        let Ok(request) = <&[u8; SDO_BYTES]>::try_from(data) else { return Handled::Short };
        if self.state == NmtState::Stopped {
            return Handled::Foreign;
        }
        let answer = match self.sdo.handle(request, &self.dictionary) {
            Step::Nothing => return Handled::Taken,
            Step::Answer(answer) => answer,
            Step::Write { address, bytes, len, answer } => {
                match self.write(address, bytes.get(..len).unwrap_or(&[]), device) {
                    Ok(()) => answer,
                    Err(abort) => self.sdo.abort(address, abort),
                }
            }
        };
        self.push(SDO_ANSWER_BASE, &answer);
        Handled::Taken
    }

    /// A master's write: judged by the dictionary, as a PDO parameter, and by the device, in this order.
    fn write(&mut self, address: Address, bytes: &[u8], device: &mut impl Device) -> Result<(), Abort> {
        let value = self.dictionary.judge(address, bytes)?;
        pdo::check(&self.dictionary, address, value)?;
        device.write(address, value)?;
        self.dictionary.store(address, value);
        // What waits of a PDO that is set up anew is not sent: it may be disabled.
        let number = address.index.wrapping_sub(TRANSMIT.communication);
        if let Some(transmit) = self.transmit.get_mut(usize::from(number)) {
            *transmit = Transmit::default();
        }
        Ok(())
    }

    fn handle_pdo(&mut self, now_ns: u64, id: u16, frame: &Frame, device: &mut impl Device) -> Handled {
        for (number, place) in (0..PDOS).zip(0..) {
            let pdo = Pdo { direction: TRANSMIT, number };
            if pdo.id(&self.dictionary) != Some(id) {
                continue;
            }
            if frame.format() != FrameFormat::Remote {
                return Handled::OtherSender;
            }
            if self.state == NmtState::Operational && pdo.allows_remote(&self.dictionary) {
                self.queue(place, now_ns);
            }
            return Handled::Taken;
        }
        if self.state != NmtState::Operational || frame.format() == FrameFormat::Remote {
            return Handled::Foreign;
        }
        let mut handled = Handled::Foreign;
        for number in 0..PDOS {
            if (Pdo { direction: RECEIVE, number }).id(&self.dictionary) == Some(id) {
                handled = self.receive(number, frame.data(), device);
            }
        }
        handled
    }

    fn receive(&mut self, number: u16, data: &[u8], device: &mut impl Device) -> Handled {
        let pdo = Pdo { direction: RECEIVE, number };
        let entries = pdo.mapped(&self.dictionary).filter_map(|address| self.dictionary.entry(address).ok());
        let length: usize = entries.map(|entry| entry.value.len()).sum();
        if data.len() < length {
            return Handled::Short;
        }
        let mut bytes = [0; 8];
        bytes[..length].copy_from_slice(&data[..length]);
        if pdo.kind(&self.dictionary) > 240 {
            self.act(number, &bytes, device);
        } else if let Some(received) = self.received.get_mut(usize::from(number)) {
            *received = Some((bytes, length));
        }
        Handled::Taken
    }

    /// Writes what a PDO holds; what may not be written is left out.
    fn act(&mut self, number: u16, bytes: &[u8; 8], device: &mut impl Device) {
        let mut place = 0;
        for entry in 0..usize::from(u8::MAX) {
            let address = Pdo { direction: RECEIVE, number }.mapped(&self.dictionary).nth(entry);
            let Some(address) = address else { return };
            let length = self.dictionary.entry(address).map_or(0, |entry| entry.value.len());
            let Some(value) = bytes.get(place..place + length) else { return };
            let _refused = self.write(address, value, device);
            place += length;
        }
    }

    fn synchronise(&mut self, device: &mut impl Device) -> Handled {
        if self.state != NmtState::Operational {
            return Handled::Sync;
        }
        for number in 0..PDOS {
            if let Some((bytes, _)) = self.received.get_mut(usize::from(number)).and_then(Option::take) {
                self.act(number, &bytes, device);
            }
        }
        for (number, transmit) in (0..PDOS).zip(&mut self.transmit) {
            let pdo = Pdo { direction: TRANSMIT, number };
            match pdo.kind(&self.dictionary) {
                _ if pdo.id(&self.dictionary).is_none() => {}
                0 => transmit.is_owed |= core::mem::take(&mut transmit.has_event),
                every @ 1..=240 => {
                    transmit.syncs = transmit.syncs.saturating_add(1);
                    if transmit.syncs >= every {
                        (transmit.syncs, transmit.is_owed) = (0, true);
                    }
                }
                _ => {}
            }
        }
        Handled::Sync
    }

    /// Lets the PDOs that SYNC asked for be sent.
    pub fn release(&mut self, now_ns: u64) {
        for place in 0..self.transmit.len() {
            if core::mem::take(&mut self.transmit[place].is_owed) {
                self.queue(place, now_ns);
            }
        }
    }

    /// A sample has been published: an event for PDOs that wait for events.
    pub fn sampled(&mut self, now_ns: u64) {
        for (number, place) in (0..PDOS).zip(0..) {
            let pdo = Pdo { direction: TRANSMIT, number };
            self.transmit[place].has_event = true;
            if self.is_event_driven(pdo) && pdo.event_timer_ns(&self.dictionary) == 0 {
                self.queue(place, now_ns);
            }
        }
    }

    /// Does what is due.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        for (number, place) in (0..PDOS).zip(0..) {
            let pdo = Pdo { direction: TRANSMIT, number };
            let period_ns = pdo.event_timer_ns(&self.dictionary);
            if self.is_event_driven(pdo) && period_ns > 0 && now_ns >= self.transmit[place].due_ns {
                self.transmit[place].due_ns = next(self.transmit[place].due_ns, period_ns, now_ns);
                self.queue(place, now_ns);
            }
        }
        let period_ns = self.heartbeat_ns();
        if self.state != NmtState::Initialising && period_ns > 0 && now_ns >= self.heartbeat_due_ns {
            self.heartbeat_due_ns = next(self.heartbeat_due_ns, period_ns, now_ns);
            self.push(HEARTBEAT_BASE, &[self.state.byte()]);
        }
    }

    /// When [`Server::handle_deadline`] is to be called next, ns; `None` without anything that is due by the clock.
    pub fn next_deadline_ns(&self) -> Option<u64> {
        let is_timed = self.state != NmtState::Initialising && self.heartbeat_ns() > 0;
        let heartbeat = is_timed.then_some(self.heartbeat_due_ns);
        let timers = (0..PDOS).zip(&self.transmit).filter_map(|(number, transmit)| {
            let pdo = Pdo { direction: TRANSMIT, number };
            let is_timed = self.is_event_driven(pdo) && pdo.event_timer_ns(&self.dictionary) > 0;
            is_timed.then_some(transmit.due_ns)
        });
        heartbeat.into_iter().chain(timers).min()
    }

    fn is_event_driven(&self, pdo: Pdo) -> bool {
        let is_on = self.state == NmtState::Operational && pdo.id(&self.dictionary).is_some();
        is_on && matches!(pdo.kind(&self.dictionary), 254 | 255)
    }

    fn heartbeat_ns(&self) -> u64 {
        self.dictionary.number(HEARTBEAT_PERIOD).max(0) as u64 * 1_000_000
    }

    /// Lets a PDO wait to be sent, unless its inhibit time runs.
    fn queue(&mut self, place: usize, now_ns: u64) {
        let pdo = Pdo { direction: TRANSMIT, number: place as u16 };
        let inhibit_ns = pdo.inhibit_ns(&self.dictionary);
        let Some(transmit) = self.transmit.get_mut(place) else { return };
        if transmit.queued_ns.is_some_and(|last_ns| now_ns < last_ns.saturating_add(inhibit_ns)) {
            return;
        }
        transmit.queued_ns = Some(now_ns);
        if core::mem::replace(&mut transmit.waits, true) {
            self.unsent += 1;
        }
    }

    /// Sends an emergency (CiA 301, section 7.2.7) with the manufacturer's bytes, unless the node is stopped.
    pub fn emergency(&mut self, code: u16, register: u8, more: [u8; 5]) {
        if !matches!(self.state, NmtState::PreOperational | NmtState::Operational) {
            return;
        }
        let [low, high] = code.to_le_bytes();
        let [a, b, c, d, e] = more;
        self.push(EMERGENCY_BASE, &[low, high, register, a, b, c, d, e]);
    }

    fn push(&mut self, base: u16, data: &[u8]) {
        let frame = Frame::classic(Id::Standard(base + u16::from(self.node_id)), data);
        match frame {
            Ok(frame) if self.waiting.len() < WAITING => self.waiting.push(frame),
            _ => self.unsent += 1,
        }
    }

    /// How many frames wait.
    pub fn waiting(&self) -> usize {
        self.waiting.len() + self.transmit.iter().filter(|transmit| transmit.waits).count()
    }

    /// Appends the frames that wait, in the order in which they are to be sent, until there are `most`.
    pub fn frames(&self, most: usize, frames: &mut Vec<Frame>) {
        let room = |frames: &Vec<Frame>| most.saturating_sub(frames.len());
        frames.extend(self.waiting.iter().take(room(frames)));
        for (number, transmit) in (0..PDOS).zip(&self.transmit) {
            if transmit.waits && room(frames) > 0 {
                frames.extend(self.pdo_frame(number));
            }
        }
    }

    fn pdo_frame(&self, number: u16) -> Option<Frame> {
        let pdo = Pdo { direction: TRANSMIT, number };
        let (mut payload, mut length) = ([0; 8], 0);
        for entry in pdo.mapped(&self.dictionary).filter_map(|address| self.dictionary.entry(address).ok()) {
            let mut bytes = [0; TEXT_MAX_BYTES];
            let more = entry.value.encode(&mut bytes);
            payload.get_mut(length..length + more)?.copy_from_slice(bytes.get(..more)?);
            length += more;
        }
        Frame::classic(Id::Standard(pdo.id(&self.dictionary)?), &payload[..length]).ok()
    }

    /// The bus has taken the first of the frames that wait. Returns how many of its values are not those that were set,
    /// as they are beyond their types.
    pub fn sent(&mut self) -> u64 {
        if !self.waiting.is_empty() {
            self.waiting.remove(0);
            return 0;
        }
        let Some(place) = self.transmit.iter().position(|transmit| transmit.waits) else { return 0 };
        self.transmit[place].waits = false;
        let mapped = Pdo { direction: TRANSMIT, number: place as u16 }.mapped(&self.dictionary);
        mapped.filter_map(|address| self.dictionary.entry(address).ok()).filter(|entry| entry.is_limited).count() as u64
    }
}

/// When something is due again that was due at `due_ns`: on the beat, or, if that has passed, a period from now.
const fn next(due_ns: u64, period_ns: u64, now_ns: u64) -> u64 {
    let beat_ns = due_ns.saturating_add(period_ns);
    if beat_ns > now_ns { beat_ns } else { now_ns.saturating_add(period_ns) }
}
