//! A small node, as a master sees it.

mod fresh;
mod listening;
mod objects;
mod pdos;
mod states;

use super::dictionary::{Access, Address, Dictionary, Entry, Mappable, Text, Value, at};
use super::*;
use resonarm_protocol::{Frame, FrameFormat, Id};
use std::vec::Vec;

/// Takes everything but 13 at 2000.
#[derive(Default)]
struct Taken {
    values: Vec<(u16, Value)>,
    epoch: u32,
}

impl Device for Taken {
    fn write(&mut self, address: Address, value: Value) -> Result<(), Abort> {
        if (address.index, value) == (0x2000, Value::U16(13)) {
            return Err(Abort::Value);
        }
        if address.index >= 0x2000 {
            self.values.push((address.index, value));
        }
        Ok(())
    }

    fn epoch(&self) -> u32 {
        self.epoch
    }
}

struct Master {
    server: Server,
    device: Taken,
}

const NODE: u8 = 5;
/// Time for which PDO data may wait for SYNC.
const WAIT_LIMIT_NS: u64 = 1_000_000_000;

fn dictionary() -> Dictionary {
    use Access::{Const, ReadOnly, ReadWrite, WriteOnly};
    let mut dictionary = Dictionary::new();
    let text = |text: &[u8]| Value::Text(Text::new(text).unwrap());
    dictionary.variable(0x1000, Entry::new(0, "Type", Const, Value::U32(0x0002_0192)));
    dictionary.variable(0x1008, Entry::new(0, "Name", Const, text(b"a name of 19 bytes!")));
    dictionary.variable(0x1017, Entry::new(0, "Heartbeat", ReadWrite, Value::U16(0)));
    let word = Entry::new(0, "Word", ReadWrite, Value::U16(7)).mappable(Mappable::Receive).within(1, 1000);
    dictionary.variable(0x2000, word);
    dictionary.variable(0x2001, Entry::new(0, "Out", ReadOnly, Value::I32(-2)).mappable(Mappable::Transmit));
    dictionary.variable(0x2002, Entry::new(0, "In", WriteOnly, Value::I8(0)).mappable(Mappable::Receive));
    dictionary.variable(0x2003, Entry::new(0, "Text", ReadWrite, text(b"")));
    dictionary.variable(0x2004, Entry::new(0, "Long", ReadWrite, Value::U32(0)).mappable(Mappable::Receive));
    let none = PdoDefaults { kind: EVENT_TYPE, ..PdoDefaults::default() };
    let receive = [mapping_word(at(0x2000, 0), 16)];
    let transmit = [mapping_word(at(0x2001, 0), 32)];
    let receive = PdoDefaults { mapped: &receive, ..none };
    let transmit = PdoDefaults { mapped: &transmit, kind: 1, event_timer_ms: 0 };
    dictionary.variable(0x1001, Entry::new(0, "Error register", ReadOnly, Value::U8(0)));
    add_error_objects(&mut dictionary);
    add_pdos(&mut dictionary, NODE, &[receive, none, none, none], &[transmit, none, none, none]);
    dictionary
}

impl Master {
    fn new() -> Master {
        let mut server = Server::new(NODE, dictionary(), WAIT_LIMIT_NS);
        server.boot(0);
        let mut master = Master { server, device: Taken::default() };
        assert_eq!(texts(&master.frames()), ["705#00"]);
        master
    }

    fn send(&mut self, id: u16, data: &[u8]) -> Handled {
        self.send_at(0, id, data)
    }

    fn send_at(&mut self, now_ns: u64, id: u16, data: &[u8]) -> Handled {
        let frame = Frame::classic(Id::Standard(id), data).unwrap();
        let handled = self.server.handle_frame(now_ns, &frame, &mut self.device);
        if handled == Handled::Sync {
            self.server.release(now_ns);
        }
        handled
    }

    fn ask(&mut self, id: u16) -> Handled {
        let frame = Frame::new(Id::Standard(id), FrameFormat::Remote, &[0; 8]).unwrap();
        self.server.handle_frame(0, &frame, &mut self.device)
    }

    fn frames(&mut self) -> Vec<Frame> {
        let mut frames = Vec::new();
        self.server.frames(100, &mut frames);
        frames.iter().for_each(|_| {
            self.server.sent();
        });
        assert_eq!(self.server.waiting(), 0);
        frames
    }

    /// The answer to an SDO request.
    fn sdo(&mut self, request: [u8; 8]) -> [u8; 8] {
        self.send(SDO_REQUEST_BASE + u16::from(NODE), &request);
        let frames = self.frames();
        assert_eq!(frames.len(), 1, "{frames:?}");
        assert_eq!(frames[0].id(), Id::Standard(0x585));
        frames[0].data().try_into().unwrap()
    }

    /// Writes an object by an expedited transfer.
    fn write(&mut self, index: u16, subindex: u8, bytes: &[u8]) -> Result<(), u32> {
        let [low, high] = index.to_le_bytes();
        let mut request = [0x23 | ((4 - bytes.len()) as u8) << 2, low, high, subindex, 0, 0, 0, 0];
        request[4..4 + bytes.len()].copy_from_slice(bytes);
        outcome(self.sdo(request), 0x60).map(drop)
    }

    /// Reads an object by an expedited transfer.
    fn read(&mut self, index: u16, subindex: u8) -> Result<u32, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self.sdo([0x40, low, high, subindex, 0, 0, 0, 0]);
        // Bits 2 and 3 count the bytes without data, and differ with the type.
        outcome(answer, 0x43 | answer[0] & 0xC)
    }
}

fn word(answer: [u8; 8]) -> u32 {
    u32::from_le_bytes(answer[4..].try_into().unwrap())
}

fn outcome(answer: [u8; 8], expected: u8) -> Result<u32, u32> {
    if answer[0] == 0x80 {
        return Err(word(answer));
    }
    assert_eq!(answer[0], expected, "{answer:x?}");
    Ok(word(answer))
}

fn texts(frames: &[Frame]) -> Vec<std::string::String> {
    frames.iter().map(std::string::ToString::to_string).collect()
}
