//! Frames and filters as the kernel lays them out (`linux/can.h`), and back.

use libc::{CAN_EFF_FLAG, CAN_EFF_MASK, CAN_RTR_FLAG, CANFD_BRS, CANFD_ESI};
use resonarm_protocol::{Frame, FrameError, FrameFormat, Id};
use socketcan::frame::{can_frame_default, canfd_frame_default};
use socketcan::{CanAnyFrame, CanFdFrame, CanFilter, CanFrame, EmbeddedFrame, Frame as _};

use crate::bus::Filter;

/// A frame in the size that its format has on the socket: `CAN_MTU` or `CANFD_MTU`.
pub(super) enum KernelFrame {
    Classical(CanFrame),
    Fd(CanFdFrame),
}

impl From<&Frame> for KernelFrame {
    fn from(frame: &Frame) -> KernelFrame {
        let (can_id, data) = (id_word(frame.id()), frame.data());
        match frame.format() {
            FrameFormat::Classic | FrameFormat::Remote => {
                let remote = if frame.format() == FrameFormat::Remote { CAN_RTR_FLAG } else { 0 };
                let mut raw = can_frame_default();
                raw.can_id = can_id | remote;
                raw.can_dlc = frame.len() as u8;
                raw.data[..data.len()].copy_from_slice(data);
                KernelFrame::Classical(raw.into())
            }
            FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
                let brs = if bit_rate_switch { CANFD_BRS as u8 } else { 0 };
                let esi = if error_state_indicator { CANFD_ESI as u8 } else { 0 };
                let mut raw = canfd_frame_default();
                raw.can_id = can_id;
                raw.len = frame.len() as u8;
                raw.flags = brs | esi;
                raw.data[..data.len()].copy_from_slice(data);
                KernelFrame::Fd(raw.into())
            }
        }
    }
}

/// The frame that came in, or `None` for an error frame, which is a message of the local controller and was never on
/// the bus.
pub(super) fn from_kernel(frame: &CanAnyFrame) -> Result<Option<Frame>, FrameError> {
    let id = match frame.id_word() {
        word if word & CAN_EFF_FLAG != 0 => Id::Extended(word & CAN_EFF_MASK),
        word => Id::Standard((word & 0x7FF) as u16),
    };
    let (format, data) = match frame {
        CanAnyFrame::Normal(frame) => (FrameFormat::Classic, frame.data()),
        CanAnyFrame::Remote(frame) => (FrameFormat::Remote, &[0; 8][..frame.dlc()]),
        CanAnyFrame::Fd(frame) => {
            let format = FrameFormat::Fd { bit_rate_switch: frame.is_brs(), error_state_indicator: frame.is_esi() };
            (format, frame.data())
        }
        CanAnyFrame::Error(_) => return Ok(None),
    };
    Frame::new(id, format, data).map(Some)
}

/// The kernel's form of a filter: the format bit always counts, the remote bit never.
pub(super) fn filter(filter: &Filter) -> CanFilter {
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
            let back = match KernelFrame::from(&frame) {
                KernelFrame::Classical(raw) => from_kernel(&raw.into()),
                KernelFrame::Fd(raw) => from_kernel(&raw.into()),
            };
            prop_assert_eq!(back, Ok(Some(frame)));
        }
    }

    #[test]
    fn the_kernel_layout_is_that_of_linux_can_h() {
        let frame = Frame::new(Id::Extended(0x123), FrameFormat::Remote, &[0; 5]).unwrap();
        let KernelFrame::Classical(raw) = KernelFrame::from(&frame) else { panic!("a classical frame") };
        assert_eq!((raw.id_word(), raw.dlc()), (0xC000_0123, 5));
        let word = |id, mask| *filter(&Filter { id, mask }).as_ref();
        let standard = word(Id::Standard(0x123), u32::MAX);
        assert_eq!((standard.can_id, standard.can_mask), (0x123, 0x9FFF_FFFF));
        let extended = word(Id::Extended(0x123), 0);
        assert_eq!((extended.can_id, extended.can_mask), (0x8000_0123, 0x8000_0000));
    }
}
