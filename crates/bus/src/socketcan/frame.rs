//! Frames and filters as the kernel lays them out (`linux/can.h`), and back.

use core::mem;

use libc::{CAN_EFF_FLAG, CAN_EFF_MASK, CAN_MTU, CAN_RTR_FLAG, CAN_SFF_MASK, CANFD_BRS, CANFD_ESI, CANFD_MTU};
use resonarm_protocol::{Frame, FrameError, FrameFormat, Id};
use socketcan::CanFilter;

use crate::Filter;

/// The kernel's `struct canfd_frame`, and its `struct can_frame`, which has identifier word, length and content at the
/// same places.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub(super) struct RawFrame {
    pub can_id: u32,
    pub len: u8,
    pub flags: u8,
    pub reserved: [u8; 2],
    pub data: [u8; 64],
}

const _: () = assert!(mem::size_of::<RawFrame>() == CANFD_MTU && mem::offset_of!(RawFrame, data) + 8 == CAN_MTU);

/// A frame and the size that its format has on the socket, bytes: `CAN_MTU` or `CANFD_MTU`.
#[derive(Clone, Copy, Debug)]
pub(super) struct KernelFrame {
    pub raw: RawFrame,
    pub size: usize,
}

impl KernelFrame {
    /// Memory for a frame.
    pub const NONE: KernelFrame =
        KernelFrame { raw: RawFrame { can_id: 0, len: 0, flags: 0, reserved: [0; 2], data: [0; 64] }, size: 0 };
}

impl From<&Frame> for KernelFrame {
    fn from(frame: &Frame) -> KernelFrame {
        let can_id = id_word(frame.id());
        let data = frame.data();
        let mut raw = RawFrame { can_id, len: frame.len() as u8, ..KernelFrame::NONE.raw };
        raw.data[..data.len()].copy_from_slice(data);
        match frame.format() {
            FrameFormat::Classic => KernelFrame { raw, size: CAN_MTU },
            FrameFormat::Remote => {
                KernelFrame { raw: RawFrame { can_id: can_id | CAN_RTR_FLAG, ..raw }, size: CAN_MTU }
            }
            FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
                let brs = if bit_rate_switch { CANFD_BRS as u8 } else { 0 };
                let esi = if error_state_indicator { CANFD_ESI as u8 } else { 0 };
                KernelFrame { raw: RawFrame { flags: brs | esi, ..raw }, size: CANFD_MTU }
            }
        }
    }
}

impl KernelFrame {
    /// The received frame, if it is well-formed.
    pub fn frame(&self) -> Result<Frame, FrameError> {
        let KernelFrame { raw: RawFrame { can_id, len, flags, data, .. }, size } = self;
        let id = match can_id {
            word if word & CAN_EFF_FLAG != 0 => Id::Extended(word & CAN_EFF_MASK),
            word => Id::Standard((word & CAN_SFF_MASK) as u16),
        };
        let has = |flag: i32| i32::from(*flags) & flag != 0;
        let format = match *size {
            CANFD_MTU => FrameFormat::Fd { bit_rate_switch: has(CANFD_BRS), error_state_indicator: has(CANFD_ESI) },
            _ if can_id & CAN_RTR_FLAG != 0 => FrameFormat::Remote,
            _ => FrameFormat::Classic,
        };
        // The kernel passes on no content that is longer than the format allows.
        let content = if format == FrameFormat::Remote { &[0; 64] } else { data };
        Frame::new(id, format, content.get(..usize::from(*len)).unwrap_or(content))
    }
}

/// The kernel's form of a filter: the format bit always counts, the remote bit never.
pub(super) fn filter(filter: &Filter) -> CanFilter {
    // With the format bit in the mask an identifier of 11 bits doesn't match one of 29 with the same number.
    CanFilter::new(id_word(filter.id), filter.mask & CAN_EFF_MASK | CAN_EFF_FLAG)
}

fn id_word(id: Id) -> u32 {
    match id {
        Id::Standard(id) => u32::from(id),
        Id::Extended(id) => id | CAN_EFF_FLAG,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn frames() -> impl Strategy<Value = Frame> {
        let id = prop_oneof![(0..=0x7FFu16).prop_map(Id::Standard), (0..=0x1FFF_FFFFu32).prop_map(Id::Extended)];
        let format = prop_oneof![
            Just(FrameFormat::Classic),
            Just(FrameFormat::Remote),
            any::<(bool, bool)>().prop_map(|(bit_rate_switch, error_state_indicator)| FrameFormat::Fd {
                bit_rate_switch,
                error_state_indicator
            }),
        ];
        (id, format, proptest::collection::vec(any::<u8>(), 0..=64)).prop_filter_map(
            "not a length of the format",
            |(id, format, data)| {
                let short = &data[..data.len() % 9];
                Frame::new(id, format, &data).or_else(|_| Frame::new(id, format, short)).ok()
            },
        )
    }

    proptest! {
        #[test]
        fn every_frame_survives_the_kernel_layout(frame in frames()) {
            prop_assert_eq!(KernelFrame::from(&frame).frame(), Ok(frame));
        }
    }

    #[test]
    fn the_kernel_layout_is_that_of_linux_can_h() {
        let frame = Frame::new(Id::Extended(0x123), FrameFormat::Remote, &[0; 5]).unwrap();
        let KernelFrame { raw, size } = KernelFrame::from(&frame);
        assert_eq!((raw.can_id, raw.len, size), (0xC000_0123, 5, 16));
        let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
        let KernelFrame { raw, size } = KernelFrame::from(&Frame::new(Id::Standard(0x7FF), format, &[7; 12]).unwrap());
        assert_eq!((raw.can_id, raw.len, raw.flags, raw.data[11], size), (0x7FF, 12, 1, 7, 72));
        let word = |id, mask| *filter(&Filter { id, mask }).as_ref();
        let standard = word(Id::Standard(0x123), u32::MAX);
        assert_eq!((standard.can_id, standard.can_mask), (0x123, 0x9FFF_FFFF));
        let extended = word(Id::Extended(0x123), 0);
        assert_eq!((extended.can_id, extended.can_mask), (0x8000_0123, 0x8000_0000));
    }
}
