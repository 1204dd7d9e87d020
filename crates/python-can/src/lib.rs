//! Any CAN adapter that the Python package python-can knows, through an embedded interpreter (feature `python-can`).
//!
//! Two bridge threads hold the Python side; between them and the caller are bounded queues, so that the methods of
//! [`Bus`] never meet the interpreter's lock. A frame takes tens of microseconds each way; use a native backend where
//! there is one. A caller that is no real-time thread can do without the threads: [`Bus::work_on_caller`].
//!
//! **Error frames** of `socketcan` and `gs_usb` mean the same as in [`resonarm_bus::socketcan`], and are counted alike;
//! bus-off comes out of [`Bus::receive`]. What those of another interface say is its maker's: they are counted as
//! [`ControllerErrors::other`](resonarm_bus::ControllerErrors::other). Where python-can itself has to filter, because
//! the adapter can't ([`Bus::set_filters`]), it compares their identifiers, too. `can.BusABC.state` is not asked: no
//! interface of python-can 4.6 that hands over error frames keeps it up to date, and its PASSIVE is that of a listener
//! for most.
//!
//! Frames lost before python-can has them are counted in [`Statistics::dropped`] if they met a full receive queue in
//! the kernel of its `socketcan`; no other driver of python-can reports losses.

mod bridge;
mod direct;
mod discovery;
mod error;
mod message;
mod options;
mod signals;

use core::sync::atomic::Ordering;
use core::time::Duration;
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle, Thread};

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyModule};
use resonarm_protocol::Frame;
use rtrb::{Consumer, Producer, RingBuffer};

use bridge::{ATTEMPTS_WHEN_CLOSING, Driver, FilterRequest, Receiver, Sender, Shared, kernel_drops};
use direct::Direct;
pub use discovery::would_load;
use error::exception;
pub use error::{Operation, PythonCanError};
use message::{ErrorFrames, Incoming};
use options::Options;
use resonarm_bus::socketcan::ControllerReports;
use resonarm_bus::{Bus, BusAddress, BusError, ControllerState, Filter, Received, Sent, Statistics};

/// Frames and error frames that wait to be received at most; what comes in beyond is lost and counted in
/// [`Statistics::dropped`].
pub const RECEIVE_QUEUE: usize = 1024;
/// Frames that wait to be sent at most; beyond, [`Bus::send`] answers [`Sent::QueueFull`].
pub const TRANSMIT_QUEUE: usize = 1024;
/// Failures kept for the caller; the first ones are kept.
const FAILURE_QUEUE: usize = 16;
/// The interface of python-can to the CAN interfaces of the kernel.
const SOCKETCAN: &str = "socketcan";
/// The interface of python-can that carries CAN FD frames whatever it says.
const VIRTUAL: &str = "virtual";
/// Time that [`Bus::close`] and [`Bus::set_filters`] wait for the driver.
const PATIENCE: Duration = Duration::from_secs(3);

/// One end of a bus behind a python-can interface.
///
/// An exception raised while sending or receiving comes out of the next [`Bus::send`], [`Bus::receive`] or
/// [`Bus::wait`], once; a frame that could not be sent is lost with it. The bridge keeps running; the caller decides
/// whether to continue.
pub struct PythonCan {
    name: String,
    outgoing: Producer<Frame>,
    /// The name of its controller in messages.
    controller: String,
    reports: ControllerReports,
    incoming: Consumer<Incoming>,
    failures: [Consumer<PythonCanError>; 2],
    requests: mpsc::Sender<FilterRequest>,
    shared: Arc<Shared>,
    sender: Thread,
    receiver: Option<JoinHandle<()>>,
    outcome: mpsc::Receiver<Result<(), PythonCanError>>,
    statistics: Statistics,
    /// The interface of python-can, if it was opened for classical frames only.
    classic_interface: Option<String>,
    /// Objects that the threads work with, to be handed to the caller; `None` once it has them, or after the end.
    spare: Option<Direct>,
    /// The bus on the calling thread, once it works there.
    direct: Option<Direct>,
}

