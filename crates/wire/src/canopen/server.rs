//! A CANopen node: handles frames, and queues the frames that it sends.

use alloc::vec::Vec;

use super::abort::Abort;
use super::dictionary::{Address, Dictionary, TEXT_MAX_BYTES, Value, at};
use super::errors::{CONSUMER_HEARTBEAT, ERROR_REGISTER, check_consumer, check_history, record_error};
use super::heartbeat::Consumers;
use super::nmt::{NmtCommand, NmtState};
use super::pdo::{self, PDOS, Pdo, RECEIVE, TRANSMIT};
use super::sdo::{SDO_BYTES, SdoServer, Step};
use super::{EMERGENCY_BASE, HEARTBEAT_BASE, NMT_ID, NODE_ID_MAX, SDO_ANSWER_BASE, SDO_REQUEST_BASE, SYNC_ID};
use resonarm_protocol::{Frame, FrameFormat, Id};

/// Capacity of the queue for frames other than PDOs.
const WAITING: usize = 16;
/// Address of the heartbeat period, ms.
const HEARTBEAT_PERIOD: Address = at(0x1017, 0);
/// Emergency error code of a received PDO that is shorter than its mapping, and is ignored (CiA 301, table 26).
const TOO_SHORT: u16 = 0x8210;
/// Emergency error code of a received PDO that is longer than its mapping: its first bytes are used.
const TOO_LONG: u16 = 0x8220;
/// Bits of the error register for a PDO of the wrong length: generic error and communication error.
const LENGTH_ERROR_REGISTER: u8 = 0x11;

/// Meaning of a node's values, which its device supplies.
pub trait Device {
    /// Judges a value that a master writes by SDO or PDO. The server stores the value afterwards.
    ///
    /// # Errors
    /// [`Abort`]: the value is not stored.
    fn write(&mut self, address: Address, value: Value) -> Result<(), Abort>;

    /// Returns a number that changes whenever values received earlier must no longer act. PDO data that was
    /// received before such a change and still waits for SYNC is dropped.
    fn epoch(&self) -> u32;
}

/// Effect of a frame on the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handled {
    /// The frame is not for this node.
    Foreign,
    /// The frame was an SDO, a PDO or a request for a PDO.
    Taken,
    /// The frame was SYNC, and PDOs that waited for it have acted. Call [`Server::release`] when the PDOs that
    /// it requests may be sent.
    Sync,
    /// The frame was a command of network management, and the node has entered its new state.
    Nmt(NmtCommand),
    /// The frame has one of the node's identifiers and the wrong length; it was ignored.
    Length,
    /// The frame was a PDO shorter than its mapping; it was ignored.
    ShortPdo {
        /// Number of the PDO, from 1.
        number: u16,
        /// Length of its mapping, bytes.
        mapped: usize,
    },
    /// The frame has one of the node's identifiers and is a CAN FD frame; it was ignored.
    Format,
    /// The frame has an identifier that only this node may send.
    OtherSender,
}

/// State of a PDO that the node sends.
#[derive(Clone, Copy, Debug, Default)]
struct Transmit {
    /// A frame waits to be sent.
    waits: bool,
    /// A SYNC has requested it.
    is_owed: bool,
    /// Number of SYNCs since it was last requested.
    syncs: u8,
    /// A sample has come since it was last requested.
    has_event: bool,
    queued_ns: Option<u64>,
    /// It was requested during the inhibit time, and is sent at its end.
    is_deferred: bool,
    due_ns: u64,
}

/// Data of a received PDO that waits for SYNC.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    bytes: [u8; 8],
    /// Time of reception, ns of time listened.
    received_ns: u64,
    /// Epoch of the device at reception.
    epoch: u32,
}

