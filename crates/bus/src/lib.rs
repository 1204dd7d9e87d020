//! CAN buses behind one trait. Every backend passes the same contract test.

mod address;
mod controller;
pub mod deadline;
mod error;
pub mod fault;
pub mod memory;
pub mod socketcan;
pub mod timed;

use core::time::Duration;

use resonarm_protocol::{Frame, Id, MessageKind, Network};

pub use address::BusAddress;
pub use controller::{ControllerErrors, ControllerState};
pub use error::BusError;

/// Opens the bus that `address` names, with the default options of its backend.
///
/// # Errors
/// [`BusError`]: what the environment lacks, and how to fix it. [`BusAddress::Memory`] can't be opened by name
/// ([`BusError::MemoryIsNotShared`]), nor can [`BusAddress::PythonCan`], which the facade `resonarm` opens
/// ([`BusError::NoPythonCan`]).
pub fn open(address: &BusAddress) -> Result<Box<dyn Bus>, BusError> {
    match address {
        BusAddress::SocketCan(interface) => {
            Ok(Box::new(socketcan::SocketCan::open(interface, socketcan::Options::default())?))
        }
        BusAddress::Memory => Err(BusError::MemoryIsNotShared),
        BusAddress::PythonCan(_) => Err(BusError::NoPythonCan),
    }
}

/// One end of a CAN bus.
///
/// `send` and `receive` never block, lock or allocate, so the real-time loop may call them; `wait` is for all
/// other callers. A node does not receive the frames it sent. Frames come in the order in which they were on the bus.
pub trait Bus: Send {
    /// Returns the name of the bus, as its address has it: `vcan0`, `memory`.
    fn name(&self) -> String;

    /// Queues one frame for sending. A full transmit queue is not an error: it is [`Sent::QueueFull`], and counted.
    ///
    /// # Errors
    /// [`BusError`] if the bus is gone or the backend failed.
    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError>;

    /// Queues frames for sending, in their order, in one go where the backend can. `frames` is left with those that
    /// were not queued: none after [`Sent::Queued`]; after [`Sent::QueueFull`], which is counted once, and after an
    /// error the first of them is the one concerned.
    ///
    /// # Errors
    /// [`BusError`] if the bus is gone or the backend failed.
    fn send_all(&mut self, frames: &mut &[Frame]) -> Result<Sent, BusError> {
        one_by_one(self, frames)
    }

    /// The next frame that has come in, if any. A backend may fetch several at a time: `None` then means that
    /// these have been received, and the next call fetches again.
    ///
    /// # Errors
    /// [`BusError`] if the bus is gone or the backend failed.
    fn receive(&mut self) -> Result<Option<Received>, BusError>;

    /// Sleeps until a frame can be received (`true`) or `timeout` has passed (`false`). Unread frames end it at once,
    /// so it is no way to let time pass: use
    /// [`Clock::sleep_until_ns`](resonarm_realtime::Clock::sleep_until_ns).
    ///
    /// # Errors
    /// [`BusError`] if the bus is gone or the backend failed.
    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError>;

    /// Receives from now on only frames that match one of `filters`; an empty list receives everything. Frames that
    /// came in before the call and were not yet received may still come out. What a filter keeps out costs no wake-up
    /// where the kernel filters. An adapter of python-can that filters in software keeps out its error frames, too.
    ///
    /// # Errors
    /// [`BusError`] if the backend can't filter so.
    fn set_filters(&mut self, filters: &[Filter]) -> Result<(), BusError>;

    /// Ends the threads of an adapter: from now on the methods of the bus do their work on the calling thread, and
    /// block while they do. This is faster, as no thread has to be woken; a real-time thread must not call it. Does
    /// nothing on a bus without such threads.
    ///
    /// # Errors
    /// [`BusError`] if the bus is gone or the backend failed.
    fn work_on_caller(&mut self) -> Result<(), BusError> {
        Ok(())
    }

    /// Checks before a run that the bus was opened for CAN FD frames. `Ok` also where the backend can't tell; sending then
    /// does.
    ///
    /// # Errors
    /// [`BusError`] says that it carries classical frames only, and how to change that.
    fn check_fd(&self) -> Result<(), BusError> {
        Ok(())
    }

    /// The counts of this end so far.
    fn statistics(&self) -> Statistics;

    /// The state that the controller of this end reported last, up to the frame received last. Where the bus has no
    /// controllers, or they don't report, [`ControllerState::Active`].
    fn controller(&self) -> ControllerState {
        ControllerState::Active
    }

