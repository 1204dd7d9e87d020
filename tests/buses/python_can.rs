//! Buses through python-can: the contract on its `virtual` and `slcan` interfaces, its failures, and the Python it
//! needs.
//!
//! The tests open python-can as the program does (`VIRTUAL_ENV`, `.venv`, the interpreter built in); `slcan` runs over
//! pairs of pseudo-terminals that socat makes.

use std::cell::{Cell, RefCell};
use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use assert_no_alloc::assert_no_alloc;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use resonarm::bus::python_can::{Operation, PythonCan, PythonCanError, RECEIVE_QUEUE, TRANSMIT_QUEUE};
use resonarm::bus::{self, Bus, BusAddress, BusError, ControllerErrors, ControllerState, Sent};
use resonarm::protocol::{Frame, FrameFormat, Id};

use crate::contract::apart_from_overflow;
use crate::{Formats, contract};

/// Longer than a busy machine keeps a thread of python-can's from its turn; no test waits so long unless it fails.
const PATIENCE: Duration = Duration::from_secs(30);
/// The keyword arguments that [`the_environment_decides`] opens when another test runs it in a process of its own.
const CHILD: &str = "RESONARM_TEST_PYTHON_CAN";

/// Opens `interface=…,channel=…`.
fn open(options: &str) -> Result<PythonCan, BusError> {
    let pairs = options.split(',').filter_map(|pair| pair.split_once('='));
    PythonCan::open(&pairs.map(|(key, value)| (key.to_string(), value.to_string())).collect::<Vec<_>>())
}

fn virtual_end(channel: &str) -> PythonCan {
    open(&format!("interface=virtual,channel={channel}")).unwrap()
}

fn frame(number: u32) -> Frame {
    Frame::classic(Id::Standard(0x123), &number.to_le_bytes()).unwrap()
}

/// A bus of python-can itself, outside the bridge.
fn foreign_end<'py>(py: Python<'py>, channel: &str, rx_queue_size: u32) -> Bound<'py, PyAny> {
    let arguments = PyDict::new(py);
    arguments.set_item("interface", "virtual").unwrap();
    arguments.set_item("channel", channel).unwrap();
    arguments.set_item("rx_queue_size", rx_queue_size).unwrap();
    py.import("can").unwrap().getattr("Bus").unwrap().call((), Some(&arguments)).unwrap()
}

/// Two pseudo-terminals, joined as a null modem joins two serial ports.
struct NullModem {
    socat: Child,
    directory: tempfile::TempDir,
}

impl NullModem {
    fn new() -> NullModem {
        let directory = tempfile::tempdir().unwrap();
        let end = |name| format!("pty,raw,echo=0,link={}", directory.path().join(name).display());
        let mut socat = Command::new("socat")
            .args(["-d", "-d", &end("a"), &end("b")])
            .stderr(Stdio::piped())
            .spawn()
            .expect("these tests need socat: apt-get install socat");
        let mut lines = BufReader::new(socat.stderr.take().unwrap()).lines();
        // socat says so once both links exist. Before, a port could not be opened.
        assert!(lines.any(|line| line.unwrap().contains("starting data transfer loop")), "socat ended");
        NullModem { socat, directory }
    }

    /// The path of one end, `a` or `b`.
    fn port(&self, name: &str) -> String {
        self.directory.path().join(name).display().to_string()
    }

    fn end(&self, name: &str) -> PythonCan {
        open(&format!("interface=slcan,channel={},bitrate=1000000,sleep_after_open=0.0", self.port(name))).unwrap()
    }
}

impl Drop for NullModem {
    fn drop(&mut self) {
        let _ = self.socat.kill();
        let _ = self.socat.wait();
    }
}

#[test]
fn virtual_keeps_the_contract() {
    let pairs = Cell::new(0);
    let make = || {
        let channel = format!("contract {}", pairs.replace(pairs.get() + 1));
        let address: BusAddress = format!("python-can:interface=virtual,channel={channel}").parse().unwrap();
        let end = || bus::open(&address).unwrap();
        (end(), end())
    };
    contract(make, Formats::All, || 0);
}

#[test]
fn slcan_keeps_the_contract() {
    let modems = RefCell::new(Vec::new());
    let make = || {
        let modem = NullModem::new();
        let end = |name| Box::new(modem.end(name)) as Box<dyn Bus>;
        let pair = (end("a"), end("b"));
        modems.borrow_mut().push(modem);
        pair
    };
    contract(make, Formats::All, || 0);
}

