//! A receiver under any stream of frames: it must not panic, and whatever it takes must be what a sender would send.
//!
//! The input is a row of frames: a head byte, then up to 8 bytes of data. Of the head, bits 0 to 3 choose the identifier, bit 4 makes
//! the CRC right, bits 5 and 6 choose the format, and bit 7 makes the data as short as its first byte says.
#![no_main]

use libfuzzer_sys::fuzz_target;
use resonarm_protocol::{Frame, FrameFormat, Id, MessageKind, Network, Receiver, Transmitter, e2e};

fn frame(head: u8, bytes: &[u8]) -> Option<Frame> {
    let network = Network::default();
    let place = usize::from(head & 0xF);
    let kind = MessageKind::ALL.get(place).copied();
    let id = kind.map_or(Id::Extended(place as u32), |kind| Id::Standard(kind.id(network)));
    let format = match head >> 5 & 3 {
        0 | 1 => FrameFormat::Classic,
        2 => FrameFormat::Remote,
        _ => FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false },
    };
    let length = if head & 0x80 != 0 { usize::from(bytes.first()? & 7) } else { kind.map_or(8, MessageKind::len) };
    let mut data = [0; 8];
    let used = bytes.len().min(8);
    data[..used].copy_from_slice(&bytes[..used]);
    if let (true, Some(data_id)) = (head & 0x10 != 0, kind.and_then(MessageKind::data_id)) {
        data[0] = e2e::crc(data_id, &data);
    }
    Frame::new(id, format, &data[..length]).ok()
}

fuzz_target!(|input: &[u8]| {
    let mut receiver = Receiver::new(Network::default());
    for chunk in input.chunks(9) {
        let Some(frame) = frame(chunk[0], &chunk[1..]) else { continue };
        let lost = receiver.lost();
        let outcome = receiver.accept(&frame);
        assert!(receiver.lost() - lost < u64::from(e2e::MAX_DELTA_COUNTER));
        if let Ok(Some(message)) = outcome {
            let mut transmitter = Transmitter::new(Network::default());
            let again = (0..=e2e::COUNTER_MAX).any(|_| transmitter.frame(&message) == Ok(frame));
            assert!(again, "{frame} was taken as {message:?}");
        }
    }
});
