//! Interprets the frames of a node for a listener that knows neither the node nor the master, such as a reader
//! of logs.
//!
//! A [`Listener`] starts from the object dictionary after a reset and tracks what the frames reveal: values
//! that the node confirms as written, values that it returns, PDOs, and resets. PDOs are decoded by the mapping
//! that follows. A mapping that the master changed before the first frame is not known.

use alloc::vec::Vec;

use super::dictionary::{Address, Dictionary, TEXT_MAX_BYTES, Value, at};
use super::nmt::{NmtCommand, NmtState};
use super::pdo::{PDOS, Pdo, RECEIVE, TRANSMIT};
use super::sdo::SDO_BYTES;
use super::{EMERGENCY_BASE, HEARTBEAT_BASE, NMT_ID, NODE_ID_MAX, SDO_ANSWER_BASE, SDO_REQUEST_BASE, SYNC_ID};
use resonarm_protocol::{Frame, FrameFormat, Id};
use thiserror::Error;

/// Meaning of a frame for the node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// The frame is neither to nor from this node.
    Foreign,
    /// A command of network management.
    Nmt {
        /// Command that is given.
        command: NmtCommand,
        /// Node id that is addressed; 0 for all nodes.
        node: u8,
    },
    /// A SYNC, with its counter if it has one.
    Sync(Option<u8>),
    /// State of the node's communication; for initialising, the boot-up message.
    Heartbeat(NmtState),
    /// An emergency message of the node.
    Emergency {
        /// Error code; 0 when the error is over.
        code: u16,
        /// Error register, object 1001.
        register: u8,
        /// Manufacturer-specific bytes of the message.
        more: [u8; 5],
    },
    /// A PDO of the node.
    Pdo {
        /// Number of the PDO, from 1.
        number: u16,
        /// Whether the node sends it; otherwise it receives it.
        is_sent: bool,
        /// Mapped objects with their values.
        values: Vec<(Address, Value)>,
        /// First mapped object that the frame is too short for; the node rejects such a frame.
        missing: Option<Address>,
    },
    /// A remote frame that requests a PDO of the node.
    PdoRequest {
        /// Number of the PDO, from 1.
        number: u16,
        /// Whether the node answers while it is operational.
        is_answered: bool,
    },
    /// A service data object (SDO).
    Sdo(Sdo),
    /// A frame under one of the node's identifiers that breaks the protocol.
    Malformed {
        /// Kind of frame by its identifier.
        of: Part,
        /// Rule that the frame breaks.
        fault: Malformed,
    },
}

/// Kind of a node's frames, by identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A command of network management.
    Nmt,
    /// SYNC, the synchronisation object.
    Sync,
    /// A PDO that the node receives, by its number from 1.
    ReceivePdo(u16),
    /// A PDO that the node sends, by its number from 1.
    TransmitPdo(u16),
    /// An emergency message of the node.
    Emergency,
    /// The boot-up message or a heartbeat.
    Heartbeat,
    /// A request to the SDO server.
    Request,
    /// An answer of the SDO server.
    Answer,
}

/// Content of an object, as far as it can be decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Content {
    /// A value of the object's type.
    Value(Value),
    /// Raw bytes of an unknown object, or of another length than its type's.
    Bytes(Vec<u8>),
}

/// Message of an SDO transfer (CiA 301, section 7.2.4).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sdo {
    /// The master requests a value.
    Read(Address),
    /// The node returns the value.
    Given(Address, Content),
    /// The master writes a value.
    Write(Address, Content),
    /// The node has written the value, or accepts segments.
    Confirmed(Address),
    /// A segmented transfer begins.
    Announced {
        /// Object that is transferred.
        address: Address,
        /// Length that was announced, bytes, if one was.
        bytes: Option<u32>,
    },
    /// A segment of a transfer.
    Segment {
        /// Object that is transferred; `None` if no earlier frame states it.
        address: Option<Address>,
        /// Number of bytes in the segment.
        bytes: usize,
        /// The whole content, with the last segment.
        whole: Option<Content>,
    },
    /// The master requests the next segment.
    NextSegment(Option<Address>),
    /// The node confirms a segment.
    SegmentTaken(Option<Address>),
    /// Either side aborts the transfer.
    Aborted {
        /// Object that was transferred.
        address: Address,
        /// SDO abort code of the reason.
        code: u32,
    },
}