/// The same where the caller does the work, from the first frame on. The driver's own queue is all there is, and has no
/// end.
#[test]
fn virtual_keeps_the_contract_on_the_caller() {
    let pairs = Cell::new(0);
    let make = || {
        let channel = format!("contract on the caller {}", pairs.replace(pairs.get() + 1));
        let end = || {
            let mut end = Box::new(virtual_end(&channel)) as Box<dyn Bus>;
            end.work_on_caller().unwrap();
            end
        };
        (end(), end())
    };
    apart_from_overflow(&make, Formats::All);
}

/// What the threads have taken in comes out before what comes later, in order, and the driver is left as it was.
#[test]
fn the_caller_continues_where_the_threads_were() {
    let (mut near, mut far) = (virtual_end("taken over"), virtual_end("taken over"));
    let send = |near: &mut PythonCan, numbers: core::ops::Range<u32>| {
        numbers.for_each(|number| assert_eq!(near.send(&frame(number)).unwrap(), Sent::Queued));
    };
    send(&mut near, 0..5);
    assert!(far.wait(PATIENCE).unwrap());
    near.work_on_caller().unwrap();
    send(&mut near, 5..8);
    far.work_on_caller().unwrap();
    far.work_on_caller().unwrap();
    send(&mut near, 8..10);
    for number in 0..10 {
        assert!(far.wait(PATIENCE).unwrap());
        assert_eq!(far.receive().unwrap().unwrap().frame, frame(number));
    }
    assert_eq!(far.receive().unwrap(), None);
    assert_eq!((near.statistics().sent, far.statistics().received), (10, 10));
    // A timeout of centuries is no error of the driver's.
    send(&mut far, 0..1);
    assert!(near.wait(Duration::MAX).unwrap());
    near.close().unwrap();
    assert!(matches!(near.work_on_caller(), Err(BusError::Closed)));
}

#[test]
fn an_unplugged_adapter_is_an_error_on_the_caller() {
    let modem = NullModem::new();
    let mut near = modem.end("a");
    near.work_on_caller().unwrap();
    drop(modem);
    let error = near.wait(PATIENCE).unwrap_err().to_string();
    assert!(error.starts_with("python-can could not receive: "), "{error}");
}

#[test]
fn carries_every_field_of_a_frame() {
    let (mut near, mut far) = (virtual_end("fields"), virtual_end("fields"));
    let fd = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: true };
    let frames = [
        Frame::new(Id::Standard(0x7FF), FrameFormat::Classic, &[1, 2, 3]),
        Frame::new(Id::Extended(0x7FF), FrameFormat::Classic, &[]),
        Frame::new(Id::Extended(0x1FFF_FFFF), FrameFormat::Remote, &[0; 8]),
        Frame::new(Id::Standard(0), fd, &[0xA5; 64]),
    ];
    for frame in frames.map(Result::unwrap) {
        near.send(&frame).unwrap();
        assert!(far.wait(PATIENCE).unwrap());
        let received = far.receive().unwrap().unwrap();
        assert_eq!(received.frame, frame);
        // A time since 1970: the clock of an adapter that counts from its own start would be far below.
        let year_2024_ns = 1_704_067_200_000_000_000;
        assert!(received.timestamp_ns > Some(year_2024_ns), "{:?}", received.timestamp_ns);
    }
}

#[test]
fn sends_and_receives_without_allocating() {
    let (mut near, mut far) = (virtual_end("allocation"), virtual_end("allocation"));
    let frame = frame(1);
    // Only these calls are those of a loop in real time. The threads behind the queues allocate with every message of
    // Python.
    let sent = assert_no_alloc(|| near.send(&frame).ok());
    assert_eq!(sent, Some(Sent::Queued));
    assert!(far.wait(PATIENCE).unwrap());
    let received = assert_no_alloc(|| [far.receive().ok().flatten(), far.receive().ok().flatten()]);
    assert_eq!(received.map(|received| received.map(|received| received.frame)), [Some(frame), None]);
}