/// A CANopen node with its object dictionary.
#[derive(Clone, Debug)]
pub struct Server {
    node_id: u8,
    dictionary: Dictionary,
    state: NmtState,
    sdo: SdoServer,
    /// Received PDOs that wait for SYNC.
    received: [Option<Waiting>; PDOS as usize],
    /// Longest time that they may wait, ns of time listened.
    wait_limit_ns: u64,
    /// Number of PDOs dropped because they were too old, or their parameters were written.
    dropped: u64,
    /// Error code of the last wrong length of each received PDO, until one of the right length comes.
    length_errors: [Option<u16>; PDOS as usize],
    /// Bits of the error register that the device has set.
    device_register: u8,
    consumers: Consumers,
    transmit: [Transmit; PDOS as usize],
    waiting: Vec<Frame>,
    heartbeat_due_ns: u64,
    /// Time of the last frame, ns; the next field is the time listened, ns.
    now_ns: u64,
    listened_ns: u64,
    unsent: u64,
}

impl Server {
    /// Returns a node of this id, 1 to 127, before its boot-up. PDO data that waits for SYNC is dropped once it
    /// is older than `wait_limit_ns`, on the clock of [`Server::look`].
    pub fn new(node_id: u8, dictionary: Dictionary, wait_limit_ns: u64) -> Server {
        Server {
            node_id,
            dictionary,
            state: NmtState::Initialising,
            sdo: SdoServer::default(),
            received: [None; PDOS as usize],
            wait_limit_ns,
            dropped: 0,
            length_errors: [None; PDOS as usize],
            device_register: 0,
            consumers: Consumers::default(),
            transmit: [Transmit::default(); PDOS as usize],
            waiting: Vec::with_capacity(WAITING),
            heartbeat_due_ns: 0,
            now_ns: 0,
            listened_ns: 0,
            unsent: 0,
        }
    }

    /// Returns the node id.
    pub fn node_id(&self) -> u8 {
        self.node_id
    }

    /// Returns the state of the communication.
    pub fn state(&self) -> NmtState {
        self.state
    }

    /// Returns the object dictionary.
    pub fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// Sets a value on behalf of the node, the closest that its type can represent.
    pub fn set(&mut self, address: Address, number: f64) {
        self.dictionary.set(address, number);
    }

    /// Sets the time for which the node has listened, ns. It is the clock for the age of PDO data and of other
    /// nodes' heartbeats.
    pub fn look(&mut self, listened_ns: u64) {
        self.listened_ns = listened_ns;
    }

    /// Returns the number of PDOs dropped since the last call while waiting for SYNC, too old or with new
    /// parameters. PDOs from an earlier state of the device don't count: the device accepts nothing in such a
    /// state.
    pub fn take_dropped(&mut self) -> u64 {
        core::mem::take(&mut self.dropped)
    }

    /// Sets the bits of the error register (object 1001) that the device causes.
    pub fn set_register(&mut self, device: u8) {
        self.device_register = device;
        self.dictionary.set(ERROR_REGISTER, f64::from(self.register()));
    }

    /// Returns the error register.
    pub fn register(&self) -> u8 {
        let has_length_error = self.length_errors.iter().any(Option::is_some);
        self.device_register | if has_length_error { LENGTH_ERROR_REGISTER } else { 0 }
    }

    /// Returns the monitored heartbeats (object 1016): the time of the last one, ns of time listened, and its
    /// limit, ns.
    pub fn watched_heartbeats(&self) -> impl Iterator<Item = (u64, u64)> {
        self.consumers.watched(&self.dictionary)
    }

    /// Returns whether a monitored heartbeat is overdue. An operational node then becomes pre-operational (the
    /// default of object 1029), and monitoring restarts with the next heartbeat.
    pub fn takes_heartbeat_loss(&mut self, is_over: impl Fn(u64, u64) -> bool) -> bool {
        let is_lost = self.consumers.take_lost(&self.dictionary, is_over);
        if is_lost && self.state == NmtState::Operational {
            self.enter(NmtState::PreOperational);
        }
        is_lost
    }