/// Rule of the protocol that a frame breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Malformed {
    /// The frame has the wrong length.
    #[error("it has {got} bytes: expected {expected}")]
    Length {
        /// The bytes that it has.
        got: usize,
        /// The bytes that it must have.
        expected: usize,
    },
    /// The command of network management is unknown.
    #[error("{got:#04x} is not a command of network management: expected 0x01, 0x02, 0x80, 0x81 or 0x82")]
    NmtCommand {
        /// First byte of the frame.
        got: u8,
    },
    /// The node id is above 127.
    #[error("{got} is not a node id: expected 0 for all nodes, or 1 to {NODE_ID_MAX}")]
    NodeId {
        /// Second byte of the frame.
        got: u8,
    },
    /// The state in a heartbeat is unknown.
    #[error("{got:#04x} is not a state of a node: expected 0x00, 0x04, 0x05 or 0x7f")]
    NmtState {
        /// Byte of the frame.
        got: u8,
    },
    /// The SDO command is unknown, or one of block transfers, which these nodes don't support.
    #[error("{got:#04x} is not a command of an expedited or segmented transfer")]
    SdoCommand {
        /// First byte of the frame.
        got: u8,
    },
    /// The frame is a remote frame, and only PDOs can be requested.
    #[error("expected a data frame, got a remote frame")]
    Remote,
    /// The frame is a CAN FD frame, and CANopen uses classical frames only.
    #[error("expected a classic frame, as CANopen has, got a CAN FD frame")]
    Fd,
}

/// A transfer that has not finished.
#[derive(Clone, Debug)]
struct Transfer {
    address: Address,
    is_write: bool,
    bytes: Vec<u8>,
    /// Whether all of its bytes have come.
    is_whole: bool,
}

/// Listens to the frames of one node and its master.
#[derive(Clone, Debug)]
pub struct Listener {
    node_id: u8,
    dictionary: Dictionary,
    transfer: Option<Transfer>,
}

impl Listener {
    /// Returns a listener to a node that has this dictionary after a reset.
    pub const fn new(node_id: u8, dictionary: Dictionary) -> Listener {
        Listener { node_id, dictionary, transfer: None }
    }

    /// Returns the id of the node that it listens to.
    pub const fn node_id(&self) -> u8 {
        self.node_id
    }

    /// Returns the object dictionary, as far as the frames have revealed it.
    pub const fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// Interprets the next frame on the bus.
    pub fn hear(&mut self, frame: &Frame) -> Heard {
        let Id::Standard(id) = frame.id() else { return Heard::Foreign };
        let is_remote = frame.format() == FrameFormat::Remote;
        let is_fd = !is_remote && frame.format() != FrameFormat::Classic;
        let own = u16::from(self.node_id);
        let data = frame.data();
        let part = match id {
            SYNC_ID if !is_remote => Part::Sync,
            NMT_ID => Part::Nmt,
            id if id == EMERGENCY_BASE + own => Part::Emergency,
            id if id == HEARTBEAT_BASE + own => Part::Heartbeat,
            id if id == SDO_REQUEST_BASE + own => Part::Request,
            id if id == SDO_ANSWER_BASE + own => Part::Answer,
            // The fixed identifiers come first: a PDO can't be moved onto them, so only then are the PDO parameters
            // searched.
            id if is_fd => match self.pdo_of(id) {
                Some(Pdo { direction: TRANSMIT, number }) => Part::TransmitPdo(number + 1),
                Some(Pdo { number, .. }) => Part::ReceivePdo(number + 1),
                None => return Heard::Foreign,
            },
            id => return self.hear_pdo(id, is_remote, data),
        };
        let heard = match part {
            _ if is_remote => Err(Malformed::Remote),
            _ if is_fd => Err(Malformed::Fd),
            Part::Sync if data.len() > 1 => Err(Malformed::Length { got: data.len(), expected: 1 }),
            Part::Sync => Ok(Heard::Sync(data.first().copied())),
            Part::ReceivePdo(_) | Part::TransmitPdo(_) => Ok(self.hear_pdo(id, false, data)),
            Part::Nmt => self.hear_nmt(data),
            Part::Emergency => exactly::<8>(data).map(|&[low, high, register, a, b, c, d, e]| Heard::Emergency {
                code: u16::from_le_bytes([low, high]),
                register,
                more: [a, b, c, d, e],
            }),
            Part::Heartbeat => self.hear_heartbeat(data),
            Part::Request => exactly(data).and_then(|data| self.hear_request(data)).map(Heard::Sdo),
            Part::Answer => exactly(data).and_then(|data| self.hear_answer(data)).map(Heard::Sdo),
        };
        heard.unwrap_or_else(|fault| Heard::Malformed { of: part, fault })
    }

