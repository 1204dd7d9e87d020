//! A receiver under any stream of frames: it must not panic, and must take only frames that a sender would send.
//!
//! The first byte of the input chooses the profile. Frames follow: each a head byte, then up to 64 bytes of
//! data, as many as the message has. Of the head, bits 0 to 3 choose the identifier, bit 4 makes the CRC right, bits 5
//! and 6 choose the format, and bit 7 makes the data as long as its first byte says.
#![no_main]

use libfuzzer_sys::fuzz_target;
use resonarm_protocol::e2e::{self, Protection};
use resonarm_protocol::{Frame, FrameFormat, Id, MessageKind, Network, Profile, Receiver, Transmitter};

/// The next frame of the input, and the rest.
fn frame(network: Network, input: &[u8]) -> Option<(Option<Frame>, &[u8])> {
    let (&head, bytes) = input.split_first()?;
    let kind = MessageKind::ALL[usize::from(head & 0xF)];
    let form = kind.form(network.profile());
    let length = match form {
        _ if head & 0x80 != 0 => usize::from(bytes.first()? & 63),
        Some(form) => form.length,
        None => 8,
    };
    let used = bytes.len().min(length);
    let mut data = [0; 64];
    data[..used].copy_from_slice(&bytes[..used]);
    let protection = form.and_then(|form| form.protection).filter(|_| head & 0x10 != 0);
    if let Some((protection, data_id)) = protection.zip(kind.data_id(network)) {
        match protection {
            Protection::Profile11 => {
                let mut content = [0; 8];
                content.copy_from_slice(&data[..8]);
                data[0] = e2e::profile11::crc(data_id, &content);
            }
            Protection::Profile5 => {
                let crc = e2e::profile5::crc(data_id, &data[..length.max(2)]);
                data[..2].copy_from_slice(&crc.to_le_bytes());
            }
        }
    }
    let fd = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
    let format = match head >> 5 & 3 {
        0 | 1 => form.map_or(FrameFormat::Classic, |form| form.format),
        2 => FrameFormat::Remote,
        _ => fd,
    };
    Some((Frame::new(Id::Standard(kind.id(network)), format, &data[..length]).ok(), &bytes[used..]))
}

fuzz_target!(|input: &[u8]| {
    let Some((&first, mut input)) = input.split_first() else { return };
    let network = Network::default().with_profile(Profile::ALL[usize::from(first & 1)]);
    let mut receiver = Receiver::new(network);
    while let Some((frame, rest)) = frame(network, input) {
        input = rest;
        let Some(frame) = frame else { continue };
        let lost = receiver.lost();
        let outcome = receiver.accept(&frame);
        assert!(receiver.lost() - lost < u64::from(e2e::MAX_DELTA_COUNTER));
        if let Ok(Some(message)) = outcome {
            let mut transmitter = Transmitter::new(network);
            // A counter has at most 256 values, of which the transmitter reaches each once in so many frames.
            let again = (0..=u8::MAX).any(|_| transmitter.frame(&message).is_ok_and(|again| is_same(&again, &frame)));
            assert!(again, "{frame} was taken as {message:?}");
        }
    }
});

/// The same identifier, kind of format and data; the flags of CAN FD don't matter.
fn is_same(one: &Frame, other: &Frame) -> bool {
    let is_fd = |frame: &Frame| matches!(frame.format(), FrameFormat::Fd { .. });
    (one.id(), one.data(), is_fd(one)) == (other.id(), other.data(), is_fd(other))
}
