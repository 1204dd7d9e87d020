//! Interpretation of the frames between a master and the node by a listener.

use super::*;
use crate::canopen::listen::{Content, Heard, Listener, Malformed, Part, Sdo};

/// The node and one who hears every frame to and from it.
struct Bus {
    master: Master,
    listener: Listener,
}

impl Bus {
    fn new() -> Bus {
        Bus { master: Master::new(), listener: Listener::new(NODE, dictionary()) }
    }

    /// Returns what is heard of a frame to the node, and of the frames that the node sends in answer.
    fn send(&mut self, id: u16, data: &[u8]) -> Vec<Heard> {
        let frame = Frame::classic(Id::Standard(id), data).unwrap();
        self.master.send(id, data);
        let answers = self.master.frames();
        [frame].iter().chain(&answers).map(|frame| self.listener.hear(frame)).collect()
    }

    fn hear(&mut self, frame: &str) -> Heard {
        self.listener.hear(&frame.parse().unwrap())
    }

    fn sdo(&mut self, request: [u8; 8]) -> [Sdo; 2] {
        match &self.send(SDO_REQUEST_BASE + u16::from(NODE), &request)[..] {
            [Heard::Sdo(request), Heard::Sdo(answer)] => [request.clone(), answer.clone()],
            other => panic!("{other:?}"),
        }
    }

    fn write(&mut self, index: u16, subindex: u8, bytes: &[u8]) -> [Sdo; 2] {
        let [low, high] = index.to_le_bytes();
        let mut request = [0x23 | ((4 - bytes.len()) as u8) << 2, low, high, subindex, 0, 0, 0, 0];
        request[4..4 + bytes.len()].copy_from_slice(bytes);
        self.sdo(request)
    }
}

#[test]
fn a_mapping_that_the_node_confirms_is_followed() {
    let mut bus = Bus::new();
    let in_default = bus.hear("205#0102");
    let word = (at(0x2000, 0), Value::U16(0x201));
    assert_eq!(in_default, Heard::Pdo { number: 1, is_sent: false, values: [word].to_vec(), missing: None });
    let id = 0x205_u32;
    bus.write(0x1400, 1, &(id | 1 << 31).to_le_bytes());
    assert_eq!(bus.hear("205#0102"), Heard::Foreign);
    bus.write(0x1600, 0, &[0]);
    bus.write(0x1600, 1, &mapping_word(at(0x2004, 0), 32).to_le_bytes());
    // Aborted: it can't be mapped, and stays as it is.
    let [_, refused] = bus.write(0x1600, 2, &mapping_word(at(0x2001, 0), 32).to_le_bytes());
    assert_eq!(refused, Sdo::Aborted { address: at(0x1600, 2), code: Abort::NotMappable.code() });
    bus.write(0x1600, 2, &mapping_word(at(0x2002, 0), 8).to_le_bytes());
    bus.write(0x1600, 0, &[2]);
    bus.write(0x1400, 1, &id.to_le_bytes());
    let values = [(at(0x2004, 0), Value::U32(0x0403_0201)), (at(0x2002, 0), Value::I8(-1))].to_vec();
    assert_eq!(
        bus.hear("205#01020304FF"),
        Heard::Pdo { number: 1, is_sent: false, values: values.clone(), missing: None }
    );
    let missing = Some(at(0x2002, 0));
    assert_eq!(
        bus.hear("205#01020304"),
        Heard::Pdo { number: 1, is_sent: false, values: values[..1].to_vec(), missing }
    );
    for (index, subindex) in [(0x1400, 1), (0x1600, 0), (0x1600, 1), (0x1600, 2)] {
        let [ours, theirs] =
            [bus.listener.dictionary(), bus.master.server.dictionary()].map(|of| of.number(at(index, subindex)));
        assert_eq!(ours, theirs, "{index:x}");
    }
    // A reset of the node is one of the mapping.
    let heard = bus.send(NMT_ID, &[0x82, 0]);
    assert_eq!(heard[0], Heard::Nmt { command: NmtCommand::ResetCommunication, node: 0 });
    assert_eq!(heard[1], Heard::Heartbeat(NmtState::Initialising));
    assert!(matches!(bus.hear("205#0102"), Heard::Pdo { missing: None, .. }));
    bus.send(NMT_ID, &[1, NODE]);
    let heard = bus.send(SYNC_ID, &[]);
    let values = [(at(0x2001, 0), Value::I32(-2))].to_vec();
    assert_eq!(heard, [Heard::Sync(None), Heard::Pdo { number: 1, is_sent: true, values, missing: None }]);
}

