//! The SDO server (CiA 301, section 7.2.4) with one transfer at a time, expedited or segmented.

use super::abort::Abort;
use super::dictionary::{Address, Dictionary, TEXT_MAX_BYTES, Value, at};
use super::errors;

/// Length of every SDO, bytes.
pub const SDO_BYTES: usize = 8;

/// State of a segmented transfer.
#[derive(Clone, Copy, Debug, Default)]
enum Transfer {
    #[default]
    None,
    /// Download to the node: the bytes so far, and the announced length.
    Down { address: Address, bytes: [u8; TEXT_MAX_BYTES], len: usize, announced: Option<usize>, toggle: bool },
    /// Upload to the master: the bytes, and how many have been sent.
    Up { address: Address, bytes: [u8; TEXT_MAX_BYTES], len: usize, sent: usize, toggle: bool },
}

/// Outcome of a request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// The server answers at once.
    Answer([u8; SDO_BYTES]),
    /// A value is complete. The answer is sent once it has been written.
    Write { address: Address, bytes: [u8; TEXT_MAX_BYTES], len: usize, answer: [u8; SDO_BYTES] },
    /// The server does not answer, as the master has aborted.
    Nothing,
}

/// SDO server of one node.
#[derive(Clone, Debug, Default)]
pub(super) struct SdoServer {
    transfer: Transfer,
}

impl SdoServer {
    /// Handles a request of the master.
    pub fn handle(&mut self, request: &[u8; SDO_BYTES], dictionary: &Dictionary) -> Step {
        let address = at(u16::from_le_bytes([request[1], request[2]]), request[3]);
        let outcome = match request[0] >> 5 {
            0 => self.download_segment(request),
            1 => self.download(request, address, dictionary).map_err(|abort| (address, abort)),
            2 => self.upload(address, dictionary).map_err(|abort| (address, abort)),
            3 => self.upload_segment(request),
            4 => {
                self.transfer = Transfer::None;
                return Step::Nothing;
            }
            _ => Err((address, Abort::Command)),
        };
        outcome.unwrap_or_else(|(address, abort)| Step::Answer(self.abort(address, abort)))
    }

    /// Ends the transfer and returns the answer that aborts it.
    pub fn abort(&mut self, address: Address, abort: Abort) -> [u8; SDO_BYTES] {
        self.transfer = Transfer::None;
        let [low, high] = address.index.to_le_bytes();
        let [a, b, c, d] = abort.code().to_le_bytes();
        [0x80, low, high, address.subindex, a, b, c, d]
    }

    fn download(&mut self, request: &[u8; SDO_BYTES], address: Address, all: &Dictionary) -> Result<Step, Abort> {
        // A new initiation ends a transfer in progress: the master has given it up, perhaps after a restart.
        self.transfer = Transfer::None;
        let entry = all.entry(address)?;
        if !entry.access.is_writable() {
            return Err(Abort::ReadOnly);
        }
        let is_expedited = request[0] & 2 != 0;
        let has_size = request[0] & 1 != 0;
        let answer = initiated(0x60, address);
        if is_expedited {
            let unused = usize::from(request[0] >> 2 & 3);
            let len = match (has_size, entry.value) {
                // Without a stated size the type tells the length. The length of a string is only in the frame.
                (true, _) | (false, Value::Text(_)) => 4 - unused,
                (false, value) => value.len(),
            };
            let mut bytes = [0; TEXT_MAX_BYTES];
            bytes[..4].copy_from_slice(&request[4..]);
            return Ok(Step::Write { address, bytes, len, answer });
        }
        let size = u32::from_le_bytes([request[4], request[5], request[6], request[7]]);
        let announced = has_size.then(|| usize::try_from(size).unwrap_or(usize::MAX));
        let most = if let Value::Text(_) = entry.value { TEXT_MAX_BYTES } else { entry.value.len() };
        // Rejected at the announcement: after the segments the master would only learn the same, later.
        if announced.is_some_and(|announced| announced > most) {
            return Err(Abort::LengthTooHigh);
        }
        let bytes = [0; TEXT_MAX_BYTES];
        self.transfer = Transfer::Down { address, bytes, len: 0, announced, toggle: false };
        Ok(Step::Answer(answer))
    }

    fn download_segment(&mut self, request: &[u8; SDO_BYTES]) -> Result<Step, (Address, Abort)> {
        let Transfer::Down { address, bytes, len, announced, toggle } = &mut self.transfer else {
            return Err((at(0, 0), Abort::Command));
        };
        let address = *address;
        let is_set = request[0] & 0x10 != 0;
        if is_set != *toggle {
            return Err((address, Abort::Toggle));
        }
        let count = 7 - usize::from(request[0] >> 1 & 7);
        let end = *len + count;
        // The buffer has the length of the longest string, so a transfer without an announced length ends here.
        let place = bytes.get_mut(*len..end).ok_or((address, Abort::LengthTooHigh))?;
        place.copy_from_slice(&request[1..1 + count]);
        *len = end;
        *toggle = !*toggle;
        let answer = [0x20 | u8::from(is_set) << 4, 0, 0, 0, 0, 0, 0, 0];
        if request[0] & 1 == 0 {
            return Ok(Step::Answer(answer));
        }
        // A master that sends another number of bytes than it has announced is faulty, and its value is not
        // stored.
        if announced.is_some_and(|announced| announced != end) {
            return Err((address, Abort::Length));
        }
        let step = Step::Write { address, bytes: *bytes, len: end, answer };
        self.transfer = Transfer::None;
        Ok(step)
    }

    fn upload(&mut self, address: Address, dictionary: &Dictionary) -> Result<Step, Abort> {
        self.transfer = Transfer::None;
        let entry = dictionary.entry(address)?;
        if !entry.access.is_readable() {
            return Err(Abort::WriteOnly);
        }
        if errors::is_empty(dictionary, address) {
            return Err(Abort::NoData);
        }
        let mut bytes = [0; TEXT_MAX_BYTES];
        let len = entry.value.encode(&mut bytes);
        let mut answer = initiated(0x41, address);
        // Values of up to 4 bytes fit an expedited answer. An empty string goes in segments, since an expedited
        // answer can't state 0 bytes.
        if (1..=4).contains(&len) {
            answer[0] = 0x43 | ((4 - len) as u8) << 2;
            answer[4..4 + len].copy_from_slice(&bytes[..len]);
        } else {
            answer[4] = len as u8;
            self.transfer = Transfer::Up { address, bytes, len, sent: 0, toggle: false };
        }
        Ok(Step::Answer(answer))
    }

    fn upload_segment(&mut self, request: &[u8; SDO_BYTES]) -> Result<Step, (Address, Abort)> {
        let Transfer::Up { address, bytes, len, sent, toggle } = &mut self.transfer else {
            return Err((at(0, 0), Abort::Command));
        };
        if (request[0] & 0x10 != 0) != *toggle {
            return Err((*address, Abort::Toggle));
        }
        let count = (*len - *sent).min(7);
        let mut answer = [0; SDO_BYTES];
        answer[1..1 + count].copy_from_slice(&bytes[*sent..*sent + count]);
        let is_last = *sent + count == *len;
        answer[0] = u8::from(*toggle) << 4 | ((7 - count) as u8) << 1 | u8::from(is_last);
        *sent += count;
        *toggle = !*toggle;
        if is_last {
            self.transfer = Transfer::None;
        }
        Ok(Step::Answer(answer))
    }
}

fn initiated(command: u8, address: Address) -> [u8; SDO_BYTES] {
    let [low, high] = address.index.to_le_bytes();
    [command, low, high, address.subindex, 0, 0, 0, 0]
}