    fn hear_nmt(&mut self, data: &[u8]) -> Result<Heard, Malformed> {
        let &[byte, node] = exactly::<2>(data)?;
        if node > NODE_ID_MAX {
            return Err(Malformed::NodeId { got: node });
        }
        let command = NmtCommand::of(byte).ok_or(Malformed::NmtCommand { got: byte })?;
        if node == 0 || node == self.node_id {
            match command {
                // A reset of the node restores all objects, one of the communication only those below 2000 (CiA
                // 301).
                NmtCommand::ResetNode => self.reset(u16::MAX),
                NmtCommand::ResetCommunication => self.reset(0x1FFF),
                NmtCommand::Start | NmtCommand::Stop | NmtCommand::PreOperational => {}
            }
        }
        Ok(Heard::Nmt { command, node })
    }

    /// Interprets a heartbeat. A node that boots has reset at least its communication.
    fn hear_heartbeat(&mut self, data: &[u8]) -> Result<Heard, Malformed> {
        let &[byte] = exactly::<1>(data)?;
        let state = NmtState::of(byte).ok_or(Malformed::NmtState { got: byte })?;
        if state == NmtState::Initialising {
            self.reset(0x1FFF);
        }
        Ok(Heard::Heartbeat(state))
    }

    fn reset(&mut self, last: u16) {
        self.dictionary.reset(0x1000..=last);
        self.transfer = None;
    }

    /// Returns the PDO that has an identifier.
    fn pdo_of(&self, id: u16) -> Option<Pdo> {
        let mut pdos = (0..PDOS).flat_map(|number| [TRANSMIT, RECEIVE].map(|direction| Pdo { direction, number }));
        pdos.find(|pdo| pdo.id(&self.dictionary) == Some(id))
    }

    fn hear_pdo(&mut self, id: u16, is_remote: bool, data: &[u8]) -> Heard {
        let Some(pdo) = self.pdo_of(id) else { return Heard::Foreign };
        let number = pdo.number + 1;
        let is_sent = pdo.direction == TRANSMIT;
        if is_remote {
            let is_answered = is_sent && pdo.allows_remote(&self.dictionary);
            return Heard::PdoRequest { number, is_answered };
        }
        let (values, missing) = self.mapped(pdo, data);
        // The node discards a short PDO, so its values must not enter the tracked dictionary.
        if missing.is_none() {
            values.iter().for_each(|(address, value)| self.dictionary.store(*address, *value));
        }
        Heard::Pdo { number, is_sent, values, missing }
    }

    /// Returns the values in a PDO, and the first mapped object that the frame is too short for.
    fn mapped(&self, pdo: Pdo, data: &[u8]) -> (Vec<(Address, Value)>, Option<Address>) {
        let mut values = Vec::new();
        let mut place = 0;
        for address in pdo.mapped(&self.dictionary) {
            let Ok(entry) = self.dictionary.entry(address) else { continue };
            let end = place + entry.value.len();
            match data.get(place..end).and_then(|bytes| entry.value.decode(bytes).ok()) {
                Some(value) => values.push((address, value)),
                None => return (values, Some(address)),
            }
            place = end;
        }
        (values, None)
    }

    fn hear_request(&mut self, request: &[u8; SDO_BYTES]) -> Result<Sdo, Malformed> {
        let address = address_of(request);
        // The upper three bits are the command specifier of CiA 301, whose numbers mean something else in an answer.
        Ok(match request[0] >> 5 {
            0 => self.hear_segment(request, true),
            1 => {
                // A write is remembered but not yet believed: the node may still abort it. `confirm` stores it.
                let is_expedited = request[0] & 2 != 0;
                let bytes = if is_expedited { self.expedited(request, address) } else { Vec::new() };
                self.transfer =
                    Some(Transfer { address, is_write: true, bytes: bytes.clone(), is_whole: is_expedited });
                match is_expedited {
                    true => Sdo::Write(address, self.content(address, bytes)),
                    false => Sdo::Announced { address, bytes: announced(request) },
                }
            }
            2 => {
                self.transfer = Some(Transfer { address, is_write: false, bytes: Vec::new(), is_whole: false });
                Sdo::Read(address)
            }
            3 => Sdo::NextSegment(self.transfer.as_ref().map(|transfer| transfer.address)),
            4 => self.aborted(request, address),
            _ => return Err(Malformed::SdoCommand { got: request[0] }),
        })
    }

