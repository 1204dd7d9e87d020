//! CAN interfaces of this Linux, through SocketCAN raw sockets (kernel document `networking/can.rst`).
//!
//! **In one call** the kernel takes all frames to send (`sendmmsg`), and hands over all that have arrived (`recvmmsg`),
//! up to 32. [`Bus::receive`] gives them out one by one. [`Bus::wait`] sleeps in that same call, in which the
//! socket blocks for a fixed time, and in `poll` only for what is shorter; everything else asks not to block
//! (`MSG_DONTWAIT`). It looks at the clock only after a sleep in which nothing was received, so it can end
//! late by what that sleep took beyond its time.
//!
//! **Error frames** are messages of the local controller, not of the bus. Those about its state and about faults of
//! the wire are asked for, and counted in their place among the frames ([`Statistics::errors`], [`Bus::controller`]).
//! Bus-off also comes out of [`Bus::receive`], as [`BusError::BusOff`], and the end works again once the controller has
//! been restarted. No other error frame is an error of the bus. A virtual interface has no controller and makes none.
//!
//! **Malformed frames**, such as one of CAN FD with 9 bytes, can be written to a virtual interface by any process. They
//! are counted ([`Statistics::malformed`]) and left out.
//!
//! **Losses** are read from `SO_MEMINFO`, at the moment they are asked for. `SO_RXQ_OVFL` reports the same kernel
//! counter, but only with the next frame that comes in after the loss, so never those at the end of a run.

mod batch;
mod error_frame;
mod frame;
mod incoming;
mod interface;

use core::time::Duration;
use std::io;
use std::os::fd::AsFd;

use libc::{
    EAFNOSUPPORT, EAGAIN, EINVAL, EMSGSIZE, ENETDOWN, ENOBUFS, ENODEV, ENXIO, EPROTONOSUPPORT, SO_MEMINFO, SOL_SOCKET,
};
use resonarm_protocol::{Frame, FrameFormat};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::net::sockopt::{self, Timeout};
use socketcan::timestamp::{SOF_TIMESTAMPING_OPT_CMSG, SOF_TIMESTAMPING_RX_SOFTWARE, SOF_TIMESTAMPING_SOFTWARE};
use socketcan::{CanAddr, CanFdSocket, CanFilter, Socket, SocketOptions};

use self::batch::IfNone;
use self::error_frame::ASKED_FOR;
use self::frame::filter;
use self::incoming::{Came, Incoming};
use super::deadline::Deadline;
use super::{Bus, Filter, Received, Sent, Statistics};
use crate::controller::ControllerState;
use crate::error::BusError;

pub use error_frame::{ControllerReports, ErrorFrame};
pub use interface::interfaces;

/// The place of the frames lost at the receive queue among the `u32` counters of `SO_MEMINFO` (Linux 4.12).
const DROPS: usize = libc::SK_MEMINFO_DROPS as usize;
/// The size of those counters up to that one, bytes.
pub const MEMINFO_BYTES: usize = 4 * (DROPS + 1);

/// Time for which a receiving call sleeps if no frame comes (`SO_RCVTIMEO`). The kernel rounds it up to its timer ticks
/// and adds up to one (`CONFIG_HZ`): 12 ms at most with ticks of 4 ms, 20 ms with the longest, of 10.
const SLEEP: Duration = Duration::from_millis(5);
/// The shortest wait that may sleep so.
const SLEEP_FROM: Duration = Duration::from_millis(15);

/// Settings with which a [`SocketCan`] is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Memory for frames not yet received, in bytes (`SO_RCVBUF`). A frame takes about 400 of them.
    pub receive_buffer_bytes: usize,
    /// Memory for frames not yet sent, in bytes (`SO_SNDBUF`). Short queues upstream of the wire keep old commands few.
    pub send_buffer_bytes: usize,
}

impl Default for Options {
    /// 2 MiB for receiving, which hold about 5400 classical frames: 0.6 s of 8-byte frames that fill 1 Mbit/s. 256 KiB
    /// for sending.
    fn default() -> Options {
        Options { receive_buffer_bytes: 2 << 20, send_buffer_bytes: 256 << 10 }
    }
}

/// The MTU of an interface that carries CAN FD frames (`CANFD_MTU` of Linux's `can.h`).
const CAN_FD_MTU: u32 = 72;