/// The dispositions of a process as Linux shows them: bit n − 1 of a mask stands for signal n. In a child that begins
/// with the default: a shell lets what it runs in the background ignore the signal.
#[test]
fn leaves_ctrl_c_alone() {
    const SIGINT: u32 = 2;
    const CHILD: &str = "RESONARM_TEST_CTRL_C";
    if std::env::var_os(CHILD).is_none() {
        let mut child = Command::new("env");
        child.arg("--default-signal=INT").arg(std::env::current_exe().unwrap());
        let output = child.args(["--exact", "python_can::leaves_ctrl_c_alone"]).env(CHILD, "1").output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
        return;
    }
    let _bus = virtual_end("signals");
    let status = fs::read_to_string("/proc/self/status").unwrap();
    for mask in ["SigCgt:", "SigIgn:"] {
        let bits = status.lines().find_map(|line| line.strip_prefix(mask)).unwrap();
        assert_eq!(u64::from_str_radix(bits.trim(), 16).unwrap() >> (SIGINT - 1) & 1, 0, "{mask}{bits}");
    }
}

/// Sends messages of python-can with this identifier, each with the value of its `is_error_frame`.
fn send_from_outside(channel: &str, arbitration_id: u32, is_error_frame: &[bool]) {
    Python::attach(|py| {
        let foreign = foreign_end(py, channel, 0);
        for is_error_frame in is_error_frame {
            let arguments = PyDict::new(py);
            arguments.set_item("arbitration_id", arbitration_id).unwrap();
            arguments.set_item("is_error_frame", is_error_frame).unwrap();
            let message = py.import("can").unwrap().getattr("Message").unwrap().call((), Some(&arguments)).unwrap();
            foreign.call_method1("send", (message,)).unwrap();
        }
        foreign.call_method0("shutdown").unwrap();
    });
}

/// On the threads, and on the caller. The identifier is the class of bus-off, to Linux.
#[test]
fn error_frames_of_unknown_meaning_are_counted() {
    const ID: u32 = 0x40;
    let mut idle = virtual_end("idle");
    for (channel, on_caller) in [("error frames", false), ("error frames on the caller", true)] {
        let mut bus = virtual_end(channel);
        if on_caller {
            bus.work_on_caller().unwrap();
        }
        send_from_outside(channel, ID, &[true, false, true, false, true]);
        let expected = Some(Frame::classic(Id::Extended(ID), &[]).unwrap());
        assert!(bus.wait(PATIENCE).unwrap());
        assert_eq!(
            (bus.receive().unwrap().map(|received| received.frame), bus.statistics().errors.other),
            (expected, 1)
        );
        // Without a wait, as a loop in real time asks; the bridge's thread may not have had its turn.
        let tries = if on_caller { 1 } else { PATIENCE.as_millis() };
        let next = (0..tries).find_map(|_| {
            assert!(!idle.wait(Duration::from_millis(1)).unwrap());
            bus.receive().unwrap()
        });
        assert_eq!(next.map(|received| received.frame), expected);
        assert!(!bus.wait(Duration::from_millis(100)).unwrap(), "what is counted alone is not waited for");
        let statistics = bus.statistics();
        assert_eq!((statistics.received, statistics.dropped, bus.discarded()), (2, 0, 0));
        assert_eq!(bus.controller(), ControllerState::Active);
        if on_caller {
            assert_eq!(statistics.errors, ControllerErrors { other: 3, ..ControllerErrors::default() });
        }
    }
}

/// An identifier too long for its format, which only `check=True` would refuse there.
#[test]
fn messages_that_are_no_frame_are_left_out_and_hide_nothing() {
    let mut bus = virtual_end("no frames");
    bus.work_on_caller().unwrap();
    send_from_outside("no frames", 0x2000_0000, &[false, false]);
    send_from_outside("no frames", 0x40, &[false]);
    let received = bus.receive().unwrap().map(|received| received.frame);
    assert_eq!(received, Some(Frame::classic(Id::Extended(0x40), &[]).unwrap()));
    assert_eq!((bus.discarded(), bus.statistics().received), (2, 1));
}

#[test]
fn keeps_the_oldest_frames_and_counts_the_rest() {
    const EXCESS: usize = 10;
    let (mut near, mut far) = (virtual_end("overflow"), virtual_end("overflow"));
    for number in 0..(RECEIVE_QUEUE + EXCESS) as u32 {
        while near.send(&frame(number)).unwrap() == Sent::QueueFull {
            near.wait(Duration::from_millis(1)).unwrap();
        }
    }
    // The last frames are counted once the bridge's thread has had its turn, which a busy machine may put off.
    let turns = (0..PATIENCE.as_millis()).take_while(|_| far.statistics().dropped < EXCESS as u64);
    turns.for_each(|_| _ = near.wait(Duration::from_millis(1)).unwrap());
    let kept: Vec<Frame> = std::iter::from_fn(|| far.receive().unwrap()).map(|received| received.frame).collect();
    assert_eq!(kept, (0..RECEIVE_QUEUE as u32).map(frame).collect::<Vec<_>>());
    assert_eq!(far.statistics().dropped, EXCESS as u64);
}