impl PythonCan {
    /// Opens `can.Bus(interface=…, channel=…, …)`. `options` are its keyword arguments: `interface` is required,
    /// `channel` stays text, every other value is read as in python-can's configuration files (integer, float, `true`,
    /// `false`, otherwise text). python-can adds the values of its configuration files and environment variables.
    /// Blocks until the driver has opened the adapter (`slcan` waits two seconds without `sleep_after_open=0.0`).
    ///
    /// python-can is looked for in VIRTUAL_ENV, otherwise in a `.venv` in the working directory or above it, otherwise
    /// in the interpreter this program was built with. Ctrl-C stays with this program: no signal handler of Python is
    /// installed.
    ///
    /// # Errors
    /// [`BusError::PythonCan`] with every variant of [`PythonCanError`] except [`PythonCanError::Stuck`].
    pub fn open(options: &[(String, String)]) -> Result<PythonCan, BusError> {
        let name = BusAddress::PythonCan(options.to_vec()).to_string();
        let options = Options::parse(options)?;
        start_python()?;
        let driver = Python::attach(|py| open_bus(py, &options))?;
        let is_classic = Python::attach(|py| is_classic(driver.bus.bind(py))) && options.interface != VIRTUAL;
        let mut bus = PythonCan::start(driver)?;
        let controller = options.channel.filter(|_| options.interface == SOCKETCAN);
        bus.controller = controller.unwrap_or_else(|| name.clone());
        bus.classic_interface = is_classic.then_some(options.interface);
        bus.name = name;
        Ok(bus)
    }

    /// Starts the bridge threads on an open python-can bus.
    fn start(driver: Driver) -> Result<PythonCan, PythonCanError> {
        let driver = Arc::new(driver);
        let shared = Arc::new(Shared::default());
        let (outgoing, to_send) = RingBuffer::new(TRANSMIT_QUEUE);
        let (came_in, incoming) = RingBuffer::new(RECEIVE_QUEUE);
        // A ring has one producer, so each thread has its own.
        let (send_failed, send_failures) = RingBuffer::new(FAILURE_QUEUE);
        let (receive_failed, receive_failures) = RingBuffer::new(FAILURE_QUEUE);
        let (requests, requested) = mpsc::channel();
        // Joining a thread has no time limit, and a driver may hang in a call. A channel can be waited on for a
        // limited time.
        let (ended, outcome) = mpsc::sync_channel(1);
        // Made with the threads and used only after their end: two threads must not be in the driver at once.
        let spare = Direct { driver: Arc::clone(&driver), shared: Arc::clone(&shared), came_in: None };
        let sender = Sender {
            driver: Arc::clone(&driver),
            outgoing: to_send,
            failures: send_failed,
            shared: Arc::clone(&shared),
            attempts: ATTEMPTS_WHEN_CLOSING,
        };
        let receiver = Receiver {
            driver,
            incoming: came_in,
            failures: receive_failed,
            requests: requested,
            shared: Arc::clone(&shared),
        };
        let sender = spawn("python-can-tx", move || sender.run())?;
        let sender_thread = sender.thread().clone();
        let receiver = spawn("python-can-rx", move || {
            let _ = ended.send(receiver.run(sender));
        });
        // Without the second thread nobody would end the first.
        let receiver = receiver.inspect_err(|_| {
            shared.closing.store(true, Ordering::Release);
            sender_thread.unpark();
        })?;
        Ok(PythonCan {
            name: String::from("python-can"),
            controller: String::from("python-can"),
            reports: ControllerReports::default(),
            outgoing,
            incoming,
            failures: [send_failures, receive_failures],
            requests,
            shared,
            sender: sender_thread,
            receiver: Some(receiver),
            outcome,
            statistics: Statistics::default(),
            classic_interface: None,
            spare: Some(spare),
            direct: None,
        })
    }

    /// Messages left out so far: those that ISO 11898-1 has no frame for.
    pub fn discarded(&self) -> u64 {
        self.shared.discarded.load(Ordering::Relaxed)
    }

    fn check_open(&self) -> Result<(), BusError> {
        if self.receiver.is_some() || self.direct.is_some() { Ok(()) } else { Err(BusError::Closed) }
    }