    /// Returns the number of frames that were never sent, because a newer one replaced them or the queue was
    /// full.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }

    /// Queues the boot-up message and enters pre-operational.
    pub fn boot(&mut self, now_ns: u64) {
        // The boot-up message is a heartbeat with the state 0 (CiA 301). It is queued before the state changes, so
        // that it comes before everything that the node sends in the new one.
        self.push(HEARTBEAT_BASE, &[NmtState::Initialising.byte()]);
        self.state = NmtState::Initialising;
        self.length_errors = [None; PDOS as usize];
        self.consumers = Consumers::default();
        self.set_register(self.device_register);
        self.enter(NmtState::PreOperational);
        self.heartbeat_due_ns = now_ns.saturating_add(self.heartbeat_ns());
    }

    /// Handles a frame from the bus.
    pub fn handle_frame(&mut self, now_ns: u64, frame: &Frame, device: &mut impl Device) -> Handled {
        let Id::Standard(id) = frame.id() else { return Handled::Foreign };
        let is_remote = frame.format() == FrameFormat::Remote;
        // A node that has not booted is not on the network.
        if self.state == NmtState::Initialising {
            return Handled::Foreign;
        }
        if !is_remote && frame.format() != FrameFormat::Classic {
            return self.handle_fd(id);
        }
        self.now_ns = now_ns;
        let own = u16::from(self.node_id);
        match id {
            NMT_ID if !is_remote => self.handle_nmt(now_ns, frame.data()),
            // A stopped node serves no SYNC, SDO or PDO (CiA 301).
            SYNC_ID if !is_remote && self.state == NmtState::Stopped => Handled::Foreign,
            // SYNC has no data, or one byte with its counter (CiA 301).
            SYNC_ID if !is_remote && frame.data().len() > 1 => Handled::Length,
            SYNC_ID if !is_remote => self.synchronise(device),
            id if id == SDO_REQUEST_BASE + own && !is_remote => self.handle_sdo(frame.data(), device),
            id if [EMERGENCY_BASE, SDO_ANSWER_BASE, HEARTBEAT_BASE].iter().any(|base| base + own == id) => {
                // A remote frame has the identifier of what it asks for, so it is no sign of a second node with this
                // id.
                if is_remote { Handled::Foreign } else { Handled::OtherSender }
            }
            id if !is_remote && (HEARTBEAT_BASE + 1..=HEARTBEAT_BASE + u16::from(NODE_ID_MAX)).contains(&id) => {
                self.hear_heartbeat((id - HEARTBEAT_BASE) as u8, frame.data())
            }
            id => self.handle_pdo(now_ns, id, frame, device),
        }
    }

    /// Handles a CAN FD frame. CANopen uses classical frames only, so one under the node's identifiers is
    /// rejected.
    fn handle_fd(&self, id: u16) -> Handled {
        let own = u16::from(self.node_id);
        let is_own = [EMERGENCY_BASE, SDO_ANSWER_BASE, HEARTBEAT_BASE].iter().any(|base| base + own == id);
        let is_pdo = |direction| (0..PDOS).any(|number| Pdo { direction, number }.id(&self.dictionary) == Some(id));
        if is_own || is_pdo(TRANSMIT) {
            Handled::OtherSender
        } else if matches!(id, NMT_ID | SYNC_ID) || id == SDO_REQUEST_BASE + own || is_pdo(RECEIVE) {
            Handled::Format
        } else {
            Handled::Foreign
        }
    }

    /// Handles the heartbeat of another node.
    fn hear_heartbeat(&mut self, node_id: u8, data: &[u8]) -> Handled {
        match (self.consumers.place_of(&self.dictionary, node_id), data) {
            (None, _) => Handled::Foreign,
            (Some(place), &[_state]) => {
                self.consumers.hear(place, self.listened_ns);
                Handled::Taken
            }
            (Some(_), _) => Handled::Length,
        }
    }