/// One end on a CAN interface.
pub struct SocketCan {
    interface: String,
    socket: Option<CanFdSocket>,
    buffers: Options,
    incoming: Incoming,
    /// Counts so far. The lost frames are those that the kernel had counted when the socket was closed.
    statistics: Statistics,
    reports: ControllerReports,
}

impl SocketCan {
    /// Opens `interface` (`can0`, `vcan0`) for classical and FD frames, with kernel timestamps.
    ///
    /// Buffer sizes beyond `net.core.rmem_max` and `wmem_max` are granted to a process with CAP_NET_ADMIN; another gets
    /// the maximum, which is logged as a warning. [`SocketCan::buffers`] returns what was granted.
    ///
    /// # Errors
    /// [`BusError`] that says what is missing: SocketCAN in the kernel, the interface, its being up, a permission.
    pub fn open(interface: &str, options: Options) -> Result<SocketCan, BusError> {
        let address = CanAddr::from_iface(interface).map_err(|source| match source.raw_os_error() {
            Some(ENODEV | ENXIO) => supported().err().unwrap_or_else(|| missing(interface)),
            _ => os(interface, "looking the interface up", source),
        })?;
        let socket = CanFdSocket::open_addr(&address).map_err(|source| match source.raw_os_error() {
            Some(EAFNOSUPPORT | EPROTONOSUPPORT) => BusError::NoSocketCan { source },
            Some(ENODEV) => BusError::NotCan { interface: interface.to_owned() },
            _ => os(interface, "opening the socket", source),
        })?;
        let buffers = configure(&socket, options).map_err(|(action, source)| os(interface, action, source))?;
        warn_if_less(interface, "receive", "rmem_max", options.receive_buffer_bytes, buffers.receive_buffer_bytes);
        warn_if_less(interface, "send", "wmem_max", options.send_buffer_bytes, buffers.send_buffer_bytes);
        let bus = SocketCan {
            interface: interface.to_owned(),
            socket: Some(socket),
            buffers,
            incoming: Incoming::new(),
            statistics: Statistics::default(),
            reports: ControllerReports::default(),
        };
        // The kernel binds to an interface that is down, and leaves ENETDOWN as the pending error of the socket.
        bus.pending_error(bus.socket()?)?;
        Ok(bus)
    }

    /// The buffer sizes the kernel granted, in the measure of [`Options`].
    pub fn buffers(&self) -> Options {
        self.buffers
    }

    fn socket(&self) -> Result<&CanFdSocket, BusError> {
        self.socket.as_ref().ok_or(BusError::Closed)
    }

    /// Takes the error that the kernel holds for the socket, such as the interface having gone down.
    fn pending_error(&self, socket: &CanFdSocket) -> Result<(), BusError> {
        match sockopt::socket_error(socket) {
            Ok(Ok(())) => Ok(()),
            Ok(Err(errno)) | Err(errno) => Err(self.failure("using the socket", errno.into())),
        }
    }

    /// Receives from the kernel.
    fn take_in(&mut self, if_none: IfNone) -> Result<Came, BusError> {
        let socket = self.socket.as_ref().ok_or(BusError::Closed)?;
        self.incoming.fill(socket.as_fd(), if_none).map_err(|source| self.failure("receiving", source))
    }

    /// Sleeps until a frame arrives, `timeout` at most, and takes it in. Returns the time that has certainly passed.
    fn sleep(&mut self, timeout: Duration) -> Result<Duration, BusError> {
        if timeout >= SLEEP_FROM {
            return Ok(match self.take_in(IfNone::Sleep)? {
                Came::Nothing => SLEEP,
                Came::Frames | Came::Signal => Duration::ZERO,
            });
        }
        let socket = self.socket()?;
        let mut polled = [PollFd::new(socket, PollFlags::IN)];
        match poll(&mut polled, timeout.try_into().ok().as_ref()) {
            Ok(0) => return Ok(timeout),
            // A signal says nothing about the time that has passed, so the caller looks at the clock.
            Err(Errno::INTR) => {}
            Ok(_) if polled[0].revents().contains(PollFlags::IN) => drop(self.take_in(IfNone::Return)?),
            Ok(_) => self.pending_error(socket)?,
            Err(errno) => return Err(self.failure("waiting", errno.into())),
        }
        Ok(Duration::ZERO)
    }