#[test]
fn transfers_expedited_and_in_segments_are_read() {
    let mut bus = Bus::new();
    let text = |text: &[u8]| Content::Value(Value::Text(Text::new(text).unwrap()));
    let name = at(0x1008, 0);
    let length = Sdo::Announced { address: name, bytes: Some(19) };
    assert_eq!(bus.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]), [Sdo::Read(name), length]);
    let segment = |bytes, whole| Sdo::Segment { address: Some(name), bytes, whole };
    for (toggle, expected) in
        [(0, segment(7, None)), (1, segment(7, None)), (0, segment(5, Some(text(b"a name of 19 bytes!"))))]
    {
        let [asked, answer] = bus.sdo([0x60 | toggle << 4, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!((asked, answer), (Sdo::NextSegment(Some(name)), expected));
    }
    let place = at(0x2003, 0);
    bus.sdo([0x21, 0x03, 0x20, 0, 9, 0, 0, 0]);
    bus.sdo([0x00, b'a', b'b', b'c', b'd', b'e', b'f', b'g']);
    let [last, taken] = bus.sdo([0x10 | 5 << 1 | 1, b'h', b'i', 0, 0, 0, 0, 0]);
    assert_eq!(last, Sdo::Segment { address: Some(place), bytes: 2, whole: Some(text(b"abcdefghi")) });
    assert_eq!(taken, Sdo::SegmentTaken(Some(place)));
    assert_eq!(
        bus.listener.dictionary().entry(place).unwrap().value,
        bus.master.server.dictionary().entry(place).unwrap().value
    );
    // The type gives the length where the frame doesn't; an object that is not known keeps its bytes.
    let [written, _] = bus.sdo([0x22, 0x00, 0x20, 0, 9, 0, 0, 0]);
    assert_eq!(written, Sdo::Write(at(0x2000, 0), Content::Value(Value::U16(9))));
    let [written, refused] = bus.write(0x3000, 1, &[1, 2]);
    assert_eq!(written, Sdo::Write(at(0x3000, 1), Content::Bytes([1, 2].to_vec())));
    assert_eq!(refused, Sdo::Aborted { address: at(0x3000, 1), code: 0x0602_0000 });
    // Of a segment that nothing precedes nobody knows the object.
    assert_eq!(bus.hear("605#0041424344454647"), Heard::Sdo(Sdo::Segment { address: None, bytes: 7, whole: None }));
}

#[test]
fn frames_that_break_the_rules_differ_from_foreign_ones() {
    let mut bus = Bus::new();
    let malformed = |of, fault| Heard::Malformed { of, fault };
    let length = |got, expected| Malformed::Length { got, expected };
    assert_eq!(bus.hear("000#01"), malformed(Part::Nmt, length(1, 2)));
    assert_eq!(bus.hear("000#0300"), malformed(Part::Nmt, Malformed::NmtCommand { got: 3 }));
    assert_eq!(bus.hear("000#0180"), malformed(Part::Nmt, Malformed::NodeId { got: 128 }));
    assert_eq!(bus.hear("605#40"), malformed(Part::Request, length(1, 8)));
    assert_eq!(bus.hear("585#C000000000000000"), malformed(Part::Answer, Malformed::SdoCommand { got: 0xC0 }));
    assert_eq!(bus.hear("085#00"), malformed(Part::Emergency, length(1, 8)));
    assert_eq!(bus.hear("705#06"), malformed(Part::Heartbeat, Malformed::NmtState { got: 6 }));
    assert_eq!(bus.hear("705#R1"), malformed(Part::Heartbeat, Malformed::Remote));
    for (fd, part) in [("605##140", Part::Request), ("080##1", Part::Sync), ("205##10900", Part::ReceivePdo(1))] {
        assert_eq!(bus.hear(fd), malformed(part, Malformed::Fd), "{fd}");
    }
    assert_eq!(bus.hear("080#0102"), malformed(Part::Sync, length(2, 1)));
    assert_eq!(bus.hear("185#R4"), Heard::PdoRequest { number: 1, is_answered: true });
    assert_eq!(bus.hear("205#R2"), Heard::PdoRequest { number: 1, is_answered: false });
    assert_eq!(
        bus.hear("085#5082110100340000"),
        Heard::Emergency { code: 0x8250, register: 0x11, more: [1, 0, 0x34, 0, 0] }
    );
    for foreign in ["606#4000000000000000", "00000605#4000000000000000", "606##140"] {
        assert_eq!(bus.hear(foreign), Heard::Foreign, "{foreign}");
    }
}

/// SplitMix64, a generator of random numbers.
struct Random(u64);

impl Random {
    fn below(&mut self, most: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ z >> 31) % most as u64) as usize
    }

    /// A request that is often one that a node understands: PDO parameters, segments, or anything.
    fn request(&mut self) -> [u8; 8] {
        let mut request = [(); 8].map(|()| self.below(256) as u8);
        let indices = [0x1008_u16, 0x1017, 0x1400, 0x1600, 0x1601, 0x1800, 0x1A00, 0x2003];
        let [low, high] = indices[self.below(indices.len())].to_le_bytes();
        (request[1], request[2], request[3]) = (low, high, self.below(4) as u8);
        let commands = [0x23, 0x2B, 0x2F, 0x22, 0x20, 0x21, 0x40, 0x60, 0x70, 0x00, 0x10, 0x01, 0x11, 0x80];
        request[0] = commands[self.below(commands.len())];
        let words = [0x8000_0205_u32, 0x205, 0x185, 0x8000_0185, 0x2000_0010, 0x2004_0020, 0, 1, 2, 4];
        if self.below(3) > 0 {
            request[4..].copy_from_slice(&words[self.below(words.len())].to_le_bytes());
        }
        request
    }
}