    fn handle_nmt(&mut self, now_ns: u64, data: &[u8]) -> Handled {
        let &[byte, node] = data else { return Handled::Length };
        let command = NmtCommand::of(byte).filter(|_| node == 0 || node == self.node_id);
        let Some(command) = command else { return Handled::Foreign };
        match command {
            NmtCommand::Start => self.enter(NmtState::Operational),
            NmtCommand::Stop => self.enter(NmtState::Stopped),
            NmtCommand::PreOperational => self.enter(NmtState::PreOperational),
            NmtCommand::ResetNode | NmtCommand::ResetCommunication => {
                // Reset communication restores the communication objects, 1000h to 1FFFh, alone; reset node also
                // restores those of the manufacturer and of the device profile (CiA 301).
                let is_all = command == NmtCommand::ResetNode;
                self.dictionary.reset(0x1000..=if is_all { u16::MAX } else { 0x1FFF });
                self.sdo = SdoServer::default();
                self.boot(now_ns);
            }
        }
        Handled::Nmt(command)
    }

    fn enter(&mut self, state: NmtState) {
        // A change of state discards what waits: targets received before a stop must not act after the next
        // start.
        if state != self.state {
            self.received = [None; PDOS as usize];
            self.transmit = [Transmit::default(); PDOS as usize];
        }
        self.state = state;
    }