    /// Ends both threads; `operation` is what they end for.
    fn end_threads(&mut self, operation: Operation) -> Result<(), BusError> {
        let receiver = self.receiver.take().ok_or(BusError::Closed)?;
        self.shared.closing.store(true, Ordering::Release);
        self.sender.unpark();
        let Ok(outcome) = self.outcome.recv_timeout(PATIENCE) else {
            return Err(PythonCanError::Stuck { operation, waited: PATIENCE }.into());
        };
        // The thread ends after its outcome, and can't panic on the way.
        let _ = receiver.join();
        Ok(outcome?)
    }

    /// Whether the threads took in a frame that [`Bus::receive`] gives out. Error frames before it are counted.
    fn has_incoming(incoming: &mut Consumer<Incoming>, reports: &mut ControllerReports) -> bool {
        while let Ok(next) = incoming.peek() {
            if next.is_given_out() {
                return true;
            }
            next.note(reports);
            let _ = incoming.pop();
        }
        false
    }

    /// Returns the oldest failure not yet reported.
    fn check_failures(&mut self) -> Result<(), BusError> {
        let oldest = self.failures.iter_mut().find_map(|failures| failures.pop().ok());
        oldest.map_or(Ok(()), |failure| Err(failure.into()))
    }
}

impl Bus for PythonCan {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.check_open()?;
        self.check_failures()?;
        if let Some(direct) = &self.direct {
            let sent = direct.send(frame)?;
            match sent {
                Sent::Queued => self.statistics.sent += 1,
                Sent::QueueFull => self.statistics.queue_full += 1,
            }
            return Ok(sent);
        }
        if self.outgoing.push(*frame).is_err() {
            self.statistics.queue_full += 1;
            return Ok(Sent::QueueFull);
        }
        self.statistics.sent += 1;
        self.sender.unpark();
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        self.check_open()?;
        loop {
            // Frames that the threads have taken in come first.
            let next = match (self.incoming.pop(), &mut self.direct) {
                (Ok(incoming), _) => Some(incoming),
                (Err(_), Some(direct)) => direct.receive()?,
                (Err(_), None) => None,
            };
            let Some(next) = next else { return self.check_failures().map(|()| None) };
            next.note(&mut self.reports);
            // In its place among the frames, so that the caller knows which frames came before the controller left the
            // bus.
            if next.is_bus_off() {
                return Err(BusError::BusOff { interface: self.controller.clone() });
            }
            if let Incoming::Frame(received) = next {
                self.statistics.received += 1;
                return Ok(Some(received));
            }
        }
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        self.check_open()?;
        let PythonCan { incoming, reports, failures, shared, direct, .. } = self;
        if PythonCan::has_incoming(incoming, reports) {
            return Ok(true);
        }
        if let Some(direct) = direct {
            return Ok(direct.wait(timeout, reports)?);
        }
        let is_idle = || !PythonCan::has_incoming(incoming, reports) && failures.iter().all(Consumer::is_empty);
        shared.wait_while(timeout, is_idle);
        if PythonCan::has_incoming(incoming, reports) {
            return Ok(true);
        }
        self.check_failures().map(|()| false)
    }

    fn set_filters(&mut self, filters: &[Filter]) -> Result<(), BusError> {
        self.check_open()?;
        if let Some(direct) = &self.direct {
            return Ok(direct.set_filters(filters)?);
        }
        let stuck = PythonCanError::Stuck { operation: Operation::SetFilters, waited: PATIENCE };
        let (reply, answer) = mpsc::sync_channel(1);
        let asked = self.requests.send(FilterRequest { filters: filters.to_vec(), reply });
        match asked.map(|()| answer.recv_timeout(PATIENCE)) {
            Ok(Ok(outcome)) => Ok(outcome?),
            // Either no answer comes in time, or the thread that would give it has ended.
            Ok(Err(_)) | Err(_) => Err(stuck.into()),
        }
    }

    fn statistics(&self) -> Statistics {
        if let Some(direct) = &self.direct {
            direct.count_drops();
        }
        Statistics { dropped: self.shared.dropped(), errors: self.reports.errors, ..self.statistics }
    }

    fn controller(&self) -> ControllerState {
        self.reports.state
    }

    fn work_on_caller(&mut self) -> Result<(), BusError> {
        self.check_open()?;
        if self.direct.is_some() {
            return Ok(());
        }
        // Set before the threads end, or the receiver would shut the bus down.
        self.shared.keeps_open.store(true, Ordering::Release);
        self.end_threads(Operation::Receive)?;
        self.direct = self.spare.take();
        self.check_failures()
    }

    fn check_fd(&self) -> Result<(), BusError> {
        let classic = self.classic_interface.clone();
        classic.map_or(Ok(()), |interface| Err(PythonCanError::Classic { interface }.into()))
    }

    fn close(&mut self) -> Result<(), BusError> {
        match self.direct.take() {
            Some(direct) => direct.close()?,
            None => self.end_threads(Operation::Close)?,
        }
        self.check_failures()
    }
}

