//! Error frames (`linux/can/error.h`): messages of the local controller, which were never on the bus.

use libc::{
    CAN_ERR_ACK, CAN_ERR_BUSERROR, CAN_ERR_BUSOFF, CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, CAN_ERR_CRTL_RX_OVERFLOW,
    CAN_ERR_CRTL_RX_PASSIVE, CAN_ERR_CRTL_RX_WARNING, CAN_ERR_CRTL_TX_OVERFLOW, CAN_ERR_CRTL_TX_PASSIVE,
    CAN_ERR_CRTL_TX_WARNING, CAN_ERR_FLAG, CAN_ERR_PROT, CAN_ERR_RESTARTED,
};

use super::frame::RawFrame;
use crate::controller::{ControllerErrors, ControllerState};

/// The classes that are asked for. Lost arbitration is no error: it is how a bus decides.
pub(super) const ASKED_FOR: u32 =
    CAN_ERR_CRTL | CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSOFF | CAN_ERR_BUSERROR | CAN_ERR_RESTARTED;

/// The byte that details a problem of the controller.
const CONTROLLER: usize = 1;
const OVERFLOW: i32 = CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW;
const WARNING: i32 = CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING;
const PASSIVE: i32 = CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;

/// Events that the controller has reported by error frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct ControllerReports {
    /// Number of errors of each kind.
    pub errors: ControllerErrors,
    /// The state that it reported last.
    pub state: ControllerState,
}

impl ControllerReports {
    /// Adds an error frame.
    pub fn note(&mut self, frame: ErrorFrame) {
        frame.count(&mut self.errors);
        self.state = frame.state().unwrap_or(self.state);
    }
}

/// The content of an error frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorFrame {
    /// The classes of errors.
    class: u32,
    /// State and events that the controller reports.
    controller: i32,
}

impl ErrorFrame {
    /// The content of the frame, if it is an error frame.
    pub(super) fn of(frame: &RawFrame) -> Option<ErrorFrame> {
        let has_class = frame.can_id & CAN_ERR_FLAG != 0;
        has_class.then(|| ErrorFrame::new(frame.can_id, &frame.data))
    }

    /// An error frame of these classes and this content.
    pub fn new(class: u32, content: &[u8]) -> ErrorFrame {
        ErrorFrame { class, controller: content.get(CONTROLLER).copied().map_or(0, i32::from) }
    }

    /// Whether the controller has left the bus.
    pub fn is_bus_off(self) -> bool {
        self.class & CAN_ERR_BUSOFF != 0
    }

    /// Adds the reported errors to the counts.
    fn count(self, errors: &mut ControllerErrors) {
        let class = |mask: u32| u64::from(self.class & mask != 0);
        let controller = |mask: i32| u64::from(self.reports_controller(mask));
        // Drivers report a fault of the wire by either of two classes, or by both.
        errors.protocol += class(CAN_ERR_PROT | CAN_ERR_BUSERROR);
        errors.no_ack += class(CAN_ERR_ACK);
        errors.overflow += controller(OVERFLOW);
        errors.warning += controller(WARNING);
        errors.passive += controller(PASSIVE);
        errors.bus_off += class(CAN_ERR_BUSOFF);
        errors.restarted += class(CAN_ERR_RESTARTED);
    }

    /// The state of the controller, if the frame reports one: the worst.
    fn state(self) -> Option<ControllerState> {
        if self.is_bus_off() {
            Some(ControllerState::BusOff)
        } else if self.reports_controller(PASSIVE) {
            Some(ControllerState::Passive)
        } else if self.reports_controller(WARNING) {
            Some(ControllerState::Warning)
        } else if self.reports_controller(CAN_ERR_CRTL_ACTIVE) || self.class & CAN_ERR_RESTARTED != 0 {
            Some(ControllerState::Active)
        } else {
            None
        }
    }

    fn reports_controller(self, mask: i32) -> bool {
        self.class & CAN_ERR_CRTL != 0 && self.controller & mask != 0
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::KernelFrame;
    use super::*;

    /// Makes an error frame with the numbers of `linux/can/error.h`.
    fn frame(class: u32, controller: u8) -> RawFrame {
        let mut data = [0; 64];
        data[1] = controller;
        RawFrame { can_id: 0x2000_0000 | class, len: 8, data, ..KernelFrame::NONE.raw }
    }

    fn counted(class: u32, controller: u8) -> (ControllerErrors, Option<ControllerState>) {
        let error = ErrorFrame::of(&frame(class, controller)).unwrap();
        let mut errors = ControllerErrors::default();
        error.count(&mut errors);
        (errors, error.state())
    }

    #[test]
    fn each_bit_of_linux_can_error_h_is_counted() {
        const NONE: ControllerErrors = ControllerErrors {
            protocol: 0,
            no_ack: 0,
            overflow: 0,
            warning: 0,
            passive: 0,
            bus_off: 0,
            restarted: 0,
            other: 0,
        };
        let warning = ControllerErrors { warning: 1, ..NONE };
        let passive = ControllerErrors { passive: 1, ..NONE };
        let overflow = ControllerErrors { overflow: 1, ..NONE };
        let protocol = ControllerErrors { protocol: 1, ..NONE };
        let cases = [
            ((0x004, 0x00), (NONE, None)),
            ((0x004, 0x01), (overflow, None)),
            ((0x004, 0x02), (overflow, None)),
            ((0x004, 0x04), (warning, Some(ControllerState::Warning))),
            ((0x004, 0x08), (warning, Some(ControllerState::Warning))),
            ((0x004, 0x10), (passive, Some(ControllerState::Passive))),
            ((0x004, 0x20), (passive, Some(ControllerState::Passive))),
            ((0x004, 0x30), (passive, Some(ControllerState::Passive))),
            ((0x004, 0x40), (NONE, Some(ControllerState::Active))),
            ((0x008, 0x00), (protocol, None)),
            ((0x080, 0x00), (protocol, None)),
            ((0x088, 0x00), (protocol, None)),
            ((0x020, 0x00), (ControllerErrors { no_ack: 1, ..NONE }, None)),
            ((0x040, 0x00), (ControllerErrors { bus_off: 1, ..NONE }, Some(ControllerState::BusOff))),
            ((0x100, 0x00), (ControllerErrors { restarted: 1, ..NONE }, Some(ControllerState::Active))),
            // The byte means nothing without the class; a driver may report several things in one frame.
            ((0x008, 0x20), (protocol, None)),
            (
                (0x0AC, 0x20),
                (ControllerErrors { protocol: 1, no_ack: 1, passive: 1, ..NONE }, Some(ControllerState::Passive)),
            ),
            // Transmit timeout and lost arbitration.
            ((0x003, 0x00), (NONE, None)),
        ];
        for ((class, controller), expected) in cases {
            assert_eq!(counted(class, controller), expected, "class {class:#x}, byte {controller:#x}");
        }
        assert_eq!(ASKED_FOR, 0x1EC);
    }

    #[test]
    fn other_frames_are_none() {
        assert_eq!(ErrorFrame::of(&RawFrame { can_id: 0x0000_0040, ..KernelFrame::NONE.raw }), None);
        assert_eq!(ErrorFrame::of(&RawFrame { can_id: 0x9FFF_FFFF, ..KernelFrame::NONE.raw }), None);
    }
}
