//! A bus and a clock for the cases.

use resonarm_bus::BusError;
use resonarm_protocol::Frame;

/// Result of taking a node off the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusOff {
    /// The node's controller is bus-off.
    Done,
    /// Only the node's own controller can go bus-off.
    Impossible,
}

/// Result of stopping the process of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// The process is stopped, and resumes by itself.
    Done,
    /// The process can't be stopped, with the reason.
    Impossible(String),
}

/// One end of a bus, with a clock. In tests it steps a node in virtual time.
pub trait Wire {
    /// The time, ns of any monotonic clock.
    fn now_ns(&self) -> u64;

    /// Sends a frame on the bus.
    ///
    /// # Errors
    /// [`BusError`] if the bus fails.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError>;

    /// The next frame; `None` if there is none until `until_ns`.
    ///
    /// # Errors
    /// [`BusError`] if the bus is gone.
    fn receive(&mut self, until_ns: u64) -> Result<Option<Frame>, BusError>;

    /// Makes the controller of the node under test go bus-off for a time, ns: in virtual time, and on a virtual
    /// interface.
    fn take_off(&mut self, _for_ns: u64) -> BusOff {
        BusOff::Impossible
    }

    /// Stops the process of the node under test for a time, ns: in virtual time, and if the process is known.
    fn stop_node(&mut self, _for_ns: u64) -> Stopped {
        Stopped::Impossible(String::from("its process is not known (--pid)"))
    }
}
