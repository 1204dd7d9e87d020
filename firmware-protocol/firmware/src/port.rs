//! The machine: the functions of `c/port/port.h`.

use resonarm_protocol::{Frame, FrameFormat, Id};

/// The structure `resonarm_frame` of `c/include/resonarm.h`. Its enumerations take a byte, as they do in the ABI of
/// bare ARM.
#[repr(C)]
struct CFrame {
    id: u32,
    id_format: u8,
    format: u8,
    length: u8,
    data: [u8; 64],
}

impl CFrame {
    const STANDARD: u8 = 0;
    const CLASSIC: u8 = 0;
    const REMOTE: u8 = 1;
    const EMPTY: CFrame =
        CFrame { id: 0, id_format: CFrame::STANDARD, format: CFrame::CLASSIC, length: 0, data: [0; 64] };
}

/// Results of the port's C functions: the call succeeded.
const DONE: u8 = 0;
const BUS_OFF: u8 = 2;

unsafe extern "C" {
    safe fn port_now_ns() -> u64;
    safe fn port_receive(frame: &mut CFrame) -> u8;
    safe fn port_send(frame: &CFrame) -> u8;
    safe fn port_wait(until_ns: u64);
}

/// The result of receiving.
pub enum Received {
    /// A classical or FD data frame was received.
    Frame(Frame),
    /// Nothing that can be a message.
    Nothing,
    /// The controller is off the bus.
    BusOff,
}

/// The machine on which the firmware runs, behind four C functions.
pub struct Port;

impl Port {
    /// A monotonic clock, ns.
    pub fn now_ns() -> u64 {
        port_now_ns()
    }

    /// The next data frame received.
    pub fn receive() -> Received {
        let mut frame = CFrame::EMPTY;
        loop {
            match port_receive(&mut frame) {
                DONE if frame.format == CFrame::REMOTE => {}
                DONE => {
                    let id = match frame.id_format {
                        CFrame::STANDARD => Id::Standard(frame.id as u16),
                        _ => Id::Extended(frame.id),
                    };
                    let data = frame.data.get(..frame.length.into()).unwrap_or_default();
                    if let Ok(frame) = Frame::new(id, FrameFormat::Classic, data) {
                        return Received::Frame(frame);
                    }
                }
                BUS_OFF => return Received::BusOff,
                _ => return Received::Nothing,
            }
        }
    }

    /// Sends a frame; returns whether it was accepted.
    pub fn send(frame: &Frame) -> bool {
        let (Id::Standard(id), FrameFormat::Classic) = (frame.id(), frame.format()) else { return false };
        let mut sent = CFrame { id: id.into(), length: frame.len() as u8, ..CFrame::EMPTY };
        sent.data[..frame.len()].copy_from_slice(frame.data());
        port_send(&sent) == DONE
    }

    /// Waits until a frame is received or the clock reaches this time; it may return earlier.
    pub fn wait(until_ns: u64) {
        port_wait(until_ns);
    }
}