    /// Whether there is a frame that [`Bus::receive`] gives out. Error frames and malformed frames before it are
    /// counted.
    fn has_frame(&mut self) -> bool {
        while let Some(slot) = self.incoming.peek() {
            match ErrorFrame::of(&slot.frame.raw) {
                // It stays in its place, since `receive` gives it out as an error.
                Some(error) if error.is_bus_off() => return true,
                Some(error) => self.reports.note(error),
                None if slot.frame.frame().is_ok() => return true,
                None => self.statistics.malformed += 1,
            }
            self.incoming.pop();
        }
        false
    }

    /// Translates an error of the open socket.
    fn failure(&self, action: &'static str, source: io::Error) -> BusError {
        let interface = self.interface.clone();
        match source.raw_os_error() {
            Some(ENETDOWN) => BusError::InterfaceDown { interface },
            Some(ENODEV | ENXIO) => BusError::InterfaceGone { interface },
            _ => os(&interface, action, source),
        }
    }
}

impl Bus for SocketCan {
    fn name(&self) -> String {
        self.interface.clone()
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.send_all(&mut core::slice::from_ref(frame))
    }

    fn send_all(&mut self, frames: &mut &[Frame]) -> Result<Sent, BusError> {
        while let Some(first) = frames.first() {
            match batch::send(self.socket()?.as_fd(), frames) {
                Ok(count) => {
                    self.statistics.sent += count as u64;
                    *frames = &frames[count..];
                }
                Err(error) => match (error.raw_os_error(), first.format()) {
                    // EAGAIN: the socket's send buffer is full. ENOBUFS: the interface's transmit queue is.
                    (Some(EAGAIN | ENOBUFS), _) => {
                        self.statistics.queue_full += 1;
                        return Ok(Sent::QueueFull);
                    }
                    // The kernel rejects an FD frame by its length if the interface carries classical frames
                    // only.
                    (Some(EINVAL | EMSGSIZE), FrameFormat::Fd { .. }) => {
                        return Err(BusError::FdNotEnabled { interface: self.interface.clone() });
                    }
                    _ => return Err(self.failure("sending", error)),
                },
            }
        }
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        self.socket()?;
        loop {
            let Some(slot) = self.incoming.pop() else {
                // A batch that was not full was the last one, which saves a system call that would find
                // nothing.
                if self.incoming.take_last() || self.take_in(IfNone::Return)? != Came::Frames {
                    return Ok(None);
                }
                continue;
            };
            let Some(error) = ErrorFrame::of(&slot.frame.raw) else {
                let Ok(frame) = slot.frame.frame() else {
                    self.statistics.malformed += 1;
                    continue;
                };
                self.statistics.received += 1;
                return Ok(Some(Received { frame, timestamp_ns: slot.timestamp_ns() }));
            };
            self.reports.note(error);
            if error.is_bus_off() {
                return Err(BusError::BusOff { interface: self.interface.clone() });
            }
        }
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        self.socket()?;
        if self.has_frame() {
            return Ok(true);
        }
        let mut remaining = timeout;
        let mut deadline = None;
        loop {
            self.incoming.take_last();
            let slept = self.sleep(remaining)?;
            if self.has_frame() {
                return Ok(true);
            }
            // The sleep states the time that has passed for certain, so that a wait that nothing came in ends here
            // without a look at the clock.
            if slept >= remaining {
                return Ok(false);
            }
            // Most waits have ended before this, and on some machines each look at the clock is a system call.
            remaining = deadline.get_or_insert_with(|| Deadline::after(remaining - slept)).remaining();
        }
    }

    fn set_filters(&mut self, filters: &[Filter]) -> Result<(), BusError> {
        let socket = self.socket()?;
        let outcome = if filters.is_empty() {
            socket.set_filter_accept_all()
        } else {
            socket.set_filters(&filters.iter().map(filter).collect::<Vec<CanFilter>>())
        };
        outcome.map_err(|source| self.failure("setting the receive filters", source))
    }

    fn check_fd(&self) -> Result<(), BusError> {
        match interface::mtu(&self.interface) {
            Some(..CAN_FD_MTU) => Err(BusError::FdNotEnabled { interface: self.interface.clone() }),
            Some(_) | None => Ok(()),
        }
    }

    fn statistics(&self) -> Statistics {
        // That the kernel answers was checked when the socket was opened.
        let dropped = self.socket.as_ref().and_then(|socket| drops(socket).ok()).unwrap_or(self.statistics.dropped);
        Statistics { dropped, errors: self.reports.errors, ..self.statistics }
    }

    fn controller(&self) -> ControllerState {
        self.reports.state
    }