/// The first steps of a mapping by CiA 301: RPDO 1 disabled, no entries, the first entry.
const DISABLE: [u8; 8] = [0x23, 0x00, 0x14, 1, 0x05, 0x02, 0, 0x80];
const NO_ENTRIES: [u8; 8] = [0x2F, 0x00, 0x16, 0, 0, 0, 0, 0];
const MAP: [u8; 8] = [0x23, 0x00, 0x16, 1, 0x20, 0, 0x04, 0x20];

/// Whatever a master asks for, the listener has the node's parameters of communication.
#[test]
fn a_listener_has_the_parameters_of_the_node_after_any_requests() {
    let mut random = Random(7);
    let mut bus = Bus::new();
    let mut mappings = 0;
    for _ in 0..50_000 {
        match random.below(200) {
            0 => drop(bus.send(NMT_ID, &[[1, 2, 0x80, 0x81, 0x82][random.below(5)], NODE])),
            1 => [DISABLE, NO_ENTRIES, MAP].iter().for_each(|request| drop(bus.send(0x605, request))),
            _ => drop(bus.send(0x605, &random.request())),
        }
        let [ours, theirs] = [bus.listener.dictionary(), bus.master.server.dictionary()];
        for (ours, theirs) in ours.objects().iter().zip(theirs.objects()).filter(|(object, _)| object.index < 0x2000) {
            let values = |object: &crate::canopen::dictionary::Object| {
                object.entries.iter().map(|entry| entry.value).collect::<Vec<_>>()
            };
            assert_eq!(values(ours), values(theirs), "{:x}", ours.index);
        }
        mappings += usize::from(theirs.number(at(0x1600, 1)) == 0x2004_0020);
    }
    // The requests do set mappings.
    assert!(mappings > 100, "{mappings}");
}