/// The driver takes a few frames and then blocks in `send`, as it does on a serial port whose other end stopped
/// reading.
#[test]
fn a_blocked_driver_blocks_nobody_here() {
    let mut bus = virtual_end("blocked");
    // The `virtual` interface blocks a sender while the queue of a receiver is full, here of two messages.
    let foreign = Python::attach(|py| foreign_end(py, "blocked", 2).unbind());
    let outcomes: Vec<Sent> = (0..3 * TRANSMIT_QUEUE as u32).map(|k| bus.send(&frame(k)).unwrap()).collect();
    assert_eq!(outcomes.last(), Some(&Sent::QueueFull));
    assert_eq!(bus.receive().unwrap(), None);
    let stuck = bus.close().unwrap_err();
    let BusError::PythonCan(reason) = &stuck else { panic!("{stuck:?}") };
    let reason = reason.downcast_ref::<PythonCanError>();
    assert!(matches!(reason, Some(PythonCanError::Stuck { operation: Operation::Close, .. })), "{reason:?}");
    insta::assert_snapshot!(stuck, @"python-can did not close the bus within 3 s: the driver does not return; unplug the adapter or end this program");
    // Read everything, so that the blocked thread gets out before this process ends.
    Python::attach(|py| {
        while !foreign.call_method1(py, "recv", (0.2,)).unwrap().is_none(py) {}
        foreign.call_method0(py, "shutdown").unwrap();
    });
}

#[test]
fn an_unplugged_adapter_is_an_error_of_the_next_call() {
    let mut modem = NullModem::new();
    let mut bus = modem.end("a");
    assert_eq!(bus.receive().unwrap(), None);
    modem.socat.kill().unwrap();
    modem.socat.wait().unwrap();
    let lost = bus.wait(PATIENCE).unwrap_err();
    // Linux tells a hang-up in either of two ways, by a failed or by an empty read.
    let expected = "python-can could not receive: CanOperationError: Could not read from serial device (from ";
    assert!(lost.to_string().starts_with(expected), "{lost}");
    // python-can's slcan sends a closing command when it shuts down, and the line is gone.
    let error = bus.close().unwrap_err();
    insta::assert_snapshot!(error, @"python-can could not close the bus: CanOperationError: Could not write to serial device (from SerialException: write failed: [Errno 5] Input/output error)");
    assert!(matches!(bus.receive(), Err(BusError::Closed)));
}

#[test]
fn refuses_what_python_can_does_not_know() {
    let message = |options: &str| open(options).err().map(|error| error.to_string()).unwrap_or_default();
    let unknown = message("interface=slacn,channel=/dev/ttyACM0");
    assert!(unknown.starts_with("python-can 4"), "{unknown}");
    assert!(unknown.contains("has no interface `slacn`; expected one of "), "{unknown}");
    assert!(unknown.contains(", slcan, socketcan, "), "{unknown}");
    insta::assert_snapshot!(message("channel=0"), @"python-can option `interface`: missing; name the adapter, for example interface=slcan,channel=/dev/ttyACM0");
    insta::assert_snapshot!(message("interface=slcan,channel=/nonexistent"), @"python-can could not open the bus: CanInitializationError: [Errno 2] could not open port /nonexistent: [Errno 2] No such file or directory: '/nonexistent'");
    let modem = NullModem::new();
    let rate = message(&format!("interface=slcan,channel={},bitrate=1,sleep_after_open=0.0", modem.port("a")));
    let expected = "python-can could not open the bus: CanInitializationError: Invalid bitrate, choose one of ";
    assert!(rate.starts_with(expected), "{rate}");
}

/// What became of [`the_environment_decides`] in a process of its own.
fn outcome(directory: &Path, environment: &[(&str, &Path)]) -> String {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "python_can::the_environment_decides", "--nocapture"]).current_dir(directory);
    command.env_remove("VIRTUAL_ENV").env(CHILD, "interface=virtual,channel=child");
    let output = command.envs(environment.iter().copied()).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let line = text.lines().find_map(|line| line.split_once("outcome: ").map(|(_, outcome)| outcome.to_string()));
    line.unwrap_or_else(|| panic!("no outcome in {text}{}", String::from_utf8_lossy(&output.stderr)))
}