    /// The kernel sends what it has queued.
    fn close(&mut self) -> Result<(), BusError> {
        // The kernel's counter is lost with the socket, so it is read first.
        self.statistics.dropped = self.statistics().dropped;
        self.socket.take().map(drop).ok_or(BusError::Closed)
    }
}

/// Whether this kernel has SocketCAN raw sockets, loading the modules where it may.
///
/// # Errors
/// [`BusError::NoSocketCan`], or another [`BusError`] if a socket can't be opened for another reason.
pub fn supported() -> Result<(), BusError> {
    const ANY: &str = "any interface";
    match CanFdSocket::open_addr(&CanAddr::new(0)) {
        Ok(_) => Ok(()),
        Err(source) if matches!(source.raw_os_error(), Some(EAFNOSUPPORT | EPROTONOSUPPORT)) => {
            Err(BusError::NoSocketCan { source })
        }
        Err(source) => Err(os(ANY, "opening the socket", source)),
    }
}

/// Sets the options of the socket, and returns the buffers granted. An error comes with the action that failed.
fn configure(socket: &CanFdSocket, options: Options) -> Result<Options, (&'static str, io::Error)> {
    let stamps = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE | SOF_TIMESTAMPING_OPT_CMSG;
    sockopt::set_socket_timeout(socket, Timeout::Recv, Some(SLEEP)).map_err(|e| ("setting the timeout", e.into()))?;
    socket.set_timestamping(stamps).map_err(|e| ("asking for kernel timestamps", e))?;
    socket.set_error_filter(ASKED_FOR).map_err(|e| ("asking for error frames", e))?;
    drops(socket).map_err(|e| ("reading the count of lost frames", e))?;
    grant_buffers(socket, options).map_err(|e| ("setting the buffer sizes", e.into()))
}

/// Sets the buffer sizes, past the system's limits where the process may, and reads back the result. The kernel
/// doubles what it is given, for its own bookkeeping, and reports the double.
fn grant_buffers(socket: &CanFdSocket, options: Options) -> Result<Options, Errno> {
    // SO_RCVBUFFORCE goes beyond the system's limit, and needs CAP_NET_ADMIN; without it SO_RCVBUF grants what the
    // limit allows.
    if sockopt::set_socket_recv_buffer_size_force(socket, options.receive_buffer_bytes).is_err() {
        sockopt::set_socket_recv_buffer_size(socket, options.receive_buffer_bytes)?;
    }
    if sockopt::set_socket_send_buffer_size_force(socket, options.send_buffer_bytes).is_err() {
        sockopt::set_socket_send_buffer_size(socket, options.send_buffer_bytes)?;
    }
    Ok(Options {
        receive_buffer_bytes: sockopt::socket_recv_buffer_size(socket)? / 2,
        send_buffer_bytes: sockopt::socket_send_buffer_size(socket)? / 2,
    })
}

fn warn_if_less(interface: &str, which: &str, limit: &str, asked: usize, granted: usize) {
    if granted < asked {
        tracing::warn!(
            "{interface}: got {which} buffer of {granted} bytes, expected {asked}; raise the limit with `sudo sysctl net.core.{limit}={asked}`"
        );
    }
}

/// The frames that found the receive queue full, since the socket was opened.
fn drops(socket: &CanFdSocket) -> io::Result<u64> {
    let mut counters = [0; MEMINFO_BYTES];
    let len = socket.get_socket_option_bytes(SOL_SOCKET, SO_MEMINFO, &mut counters)?;
    drops_in(&counters[..len])
}

/// The same from the counters of `SO_MEMINFO`.
pub fn drops_in(counters: &[u8]) -> io::Result<u64> {
    let last = counters.chunks_exact(4).nth(DROPS).and_then(|bytes| bytes.try_into().ok());
    let count = last.map(u32::from_ne_bytes).ok_or_else(|| io::Error::from(io::ErrorKind::UnexpectedEof))?;
    Ok(u64::from(count))
}

fn missing(interface: &str) -> BusError {
    // Without /proc the list stays empty; the error is the same.
    BusError::InterfaceMissing { interface: interface.to_owned(), present: interfaces().unwrap_or_default() }
}

fn os(interface: &str, action: &'static str, source: io::Error) -> BusError {
    let interface = interface.to_owned();
    match source.kind() {
        io::ErrorKind::PermissionDenied => BusError::Permission { interface, action, source },
        _ => BusError::Os { interface, action, source },
    }
}