    /// Leaves the bus; every later call answers [`BusError::Closed`]. Frames queued before are still sent.
    ///
    /// # Errors
    /// [`BusError`] if the backend could not leave in order.
    fn close(&mut self) -> Result<(), BusError>;
}

/// One end of a bus in simulated time.
pub trait VirtualBus: Bus {
    /// Returns the time at which something happens on the bus by itself, ns on its clock: what has been sent up to now
    /// is sent, and more is to come no earlier. `None` is never.
    fn next_event_ns(&mut self) -> Option<u64>;
}

impl<B: Bus + ?Sized> Bus for &mut B {
    fn name(&self) -> String {
        (**self).name()
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        (**self).send(frame)
    }

    fn send_all(&mut self, frames: &mut &[Frame]) -> Result<Sent, BusError> {
        (**self).send_all(frames)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        (**self).receive()
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        (**self).wait(timeout)
    }

    fn set_filters(&mut self, filters: &[Filter]) -> Result<(), BusError> {
        (**self).set_filters(filters)
    }

    fn work_on_caller(&mut self) -> Result<(), BusError> {
        (**self).work_on_caller()
    }

    fn check_fd(&self) -> Result<(), BusError> {
        (**self).check_fd()
    }

    fn statistics(&self) -> Statistics {
        (**self).statistics()
    }

    fn controller(&self) -> ControllerState {
        (**self).controller()
    }

    fn close(&mut self) -> Result<(), BusError> {
        (**self).close()
    }
}

/// [`Bus::send_all`] for a backend that takes one frame at a time.
fn one_by_one<B: Bus + ?Sized>(bus: &mut B, frames: &mut &[Frame]) -> Result<Sent, BusError> {
    while let Some((first, rest)) = frames.split_first() {
        if bus.send(first)? == Sent::QueueFull {
            return Ok(Sent::QueueFull);
        }
        *frames = rest;
    }
    Ok(Sent::Queued)
}

/// The result of [`Bus::send`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// The frame is queued.
    Queued,
    /// The transmit queue is full (`ENOBUFS` of SocketCAN); the frame was not taken. Try again later.
    QueueFull,
}

/// A received frame with its time stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// Frame as it was on the bus.
    pub frame: Frame,
    /// Time at which the kernel or the adapter saw the frame, in nanoseconds of the UNIX epoch, if the backend knows.
    pub timestamp_ns: Option<u64>,
}

/// Lets a frame through when `frame.id & mask == id & mask` and the identifier formats agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Filter {
    /// The identifier to compare with.
    pub id: Id,
    /// The bits that count.
    pub mask: u32,
}

impl Filter {
    /// Returns whether the filter lets `frame` through.
    pub fn matches(&self, frame: &Frame) -> bool {
        matches!((self.id, frame.id()), (Id::Standard(_), Id::Standard(_)) | (Id::Extended(_), Id::Extended(_)))
            && frame.id().raw() & self.mask == self.id.raw() & self.mask
    }
}

/// Filters that let every message of a network through, from any node: one that only this node sends reveals a second
/// sender.
pub fn network_filters(network: Network) -> [Filter; MessageKind::COUNT] {
    MessageKind::ALL.map(|kind| Filter { id: Id::Standard(kind.id(network)), mask: 0x7FF })
}

/// Whether `filters` let `frame` through; none let everything through.
fn accepts(filters: &[Filter], frame: &Frame) -> bool {
    filters.is_empty() || filters.iter().any(|filter| filter.matches(frame))
}

/// Counts of one end of a bus, in frames since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Frames handed to the caller by [`Bus::receive`].
    pub received: u64,
    /// Frames queued for sending.
    pub sent: u64,
    /// Incoming frames lost because the receive queue was full. What the kernel drops before a frame reaches any socket
    /// (`net.core.netdev_max_backlog`, counted for all interfaces in the second column of `/proc/net/softnet_stat`) is
    /// not included; the counters within the frames show it.
    pub dropped: u64,
    /// Malformed incoming frames, left out: a virtual interface carries, for example, CAN FD frames of 9 bytes.
    pub malformed: u64,
    /// Calls of [`Bus::send`] and [`Bus::send_all`] that met a full transmit queue.
    pub queue_full: u64,
    /// The errors that the controller of this end reported; none where the backend does not report them.
    pub errors: ControllerErrors,
}