    fn handle_sdo(&mut self, data: &[u8], device: &mut impl Device) -> Handled {
        let Ok(request) = <&[u8; SDO_BYTES]>::try_from(data) else { return Handled::Length };
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

    /// Handles a master's write: the dictionary judges it, then the rules for PDO parameters, then the device.
    fn write(&mut self, address: Address, bytes: &[u8], device: &mut impl Device) -> Result<(), Abort> {
        // Everything that can reject the value comes before it is stored, and the device, which may act on it, last.
        let value = self.dictionary.judge(address, bytes)?;
        pdo::check(&self.dictionary, address, value)?;
        check_history(address, value)?;
        check_consumer(&self.dictionary, address, value)?;
        device.write(address, value)?;
        self.dictionary.store(address, value);
        // A PDO with new parameters may be disabled or have another mapping. A frame that waits under the old
        // ones is not sent.
        let number = address.index.wrapping_sub(TRANSMIT.communication);
        if let Some(transmit) = self.transmit.get_mut(usize::from(number)) {
            *transmit = Transmit::default();
        }
        // Data received under the old parameters does not act either.
        for base in [RECEIVE.communication, RECEIVE.mapping] {
            let number = address.index.wrapping_sub(base);
            if let Some(received) = self.received.get_mut(usize::from(number)) {
                self.dropped += u64::from(received.take().is_some());
            }
        }
        if address == HEARTBEAT_PERIOD {
            self.heartbeat_due_ns = self.now_ns.saturating_add(self.heartbeat_ns());
        }
        if address.index == CONSUMER_HEARTBEAT {
            self.consumers.forget(address.subindex);
        }
        Ok(())
    }

    fn handle_pdo(&mut self, now_ns: u64, id: u16, frame: &Frame, device: &mut impl Device) -> Handled {
        for (number, place) in (0..PDOS).zip(0..) {
            let pdo = Pdo { direction: TRANSMIT, number };
            if pdo.id(&self.dictionary) != Some(id) {
                continue;
            }
            // Only this node sends its own PDOs, in whatever state it is, so such a frame shows a second node with
            // this id.
            if frame.format() != FrameFormat::Remote {
                return Handled::OtherSender;
            }
            if self.state == NmtState::Operational && pdo.allows_remote(&self.dictionary) {
                self.request(place, now_ns);
            }
            return Handled::Taken;
        }
        if self.state != NmtState::Operational || frame.format() == FrameFormat::Remote {
            return Handled::Foreign;
        }
        // Several received PDOs may have the same identifier, and each of them takes the frame.
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
        // The length follows from the mapping as it is now: the master may have changed it since the last frame.
        let entries = pdo.mapped(&self.dictionary).filter_map(|address| self.dictionary.entry(address).ok());
        let length: usize = entries.map(|entry| entry.value.len()).sum();
        let mut bytes = [0; 8];
        let whole =
            data.get(..length).and_then(|used| bytes.get_mut(..length).map(|place| place.copy_from_slice(used)));
        let error = match whole {
            None => Some(TOO_SHORT),
            Some(()) => (data.len() > length).then_some(TOO_LONG),
        };
        self.note_length(number, error, [data.len(), length]);
        if whole.is_none() {
            return Handled::ShortPdo { number: number + 1, mapped: length };
        }
        // Types 0 to 240 act at the next SYNC, the others at once (CiA 301, table 54).
        if pdo.kind(&self.dictionary) > 240 {
            self.act(number, &bytes, device);
        } else if let Some(received) = self.received.get_mut(usize::from(number)) {
            *received = Some(Waiting { bytes, received_ns: self.listened_ns, epoch: device.epoch() });
        }
        Handled::Taken
    }

    /// Reports to the master, once, that the length of a PDO differs from its mapping (CiA 301, section
    /// 7.5.2.36), and once that all lengths are right again.
    fn note_length(&mut self, number: u16, error: Option<u16>, [got, mapped]: [usize; 2]) {
        let Some(last) = self.length_errors.get_mut(usize::from(number)) else { return };
        if core::mem::replace(last, error) == error {
            return;
        }
        self.set_register(self.device_register);
        let byte = |length: usize| u8::try_from(length).unwrap_or(u8::MAX);
        match error {
            Some(code) => self.emergency(code, self.register(), [number as u8 + 1, byte(got), byte(mapped), 0, 0]),
            // Code 0000h says that no error is left (CiA 301), so it is not sent while another one stays.
            None if self.register() == 0 => self.emergency(0, 0, [0; 5]),
            None => {}
        }
    }

    /// Writes the values of a PDO. Values that may not be written are skipped.
    fn act(&mut self, number: u16, bytes: &[u8; 8], device: &mut impl Device) {
        let mut place = 0;
        // The mapping is read anew for every entry, since a borrow of the dictionary cannot last over the write.
        for entry in 0..usize::from(u8::MAX) {
            let address = Pdo { direction: RECEIVE, number }.mapped(&self.dictionary).nth(entry);
            let Some(address) = address else { return };
            let length = self.dictionary.entry(address).map_or(0, |entry| entry.value.len());
            let Some(value) = bytes.get(place..place + length) else { return };
            // A PDO has no answer in which a refusal could be reported. The entries after it are still written.
            let _refused = self.write(address, value, device);
            place += length;
        }
    }

    fn synchronise(&mut self, device: &mut impl Device) -> Handled {
        if self.state != NmtState::Operational {
            return Handled::Sync;
        }
        for number in 0..PDOS {
            let Some(waiting) = self.received.get_mut(usize::from(number)).and_then(Option::take) else { continue };
            // A PDO written before this one may have changed the device's state, so the epoch is compared for
            // each.
            let age_ns = self.listened_ns.saturating_sub(waiting.received_ns);
            if age_ns > self.wait_limit_ns {
                self.dropped += 1;
            } else if waiting.epoch == device.epoch() {
                self.act(number, &waiting.bytes, device);
            }
        }
        for (number, transmit) in (0..PDOS).zip(&mut self.transmit) {
            let pdo = Pdo { direction: TRANSMIT, number };
            match pdo.kind(&self.dictionary) {
                _ if pdo.id(&self.dictionary).is_none() => {}
                // Type 0 is acyclic: it is sent at the SYNC after an event. Types 1 to 240 count SYNCs.
                0 => transmit.is_owed |= core::mem::take(&mut transmit.has_event),
                every @ 1..=240 => {
                    transmit.syncs = transmit.syncs.saturating_add(1);
                    if transmit.syncs >= every {
                        transmit.syncs = 0;
                        transmit.is_owed = true;
                    }
                }
                _ => {}
            }
        }
        Handled::Sync
    }

    /// Queues the PDOs that SYNC has requested.
    pub fn release(&mut self, now_ns: u64) {
        for place in 0..self.transmit.len() {
            if core::mem::take(&mut self.transmit[place].is_owed) {
                self.queue(place, now_ns);
            }
        }
    }

    /// Notes that a sample has been published, which is an event for event-driven PDOs.
    pub fn sampled(&mut self, now_ns: u64) {
        for (number, place) in (0..PDOS).zip(0..) {
            let pdo = Pdo { direction: TRANSMIT, number };
            self.transmit[place].has_event = true;
            if self.is_event_driven(pdo) && pdo.event_timer_ns(&self.dictionary) == 0 {
                self.request(place, now_ns);
            }
        }
    }

    /// Queues everything that is due at `now_ns`.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        for (number, place) in (0..PDOS).zip(0..) {
            let pdo = Pdo { direction: TRANSMIT, number };
            let period_ns = pdo.event_timer_ns(&self.dictionary);
            if self.is_event_driven(pdo) && period_ns > 0 && now_ns >= self.transmit[place].due_ns {
                self.transmit[place].due_ns = next(self.transmit[place].due_ns, period_ns, now_ns);
                self.request(place, now_ns);
            }
            if self.transmit[place].is_deferred && now_ns >= self.inhibited_until_ns(place) {
                self.queue(place, now_ns);
            }
        }
        let period_ns = self.heartbeat_ns();
        if self.state != NmtState::Initialising && period_ns > 0 && now_ns >= self.heartbeat_due_ns {
            self.heartbeat_due_ns = next(self.heartbeat_due_ns, period_ns, now_ns);
            self.push(HEARTBEAT_BASE, &[self.state.byte()]);
        }
    }

    /// Returns the time at which [`Server::handle_deadline`] must be called next, ns; `None` if nothing is due
    /// by the clock.
    pub fn next_deadline_ns(&self) -> Option<u64> {
        let is_timed = self.state != NmtState::Initialising && self.heartbeat_ns() > 0;
        let heartbeat = is_timed.then_some(self.heartbeat_due_ns);
        let timers = (0..PDOS).zip(&self.transmit).filter_map(|(number, transmit)| {
            let pdo = Pdo { direction: TRANSMIT, number };
            let is_timed = self.is_event_driven(pdo) && pdo.event_timer_ns(&self.dictionary) > 0;
            is_timed.then_some(transmit.due_ns)
        });
        let deferred = (0..self.transmit.len()).filter(|place| self.transmit[*place].is_deferred);
        let deferred = deferred.map(|place| self.inhibited_until_ns(place));
        heartbeat.into_iter().chain(timers).chain(deferred).min()
    }

    fn is_event_driven(&self, pdo: Pdo) -> bool {
        let is_on = self.state == NmtState::Operational && pdo.id(&self.dictionary).is_some();
        is_on && matches!(pdo.kind(&self.dictionary), 254 | 255)
    }

    fn heartbeat_ns(&self) -> u64 {
        self.dictionary.number(HEARTBEAT_PERIOD).max(0) as u64 * 1_000_000
    }

    /// Returns the time at which the inhibit time of a PDO ends, ns of the clock.
    fn inhibited_until_ns(&self, place: usize) -> u64 {
        let inhibit_ns = Pdo { direction: TRANSMIT, number: place as u16 }.inhibit_ns(&self.dictionary);
        let last_ns = self.transmit.get(place).and_then(|transmit| transmit.queued_ns);
        last_ns.map_or(0, |last_ns| last_ns.saturating_add(inhibit_ns))
    }

    /// Requests a PDO because of an event or a remote frame. It is queued at once, or at the end of its inhibit
    /// time.
    fn request(&mut self, place: usize, now_ns: u64) {
        if now_ns >= self.inhibited_until_ns(place) {
            self.queue(place, now_ns);
        } else if let Some(transmit) = self.transmit.get_mut(place) {
            transmit.is_deferred = true;
        }
    }

    /// Queues a PDO, which is built when it is sent.
    fn queue(&mut self, place: usize, now_ns: u64) {
        let Some(transmit) = self.transmit.get_mut(place) else { return };
        transmit.queued_ns = Some(now_ns);
        transmit.is_deferred = false;
        // The frame is built when it is sent. A PDO that already waits is so replaced by its newer values.
        if core::mem::replace(&mut transmit.waits, true) {
            self.unsent += 1;
        }
    }

    /// Sends an emergency (CiA 301, section 7.2.7) with manufacturer-specific bytes, unless the node is
    /// stopped, and writes an error into the history (object 1003).
    pub fn emergency(&mut self, code: u16, register: u8, more: [u8; 5]) {
        if code != 0 {
            record_error(&mut self.dictionary, code, u16::from_le_bytes([more[0], more[1]]));
        }
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

    /// Returns the number of frames that wait.
    pub fn waiting(&self) -> usize {
        self.waiting.len() + self.transmit.iter().filter(|transmit| transmit.waits).count()
    }

    /// Appends the frames that wait, in the order of sending, until `frames` has `most`.
    pub fn frames(&self, most: usize, frames: &mut Vec<Frame>) {
        let room = |frames: &Vec<Frame>| most.saturating_sub(frames.len());
        // The same order as in `sent`, which removes the first frame: the queue, then the PDOs by number.
        frames.extend(self.waiting.iter().take(room(frames)));
        for (number, transmit) in (0..PDOS).zip(&self.transmit) {
            if transmit.waits && room(frames) > 0 {
                frames.extend(self.pdo_frame(number));
            }
        }
    }

    fn pdo_frame(&self, number: u16) -> Option<Frame> {
        let pdo = Pdo { direction: TRANSMIT, number };
        let mut payload = [0; 8];
        let mut length = 0;
        for entry in pdo.mapped(&self.dictionary).filter_map(|address| self.dictionary.entry(address).ok()) {
            let mut bytes = [0; TEXT_MAX_BYTES];
            let more = entry.value.encode(&mut bytes);
            payload.get_mut(length..length + more)?.copy_from_slice(bytes.get(..more)?);
            length += more;
        }
        Frame::classic(Id::Standard(pdo.id(&self.dictionary)?), &payload[..length]).ok()
    }

    /// Notes that the bus has taken the first of the waiting frames. Returns how many of its values were
    /// limited to the range of their types.
    pub fn sent(&mut self) -> u64 {
        if !self.waiting.is_empty() {
            // The queue has at most 16 frames, so moving them costs less than a ring buffer would in code.
            self.waiting.remove(0);
            return 0;
        }
        let Some(place) = self.transmit.iter().position(|transmit| transmit.waits) else { return 0 };
        self.transmit[place].waits = false;
        let mapped = Pdo { direction: TRANSMIT, number: place as u16 }.mapped(&self.dictionary);
        // Counted when it is sent, since only then is it certain which values the frame has.
        mapped.filter_map(|address| self.dictionary.entry(address).ok()).filter(|entry| entry.is_limited).count() as u64
    }
}

/// Returns the next due time: one period after the last, or, if that has passed, one period from now.
const fn next(due_ns: u64, period_ns: u64, now_ns: u64) -> u64 {
    // After a pause, missed periods are skipped. Catching up would send them in a burst.
    let beat_ns = due_ns.saturating_add(period_ns);
    if beat_ns > now_ns { beat_ns } else { now_ns.saturating_add(period_ns) }
}