/// Opens the virtual bus in the environment of this process; the tests below run it as a child in environments of
/// theirs.
#[test]
fn the_environment_decides() {
    match std::env::var(CHILD) {
        Ok(options) => {
            println!("outcome: {}", open(&options).map(|_| "open".to_string()).unwrap_or_else(|e| e.to_string()))
        }
        Err(_) => open("interface=virtual,channel=child").unwrap().close().unwrap(),
    }
}

/// The major and minor version and the installation directory of the embedded interpreter.
fn embedded() -> (String, String) {
    Python::attach(|py| {
        let info = py.version_info();
        let prefix = py.import("sys").unwrap().getattr("base_exec_prefix").unwrap().extract().unwrap();
        (format!("{}.{}", info.major, info.minor), prefix)
    })
}

/// An environment without a single package.
fn empty_environment(path: &Path, version: &str) {
    fs::create_dir_all(path.join(format!("lib/python{version}/site-packages"))).unwrap();
    fs::write(path.join("pyvenv.cfg"), format!("version = {version}.0\n")).unwrap();
}

#[test]
fn finds_the_environment_beside_the_working_directory_and_an_active_one() {
    let directory = tempfile::tempdir().unwrap();
    let environment = directory.path().join(".venv");
    open("interface=virtual,channel=packages").unwrap().close().unwrap();
    let (version, prefix) = embedded();
    empty_environment(&environment, &version);
    let packages = environment.join(format!("lib/python{version}/site-packages"));
    // The packages that this process uses.
    let can: String = Python::attach(|py| py.import("can").unwrap().getattr("__file__").unwrap().extract().unwrap());
    // The module is `site-packages/can/__init__.py`, so the packages are two folders above the file.
    for package in fs::read_dir(Path::new(&can).ancestors().nth(2).unwrap()).unwrap().map(Result::unwrap) {
        symlink(package.path(), packages.join(package.file_name())).unwrap();
    }
    let below = directory.path().join("below");
    fs::create_dir(&below).unwrap();
    assert_eq!(outcome(&below, &[]), "open");
    // Python finds its environment by itself when the first `python3` on PATH is a link in one.
    let programs = environment.join("bin");
    fs::create_dir(&programs).unwrap();
    symlink(format!("{prefix}/bin/python{version}"), programs.join("python3")).unwrap();
    fs::write(environment.join("pyvenv.cfg"), format!("home = {prefix}/bin\nversion = {version}.0\n")).unwrap();
    assert_eq!(outcome(&below, &[("PATH", &programs), ("VIRTUAL_ENV", &environment)]), "open");
}

#[test]
fn says_which_command_installs_python_can() {
    let directory = tempfile::tempdir().unwrap();
    let environment = directory.path().join("environment");
    let (version, _) = embedded();
    empty_environment(&environment, &version);
    let text = outcome(directory.path(), &[("VIRTUAL_ENV", &environment)]);
    // The release that the tests run with may be any, so its numbers are left out of the text.
    let patch = Python::attach(|py| py.version_info().patch);
    let advice =
        text.replace(&environment.display().to_string(), "ENV").replace(&format!("{version}.{patch}"), "X.Y.Z");
    insta::assert_snapshot!(advice, @"python-can is not installed in the virtual environment `ENV` (Python X.Y.Z); install it with `ENV/bin/python3 -m pip install python-can`");
}

#[test]
fn says_both_versions() {
    let directory = tempfile::tempdir().unwrap();
    let environment = directory.path().join("environment");
    // No interpreter of today can be of this version, so it differs from the embedded one on every machine.
    empty_environment(&environment, "2.7");
    let (version, prefix) = embedded();
    let text = outcome(directory.path(), &[("VIRTUAL_ENV", &environment)]);
    let text =
        text.replace(&environment.display().to_string(), "ENV").replace(&prefix, "PREFIX").replace(&version, "X.Y");
    insta::assert_snapshot!(text, @"the virtual environment `ENV` is for Python 2.7, but this program embeds Python X.Y; make one with `PREFIX/bin/pythonX.Y -m venv DIRECTORY` and set VIRTUAL_ENV to it, or build again with PYO3_PYTHON=ENV/bin/python3");
}
