//! Effects on the node under test outside the bus: error frames on its interface, and signals to its process.

use std::fs;
use std::io;

use rustix::process::{Pid, Signal, kill_process};
use socketcan::{CanErrorFrame, CanSocket, Socket, SocketOptions};

/// The classes of error frames (`linux/can/error.h`).
const BUS_OFF: u32 = libc::CAN_ERR_BUSOFF;
const RESTARTED: u32 = libc::CAN_ERR_RESTARTED;

/// Sends on a virtual interface the error frames of a controller that goes bus-off and is restarted. Every program on
/// the interface that asks for error frames receives them.
#[derive(Debug)]
pub(super) struct Controller {
    socket: CanSocket,
    /// Time at which the node is to be restarted, ns, if it is off.
    pub on_at_ns: Option<u64>,
}

impl Controller {
    /// The controller of a virtual interface: a real one's driver doesn't loop error frames back, and may send them.
    pub fn of(interface: &str) -> Option<Controller> {
        let device = fs::canonicalize(format!("/sys/class/net/{interface}")).ok()?;
        // sysfs links an interface to its device; those without hardware are below this folder.
        let is_virtual = device.starts_with("/sys/devices/virtual");
        let socket = is_virtual.then(|| CanSocket::open(interface).ok()).flatten()?;
        // It receives nothing, so that its queue stays empty.
        socket.set_filter_drop_all().ok()?;
        Some(Controller { socket, on_at_ns: None })
    }

    pub fn go_off(&mut self, until_ns: u64) -> io::Result<()> {
        self.send_error_frame(BUS_OFF)?;
        self.on_at_ns = Some(until_ns);
        Ok(())
    }

    pub fn restart(&mut self) -> io::Result<()> {
        // Cleared first, so that an interface that fails is not tried again and again.
        self.on_at_ns = None;
        self.send_error_frame(RESTARTED)
    }

    fn send_error_frame(&self, class: u32) -> io::Result<()> {
        let frame = CanErrorFrame::new_error(class, &[]).map_err(io::Error::other)?;
        self.socket.write_frame(&frame)
    }
}

/// A process of this machine, which resumes at the latest when this is dropped.
#[derive(Debug)]
pub(super) struct Process {
    pid: Pid,
    /// Time at which the process is to resume, ns, if it is stopped.
    pub resumes_at_ns: Option<u64>,
}

impl Process {
    pub fn new(pid: Pid) -> Process {
        Process { pid, resumes_at_ns: None }
    }

    pub fn stop(&mut self, until_ns: u64) -> io::Result<()> {
        kill_process(self.pid, Signal::STOP)?;
        self.resumes_at_ns = Some(until_ns);
        Ok(())
    }

    pub fn resume(&mut self) -> io::Result<()> {
        self.resumes_at_ns = None;
        Ok(kill_process(self.pid, Signal::CONT)?)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if self.resumes_at_ns.is_some() {
            // It may have ended meanwhile.
            drop(self.resume());
        }
    }
}