    fn hear_answer(&mut self, answer: &[u8; SDO_BYTES]) -> Result<Sdo, Malformed> {
        let address = address_of(answer);
        Ok(match answer[0] >> 5 {
            0 => self.hear_segment(answer, false),
            1 => {
                let transfer = self.transfer.take();
                let of = transfer.as_ref().map(|transfer| transfer.address);
                self.confirm(transfer);
                Sdo::SegmentTaken(of)
            }
            2 if answer[0] & 2 != 0 => {
                self.transfer = None;
                let content = self.content(address, self.expedited(answer, address));
                self.learn(address, &content);
                Sdo::Given(address, content)
            }
            2 => {
                self.transfer = Some(Transfer { address, is_write: false, bytes: Vec::new(), is_whole: false });
                Sdo::Announced { address, bytes: announced(answer) }
            }
            3 => {
                // An answer to a request that was not heard confirms nothing that is known.
                let transfer = self.transfer.take().filter(|transfer| transfer.is_write && transfer.address == address);
                self.confirm(transfer);
                Sdo::Confirmed(address)
            }
            4 => self.aborted(answer, address),
            _ => return Err(Malformed::SdoCommand { got: answer[0] }),
        })
    }

    /// Handles a confirmation by the node: the value is written, or more segments follow.
    fn confirm(&mut self, transfer: Option<Transfer>) {
        match transfer {
            Some(Transfer { address, is_write: true, bytes, is_whole: true }) => {
                self.learn(address, &self.content(address, bytes));
            }
            unfinished => self.transfer = unfinished,
        }
    }

    fn hear_segment(&mut self, data: &[u8; SDO_BYTES], is_write: bool) -> Sdo {
        // Bits 1 to 3 count the bytes of a segment that hold no data, bit 0 marks the last one (CiA 301).
        let bytes = 7 - usize::from(data[0] >> 1 & 7);
        let is_last = data[0] & 1 != 0;
        let Some(transfer) = self.transfer.as_mut().filter(|transfer| transfer.is_write == is_write) else {
            return Sdo::Segment { address: None, bytes, whole: None };
        };
        // A value longer than the longest string belongs to no such node. The bytes beyond are dropped, so that
        // hostile frames can't grow memory.
        let room = TEXT_MAX_BYTES.saturating_sub(transfer.bytes.len()).min(bytes);
        transfer.bytes.extend(&data[1..=room]);
        transfer.is_whole = is_last;
        let address = transfer.address;
        let whole = is_last.then(|| transfer.bytes.clone()).map(|bytes| self.content(address, bytes));
        if let (Some(content), false) = (&whole, is_write) {
            self.learn(address, content);
            self.transfer = None;
        }
        Sdo::Segment { address: Some(address), bytes, whole }
    }

    fn aborted(&mut self, data: &[u8; SDO_BYTES], address: Address) -> Sdo {
        self.transfer = None;
        Sdo::Aborted { address, code: word(data) }
    }

    /// Returns the bytes of an expedited transfer: as many as the frame states, or as the object's type has.
    fn expedited(&self, data: &[u8; SDO_BYTES], address: Address) -> Vec<u8> {
        let unused = usize::from(data[0] >> 2 & 3);
        // Without a stated size the frame alone doesn't tell how many of its four bytes count.
        let of_type = || self.dictionary.entry(address).map_or(4, |entry| entry.value.len().min(4));
        let len = if data[0] & 1 != 0 { 4 - unused } else { of_type() };
        data[4..4 + len].to_vec()
    }

    fn content(&self, address: Address, bytes: Vec<u8>) -> Content {
        let entry = self.dictionary.entry(address).ok();
        match entry.and_then(|entry| entry.value.decode(&bytes).ok()) {
            Some(value) => Content::Value(value),
            None => Content::Bytes(bytes),
        }
    }

    fn learn(&mut self, address: Address, content: &Content) {
        if let Content::Value(value) = content {
            self.dictionary.store(address, *value);
        }
    }
}

fn exactly<const N: usize>(data: &[u8]) -> Result<&[u8; N], Malformed> {
    data.try_into().map_err(|_| Malformed::Length { got: data.len(), expected: N })
}

fn address_of(data: &[u8; SDO_BYTES]) -> Address {
    at(u16::from_le_bytes([data[1], data[2]]), data[3])
}

fn word(data: &[u8; SDO_BYTES]) -> u32 {
    u32::from_le_bytes([data[4], data[5], data[6], data[7]])
}

fn announced(data: &[u8; SDO_BYTES]) -> Option<u32> {
    (data[0] & 1 != 0).then(|| word(data))
}
