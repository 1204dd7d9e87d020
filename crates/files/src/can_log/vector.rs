//! Code that Vector's formats, ASC and BLF, share.

use std::io;

use resonarm_protocol::{Frame, FrameFormat};

use super::LoggedFrame;

/// Lengths of CAN FD frames by their DLC (ISO 11898-1).
const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
/// Longest data of a classical frame, bytes; larger DLCs mean the same length (ISO 11898-1).
pub(super) const LONGEST_CLASSIC: usize = 8;

/// Flags of a frame on a CAN FD channel: remote, extended data length, bit rate switch, error state indicator.
pub(super) const REMOTE: u32 = 1 << 4;
pub(super) const EDL: u32 = 1 << 12;
pub(super) const BRS: u32 = 1 << 13;
pub(super) const ESI: u32 = 1 << 14;

/// Returns the DLC of a frame's length.
pub(super) fn dlc(frame: &Frame) -> usize {
    LENGTHS.iter().position(|length| *length == frame.len()).unwrap_or(0)
}

/// Returns the length of a CAN FD frame with a DLC.
pub(super) fn length(dlc: usize) -> Option<usize> {
    LENGTHS.get(dlc).copied()
}

/// Returns the flags of a format.
pub(super) fn flags(format: FrameFormat) -> u32 {
    let set = |flag: u32, is: bool| if is { flag } else { 0 };
    match format {
        FrameFormat::Classic => 0,
        FrameFormat::Remote => REMOTE,
        FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
            EDL | set(BRS, bit_rate_switch) | set(ESI, error_state_indicator)
        }
    }
}

/// Returns the format of a frame with these flags: a CAN FD channel also logs classical frames.
pub(super) fn format(flags: u32) -> FrameFormat {
    let is = |flag: u32| flags & flag != 0;
    match (is(EDL), is(REMOTE)) {
        // CAN FD has no remote frames, so the remote flag says nothing here (ISO 11898-1).
        (true, _) => FrameFormat::Fd { bit_rate_switch: is(BRS), error_state_indicator: is(ESI) },
        (false, true) => FrameFormat::Remote,
        (false, false) => FrameFormat::Classic,
    }
}

/// Returns the time of a frame, ns, from the start of the log at `start_ms` of the UNIX epoch.
pub(super) fn since(logged: &LoggedFrame, start_ms: u64) -> io::Result<u64> {
    logged.time_ns.checked_sub(start_ms * 1_000_000).ok_or_else(|| {
        let cause = format!("a frame at {} ns, earlier than the start of the log, {start_ms} ms", logged.time_ns);
        io::Error::new(io::ErrorKind::InvalidInput, cause)
    })
}