impl Drop for PythonCan {
    fn drop(&mut self) {
        // To see an error of closing, call `close`.
        let _ = self.close();
    }
}

fn spawn(name: &str, run: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, PythonCanError> {
    thread::Builder::new().name(name.to_string()).spawn(run).map_err(PythonCanError::Thread)
}

/// The release of the python-can that [`PythonCan::open`] would take, as "4.5.0". It is imported.
///
/// # Errors
/// [`PythonCanError`] as of [`PythonCan::open`]: python-can is missing, or the environment doesn't fit.
pub fn version() -> Result<String, PythonCanError> {
    start_python()?;
    Python::attach(|py| {
        let release = discovery::import_can(py)?.getattr("__version__").and_then(|version| version.extract());
        release.map_err(|error| exception(py, Operation::Import, error))
    })
}

fn start_python() -> Result<(), PythonCanError> {
    signals::start_python().map_err(|error| Python::attach(|py| exception(py, Operation::Import, error)))
}

/// Imports python-can and opens the bus.
fn open_bus(py: Python<'_>, options: &Options) -> Result<Driver, PythonCanError> {
    let can = discovery::import_can(py)?;
    check_interface(&can, &options.interface)?;
    let open = || -> PyResult<Driver> {
        let arguments = PyDict::new(py);
        for (key, value) in &options.rest {
            arguments.set_item(key, value)?;
        }
        arguments.set_item("interface", &options.interface)?;
        if let Some(channel) = &options.channel {
            arguments.set_item("channel", channel)?;
        }
        let bus = can.getattr("Bus")?.call((), Some(&arguments))?;
        let socket = if options.interface == SOCKETCAN { Some(bus.getattr("socket")?) } else { None };
        // Checked now that it reports its losses, since it is asked for them before each frame.
        socket.as_ref().map(kernel_drops).transpose()?;
        let message_class = can.getattr("Message")?.unbind();
        let error_frames = ErrorFrames::of(&options.interface);
        Ok(Driver { bus: bus.unbind(), message_class, socket: socket.map(Bound::unbind), error_frames })
    };
    open().map_err(|error| exception(py, Operation::Open, error))
}

/// Whether the bus says that it was opened for classical frames only (`can.BusABC.protocol`, from python-can 4.2 on).
fn is_classic(bus: &Bound<'_, PyAny>) -> bool {
    let protocol = bus.getattr("protocol").and_then(|protocol| protocol.getattr("name"));
    // Older releases have no such attribute. Their buses are not said to be classical.
    protocol.and_then(|name| name.extract::<String>()).is_ok_and(|name| name == "CAN_20")
}

/// `can.VALID_INTERFACES` holds the interfaces of python-can and of its installed plug-ins.
fn check_interface(can: &Bound<'_, PyModule>, interface: &str) -> Result<(), PythonCanError> {
    let names = || -> PyResult<(Vec<String>, String)> {
        let known =
            can.getattr("VALID_INTERFACES")?.try_iter()?.map(|name| name?.extract()).collect::<PyResult<_>>()?;
        Ok((known, can.getattr("__version__")?.extract()?))
    };
    let (mut known, version) = names().map_err(|error| exception(can.py(), Operation::Open, error))?;
    if known.iter().any(|name| name == interface) {
        return Ok(());
    }
    // python-can keeps them in a set, and the message should be the same every time.
    known.sort();
    Err(PythonCanError::UnknownInterface { interface: interface.to_string(), version, known: known.join(", ") })
}
